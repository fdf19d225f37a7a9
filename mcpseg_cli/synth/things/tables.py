"""Tables and desks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mcpseg_cli.synth.geometry.shapes import (
    bend,
    boxes,
    ellipse,
    lathe,
    pipe,
    rectangle,
    slab,
    slanted,
    solid,
    stand,
)
from mcpseg_cli.synth.geometry.solids import Item, Part, Triangles, shifted
from mcpseg_cli.synth.models.stand_in import stand_in
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_metal, pick_plastic
from mcpseg_cli.synth.things.table_parts import (
    drawers,
    frame_material,
    panel_legs,
    pillar,
    post_legs,
    t_legs,
    table_top,
)


def make_table(design: str, style: Style, rng: np.random.Generator) -> Item:
    """Make a table, its back to y = 0; one sits at it from +y.

    Args:
        design: One of ``TABLE_DESIGNS``.
        style: Colours and materials of the building.
        rng: Decides sizes, shape and colours.

    Returns:
        An object of class table that stands on z = 0; its first part is the top.

    Raises:
        KeyError: There is no such design.
    """
    model = stand_in("table", design, style, rng)
    return model or stand("table", TABLE_DESIGNS[design](style, rng))


def _desk(style: Style, rng: np.random.Generator) -> list[Part]:
    """Desk: posts, T legs or panels, at times with drawers, a modesty panel and a cable tray."""
    width, depth, height = rng.uniform(1.2, 1.9), rng.uniform(0.6, 0.85), rng.uniform(0.7, 0.77)
    return _worktop(width, depth, height, style, rng)


def _standing(style: Style, rng: np.random.Generator) -> list[Part]:
    """Desk on lifting columns, up or down."""
    width, depth, height = rng.uniform(1.2, 1.8), rng.uniform(0.65, 0.8), rng.uniform(0.75, 1.12)
    parts = [table_top(style, rng, rectangle(width, depth, rng.uniform(0, 0.06)), height)]
    parts += t_legs((width, depth), height, style, rng)

    # the switch under its front edge
    switch = paint((45, 45, 48), rng)
    low = (width / 2 - 0.3, depth / 2 - 0.06, height - 0.065)
    return [*parts, solid(switch, boxes(low, (width / 2 - 0.18, depth / 2, height - 0.035)))]


def _worktop(
    width: float, depth: float, height: float, style: Style, rng: np.random.Generator
) -> list[Part]:
    """Make a rectangular desk of a size."""
    size, half, rear = (width, depth), width / 2, -depth / 2
    top = table_top(style, rng, rectangle(width, depth, rng.choice([0.0, 0.0, 0.03, 0.1])), height)
    kind = int(rng.integers(3))
    if kind < 2:
        legs = (post_legs, t_legs)[kind](size, height, style, rng)
    else:
        legs = panel_legs(size, height, top.material)
    parts = [top, *legs]

    # a panel at its back
    if rng.random() < 0.45:
        panel = top.material if rng.random() < 0.6 else pick_plastic(style, rng)
        low, y = rng.uniform(0.2, 0.42), rear + rng.uniform(0.03, 0.1)
        sheet = boxes((-half + 0.08, y, low), (half - 0.08, y + 0.016, height - 0.03))
        parts.append(solid(panel, sheet))

    # drawers and a tray for cables
    sides = [side for side in (-1, 1) if rng.random() < (0.3 if width < 1.5 else 0.4)]
    material = top.material if rng.random() < 0.5 else pick_plastic(style, rng)
    for side in sides:
        edge = height - rng.uniform(0.04, 0.14)
        parts += drawers(material, side * (half - 0.29), depth, edge, rng)
    if rng.random() < 0.3:
        path = [(x, rear + 0.2, height - 0.1) for x in (-half + 0.3, half - 0.3)]
        parts.append(solid(paint((90, 90, 92), rng, "metal"), pipe(path, 0.035, 5)))
    return parts


def _corner(style: Style, rng: np.random.Generator) -> list[Part]:
    """L-shaped desk: a worktop along the back and a return along one side."""
    width, depth, height = rng.uniform(1.5, 2.0), rng.uniform(0.65, 0.8), rng.uniform(0.71, 0.76)
    long, side, wide = rng.uniform(1.3, 1.8), rng.choice([-1.0, 1.0]), rng.uniform(0.5, 0.65)
    top = table_top(style, rng, rectangle(width, depth), height)
    x, half, deep = side * (width - wide) / 2, width / 2, depth / 2
    wing = shifted(slab(rectangle(wide, long - depth), height - 0.028, height), x, long / 2)
    frame = frame_material(style, rng)
    parts = [top, solid(top.material, wing)]

    # a foot under each corner but the inner one
    end = long - deep - 0.05
    feet = [(-half + 0.06, -deep + 0.06), (half - 0.06, -deep + 0.06)]
    feet += [(-side * (half - 0.06), deep - 0.06)]
    feet += [(x - wide / 2 + 0.05, end), (x + wide / 2 - 0.05, end)]
    for a, b in feet:
        post = boxes((a - 0.025, b - 0.025, 0), (a + 0.025, b + 0.025, height - 0.028))
        parts.append(solid(frame, post))

    low = (-half + 0.1, -deep + 0.02, 0.25)
    if rng.random() < 0.5:
        panel = boxes(low, (half - 0.1, -deep + 0.04, height - 0.03))
        parts.append(solid(top.material, panel))
    if rng.random() < 0.5:
        parts += drawers(top.material, -side * (half - 0.3), depth, height - 0.06, rng)
    return parts


def _round(style: Style, rng: np.random.Generator) -> list[Part]:
    """Round or squarish table on a column, a cone or four legs."""
    across, height = rng.uniform(0.7, 1.3), rng.uniform(0.7, 0.77)
    outline = ellipse(across, across, 1.0 if rng.random() < 0.75 else 0.3)
    top = table_top(style, rng, outline, height)
    frame, kind = frame_material(style, rng), rng.random()
    if kind < 0.35:
        reach = across * rng.uniform(0.28, 0.36)
        foot = [(0, 0), (reach, 0), (reach, 0.012), (0.06, 0.035), (0.04, 0.06)]
        stem = _stem((0.04, 0.04), (0.04, height - 0.05), 0.15, height)
        return [top, solid(frame, lathe(foot, 18)), solid(frame, stem)]

    # a column on four arms
    if kind < 0.7:
        reach, turn = across * 0.4, rng.uniform(0, 1.5)
        arms = []
        for a in turn + np.arange(4) * np.pi / 2:
            knee = (reach * 0.5 * np.cos(a), reach * 0.5 * np.sin(a), 0.09)
            tip = (reach * np.cos(a), reach * np.sin(a), 0.02)
            arms.append(pipe(bend([(0, 0, 0.1), knee, tip], 0.1), 0.022))
        stem = _stem((0.045, 0.05), (0.035, height - 0.05), 0.16, height)
        return [top, solid(frame, *arms), solid(frame, stem)]

    # four splayed legs
    inner, parts = across * 0.68, [top]
    for x in (-1, 1):
        for y in (-1, 1):
            low = (x * inner / 1.8, y * inner / 1.8, 0)
            high = (x * inner / 2.2, y * inner / 2.2, height - 0.02)
            parts.append(solid(frame, slanted(low, high, (0.045, 0.045))))
    return parts


def _stem(
    foot: tuple[float, float], neck: tuple[float, float], head: float, height: float
) -> Triangles:
    """Return a column from a foot over a neck, radius and height of each, to a head under a top."""
    return lathe([foot, neck, (head, height - 0.03), (head, height - 0.025)], 10)


def _conference(style: Style, rng: np.random.Generator) -> list[Part]:
    """Large meeting table: rectangular, boat-shaped or oval, on panels, columns or legs."""
    length, depth, height = rng.uniform(2.4, 5.0), rng.uniform(1.0, 1.5), rng.uniform(0.71, 0.76)
    return meeting_parts(length, depth, height, style, rng)


def meeting_parts(
    length: float, depth: float, height: float, style: Style, rng: np.random.Generator
) -> list[Part]:
    """Make a meeting table of a size, about the origin."""
    model = stand_in("table", "meeting", style, rng, length)
    if model is not None:
        return list(model.parts)
    shape = int(rng.integers(4))
    if shape == 0:
        outline = rectangle(length, depth, rng.uniform(0, 0.2))
    elif shape == 1:  # boat
        x = np.linspace(-1, 1, 13)
        y = depth / 2 * (1 - rng.uniform(0.1, 0.3) * x**2)
        near, far = np.column_stack([x, -y]), np.column_stack([x, y])[::-1]
        outline = np.concatenate([near, far]) * [length / 2, 1]
    else:
        outline = ellipse(length, depth, 1.0 if shape == 2 else rng.uniform(0.3, 0.7), 32)
    parts = [table_top(style, rng, outline, height)]

    # legs, or a pillar for every two metres
    base = parts[0].material if rng.random() < 0.5 else pick_metal(style, rng)
    if shape < 2 and rng.random() < 0.4:
        parts += post_legs((length * 0.94, depth * 0.72), height, style, rng)
    else:
        round_ = rng.random() < 0.4
        for x in np.linspace(-1, 1, 2 if length < 3.8 else 3) * length * 0.29:
            parts.append(pillar(base, x, depth, height, round_=round_))

    # sockets in its middle
    if rng.random() < 0.5:
        box = paint((60, 60, 62), rng, "metal")
        parts.append(solid(box, boxes([(-0.2, -0.07, height)], [(0.2, 0.07, height + 0.006)])))
    return parts


def _trestle(style: Style, rng: np.random.Generator) -> list[Part]:
    """Plain top on two trestles or a folding frame."""
    width, depth, height = rng.uniform(1.3, 2.0), rng.uniform(0.65, 0.9), rng.uniform(0.71, 0.75)
    frame = frame_material(style, rng)
    parts = [table_top(style, rng, rectangle(width, depth), height)]
    near, far = depth * 0.36, depth * 0.42
    for x in (-width * 0.34, width * 0.34):
        # two pairs of legs, a bar low between the legs of each
        spread = rng.uniform(0.12, 0.2)
        for sign in (-1, 1):
            feet = [(x + sign * spread, y, 0) for y in (-far, far)]
            tops = [(x + sign * 0.02, y, height - 0.05) for y in (-near, near)]
            a, b = x + sign * spread * 0.7, depth * 0.4
            bar = boxes((a - 0.012, -b, 0.2), (a + 0.012, b, 0.24))
            parts.append(solid(frame, slanted(feet, tops, (0.035, 0.035)), bar))

        beam = boxes((x - 0.04, -far, height - 0.08), (x + 0.04, far, height - 0.03))
        parts.append(solid(frame, beam))
    return parts


def _coffee(style: Style, rng: np.random.Generator) -> list[Part]:
    """Low table: rectangular or round, often with a shelf below."""
    width, height = rng.uniform(0.7, 1.25), rng.uniform(0.33, 0.5)
    depth = rng.uniform(0.45, 0.7) if rng.random() < 0.6 else width

    # round on three legs
    if rng.random() < 0.35:
        top = table_top(style, rng, ellipse(width, depth, 1.0), height)
        frame = frame_material(style, rng)
        angles = np.arange(3) * 2.1 + rng.uniform(0, 2)
        ends = np.column_stack([np.cos(angles) * width, np.sin(angles) * depth]) * 0.4
        knees = np.column_stack([ends * 0.7, np.full(3, height - 0.02)])
        pairs = zip(ends.tolist(), knees, strict=True)
        legs = [slanted((*end, 0), knee, (0.035, 0.035)) for end, knee in pairs]
        return [top, *(solid(frame, leg) for leg in legs)]

    parts = [table_top(style, rng, rectangle(width, depth, rng.choice([0.0, 0.05])), height)]
    parts += post_legs((width, depth), height, style, rng)
    if rng.random() < 0.5:
        shelf = slab(rectangle(width - 0.14, depth - 0.14), 0.12, 0.14)
        parts.append(solid(parts[0].material, shelf))
    return parts


def _pedestal(style: Style, rng: np.random.Generator) -> list[Part]:
    """Small high or low bistro table on a disc."""
    across, height = rng.uniform(0.55, 0.8), rng.choice([0.73, 1.05]) + rng.uniform(-0.02, 0.03)
    frame = pick_metal(style, rng)
    foot = lathe([(0, 0), (0.25, 0), (0.25, 0.012), (0.05, 0.035)], 18)
    stem = _stem((0.035, 0.02), (0.035, height - 0.04), 0.14, height)
    outline = ellipse(across, across, 1.0 if rng.random() < 0.6 else 0.15)
    return [table_top(style, rng, outline, height), solid(frame, foot), solid(frame, stem)]


def _side(style: Style, rng: np.random.Generator) -> list[Part]:
    """Small table beside a sofa or a bed: on three legs, or a box with a drawer or a shelf."""
    across, height = rng.uniform(0.34, 0.52), rng.uniform(0.42, 0.62)
    deep, thin = across * 0.9, (0.03, 0.03)

    # round on three legs
    if rng.random() < 0.5:
        frame, angles = frame_material(style, rng), np.arange(3) * 2.1 + rng.uniform(0, 2)
        ends = [(np.cos(a) * across * 0.42, np.sin(a) * across * 0.42) for a in angles]
        legs = [slanted((x, y, 0), (x * 0.7, y * 0.7, height - 0.02), thin) for x, y in ends]
        top = table_top(style, rng, ellipse(across, across, 1.0), height)
        return [top, *(solid(frame, leg) for leg in legs)]

    top = table_top(style, rng, rectangle(across, deep), height)
    low = height - rng.uniform(0.14, 0.4)
    body = slab(rectangle(across - 0.04, deep - 0.04), low, height - 0.02)
    return [top, solid(top.material, body), *post_legs((across, deep), height, style, rng)]


TABLE_DESIGNS: dict[str, Callable[[Style, np.random.Generator], list[Part]]] = {
    "desk": _desk,
    "round": _round,
    "conference": _conference,
    "trestle": _trestle,
    "coffee": _coffee,
    "corner": _corner,
    "standing": _standing,
    "pedestal": _pedestal,
    "side": _side,
}
"""Tables by name: what makes their parts."""
