"""Floor plans: corridors first, then rooms along both their sides, then doors, windows and what is built in."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from mcpseg_cli.errors import InputError
from mcpseg_cli.synth.building.fittings import fit_out
from mcpseg_cli.synth.plan import Opening, Room, RoomKind
from mcpseg_cli.synth.surfaces.styles import Style

Rectangle = tuple[float, float, float, float]
"""Lowest x, lowest y, highest x, highest y."""

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
}
_SHALLOW = ("storage", "copyRoom", "pantry", "WC", "bathroom", "kitchen")
_AT_MOST: dict[RoomKind, tuple[int, int]] = {
    "openspace": (1, 9),
    "storage": (2, 12),
    "WC": (1, 20),
    "pantry": (1, 20),
    "bathroom": (1, 8),
    "study": (1, 8),
    "kitchen": (1, 6),
}
"""So many, and another for every so many rooms of any kind."""


@dataclass
class Space:
    """A room while the plan is being drawn.

    Attributes:
        kind: What it is used for.
        box: Its inside.
        ceiling: Height, metres.
        openings: What has been cut into its walls so far.
    """

    kind: RoomKind
    box: Rectangle
    ceiling: float
    openings: list[Opening] = field(default_factory=list)

    def reach(self, side: int) -> tuple[float, float]:
        """Return where a wall begins and ends."""
        return (self.box[0], self.box[2]) if side % 2 == 0 else (self.box[1], self.box[3])

    def is_free(self, side: int, start: float, end: float, margin: float = 0.12) -> bool:
        """Return whether a stretch of a wall lies inside the wall and is clear of other openings."""
        low, high = self.reach(side)
        return (
            start >= low + margin
            and end <= high - margin
            and all(
                o.side != side or o.end + margin < start or o.start - margin > end
                for o in self.openings
            )
        )


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
    num_halls = (
        max(1, round(num_rooms * rng.uniform(0.14, 0.24)))
        if num_rooms < 40
        else round(num_rooms / 6)
    )
    kinds = _kinds(style, num_rooms - num_halls, rng)
    height = rng.uniform(*style.height)
    for attempt in range(60):
        halls = _corridors(
            style, kinds, num_halls, (1.0 + 0.06 * attempt) * _length(kinds, style), rng
        )
        if not _join(halls, height, rng):
            continue
        rooms = _line_up(halls, kinds, height, style, rng)
        if len(rooms) == len(kinds):
            return _finish(halls + rooms, style, rng)
    found, expected = f"no plan found for {num_rooms} rooms", "rooms that fit along corridors"
    raise InputError(
        "the floor plan", found, expected, "try another number of rooms or another seed"
    )


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


def _length(kinds: list[RoomKind], style: Style) -> float:
    """Estimate how many metres of corridor the rooms need."""
    return sum(sum(_WIDTHS[kind]) / 2 + 0.2 for kind in kinds) / 2 + 4.0


def _corridors(
    style: Style, kinds: list[RoomKind], count: int, length: float, rng: np.random.Generator
) -> list[Space]:
    """Draw the boxes of the corridors: legs of the chosen shape, each cut into ``count`` pieces in all."""
    width = rng.uniform(*style.hall_width)
    shapes = [
        shape
        for shape in style.corridors
        if {"straight": 1, "L": 2, "T": 2, "U": 3, "loop": 4}[shape] <= count
    ]
    shape = shapes[int(rng.integers(len(shapes)))] if shapes else "straight"
    if shape == "straight":
        legs = [(0.0, 0.0, length, width)]
    elif shape == "L":
        first = length * rng.uniform(0.4, 0.6) + 4
        legs = [(0.0, 0.0, first, width), (first - width, width, first, width + length - first + 8)]
    elif shape == "T":
        first = length * rng.uniform(0.5, 0.65) + 2
        middle = first * rng.uniform(0.4, 0.6)
        legs = [
            (0.0, 0.0, first, width),
            (middle, width, middle + width, width + length - first + 7),
        ]
    elif shape == "U":
        first, side = length * 0.4 + 12, length * 0.3 + 3
        legs = [
            (0.0, 0.0, first, width),
            (0.0, width, width, width + side),
            (first - width, width, first, width + side),
        ]
    else:
        first, side = max(length * 0.3 + 4, 16.0), max(length * 0.2, 12.0)
        legs = [
            (0.0, 0.0, first, width),
            (0.0, width, width, width + side),
            (first - width, width, first, width + side),
            (0.0, width + side, first, 2 * width + side),
        ]
    lengths = np.array([max(leg[2] - leg[0], leg[3] - leg[1]) for leg in legs])
    pieces = np.ones(len(legs), int)
    while pieces.sum() < count:
        pieces[int(np.argmax(lengths / pieces))] += 1
    return [
        Space("hallway", box, 0.0)
        for leg, number in zip(legs, pieces, strict=True)
        for box in _cut(leg, number, rng)
    ]


def _cut(leg: Rectangle, count: int, rng: np.random.Generator) -> list[Rectangle]:
    """Cut one leg across into pieces, a thin wall between them; its ends keep off the legs they meet."""
    x0, y0, x1, y1 = leg
    along_x = x1 - x0 > y1 - y0
    low, high = (x0, x1) if along_x else (y0 + 0.12, y1 - 0.12)
    cuts = low + (high - low) * (np.arange(1, count) + rng.uniform(-0.15, 0.15, count - 1)) / count
    edges = [low, *cuts.tolist(), high]
    ends = [
        (edges[k] + (0.06 if k else 0), edges[k + 1] - (0.06 if k < count - 1 else 0))
        for k in range(count)
    ]
    return [(a, y0, b, y1) if along_x else (x0, a, x1, b) for a, b in ends]


def _join(halls: list[Space], height: float, rng: np.random.Generator) -> bool:
    """Open passages between corridors that meet, give each its ceiling; return whether all can be walked through."""
    network = list(range(len(halls)))  # number of the part of the network that each belongs to
    lowered = rng.uniform(0.0, 0.35)
    for hall in halls:
        hall.ceiling = max(height - lowered, 2.45)
    for number, first in enumerate(halls):
        for other in range(number + 1, len(halls)):
            second = halls[other]
            side, low, high, gap = _facing(first.box, second.box)
            if side < 0 or gap > 0.2 or high - low < 1.4:
                continue
            header = rng.uniform(0.2, 0.4) if rng.random() < 0.5 and height - lowered > 2.6 else 0.0
            inset = rng.uniform(0.05, 0.2) if rng.random() < 0.4 else 0.0
            top = first.ceiling - header
            opening = Opening("passage", side, low + inset, high - inset, 0.0, top, depth=gap / 2)
            first.openings.append(opening)
            second.openings.append(replace(opening, side=(side + 2) % 4))
            kept, dropped = network[number], network[other]
            network = [kept if part == dropped else part for part in network]
    return len(set(network)) == 1


def _facing(first: Rectangle, second: Rectangle) -> tuple[int, float, float, float]:
    """Return on which side of the first box the second lies, the stretch they share and the gap; side -1: nowhere."""
    gaps = (first[1] - second[3], second[0] - first[2], second[1] - first[3], first[0] - second[2])
    side = int(np.argmax(gaps))
    axis = side % 2
    low, high = max(first[axis], second[axis]), min(first[axis + 2], second[axis + 2])
    if gaps[side] < 0 or high <= low:
        return -1, 0.0, 0.0, 0.0
    return side, low, high, gaps[side]


def _overlaps(box: Rectangle, others: list[Rectangle], margin: float) -> bool:
    """Return whether a box comes closer than ``margin`` to any other."""
    return any(
        box[0] < o[2] + margin
        and o[0] < box[2] + margin
        and box[1] < o[3] + margin
        and o[1] < box[3] + margin
        for o in others
    )


def _line_up(
    halls: list[Space], kinds: list[RoomKind], height: float, style: Style, rng: np.random.Generator
) -> list[Space]:
    """Place rooms along the corridors, each with a door; stop at the first that does not fit anywhere."""
    wall = rng.uniform(0.1, 0.25)
    strips = []
    for hall in halls:
        x0, y0, x1, y1 = hall.box
        for side in (0, 2) if x1 - x0 > y1 - y0 else (1, 3):
            start = hall.reach(side)[0] + (-rng.uniform(0, 1.0) if len(halls) == 1 else 0.0)
            strips.append((hall, Strip(hall.box, side, rng.uniform(*style.depth), wall, start)))
    placed: list[Space] = []
    for kind in kinds:
        width = rng.uniform(*_WIDTHS[kind])
        for index in rng.permutation(len(strips)):
            hall, strip = strips[index]
            room = _try(hall, strip, kind, width, [space.box for space in halls + placed], rng)
            if room is not None:
                room.ceiling = _ceiling(kind, height, rng)
                placed.append(room)
                break
        else:
            return placed
    return placed


def _ceiling(kind: RoomKind, height: float, rng: np.random.Generator) -> float:
    """Draw the height of a room's ceiling."""
    extra = (
        rng.uniform(0.2, 0.6)
        if kind in ("lobby", "lounge", "openspace") and rng.random() < 0.5
        else 0.0
    )
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
    """Place a room at the first place of a strip where it and its door fit, and cut the door; None if nowhere."""
    depth = strip.depth + (rng.uniform(0.8, 2.4) if kind in ("openspace", "lobby") else 0.0)
    if kind in _SHALLOW and rng.random() < 0.5:
        depth = rng.uniform(2.6, 4.0)
    door = _door(kind, rng)
    while strip.cursor + 0.6 * width < strip.end() + 1.0:
        box = strip.slot(width, depth)
        if not _overlaps(box, boxes, strip.wall - 1e-6):
            room = Space(kind, box, 0.0)
            if _cut_door(room, hall, strip.side, door, strip.wall, rng):
                strip.cursor += width + strip.wall
                return room
        if (
            kind in ("openspace", "lobby") or rng.random() < 0.3
        ):  # a shallower room may fit where a deep one does not
            depth = max(depth - 0.4, 3.0)
        strip.cursor += 0.35
    return None


def _door(kind: RoomKind, rng: np.random.Generator) -> Opening:
    """Draw the door of a room; sides and places are filled in where it is cut."""
    double = kind in ("openspace", "lobby", "lounge", "conferenceRoom") and rng.random() < 0.35
    width = rng.uniform(1.5, 1.8) if double else rng.uniform(0.82, 1.0)
    draw = rng.random()
    leaf = rng.uniform(80, 168) if draw < 0.8 else -1.0
    return Opening(
        "door", 0, 0.0, width, 0.0, rng.uniform(2.0, 2.2), leaf, bool(rng.random() < 0.5)
    )


def _cut_door(
    room: Space, hall: Space, side: int, door: Opening, wall: float, rng: np.random.Generator
) -> bool:
    """Cut a door between a room and a space on the other side of its wall, where both walls are free."""
    own = (side + 2) % 4
    low = max(room.reach(own)[0], hall.reach(side)[0]) + 0.2
    high = min(room.reach(own)[1], hall.reach(side)[1]) - 0.2
    width = door.end - door.start
    if high - low < width:
        return False
    ends = (
        [low + rng.uniform(0, 0.25), high - width - rng.uniform(0, 0.25)]
        if rng.random() < 0.75
        else []
    )
    for start in [*ends, *rng.uniform(low, high - width, 4).tolist()]:
        start = float(np.clip(start, low, high - width))
        if room.is_free(own, start, start + width) and hall.is_free(side, start, start + width):
            cut = replace(door, side=own, start=start, end=start + width, depth=wall / 2)
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
    """Close some doors, add windows and what is built in, name the rooms and move the plan off the origin."""
    _connect_neighbours(spaces, rng)
    _close_some(spaces, rng)
    shift = np.round(rng.uniform(-40, 40, 2), 3)
    counts: dict[str, int] = {}
    rooms = []
    boxes = [space.box for space in spaces]
    for space in spaces:
        counts[space.kind] = counts.get(space.kind, 0) + 1
        exterior = tuple(
            side for side in range(4) if not _overlaps(_beyond(space.box, side), boxes, 0.0)
        )
        room = Room(
            f"{space.kind}_{counts[space.kind]}",
            space.kind,
            np.array(space.box[:2]) + shift,
            np.array(space.box[2:]) + shift,
            space.ceiling,
            tuple(
                replace(o, start=o.start + shift[o.side % 2], end=o.end + shift[o.side % 2])
                for o in space.openings
            ),
            (),
            (),
            exterior,
        )
        rooms.append(room)
    rooms = fit_out(rooms, style, rng)
    return sorted(rooms, key=lambda room: (room.kind.lower(), int(room.name.rsplit("_", 1)[1])))


def _beyond(box: Rectangle, side: int) -> Rectangle:
    """Return the strip of 2 m outside one side of a box."""
    x0, y0, x1, y1 = box
    strips = (
        (x0, y0 - 2, x1, y0 - 0.02),
        (x1 + 0.02, y0, x1 + 2, y1),
        (x0, y1 + 0.02, x1, y1 + 2),
        (x0 - 2, y0, x0 - 0.02, y1),
    )
    return strips[side]


def _connect_neighbours(spaces: list[Space], rng: np.random.Generator) -> None:
    """Give some rooms a second door, to the room beside them."""
    rooms = [space for space in spaces if space.kind not in ("hallway", "WC", "bathroom")]
    for number, first in enumerate(rooms):
        for second in rooms[number + 1 :]:
            side, low, high, gap = _facing(first.box, second.box)
            if side >= 0 and gap < 0.3 and high - low > 2 and rng.random() < 0.12:
                _cut_door(second, first, side, _door("office", rng), gap, rng)


def _close_some(spaces: list[Space], rng: np.random.Generator) -> None:
    """Close the doors of about one room in ten."""
    rooms = [
        space
        for space in spaces
        if space.kind in ("office", "storage", "WC", "conferenceRoom", "copyRoom")
    ]
    closed = [room for room in rooms if rng.random() < 0.1][: len(spaces) // 8]
    for room in closed:
        for number, door in enumerate(room.openings):
            room.openings[number] = replace(door, leaf_deg=0.0)
            for other in spaces:
                for index, twin in enumerate(other.openings):
                    if (
                        twin.side == (door.side + 2) % 4
                        and twin.start == door.start
                        and twin.end == door.end
                    ):
                        other.openings[index] = replace(twin, leaf_deg=0.0)
