"""The shell of a room as seen from inside: floor, ceiling, walls, beams, columns, doors, windows, lamps and pipes."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from mcpseg_cli.synth.building.ceilings import build_ceiling
from mcpseg_cli.synth.building.fittings import free_stretches, wall_of
from mcpseg_cli.synth.building.joinery import build_doors, build_windows, on_wall
from mcpseg_cli.synth.geometry.solids import (
    Item,
    Part,
    Triangles,
    box,
    circle,
    part_of,
    prism,
    quad,
    shifted,
    tube,
)
from mcpseg_cli.synth.plan import Fixture, Opening, Room
from mcpseg_cli.synth.surfaces.materials import Colour, Material
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_colour, pick_metal, pick_wood

_HALL_FLOORS = ("hallway", "WC", "storage", "copyRoom", "lobby", "kitchen", "bathroom")
_MAIN_FLOOR = 0.7  # share of rooms that have the building's main covering for sure


def build_shell(room: Room, style: Style, rng: np.random.Generator) -> list[Item]:
    """Build everything of a room but its furniture.

    Args:
        room: The room, complete with openings and fixtures.
        style: The building's.
        rng: Random numbers.

    Returns:
        Objects in the map frame: one floor, one ceiling, a wall for each side, and beams, columns,
            doors, windows and
        clutter (lamps, blinds, radiators, ducts, pipes, sockets, signs, extinguishers). Parts that
        glow are the lights.
    """
    daylight = rng.uniform(*style.daylight) * (0.15 if rng.random() < 0.15 else 1.0)
    is_hall = room.kind == "hallway"
    finish = (
        np.random.default_rng(style.hall_seed) if is_hall else rng
    )  # all corridors look the same
    wall = _wall_paint(style, finish)
    trim = paint(
        pick_colour(((225, 222, 214), (70, 66, 62), (120, 116, 110), style.wood[0]), finish), finish
    )
    skirting = finish.uniform(0.06, 0.14) if finish.random() < 0.75 else 0.0
    items = [_floor(room, style, rng, finish)]
    items += build_ceiling(room, style, rng, finish)
    dado = _dado(room, style, finish)
    for side in range(4):
        face = wall if is_hall or rng.random() > style.feature_walls else _feature(style, rng)
        items.append(_wall(room, side, face, trim, skirting, dado))
    items += _fixtures(room, wall, trim, skirting, style, rng)
    items += build_doors(room, style, rng)
    items += build_windows(room, style, daylight, rng)
    items += _fittings(room, style, rng)
    return items


def _wall_paint(style: Style, rng: np.random.Generator) -> Material:
    """Draw the usual surface of a room's walls."""
    pattern = (
        style.wall_patterns[0]
        if rng.random() < 0.7
        else style.wall_patterns[int(rng.integers(len(style.wall_patterns)))]
    )
    return _surface(pattern, style, rng)


def _surface(pattern: str, style: Style, rng: np.random.Generator) -> Material:
    """Return a wall surface of a pattern in the building's colours."""
    colour = pick_colour(style.walls, rng)
    if pattern == "brick":
        mortar: Colour = (176, 168, 156)
        return Material(
            "brick",
            pick_colour(style.accents[:2], rng),
            mortar,
            rng.uniform(0.9, 1.1),
            int(rng.integers(1 << 30)),
        )
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
    if rng.random() < 0.5:
        return (
            _surface(
                style.wall_patterns[int(rng.integers(1, len(style.wall_patterns)))], style, rng
            )
            if len(style.wall_patterns) > 1
            else _surface("plaster", style, rng)
        )
    return paint(pick_colour(style.accents, rng), rng, "plaster", 0.6)


def _floor(room: Room, style: Style, rng: np.random.Generator, finish: np.random.Generator) -> Item:
    """Lay the floor, out to the middle of the walls in doors and passages; ``finish`` draws the covering."""
    choices = style.hall_floors if room.kind in _HALL_FLOORS else style.floors
    covering = (
        choices[int(finish.integers(len(choices)))] if finish.random() > _MAIN_FLOOR else choices[0]
    )
    covering = replace(covering, seed=int(finish.integers(1 << 30)))
    (x0, y0), (x1, y1) = room.low, room.high
    parts = [part_of(quad((x0, y0, 0), (x1 - x0, 0, 0), (0, y1 - y0, 0)), covering)]
    strip = paint((120, 116, 108), rng, "metal") if rng.random() < 0.5 else covering
    for opening in room.openings:
        if opening.kind != "window":
            a, b, deep = opening.start, opening.end, opening.depth
            sheet = on_wall(quad((a, -deep, 0), (b - a, 0, 0), (0, deep, 0)), room, opening.side)
            parts.append(part_of(sheet, covering if opening.kind == "passage" else strip))
    return Item("floor", tuple(parts))


def _dado(room: Room, style: Style, rng: np.random.Generator) -> tuple[float, Material] | None:
    """Draw the height and surface of the lower part of the walls where it differs: tiles, paint, panels."""
    if room.kind in ("WC", "bathroom") or (
        room.kind in ("pantry", "kitchen") and rng.random() < 0.5
    ):
        return rng.uniform(1.4, 2.2), paint((214, 214, 208), rng, "tiles", rng.uniform(0.1, 0.3))
    if rng.random() > 0.08:
        return None
    if rng.random() < 0.4:
        return rng.uniform(0.8, 1.2), pick_wood(style, rng)
    return rng.uniform(0.9, 1.4), paint(pick_colour(style.walls, rng, 30.0), rng, "plaster", 0.6)


def _wall(
    room: Room,
    side: int,
    face: Material,
    trim: Material,
    skirting: float,
    dado: tuple[float, Material] | None,
) -> Item:
    """Build one wall around its openings, with reveals, skirting and sometimes a second colour below."""
    openings = [opening for opening in room.openings if opening.side == side]
    start, end, _, _ = wall_of(room, side)
    parts = []
    bands = [(0.0, room.ceiling, face)]
    if dado is not None:
        bands = [(0.0, dado[0], dado[1]), (dado[0], room.ceiling, face)]
    for low, high, material in bands:
        sheet = _sheet(start, end, low, high, openings)
        if len(sheet):
            parts.append(part_of(on_wall(sheet, room, side), material))
    parts += [part_of(on_wall(_reveal(o), room, side), face) for o in openings if o.kind != "door"]
    if skirting and room.kind not in ("WC", "bathroom"):
        gaps = [o for o in openings if o.low < skirting]
        for a, b in _spans(start, end, gaps, 0.06):
            parts.append(part_of(on_wall(box((a, 0, 0), (b, 0.012, skirting)), room, side), trim))
    if not parts:  # nothing but a passage
        edge = quad((end, 0, room.ceiling - 0.02), (start - end, 0, 0), (0, 0, 0.02))
        parts.append(part_of(on_wall(edge, room, side), face))
    return Item("wall", tuple(parts))


def _spans(
    start: float, end: float, openings: list[Opening], margin: float
) -> list[tuple[float, float]]:
    """Return the stretches of a wall between openings."""
    spans, cursor = [], start
    for opening in sorted(openings, key=lambda o: o.start):
        if opening.start - margin > cursor:
            spans.append((cursor, opening.start - margin))
        cursor = max(cursor, opening.end + margin)
    return [*spans, (cursor, end)] if end > cursor else spans


def _sheet(start: float, end: float, low: float, high: float, openings: list[Opening]) -> Triangles:
    """Return the face of a wall between two heights with the openings cut out, in the frame of the wall."""
    along = sorted(
        {start, end, *(x for o in openings for x in (o.start, o.end) if start < x < end)}
    )
    up = sorted({low, high, *(z for o in openings for z in (o.low, o.high) if low < z < high)})
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


def _fixtures(
    room: Room,
    wall: Material,
    trim: Material,
    skirting: float,
    style: Style,
    rng: np.random.Generator,
) -> list[Item]:
    """Build columns, beams, shafts, radiators, ducts and pipes."""
    plain = replace(wall, seed=wall.seed + 3)
    grey = paint(pick_colour(((150, 148, 142), (172, 168, 160)), rng), rng, "concrete", 1.0)
    column = (
        grey
        if rng.random() < 0.4
        else (plain if rng.random() < 0.7 else paint(pick_colour(style.accents, rng), rng))
    )
    beam = (
        grey if rng.random() < 0.35 else (plain if rng.random() < 0.75 else pick_wood(style, rng))
    )
    items = []
    for fixture in room.fixtures:
        low, high = fixture.low.tolist(), fixture.high.tolist()
        if fixture.kind == "beam":
            items.append(Item("beam", (part_of(box(low, high), beam),)))
        elif fixture.kind in ("column", "round column"):
            items.append(Item("column", tuple(_column(fixture, column, trim, skirting))))
        elif fixture.kind == "shaft":
            items.append(Item("wall", (part_of(box(low, high), plain),)))
        elif fixture.kind == "radiator":
            items.append(_radiator(room, fixture, rng))
        else:
            items.append(_duct(room, fixture, style, rng))
    return items


def _column(fixture: Fixture, face: Material, trim: Material, skirting: float) -> list[Part]:
    """Build a column, with a skirting around its foot if the room has one."""
    low, high = fixture.low, fixture.high
    if fixture.kind == "round column":
        x, y = ((low + high) / 2)[:2].tolist()
        radius = float(high[0] - low[0]) / 2
        return [part_of(prism(circle(radius, 20, x, y), float(low[2]), float(high[2])), face)]
    parts = [part_of(box(low.tolist(), high.tolist()), face)]
    if skirting:
        edge = np.array([0.012, 0.012, 0.0])
        parts.append(
            part_of(box((low - edge).tolist(), (*(high + edge)[:2].tolist(), skirting)), trim)
        )
    return parts


def _radiator(room: Room, fixture: Fixture, rng: np.random.Generator) -> Item:
    """Build a radiator with its brackets and feed pipes."""
    white = paint((226, 224, 216), rng, "stripes", rng.uniform(0.03, 0.07))
    low, high = fixture.low, fixture.high
    along = int(np.argmax((high - low)[:2]))
    parts = [part_of(box(low.tolist(), high.tolist()), white)]
    for share in (0.06, 0.94):
        foot = (low + high) / 2
        foot[along] = low[along] + share * (high - low)[along]
        parts.append(
            part_of(tube((foot[0], foot[1], 0.0), (foot[0], foot[1], float(low[2])), 0.012), white)
        )
    return Item("clutter", tuple(parts))


def _duct(room: Room, fixture: Fixture, style: Style, rng: np.random.Generator) -> Item:
    """Run a duct (round or square) or a pipe along the ceiling on hangers."""
    low, high = fixture.low, fixture.high
    along = int(np.argmax((high - low)[:2]))
    middle = (low + high) / 2
    first, last = middle.copy(), middle.copy()
    first[along], last[along] = low[along], high[along]
    size = float(high[2] - low[2])
    metal = (
        pick_metal(style, rng)
        if rng.random() < 0.6
        else paint(pick_colour(style.walls + style.accents, rng), rng)
    )
    if fixture.kind == "duct" and rng.random() < 0.5:
        parts = [part_of(box(low.tolist(), high.tolist()), metal)]
    else:
        parts = [
            part_of(tube(first.tolist(), last.tolist(), size / 2, 14 if size > 0.15 else 8), metal)
        ]
    for place in np.arange(low[along] + 0.5, high[along], 2.0).tolist():
        hanger = middle.copy()
        hanger[along] = place
        top = (float(hanger[0]), float(hanger[1]), room.ceiling)
        parts.append(part_of(tube((top[0], top[1], float(high[2]) - 0.01), top, 0.006, 4), metal))
    return Item("clutter", tuple(parts))


def _fittings(room: Room, style: Style, rng: np.random.Generator) -> list[Item]:
    """Put switches, sockets and conduits on the walls, in public buildings signs and extinguishers too."""
    items = []
    is_public_hall = room.kind == "hallway" and style.is_public
    white, grey = paint((228, 226, 218), rng), paint((150, 150, 148), rng, "metal")
    for side in range(4):
        low = [s for s in free_stretches(room, side, 0.12, 0.0, 1.6) if s[1] - s[0] > 0.5]
        for a, b in low:
            for x in rng.uniform(
                a + 0.05, b - 0.1, int(rng.integers(0, 1 + int((b - a) / 1.5)))
            ).tolist():
                plate = box((x, 0, 0.24), (x + rng.uniform(0.08, 0.24), 0.011, 0.32))
                items.append(Item("clutter", (part_of(on_wall(plate, room, side), white),)))
        for door in [o for o in room.openings if o.kind == "door" and o.side == side]:
            items += _beside_door(room, door, low, white, rng, is_public_hall=is_public_hall)
        if is_public_hall and low and rng.random() < 0.4:
            a, b = low[int(rng.integers(len(low)))]
            items.append(_extinguisher(room, side, rng.uniform(a + 0.1, b - 0.1), rng))
        if low and rng.random() < 0.1:
            a, b = low[int(rng.integers(len(low)))]
            x = rng.uniform(a, b)
            pipe = tube((x, 0.016, 0.0), (x, 0.016, room.ceiling), rng.uniform(0.01, 0.016))
            items.append(Item("clutter", (part_of(on_wall(pipe, room, side), grey),)))
    return items


def _beside_door(
    room: Room,
    door: Opening,
    free: list[tuple[float, float]],
    white: Material,
    rng: np.random.Generator,
    *,
    is_public_hall: bool,
) -> list[Item]:
    """Put a switch (inside) or a name plate (in public corridors) beside a door, and a sign above some."""
    items = []
    for x in (door.end + 0.14, door.start - 0.22):
        if any(a <= x and x + 0.14 <= b for a, b in free):
            wide, low, high = (0.14, 1.45, 1.6) if is_public_hall else (0.08, 1.05, 1.13)
            plate = on_wall(box((x, 0, low), (x + wide, 0.011, high)), room, door.side)
            face = (
                Material("paper", (214, 214, 210), (60, 60, 66), 0.1, white.seed)
                if is_public_hall
                else white
            )
            items.append(Item("clutter", (part_of(plate, face),)))
            break
    if is_public_hall and rng.random() < 0.15 and door.high + 0.35 < room.ceiling:
        x = (door.start + door.end) / 2
        sign = on_wall(
            box((x - 0.15, 0, door.high + 0.1), (x + 0.15, 0.03, door.high + 0.26)), room, door.side
        )
        items.append(
            Item(
                "clutter",
                (part_of(sign, Material("print", (40, 140, 84), (230, 240, 232), 0.1, 1, 0.25)),),
            )
        )
    return items


def _extinguisher(room: Room, side: int, x: float, rng: np.random.Generator) -> Item:
    """Hang a fire extinguisher."""
    red = paint((186, 34, 30), rng)
    tank = shifted(prism(circle(0.075, 10), 0.5, 0.95), x, 0.085)
    neck = shifted(prism(circle(0.03, 6), 0.95, 1.05), x, 0.085)
    bracket = box((x - 0.03, 0, 0.7), (x + 0.03, 0.02, 0.8))
    parts = (
        part_of(on_wall(tank, room, side), red),
        part_of(on_wall(neck, room, side), paint((30, 30, 32), rng)),
        part_of(on_wall(bracket, room, side), paint((90, 90, 90), rng)),
    )
    return Item("clutter", parts)
