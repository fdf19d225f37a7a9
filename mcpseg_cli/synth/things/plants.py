"""Plants in pots."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import Points, boxes, lathe, leaves, pipe, solid
from mcpseg_cli.synth.geometry.solids import Part
from mcpseg_cli.synth.surfaces.styles import Style, paint


def plant(style: Style, rng: np.random.Generator) -> list[Part]:
    """Tall plant on the floor: a bush, a palm, a rubber tree or a dracaena."""
    across, pot = rng.uniform(0.15, 0.23), rng.uniform(0.22, 0.5)
    parts = _pot(across, pot, rng)
    height = rng.uniform(0.9, 1.9)
    return parts + (_palm, _bush, _tuft)[rng.integers(3)](pot * 0.9, height, rng)


def small_plant(style: Style, rng: np.random.Generator) -> list[Part]:
    """Plant for a desk or sill."""
    across, pot = rng.uniform(0.045, 0.09), rng.uniform(0.07, 0.15)
    parts, grown = _pot(across, pot, rng), (_bush, _tuft)[rng.integers(2)]
    return parts + grown(pot * 0.9, pot + rng.uniform(0.12, 0.4), rng)


def _green(rng: np.random.Generator) -> tuple[float, float, float]:
    """Pick a green."""
    base = np.array([(52, 92, 40), (70, 110, 50), (40, 76, 48), (96, 120, 60)][rng.integers(4)])
    red, green, blue = (base + rng.normal(0, 8, 3)).tolist()
    return red, green, blue


def _pot(across: float, height: float, rng: np.random.Generator) -> list[Part]:
    """Make a pot, round or square, with its soil."""
    colour = ((160, 92, 66), (228, 226, 220), (60, 60, 64), (120, 110, 100))[rng.integers(4)]
    material = paint(colour, rng)
    soil = paint((60, 46, 36), rng)
    low, high = height * 0.8, height * 0.9
    if rng.random() < 0.25:
        a, b = across, across - 0.015
        box = boxes(
            [(-a, -a, 0), (-a, -a, 0), (b, -a, 0), (-a, -a, 0), (-a, b, 0)],
            [(a, a, 0.02), (-b, a, height), (a, a, height), (a, -b, height), (a, a, height)],
        )
        return [solid(material, box), solid(soil, boxes((-b, -b, low), (b, b, high)))]

    # round ones are wider at the rim
    rim = across * rng.uniform(1.0, 1.15)
    edge = (rim * 0.92, height)
    body = lathe([(0, 0), (across * 0.75, 0), (rim, height), edge], 14)
    return [solid(material, body), solid(soil, lathe([edge, (across * 0.85, high), (0, high)], 14))]


def _directions(count: int, rng: np.random.Generator, rise: tuple[float, float]) -> Points:
    """Return unit vectors around the upright with elevations in a range, (count, 3)."""
    around = (np.arange(count) + rng.uniform(0, 1.2, count)) * (2 * np.pi / count)
    around = around + rng.uniform(0, 6)
    up = rng.uniform(*rise, count)
    return np.column_stack([np.cos(around) * np.cos(up), np.sin(around) * np.cos(up), np.sin(up)])


def _bush(low: float, high: float, rng: np.random.Generator) -> list[Part]:
    """Make stems with many leaves about them, in two greens."""
    tall = high - low
    stems = int(rng.integers(3, 8))
    tips = _directions(stems, rng, (0.9, 1.5)) * tall * rng.uniform(0.6, 0.95, (stems, 1))
    wood, twigs = paint((96, 78, 52), rng), []
    for x, y, z in tips.tolist():
        path = [(0, 0, low - 0.02), (x * 0.4, y * 0.4, low + z * 0.6), (x, y, low + z)]
        twigs.append(pipe(path, max(0.004, tall * 0.007), 4))

    # leaves along the outer part of the stems
    count = int(rng.integers(60, 160))
    share = rng.uniform(0.25, 1.0, (count, 1))
    base = tips[rng.integers(stems, size=count)] * share + [0, 0, low]
    length = max(tall * rng.uniform(0.1, 0.18), 0.03)
    tip = base + _directions(count, rng, (-0.5, 0.9)) * length * rng.uniform(0.6, 1.2, (count, 1))
    tip[:, 2] = np.maximum(tip[:, 2], 0.02)

    parts, halves = [solid(wood, *twigs)], count // 2
    for part in (slice(0, halves), slice(halves, count)):
        green = paint(_green(rng), rng, "foliage", 0.05)
        parts.append(solid(green, leaves(base[part], tip[part], length * 0.55, 0.12)))
    return parts


def _tuft(low: float, high: float, rng: np.random.Generator) -> list[Part]:
    """Make long leaves out of one or several heads on bare stems: dracaena, snake plant."""
    tall, parts = high - low, []
    heads = int(rng.integers(1, 4))
    for _ in range(heads):
        # where it is, on a stem if there are more
        x, y = rng.normal(0, 0.03 + 0.05 * tall * (heads > 1), 2)
        spot = np.array([x, y, low + tall * rng.uniform(0.0, 0.6) * (heads > 1)])
        if heads > 1:
            stem = pipe([(0, 0, low - 0.02), spot.tolist()], 0.012, 5)
            parts.append(solid(paint((120, 96, 66), rng), stem))

        # leaves that rise and then bend down
        count, length = int(rng.integers(14, 34)), min(0.7 * tall, 0.75)
        way = _directions(count, rng, (0.5, 1.5)) * length * rng.uniform(0.6, 1.0, (count, 1))
        knee = spot + way * 0.7
        tip = knee + way * 0.5 * [1.0, 1.0, -0.35]
        green, width = paint(_green(rng), rng, "foliage", 0.05), max(0.02, length * 0.07)
        rising = leaves(np.broadcast_to(spot, knee.shape), knee + (tip - knee) * 0.2, width)
        falling = leaves(knee - way * 0.1, tip, width * 0.8)
        parts.append(solid(green, rising, falling))
    return parts


def _palm(low: float, high: float, rng: np.random.Generator) -> list[Part]:
    """Make arching fronds with leaflets."""
    tall, count = high - low, int(rng.integers(7, 13))
    bases, tips, stems = [], [], []
    way = _directions(count, rng, (0.9, 1.45))
    steps = np.linspace(0, 1, 9)[:, None]
    for row in range(count):
        # the frond's spine
        reach = way[row] * tall * rng.uniform(0.7, 1.0)
        spine = steps * reach * [1 + 0.4, 1 + 0.4, 1] - steps**2 * [0, 0, 0.25 * tall] + [0, 0, low]
        stems.append(pipe(spine[::2], 0.006, 4))

        # leaflets to both sides, longest in its middle
        side = np.cross(reach, [0, 0, 1.0])
        side /= max(float(np.linalg.norm(side)), 1e-9)
        for sign in (-1, 1):
            bases.append(spine[2:])
            spread = 0.22 * tall * np.sin(np.pi * np.clip(steps[2:] * 1.05, 0, 1)) + 0.02
            tips.append(spine[2:] + sign * side * spread * 0.7 + reach * 0.12 - [0, 0, 0.04])

    fronds = leaves(np.concatenate(bases), np.concatenate(tips), 0.03)
    wood, green = paint((90, 110, 60), rng), paint(_green(rng), rng, "foliage", 0.05)
    return [solid(wood, *stems), solid(green, fronds)]
