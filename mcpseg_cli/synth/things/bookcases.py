"""Bookcases, cupboards and racks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mcpseg_cli.synth.geometry.shapes import Points, boxes, solid
from mcpseg_cli.synth.geometry.solids import Item, Part
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_metal, pick_plastic, pick_wood
from mcpseg_cli.synth.things.books import book_row, book_stack, leaning_books
from mcpseg_cli.synth.things.boxes_and_bags import carton_parts, small_parts


def make_bookcase(
    kind: str, style: Style, rng: np.random.Generator, form: int | None = None
) -> list[Item]:
    """Make a bookcase and what stands on its shelves, its back to y = 0.

    Args:
        kind: One of ``BOOKCASE_KINDS``.
        style: Colours and materials of the building.
        rng: Decides sizes, shape, filling and colours.
        form: Two bookcases with the same number differ in their filling only; without, nothing is
            shared.

    Returns:
        The bookcase, of class bookcase, on z = 0 with its books; then separate things on the
        shelves, of class clutter, in the same frame.

    Raises:
        KeyError: There is no such kind.
    """
    parts, loose = BOOKCASE_KINDS[kind](
        style, rng if form is None else np.random.default_rng(form), rng
    )
    low = np.min([part.triangles.min(axis=(0, 1)) for part in parts], axis=0)
    return [Item("bookcase", tuple(p.moved(y=-float(low[1]), z=-float(low[2])) for p in parts))] + [
        Item("clutter", tuple(part.moved(y=-float(low[1]), z=-float(low[2])) for part in thing))
        for thing in loose
    ]


Filled = tuple[list[Part], list[list[Part]]]
"""Parts of the bookcase, and the parts of each separate thing."""


def _carcass(
    material: Material,
    size: tuple[float, float, float],
    levels: list[float],
    *,
    foot: float,
    back: bool,
) -> list[Part]:
    """Make sides, boards at levels and a back panel; x centred."""
    width, depth, height = size
    thick = 0.02
    parts = [
        solid(material, boxes((-width / 2, 0, 0), (-width / 2 + thick, depth, height))),
        solid(material, boxes((width / 2 - thick, 0, 0), (width / 2, depth, height))),
    ]
    inner = width / 2 - thick
    parts += [
        solid(material, boxes((-inner, 0.006, level), (inner, depth - 0.003, level + thick)))
        for level in [*levels, height - thick]
    ]
    if back:
        parts.append(solid(material, boxes((-inner, 0, foot), (inner, 0.006, height))))
    if foot > 0.03:
        parts.append(solid(material, boxes((-inner, depth - 0.05, 0), (inner, depth - 0.03, foot))))
    return parts


def _fill(
    span: tuple[float, float],
    depth: float,
    level: float,
    height: float,
    fullness: float,
    rng: np.random.Generator,
) -> Filled:
    """Fill the shelf from x to x at a level: books, leaning ones, stacks, boxes, things, gaps."""
    parts: list[Part] = []
    loose: list[list[Part]] = []
    x, last = span[0] + rng.uniform(0.0, 0.03), span[1] - 0.01
    while last - x > 0.06:
        free, draw = last - x, rng.random()
        if draw > fullness:
            x += rng.uniform(0.1, 0.45)
        elif draw < 0.62 * fullness:
            row = book_row(min(free, rng.uniform(0.15, 0.9)), depth, height, rng)
            parts += [part.moved(x=x, z=level) for part in row]
            x = max([float(part.triangles[..., 0].max()) for part in row], default=0.0) + x + 0.004
            if rng.random() < 0.4 and height > 0.2:
                books, width = leaning_books(height, rng)
                if width < last - x:
                    parts.append(
                        solid(paint((150, 120, 100), rng, "book", 0.03), books).moved(x=x, z=level)
                    )
                    x += width + 0.01
        elif draw < 0.72 * fullness and free > 0.3 and depth > 0.24 and height > 0.15:
            x += 0.14
            stack = book_stack(rng, int(rng.integers(1, max(int(height / 0.06), 2))))
            if max(float(part.high[2]) for part in stack) < height - 0.01:
                parts += [
                    part.moved(x=x, y=depth / 2 + 0.02, z=level, yaw=rng.normal(0, 0.05))
                    for part in stack
                ]
            x += 0.16
        else:
            thing = (
                carton_parts(rng, (min(free, 0.45), depth - 0.03, height - 0.03))
                if rng.random() < 0.5
                else small_parts(rng)
            )
            low, high = _extent(thing)
            if high[0] - low[0] < free and high[1] - low[1] < depth and high[2] < height - 0.005:
                y = depth / 2 - (low[1] + high[1]) / 2
                loose.append(
                    [part.moved(x=x - float(low[0]), y=float(y), z=level) for part in thing]
                )
            x += float(high[0] - low[0]) + rng.uniform(0.01, 0.06)
    return parts, loose


def _extent(parts: list[Part]) -> tuple[Points, Points]:
    """Return the lowest and highest corner of parts."""
    corners = np.concatenate([part.triangles.reshape(-1, 3) for part in parts])
    return corners.min(axis=0), corners.max(axis=0)


def _levels(foot: float, height: float, rng: np.random.Generator, gap: float = 0.34) -> list[float]:
    """Return heights of shelves, unevenly spaced."""
    count = max(round((height - foot) / (gap * rng.uniform(0.9, 1.2))), 1)
    steps = rng.uniform(0.88, 1.12, count)
    return [
        float(z)
        for z in foot
        + (height - foot - 0.02) * np.concatenate([[0.0], np.cumsum(steps)[:-1]]) / steps.sum()
    ]


def _shelves(
    material: Material,
    size: tuple[float, float, float],
    foot: float,
    rng: np.random.Generator,
    filling: np.random.Generator,
) -> Filled:
    """Make open shelves with their filling."""
    width, depth, height = size
    levels, fullness = _levels(foot, height, rng), filling.uniform(0.55, 0.97)
    parts, loose = _carcass(material, size, levels, foot=foot, back=rng.random() < 0.8), []
    tops = [*levels[1:], height - 0.02]
    for level, top in zip(levels, tops, strict=True):
        more, things = _fill(
            (-width / 2 + 0.025, width / 2 - 0.025),
            depth - 0.01,
            level + 0.02,
            top - level - 0.02,
            fullness,
            filling,
        )
        parts += [part.moved(y=0.007) for part in more]
        loose += [[part.moved(y=0.007) for part in thing] for thing in things]
    return parts, loose


def _board_material(style: Style, rng: np.random.Generator) -> Material:
    """Pick what shelves are made of."""
    draw = rng.random()
    return (
        pick_wood(style, rng)
        if draw < 0.6
        else pick_plastic(style, rng)
        if draw < 0.85
        else pick_metal(style, rng)
    )


def _open(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Tall open shelves."""
    size = (rng.uniform(0.7, 1.25), rng.uniform(0.26, 0.4), rng.uniform(1.5, 2.25))
    return _shelves(_board_material(style, rng), size, rng.choice([0.0, 0.06, 0.09]), rng, filling)


def _low(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Low open shelves, or a low cupboard with doors."""
    size = (rng.uniform(0.8, 1.6), rng.uniform(0.32, 0.45), rng.uniform(0.7, 1.15))
    if rng.random() < 0.5:
        return _shelves(_board_material(style, rng), size, rng.choice([0.0, 0.06]), rng, filling)
    return _doors(_board_material(style, rng), size, (0.05, size[2] - 0.02), rng), []


def _tv_board(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Long low board for a television: shelves, or doors."""
    size = (rng.uniform(1.2, 2.2), rng.uniform(0.34, 0.5), rng.uniform(0.36, 0.66))
    if rng.random() < 0.5:
        return _shelves(
            _board_material(style, rng), size, rng.choice([0.0, 0.06, 0.12]), rng, filling
        )
    return _doors(_board_material(style, rng), size, (0.05, size[2] - 0.02), rng), []


def _doors(
    material: Material,
    size: tuple[float, float, float],
    span: tuple[float, float],
    rng: np.random.Generator,
) -> list[Part]:
    """Make a closed body with doors over a range of heights, and handles."""
    width, depth, height = size
    count = max(round(width / rng.uniform(0.4, 0.55)), 1)
    edges = np.linspace(-width / 2, width / 2, count + 1)
    body = boxes(
        [(-width / 2, 0, 0.03), (-width / 2 + 0.02, 0.03, 0)],
        [(width / 2, depth, height), (width / 2 - 0.02, depth - 0.03, 0.03)],
    )
    faces = boxes(
        [(x + 0.003, depth, span[0]) for x in edges[:-1]],
        [(x - 0.003, depth + 0.018, span[1]) for x in edges[1:]],
    )
    face = material if rng.random() < 0.6 else paint((225, 224, 220), rng)
    z = (span[0] + span[1]) / 2 + rng.uniform(-0.1, 0.2) * (span[1] - span[0])
    hinge = [
        x - 0.06 if row % 2 == 0 else x - width / count + 0.04 for row, x in enumerate(edges[1:])
    ]
    pulls = boxes(
        [(x, depth + 0.018, z) for x in hinge],
        [(x + 0.014, depth + 0.045, z + 0.13) for x in hinge],
    )
    return [
        solid(material, body),
        solid(face, faces),
        solid(paint((150, 150, 152), rng, "metal"), pulls),
    ]


def _cupboard(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Tall cupboard: doors below, or up to the top."""
    size = (rng.uniform(0.8, 1.25), rng.uniform(0.38, 0.48), rng.uniform(1.7, 2.25))
    material = _board_material(style, rng)
    if rng.random() < 0.4:
        return _doors(material, size, (0.06, size[2] - 0.03), rng), []
    split = rng.uniform(0.7, 1.1)
    low = _doors(material, (size[0], size[1], split), (0.06, split - 0.01), rng)
    parts, loose = _shelves(material, (size[0], size[1] - 0.02, size[2] - split), 0.0, rng, filling)
    return low + [part.moved(z=split) for part in parts], [
        [part.moved(z=split) for part in thing] for thing in loose
    ]


def _glass(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Bookcase with glass doors: frames, panes, books behind."""
    size = (rng.uniform(0.8, 1.1), rng.uniform(0.32, 0.42), rng.uniform(1.6, 2.1))
    material = _board_material(style, rng)
    parts, loose = _shelves(material, size, 0.08, rng, filling)
    width, depth, height = size
    half = width / 2
    uprights = (-half, -0.05, 0.005, half - 0.045)
    bars = [((x, depth, 0.09), (x + 0.045, depth + 0.018, height)) for x in uprights]
    bars += [((-half, depth, z), (half, depth + 0.018, z + 0.05)) for z in (0.09, height - 0.05)]
    parts.append(solid(material, boxes([a for a, _ in bars], [b for _, b in bars])))
    pane = boxes(
        [(-half + 0.045, depth + 0.006, 0.14)], [(half - 0.045, depth + 0.01, height - 0.05)]
    )
    parts.append(solid(paint((190, 205, 205), rng, "glass"), pane))
    return parts, loose


def _rack(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Metal storage rack on posts, with boxes and folders."""
    metal = pick_metal(style, rng)
    width, depth, height = rng.uniform(0.9, 1.8), rng.uniform(0.35, 0.6), rng.uniform(1.6, 2.3)
    posts = [(x, y) for x in (-width / 2, width / 2 - 0.035) for y in (0, depth - 0.035)]
    parts = [solid(metal, boxes((x, y, 0), (x + 0.035, y + 0.035, height))) for x, y in posts]
    loose: list[list[Part]] = []
    levels = _levels(0.08, height, rng, 0.45)
    for level, top in zip(levels, [*levels[1:], height + 0.3], strict=True):
        parts.append(
            solid(
                metal,
                boxes(
                    (-width / 2 + 0.004, 0.004, level),
                    (width / 2 - 0.004, depth - 0.004, level + 0.035),
                ),
            )
        )
        span = (-width / 2 + 0.05, width / 2 - 0.05)
        more, things = _fill(
            span,
            depth - 0.04,
            level + 0.035,
            top - level - 0.05,
            filling.uniform(0.4, 0.9),
            filling,
        )
        for content in (more, *things):
            parts += [part.moved(y=0.02) for part in content]
    return parts, loose


def _wall_shelf(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Boards on brackets that hang on a wall; z = 0 is its lowest edge."""
    material, metal = _board_material(style, rng), pick_metal(style, rng)
    width, depth = rng.uniform(0.7, 1.4), rng.uniform(0.2, 0.32)
    parts: list[Part] = []
    loose: list[list[Part]] = []
    for row in range(int(rng.integers(1, 4))):
        level = 0.12 + row * 0.34
        parts.append(
            solid(material, boxes((-width / 2, 0, level), (width / 2, depth, level + 0.022)))
        )
        for x in (-width * 0.36, width * 0.36):
            bars = boxes(
                [(x, 0, level - 0.12), (x, 0, level - 0.02)],
                [(x + 0.02, 0.02, level), (x + 0.02, depth * 0.85, level)],
            )
            parts.append(solid(metal, bars))
        more, things = _fill(
            (-width / 2 + 0.01, width / 2),
            depth - 0.01,
            level + 0.022,
            0.2,
            filling.uniform(0.4, 0.9),
            filling,
        )
        parts, loose = parts + [part.moved(y=0.005) for part in more], loose + things
    return parts, loose


BOOKCASE_KINDS: dict[str, Callable[[Style, np.random.Generator, np.random.Generator], Filled]] = {
    "open": _open,
    "low": _low,
    "cupboard": _cupboard,
    "glass": _glass,
    "rack": _rack,
    "wall shelf": _wall_shelf,
    "tv board": _tv_board,
}
"""Bookcases by kind: what makes their parts and the things on them; the second generator decides the filling."""
