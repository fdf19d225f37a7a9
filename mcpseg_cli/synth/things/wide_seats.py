"""Wide seats of class chair: armchairs and benches."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import boxes, cushion, shell, slanted, solid
from mcpseg_cli.synth.geometry.solids import Part, Triangles, shifted, tilted
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import Style, pick_fabric, pick_metal, pick_plastic, pick_wood
from mcpseg_cli.synth.things.chair_parts import four_legs, shell_seat


def armchair(style: Style, rng: np.random.Generator) -> list[Part]:
    """Upholstered armchair: boxy, or a tub."""
    fabric, seat = pick_fabric(style, rng), rng.uniform(0.38, 0.45)
    leg = pick_wood(style, rng) if rng.random() < 0.5 else pick_metal(style, rng)
    foot = rng.uniform(0.08, 0.2)
    width, depth, arm = rng.uniform(0.6, 0.8), rng.uniform(0.62, 0.78), rng.uniform(0.07, 0.14)
    top, rise = rng.uniform(0.7, 0.92), rng.uniform(0.56, 0.66)
    tub = rng.random() < 0.45
    inset = 0.26 if tub else 0.1
    parts = [solid(leg, triangles) for triangles in _feet(width - inset, depth - inset, foot, rng)]
    half, rear = width / 2, -depth / 2
    if tub:
        return parts + _tub(half, -rear, (foot, seat, rise, top), fabric)

    # seat on a box
    inner = half - arm
    pad = cushion((-inner, rear + 0.1, foot + 0.1), (inner, -rear, seat), 0.2, 0.35)
    below = boxes((-inner, rear + 0.05, foot), (inner, -rear - 0.03, foot + 0.12))
    parts += [solid(fabric, pad), solid(fabric, below)]

    # back and arms
    slope = tilted(cushion((-inner, -0.08, 0), (inner, 0.09, top - foot), 0.25, 0.3), 0.12)
    parts.append(solid(fabric, shifted(slope, 0, rear + 0.08, foot)))
    for x in (-half, half - arm):
        block = cushion((x, rear + 0.02, foot), (x + arm, -rear - 0.02, rise), 0.25, 0.35)
        parts.append(solid(fabric, block))
    return parts


def _tub(
    half: float, reach: float, heights: tuple[float, float, float, float], fabric: Material
) -> list[Part]:
    """Make a wall bent around a seat; heights are those of feet, seat, front and back."""
    foot, seat, rise, top = heights
    angle, up = np.meshgrid(np.linspace(-2.3, 2.3, 15), np.linspace(0, 1, 4), indexing="ij")
    lift = foot + (rise + (top - rise) * np.cos(angle / 2.3 * np.pi / 2) - foot) * up
    bulge = 1 + 0.06 * up
    x, y = np.sin(angle) * (half - 0.05) * bulge, -np.cos(angle) * (reach - 0.05) * bulge
    bowl = np.stack([x, y, lift], -1)

    parts = [solid(fabric, shell(piece, 0.08)) for piece in (bowl[:6], bowl[5:10], bowl[9:])]
    radius = half - 0.09
    pad = cushion((-radius, -reach + 0.1, foot), (radius, reach - 0.02, seat), 0.8, 0.3)
    return [*parts, solid(fabric, pad)]


def _feet(width: float, depth: float, height: float, rng: np.random.Generator) -> list[Triangles]:
    """Return four short feet about the origin."""
    splay = rng.uniform(0, 0.03)
    spots = [(x, y) for x in (-1, 1) for y in (-1, 1)]
    tops = [(x * width / 2, y * depth / 2, height + 0.02) for x, y in spots]
    return [
        slanted((x + np.sign(x) * splay, y + np.sign(y) * splay, 0), (x, y, z), (0.035, 0.035))
        for x, y, z in tops
    ]


def bench(style: Style, rng: np.random.Generator) -> list[Part]:
    """Bench: wooden, or a row of shells on a beam as in waiting areas."""
    frame = pick_metal(style, rng)
    if rng.random() < 0.5:
        wood, length, depth = pick_wood(style, rng), rng.uniform(1.1, 1.8), rng.uniform(0.32, 0.45)
        planks = np.linspace(-depth / 2, depth / 2, int(rng.integers(2, 6)))
        lows = [(-length / 2, y, 0.41) for y in planks[:-1] + 0.005]
        highs = [(length / 2, y, 0.45) for y in planks[1:] - 0.005]
        legs = four_legs(length - 0.2, depth, 0.41, 0.0, 0.05, frame)
        return [solid(wood, boxes(lows, highs)), *legs]

    # shells of one form
    count, shade, parts = int(rng.integers(2, 5)), pick_plastic(style, rng), []
    for number in range(count):
        seat = shell_seat(shade, 0.46, 0.44, np.random.default_rng(int(style.tidiness * 100) + 3))
        parts += [part.moved(x=(number - (count - 1) / 2) * 0.54) for part in seat]

    # the beam on two feet
    half = count * 0.54 / 2
    parts.append(solid(frame, boxes((-half, -0.04, 0.34), (half, 0.03, 0.41))))
    for x in (-half + 0.2, half - 0.2):
        lows = [(x - 0.025, -0.25, 0), (x - 0.02, -0.02, 0)]
        highs = [(x + 0.025, 0.25, 0.03), (x + 0.02, 0.02, 0.35)]
        parts.append(solid(frame, boxes(lows, highs)))
    return parts
