"""Rugs: they are part of the floor, which is cut out under them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from mcpseg_cli.synth.geometry.solids import Item, Part, Triangles, area_of, part_of
from mcpseg_cli.synth.surfaces.materials import Colour, Pattern
from mcpseg_cli.synth.surfaces.styles import Style, paint

RUG_HEIGHT = 0.004
"""How far a rug lies over the floor, metres: too little to see furniture sink in."""
_COLOURS: tuple[Colour, ...] = (
    *((112, 36, 36), (134, 70, 54), (58, 64, 92), (92, 88, 84), (184, 172, 150)),
    *((206, 196, 176), (64, 62, 62), (150, 118, 72), (70, 90, 84), (140, 128, 116)),
)
_PATTERNS: tuple[Pattern, ...] = ("print", "print", "carpet", "weave", "stripes", "checks")

Outline = NDArray[np.float64]
"""(K, 2) corners of a convex polygon, counter-clockwise, metres."""


def make_rug(outline: Outline, style: Style, rng: np.random.Generator) -> Item:
    """Make a rug about the origin, in most cases with a border of another colour.

    Args:
        outline: Its outline.
        style: Colours of the building.
        rng: Decides pattern and colours.

    Returns:
        An object of class floor, to be moved where it lies; it is a sheet without edges.
    """
    colours = _COLOURS + style.upholstery
    pattern = _PATTERNS[rng.integers(len(_PATTERNS))]
    field = paint(colours[rng.integers(len(colours))], rng, pattern, rng.uniform(0.03, 0.4))
    other = colours[rng.integers(len(colours))]
    if pattern in ("print", "stripes", "checks"):
        field = replace(field, accent=other)
    if rng.random() < 0.35:
        return Item("floor", (part_of(_sheet([outline]), field),), "rug")

    # a border all round
    inner = outline * (1.0 - rng.uniform(0.1, 0.4) / np.ptp(outline, axis=0))
    border = paint(other, rng, "carpet", 0.1)
    rim = part_of(_sheet(_cut(outline, inner)), border)
    return Item("floor", (part_of(_sheet([inner]), field), rim), "rug")


def lay_rugs(items: Sequence[Item]) -> list[Item]:
    """Lay the rugs of a room on its floor, which is cut out under them.

    Args:
        items: Objects of one room, the floor before any rugs; these are the further ones of class
            floor.

    Returns:
        The same objects, the rugs after the floor, each cut out under those that came later, and
        none of which nothing is left; the very same ones where there is no rug.
    """
    floors = [item for item in items if item.name == "floor"]
    if len(floors) < 2:
        return list(items)

    # each rug is cut out of all that lies there before it
    laid = floors[:1]
    for rug in floors[1:]:
        corners = np.concatenate([part.triangles[..., :2].reshape(-1, 2) for part in rug.parts])
        outline = corners[ConvexHull(corners).vertices]
        cut = [replace(item, parts=_cut_out(item.parts, outline)) for item in laid]
        laid = [*(item for item in cut if item.parts), rug]

    # where the floor was
    place = next(number for number, item in enumerate(items) if item is floors[0])
    after = [item for item in items[place:] if item.name != "floor"]
    return [*items[:place], *laid, *after]


def _cut_out(parts: tuple[Part, ...], outline: Outline) -> tuple[Part, ...]:
    """Return level parts with an outline cut out."""
    return tuple(kept for part in parts for kept in _without(part, outline))


def _without(part: Part, outline: Outline) -> list[Part]:
    """Return a level part with an outline cut out; none if nothing is left."""
    level = float(part.triangles[0, 0, 2])
    pieces = [piece for triangle in part.triangles for piece in _cut(triangle[:, :2], outline)]
    left = _sheet(pieces, level)
    left = left[area_of(left) > 1e-7]
    return [replace(part, triangles=left)] if len(left) else []


def _cut(polygon: Outline, hole: Outline) -> list[Outline]:
    """Return convex pieces of a convex polygon that lie outside a convex hole."""
    pieces, rest = [], polygon
    for start, end in zip(hole, np.roll(hole, -1, axis=0), strict=True):
        piece = _half(rest, end, start)  # right of this edge
        if len(piece):
            pieces.append(piece)
        rest = _half(rest, start, end)
        if not len(rest):
            break
    return pieces


def _half(polygon: Outline, start: Outline, end: Outline) -> Outline:
    """Return the part of a convex polygon to the left of the line from start to end."""
    along = end - start
    side = along[0] * (polygon[:, 1] - start[1]) - along[1] * (polygon[:, 0] - start[0])
    kept = []

    # corners on the left, and where edges cross the line
    for number in range(len(polygon)):
        after = (number + 1) % len(polygon)
        if side[number] >= 0:
            kept.append(polygon[number])
        if (side[number] < 0) != (side[after] < 0):
            share = side[number] / (side[number] - side[after])
            kept.append(polygon[number] + share * (polygon[after] - polygon[number]))
    return np.array(kept) if len(kept) > 2 else np.zeros((0, 2))


def _sheet(pieces: Sequence[Outline], level: float = RUG_HEIGHT) -> Triangles:
    """Return the triangles of convex pieces at a height, facing up."""
    if not pieces:
        return np.zeros((0, 3, 3))
    fans = [(np.broadcast_to(p[0], p[1:-1].shape), p[1:-1], p[2:]) for p in pieces]
    flat = np.concatenate([np.stack(fan, axis=1) for fan in fans])
    return np.concatenate([flat, np.full((*flat.shape[:2], 1), level)], axis=2)
