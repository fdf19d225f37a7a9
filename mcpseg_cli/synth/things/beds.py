"""Beds of class clutter: divans, beds with high headboards, bunks, unmade ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcpseg_cli.synth.geometry.shapes import boxes, cushion, shell, solid
from mcpseg_cli.synth.geometry.solids import Part, shifted, tilted
from mcpseg_cli.synth.surfaces.materials import Colour, Material, Pattern
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_fabric, pick_metal, pick_wood

_LINEN: tuple[Colour, ...] = (
    *((238, 237, 233), (230, 226, 216), (242, 242, 241), (190, 182, 168), (120, 130, 142)),
    *((70, 78, 92), (134, 96, 88), (92, 102, 84), (198, 206, 212), (178, 140, 128)),
)
_PATTERNS: tuple[Pattern, ...] = ("plain", "plain", "checks", "print", "stripes")


def _linen(rng: np.random.Generator, *, white: bool = False) -> Material:
    """Draw bed linen, mostly white or pale."""
    colour = _LINEN[rng.integers(3 if white else len(_LINEN))]
    return paint(colour, rng, "plain" if white else _PATTERNS[rng.integers(5)], 0.15)


def divan(style: Style, rng: np.random.Generator) -> list[Part]:
    """Bed on a box that reaches the floor: without a headboard, or with a high padded one."""
    half, long = float(rng.choice([0.45, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95])), rng.uniform(1.9, 2.1)
    level, thick = rng.uniform(0.18, 0.4), rng.uniform(0.16, 0.28)
    frame = pick_fabric(style, rng) if rng.random() < 0.5 else pick_wood(style, rng)
    draw, back, parts = rng.random(), 0.0, []
    if draw < 0.45:
        back, wide = rng.uniform(0.05, 0.14), half + rng.uniform(0.0, 0.35)
        tall = rng.uniform(0.8, 1.35)
        parts.append(solid(frame, boxes((-wide, 0, 0), (wide, back, tall))))
    parts.append(solid(frame, boxes((-half, back, 0.02), (half, back + long, level))))
    parts += _bedding(half, back, back + long, (level, thick), rng)
    return parts


def iron_bed(style: Style, rng: np.random.Generator) -> list[Part]:
    """Bed with bars at head and foot, and air under it."""
    half, long = float(rng.choice([0.45, 0.6, 0.7, 0.8])), rng.uniform(1.9, 2.05)
    level = rng.uniform(0.28, 0.42)
    frame = pick_metal(style, rng) if rng.random() < 0.6 else pick_wood(style, rng)
    parts = []
    for y, tall in ((0.0, rng.uniform(0.8, 1.2)), (long + 0.05, rng.uniform(0.5, 0.85))):
        posts = boxes(
            [(-half - 0.03, y, 0), (half - 0.01, y, 0)],
            [(-half + 0.01, y + 0.04, tall), (half + 0.03, y + 0.04, tall)],
        )
        count = int(rng.integers(2, 9))
        xs = np.linspace(-half, half, count + 2)[1:-1]
        bars = boxes(
            [(x - 0.01, y + 0.01, level) for x in xs],
            [(x + 0.01, y + 0.03, tall - 0.03) for x in xs],
        )
        rail = boxes((-half + 0.01, y + 0.005, tall - 0.05), (half - 0.01, y + 0.035, tall - 0.01))
        parts += [solid(frame, posts), solid(frame, rail, bars)]
    side = boxes((-half, 0.04, level - 0.1), (half, long + 0.05, level))
    parts.append(solid(frame, side))
    parts += _bedding(half, 0.04, long + 0.05, (level, rng.uniform(0.12, 0.22)), rng)
    return parts


def bunk_bed(style: Style, rng: np.random.Generator) -> list[Part]:
    """Two beds over each other with a ladder, or a high one over a free space."""
    half, long, tall = rng.uniform(0.42, 0.5), rng.uniform(1.9, 2.05), rng.uniform(1.55, 1.8)
    frame = pick_wood(style, rng) if rng.random() < 0.7 else pick_metal(style, rng)
    w = half + 0.04
    spots = [(x, y) for x in (-w, w - 0.06) for y in (0.0, long + 0.04)]
    posts = boxes(
        [(x, y, 0) for x, y in spots], [(x + 0.06, y + 0.06, tall + 0.15) for x, y in spots]
    )
    levels = [tall - 0.35] if rng.random() < 0.3 else [rng.uniform(0.28, 0.4), tall - 0.35]
    parts = [solid(frame, posts)]
    for level in levels:
        rails = boxes((-half, 0.06, level - 0.12), (half, long + 0.04, level))
        parts.append(solid(frame, rails))
        parts += _bedding(half - 0.02, 0.06, long + 0.03, (level, 0.13), rng)
    guards = boxes(
        [(x, 0.06, tall) for x in (-w, w - 0.03)],
        [(x + 0.03, long + 0.04, tall + 0.1) for x in (-w, w - 0.03)],
    )
    rungs = np.arange(0.3, tall, 0.3)
    at = long - rng.uniform(0.35, 0.6)
    steps = boxes([(w, at, z) for z in rungs], [(w + 0.04, at + 0.34, z + 0.03) for z in rungs])
    beams = boxes(
        [(w, at - 0.04, 0), (w, at + 0.34, 0)],
        [(w + 0.04, at, tall + 0.1), (w + 0.04, at + 0.38, tall + 0.1)],
    )
    return [*parts, solid(frame, guards), solid(frame, steps), solid(frame, beams)]


def _bedding(
    half: float, first: float, last: float, heights: tuple[float, float], rng: np.random.Generator
) -> list[Part]:
    """Make mattress, pillows and a cover: made, thrown back or in a heap."""
    level, thick = heights
    top = level + thick
    sheet, cover = _linen(rng, white=True), _linen(rng, white=rng.random() < 0.35)
    pad = cushion((-half, first, level), (half, last, top), 0.08, 0.2)
    parts = [solid(sheet, pad)]
    if rng.random() < 0.12:
        return parts  # stripped

    parts += _pillows(half, first, top, sheet, rng)

    # how untidy: in folds of up to 12 cm
    mess, back = rng.uniform(0.015, 0.06) * (2.0 if rng.random() < 0.35 else 1.0), rng.random()
    start = first + (last - first) * (
        rng.uniform(0.25, 0.4) if back < 0.6 else rng.uniform(0.4, 0.65)
    )
    parts.append(solid(cover, _cover(half, top, start, last, mess, rng)))
    if rng.random() < 0.25:
        throw, end = _linen(rng), last - rng.uniform(0.05, 0.2)
        parts.append(solid(throw, _cover(half, top + mess + 0.04, end - 0.5, end, 0.012, rng)))
    return parts


def _pillows(
    half: float, first: float, top: float, sheet: Material, rng: np.random.Generator
) -> list[Part]:
    """Make pillows at the head, flat or leaning, of two sizes."""
    count, parts = int(rng.integers(1, 3)) if half < 0.6 else int(rng.integers(2, 6)), []
    for number in range(count):
        x = (number % 2 - 0.5) * half if half >= 0.6 else rng.uniform(-0.08, 0.08)
        wide = rng.uniform(0.26, 0.36)
        soft = cushion((-wide, -0.07, 0), (wide, 0.07, 0.42), 0.4, 0.5)
        one = tilted(soft, rng.uniform(0.5, 1.35))
        row = 0.09 * (number // 2)
        there = shifted(one, float(x), first + 0.44 + row, top + 0.02 + row)
        parts.append(solid(replace(sheet, seed=number + 2), there))
    return parts


def _cover(
    half: float, top: float, first: float, last: float, mess: float, rng: np.random.Generator
) -> np.ndarray:
    """Return a cover with folds that hangs down at both sides, unevenly."""
    left, right = rng.uniform(0.02, 0.32, 2)
    down = np.array([-half - 0.035, -half - 0.03, -half * 0.95])
    x = np.concatenate([down, np.linspace(-0.8, 0.8, 11) * half, -down[::-1]])
    z = np.concatenate([[-left, 0.0, 0.03], np.full(11, 0.045), [0.03, 0.0, -right]])
    y = np.linspace(first, last, 13)
    a, b = np.meshgrid(x, y, indexing="ij")
    one, two, three = rng.uniform(0, 6, 3)
    waves = np.sin(7 * a + 3 * b + one) * np.cos(6 * b - 2 * a + two) + 0.5 * np.sin(13 * b + three)
    level = top + z[:, None] + np.where(z[:, None] > 0.02, mess * (waves + 1.2) / 1.5, 0.0)
    skew = rng.normal(0, 0.05) * (a / max(half, 0.1))
    return shell(
        np.stack(
            [a, b - np.abs(skew) * (b < (first + last) / 2), np.maximum(level, 0.03)], axis=-1
        ),
        0.03,
    )
