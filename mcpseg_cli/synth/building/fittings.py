"""Windows, service doors and what is built into rooms: columns, beams, shafts, radiators, ducts and pipes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.synth.plan import CeilingKind, Fixture, Opening, Room
from mcpseg_cli.synth.surfaces.styles import Style

_UNDER_TILES = (
    0.2  # of the usual share of rooms with beams, where a suspended ceiling would hide them
)
_IN_HALLS = 0.6  # the same in corridors


def fit_out(rooms: list[Room], style: Style, rng: np.random.Generator) -> list[Room]:
    """Add windows, glass walls, service doors and fixtures to the rooms of a plan.

    Args:
        rooms: Rooms with doors and passages.
        style: The building's.
        rng: Random numbers.

    Returns:
        The same rooms, complete; ``taken`` holds what furniture keeps clear of.
    """
    bay = rng.uniform(3.2, 6.0)  # columns and beams stand on one raster in the whole building
    rooms = _glass_walls(rooms, style, rng)
    complete = []
    for room in rooms:
        room = _service_doors(room, rng) if room.kind == "hallway" else room
        room = replace(room, ceiling_kind=_ceiling_kind(room, style, rng))
        columns = [
            column for column in _columns(room, style, bay, rng) if not _blocks(room, column)
        ]
        room = _windows(
            replace(room, fixtures=tuple(_apart(columns))), style, rng
        )  # windows lie between columns
        fixtures = [*columns, *_shafts(room, rng), *_radiators(room, rng)]
        fixtures = [fixture for fixture in fixtures if not _blocks(room, fixture)]
        fixtures = _apart(fixtures) + _beams(room, style, bay, rng)
        fixtures += _ducts(room, style, fixtures, rng)
        taken = [np.stack([f.low, f.high]) for f in fixtures] + [
            box for opening in room.openings for box in _kept_clear(room, opening)
        ]
        complete.append(replace(room, fixtures=tuple(fixtures), taken=tuple(taken)))
    return complete


def wall_of(room: Room, side: int) -> tuple[float, float, float, float]:
    """Return where a wall begins and ends along itself, where it stands across, and which way (+1, -1) is inwards."""
    across = 1 - side % 2
    along = side % 2
    inwards = 1.0 if side in (0, 3) else -1.0
    place = room.low[across] if inwards > 0 else room.high[across]
    return float(room.low[along]), float(room.high[along]), float(place), inwards


def at_wall(
    room: Room,
    side: int,
    along: tuple[float, float],
    out: tuple[float, float],
    up: tuple[float, float],
) -> NDArray[np.float64]:
    """Return the (2, 3) box at a wall: a stretch along it, distances from it into the room, and heights."""
    _, _, place, inwards = wall_of(room, side)
    near, far = sorted((place + inwards * out[0], place + inwards * out[1]))
    if side % 2 == 0:
        return np.array([[along[0], near, up[0]], [along[1], far, up[1]]])
    return np.array([[near, along[0], up[0]], [far, along[1], up[1]]])


def free_stretches(
    room: Room, side: int, margin: float = 0.15, low: float = 0.0, high: float = 9.0
) -> list[tuple[float, float]]:
    """Return the stretches of a wall that have no opening between two heights and no column or shaft before them."""
    start, end, _, _ = wall_of(room, side)
    blocked = [
        (o.start - margin, o.end + margin)
        for o in room.openings
        if o.side == side and o.low < high and o.high > low
    ]
    strip = at_wall(
        room, side, (start, end), (0, 0.35), (low + 0.01, min(high, room.ceiling) - 0.01)
    )
    blocked += [
        (float(f.low[side % 2]) - margin, float(f.high[side % 2]) + margin)
        for f in room.fixtures
        if f.kind not in ("beam", "duct") and (f.low < strip[1]).all() and (f.high > strip[0]).all()
    ]
    stretches = []
    cursor = start + margin
    for first, last in sorted(blocked):
        if first > cursor:
            stretches.append((cursor, float(first)))
        cursor = max(cursor, float(last))
    if end - margin > cursor:
        stretches.append((cursor, end - margin))
    return stretches


def _ceiling_kind(room: Room, style: Style, rng: np.random.Generator) -> CeilingKind:
    """Draw what a ceiling is made of, the same in all corridors of a building."""
    finish = np.random.default_rng(style.hall_seed) if room.kind == "hallway" else rng
    return (
        style.ceilings[int(finish.integers(len(style.ceilings)))]
        if finish.random() < 0.4
        else style.ceilings[0]
    )


def _glass_walls(rooms: list[Room], style: Style, rng: np.random.Generator) -> list[Room]:
    """Put glass into walls between rooms and corridors, the same pane on both sides."""
    added: dict[int, list[Opening]] = {index: [] for index in range(len(rooms))}
    for index, room in enumerate(rooms):
        if (
            room.kind not in ("office", "conferenceRoom", "openspace", "lounge")
            or rng.random() > style.glass_walls
        ):
            continue
        for door in [o for o in room.openings if o.kind == "door"][:1]:
            halls = [
                (number, hall, twin)
                for number, hall in enumerate(rooms)
                for twin in hall.openings
                if hall.kind == "hallway"
                and twin.side == (door.side + 2) % 4
                and twin.start == door.start
            ]
            if not halls:
                continue
            number, hall, twin = halls[0]
            hall_with = replace(hall, openings=hall.openings + tuple(added[number]))
            shared = [
                (max(a, c), min(b, d))
                for a, b in free_stretches(room, door.side)
                for c, d in free_stretches(hall_with, twin.side)
                if min(b, d) - max(a, c) > 0.6
            ]
            low, high = (
                (0.08, door.high) if rng.random() < 0.5 else (rng.uniform(0.8, 1.1), door.high)
            )
            for start, end in shared:
                end = min(end, start + rng.uniform(1.0, 4.0))
                pane = Opening(
                    "window", door.side, start, end, low, high, depth=door.depth, glazing="interior"
                )
                added[index].append(pane)
                added[number].append(replace(pane, side=twin.side))
    return [
        replace(room, openings=room.openings + tuple(added[index]))
        for index, room in enumerate(rooms)
    ]


def _service_doors(room: Room, rng: np.random.Generator) -> Room:
    """Put closed doors that lead nowhere into the outer walls of a corridor: stairs, shafts, cupboards."""
    openings = list(room.openings)
    for side in room.exterior:
        start, end, _, _ = wall_of(room, side)
        if end - start < 4.0 and rng.random() < 0.6:
            width = min(rng.uniform(0.85, 1.75), end - start - 0.5)
            middle = (start + end) / 2
            openings.append(
                Opening(
                    "door",
                    side,
                    middle - width / 2,
                    middle + width / 2,
                    0.0,
                    2.1,
                    0.0,
                    is_dummy=True,
                )
            )
    for side in range(4):
        if any(opening.side == side and opening.is_dummy for opening in openings):
            continue
        for first, last in free_stretches(room, side, 0.25):
            if last - first > 1.2 and rng.random() < 0.5:
                width = (
                    rng.uniform(0.8, 1.0)
                    if last - first < 2.2 or rng.random() < 0.7
                    else rng.uniform(1.4, 1.8)
                )
                start = rng.uniform(first, last - width)
                openings.append(
                    Opening(
                        "door",
                        side,
                        start,
                        start + width,
                        0.0,
                        rng.uniform(2.0, 2.15),
                        0.0,
                        is_dummy=True,
                    )
                )
    return replace(room, openings=tuple(openings))


def _windows(room: Room, style: Style, rng: np.random.Generator) -> Room:
    """Put windows into the walls to the street."""
    if room.kind in ("storage", "WC", "copyRoom", "bathroom") and rng.random() < 0.7:
        return room
    openings = list(room.openings)
    glazing = style.glazing[int(rng.integers(len(style.glazing)))]
    sill, top = rng.uniform(0.75, 1.05), min(room.ceiling - rng.uniform(0.15, 0.5), 2.7)
    depth = rng.uniform(0.08, 0.3)
    sides = [side for side in room.exterior if room.kind != "hallway" or rng.random() < 0.35]
    sides = [side for number, side in enumerate(sides) if number == 0 or rng.random() < 0.35]
    for side in sides:
        for first, last in free_stretches(room, side, 0.2):
            if last - first < 0.8:
                continue
            if glazing == "single":
                width, gap = rng.uniform(0.9, 1.6), rng.uniform(0.4, 1.2)
                count = max(1, int((last - first + gap) / (width + gap)))
                inset = (last - first - count * width - (count - 1) * gap) / 2
                spans = [
                    (first + inset + k * (width + gap), first + inset + k * (width + gap) + width)
                    for k in range(count)
                ]
                spans = [(max(a, first), min(b, last)) for a, b in spans]
            else:
                inset = rng.uniform(0.0, 0.4)
                spans = [(first + inset, last - inset)]
            low = 0.06 if glazing == "full" else sill
            openings += [
                Opening("window", side, a, b, low, top, depth=depth, glazing=glazing)
                for a, b in spans
                if b - a > 0.5
            ]
    return replace(room, openings=tuple(openings))


def _columns(room: Room, style: Style, bay: float, rng: np.random.Generator) -> list[Fixture]:
    """Stand columns on the building's raster: half in the walls, in wide rooms free in the middle too."""
    if rng.random() > 1.3 * style.columns * (
        1.6 if room.kind in ("openspace", "lobby", "lounge") else 1.0
    ):
        return []
    size = rng.uniform(0.28, 0.55)
    is_round = rng.random() < 0.3
    size_x, size_y = room.high - room.low
    columns = []
    spots: list[tuple[float, float]] = []
    if min(size_x, size_y) > 4.5:
        along = 0 if size_x > size_y else 1
        count = max(1, int(room.high[along] - room.low[along]) // int(max(bay, 3.0)))
        for k in range(count):
            spot = room.low + (room.high - room.low) * 0.5
            spot[along] = room.low[along] + (k + 0.5) * (room.high[along] - room.low[along]) / count
            spots.append((float(spot[0]), float(spot[1])))
        if room.kind not in ("openspace", "lobby", "lounge"):
            spots = []
    for x, y in spots:
        low, high = (
            np.array([x - size / 2, y - size / 2, 0.0]),
            np.array([x + size / 2, y + size / 2, room.ceiling]),
        )
        columns.append(Fixture("round column" if is_round else "column", low, high))
    depth = rng.uniform(0.12, 0.35)
    for side in (room.exterior or (0, 2))[:2]:
        start, end, _, _ = wall_of(room, side)
        first = (np.ceil(start / bay)) * bay
        for middle in np.arange(first, end, bay).tolist():
            along_wall = (max(middle - size / 2, start), min(middle + size / 2, end))
            if along_wall[1] - along_wall[0] > 0.15:
                low, high = at_wall(room, side, along_wall, (0.0, depth), (0.0, room.ceiling))
                columns.append(Fixture("column", low, high))
    return columns


def _shafts(room: Room, rng: np.random.Generator) -> list[Fixture]:
    """Box out a corner of the room, or a stretch of a wall: pipes behind a piece of wall, a chimney breast."""
    shafts = []
    if rng.random() < 0.25 and room.kind != "hallway":
        size = rng.uniform(0.25, 0.7, 2)
        corner = np.where(rng.random(2) < 0.5, room.low, room.high - size)
        shafts.append(
            Fixture("shaft", np.array([*corner, 0.0]), np.array([*(corner + size), room.ceiling]))
        )
    if rng.random() < 0.25:
        side = int(rng.integers(4))
        wide = [span for span in free_stretches(room, side) if span[1] - span[0] > 1.0]
        if wide:
            a, b = wide[int(rng.integers(len(wide)))]
            width = rng.uniform(0.4, min(1.8, b - a))
            start = rng.uniform(a, b - width)
            low, high = at_wall(
                room,
                side,
                (start, start + width),
                (0.0, rng.uniform(0.06, 0.3)),
                (0.0, room.ceiling),
            )
            shafts.append(Fixture("shaft", low, high))
    return shafts


def _radiators(room: Room, rng: np.random.Generator) -> list[Fixture]:
    """Hang radiators under windows that have a sill."""
    radiators = []
    if rng.random() < 0.5:
        for window in room.openings:
            if (
                window.kind == "window"
                and window.glazing in ("single", "band")
                and window.low > 0.7
            ):
                width = min(window.end - window.start, rng.uniform(0.8, 1.8))
                middle = (window.start + window.end) / 2
                low, high = at_wall(
                    room,
                    window.side,
                    (middle - width / 2, middle + width / 2),
                    (0.03, rng.uniform(0.1, 0.16)),
                    (0.12, 0.66),
                )
                radiators.append(Fixture("radiator", low, high))
    return radiators


def _beams(room: Room, style: Style, bay: float, rng: np.random.Generator) -> list[Fixture]:
    """Hang beams across the short way of the room, on the raster."""
    share = style.beams * (_UNDER_TILES if room.ceiling_kind == "acoustic" else 1.0)
    if rng.random() > share * (_IN_HALLS if room.kind == "hallway" else 1.0) or room.ceiling < 2.5:
        return []
    along = int(np.argmax(room.high - room.low))
    width = rng.uniform(0.2, 0.45)
    drop = min(rng.uniform(0.2, 0.6), room.ceiling - 2.2)
    beams = []
    first = np.ceil((room.low[along] + 0.3) / bay) * bay
    places = np.arange(first, room.high[along] - 0.3, bay).tolist()
    if rng.random() < 0.25:  # one along a wall as well
        places.append(float(room.low[along] + width / 2))
    for middle in places or [float(room.low[along] + room.high[along]) / 2]:
        low, high = np.array([*room.low, room.ceiling - drop]), np.array([*room.high, room.ceiling])
        low[along], high[along] = (
            max(middle - width / 2, room.low[along]),
            min(middle + width / 2, room.high[along]),
        )
        beams.append(Fixture("beam", low, high))
    return beams


def _ducts(
    room: Room, style: Style, fixtures: list[Fixture], rng: np.random.Generator
) -> list[Fixture]:
    """Run a duct and pipes along the room under the ceiling, below beams."""
    if room.ceiling_kind == "acoustic" or rng.random() > style.ducts or room.ceiling < 2.75:
        return []
    along = int(np.argmax(room.high - room.low))
    across = 1 - along
    drop = max((float(f.high[2] - f.low[2]) for f in fixtures if f.kind == "beam"), default=0.0)
    ducts = []
    place = room.low[across] + rng.uniform(0.15, 0.5)
    for _ in range(int(rng.integers(1, 4))):
        is_duct = rng.random() < 0.35 and room.ceiling - drop > 2.75
        size = rng.uniform(0.2, 0.4) if is_duct else rng.uniform(0.03, 0.1)
        if place + size > room.high[across] - 0.1:
            break
        low, high = np.zeros(3), np.zeros(3)
        low[along], high[along] = room.low[along], room.high[along]
        low[across], high[across] = place, place + size
        high[2] = room.ceiling - drop - 0.04
        low[2] = high[2] - size
        ducts.append(Fixture("duct" if is_duct else "pipe", low, high))
        place += size + rng.uniform(0.1, 1.2)
    columns = [f for f in fixtures if f.kind != "beam"]
    return [
        d
        for d in ducts
        if not any((d.low < f.high).all() and (d.high > f.low).all() for f in columns)
    ]


def _blocks(room: Room, fixture: Fixture) -> bool:
    """Return whether a fixture would stand in an opening or in the way through a door."""
    for opening in room.openings:
        out = 0.05 if opening.kind == "window" else 1.1
        box = at_wall(
            room,
            opening.side,
            (opening.start - 0.05, opening.end + 0.05),
            (-0.1, out),
            (opening.low, opening.high),
        )
        boxes = [box, *_kept_clear(room, opening)]
        if any((fixture.low < b[1]).all() and (fixture.high > b[0]).all() for b in boxes):
            return True
    return False


def _apart(fixtures: list[Fixture]) -> list[Fixture]:
    """Drop fixtures that reach into an earlier one."""
    kept: list[Fixture] = []
    for f in fixtures:
        if not any((f.low < k.high + 0.02).all() and (f.high > k.low - 0.02).all() for k in kept):
            kept.append(f)
    return kept


def leaf_line(
    room: Room, opening: Opening
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return hinge and far edge, (2,) each in the map frame, of every leaf of a door that stands in this room."""
    if opening.kind != "door" or opening.leaf_deg <= 0:
        return []
    _, _, place, inwards = wall_of(room, opening.side)
    width = opening.end - opening.start
    ends = (False, True) if opening.is_double else (opening.hinge_at_end,)
    lines = []
    for at_end in ends:
        hinge = opening.end - 0.05 if at_end else opening.start + 0.05
        length = (width / 2 if opening.is_double else width) - 0.09
        angle = np.radians(opening.leaf_deg)
        along = (-1.0 if at_end else 1.0) * np.cos(angle) * length
        out = inwards * np.sin(angle) * length
        base = place + inwards * 0.05
        first, last = (hinge, base), (hinge + along, base + out)
        if opening.side % 2:
            first, last = first[::-1], last[::-1]
        lines.append((np.array(first), np.array(last)))
    return lines


def _kept_clear(room: Room, opening: Opening) -> list[NDArray[np.float64]]:
    """Return the boxes before an opening that must stay free: the way through and the leaves that stand open."""
    if opening.kind == "window":
        return []
    boxes = [at_wall(room, opening.side, (opening.start, opening.end), (0.0, 0.9), (0.0, 2.2))]
    for first, last in leaf_line(room, opening):
        low, high = np.minimum(first, last) - 0.06, np.maximum(first, last) + 0.06
        boxes.append(np.array([[*low, 0.0], [*high, opening.high]]))
    return boxes
