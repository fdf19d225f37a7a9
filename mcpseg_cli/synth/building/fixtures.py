"""What is built into rooms: columns, shafts, radiators, beams, ducts and pipes."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.building.walls import at_wall, free_stretches, kept_clear, meets, wall_of
from mcpseg_cli.synth.plan import Fixture, Room
from mcpseg_cli.synth.surfaces.styles import Style

_UNDER_TILES = 0.2  # of the usual share of beams, where a suspended ceiling would hide them
_IN_HALLS = 0.6  # the same in corridors
_LARGE = ("openspace", "lobby", "lounge")  # rooms with columns in their middle


def columns(room: Room, style: Style, bay: float, rng: np.random.Generator) -> list[Fixture]:
    """Stand columns on the building's raster: half in the walls, in wide rooms free as well."""
    share = 1.3 * style.columns * (1.6 if room.kind in _LARGE else 1.0)
    if rng.random() > share:
        return []
    size = rng.uniform(0.28, 0.55)
    is_round = rng.random() < 0.3

    # in a row through the middle
    found = []
    for x, y in _middle_row(room, bay):
        low, high = [x - size / 2, y - size / 2, 0.0], [x + size / 2, y + size / 2, room.ceiling]
        corners = np.array([low, high])
        found.append(Fixture("round column" if is_round else "column", corners[0], corners[1]))

    # half in the outer walls
    depth = rng.uniform(0.12, 0.35)
    for side in (room.exterior or (0, 2))[:2]:
        start, end, _, _ = wall_of(room, side)
        for middle in np.arange(np.ceil(start / bay) * bay, end, bay).tolist():
            along = (max(middle - size / 2, start), min(middle + size / 2, end))
            if along[1] - along[0] > 0.15:
                low, high = at_wall(room, side, along, (0.0, depth), (0.0, room.ceiling))
                found.append(Fixture("column", low, high))
    return found


def _middle_row(room: Room, bay: float) -> list[tuple[float, float]]:
    """Return where columns stand in the middle of a large room, x and y."""
    size = room.high - room.low
    if size.min() <= 4.5 or room.kind not in _LARGE:
        return []
    along = 0 if size[0] > size[1] else 1
    count = max(1, int(size[along]) // int(max(bay, 3.0)))
    spots = np.tile(room.low + size * 0.5, (count, 1))
    spots[:, along] = room.low[along] + (np.arange(count) + 0.5) * size[along] / count
    return [(x, y) for x, y in spots.tolist()]


def shafts(room: Room, rng: np.random.Generator) -> list[Fixture]:
    """Box out a corner, or a stretch of a wall: pipes behind a piece of wall, a chimney breast."""
    found = []
    if rng.random() < 0.25 and room.kind != "hallway":
        size = rng.uniform(0.25, 0.7, 2)
        corner = np.where(rng.random(2) < 0.5, room.low, room.high - size)
        low, high = np.array([*corner, 0.0]), np.array([*(corner + size), room.ceiling])
        found.append(Fixture("shaft", low, high))

    if rng.random() < 0.25:
        side = int(rng.integers(4))
        wide = [span for span in free_stretches(room, side) if span[1] - span[0] > 1.0]
        if wide:
            a, b = wide[int(rng.integers(len(wide)))]
            width = rng.uniform(0.4, min(1.8, b - a))
            start = rng.uniform(a, b - width)
            along, out = (start, start + width), (0.0, rng.uniform(0.06, 0.3))
            low, high = at_wall(room, side, along, out, (0.0, room.ceiling))
            found.append(Fixture("shaft", low, high))
    return found


def radiators(room: Room, rng: np.random.Generator) -> list[Fixture]:
    """Hang radiators under windows that have a sill."""
    if rng.random() >= 0.5:
        return []
    found = []
    for window in room.openings:
        has_sill = window.low > 0.7 and window.glazing in ("single", "band")
        if window.kind != "window" or not has_sill:
            continue
        width = min(window.end - window.start, rng.uniform(0.8, 1.8))
        middle = (window.start + window.end) / 2
        along, out = (middle - width / 2, middle + width / 2), (0.03, rng.uniform(0.1, 0.16))
        low, high = at_wall(room, window.side, along, out, (0.12, 0.66))
        found.append(Fixture("radiator", low, high))
    return found


def beams(room: Room, style: Style, bay: float, rng: np.random.Generator) -> list[Fixture]:
    """Hang beams across the short way of the room, on the raster."""
    share = style.beams * (_UNDER_TILES if room.ceiling_kind == "acoustic" else 1.0)
    if rng.random() > share * (_IN_HALLS if room.kind == "hallway" else 1.0) or room.ceiling < 2.5:
        return []
    along = int(np.argmax(room.high - room.low))
    start, end = room.low[along], room.high[along]
    width = rng.uniform(0.2, 0.45)
    drop = min(rng.uniform(0.2, 0.6), room.ceiling - 2.2)

    # on the raster, at times one along a wall as well, one at least
    places = np.arange(np.ceil((start + 0.3) / bay) * bay, end - 0.3, bay).tolist()
    if rng.random() < 0.25:
        places.append(float(start + width / 2))
    found = []
    for middle in places or [float(start + end) / 2]:
        low, high = np.array([*room.low, room.ceiling - drop]), np.array([*room.high, room.ceiling])
        low[along], high[along] = max(middle - width / 2, start), min(middle + width / 2, end)
        found.append(Fixture("beam", low, high))
    return found


def ducts(
    room: Room, style: Style, fixtures: list[Fixture], rng: np.random.Generator
) -> list[Fixture]:
    """Run a duct and pipes along the room under the ceiling, below beams."""
    if room.ceiling_kind == "acoustic" or rng.random() > style.ducts or room.ceiling < 2.75:
        return []
    along = int(np.argmax(room.high - room.low))
    across = 1 - along
    heights = [float(f.high[2] - f.low[2]) for f in fixtures if f.kind == "beam"]
    drop = max(heights, default=0.0)

    # side by side from one wall on
    found = []
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
        found.append(Fixture("duct" if is_duct else "pipe", low, high))
        place += size + rng.uniform(0.1, 1.2)

    # not through columns
    standing = [np.stack([f.low, f.high]) for f in fixtures if f.kind != "beam"]
    return [duct for duct in found if not any(meets(duct.low, duct.high, box) for box in standing)]


def blocks(room: Room, fixture: Fixture) -> bool:
    """Return whether a fixture would stand in an opening or in the way through a door."""
    for opening in room.openings:
        along = (opening.start - 0.05, opening.end + 0.05)
        out = (-0.1, 0.05 if opening.kind == "window" else 1.1)
        before = at_wall(room, opening.side, along, out, (opening.low, opening.high))
        boxes = [before, *kept_clear(room, opening)]
        if any(meets(fixture.low, fixture.high, box) for box in boxes):
            return True
    return False


def apart(fixtures: list[Fixture]) -> list[Fixture]:
    """Drop fixtures that reach into an earlier one."""
    kept: list[Fixture] = []
    for f in fixtures:
        if not any((f.low < k.high + 0.02).all() and (f.high > k.low - 0.02).all() for k in kept):
            kept.append(f)
    return kept
