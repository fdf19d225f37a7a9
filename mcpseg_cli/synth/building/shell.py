"""The shell of a room as seen from inside: everything but its furniture."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from mcpseg_cli.synth.building.ceilings import build_ceiling
from mcpseg_cli.synth.building.doors import build_doors
from mcpseg_cli.synth.building.installations import Finish, build_fixtures
from mcpseg_cli.synth.building.switches_and_signs import build_switches_and_signs
from mcpseg_cli.synth.building.walls import Span, on_wall, wall_of
from mcpseg_cli.synth.building.windows import build_windows
from mcpseg_cli.synth.geometry.solids import Item, Triangles, box, part_of, quad
from mcpseg_cli.synth.plan import Opening, Room
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_colour, pick_wood

_HALL_FLOORS = ("hallway", "WC", "storage", "copyRoom", "lobby", "kitchen", "bathroom")
_MAIN_FLOOR = 0.7  # share of rooms that have the building's main covering for sure
_WET = ("WC", "bathroom")  # tiled rooms without skirting

Dado = tuple[float, Material] | None
"""Height and surface of the lower part of the walls; None where it is like the upper."""


def build_shell(room: Room, style: Style, rng: np.random.Generator) -> list[Item]:
    """Build everything of a room but its furniture.

    Args:
        room: The room, complete with openings and fixtures.
        style: The building's.
        rng: Random numbers.

    Returns:
        Objects in the map frame: one floor, one ceiling, a wall for each side, beams, columns,
        doors, windows and clutter (lamps, blinds, radiators, ducts, pipes, sockets, signs,
        extinguishers). Parts that glow are the lights.
    """
    daylight = rng.uniform(*style.daylight) * (0.15 if rng.random() < 0.15 else 1.0)
    is_hall = room.kind == "hallway"

    # all corridors look the same
    finish = np.random.default_rng(style.hall_seed) if is_hall else rng
    face = _wall_paint(style, finish)
    colours = ((225, 222, 214), (70, 66, 62), (120, 116, 110), style.wood[0])
    trim = paint(pick_colour(colours, finish), finish)
    skirting = finish.uniform(0.06, 0.14) if finish.random() < 0.75 else 0.0
    usual = Finish(face, trim, skirting)

    # floor, ceiling and walls, some of them in a colour of their own
    items = [_floor(room, style, rng, finish)]
    items += build_ceiling(room, style, rng, finish)
    dado = _dado(room, style, finish)
    for side in range(4):
        is_usual = is_hall or rng.random() > style.feature_walls
        own = usual if is_usual else replace(usual, wall=_feature(style, rng))
        items.append(_wall(room, side, own, dado))

    # what is built in
    items += build_fixtures(room, usual, style, rng)
    items += build_doors(room, style, rng)
    items += build_windows(room, style, daylight, rng)
    items += build_switches_and_signs(room, style, rng)
    return items


def _wall_paint(style: Style, rng: np.random.Generator) -> Material:
    """Draw the usual surface of a room's walls."""
    patterns = style.wall_patterns
    pattern = patterns[0] if rng.random() < 0.7 else patterns[int(rng.integers(len(patterns)))]
    return _surface(pattern, style, rng)


def _surface(pattern: str, style: Style, rng: np.random.Generator) -> Material:
    """Return a wall surface of a pattern in the building's colours."""
    colour = pick_colour(style.walls, rng)
    if pattern == "brick":
        brick, scale = pick_colour(style.accents[:2], rng), rng.uniform(0.9, 1.1)
        return Material("brick", brick, (176, 168, 156), scale, int(rng.integers(1 << 30)))
    if pattern == "wood":
        return pick_wood(style, rng)
    if pattern == "concrete":
        return paint(pick_colour(((150, 148, 144), (170, 168, 162)), rng), rng, "concrete", 1.2)
    if pattern == "print":
        printed = paint(colour, rng, "print", rng.uniform(0.08, 0.3))
        faint = rng.uniform(0.85, 0.95)
        return replace(printed, accent=(colour[0] * faint, colour[1] * faint, colour[2] * faint))
    return paint(colour, rng, "plaster" if pattern == "plaster" else "plain", 0.6)


def _feature(style: Style, rng: np.random.Generator) -> Material:
    """Draw the surface of a wall that stands out."""
    if rng.random() >= 0.5:
        return paint(pick_colour(style.accents, rng), rng, "plaster", 0.6)
    others = style.wall_patterns[1:]
    return _surface(others[int(rng.integers(len(others)))] if others else "plaster", style, rng)


def _floor(room: Room, style: Style, rng: np.random.Generator, finish: np.random.Generator) -> Item:
    """Lay the floor, out to the middle of the walls in doors and passages."""
    choices = style.hall_floors if room.kind in _HALL_FLOORS else style.floors
    is_other = finish.random() > _MAIN_FLOOR
    covering = choices[int(finish.integers(len(choices)))] if is_other else choices[0]
    covering = replace(covering, seed=int(finish.integers(1 << 30)))
    (x0, y0), (x1, y1) = room.low, room.high
    parts = [part_of(quad((x0, y0, 0), (x1 - x0, 0, 0), (0, y1 - y0, 0)), covering)]

    # thresholds
    strip = paint((120, 116, 108), rng, "metal") if rng.random() < 0.5 else covering
    for opening in room.openings:
        if opening.kind != "window":
            a, b, deep = opening.start, opening.end, opening.depth
            sheet = on_wall(quad((a, -deep, 0), (b - a, 0, 0), (0, deep, 0)), room, opening.side)
            parts.append(part_of(sheet, covering if opening.kind == "passage" else strip))
    return Item("floor", tuple(parts))


def _dado(room: Room, style: Style, rng: np.random.Generator) -> Dado:
    """Draw the lower part of the walls where it differs: tiles, paint, panels."""
    if room.kind in _WET or (room.kind in ("pantry", "kitchen") and rng.random() < 0.5):
        return rng.uniform(1.4, 2.2), paint((214, 214, 208), rng, "tiles", rng.uniform(0.1, 0.3))
    if rng.random() > 0.08:
        return None
    if rng.random() < 0.4:
        return rng.uniform(0.8, 1.2), pick_wood(style, rng)
    return rng.uniform(0.9, 1.4), paint(pick_colour(style.walls, rng, 30.0), rng, "plaster", 0.6)


def _wall(room: Room, side: int, finish: Finish, dado: Dado) -> Item:
    """Build one wall around its openings, with reveals and skirting."""
    openings = [opening for opening in room.openings if opening.side == side]
    start, end, _, _ = wall_of(room, side)
    pieces: list[tuple[Triangles, Material]] = []

    # its face, at times in two bands, and the sides of the openings
    middle, below = dado or (0.0, finish.wall)
    for low, high, face in ((0.0, middle, below), (middle, room.ceiling, finish.wall)):
        pieces.append((_sheet(start, end, low, high, openings), face))
    pieces += [(_reveal(o), finish.wall) for o in openings if o.kind != "door"]

    if finish.skirting and room.kind not in _WET:
        gaps = [o for o in openings if o.low < finish.skirting]
        for a, b in _spans(start, end, gaps, 0.06):
            pieces.append((box((a, 0, 0), (b, 0.012, finish.skirting)), finish.trim))
    pieces = [(solid, face) for solid, face in pieces if len(solid)]
    if not pieces:  # nothing but a passage
        edge = quad((end, 0, room.ceiling - 0.02), (start - end, 0, 0), (0, 0, 0.02))
        pieces.append((edge, finish.wall))
    return Item("wall", tuple(part_of(on_wall(solid, room, side), face) for solid, face in pieces))


def _spans(start: float, end: float, openings: list[Opening], margin: float) -> list[Span]:
    """Return the stretches of a wall between openings."""
    spans, cursor = [], start
    for opening in sorted(openings, key=lambda o: o.start):
        if opening.start - margin > cursor:
            spans.append((cursor, opening.start - margin))
        cursor = max(cursor, opening.end + margin)
    return [*spans, (cursor, end)] if end > cursor else spans


def _sheet(start: float, end: float, low: float, high: float, openings: list[Opening]) -> Triangles:
    """Return the face of a wall between two heights, openings cut out, in the frame of the wall."""
    # a raster through all edges of openings
    x_edges = [x for o in openings for x in (o.start, o.end) if start < x < end]
    z_edges = [z for o in openings for z in (o.low, o.high) if low < z < high]
    along, up = sorted({start, end, *x_edges}), sorted({low, high, *z_edges})

    sheets = []
    for a, b in itertools.pairwise(along):
        for c, d in itertools.pairwise(up):
            x, z = (a + b) / 2, (c + d) / 2
            if not any(o.start < x < o.end and o.low < z < o.high for o in openings):
                sheets.append(quad((b, 0, c), (a - b, 0, 0), (0, 0, d - c)))
    return np.concatenate(sheets) if sheets else np.zeros((0, 3, 3))


def _reveal(opening: Opening) -> Triangles:
    """Return the inner faces of an opening, in the frame of the wall; none below a passage."""
    a, b, low, high, deep = opening.start, opening.end, opening.low, opening.high, opening.depth
    faces = [
        quad((a, 0, low), (0, -deep, 0), (0, 0, high - low)),
        quad((b, -deep, low), (0, deep, 0), (0, 0, high - low)),
        quad((a, -deep, high), (0, deep, 0), (b - a, 0, 0)),
    ]
    if low > 0:
        faces.append(quad((a, -deep, low), (b - a, 0, 0), (0, deep, 0)))
    return np.concatenate(faces)
