"""Curtains and blinds of class clutter that hang before walls and windows, down to the floor."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import boxes, solid, stand
from mcpseg_cli.synth.geometry.solids import Item, Part, Triangles, surface
from mcpseg_cli.synth.surfaces.materials import Colour, Material, Pattern
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_colour, pick_metal

_CLOTHS: tuple[Colour, ...] = (
    *((232, 228, 218), (238, 238, 236), (206, 196, 178), (150, 146, 140), (84, 86, 92)),
    *((96, 72, 58), (120, 40, 46), (60, 76, 104), (108, 120, 92), (188, 168, 128)),
)
_PATTERNS: tuple[Pattern, ...] = ("weave", "weave", "plain", "stripes", "print")
OUT = 0.15
"""How far from the wall the cloth hangs, metres; blinds in the window have room behind it."""


def pick_cloth(style: Style, rng: np.random.Generator, wall: Material | None = None) -> Material:
    """Draw the cloth of a room's curtains, at times in the colour of the walls."""
    if wall is not None and wall.pattern in ("plain", "plaster") and rng.random() < 0.25:
        return paint(wall.base, rng, "weave", 0.1)
    colours = (*_CLOTHS, *_CLOTHS, *style.walls, *style.accents)
    pattern = _PATTERNS[rng.integers(len(_PATTERNS))]
    return paint(pick_colour(colours, rng), rng, pattern, rng.uniform(0.05, 0.3))


def curtain(
    width: float,
    height: float,
    cloth: Material,
    style: Style,
    rng: np.random.Generator,
    *,
    drawn: float,
) -> Item:
    """Make a curtain in folds on its rail, down to the floor.

    Args:
        width: Of the rail, metres.
        height: Of the rail over the floor, metres.
        cloth: What it is made of.
        style: The building's.
        rng: Random numbers.
        drawn: Share of the width that it covers, from both ends or from one.

    Returns:
        An object of class clutter, its back (the brackets of the rail) at y = 0.
    """
    w, rail, drop = width / 2, pick_metal(style, rng), height - 0.03
    low, metal = OUT - 0.012, boxes((-w, OUT - 0.012, drop), (w, OUT + 0.012, height))
    ends = boxes([(-w, 0, drop), (w - 0.02, 0, drop)], [(-w + 0.02, low, height), (w, low, height)])
    parts = [solid(rail, metal), solid(rail, ends)]

    # in two halves, or pushed to one side
    drawn = float(np.clip(drawn, 0.12, 0.99))
    if rng.random() < 0.7:
        split = 0.5 if rng.random() < 0.7 else rng.uniform(0.3, 0.7)
        spans = [(-w, -w + width * drawn * split), (w - width * drawn * (1 - split), w)]
    else:
        spans = [(-w, -w + width * drawn)]
    for first, last in spans:
        fold = rng.uniform(0.07, 0.16) * (0.6 + 0.4 * drawn)
        parts.append(solid(cloth, _folds(first, last, drop, fold, rng)))
    return stand("clutter", parts, "curtain")


def _folds(
    first: float, last: float, top: float, pitch: float, rng: np.random.Generator
) -> Triangles:
    """Return a sheet in folds from the floor up to a rail, at times gathered by a band."""
    columns = max(int((last - first) / pitch * 6), 8)
    x, share = np.meshgrid(np.linspace(first, last, columns), np.linspace(0, 1, 9), indexing="ij")
    deep = rng.uniform(0.015, 0.04)
    sway = 0.4 * np.sin(x * rng.uniform(5, 9) + 2 * share)
    wave = np.sin((x - first) / pitch * 2 * np.pi + sway + rng.uniform(0, 6))
    y = OUT + deep * wave * (1.0 - 0.35 * share) - 0.004

    # gathered towards one end at the height of the hip
    if last - first < 0.9 and rng.random() < 0.25:
        pinch = 1 - 0.6 * np.exp(-(((share - 0.45) / 0.2) ** 2))
        x = first + (x - first) * pinch if first < 0 else last + (x - last) * pinch
    return surface(np.stack([x, y, share * top], axis=-1))


def louvres(
    width: float, height: float, cloth: Material, rng: np.random.Generator, *, low: float = 0.0
) -> Item:
    """Make upright strips that hang side by side from a rail, turned alike, or pleats of a blind.

    Args:
        width: Of the rail, metres.
        height: Of the rail over its lower end, metres.
        cloth: What they are made of.
        rng: Random numbers.
        low: How far over the lower end they stop, metres.
    """
    w, pitch, turn = width / 2, rng.uniform(0.08, 0.13), rng.uniform(-1.2, 1.2)
    reach, out = pitch * 0.52, 0.16
    lanes = np.arange(-w + reach, w - reach, pitch)
    step = reach * np.array([np.cos(turn), np.sin(turn)])
    sheets = []
    for x in lanes:
        ends = np.array([[x - step[0], out - step[1]], [x + step[0], out + step[1]]])
        grid = np.stack(
            [np.column_stack([ends, np.full(2, z)]) for z in (low, height - 0.04)], axis=1
        )
        sheets.append(surface(grid))
    rail = boxes((-w, 0, height - 0.04), (w, out + 0.03, height))
    parts: list[Part] = [solid(paint((226, 226, 224), rng), rail), solid(cloth, *sheets)]
    return stand("clutter", parts, "curtain")


def panel_blind(
    width: float, height: float, cloth: Material, rng: np.random.Generator, *, slats: bool
) -> Item:
    """Make a blind before a window or a wall, let down all the way: cloth, or level slats."""
    w, rows = width / 2, max(int(height / 0.03), 4) if slats else 4
    x, z = np.meshgrid([-w + 0.01, w - 0.01], np.linspace(0, height - 0.06, rows), indexing="ij")
    y = np.full(x.shape, 0.13)
    if slats:
        y = y + 0.012 * np.where(np.arange(rows) % 2, 1, -1)
    sheet = surface(np.stack([x, y, z], axis=-1))
    case = boxes((-w, 0, height - 0.07), (w, 0.16, height))
    parts = [solid(paint(cloth.base, rng), case), solid(cloth, sheet)]
    return stand("clutter", parts, "curtain")
