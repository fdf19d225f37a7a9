"""Pantry and washroom: counters, fridges, coolers, machines, basins, toilets, stalls."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import bend, boxes, cushion, lathe, pipe, rod, solid
from mcpseg_cli.synth.geometry.solids import Part, shifted, tilted
from mcpseg_cli.synth.models.stand_in import row_of
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_plastic, pick_table_top, pick_wood
from mcpseg_cli.synth.things.boxes_and_bags import bright
from mcpseg_cli.synth.things.desk_things import dark_or_light


def counter(style: Style, rng: np.random.Generator) -> list[Part]:
    """Kitchen counter with doors, a sink and a tap."""
    return counter_parts(rng.uniform(1.2, 2.8), style, rng)


def counter_parts(width: float, style: Style, rng: np.random.Generator) -> list[Part]:
    """Make a counter of a width."""
    if models := row_of("clutter", "counter", style, rng, width):
        return models
    face = pick_wood(style, rng) if rng.random() < 0.5 else pick_plastic(style, rng)
    depth, height, w = rng.uniform(0.58, 0.65), rng.uniform(0.86, 0.94), width / 2
    edges = np.linspace(-w, w, max(int(width / 0.55), 2) + 1)

    # the body on its plinth, doors and handles before it
    body = boxes(
        [(-w, 0, 0.1), (-w + 0.02, 0, 0)],
        [(w, depth - 0.03, height - 0.035), (w - 0.02, depth - 0.09, 0.1)],
    )
    doors = boxes(
        [(x + 0.003, depth - 0.03, 0.12) for x in edges[:-1]],
        [(x - 0.003, depth - 0.012, height - 0.05) for x in edges[1:]],
    )
    pulls = boxes(
        [(x + 0.08, depth - 0.012, height - 0.12) for x in edges[:-1]],
        [(x + 0.22, depth + 0.01, height - 0.105) for x in edges[:-1]],
    )

    # the top around a sink, a tap behind it
    x = rng.uniform(-w + 0.35, w - 0.35)
    steel = paint((190, 192, 194), rng, "metal")
    left, right, rear, front, low = x - 0.22, x + 0.22, 0.12, depth - 0.12, height - 0.035
    top = boxes(
        [(-w, 0, low), (right, 0, low), (left, 0, low), (left, front, low)],
        [(left, depth, height), (w, depth, height), (right, rear, height), (right, depth, height)],
    )
    bowl = boxes((left, rear, height - 0.034), (right, front, height - 0.03))
    high = height + 0.26
    bent = [(x, 0.07, height), (x, 0.07, high), (x, 0.24, high), (x, 0.24, height + 0.18)]
    metals = [pulls, bowl, pipe(bend(bent, 0.1), 0.012)]

    parts = [solid(pick_table_top(style, rng), top), solid(face, body, doors)]
    return parts + [solid(steel, piece) for piece in metals]


def wall_cupboard(style: Style, rng: np.random.Generator) -> list[Part]:
    """Kitchen wall cupboards."""
    width, depth, height = rng.uniform(0.8, 2.4), rng.uniform(0.3, 0.37), rng.uniform(0.55, 0.8)
    w, face = width / 2, pick_wood(style, rng) if rng.random() < 0.5 else pick_plastic(style, rng)
    edges = np.linspace(-w, w, max(int(width / 0.5), 2) + 1)
    doors = boxes(
        [(x + 0.003, depth, 0.004) for x in edges[:-1]],
        [(x - 0.003, depth + 0.018, height - 0.004) for x in edges[1:]],
    )
    return [solid(face, boxes((-w, 0, 0), (w, depth, height)), doors)]


def fridge(style: Style, rng: np.random.Generator) -> list[Part]:
    """Fridge, small or tall, with its handles."""
    tall = rng.random() < 0.6
    w, d = rng.uniform(0.5, 0.7) / 2, rng.uniform(0.55, 0.68)
    h = rng.uniform(1.5, 1.9) if tall else rng.uniform(0.8, 0.9)
    material = paint(((238, 238, 236), (182, 184, 186), (60, 62, 66))[rng.integers(3)], rng)
    cut = h * rng.uniform(0.6, 0.72) if tall else h - 0.01

    # a second door over the first of tall ones
    doors = [((-w, d, 0.06), (w, d + 0.05, cut))]
    bars = [((w - 0.06, d + 0.05, cut - 0.35), (w - 0.035, d + 0.085, cut - 0.05))]
    if tall:
        end = min(cut + 0.3, h - 0.02)
        doors.append(((-w, d, cut + 0.006), (w, d + 0.05, h)))
        bars.append(((w - 0.06, d + 0.05, cut + 0.05), (w - 0.035, d + 0.085, end)))
    fronts, pulls = (boxes([a for a, _ in set_], [b for _, b in set_]) for set_ in (doors, bars))
    body = solid(material, boxes((-w, 0, 0), (w, d, h)), fronts)
    return [body, solid(paint((170, 172, 174), rng, "metal"), pulls)]


def microwave(style: Style, rng: np.random.Generator) -> list[Part]:
    """Microwave oven."""
    w, d, h = rng.uniform(0.44, 0.54) / 2, rng.uniform(0.32, 0.42), rng.uniform(0.25, 0.31)
    glass = boxes((-w + 0.03, d, 0.04), (w * 0.45, d + 0.008, h - 0.03))
    panel = boxes((w * 0.55, d, 0.02), (w - 0.02, d + 0.004, h - 0.02))
    return [
        solid(dark_or_light(rng), boxes((-w, 0, 0), (w, d, h)), panel),
        solid(paint((24, 24, 27), rng, "glass"), glass),
    ]


def coffee_machine(style: Style, rng: np.random.Generator) -> list[Part]:
    """Coffee machine with its spout and cup."""
    w, d, h = rng.uniform(0.2, 0.34) / 2, rng.uniform(0.3, 0.42), rng.uniform(0.3, 0.44)
    lows, highs = [(-w, 0, 0), (-w, 0, h * 0.6), (-w, 0, 0)], [(w, d * 0.55, h), (w, d, h)]
    body = boxes(lows, [*highs, (w, d, 0.05)])
    spout = rod(0.02, h * 0.5, h * 0.61, 0, d * 0.8, 8)
    cup = lathe([(0, 0.05), (0.03, 0.05), (0.04, 0.13), (0.03, 0.12), (0, 0.07)], 10, 0, d * 0.8)
    casing, steel = dark_or_light(rng), paint((150, 150, 152), rng, "metal")
    return [solid(casing, body), solid(steel, spout), solid(paint((236, 235, 230), rng), cup)]


def water_cooler(style: Style, rng: np.random.Generator) -> list[Part]:
    """Water cooler with its bottle."""
    w, d, h = 0.16, 0.34, rng.uniform(0.9, 1.05)
    body = boxes(
        [(-w, 0, 0), (-w, 0, h * 0.55), (-w, d * 0.8, 0), (-w, 0, h * 0.85)],
        [(w, d * 0.8, h), (w, d * 0.82, h * 0.85), (w, d, h * 0.6), (w, d, h)],
    )
    taps = boxes(
        [(x - 0.015, d * 0.8, h * 0.74) for x in (-0.06, 0.06)],
        [(x + 0.015, d * 0.95, h * 0.78) for x in (-0.06, 0.06)],
    )

    # the bottle stands on its neck, a groove around it
    below = [(0.04, h), (0.05, h + 0.04), (0.13, h + 0.1), (0.13, h + 0.2)]
    groove = [(0.122, h + 0.22), (0.13, h + 0.24)]
    bottle = lathe([*below, *groove, (0.13, h + 0.37), (0, h + 0.38)], 14)
    white, water = paint((228, 228, 226), rng), paint((130, 170, 205), rng, "glass")
    placed = shifted(bottle, 0, d / 2, 0)
    return [solid(white, body), solid(water, placed), solid(paint((60, 90, 170), rng), taps)]


def vending_machine(style: Style, rng: np.random.Generator) -> list[Part]:
    """Vending machine with a window of goods."""
    w, d, h = rng.uniform(0.7, 1.0) / 2, rng.uniform(0.65, 0.85), rng.uniform(1.75, 1.9)
    body = boxes([(-w, 0, 0.04), (-w + 0.03, 0.03, 0)], [(w, d, h), (w - 0.03, d - 0.05, 0.04)])
    pane = boxes((-w + 0.06, d, 0.55), (w * 0.45, d + 0.01, h - 0.12))
    lows, highs = [(w * 0.55, d, 0.7), (-w + 0.06, d, 0.2)], [(w - 0.04, d + 0.02, 1.5)]
    panel = boxes(lows, [*highs, (w * 0.45, d + 0.03, 0.42)])
    casing, goods = paint(bright(rng), rng), paint((120, 110, 90), rng, "print", 0.12)
    return [solid(casing, body), solid(goods, pane), solid(paint((50, 50, 54), rng), panel)]


def basin(style: Style, rng: np.random.Generator) -> list[Part]:
    """Wash basin that hangs on the wall at its height; z = 0 is its lowest edge."""
    white = paint((240, 240, 237), rng)
    width, depth = rng.uniform(0.42, 0.62), rng.uniform(0.36, 0.48)
    outside, inside = [(0, 0), (0.25, 0.02), (0.46, 0.12), (0.5, 0.17)], [(0.35, 0.08), (0, 0.05)]
    outer = lathe([*outside, (0.45, 0.17), *inside], 20)
    bowl = shifted(outer * [width, depth, 1.0], 0, depth * 0.5 + 0.03, 0)
    ledge = boxes((-width * 0.45, 0, 0.06), (width * 0.45, 0.12, 0.17))
    tap = pipe(bend([(0, 0.08, 0.17), (0, 0.08, 0.3), (0, 0.2, 0.3), (0, 0.2, 0.26)], 0.05), 0.012)
    return [solid(white, bowl, ledge), solid(paint((190, 192, 194), rng, "metal"), tap)]


def toilet(style: Style, rng: np.random.Generator) -> list[Part]:
    """Toilet with its seat and cistern."""
    white = paint((241, 241, 239), rng)

    # the bowl, and the seat on it
    outside = [(0, 0), (0.28, 0), (0.25, 0.1), (0.3, 0.22), (0.5, 0.36), (0.5, 0.39)]
    bowl = lathe([*outside, (0.36, 0.39), (0.2, 0.25), (0, 0.22)], 18)
    pan = shifted(bowl * [0.38, 0.52, 1.0], 0, 0.44, 0)
    ring = lathe([(0.5, 0.39), (0.52, 0.41), (0.34, 0.415), (0.34, 0.39)], 18)
    seat = shifted(ring * [0.38, 0.5, 1.0], 0, 0.44, 0)

    # the cistern, and the lid up against it
    tank = cushion((-0.19, 0.0, 0.38), (0.19, 0.18, 0.78), 0.15, 0.15)
    flap = cushion((-0.18, -0.012, 0.0), (0.18, 0.012, 0.42), 0.4, 0.4)
    lid = shifted(tilted(flap, rng.uniform(0.05, 0.15)), 0, 0.23, 0.4)
    foot = boxes((-0.09, 0.02, 0), (0.09, 0.3, 0.38))
    plastic = paint((236, 236, 232), rng)
    return [solid(white, pan, foot), solid(white, tank), solid(plastic, seat, lid)]


def urinal(style: Style, rng: np.random.Generator) -> list[Part]:
    """Urinal that hangs on the wall."""
    outside, inside = [(0, 0), (0.1, 0.02), (0.17, 0.15), (0.16, 0.2)], [(0.12, 0.18), (0.02, 0.08)]
    body = lathe([*outside, *inside], 14)
    rear = cushion((-0.17, 0, 0.05), (0.17, 0.1, 0.62), 0.3, 0.2)
    return [solid(paint((241, 241, 239), rng), shifted(body, 0, 0.17, 0), rear)]


def stall_wall(style: Style, rng: np.random.Generator) -> list[Part]:
    """Partition beside a toilet, on feet, its back against the wall."""
    depth, top = rng.uniform(1.2, 1.45), rng.uniform(1.9, 2.0)
    panel = boxes((-0.015, 0, 0.15), (0.015, depth, top))
    foot = boxes([(-0.02, depth - 0.08, 0)], [(0.02, depth - 0.04, 0.15)])
    colour = ((214, 212, 204), (120, 140, 160), (150, 90, 60), (180, 196, 170))[rng.integers(4)]
    return [solid(paint(colour, rng), panel), solid(paint((170, 170, 172), rng, "metal"), foot)]


def towel_box(style: Style, rng: np.random.Generator) -> list[Part]:
    """Dispenser of paper towels or soap, or a hand dryer."""
    w, d, h = rng.uniform(0.06, 0.15), rng.uniform(0.1, 0.2), rng.uniform(0.2, 0.38)
    casing = paint((226, 226, 224) if rng.random() < 0.6 else (160, 162, 166), rng)
    return [solid(casing, cushion((-w, 0, 0), (w, d, h), 0.15, 0.2))]
