"""Floor plans: corridors, then rooms along both their sides, then doors and what is built in."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mcpseg_cli.errors import InputError
from mcpseg_cli.synth.building.corridors import draw_corridors, join_corridors
from mcpseg_cli.synth.building.fittings import fit_out
from mcpseg_cli.synth.building.spaces import Rectangle, Space, beyond, facing, overlaps
from mcpseg_cli.synth.plan import Opening, Room, RoomKind
from mcpseg_cli.synth.surfaces.styles import Style

_WIDTHS: dict[RoomKind, tuple[float, float]] = {
    "office": (2.6, 5.2),
    "conferenceRoom": (4.0, 8.0),
    "lounge": (4.0, 8.0),
    "storage": (2.5, 4.5),
    "openspace": (7.0, 11.5),
    "pantry": (2.6, 4.5),
    "copyRoom": (2.5, 4.0),
    "WC": (2.5, 4.5),
    "lobby": (6.0, 9.0),
    "hallway": (2.0, 2.0),
    "livingRoom": (3.5, 5.6),
    "diningRoom": (3.0, 4.4),
    "kitchen": (2.4, 4.0),
    "bedroom": (2.9, 4.4),
    "study": (2.4, 3.6),
    "bathroom": (1.9, 2.8),
    "classRoom": (6.0, 9.0),
    "cafe": (5.5, 9.0),
    "workshop": (5.0, 8.5),
    "cloakroom": (2.6, 5.0),
}
_SHALLOW = ("storage", "copyRoom", "pantry", "WC", "bathroom", "kitchen", "cloakroom")
_AT_MOST: dict[RoomKind, tuple[int, int]] = {
    "openspace": (1, 9),
    "storage": (2, 12),
    "WC": (1, 20),
    "pantry": (1, 20),
    "bathroom": (1, 8),
    "study": (1, 8),
    "kitchen": (1, 6),
    "cafe": (1, 8),
    "cloakroom": (1, 6),
}
"""So many, and another for every so many rooms of any kind."""
_WIDE = ("openspace", "lobby")
_WITH_DOUBLE_DOORS = ("openspace", "lobby", "lounge", "conferenceRoom", "cafe", "workshop")
_WITH_HIGH_CEILINGS = ("lobby", "lounge", "openspace", "cafe", "workshop")
_AT_TIMES_CLOSED = ("office", "storage", "WC", "conferenceRoom", "copyRoom")


@dataclass
class Strip:
    """One side of a corridor, along which rooms are lined up.

    Attributes:
        corridor: Its box.
        side: Which of its sides: the rooms lie beyond it.
        depth: How deep rooms are here.
        wall: How thick the wall is.
        cursor: Where the next room begins.
    """

    corridor: Rectangle
    side: int
    depth: float
    wall: float
    cursor: float

    def slot(self, width: float, depth: float) -> Rectangle:
        """Return the box of a room that begins at the cursor."""
        x0, y0, x1, y1 = self.corridor
        low, high = self.cursor, self.cursor + width
        if self.side == 0:
            return low, y0 - self.wall - depth, high, y0 - self.wall
        if self.side == 2:
            return low, y1 + self.wall, high, y1 + self.wall + depth
        if self.side == 1:
            return x1 + self.wall, low, x1 + self.wall + depth, high
        return x0 - self.wall - depth, low, x0 - self.wall, high

    def end(self) -> float:
        """Return where the corridor ends."""
        return self.corridor[2] if self.side % 2 == 0 else self.corridor[3]


def plan_area(style: Style, num_rooms: int, rng: np.random.Generator) -> list[Room]:
    """Draw the plan of one floor of a building.

    Args:
        style: The building's.
        num_rooms: Rooms, corridors among them; at least 2. With 8 or more every kind the style
            requires is among them.
        rng: Random numbers.

    Returns:
        The rooms in natural order of their names, in a map frame whose origin lies tens of metres
        away. They do not overlap; each has a way to a corridor and corridors join each other.

    Raises:
        InputError: No arrangement was found.
    """
    # how many corridors, and what the rooms are for
    if num_rooms < 40:
        num_halls = max(1, round(num_rooms * rng.uniform(0.14, 0.24)))
    else:
        num_halls = round(num_rooms / 6)
    kinds = _kinds(style, num_rooms - num_halls, rng)
    height = rng.uniform(*style.height)

    # longer corridors with every try, until all rooms fit
    for attempt in range(60):
        length = (1.0 + 0.06 * attempt) * _length(kinds)
        halls = draw_corridors(style, num_halls, length, rng)
        if not join_corridors(halls, height, rng):
            continue
        rooms = _line_up(halls, kinds, height, style, rng)
        if len(rooms) == len(kinds):
            return _finish(halls + rooms, style, rng)
    found, expected = f"no plan found for {num_rooms} rooms", "rooms that fit along corridors"
    remedy = "try another number of rooms or another seed"
    raise InputError("the floor plan", found, expected, remedy)


def _kinds(style: Style, count: int, rng: np.random.Generator) -> list[RoomKind]:
    """Draw what rooms are for, those the style requires among them, in random order."""
    names, weights = list(style.kinds), np.array(list(style.kinds.values()))
    kinds: list[RoomKind] = list(style.required[:count])
    limits = {kind: first + count // more for kind, (first, more) in _AT_MOST.items()}
    while len(kinds) < count:
        kind = names[int(rng.choice(len(names), p=weights / weights.sum()))]
        if kinds.count(kind) < limits.get(kind, count):
            kinds.append(kind)
    return [kinds[index] for index in rng.permutation(count)]


def _length(kinds: list[RoomKind]) -> float:
    """Estimate how many metres of corridor the rooms need."""
    return sum(sum(_WIDTHS[kind]) / 2 + 0.2 for kind in kinds) / 2 + 4.0


def _line_up(
    halls: list[Space], kinds: list[RoomKind], height: float, style: Style, rng: np.random.Generator
) -> list[Space]:
    """Place rooms along the corridors, each with a door; stop at the first that fits nowhere."""
    strips = _strips(halls, style, rng)
    placed: list[Space] = []
    for kind in kinds:
        width = rng.uniform(*_WIDTHS[kind])
        for index in rng.permutation(len(strips)):
            hall, strip = strips[index]
            boxes = [space.box for space in halls + placed]
            room = _try(hall, strip, kind, width, boxes, rng)
            if room is not None:
                room.ceiling = _ceiling(kind, height, rng)
                placed.append(room)
                break
        else:
            return placed
    return placed


def _strips(
    halls: list[Space], style: Style, rng: np.random.Generator
) -> list[tuple[Space, Strip]]:
    """Return both sides of each corridor; all walls of a plan are of one thickness."""
    wall = rng.uniform(0.1, 0.25)
    strips = []
    for hall in halls:
        x0, y0, x1, y1 = hall.box
        for side in (0, 2) if x1 - x0 > y1 - y0 else (1, 3):
            start = hall.reach(side)[0] + (-rng.uniform(0, 1.0) if len(halls) == 1 else 0.0)
            strips.append((hall, Strip(hall.box, side, rng.uniform(*style.depth), wall, start)))
    return strips


def _ceiling(kind: RoomKind, height: float, rng: np.random.Generator) -> float:
    """Draw the height of a room's ceiling."""
    is_high = kind in _WITH_HIGH_CEILINGS and rng.random() < 0.5
    extra = rng.uniform(0.2, 0.6) if is_high else 0.0
    less = rng.uniform(0.0, 0.25) if kind in _SHALLOW else 0.0
    return float(np.clip(height + extra - less + rng.normal(0, 0.03), 2.4, 4.0))


def _try(
    hall: Space,
    strip: Strip,
    kind: RoomKind,
    width: float,
    boxes: list[Rectangle],
    rng: np.random.Generator,
) -> Space | None:
    """Place a room at the first place of a strip where it and its door fit; None if nowhere."""
    depth = strip.depth + (rng.uniform(0.8, 2.4) if kind in _WIDE else 0.0)
    if kind in _SHALLOW and rng.random() < 0.5:
        depth = rng.uniform(2.6, 4.0)
    door = _door(kind, rng)

    while strip.cursor + 0.6 * width < strip.end() + 1.0:
        box = strip.slot(width, depth)
        if not overlaps(box, boxes, strip.wall - 1e-6):
            room = Space(kind, box, 0.0)
            if _cut_door(room, hall, strip.side, door, strip.wall, rng):
                strip.cursor += width + strip.wall
                return room

        # a shallower room may fit where a deep one does not
        if kind in _WIDE or rng.random() < 0.3:
            depth = max(depth - 0.4, 3.0)
        strip.cursor += 0.35
    return None


def _door(kind: RoomKind, rng: np.random.Generator) -> Opening:
    """Draw the door of a room; sides and places are filled in where it is cut."""
    double = kind in _WITH_DOUBLE_DOORS and rng.random() < 0.35
    width = rng.uniform(1.5, 1.8) if double else rng.uniform(0.82, 1.0)
    draw = rng.random()
    leaf = rng.uniform(80, 168) if draw < 0.8 else -1.0
    height = rng.uniform(2.0, 2.2)
    return Opening("door", 0, 0.0, width, 0.0, height, leaf, bool(rng.random() < 0.5))


def _cut_door(
    room: Space, hall: Space, side: int, door: Opening, wall: float, rng: np.random.Generator
) -> bool:
    """Cut a door between two spaces where their walls are free; return whether there was a place.

    ``side`` is the side of ``hall`` on which ``room`` lies, ``wall`` what is between them, metres.
    """
    # the stretch they share
    own = (side + 2) % 4
    low = max(room.reach(own)[0], hall.reach(side)[0]) + 0.2
    high = min(room.reach(own)[1], hall.reach(side)[1]) - 0.2
    width = door.end - door.start
    if high - low < width:
        return False

    # near its ends as a rule
    starts = []
    if rng.random() < 0.75:
        starts = [low + rng.uniform(0, 0.25), high - width - rng.uniform(0, 0.25)]
    starts += rng.uniform(low, high - width, 4).tolist()
    for start in np.clip(starts, low, high - width).tolist():
        end = start + width
        if room.is_free(own, start, end) and hall.is_free(side, start, end):
            cut = replace(door, side=own, start=start, end=end, depth=wall / 2)
            room.openings.append(replace(cut, leaf_deg=min(cut.leaf_deg, _widest(room, cut))))
            hall.openings.append(replace(cut, side=side, leaf_deg=-1.0))
            return True
    return False


def _widest(room: Space, door: Opening) -> float:
    """Return how far a leaf may open before it meets the wall beside it, degrees."""
    low, high = room.reach(door.side)
    before, after = door.start - low, high - door.end
    beside = min(before, after) if door.is_double else (after if door.hinge_at_end else before)
    length = (door.end - door.start) / (2 if door.is_double else 1)
    return 90.0 + float(np.degrees(np.arcsin(np.clip((beside - 0.08) / length, -0.2, 1.0))))


def _finish(spaces: list[Space], style: Style, rng: np.random.Generator) -> list[Room]:
    """Close some doors, name the rooms, move the plan off the origin and add what is built in."""
    _connect_neighbours(spaces, rng)
    _close_some(spaces, rng)
    shift = np.round(rng.uniform(-40, 40, 2), 3)
    counts: dict[str, int] = {}
    rooms, boxes = [], [space.box for space in spaces]
    for space in spaces:
        counts[space.kind] = counts.get(space.kind, 0) + 1
        name = f"{space.kind}_{counts[space.kind]}"
        low, high = np.array(space.box[:2]) + shift, np.array(space.box[2:]) + shift

        # openings move along; nothing but the street is beyond exterior sides
        openings = []
        for opening in space.openings:
            step = shift[opening.side % 2]
            openings.append(replace(opening, start=opening.start + step, end=opening.end + step))
        exterior = tuple(s for s in range(4) if not overlaps(beyond(space.box, s), boxes, 0.0))
        cut = tuple(openings)
        room = Room(name, space.kind, low, high, space.ceiling, cut, exterior=exterior)
        rooms.append(room)
    rooms = fit_out(rooms, style, rng)
    return sorted(rooms, key=lambda room: (room.kind.lower(), int(room.name.rsplit("_", 1)[1])))


def _connect_neighbours(spaces: list[Space], rng: np.random.Generator) -> None:
    """Give some rooms a second door, to the room beside them."""
    rooms = [space for space in spaces if space.kind not in ("hallway", "WC", "bathroom")]
    for number, first in enumerate(rooms):
        for second in rooms[number + 1 :]:
            side, low, high, gap = facing(first.box, second.box)
            if side >= 0 and gap < 0.3 and high - low > 2 and rng.random() < 0.12:
                _cut_door(second, first, side, _door("office", rng), gap, rng)


def _close_some(spaces: list[Space], rng: np.random.Generator) -> None:
    """Close the doors of about one room in ten, on both their sides."""
    rooms = [space for space in spaces if space.kind in _AT_TIMES_CLOSED]
    closed = [room for room in rooms if rng.random() < 0.1][: len(spaces) // 8]
    for room in closed:
        doors = {((door.side + 2) % 4, door.start, door.end) for door in room.openings}
        room.openings[:] = [replace(door, leaf_deg=0.0) for door in room.openings]
        for other in spaces:
            other.openings[:] = [
                replace(twin, leaf_deg=0.0) if (twin.side, twin.start, twin.end) in doors else twin
                for twin in other.openings
            ]
