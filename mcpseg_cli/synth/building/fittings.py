"""The outfit of planned rooms: windows, glass walls, service doors, kinds of ceiling, fixtures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcpseg_cli.synth.building.fixtures import (
    apart,
    beams,
    blocks,
    columns,
    ducts,
    radiators,
    shafts,
)
from mcpseg_cli.synth.building.walls import Span, free_stretches, kept_clear, wall_of
from mcpseg_cli.synth.plan import CeilingKind, Opening, Room
from mcpseg_cli.synth.surfaces.styles import Glazing, Style

_WITH_GLASS_WALLS = ("office", "conferenceRoom", "openspace", "lounge")
_MOSTLY_WINDOWLESS = ("storage", "WC", "copyRoom", "bathroom")


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
    return [_complete(room, style, bay, rng) for room in _glass_walls(rooms, style, rng)]


def _complete(room: Room, style: Style, bay: float, rng: np.random.Generator) -> Room:
    """Add a room's windows and fixtures."""
    room = _service_doors(room, rng) if room.kind == "hallway" else room
    room = replace(room, ceiling_kind=_ceiling_kind(room, style, rng))

    # windows lie between columns
    standing = [column for column in columns(room, style, bay, rng) if not blocks(room, column)]
    room = _windows(replace(room, fixtures=tuple(apart(standing))), style, rng)

    # what else stands there, then what hangs under the ceiling
    fixtures = [*standing, *shafts(room, rng), *radiators(room, rng)]
    fixtures = apart([fixture for fixture in fixtures if not blocks(room, fixture)])
    fixtures += beams(room, style, bay, rng)
    fixtures += ducts(room, style, fixtures, rng)

    taken = [np.stack([f.low, f.high]) for f in fixtures]
    taken += [box for opening in room.openings for box in kept_clear(room, opening)]
    return replace(room, fixtures=tuple(fixtures), taken=tuple(taken))


def _ceiling_kind(room: Room, style: Style, rng: np.random.Generator) -> CeilingKind:
    """Draw what a ceiling is made of, the same in all corridors of a building."""
    finish = np.random.default_rng(style.hall_seed) if room.kind == "hallway" else rng
    if finish.random() < 0.4:
        return style.ceilings[int(finish.integers(len(style.ceilings)))]
    return style.ceilings[0]


def _glass_walls(rooms: list[Room], style: Style, rng: np.random.Generator) -> list[Room]:
    """Put glass into walls between rooms and corridors, the same pane on both sides."""
    added: dict[int, list[Opening]] = {index: [] for index in range(len(rooms))}
    for index, room in enumerate(rooms):
        if room.kind not in _WITH_GLASS_WALLS or rng.random() > style.glass_walls:
            continue
        for door in [o for o in room.openings if o.kind == "door"][:1]:
            number, twin = _twin(rooms, door)
            if twin is None:
                continue

            # where the wall is free on both sides, beside what has been added before
            hall = rooms[number]
            hall = replace(hall, openings=hall.openings + tuple(added[number]))
            own, other = free_stretches(room, door.side), free_stretches(hall, twin.side)
            shared = [(max(a, c), min(b, d)) for a, b in own for c, d in other]
            low = 0.08 if rng.random() < 0.5 else rng.uniform(0.8, 1.1)
            for start, last in shared:
                if last - start <= 0.6:
                    continue
                end = min(last, start + rng.uniform(1.0, 4.0))
                pane = Opening("window", door.side, start, end, low, door.high, depth=door.depth)
                pane = replace(pane, glazing="interior")
                added[index].append(pane)
                added[number].append(replace(pane, side=twin.side))
    return [
        replace(room, openings=room.openings + tuple(added[index]))
        for index, room in enumerate(rooms)
    ]


def _twin(rooms: list[Room], door: Opening) -> tuple[int, Opening | None]:
    """Return the number of the corridor that a door leads to, and the door as seen from there."""
    for number, hall in enumerate(rooms):
        for twin in hall.openings:
            is_opposite = twin.side == (door.side + 2) % 4 and twin.start == door.start
            if hall.kind == "hallway" and is_opposite:
                return number, twin
    return -1, None


def _service_doors(room: Room, rng: np.random.Generator) -> Room:
    """Put closed doors that lead nowhere into a corridor's walls: stairs, shafts, cupboards."""
    openings = list(room.openings)

    # at the ends of the corridor
    for side in room.exterior:
        start, end, _, _ = wall_of(room, side)
        if end - start < 4.0 and rng.random() < 0.6:
            width = min(rng.uniform(0.85, 1.75), end - start - 0.5)
            middle = (start + end) / 2
            openings.append(_dummy(side, middle - width / 2, middle + width / 2, 2.1))

    # where nothing else is along it
    with_door = {opening.side for opening in openings if opening.is_dummy}
    for side in [side for side in range(4) if side not in with_door]:
        for first, last in free_stretches(room, side, 0.25):
            if last - first <= 1.2 or rng.random() >= 0.5:
                continue
            is_single = last - first < 2.2 or rng.random() < 0.7
            width = rng.uniform(0.8, 1.0) if is_single else rng.uniform(1.4, 1.8)
            start = rng.uniform(first, last - width)
            openings.append(_dummy(side, start, start + width, rng.uniform(2.0, 2.15)))
    return replace(room, openings=tuple(openings))


def _dummy(side: int, start: float, end: float, height: float) -> Opening:
    """Return a closed door that leads nowhere."""
    return Opening("door", side, start, end, 0.0, height, 0.0, is_dummy=True)


def _windows(room: Room, style: Style, rng: np.random.Generator) -> Room:
    """Put windows into the walls to the street."""
    if room.kind in _MOSTLY_WINDOWLESS and rng.random() < 0.7:
        return room
    glazing = style.glazing[int(rng.integers(len(style.glazing)))]
    sill, top = rng.uniform(0.75, 1.05), min(room.ceiling - rng.uniform(0.15, 0.5), 2.7)
    depth = rng.uniform(0.08, 0.3)

    # on the first side at least, in corridors less often
    sides = [side for side in room.exterior if room.kind != "hallway" or rng.random() < 0.35]
    sides = [side for number, side in enumerate(sides) if number == 0 or rng.random() < 0.35]
    openings = list(room.openings)
    low = 0.06 if glazing == "full" else sill
    for side in sides:
        for stretch in free_stretches(room, side, 0.2):
            openings += [
                Opening("window", side, a, b, low, top, depth=depth, glazing=glazing)
                for a, b in _panes(stretch, glazing, rng)
                if b - a > 0.5
            ]
    return replace(room, openings=tuple(openings))


def _panes(stretch: Span, glazing: Glazing, rng: np.random.Generator) -> list[Span]:
    """Divide a free stretch of wall among single windows, or fill it with one."""
    first, last = stretch
    if last - first < 0.8:
        return []
    if glazing != "single":
        inset = rng.uniform(0.0, 0.4)
        return [(first + inset, last - inset)]

    width, gap = rng.uniform(0.9, 1.6), rng.uniform(0.4, 1.2)
    count = max(1, int((last - first + gap) / (width + gap)))
    inset = (last - first - count * width - (count - 1) * gap) / 2
    starts = [first + inset + number * (width + gap) for number in range(count)]
    return [(max(start, first), min(start + width, last)) for start in starts]
