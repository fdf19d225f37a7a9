"""Rows of books and binders, stacks and boxes: what fills a shelf."""

from __future__ import annotations

import itertools

import numpy as np

from mcpseg_cli.synth.geometry.shapes import boxes, lean, solid
from mcpseg_cli.synth.geometry.solids import Part, Triangles, shifted, turned
from mcpseg_cli.synth.surfaces.materials import Colour, Material
from mcpseg_cli.synth.surfaces.styles import paint

_COVERS: tuple[Colour, ...] = (
    *((140, 40, 38), (38, 62, 110), (44, 90, 60), (222, 214, 198), (60, 58, 60), (196, 150, 60)),
    *((88, 50, 92), (120, 140, 150), (235, 235, 232), (150, 90, 50), (30, 110, 130)),
    (180, 180, 178),
)


def book_row(width: float, depth: float, height: float, rng: np.random.Generator) -> list[Part]:
    """Fill a shelf with books from x = 0 and its rear at y = 0 up to a width, a depth and a height.

    Books stand side by side in a few colours, uneven in height and depth, with gaps; the last ones
    may lean.

    Args:
        width: Free width, metres.
        depth: Free depth, metres.
        height: Free height, metres.
        rng: Decides which books.

    Returns:
        One to four parts on z = 0; none if nothing fits.
    """
    # binders are alike, books are not
    if rng.random() < 0.25:
        binders, thick = True, rng.uniform(0.045, 0.08, 64)
        tall, deep = np.full(64, 0.31), rng.normal(0.27, 0.0, 64)
    else:
        binders, thick = False, rng.uniform(0.012, 0.055, 64)
        tall = np.clip(rng.normal(rng.uniform(0.2, 0.28), 0.025, 64), 0.15, 0.34)
        deep = rng.normal(0.18, 0.025, 64)
    deep = np.clip(deep, 0.1, depth - 0.01)
    tall = np.minimum(tall, height - 0.015)

    # as many as there is space for
    ends = np.cumsum(thick)
    starts = ends - thick
    count = int(np.searchsorted(ends, width))
    if count == 0 or height < 0.1:
        return []

    # their backs in a line, nearly
    line = depth - rng.uniform(0.005, max(depth - 0.28, 0.01))
    front = line - np.abs(rng.normal(0, 0.008, count))
    front = np.maximum(front, deep[:count] + 0.003)
    lows = np.column_stack([starts[:count], front - deep[:count], np.zeros(count)])
    highs = np.column_stack([ends[:count] - 0.001, front, tall[:count]])
    return _in_colours(boxes(lows, highs).reshape(count, -1, 3, 3), binders, rng)


def leaning_books(height: float, rng: np.random.Generator) -> tuple[Triangles, float]:
    """Make a few books that lean to the left.

    Returns:
        The books, about their lower left corner, and the width they take, metres.
    """
    count, tall = int(rng.integers(1, 4)), min(float(rng.uniform(0.2, 0.27)), height - 0.03)
    angle = float(rng.uniform(0.1, 0.35))
    thick = rng.uniform(0.015, 0.04, count)
    starts = np.cumsum(thick) - thick
    lows = np.column_stack([starts, np.full(count, 0.02), np.zeros(count)])
    deep, high = rng.uniform(0.16, 0.22, count), tall * rng.uniform(0.9, 1, count)
    books = boxes(lows, np.column_stack([starts + thick - 0.001, deep, high]))

    leaned = lean(books, -angle)
    low = leaned.min(axis=(0, 1))
    return shifted(leaned, -float(low[0]), 0, -float(low[2])), float(np.ptp(leaned[..., 0]))


def book_stack(rng: np.random.Generator, count: int = 0) -> list[Part]:
    """Lay a few books or papers on each other about the origin, each turned a little, on z = 0."""
    count = count or int(rng.integers(2, 8))
    level, books = 0.0, []
    width, depth = rng.uniform(0.14, 0.22), rng.uniform(0.2, 0.3)
    for _ in range(count):
        thick = rng.uniform(0.008, 0.045)
        half = np.array([width, depth]) / 2 * rng.uniform(0.8, 1.05, 2)
        book = boxes((-half[0], -half[1], level), (half[0], half[1], level + thick))
        books.append(shifted(turned(book, rng.normal(0, 0.12)), *rng.normal(0, 0.006, 2)))
        level += thick
    return _in_colours(np.stack(books), False, rng)


def _in_colours(books: Triangles, binders: bool, rng: np.random.Generator) -> list[Part]:
    """Group books, (N, 12, 3, 3), into a few colours; a part is a run of neighbours."""
    runs = min(len(books), 1 + int(rng.integers(1, 3)) if binders else 1 + len(books) // 7)
    cuts = np.linspace(0, len(books), runs + 1).astype(int)
    spans = [(a, b) for a, b in itertools.pairwise(cuts) if b > a]
    return [solid(_cover(rng), books[a:b].reshape(-1, 3, 3)) for a, b in spans]


def _cover(rng: np.random.Generator) -> Material:
    """Pick a cover; the pattern book varies it from spine to spine."""
    first, second = rng.integers(len(_COVERS), size=2)
    base = paint(_COVERS[first], rng, "book", rng.uniform(0.02, 0.045))
    return Material("book", base.base, _COVERS[second], base.scale, base.seed)
