"""Chairs: office chairs, shell chairs, armchairs, stools, benches."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mcpseg_cli.synth.geometry.shapes import (
    bend,
    boxes,
    cushion,
    lathe,
    pipe,
    rod,
    solid,
    stand,
)
from mcpseg_cli.synth.geometry.solids import Item, Part, shifted, tilted
from mcpseg_cli.synth.models.stand_in import stand_in
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import (
    Style,
    paint,
    pick_fabric,
    pick_metal,
    pick_plastic,
    pick_wood,
)
from mcpseg_cli.synth.things.armchairs import club_chair, easy_chair, swivel_tub, wing_chair
from mcpseg_cli.synth.things.boxes_and_bags import bright
from mcpseg_cli.synth.things.chair_parts import (
    armrests,
    back_grid,
    backrest,
    four_legs,
    gas_column,
    seat_cushion,
    shell_seat,
    star_base,
)
from mcpseg_cli.synth.things.wide_seats import armchair, bench


def make_chair(design: str, style: Style, rng: np.random.Generator) -> Item:
    """Make a chair, its back to y = 0.

    Args:
        design: One of ``CHAIR_DESIGNS``.
        style: Colours and materials of the building.
        rng: Decides sizes, shape and colours.

    Returns:
        An object of class chair that stands on z = 0.

    Raises:
        KeyError: There is no such design.
    """
    model = stand_in("chair", design, style, rng)
    return model or stand("chair", CHAIR_DESIGNS[design](style, rng))


def _task(style: Style, rng: np.random.Generator) -> list[Part]:
    """Swivel chair: star base, gas column, cushion, curved back, often arms."""
    fabric, shell_colour = pick_fabric(style, rng), paint((40, 40, 44), rng)
    if rng.random() < 0.35:
        shell_colour = pick_plastic(style, rng)
    frame = pick_metal(style, rng) if rng.random() < 0.4 else shell_colour
    seat, width, depth = rng.uniform(0.43, 0.54), rng.uniform(0.46, 0.52), rng.uniform(0.42, 0.48)
    height, mesh = rng.uniform(0.42, 0.62), rng.random() < 0.4

    # base and seat
    parts = [*star_base(frame, rng.uniform(0.29, 0.35), rng), gas_column(seat - 0.07, rng)]
    parts.append(seat_cushion(fabric, width, depth, rng.uniform(0.06, 0.09), y=-depth / 2, z=seat))

    # the back, and the spine that holds it
    lean, rear, start = rng.uniform(0.05, 0.28), -depth / 2 - 0.04, seat + rng.uniform(0.03, 0.14)
    wide, curve, taper = rng.uniform(0.85, 1.0), rng.uniform(0.03, 0.09), rng.uniform(0, 0.3)
    grid = back_grid(width * wide, height, rng, curve=curve, taper=taper)
    thick = 0.018 if mesh else rng.uniform(0.04, 0.07)
    parts.append(backrest(fabric, grid, thick, y=rear, z=start, lean=lean))
    spine = [(0, 0, seat - 0.06), (0, rear - 0.05, seat - 0.04)]
    spine.append((0, rear - 0.06 - 0.1 * lean, start + 0.22))
    parts.append(solid(shell_colour, pipe(bend(spine, 0.08), 0.028, 6)))

    # arms, and a jacket or a head rest
    if rng.random() < 0.65:
        parts += armrests(shell_colour, frame, width=width, seat=seat, y=-0.12, rng=rng)
    if rng.random() < 0.1:
        parts.append(_jacket(width, height, rng, y=rear, z=start, lean=lean))
    elif rng.random() < 0.2:
        slope, top = np.tan(lean) * height, start + height
        rest = cushion((-0.14, -0.03, -0.07), (0.14, 0.04, 0.08))
        parts.append(solid(fabric, shifted(rest, 0, rear - 0.1 - slope, top + 0.1)))
        post = rod(0.015, top - 0.12, top + 0.1, 0, rear - 0.12 - slope)
        parts.append(solid(shell_colour, post))
    return parts


def _jacket(
    width: float, height: float, rng: np.random.Generator, *, y: float, z: float, lean: float
) -> Part:
    """Hang a jacket over the back of a chair."""
    low = (-width / 2 - 0.04, -0.09, height * rng.uniform(0.1, 0.35))
    cloth = cushion(low, (width / 2 + 0.04, 0.07, height + 0.04), 0.35, 0.3)
    cloth[..., 1] += 0.015 * np.sin(cloth[..., 0] * 22) * (1.2 - cloth[..., 2] / height)
    cloth[..., 0] *= 1.12 - 0.2 * cloth[..., 2:][..., 0] / height
    return solid(paint(bright(rng), rng, "weave", 0.03), shifted(tilted(cloth, lean), 0, y, z))


def _executive(style: Style, rng: np.random.Generator) -> list[Part]:
    """High swivel chair with thick bolsters and padded arms."""
    colour = ((38, 34, 32), (70, 45, 32), (205, 198, 186))[rng.integers(3)]
    leather = paint(colour, rng, "leather", 0.05)
    frame = pick_metal(style, rng) if rng.random() < 0.5 else paint((40, 40, 44), rng)
    seat, width, depth = rng.uniform(0.46, 0.54), rng.uniform(0.5, 0.56), rng.uniform(0.48, 0.53)
    parts = [*star_base(frame, 0.34, rng), gas_column(seat - 0.11, rng)]
    parts.append(seat_cushion(leather, width, depth, 0.13, y=-depth / 2, z=seat))

    # a high back with bolsters across
    lean, bolsters = rng.uniform(0.1, 0.25), int(rng.integers(3, 6))
    height, wing = rng.uniform(0.62, 0.76), rng.uniform(0.02, 0.06)
    grid = back_grid(width, height, rng, curve=wing, taper=0.12)
    parts.append(backrest(leather, grid, 0.05, y=-depth / 2 - 0.05, z=seat - 0.02, lean=lean))
    step, half = height / bolsters, width * 0.42
    rows = [(step * row + 0.01, step * (row + 1)) for row in range(bolsters)]
    pads = np.concatenate([cushion((-half, -0.035, a), (half, 0.06, b)) for a, b in rows])
    parts.append(solid(leather, shifted(tilted(pads, lean), 0, -depth / 2 - 0.02, seat - 0.02)))
    return parts + armrests(leather, frame, width=width, seat=seat, y=-0.15, rng=rng)


def _four_leg(style: Style, rng: np.random.Generator) -> list[Part]:
    """Shell chair or wooden chair on four legs, at times padded or with arms."""
    seat, width = rng.uniform(0.43, 0.48), rng.uniform(0.42, 0.5)
    wooden = rng.random() < 0.35
    frame = pick_wood(style, rng) if wooden else pick_metal(style, rng)
    thick = rng.uniform(0.028, 0.042) if wooden else rng.uniform(0.018, 0.026)
    splay = rng.uniform(0.0, 0.05)
    if wooden and rng.random() < 0.6:
        return _rail_back(width, seat, splay * 0.4, thick, frame, style, rng)

    surface = pick_plastic(style, rng) if rng.random() < 0.6 else pick_wood(style, rng)
    parts = four_legs(width, 0.4, seat - 0.02, splay, thick, frame)
    parts += shell_seat(surface, width, seat, rng)
    if rng.random() < 0.4:
        pad = pick_fabric(style, rng)
        parts.append(seat_cushion(pad, width * 0.92, 0.38, 0.035, y=-0.18, z=seat + 0.03))
    if rng.random() < 0.25:
        parts += armrests(surface, frame, width=width, seat=seat, y=-0.1, rng=rng)
    return parts


def _rail_back(
    width: float,
    seat: float,
    splay: float,
    thick: float,
    frame: Material,
    style: Style,
    rng: np.random.Generator,
) -> list[Part]:
    """Wooden chair with a few rails between the posts of its back."""
    rear, depth = rng.uniform(0.8, 0.98), 0.42
    parts = four_legs(width, depth, seat - 0.03, splay, thick, frame, rear=rear)
    pad = pick_fabric(style, rng) if rng.random() < 0.6 else frame
    parts.append(seat_cushion(pad, width, depth, 0.045, y=-depth / 2, z=seat))

    rails = np.linspace(seat + 0.12, rear - 0.04, int(rng.integers(2, 5)))
    lows = [(-width / 2 + 0.03, -depth / 2 - 0.04, z) for z in rails]
    highs = [(width / 2 - 0.03, -depth / 2 - 0.005, z + 0.05) for z in rails]
    return [*parts, solid(frame, boxes(lows, highs))]


def _cantilever(style: Style, rng: np.random.Generator) -> list[Part]:
    """Chair on a bent tube without rear legs, at times with arms."""
    frame, seat, width = pick_metal(style, rng), rng.uniform(0.43, 0.47), rng.uniform(0.46, 0.52)
    fabric, depth, radius = pick_fabric(style, rng), 0.44, rng.uniform(0.011, 0.014)
    arms = rng.random() < 0.5
    top, half, parts = rng.uniform(0.78, 0.9), depth / 2, []
    rear = -half - 0.08

    # one tube from the foot to the top; with arms another carries the seat
    for x in (-width / 2, width / 2):
        foot = [(x, rear - 0.02, radius), (x, half, radius)]
        back = [(x, -half, seat - 0.03), (x, rear, top)]
        if arms:
            loop = bend([*foot, (x, half + 0.02, 0.66), (x, rear, 0.67)], 0.07)
            parts.append(solid(frame, pipe(loop, radius)))
            parts.append(solid(frame, pipe(bend([(x, half, seat - 0.03), *back], 0.08), radius)))
        else:
            path = bend([*foot, (x, half + 0.03, seat - 0.03), *back], 0.07)
            parts.append(solid(frame, pipe(path, radius)))
    bar = boxes((-width / 2, rear - 0.03, 0), (width / 2, rear - 0.008, 0.022))
    parts.append(solid(frame, bar))

    # seat and back
    wide, thick = width - 0.03, rng.uniform(0.03, 0.06)
    parts.append(seat_cushion(fabric, wide, depth, thick, y=-half, z=seat + 0.02))
    grid = back_grid(wide, top - seat - 0.06, rng, curve=0.02, taper=0.0)
    thin = rng.uniform(0.015, 0.045)
    parts.append(backrest(fabric, grid, thin, y=-half - 0.01, z=seat + 0.08, lean=0.15))
    return parts


def _folding(style: Style, rng: np.random.Generator) -> list[Part]:
    """Folding chair: crossed legs, thin seat and back."""
    frame, width = pick_metal(style, rng), rng.uniform(0.42, 0.46)
    panel = (pick_plastic, pick_wood, pick_fabric)[rng.integers(3)](style, rng)
    parts = []

    # legs, and bars between them
    for x in (-width / 2, width / 2):
        outer = [(x, 0.26, 0.0), (x, -0.15, 0.48), (x, -0.26, 0.8)]
        inner = [(x * 0.9, -0.25, 0.0), (x * 0.9, 0.18, 0.44)]
        parts += [solid(frame, pipe(path, 0.011)) for path in (outer, inner)]
    for y, z in ((0.2, 0.075), (-0.2, 0.06)):
        bar = pipe([(-width / 2, y, z), (width / 2, y, z)], 0.009)
        parts.append(solid(frame, bar))

    parts.append(seat_cushion(panel, width * 0.86, 0.38, 0.03, y=-0.17, z=0.45))
    grid = back_grid(width, rng.uniform(0.16, 0.24), rng, curve=0.03, taper=0.05)
    return [*parts, backrest(panel, grid, 0.014, y=-0.2, z=0.58, lean=0.3)]


def _stool(style: Style, rng: np.random.Generator) -> list[Part]:
    """Stool: bar stool on a disc or legs, or a low swivel stool."""
    kind = int(rng.integers(3))
    frame, radius = pick_metal(style, rng), rng.uniform(0.15, 0.2)
    top = rng.uniform(0.6, 0.8) if kind < 2 else rng.uniform(0.42, 0.55)
    pad = cushion((-radius, -radius, top - 0.07), (radius, radius, top), 1.0, 0.5)
    seat = solid(pick_fabric(style, rng), pad)

    # on a disc, with a ring for the feet
    if kind == 0:
        disc = [(0, 0), (0.21, 0), (0.21, 0.01), (0.03, 0.03), (0.03, top - 0.05), (0, top - 0.05)]
        angles = np.linspace(0, 2 * np.pi, 13)
        ring = pipe([(0.14 * np.cos(a), 0.14 * np.sin(a), 0.26) for a in angles], 0.009)
        return [solid(frame, lathe(disc, 14)), solid(frame, ring), seat]

    # on four legs, or on castors
    if kind == 1:
        wood = pick_wood(style, rng) if rng.random() < 0.6 else frame
        z, corners = rng.uniform(0.2, 0.35), ((-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1))
        rungs = solid(wood, pipe([(x * 0.16, y * 0.16, z) for x, y in corners], 0.01))
        return [*four_legs(0.28, 0.28, top - 0.05, 0.06, 0.03, wood), rungs, seat]
    return [*star_base(frame, 0.25, rng), gas_column(top - 0.06, rng), seat]


CHAIR_DESIGNS: dict[str, Callable[[Style, np.random.Generator], list[Part]]] = {
    "four-leg": _four_leg,
    "stool": _stool,
    "task": _task,
    "executive": _executive,
    "armchair": armchair,
    "folding": _folding,
    "cantilever": _cantilever,
    "bench": bench,
    "club": club_chair,
    "wing": wing_chair,
    "easy": easy_chair,
    "swivel tub": swivel_tub,
}
"""Chairs by name: what makes their parts."""
