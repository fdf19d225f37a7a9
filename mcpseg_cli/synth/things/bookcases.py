"""Bookcases, cupboards and racks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mcpseg_cli.synth.geometry.shapes import Points, boxes, solid
from mcpseg_cli.synth.geometry.solids import Item, Part
from mcpseg_cli.synth.models.stand_in import stand_in
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
    shape = rng if form is None else np.random.default_rng(form)
    model = stand_in("bookcase", kind, style, shape)
    if model is not None:
        return [model]
    made = BOOKCASE_KINDS[kind](style, shape, rng)

    # the lowest and rearmost point goes to the origin
    low = np.min([part.triangles.min(axis=(0, 1)) for part in made.parts], axis=0)
    y, z = -float(low[1]), -float(low[2])
    things = [Item("clutter", tuple(thing)) for thing in made.loose]
    bookcase = Item("bookcase", tuple(made.parts), "cabinet" if made.is_closed else "")
    return [item.moved(y=y, z=z) for item in (bookcase, *things)]


class Filled(NamedTuple):
    """A bookcase, or part of one, and what it holds.

    Attributes:
        parts: Of the bookcase.
        loose: The parts of each separate thing.
        is_closed: Whether doors hide all of its inside.
    """

    parts: list[Part]
    loose: list[list[Part]]
    is_closed: bool = False


def _carcass(
    material: Material,
    size: tuple[float, float, float],
    levels: list[float],
    *,
    foot: float,
    back: bool,
) -> list[Part]:
    """Make sides, boards at levels and a back panel; x centred."""
    (width, depth, height), thick = size, 0.02
    half, inner = width / 2, width / 2 - thick
    shapes = [boxes((-half, 0, 0), (-inner, depth, height))]
    shapes.append(boxes((inner, 0, 0), (half, depth, height)))
    shapes += [
        boxes((-inner, 0.006, level), (inner, depth - 0.003, level + thick))
        for level in [*levels, height - thick]
    ]

    # a back and a plinth where there are such
    if back:
        shapes.append(boxes((-inner, 0, foot), (inner, 0.006, height)))
    if foot > 0.03:
        shapes.append(boxes((-inner, depth - 0.05, 0), (inner, depth - 0.03, foot)))
    return [solid(material, shape) for shape in shapes]


@dataclass(frozen=True)
class _Bay:
    """The space over one shelf: from x to x, from y = 0 to its depth, from its level up."""

    span: tuple[float, float]
    depth: float
    level: float
    height: float


def _fill(bay: _Bay, fullness: float, style: Style, rng: np.random.Generator) -> Filled:
    """Fill the space over a shelf: books, leaning ones, stacks, boxes, things, gaps."""
    parts: list[Part] = []
    loose: list[list[Part]] = []
    x, last = bay.span[0] + rng.uniform(0.0, 0.03), bay.span[1] - 0.01

    # from one end to the other
    while last - x > 0.06:
        free, draw = last - x, rng.random()
        if draw > fullness:
            x += rng.uniform(0.1, 0.45)
        elif draw < 0.62 * fullness:
            books, x = _books(bay, x, last, rng)
            parts += books
        elif draw < 0.72 * fullness and free > 0.3 and bay.depth > 0.24 and bay.height > 0.15:
            parts += _stack(bay, x + 0.14, rng)
            x = x + 0.14 + 0.16
        else:
            thing, wide = _thing(bay, x, free, style, rng)
            loose += [thing] if thing else []
            x += wide + rng.uniform(0.01, 0.06)
    return Filled(parts, loose)


def _books(bay: _Bay, x: float, last: float, rng: np.random.Generator) -> tuple[list[Part], float]:
    """Put a row of books at x, at times with some that lean; return them and where they end."""
    row = book_row(min(last - x, rng.uniform(0.15, 0.9)), bay.depth, bay.height, rng)
    parts = [part.moved(x=x, z=bay.level) for part in row]
    x = max([float(part.triangles[..., 0].max()) for part in row], default=0.0) + x + 0.004

    if rng.random() < 0.4 and bay.height > 0.2:
        books, width = leaning_books(bay.height, rng)
        if width < last - x:
            leaning = solid(paint((150, 120, 100), rng, "book", 0.03), books)
            parts.append(leaning.moved(x=x, z=bay.level))
            x += width + 0.01
    return parts, x


def _stack(bay: _Bay, x: float, rng: np.random.Generator) -> list[Part]:
    """Lay a stack of books about x, none if it is too high."""
    stack = book_stack(rng, int(rng.integers(1, max(int(bay.height / 0.06), 2))))
    if max(float(part.high[2]) for part in stack) >= bay.height - 0.01:
        return []
    y = bay.depth / 2 + 0.02
    return [part.moved(x=x, y=y, z=bay.level, yaw=rng.normal(0, 0.05)) for part in stack]


def _thing(
    bay: _Bay, x: float, free: float, style: Style, rng: np.random.Generator
) -> tuple[list[Part], float]:
    """Put a box or something small at x; return it, nothing if it does not fit, and its width."""
    if rng.random() < 0.5:
        thing = carton_parts(rng, (min(free, 0.45), bay.depth - 0.03, bay.height - 0.03))
    else:
        thing = small_parts(style, rng)

    low, high = _extent(thing)
    wide = float(high[0] - low[0])
    if wide >= free or high[1] - low[1] >= bay.depth or high[2] >= bay.height - 0.005:
        return [], wide
    y = float(bay.depth / 2 - (low[1] + high[1]) / 2)
    return [part.moved(x=x - float(low[0]), y=y, z=bay.level) for part in thing], wide


def _extent(parts: list[Part]) -> tuple[Points, Points]:
    """Return the lowest and highest corner of parts."""
    corners = np.concatenate([part.triangles.reshape(-1, 3) for part in parts])
    return corners.min(axis=0), corners.max(axis=0)


def _levels(foot: float, height: float, rng: np.random.Generator, gap: float = 0.34) -> list[float]:
    """Return heights of shelves, unevenly spaced."""
    count = max(round((height - foot) / (gap * rng.uniform(0.9, 1.2))), 1)
    steps = rng.uniform(0.88, 1.12, count)
    below = np.concatenate([[0.0], np.cumsum(steps)[:-1]])
    return [float(z) for z in foot + (height - foot - 0.02) * below / steps.sum()]


def _shelves(
    material: Material,
    size: tuple[float, float, float],
    foot: float,
    style: Style,
    rng: np.random.Generator,
    filling: np.random.Generator,
) -> Filled:
    """Make open shelves with their filling."""
    width, depth, height = size
    levels, fullness = _levels(foot, height, rng), filling.uniform(0.55, 0.97)
    parts, loose = _carcass(material, size, levels, foot=foot, back=rng.random() < 0.8), []

    # books and things stand clear of sides, back and the next shelf
    span = (-width / 2 + 0.025, width / 2 - 0.025)
    for level, top in zip(levels, [*levels[1:], height - 0.02], strict=True):
        bay = _Bay(span, depth - 0.01, level + 0.02, top - level - 0.02)
        more, things, _ = _fill(bay, fullness, style, filling)
        parts += [part.moved(y=0.007) for part in more]
        loose += [[part.moved(y=0.007) for part in thing] for thing in things]
    return Filled(parts, loose)


def _board_material(style: Style, rng: np.random.Generator) -> Material:
    """Pick what shelves are made of."""
    draw = rng.random()
    if draw < 0.6:
        return pick_wood(style, rng)
    return pick_plastic(style, rng) if draw < 0.85 else pick_metal(style, rng)


def _open(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Tall open shelves."""
    size = (rng.uniform(0.7, 1.25), rng.uniform(0.26, 0.4), rng.uniform(1.5, 2.25))
    material, foot = _board_material(style, rng), rng.choice([0.0, 0.06, 0.09])
    return _shelves(material, size, foot, style, rng, filling)


def _low(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Low open shelves, or a low cupboard with doors."""
    size = (rng.uniform(0.8, 1.6), rng.uniform(0.32, 0.45), rng.uniform(0.7, 1.15))
    is_open, material = rng.random() < 0.5, _board_material(style, rng)
    if is_open:
        return _shelves(material, size, rng.choice([0.0, 0.06]), style, rng, filling)
    return Filled(_doors(material, size, (0.05, size[2] - 0.02), rng), [], is_closed=True)


def _tv_board(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Long low board for a television: shelves, or doors."""
    size = (rng.uniform(1.2, 2.2), rng.uniform(0.34, 0.5), rng.uniform(0.36, 0.66))
    is_open, material = rng.random() < 0.5, _board_material(style, rng)
    if is_open:
        return _shelves(material, size, rng.choice([0.0, 0.06, 0.12]), style, rng, filling)
    return Filled(_doors(material, size, (0.05, size[2] - 0.02), rng), [], is_closed=True)


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

    # the body stands on a plinth; doors lie before it
    left, right = [-width / 2, -width / 2 + 0.02], [width / 2, width / 2 - 0.02]
    body = boxes(
        [(left[0], 0, 0.03), (left[1], 0.03, 0)],
        [(right[0], depth, height), (right[1], depth - 0.03, 0.03)],
    )
    faces = boxes(
        [(x + 0.003, depth, span[0]) for x in edges[:-1]],
        [(x - 0.003, depth + 0.018, span[1]) for x in edges[1:]],
    )
    face = material if rng.random() < 0.6 else paint((225, 224, 220), rng)

    # handles of two doors are next to each other
    z = (span[0] + span[1]) / 2 + rng.uniform(-0.1, 0.2) * (span[1] - span[0])
    far = width / count
    hinge = [x - 0.06 if row % 2 == 0 else x - far + 0.04 for row, x in enumerate(edges[1:])]
    pulls = boxes(
        [(x, depth + 0.018, z) for x in hinge],
        [(x + 0.014, depth + 0.045, z + 0.13) for x in hinge],
    )
    pull = paint((150, 150, 152), rng, "metal")
    return [solid(material, body), solid(face, faces), solid(pull, pulls)]


def _cupboard(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Tall cupboard: doors below, or up to the top."""
    size = (rng.uniform(0.8, 1.25), rng.uniform(0.38, 0.48), rng.uniform(1.7, 2.25))
    material = _board_material(style, rng)
    if rng.random() < 0.4:
        return Filled(_doors(material, size, (0.06, size[2] - 0.03), rng), [], is_closed=True)

    # doors below, shelves on top of them
    (width, depth, height), split = size, rng.uniform(0.7, 1.1)
    low = _doors(material, (width, depth, split), (0.06, split - 0.01), rng)
    upper = (width, depth - 0.02, height - split)
    parts, loose, _ = _shelves(material, upper, 0.0, style, rng, filling)
    raised = [[part.moved(z=split) for part in thing] for thing in loose]
    return Filled(low + [part.moved(z=split) for part in parts], raised)


def _glass(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Bookcase with glass doors: frames, panes, books behind."""
    size = (rng.uniform(0.8, 1.1), rng.uniform(0.32, 0.42), rng.uniform(1.6, 2.1))
    material = _board_material(style, rng)
    parts, loose, _ = _shelves(material, size, 0.08, style, rng, filling)

    # the frames of two doors, and one pane through both
    half, depth, height = size[0] / 2, size[1], size[2]
    uprights = (-half, -0.05, 0.005, half - 0.045)
    bars = [((x, depth, 0.09), (x + 0.045, depth + 0.018, height)) for x in uprights]
    bars += [((-half, depth, z), (half, depth + 0.018, z + 0.05)) for z in (0.09, height - 0.05)]
    parts.append(solid(material, boxes([a for a, _ in bars], [b for _, b in bars])))
    low, high = (-half + 0.045, depth + 0.006, 0.14), (half - 0.045, depth + 0.01, height - 0.05)
    parts.append(solid(paint((190, 205, 205), rng, "glass"), boxes(low, high)))
    return Filled(parts, loose)


def _rack(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Metal storage rack on posts, with boxes and folders."""
    metal = pick_metal(style, rng)
    width, depth, height = rng.uniform(0.9, 1.8), rng.uniform(0.35, 0.6), rng.uniform(1.6, 2.3)
    posts = [(x, y) for x in (-width / 2, width / 2 - 0.035) for y in (0, depth - 0.035)]
    parts = [solid(metal, boxes((x, y, 0), (x + 0.035, y + 0.035, height))) for x, y in posts]

    # a shelf and what it holds, which counts as the rack's own
    half = width / 2
    levels = _levels(0.08, height, rng, 0.45)
    for level, top in zip(levels, [*levels[1:], height + 0.3], strict=True):
        low, high = (-half + 0.004, 0.004, level), (half - 0.004, depth - 0.004, level + 0.035)
        parts.append(solid(metal, boxes(low, high)))
        bay = _Bay((-half + 0.05, half - 0.05), depth - 0.04, level + 0.035, top - level - 0.05)
        more, things, _ = _fill(bay, filling.uniform(0.4, 0.9), style, filling)
        for content in (more, *things):
            parts += [part.moved(y=0.02) for part in content]
    return Filled(parts, [])


def _wall_shelf(style: Style, rng: np.random.Generator, filling: np.random.Generator) -> Filled:
    """Boards on brackets that hang on a wall; z = 0 is its lowest edge."""
    material, metal = _board_material(style, rng), pick_metal(style, rng)
    width, depth = rng.uniform(0.7, 1.4), rng.uniform(0.2, 0.32)
    parts: list[Part] = []
    loose: list[list[Part]] = []
    for row in range(int(rng.integers(1, 4))):
        # the board
        level, half = 0.12 + row * 0.34, width / 2
        parts.append(solid(material, boxes((-half, 0, level), (half, depth, level + 0.022))))

        # its brackets
        for x in (-width * 0.36, width * 0.36):
            upright = (x + 0.02, 0.02, level)
            arm = (x + 0.02, depth * 0.85, level)
            bars = boxes([(x, 0, level - 0.12), (x, 0, level - 0.02)], [upright, arm])
            parts.append(solid(metal, bars))

        # what stands on it
        bay = _Bay((-half + 0.01, half), depth - 0.01, level + 0.022, 0.2)
        more, things, _ = _fill(bay, filling.uniform(0.4, 0.9), style, filling)
        parts, loose = parts + [part.moved(y=0.005) for part in more], loose + things
    return Filled(parts, loose)


Maker = Callable[[Style, np.random.Generator, np.random.Generator], Filled]
BOOKCASE_KINDS: dict[str, Maker] = {
    "open": _open,
    "low": _low,
    "cupboard": _cupboard,
    "glass": _glass,
    "rack": _rack,
    "wall shelf": _wall_shelf,
    "tv board": _tv_board,
}
"""What makes bookcases and the things in them; the second generator decides the filling."""
