"""Painting: the colour of surfaces under even white light, from their patterns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.synth.surfaces.materials import Material, Pattern
from mcpseg_cli.synth.surfaces.noise import Floats, fbm, hash01

PATTERNS: tuple[Pattern, ...] = get_args(Pattern)


@dataclass(frozen=True)
class Surface:
    """Points on surfaces of one pattern, each with its own material's settings.

    Attributes:
        xyz: (N, 3) float32, metres, in the frame of the part.
        normals: (N, 3) float32 unit vectors in that frame.
        base: (N, 3) float32 main colour, 0-255.
        accent: (N, 3) float32 second colour.
        scale: (N,) float32 repeat of the pattern, metres.
        seed: (N,) uint32, tells surfaces apart.
        grain: (N,) int8 axis along which the part is longest.
        middle: (N, 3) float32 middle of the part.
    """

    xyz: Floats
    normals: Floats
    base: Floats
    accent: Floats
    scale: Floats
    seed: NDArray[np.uint32]
    grain: NDArray[np.int8]
    middle: Floats

    def plane(self, along_grain: bool = False) -> tuple[Floats, Floats]:
        """Return coordinates on the surface: v is up on upright faces, or u along the grain."""
        across = np.argmax(np.abs(self.normals), axis=1)
        first = np.where(across == 0, 1, 0)
        second = np.where(across == 2, 1, 2)
        if along_grain:
            swap = self.grain == second
            first, second = np.where(swap, second, first), np.where(swap, first, second)
        rows = np.arange(len(across))
        return self.xyz[rows, first], self.xyz[rows, second]


Shades = tuple[Floats, Floats]
"""How much of the accent shows, 0-1, and how bright the surface is, 1 for as is; (N,) each."""


def paint_points(
    material: Material,
    xyz_local: NDArray[np.float32],
    normals: NDArray[np.float32],
    rng: np.random.Generator,
) -> Floats:
    """Paint points of one material.

    Args:
        material: The material.
        xyz_local: (N, 3) float32, metres, in the part's frame.
        normals: (N, 3) float32 unit vectors in that frame.
        rng: Random numbers, for grain finer than the points.

    Returns:
        (N, 3) float32 colour, 0-255.
    """
    count = len(xyz_local)
    if not count:
        return np.zeros((0, 3), np.float32)

    # all of one material, and the part as large as they reach
    low, high = xyz_local.min(axis=0), xyz_local.max(axis=0)
    surface = Surface(
        np.asarray(xyz_local, np.float32),
        np.asarray(normals, np.float32),
        np.tile(np.array(material.base, np.float32), (count, 1)),
        np.tile(np.array(material.accent, np.float32), (count, 1)),
        np.full(count, material.scale, np.float32),
        np.full(count, material.seed & 0xFFFFFFFF, np.uint32),
        np.full(count, np.argmax(high - low), np.int8),
        np.tile(np.float32((low + high) / 2), (count, 1)),
    )
    return paint_surface(material.pattern, surface, rng)


def paint_surface(pattern: Pattern, surface: Surface, rng: np.random.Generator) -> Floats:
    """Paint points of one pattern, with dirt and bright spots; see ``paint_points``."""
    if pattern == "book":
        colour, light = _books(surface)
    else:
        share, light = _PAINTERS[pattern](surface, rng)
        colour = surface.base + np.clip(share, 0, 1)[:, None] * (surface.accent - surface.base)
    dirt = 0.96 + 0.08 * fbm(surface.xyz, 0.9, surface.seed + np.uint32(77), 2)
    light = light * dirt * (1 + rng.normal(0, 0.015, len(light)).astype(np.float32))
    painted: Floats = np.clip(colour * light[:, None], 0, 255).astype(np.float32)
    return painted


def _cells(value: Floats, size: Floats | float) -> tuple[NDArray[np.int32], Floats]:
    """Return which cell of a row each value lies in, and where in it, 0-1."""
    place = value / size
    cell = np.floor(place)
    return cell.astype(np.int32), (place - cell).astype(np.float32)


def _line(place: Floats, width: Floats | float) -> NDArray[np.bool_]:
    """Return whether a place in a cell lies on the line around it, as wide as a share of it."""
    return (place < width) | (place > 1 - np.asarray(width))


def _shades(share: NDArray[np.generic], light: NDArray[np.generic]) -> Shades:
    """Return both in single precision."""
    return share.astype(np.float32), light.astype(np.float32)


def _plain(s: Surface, rng: np.random.Generator) -> Shades:
    return 0.2 * fbm(s.xyz, 3.0, s.seed, 2), np.ones(len(s.xyz), np.float32)


def _plaster(s: Surface, rng: np.random.Generator) -> Shades:
    blotches = fbm(s.xyz, 1.2, s.seed, 4)
    bumps = fbm(s.xyz, 25.0, s.seed + np.uint32(9), 2)
    return 0.12 * np.clip(blotches - 0.45, 0, 1), 0.97 + 0.06 * bumps


def _carpet(s: Surface, rng: np.random.Generator) -> Shades:
    u, v = s.plane()
    row, _ = _cells(u, s.scale)
    column, _ = _cells(v, s.scale)
    tuft = rng.random(len(u), np.float32)
    worn = fbm(s.xyz, 1.5, s.seed, 3)
    share = 0.55 * tuft + 0.4 * fbm(s.xyz, 30.0, s.seed, 2)
    return share, 0.94 + 0.08 * hash01(row, column, s.seed) + 0.12 * (worn - 0.5)


def _wood(s: Surface, rng: np.random.Generator) -> Shades:
    # planks, each cut into pieces
    u, v = s.plane(along_grain=True)
    plank, across = _cells(v, s.scale)
    shift = hash01(plank, np.zeros_like(plank), s.seed)
    piece, along = _cells(u + 1.4 * shift, 1.4)
    width = (0.02 / np.maximum(s.scale * 8, 0.4)).astype(np.float32)
    joint = _line(across, width) | (along < 0.004)

    # noise stretched along them, its level lines the rings
    own = hash01(plank, piece, s.seed) * 50
    stretched = np.column_stack([u * 1.5, v * 18, own]).astype(np.float32)
    grain = fbm(stretched, 1.0, s.seed, 4)
    ring = 0.5 + 0.5 * np.sin(25 * grain)
    share = 0.3 * ring + 0.8 * np.clip(grain - 0.35, 0, 1)
    light = 0.88 + 0.24 * hash01(plank, piece, s.seed + np.uint32(3))
    return share, np.where(joint, light * 0.75, light).astype(np.float32)


def _brick(s: Surface, rng: np.random.Generator) -> Shades:
    u, v = s.plane()
    row, up = _cells(v, 0.078 * s.scale)
    brick, along = _cells(u + 0.115 * s.scale * (row % 2), 0.23 * s.scale)
    mortar = _line(up, 0.08) | _line(along, 0.025)
    light = 0.75 + 0.45 * hash01(brick, row, s.seed) + 0.25 * (fbm(s.xyz, 40.0, s.seed, 2) - 0.5)
    return _shades(np.where(mortar, 0.95, 0.12), np.where(mortar, 0.9, light))


def _tiles(s: Surface, rng: np.random.Generator) -> Shades:
    u, v = s.plane()
    column, along = _cells(u, s.scale)
    row, up = _cells(v, s.scale)
    width = 0.004 / s.scale
    grout = _line(along, width) | _line(up, width)
    light = 0.95 + 0.09 * hash01(column, row, s.seed) + 0.1 * (fbm(s.xyz, 8.0, s.seed, 3) - 0.5)
    return np.where(grout, 1.0, 0.1).astype(np.float32), light


def _acoustic(s: Surface, rng: np.random.Generator) -> Shades:
    # rails between the tiles, and the groove beside them
    u, v = s.plane()
    column, along = _cells(u, s.scale)
    row, up = _cells(v, s.scale)
    width = 0.012 / s.scale
    rail = _line(along, width) | _line(up, width)
    groove = _line(along, 1.9 * width) | _line(up, 1.9 * width)

    pores = np.clip((fbm(s.xyz, 45.0, s.seed, 2) - 0.58) * 5, 0, 1)
    light = 0.95 + 0.07 * hash01(column, row, s.seed)
    stained = np.clip(fbm(s.xyz, 0.8, s.seed + np.uint32(5), 3) - 0.66, 0, 1) * 1.5
    share = np.where(rail, 0.0, np.where(groove, 0.9, pores + stained))
    return _shades(share, np.where(rail, 1.04, light))


def _concrete(s: Surface, rng: np.random.Generator) -> Shades:
    u, v = s.plane()
    _, along = _cells(u, s.scale)
    _, up = _cells(v, s.scale)
    joint = _line(along, 0.004) | _line(up, 0.004)
    stain = 1.6 * np.clip(fbm(s.xyz, 1.6, s.seed, 5) - 0.4, 0, 1)
    pits = fbm(s.xyz, 60.0, s.seed, 1) > 0.86
    return _shades(np.where(joint, 0.8, stain), np.where(pits, 0.8, 1.0))


def _weave(s: Surface, rng: np.random.Generator) -> Shades:
    mottle = fbm(s.xyz, 60.0, s.seed, 2)
    share = 0.3 * rng.random(len(s.xyz), np.float32) + 0.5 * mottle
    return share, 0.9 + 0.2 * fbm(s.xyz, 6.0, s.seed, 2)


def _stripes(s: Surface, rng: np.random.Generator) -> Shades:
    u, _ = s.plane()
    _, place = _cells(u, s.scale)
    return (place < 0.45).astype(np.float32), 0.95 + 0.1 * fbm(s.xyz, 20.0, s.seed, 2)


def _checks(s: Surface, rng: np.random.Generator) -> Shades:
    u, v = s.plane()
    _, along = _cells(u, s.scale)
    _, up = _cells(v, s.scale)
    share = 0.5 * (along < 0.4) + 0.5 * (up < 0.4)
    return share.astype(np.float32), 0.95 + 0.1 * fbm(s.xyz, 20.0, s.seed, 2)


def _print(s: Surface, rng: np.random.Generator) -> Shades:
    blobs = fbm(s.xyz, 2.2 / s.scale, s.seed, 2)
    return np.clip((blobs - 0.5) * 9, 0, 1), np.ones(len(blobs), np.float32)


def _leather(s: Surface, rng: np.random.Generator) -> Shades:
    crease = np.abs(fbm(s.xyz, 14.0, s.seed, 3) - 0.5)
    sheen = 0.9 + 0.35 * np.clip(s.normals[:, 2], 0, 1) * fbm(s.xyz, 4.0, s.seed + np.uint32(2), 2)
    return np.clip(0.7 - 9 * crease, 0, 0.7), sheen


def _metal(s: Surface, rng: np.random.Generator) -> Shades:
    u, v = s.plane(along_grain=True)
    along = np.column_stack([u * 2, v * 90, np.zeros_like(u)]).astype(np.float32)
    around = np.column_stack([u * 3, v * 3, s.normals[:, 2] * 2]).astype(np.float32)
    brushed = fbm(along, 1.0, s.seed, 2)
    reflection = fbm(around, 1.0, s.seed + np.uint32(4), 2)
    return 0.5 * brushed, 0.65 + 0.7 * reflection


def _glass(s: Surface, rng: np.random.Generator) -> Shades:
    """The outside, or the room mirrored: brighter towards the top, soft shapes and streaks."""
    outside = fbm(s.xyz, 1.1, s.seed, 2)
    height = np.clip((s.xyz[:, 2] - 0.6) / 1.6, 0, 1)
    streak = fbm(s.xyz * np.array([1, 1, 0.15], np.float32), 3.0, s.seed + np.uint32(2), 2)
    share = 0.9 * height + 1.2 * (outside - 0.5)
    light = 0.7 + 0.3 * height + 0.3 * (outside - 0.5) + 0.2 * (streak - 0.5)
    return np.clip(share, 0, 1), light.astype(np.float32)


def _screen(s: Surface, rng: np.random.Generator) -> Shades:
    """Dark ones mirror the room smoothly; lit ones show windows with lines of text, a task bar."""
    u, v = s.plane()
    mirrored = np.clip(3.0 * (fbm(s.xyz, 2.5, s.seed, 2) - 0.45), 0, 1) * 0.7

    # windows with a title, and text in them
    column, along = _cells(u - s.middle[:, 0], 0.27)
    row, up = _cells(v - s.middle[:, 2], 0.22)
    is_window = hash01(column, row, s.seed) > 0.35
    line, _ = _cells(v, 0.05)
    text = (hash01(column, line, s.seed + np.uint32(1)) > 0.5) & (along < 0.7)
    shown = np.where(up > 0.85, 0.2, np.where(text, 0.72, 1.0)) * (along < 0.94)
    lit = np.where(is_window, shown, 0.15 * along + 0.1 * up)

    is_lit = s.base.mean(axis=1) > 60
    return _shades(np.where(is_lit, lit, mirrored), np.where(is_lit, 1.05, 0.9 + 0.3 * mirrored))


def _foliage(s: Surface, rng: np.random.Generator) -> Shades:
    leaf = fbm(s.xyz, 18.0, s.seed, 2)
    light = 0.65 + 0.7 * rng.random(len(leaf), np.float32)
    return np.clip((leaf - 0.3) * 2, 0, 1), light.astype(np.float32)


def _paper(s: Surface, rng: np.random.Generator) -> Shades:
    u, v = s.plane()
    line, place = _cells(v, 0.02)
    word, _ = _cells(u, 0.025)
    ink = (place < 0.5) & (hash01(word, line, s.seed) > 0.35) & (fbm(s.xyz, 6.0, s.seed, 1) > 0.4)
    return np.where(ink, 0.55, 0.02).astype(np.float32), np.full(len(u), 1.0, np.float32)


def _whiteboard(s: Surface, rng: np.random.Generator) -> Shades:
    written = fbm(s.xyz, 2.5, s.seed + np.uint32(1), 1) > 0.55
    stroke = np.abs(fbm(s.xyz, 16.0, s.seed, 2) - 0.5) < 0.025
    smear = np.clip(fbm(s.xyz, 3.0, s.seed + np.uint32(2), 3) - 0.55, 0, 1)
    share = np.where(written & stroke, 0.6, 0.5 * smear).astype(np.float32)
    return share, 0.97 + 0.06 * fbm(s.xyz, 0.7, s.seed, 2)


def _chalkboard(s: Surface, rng: np.random.Generator) -> Shades:
    share, light = _whiteboard(s, rng)
    return share + np.clip(fbm(s.xyz, 2.0, s.seed + np.uint32(6), 3) - 0.4, 0, 1) * 0.6, light


def _cardboard(s: Surface, rng: np.random.Generator) -> Shades:
    # tape along the middle of top and bottom, a print on the sides
    _, v = replace(s, xyz=s.xyz - s.middle).plane(along_grain=True)
    is_level = np.abs(s.normals[:, 2]) > 0.5
    tape = (np.abs(v) < 0.025) & is_level
    print_ = (fbm(s.xyz, 9.0, s.seed, 1) > 0.72) & (np.abs(s.normals[:, 2]) < 0.5)
    share = np.where(tape, 0.8, np.where(print_, 0.5, 0.08)).astype(np.float32)
    return share, 0.94 + 0.12 * fbm(s.xyz, 12.0, s.seed, 2)


def _marble(s: Surface, rng: np.random.Generator) -> Shades:
    cloud = fbm(s.xyz, 2.0, s.seed, 4)
    vein = np.clip(1 - 22 * np.abs(fbm(s.xyz, 1.1, s.seed + np.uint32(8), 4) - 0.5), 0, 1)
    return 0.5 * cloud + 0.4 * vein, 0.95 + 0.1 * fbm(s.xyz, 30.0, s.seed, 2)


def _books(s: Surface) -> Shades:
    """Return colour, (N, 3), and brightness of rows of books with titles on their backs."""
    u, v = s.plane()
    book, along = _cells(u, np.minimum(s.scale, 0.06))
    row = np.zeros_like(book)
    tint = np.column_stack([hash01(book, row + k, s.seed) for k in range(3)])
    mix = hash01(book, row + 4, s.seed)[:, None]
    colour = s.base * (1 - mix) + s.accent * mix + (tint - 0.5) * 50

    # gaps between them are dark, titles bright
    _, up = _cells(v, 0.11)
    title = (up > 0.55) & (up < 0.75) & (hash01(book, row + 5, s.seed) > 0.4)
    gap = _line(along, 0.06)
    own = 0.8 + 0.4 * hash01(book, row + 6, s.seed)
    return _shades(colour, np.where(gap, 0.5, np.where(title, 1.5, 1.0)) * own)


_PAINTERS: dict[Pattern, Callable[[Surface, np.random.Generator], Shades]] = {
    "plain": _plain,
    "carpet": _carpet,
    "wood": _wood,
    "brick": _brick,
    "plaster": _plaster,
    "tiles": _tiles,
    "acoustic": _acoustic,
    "concrete": _concrete,
    "weave": _weave,
    "stripes": _stripes,
    "checks": _checks,
    "print": _print,
    "leather": _leather,
    "metal": _metal,
    "glass": _glass,
    "screen": _screen,
    "foliage": _foliage,
    "paper": _paper,
    "whiteboard": _whiteboard,
    "chalkboard": _chalkboard,
    "cardboard": _cardboard,
    "marble": _marble,
}
