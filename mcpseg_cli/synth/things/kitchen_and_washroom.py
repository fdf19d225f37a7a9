"""Pantry and washroom: counters, fridges, coolers, machines, basins, toilets, stalls."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import bend, boxes, cushion, lathe, pipe, rod, solid
from mcpseg_cli.synth.geometry.solids import Part, shifted, tilted
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_plastic, pick_table_top, pick_wood
from mcpseg_cli.synth.things.boxes_and_bags import bright
from mcpseg_cli.synth.things.desk_things import dark_or_light


def counter(style: Style, rng: np.random.Generator) -> list[Part]:
    """Kitchen counter with doors, a sink and a tap."""
    return counter_parts(rng.uniform(1.2, 2.8), style, rng)


def counter_parts(width: float, style: Style, rng: np.random.Generator) -> list[Part]:
    """Make a counter of a width."""
    face = pick_wood(style, rng) if rng.random() < 0.5 else pick_plastic(style, rng)
    depth, height, w = rng.uniform(0.58, 0.65), rng.uniform(0.86, 0.94), width / 2
    edges = np.linspace(-w, w, max(int(width / 0.55), 2) + 1)
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
    x = rng.uniform(-w + 0.35, w - 0.35)
    steel = paint((190, 192, 194), rng, "metal")
    top = boxes(
        [
            (-w, 0, height - 0.035),
            (x + 0.22, 0, height - 0.035),
            (x - 0.22, 0, height - 0.035),
            (x - 0.22, depth - 0.12, height - 0.035),
        ],
        [
            (x - 0.22, depth, height),
            (w, depth, height),
            (x + 0.22, 0.12, height),
            (x + 0.22, depth, height),
        ],
    )
    bowl = boxes([(x - 0.22, 0.12, height - 0.034)], [(x + 0.22, depth - 0.12, height - 0.03)])
    tap = pipe(
        bend(
            [
                (x, 0.07, height),
                (x, 0.07, height + 0.26),
                (x, 0.24, height + 0.26),
                (x, 0.24, height + 0.18),
            ],
            0.1,
        ),
        0.012,
    )
    return [
        solid(pick_table_top(style, rng), top),
        solid(face, body, doors),
        solid(steel, pulls),
        solid(steel, bowl),
        solid(steel, tap),
    ]


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
    w, d, h = (
        rng.uniform(0.5, 0.7) / 2,
        rng.uniform(0.55, 0.68),
        rng.uniform(1.5, 1.9) if tall else rng.uniform(0.8, 0.9),
    )
    material = paint(((238, 238, 236), (182, 184, 186), (60, 62, 66))[rng.integers(3)], rng)
    cut = h * rng.uniform(0.6, 0.72) if tall else h - 0.01
    fronts = boxes(
        [(-w, d, 0.06), (-w, d, cut + 0.006)][: 1 + tall],
        [(w, d + 0.05, cut), (w, d + 0.05, h)][: 1 + tall],
    )
    pulls = boxes(
        [(w - 0.06, d + 0.05, cut - 0.35), (w - 0.06, d + 0.05, cut + 0.05)][: 1 + tall],
        [(w - 0.035, d + 0.085, cut - 0.05), (w - 0.035, d + 0.085, min(cut + 0.3, h - 0.02))][
            : 1 + tall
        ],
    )
    return [
        solid(material, boxes((-w, 0, 0), (w, d, h)), fronts),
        solid(paint((170, 172, 174), rng, "metal"), pulls),
    ]


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
    body = boxes(
        [(-w, 0, 0), (-w, 0, h * 0.6), (-w, 0, 0)], [(w, d * 0.55, h), (w, d, h), (w, d, 0.05)]
    )
    spout = rod(0.02, h * 0.5, h * 0.61, 0, d * 0.8, 8)
    cup = lathe([(0, 0.05), (0.03, 0.05), (0.04, 0.13), (0.03, 0.12), (0, 0.07)], 10, 0, d * 0.8)
    return [
        solid(dark_or_light(rng), body),
        solid(paint((150, 150, 152), rng, "metal"), spout),
        solid(paint((236, 235, 230), rng), cup),
    ]


def water_cooler(style: Style, rng: np.random.Generator) -> list[Part]:
    """Water cooler with its bottle."""
    w, d, h = 0.16, 0.34, rng.uniform(0.9, 1.05)
    body = boxes(
        [(-w, 0, 0), (-w, 0, h * 0.55), (-w, d * 0.8, 0), (-w, 0, h * 0.85)],
        [(w, d * 0.8, h), (w, d * 0.82, h * 0.85), (w, d, h * 0.6), (w, d, h)],
    )
    bottle = lathe(
        [
            (0.04, h),
            (0.05, h + 0.04),
            (0.13, h + 0.1),
            (0.13, h + 0.2),
            (0.122, h + 0.22),
            (0.13, h + 0.24),
            (0.13, h + 0.37),
            (0, h + 0.38),
        ],
        14,
    )
    taps = boxes(
        [(x - 0.015, d * 0.8, h * 0.74) for x in (-0.06, 0.06)],
        [(x + 0.015, d * 0.95, h * 0.78) for x in (-0.06, 0.06)],
    )
    return [
        solid(paint((228, 228, 226), rng), body),
        solid(paint((130, 170, 205), rng, "glass"), shifted(bottle, 0, d / 2, 0)),
        solid(paint((60, 90, 170), rng), taps),
    ]


def vending_machine(style: Style, rng: np.random.Generator) -> list[Part]:
    """Vending machine with a window of goods."""
    w, d, h = rng.uniform(0.7, 1.0) / 2, rng.uniform(0.65, 0.85), rng.uniform(1.75, 1.9)
    body = boxes([(-w, 0, 0.04), (-w + 0.03, 0.03, 0)], [(w, d, h), (w - 0.03, d - 0.05, 0.04)])
    pane = boxes((-w + 0.06, d, 0.55), (w * 0.45, d + 0.01, h - 0.12))
    panel = boxes(
        [(w * 0.55, d, 0.7), (-w + 0.06, d, 0.2)],
        [(w - 0.04, d + 0.02, 1.5), (w * 0.45, d + 0.03, 0.42)],
    )
    return [
        solid(paint(bright(rng), rng), body),
        solid(paint((120, 110, 90), rng, "print", 0.12), pane),
        solid(paint((50, 50, 54), rng), panel),
    ]


def basin(style: Style, rng: np.random.Generator) -> list[Part]:
    """Wash basin that hangs on the wall at its height; z = 0 is its lowest edge."""
    white = paint((240, 240, 237), rng)
    width, depth = rng.uniform(0.42, 0.62), rng.uniform(0.36, 0.48)
    outer = lathe(
        [(0, 0), (0.25, 0.02), (0.46, 0.12), (0.5, 0.17), (0.45, 0.17), (0.35, 0.08), (0, 0.05)], 20
    )
    bowl = shifted(outer * [width, depth, 1.0], 0, depth * 0.5 + 0.03, 0)
    ledge = boxes((-width * 0.45, 0, 0.06), (width * 0.45, 0.12, 0.17))
    tap = pipe(bend([(0, 0.08, 0.17), (0, 0.08, 0.3), (0, 0.2, 0.3), (0, 0.2, 0.26)], 0.05), 0.012)
    return [solid(white, bowl, ledge), solid(paint((190, 192, 194), rng, "metal"), tap)]


def toilet(style: Style, rng: np.random.Generator) -> list[Part]:
    """Toilet with its seat and cistern."""
    white = paint((241, 241, 239), rng)
    bowl = lathe(
        [
            (0, 0),
            (0.28, 0),
            (0.25, 0.1),
            (0.3, 0.22),
            (0.5, 0.36),
            (0.5, 0.39),
            (0.36, 0.39),
            (0.2, 0.25),
            (0, 0.22),
        ],
        18,
    )
    pan = shifted(bowl * [0.38, 0.52, 1.0], 0, 0.44, 0)
    seat = shifted(
        lathe([(0.5, 0.39), (0.52, 0.41), (0.34, 0.415), (0.34, 0.39)], 18) * [0.38, 0.5, 1.0],
        0,
        0.44,
        0,
    )
    tank = cushion((-0.19, 0.0, 0.38), (0.19, 0.18, 0.78), 0.15, 0.15)
    lid = shifted(
        tilted(
            cushion((-0.18, -0.012, 0.0), (0.18, 0.012, 0.42), 0.4, 0.4), rng.uniform(0.05, 0.15)
        ),
        0,
        0.23,
        0.4,
    )
    return [
        solid(white, pan, boxes((-0.09, 0.02, 0), (0.09, 0.3, 0.38))),
        solid(white, tank),
        solid(paint((236, 236, 232), rng), seat, lid),
    ]


def urinal(style: Style, rng: np.random.Generator) -> list[Part]:
    """Urinal that hangs on the wall."""
    body = lathe(
        [(0, 0), (0.1, 0.02), (0.17, 0.15), (0.16, 0.2), (0.12, 0.18), (0.02, 0.08)], 14
    ) * [1.0, 1.0, 1.0]
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
    return [
        solid(
            paint((226, 226, 224) if rng.random() < 0.6 else (160, 162, 166), rng),
            cushion((-w, 0, 0), (w, d, h), 0.15, 0.2),
        )
    ]
