"""What homes hold beyond offices: beds, televisions, lamps, bowls, toys, laundry, bath tubs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcpseg_cli.synth.geometry.shapes import boxes, cushion, lathe, rod, shell, solid
from mcpseg_cli.synth.geometry.solids import Part, Triangles, shifted, tilted
from mcpseg_cli.synth.surfaces.materials import Colour, Material, Pattern, kelvin_colour
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_fabric, pick_metal, pick_wood
from mcpseg_cli.synth.things.boxes_and_bags import bright
from mcpseg_cli.synth.things.desk_things import dark_or_light, screen_parts

_LINEN: tuple[Colour, ...] = (
    *((226, 222, 212), (190, 182, 168), (120, 130, 142), (70, 78, 92), (134, 96, 88)),
    *((92, 102, 84), (60, 56, 60)),
)


_SHADES: tuple[Colour, ...] = ((232, 222, 198), (196, 170, 130), (90, 60, 50), (60, 62, 66))


def _shade(rng: np.random.Generator) -> Material:
    """Pick a lamp shade, mostly lit by a warm bulb."""
    lit = rng.uniform(0.4, 1.4) if rng.random() < 0.6 else 0.0
    if lit:
        colour = kelvin_colour(rng.uniform(2100, 3000))
        return Material("plain", colour, colour, 0.1, 0, lit)
    return paint(_SHADES[rng.integers(len(_SHADES))], rng, "weave", 0.02)


def table_lamp(style: Style, rng: np.random.Generator) -> list[Part]:
    """Table lamp with a foot and a shade."""
    tall, wide = rng.uniform(0.3, 0.6), rng.uniform(0.09, 0.19)
    cut, neck = tall * rng.uniform(0.5, 0.65), rng.uniform(0.01, 0.07)
    outline = [(0, 0), (wide * 0.6, 0), (wide * 0.55, 0.02), (neck, cut * 0.5)]
    foot = lathe([*outline, (0.012, cut), (0.01, cut + 0.03)], 14)
    body = paint(bright(rng), rng) if rng.random() < 0.5 else pick_metal(style, rng)
    cloth, top = _shade(rng), wide * rng.uniform(0.5, 1.0)
    return [solid(body, foot), solid(cloth, lathe([(wide, cut), (top, tall)], 16))]


def standard_lamp(style: Style, rng: np.random.Generator) -> list[Part]:
    """Floor lamp with a shade, on a rod or three legs."""
    tall, wide, metal = rng.uniform(1.3, 1.75), rng.uniform(0.16, 0.27), pick_metal(style, rng)
    cut = tall - rng.uniform(0.22, 0.4)
    shade = solid(_shade(rng), lathe([(wide, cut), (wide * rng.uniform(0.6, 1.0), tall)], 18))
    foot = lathe([(0, 0), (0.15, 0), (0.14, 0.02), (0.012, 0.035)], 16)
    return [solid(metal, foot, rod(0.012, 0.03, cut + 0.05)), shade]


def television(style: Style, rng: np.random.Generator) -> list[Part]:
    """Television on its feet."""
    casing, width = paint((28, 28, 31), rng), rng.uniform(0.7, 1.45)
    screen = [part.moved(y=0.12, z=0.05) for part in screen_parts(width, casing, rng)]
    ends = (-0.3 * width, 0.3 * width)
    feet = [boxes((x - 0.02, 0, 0), (x + 0.02, 0.24, 0.06)) for x in ends]
    return [*screen, *(solid(casing, foot) for foot in feet)]


def bowl(style: Style, rng: np.random.Generator) -> list[Part]:
    """Bowl, at times with fruit."""
    wide, tall = rng.uniform(0.07, 0.18), rng.uniform(0.04, 0.1)
    outside, inside = [(0, 0), (wide * 0.5, 0), (wide, tall)], [(wide * 0.5, 0.012), (0, 0.012)]
    shape = lathe([*outside, (wide * 0.94, tall), *inside], 16)
    parts = [solid(paint(bright(rng), rng), shape)]

    if rng.random() < 0.5:
        size = min(0.035, wide * 0.35)
        one = cushion((-size,) * 3, (size,) * 3, 1.0, 1.0)
        spots = rng.uniform(-wide * 0.4, wide * 0.4, (4, 2)).tolist()
        fruit = [shifted(one, x, y, 0.02 + size) for x, y in spots]
        colour = ((190, 60, 40), (220, 150, 50), (120, 150, 60))[rng.integers(3)]
        parts.append(solid(paint(colour, rng), *fruit))
    return parts


def candles(style: Style, rng: np.random.Generator) -> list[Part]:
    """Candles, remote controls and the like on a tray."""
    a, b = rng.uniform(0.08, 0.16), rng.uniform(0.06, 0.12)
    tray, places = boxes([(-a, -b, 0)], [(a, b, 0.012)]), (-a * 0.6, 0.0, a * 0.6)
    sizes = [(rng.uniform(0.018, 0.032), rng.uniform(0.05, 0.2)) for _ in places]
    wax = [rod(thick, 0.012, top, x, 0.0) for x, (thick, top) in zip(places, sizes, strict=True)]
    return [solid(pick_wood(style, rng), tray), solid(paint((222, 210, 186), rng), *wax)]


def toys(style: Style, rng: np.random.Generator) -> list[Part]:
    """A heap of building blocks and balls."""
    parts = []
    for _ in range(int(rng.integers(3, 8))):
        x, y, size = rng.uniform(-0.22, 0.22), rng.uniform(-0.22, 0.22), rng.uniform(0.025, 0.08)
        if rng.random() < 0.7:
            toy = boxes((-size, -size * 0.7, 0), (size, size * 0.7, size * 1.2))
        else:
            toy = shifted(cushion((-size,) * 3, (size,) * 3, 1.0, 1.0), z=size)
        parts.append(solid(paint(bright(rng), rng), toy).moved(x=x, y=y, yaw=rng.uniform(0, 3)))
    return parts


def laundry_basket(style: Style, rng: np.random.Generator) -> list[Part]:
    """Basket with clothes in it."""
    wide, tall = rng.uniform(0.17, 0.26), rng.uniform(0.25, 0.6)
    outside, inside = [(0, 0), (wide * 0.85, 0), (wide, tall)], (wide * 0.9, tall * 0.8)
    body, w = lathe([*outside, (wide * 0.96, tall), inside], 16), wide * 0.85
    cloth = cushion((-w, -w, tall * 0.6), (w, w, tall + 0.06), 0.9, 0.6)
    colour = ((170, 134, 90), (224, 222, 214), (110, 90, 70))[rng.integers(3)]
    basket = paint(colour, rng, "weave", 0.03)
    return [solid(basket, body), solid(paint(bright(rng), rng, "weave", 0.04), cloth)]


def clothes(style: Style, rng: np.random.Generator) -> list[Part]:
    """Clothes dropped on the floor."""
    a, b = rng.uniform(0.15, 0.35), rng.uniform(0.12, 0.25)
    heap = cushion((-a, -b, 0), (a, b, rng.uniform(0.05, 0.14)), 0.7, 0.8)
    folds = 0.25 * np.sin(heap[..., 0] * 31 + rng.uniform(0, 6)) * np.cos(heap[..., 1] * 27)
    heap[..., 2] *= 1 + folds
    return [solid(paint(bright(rng), rng, "weave", 0.05), np.maximum(heap, [-9, -9, 0.0]))]


def bed(style: Style, rng: np.random.Generator) -> list[Part]:
    """Bed with its headboard at the back, mattress, bedding and pillows, for one or two."""
    half, long = rng.choice([0.45, 0.5, 0.7, 0.8, 0.9]), rng.uniform(1.95, 2.1)
    level = rng.uniform(0.25, 0.38)
    frame = pick_fabric(style, rng) if rng.random() < 0.35 else pick_wood(style, rng)
    wide = half + 0.03

    # the frame on its feet
    head = boxes((-wide, 0, 0), (wide, 0.05, rng.uniform(0.6, 1.15)))
    sides = boxes((-wide, 0.05, level - rng.uniform(0.14, 0.22)), (wide, long + 0.08, level))
    spots = [(x, y) for x in (-half + 0.05, half - 0.05) for y in (0.2, long - 0.1)]
    feet = [solid(frame, rod(0.03, 0, level - 0.1, x, y)) for x, y in spots]
    mattress = cushion((-half, 0.06, level), (half, long + 0.06, level + 0.2), 0.08, 0.2)

    # bedding of two colours
    linen = paint(_LINEN[rng.integers(len(_LINEN))], rng, "plain")
    patterns: tuple[Pattern, ...] = ("plain", "checks", "print", "stripes")
    colour = _LINEN[rng.integers(len(_LINEN))]
    cover = paint(colour, rng, patterns[rng.integers(4)], 0.15)
    parts = [solid(frame, head), solid(frame, sides), *feet, solid(linen, mattress)]
    parts.append(solid(cover, _duvet(half, level + 0.2, rng.uniform(0.5, 0.9), long + 0.07, rng)))

    count, slip = 1 if half < 0.6 else 2, replace(linen, seed=linen.seed + 1)
    for x in (np.arange(count) - (count - 1) / 2) * half:
        pad = tilted(cushion((-0.3, -0.07, 0), (0.3, 0.07, 0.4), 0.4, 0.5), rng.uniform(0.7, 1.3))
        parts.append(solid(slip, shifted(pad, float(x), 0.47, level + 0.22)))
    return parts


def _duvet(
    half: float, top: float, first: float, last: float, rng: np.random.Generator
) -> Triangles:
    """Lay a cover with folds over a mattress, hanging down at both sides."""
    drop = rng.uniform(0.05, 0.2)
    level = [(x * half, 0.04) for x in np.linspace(-0.9, 0.9, 9)]
    side = [(half + 0.03, 0.02), (half + 0.035, -drop)]
    across = np.array([*((-x, z) for x, z in side[::-1]), *level, *side])

    y = np.linspace(first, last, 9)
    x = np.repeat(across[:, :1], len(y), axis=1)
    fold = 0.02 * np.sin(9 * x + rng.uniform(0, 6)) * np.cos(7 * y + rng.uniform(0, 6))
    z = top + across[:, 1:] + np.where(across[:, 1:] > 0.03, fold, 0.0)
    return shell(np.stack([x, np.broadcast_to(y, x.shape), z], axis=-1), 0.03)


def bath_tub(style: Style, rng: np.random.Generator) -> list[Part]:
    """Bath tub along x with its tap."""
    half, deep, tall = rng.uniform(0.7, 0.85), rng.uniform(0.66, 0.78), rng.uniform(0.52, 0.6)
    white, rim = paint((238, 238, 235), rng), 0.07
    inner, far = half - rim, deep - rim

    # four walls and the bottom
    walls = [
        boxes((-half, 0, 0), (half, rim, tall)),
        boxes((-half, far, 0), (half, deep, tall)),
        boxes((-half, rim, 0), (-inner, far, tall)),
        boxes((inner, rim, 0), (half, far, tall)),
        boxes((-inner, rim, 0), (inner, far, 0.12)),
    ]
    lows, highs = [(-0.1, 0.0, tall), (-0.02, 0.0, tall + 0.06)], [(0.1, 0.06, tall + 0.08)]
    tap = boxes(lows, [*highs, (0.02, 0.16, tall + 0.1)])
    steel = paint((180, 182, 184), rng, "metal")
    return [*(solid(white, wall) for wall in walls), solid(steel, tap)]


def washing_machine(style: Style, rng: np.random.Generator) -> list[Part]:
    """Washing machine with its round door."""
    body = boxes([(-0.3, 0, 0)], [(0.3, 0.56, 0.85)])
    ring = tilted(lathe([(0.19, 0), (0.17, 0.03), (0.12, 0.035), (0, 0.02)], 18), -np.pi / 2)
    panel = boxes([(-0.29, 0.56, 0.73)], [(0.29, 0.57, 0.83)])
    return [
        solid(paint((234, 234, 231), rng), body),
        solid(dark_or_light(rng), shifted(ring, 0, 0.56, 0.42)),
        solid(paint((120, 122, 126), rng), panel),
    ]
