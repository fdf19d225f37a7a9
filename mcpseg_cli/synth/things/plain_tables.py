"""Plain tables of a given size: pupils' desks and work benches."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import boxes, rectangle, solid, stand
from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.models.stand_in import stand_in
from mcpseg_cli.synth.surfaces.styles import Style, pick_metal, pick_wood
from mcpseg_cli.synth.things.table_parts import drawers, panel_legs, post_legs, t_legs, table_top


def school_desk(
    width: float, depth: float, height: float, style: Style, rng: np.random.Generator
) -> Item:
    """Make a desk for one pupil or two, at times with a shelf under its top, its back to y = 0.

    Args:
        width: Along the front, metres.
        depth: Metres.
        height: Metres.
        style: Colours and materials of the building.
        rng: Decides its legs and colours.
    """
    model = stand_in("table", "desk", style, rng, width)
    if model is not None:
        return model
    size = (width, depth)
    parts = [table_top(style, rng, rectangle(width, depth, rng.uniform(0, 0.05)), height)]
    parts += (post_legs, t_legs)[rng.integers(2)](size, height, style, rng)
    if rng.random() < 0.5:
        low, high = height - rng.uniform(0.1, 0.16), width / 2 - 0.07
        shelf = boxes((-high, -depth / 2 + 0.04, low - 0.012), (high, depth / 2 - 0.12, low))
        parts.append(solid(pick_metal(style, rng), shelf))
    return stand("table", parts)


def work_bench(
    width: float, depth: float, height: float, style: Style, rng: np.random.Generator
) -> Item:
    """Make a work bench: a thick top on posts or panels, a board below, drawers; see above."""
    model = stand_in("table", "trestle", style, rng, width)
    if model is not None:
        return model
    wood, thick = pick_wood(style, rng), rng.uniform(0.04, 0.07)
    half, deep, under = width / 2, depth / 2, height - thick
    top = solid(wood, boxes((-half, -deep, under), (half, deep, height)))
    is_open = rng.random() < 0.6
    legs = (
        post_legs((width, depth), under + 0.02, style, rng)
        if is_open
        else panel_legs((width, depth), under + 0.02, wood)
    )

    # a board near the floor, and drawers at one end
    parts = [top, *legs]
    if rng.random() < 0.7:
        low = rng.uniform(0.15, 0.3)
        parts.append(
            solid(
                wood, boxes((0.08 - half, 0.08 - deep, low), (half - 0.08, deep - 0.1, low + 0.02))
            )
        )
    elif width > 1.2:
        parts += drawers(wood, half - 0.35, depth, under, rng)
    return stand("table", parts)
