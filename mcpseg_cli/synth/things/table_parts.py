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
    material, thick = pick_table_top(style, rng), rng.uniform(0.018, 0.038)
    return solid(material, slab(outline, height - thick, height))


def post_legs(
    size: tuple[float, float], height: float, style: Style, rng: np.random.Generator
) -> list[Part]:
    """Make four legs under a top about the origin, square or round, with an apron."""
    width, depth = size
    frame, thick = frame_material(style, rng), rng.uniform(0.03, 0.07)
    splay = rng.uniform(0, 0.04) * (rng.random() < 0.4)
    inner, edge, top = width / 2 - 0.06, depth / 2 - 0.06, height - 0.02

    parts = []
    for x in (-1, 1):
        for y in (-1, 1):
            knee = np.array([x * inner, y * edge, top])
            foot = knee + np.array([x * splay, y * splay, -top])
            parts.append(solid(frame, slanted(foot, knee, (thick, thick))))

    # the apron, lower at the back
    rear = boxes((-inner, -edge - 0.01, height - 0.09), (inner, -edge + 0.01, top))
    front = boxes((-inner, edge - 0.01, height - 0.07), (inner, edge + 0.01, top))
    return [*parts, solid(frame, rear), solid(frame, front)]


def t_legs(
    size: tuple[float, float], height: float, style: Style, rng: np.random.Generator
) -> list[Part]:
    """Make two T or C legs with feet along the depth."""
    width, depth = size
    frame, inset, wide = pick_metal(style, rng), rng.uniform(0.05, 0.25), rng.uniform(0.05, 0.08)
    back = rng.uniform(-0.5, 0.0) * depth * 0.6
    half, deep, parts = wide / 2, depth / 2, []

    # foot, post and arm of each
    for sign in (-1, 1):
        x = sign * (width / 2 - inset)
        foot = boxes((x - half, -deep + 0.03, 0), (x + half, deep - 0.06, 0.04))
        post = boxes((x - half, back - 0.04, 0.03), (x + half, back + 0.04, height - 0.03))
        arm = boxes((x - 0.02, -deep + 0.06, height - 0.06), (x + 0.02, deep - 0.08, height - 0.02))
        parts += [solid(frame, foot), solid(frame, post), solid(frame, arm)]

    # a beam between them
    inner = width / 2 - inset
    beam = boxes((-inner, back - 0.02, height - 0.09), (inner, back + 0.02, height - 0.03))
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
    front, rear, low = depth / 2 - 0.06, -depth / 2, rng.uniform(0.02, 0.08)
    left, right, edges = x - wide / 2, x + wide / 2, np.linspace(low, top, fronts + 1)
    body = boxes((left, rear + 0.1, low), (right, front, top))
    feet = boxes((left + 0.02, rear + 0.12, 0), (right - 0.02, front - 0.02, low))

    # a front and a handle for each drawer
    faces = boxes(
        [(left, front, z + 0.004) for z in edges[:-1]],
        [(right, front + 0.018, z - 0.004) for z in edges[1:]],
    )
    pulls = boxes(
        [(x - 0.06, front + 0.018, z - 0.05) for z in edges[1:]],
        [(x + 0.06, front + 0.035, z - 0.036) for z in edges[1:]],
    )
    return [solid(material, body, faces, feet), solid(handle, pulls)]


def pillar(material: Material, x: float, depth: float, height: float, *, round_: bool) -> Part:
    """Make what a meeting table stands on: a drum, or a panel on a foot."""
    if round_:
        return solid(material, rod(min(0.25, depth * 0.2), 0, height - 0.02, x, 0, 16))
    lows = [(x - 0.16, -depth * 0.3, 0), (x - 0.06, -depth * 0.22, 0.04)]
    highs = [(x + 0.16, depth * 0.3, 0.05), (x + 0.06, depth * 0.22, height - 0.02)]
    return solid(material, boxes(lows, highs))
