"""Parts that tables have in common: tops, legs, drawers."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import Points, boxes, rod, slab, slanted, solid
from mcpseg_cli.synth.geometry.solids import Part
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_metal, pick_table_top, pick_wood


def frame_material(style: Style, rng: np.random.Generator) -> Material:
    """Pick what legs are made of."""
    return pick_metal(style, rng) if rng.random() < 0.65 else pick_wood(style, rng)


def table_top(style: Style, rng: np.random.Generator, outline: Points, height: float) -> Part:
    """Make a table top under a height."""
    return solid(
        pick_table_top(style, rng), slab(outline, height - rng.uniform(0.018, 0.038), height)
    )


def post_legs(
    size: tuple[float, float], height: float, style: Style, rng: np.random.Generator
) -> list[Part]:
    """Make four legs under a top about the origin, square or round, with an apron."""
    width, depth = size
    frame, thick, splay = (
        frame_material(style, rng),
        rng.uniform(0.03, 0.07),
        rng.uniform(0, 0.04) * (rng.random() < 0.4),
    )
    parts, top = [], height - 0.02
    for x in (-1, 1):
        for y in (-1, 1):
            spot = np.array([x * (width / 2 - 0.06), y * (depth / 2 - 0.06), top])
            foot = spot + np.array([x * splay, y * splay, -top])
            parts.append(solid(frame, slanted(foot, spot, (thick, thick))))
    inner, edge = width / 2 - 0.06, depth / 2 - 0.06
    parts.append(
        solid(frame, boxes([(-inner, -edge - 0.01, height - 0.09)], [(inner, -edge + 0.01, top)]))
    )
    parts.append(
        solid(frame, boxes([(-inner, edge - 0.01, height - 0.07)], [(inner, edge + 0.01, top)]))
    )
    return parts


def t_legs(
    size: tuple[float, float], height: float, style: Style, rng: np.random.Generator
) -> list[Part]:
    """Make two T or C legs with feet along the depth."""
    width, depth = size
    frame, inset, wide = pick_metal(style, rng), rng.uniform(0.05, 0.25), rng.uniform(0.05, 0.08)
    back = rng.uniform(-0.5, 0.0) * depth * 0.6
    parts = []
    for sign in (-1, 1):
        x = sign * (width / 2 - inset)
        low, high = (x - wide / 2, -depth / 2 + 0.03, 0), (x + wide / 2, depth / 2 - 0.06, 0.04)
        post = boxes(
            [(x - wide / 2, back - 0.04, 0.03)], [(x + wide / 2, back + 0.04, height - 0.03)]
        )
        arm = boxes(
            [(x - 0.02, -depth / 2 + 0.06, height - 0.06)],
            [(x + 0.02, depth / 2 - 0.08, height - 0.02)],
        )
        parts += [solid(frame, boxes([low], [high])), solid(frame, post), solid(frame, arm)]
    beam = boxes(
        [(-width / 2 + inset, back - 0.02, height - 0.09)],
        [(width / 2 - inset, back + 0.02, height - 0.03)],
    )
    return [*parts, solid(frame, beam)]


def panel_legs(size: tuple[float, float], height: float, material: Material) -> list[Part]:
    """Make two side panels."""
    width, depth = size
    lows = [(x, -depth / 2 + 0.02, 0) for x in (-width / 2, width / 2 - 0.025)]
    highs = [(x + 0.025, depth / 2 - 0.03, height - 0.02) for x in (-width / 2, width / 2 - 0.025)]
    return [solid(material, boxes(low, high)) for low, high in zip(lows, highs, strict=True)]


def drawers(
    material: Material, x: float, depth: float, top: float, rng: np.random.Generator
) -> list[Part]:
    """Make drawers under a desk about x, their fronts at the desk's."""
    handle, fronts, wide = paint((170, 170, 172), rng, "metal"), int(rng.integers(2, 5)), 0.41
    front, low = depth / 2 - 0.06, rng.uniform(0.02, 0.08)
    edges = np.linspace(low, top, fronts + 1)
    body = boxes([(x - wide / 2, -depth / 2 + 0.1, low)], [(x + wide / 2, front, top)])
    faces = boxes(
        [(x - wide / 2, front, z + 0.004) for z in edges[:-1]],
        [(x + wide / 2, front + 0.018, z - 0.004) for z in edges[1:]],
    )
    pulls = boxes(
        [(x - 0.06, front + 0.018, z - 0.05) for z in edges[1:]],
        [(x + 0.06, front + 0.035, z - 0.036) for z in edges[1:]],
    )
    feet = boxes(
        [(x - wide / 2 + 0.02, -depth / 2 + 0.12, 0)], [(x + wide / 2 - 0.02, front - 0.02, low)]
    )
    return [solid(material, body, faces, feet), solid(handle, pulls)]


def pillar(material: Material, x: float, depth: float, height: float, *, round_: bool) -> Part:
    """Make what a meeting table stands on: a drum, or a panel on a foot."""
    if round_:
        return solid(material, rod(min(0.25, depth * 0.2), 0, height - 0.02, x, 0, 16))
    lows = [(x - 0.16, -depth * 0.3, 0), (x - 0.06, -depth * 0.22, 0.04)]
    return solid(
        material,
        boxes(lows, [(x + 0.16, depth * 0.3, 0.05), (x + 0.06, depth * 0.22, height - 0.02)]),
    )
