"""Parts that chairs have in common: backs, seats, star bases, armrests, legs."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import (
    Points,
    bend,
    boxes,
    cushion,
    lathe,
    pipe,
    rod,
    shell,
    slanted,
    solid,
)
from mcpseg_cli.synth.geometry.solids import Part, shifted, tilted, turned
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import paint


def back_grid(
    width: float, height: float, rng: np.random.Generator, *, curve: float, taper: float = 0.1
) -> Points:
    """Return a (11, 7, 3) grid of a backrest, from z = 0 up, its middle at y = 0, hollow across."""
    rows = (1 - np.cos(np.linspace(0, np.pi, 11))) / 2  # close together where the outline bends
    up, across = np.meshgrid(rows, np.linspace(-1, 1, 7), indexing="ij")

    # the outline has round corners and a waist
    power = rng.uniform(2.5, 7.0)
    corner = (1 - np.abs(2 * up - 1) ** power) ** (1 / power)
    end, waist = rng.uniform(0.55, 0.85), rng.uniform(-0.08, 0.1)
    outline = (end + (1 - end) * corner) * (1 - waist * np.sin(np.pi * up) ** 2)
    x = across * width / 2 * (1 - taper * up) * outline

    # it bends about the sitter and supports the loins
    lumbar = rng.uniform(0.01, 0.03) * np.sin(np.pi * np.clip(up * 1.6, 0, 1))
    y = curve * across**2 + lumbar - rng.uniform(0.03, 0.1) * up**2
    return np.stack([x, y, up * height], axis=-1)


def backrest(
    material: Material, grid: Points, thickness: float, *, y: float, z: float, lean: float
) -> Part:
    """Make a backrest of a grid, leaning back about its lower edge."""
    return solid(material, shifted(tilted(shell(grid[:, ::-1], thickness), lean), 0, y, z))


def seat_cushion(
    material: Material, width: float, depth: float, thickness: float, *, y: float, z: float
) -> Part:
    """Make a seat cushion under z whose front edge rolls down."""
    grid = cushion((-width / 2, y, z - thickness), (width / 2, y + depth, z), 0.4, 0.5)
    front = np.clip((grid[..., 1] - y) / depth, 0, 1)
    hollow = 0.012 * (1 - (2 * grid[..., 0] / width) ** 2)
    grid[..., 2] -= 0.03 * front**6 + hollow * (grid[..., 2] > z - thickness / 2)
    return solid(material, grid)


def star_base(
    material: Material, radius: float, rng: np.random.Generator, legs: int = 5
) -> list[Part]:
    """Make a star base about the z axis with castors, and the column up from it."""
    castor_z, spokes, castors = 0.028, [], []
    rubber = paint((35, 35, 38), rng)
    turn = rng.uniform(0, 2)
    for number in range(legs):
        # higher and narrower towards the middle
        angle = turn + number * 2 * np.pi / legs
        grid = boxes([(0.02, -0.022, 0.062)], [(radius, 0.022, 0.095)])
        inner = 1 - grid[..., 0] / radius
        grid[..., 2] += 0.035 * inner
        grid[..., 1] *= 0.6 + 0.6 * inner
        spokes.append(turned(grid, angle))

        # a castor that points anywhere
        wheel = tilted(rod(castor_z, -0.024, 0.024, sides=9), np.pi / 2)
        swivel = rng.uniform(0, 6.3)
        castors.append(turned(shifted(turned(wheel, swivel), radius - 0.03, 0, castor_z), angle))
        castors.append(turned(rod(0.008, castor_z, 0.07, radius - 0.03, 0, 5), angle))
    return [solid(material, *spokes), solid(rubber, *castors)]


def gas_column(height: float, rng: np.random.Generator) -> Part:
    """Make a gas column with its bellows up to the seat."""
    dark = paint((50, 50, 54), rng, "metal")
    sleeve = [(0, 0.06), (0.034, 0.06), (0.034, 0.12), (0.026, 0.13), (0.026, height * 0.62)]
    plate = boxes([(-0.09, -0.12, height - 0.03)], [(0.09, 0.1, height)])
    return solid(dark, lathe([*sleeve, (0.015, height * 0.63), (0.015, height)], 9), plate)


def armrests(
    pad: Material, frame: Material, *, width: float, seat: float, y: float, rng: np.random.Generator
) -> list[Part]:
    """Make two armrests at the sides of a seat: on posts, or as loops."""
    rise, depth = rng.uniform(0.18, 0.25), rng.uniform(0.2, 0.28)
    is_loop = rng.random() < 0.3
    top, end, parts = seat + rise, y + depth, []
    for sign in (-1, 1):
        x = sign * (width / 2 + 0.035)
        if is_loop:
            rear = [(x * 0.7, y, seat - 0.04), (x, y, seat), (x, y - 0.02, top)]
            front = [(x, end, top), (x, end - 0.02, seat), (x * 0.7, end, seat - 0.04)]
            parts.append(solid(pad, pipe(bend([*rear, *front], 0.07), 0.018, 6)))
            continue

        # a post out from under the seat, a pad on it
        out = [(sign * 0.1, y + 0.1, seat - 0.07), (x, y + 0.1, seat - 0.06), (x, y + 0.1, top)]
        parts.append(solid(frame, pipe(bend(out, 0.05), 0.017)))
        rest = cushion((x - 0.04, y - 0.02, top - 0.01), (x + 0.04, end, top + 0.025))
        parts.append(solid(pad, rest))
    return parts


def four_legs(
    width: float,
    depth: float,
    seat: float,
    splay: float,
    thick: float,
    material: Material,
    *,
    rear: float = 0.0,
) -> list[Part]:
    """Make four legs under a seat; those at the back go up to ``rear`` beyond it."""
    parts = []
    for x in (-1, 1):
        for y in (-1, 1):
            top = (x * (width / 2 - 0.03), y * (depth / 2 - 0.03), seat)
            foot = (top[0] + x * splay, top[1] + y * splay, 0.0)
            parts.append(solid(material, slanted(foot, top, (thick, thick))))
    if rear > 0:
        first = [(x * (width / 2 - 0.03), -depth / 2 + 0.03, seat) for x in (-1, 1)]
        last = [(x * (width / 2 - 0.03), -depth / 2 - 0.04, rear) for x in (-1, 1)]
        parts.append(solid(material, slanted(first, last, (thick, thick))))
    return parts


def shell_seat(
    material: Material, width: float, seat: float, rng: np.random.Generator
) -> list[Part]:
    """Make a seat and back of bent plastic or plywood, centred, the seat's front at +y."""
    depth, height, thin = rng.uniform(0.4, 0.44), rng.uniform(0.32, 0.42), rng.uniform(0.008, 0.016)
    along, across = np.meshgrid(np.linspace(0, 1, 8), np.linspace(-1, 1, 7), indexing="ij")

    # the seat: narrower at its ends, hollow behind, rolling down before
    dish = rng.uniform(0.01, 0.03)
    x = across * width / 2 * (0.9 + 0.1 * along) * (1 - 0.14 * np.abs(2 * along - 1) ** 5)
    sag = dish * across**2 * (1 - along)
    z = seat - thin + sag - 0.03 * along**5 + 0.02 * (1 - along) ** 3
    bottom = np.stack([x, (along - 0.5) * depth, z], axis=-1)

    # the back, of one piece with it or over a gap
    low = 0.012 if rng.random() < 0.5 else rng.uniform(0.08, 0.16)
    curve, taper = rng.uniform(0.03, 0.08), rng.uniform(0, 0.25)
    grid = back_grid(width * 0.95, height, rng, curve=curve, taper=taper)
    tip = rng.uniform(0.1, 0.3)
    back = backrest(material, grid, thin, y=-depth / 2 - 0.01, z=seat + low, lean=tip)
    parts = [solid(material, shell(bottom[:, ::-1], thin)), back]

    # two bars hold the back over the gap
    if low > 0.05:
        rear, under = -depth / 2, seat - 0.02
        for x0 in (-width * 0.25, width * 0.25):
            path = [(x0, rear + 0.08, under), (x0, rear - 0.03, under)]
            path.append((x0, rear - 0.06, seat + low + 0.14))
            parts.append(solid(paint((150, 152, 156), rng, "metal"), pipe(bend(path, 0.05), 0.01)))
    return parts
