"""Sofas with cushions."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import Points, boxes, cushion, slanted, solid, stand
from mcpseg_cli.synth.geometry.solids import Item, Part, shifted, tilted
from mcpseg_cli.synth.models.stand_in import stand_in
from mcpseg_cli.synth.surfaces.materials import Colour, Material
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_fabric, pick_metal, pick_wood

_LEATHERS: tuple[Colour, ...] = ((45, 36, 32), (120, 70, 42), (210, 200, 185))
_LOOSE: tuple[Colour, ...] = ((190, 90, 50), (60, 110, 120), (200, 170, 70), (90, 60, 110))


def make_sofa(seats: int, style: Style, rng: np.random.Generator) -> Item:
    """Make a sofa, its back to y = 0.

    Args:
        seats: How many sit on it, 1-4.
        style: Colours and materials of the building.
        rng: Decides sizes, shape and colours.

    Returns:
        An object of class sofa that stands on z = 0.
    """
    model = stand_in("sofa", "sofa", style, rng, 0.63 * seats + 0.3)
    if model is not None:
        return model
    fabric = pick_fabric(style, rng)
    if rng.random() < 0.25:
        fabric = paint(_LEATHERS[rng.integers(len(_LEATHERS))], rng, "leather", 0.05)
    place, arm = rng.uniform(0.55, 0.72), rng.uniform(0.09, 0.24) * (rng.random() < 0.88)
    depth, foot, seat = rng.uniform(0.78, 0.98), rng.uniform(0.03, 0.15), rng.uniform(0.38, 0.46)
    size = np.array([seats * place + 2 * arm, depth, rng.uniform(0.66, 0.9)])

    # frame, then cushions
    parts = [_base(fabric, size, foot, seat - 0.13), _rear(fabric, size, foot, arm, rng)]
    parts += _feet(style, size, foot, rng)
    if arm > 0:
        parts += _arms(fabric, size, foot, arm, rng)
    parts += _cushions(fabric, seats, place, size, seat, rng)
    if rng.random() < 0.15 and seats > 1:
        parts.append(_chaise(fabric, place, size, seat, rng))
    return stand("sofa", parts)


def _base(fabric: Material, size: Points, low: float, high: float) -> Part:
    """Make the box under the seats."""
    half, depth = float(size[0]) / 2 - 0.02, float(size[1])
    return solid(fabric, cushion((-half, 0.03, low), (half, depth - 0.02, high), 0.08, 0.15))


def _rear(
    fabric: Material, size: Points, foot: float, arm: float, rng: np.random.Generator
) -> Part:
    """Make the frame behind the cushions."""
    width, _, height = size.tolist()
    half = width / 2 - arm * 0.8
    thick, top = rng.uniform(0.14, 0.2), height - rng.uniform(0.02, 0.12)
    return solid(fabric, cushion((-half, 0, foot), (half, thick, top), 0.12, 0.3))


def _feet(style: Style, size: Points, foot: float, rng: np.random.Generator) -> list[Part]:
    """Make four feet."""
    material = pick_wood(style, rng) if rng.random() < 0.5 else pick_metal(style, rng)
    width, depth, _ = size.tolist()
    spots = [(x * (width / 2 - 0.08), y) for x in (-1, 1) for y in (0.1, depth - 0.1)]
    posts = [slanted((x, y, 0), (x, y, foot + 0.03), (0.045, 0.045)) for x, y in spots]
    return [solid(material, post) for post in posts]


def _arms(
    fabric: Material, size: Points, foot: float, arm: float, rng: np.random.Generator
) -> list[Part]:
    """Make the two arms: blocks, rolled or low."""
    width, depth, _ = size.tolist()
    top, round_side = rng.uniform(0.5, 0.66), rng.uniform(0.15, 0.5)
    shapes = [
        cushion((x, 0.02, foot), (x + arm, depth - 0.01, top), 0.15, round_side)
        for x in (-width / 2, width / 2 - arm)
    ]
    return [solid(fabric, shape) for shape in shapes]


def _cushions(
    fabric: Material, seats: int, place: float, size: Points, seat: float, rng: np.random.Generator
) -> list[Part]:
    """Make seat and back cushions, each pressed a little differently, at times a loose one."""
    parts, depth, height = [], float(size[1]), float(size[2])
    thick, back = rng.uniform(0.12, 0.18), rng.uniform(0.13, 0.2)
    for number in range(seats):
        x = (number - seats / 2) * place
        press = rng.uniform(0, 0.02)
        low, high = (x + 0.004, 0.2, seat - thick), (x + place - 0.004, depth + 0.01, seat - press)
        parts.append(solid(fabric, cushion(low, high, 0.18, 0.4)))

        # what one leans against
        top = height - seat + rng.uniform(0, 0.05)
        rest = cushion((0.01, -back / 2, 0), (place - 0.01, back / 2, top), 0.25, 0.45)
        leaned = shifted(tilted(rest, rng.uniform(0.08, 0.2)), x, 0.17 + back / 2, seat - 0.02)
        parts.append(solid(fabric, leaned))

    if rng.random() < 0.5:
        loose = paint(_LOOSE[rng.integers(len(_LOOSE))], rng, "weave", 0.03)
        pad = tilted(cushion((-0.2, -0.06, 0), (0.2, 0.06, 0.38), 0.45, 0.5), rng.uniform(0.2, 0.4))
        x = rng.choice([-1.0, 1.0]) * (seats * place / 2 - 0.24)
        parts.append(solid(loose, shifted(pad, float(x), 0.17 + back + 0.13, seat - 0.01)))
    return parts


def _chaise(
    fabric: Material, place: float, size: Points, seat: float, rng: np.random.Generator
) -> Part:
    """Make the long end of an L-shaped sofa."""
    depth = float(size[1])
    x = float(size[0]) / 2 * rng.choice([-1.0, 1.0])
    low, high = min(x, x - np.sign(x) * place), max(x, x - np.sign(x) * place)
    end = depth + rng.uniform(0.5, 0.7)
    body = cushion((low, depth - 0.02, seat - 0.15), (high, end, seat), 0.15, 0.35)
    plinth = boxes([(low + 0.03, depth - 0.02, 0)], [(high - 0.03, depth + 0.45, seat - 0.13)])
    return solid(fabric, body, plinth)
