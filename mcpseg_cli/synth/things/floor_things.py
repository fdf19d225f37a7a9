"""What stands about on floors: bins, lamps, coat stands, fans, ladders, bicycles, cushions, leaning boards."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import (
    Points,
    bend,
    boxes,
    cushion,
    lathe,
    pipe,
    rectangle,
    rod,
    shell,
    slanted,
    solid,
)
from mcpseg_cli.synth.geometry.solids import Part, Triangles, frustum, shifted, tilted, turned
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_fabric, pick_metal, pick_wood
from mcpseg_cli.synth.things.boxes_and_bags import bright
from mcpseg_cli.synth.things.desk_things import dark_or_light


def bin_(style: Style, rng: np.random.Generator) -> list[Part]:
    """Waste bin: round, square or with a lid, paper or a bag in it."""
    radius, height = rng.uniform(0.11, 0.2), rng.uniform(0.26, 0.6)
    material = dark_or_light(rng) if rng.random() < 0.6 else paint(bright(rng), rng)
    if rng.random() < 0.3:
        body = frustum(
            rectangle(radius * 1.6, radius * 1.3), rectangle(radius * 2, radius * 1.7), 0, height
        )
        lid = boxes(
            (-radius - 0.01, -radius * 0.85 - 0.01, height),
            (radius + 0.01, radius * 0.85 + 0.01, height + 0.06),
        )
        return [solid(material, body), solid(paint(bright(rng), rng), lid)]
    inner = lathe(
        [
            (radius, height),
            (radius - 0.006, height),
            (radius * 0.8, height * 0.6),
            (0, height * rng.uniform(0.5, 0.75)),
        ],
        14,
    )
    body = lathe([(0, 0), (radius * 0.78, 0), (radius, height)], 14)
    parts = [solid(material, body), solid(paint((230, 228, 224), rng), inner)]
    if rng.random() < 0.5:
        bag = lathe(
            [
                (radius + 0.006, height * 0.8),
                (radius + 0.01, height + 0.01),
                (radius - 0.01, height + 0.012),
            ],
            14,
        )
        parts.append(solid(paint(((225, 228, 232), (40, 40, 44))[rng.integers(2)], rng), bag))
    return parts


def floor_lamp(style: Style, rng: np.random.Generator) -> list[Part]:
    """Floor lamp: uplighter, shade or arc."""
    metal, height = pick_metal(style, rng), rng.uniform(1.4, 1.85)
    foot = lathe([(0, 0), (0.15, 0), (0.14, 0.02), (0.012, 0.035)], 16)
    shade_colour = paint((236, 228, 206), rng)
    if rng.random() < 0.3:
        top = bend(
            [(0, 0, 0.03), (0, 0, height), (0, 0.45, height), (0, 0.5, height - 0.3)], 0.4, 6
        )
        shade = shifted(lathe([(0.14, -0.1), (0.06, 0.04), (0, 0.05)], 14), 0, 0.5, height - 0.28)
        return [
            solid(metal, foot),
            solid(metal, pipe(top[:3], 0.012)),
            solid(metal, pipe(top[2:], 0.012)),
            solid(shade_colour, shade),
        ]
    wide = rng.uniform(0.12, 0.2)
    profile = (
        [(wide, height - 0.25), (wide * 0.7, height)]
        if rng.random() < 0.6
        else [(0.02, height - 0.12), (wide, height)]
    )
    return [
        solid(metal, foot, rod(0.012, 0.03, height - 0.1)),
        solid(shade_colour, lathe(profile, 16)),
    ]


def coat_stand(style: Style, rng: np.random.Generator) -> list[Part]:
    """Coat stand with coats and bags hung on it."""
    material, height = (
        pick_wood(style, rng) if rng.random() < 0.5 else pick_metal(style, rng),
        rng.uniform(1.65, 1.85),
    )
    angles = np.arange(4) * np.pi / 2 + 0.4
    feet = [
        pipe(
            bend(
                [
                    (0, 0, 0.25),
                    (0.12 * np.cos(a), 0.12 * np.sin(a), 0.18),
                    (0.26 * np.cos(a), 0.26 * np.sin(a), 0.015),
                ],
                0.1,
            ),
            0.014,
            5,
        )
        for a in angles
    ]
    hooks = [
        pipe([(0, 0, height - 0.15), (0.14 * np.cos(a), 0.14 * np.sin(a), height - 0.05)], 0.01, 5)
        for a in angles
    ]
    parts = [
        solid(material, *feet),
        solid(material, rod(0.02, 0.1, height)),
        solid(material, *hooks),
    ]
    return parts + [
        solid(
            paint(bright(rng), rng, "weave", 0.03),
            shifted(turned(_coat(rng), angle - np.pi / 2), z=height - 0.1),
        )
        for angle in angles[: int(rng.integers(0, 4))]
    ]


def _coat(rng: np.random.Generator) -> Triangles:
    """Make a hanging coat with folds, its neck at the origin, towards +y."""
    drop = rng.uniform(0.7, 1.1)
    angle, down = np.meshgrid(np.linspace(0, 2 * np.pi, 15), np.linspace(0, 1, 7), indexing="ij")
    width = 0.04 + 0.16 * np.minimum(1, down * 4) + 0.04 * down
    fold = 1 + 0.12 * np.sin(angle * 4 + rng.uniform(0, 6)) * down
    grid = np.stack(
        [
            width * np.cos(angle) * fold,
            0.13 + 0.1 * np.minimum(1, down * 3) * np.sin(angle) * fold,
            -drop * down,
        ],
        axis=-1,
    )
    return shell(grid, 0.01)


def fan(style: Style, rng: np.random.Generator) -> list[Part]:
    """Standing fan with its guard and blades."""
    height, radius, material = rng.uniform(0.9, 1.3), rng.uniform(0.18, 0.24), dark_or_light(rng)
    around = np.linspace(0, 2 * np.pi, 17)
    rings = [
        pipe(
            np.column_stack([r * np.cos(around), np.full(17, y), height + r * np.sin(around)]),
            0.005,
            4,
        )
        for r, y in (
            (radius, 0.0),
            (radius * 0.98, 0.06),
            (radius * 0.5, 0.09),
            (radius * 0.5, -0.03),
        )
    ]
    spokes = [
        pipe([(0, 0.1, height), (radius * np.cos(a), 0.03, height + radius * np.sin(a))], 0.003, 4)
        for a in around[::2]
    ]
    blades = [boxes((0.02, -0.004, -0.05), (radius * 0.85, 0.004, 0.05)) for _ in range(3)]
    turns = [
        np.array([[np.cos(a), 0, -np.sin(a)], [0, 1, 0], [np.sin(a), 0, np.cos(a)]])
        for a in (0.3, 2.4, 4.5)
    ]
    wings = [
        shifted(tilted(blade, 0.3) @ turn.T, 0, 0.03, height)
        for blade, turn in zip(blades, turns, strict=True)
    ]
    motor = shifted(tilted(rod(0.05, -0.03, 0.12, sides=10), np.pi / 2), 0, 0.02, height)
    foot = lathe([(0, 0), (0.2, 0), (0.19, 0.02), (0.02, 0.04)], 16)
    return [
        solid(material, *rings, *spokes, motor),
        solid(paint((150, 170, 190), rng), *wings),
        solid(material, foot),
        solid(material, rod(0.015, 0.03, height - 0.05)),
    ]


def ladder(style: Style, rng: np.random.Generator) -> list[Part]:
    """Step ladder, open."""
    height, spread, width = rng.uniform(1.1, 1.9), 0.32, 0.42
    metal = paint((190, 192, 194), rng, "metal")
    rails = [
        slanted((x, spread, 0), (x * 0.8, 0.03, height), (0.025, 0.06))
        for x in (-width / 2, width / 2)
    ]
    legs = slanted(
        [(-width / 2, -spread, 0), (width / 2, -spread, 0)],
        [(-width * 0.4, -0.03, height - 0.1), (width * 0.4, -0.03, height - 0.1)],
        (0.025, 0.03),
    )
    z = np.arange(0.25, height - 0.1, 0.26)
    y, x = spread * (1 - z / height), width / 2 * (1 - 0.2 * z / height)
    steps = boxes(np.column_stack([-x, y - 0.05, z]), np.column_stack([x, y + 0.06, z + 0.025]))
    top = boxes((-width * 0.42, -0.08, height), (width * 0.42, 0.1, height + 0.03))
    return [
        solid(metal, rails[0]),
        solid(metal, rails[1]),
        solid(metal, legs),
        solid(metal, steps, top),
    ]


def bicycle(style: Style, rng: np.random.Generator) -> list[Part]:
    """Bicycle that leans a little, along x, its back to y = 0."""
    radius, base = 0.33, 1.02
    around = np.linspace(0, 2 * np.pi, 21)
    ring = np.column_stack(
        [radius * np.cos(around), np.zeros(21), radius + radius * np.sin(around)]
    )
    spokes = [
        pipe([(0, 0, radius), (radius * np.cos(a), 0, radius + radius * np.sin(a))], 0.002, 3)
        for a in around[:-1:2]
    ]
    wheel = np.concatenate([pipe(ring, 0.02, 6), *spokes])
    crank, seat, head, rear, front = (
        (-0.08, 0, 0.28),
        (-0.22, 0, 0.8),
        (0.34, 0, 0.82),
        (-base / 2, 0, radius),
        (base / 2, 0, radius),
    )
    tubes = [(crank, seat), (crank, head), (seat, head), (rear, crank), (rear, seat), (head, front)]
    frame = np.concatenate([pipe([a, b], 0.016, 6) for a, b in tubes])
    bar = pipe(
        bend(
            [
                (0.2, -0.3, 0.98),
                (0.33, -0.2, 1.0),
                (0.32, 0, 0.95),
                (0.33, 0.2, 1.0),
                (0.2, 0.3, 0.98),
            ],
            0.08,
        ),
        0.012,
    )
    stem = pipe([(0.34, 0, 0.82), (0.32, 0, 0.96)], 0.014)
    saddle = cushion((-0.36, -0.07, 0.86), (-0.1, 0.07, 0.92), 0.6, 0.6)
    post = pipe([seat, (-0.23, 0, 0.88)], 0.012)
    pedals = boxes(
        [(-0.2, 0.06, 0.15), (-0.02, -0.14, 0.39)], [(-0.1, 0.14, 0.17), (0.06, -0.06, 0.41)]
    )
    rubber, colour = paint((36, 36, 38), rng), paint(bright(rng), rng)
    pieces = [
        (rubber, shifted(wheel, -base / 2)),
        (rubber, shifted(wheel, base / 2)),
        (colour, frame),
        (rubber, bar),
        (colour, stem),
        (rubber, np.concatenate([saddle, post])),
        (rubber, pedals),
    ]
    angle = rng.uniform(-0.03, 0.12)
    return [solid(material, tilted(shape, angle)) for material, shape in pieces]


def loose_cushion(style: Style, rng: np.random.Generator) -> list[Part]:
    """Floor cushion or beanbag."""
    across = rng.uniform(0.4, 0.8)
    profile: Points = (
        np.array(
            [
                (0.0, 0.0),
                (0.42, 0.0),
                (0.5, 0.12),
                (0.47, 0.3),
                (0.33, 0.5),
                (0.15, 0.62),
                (0.0, 0.64),
            ]
        )
        * across
    )
    body = lathe(profile, 16)
    body *= 1 + 0.04 * np.sin(body[..., 0:1] * 23) * np.cos(body[..., 1:2] * 19)
    return [solid(pick_fabric(style, rng), body)]


def side_slab(style: Style, rng: np.random.Generator) -> list[Part]:
    """Boards, rolls and panels that lean against a wall."""
    width, height = rng.uniform(0.4, 1.2), rng.uniform(0.6, 1.5)
    board = tilted(boxes((-width / 2, 0, 0), (width / 2, 0.025, height)), rng.uniform(0.1, 0.2))
    material = paint(
        ((178, 142, 98), (230, 228, 222), (120, 90, 60))[rng.integers(3)], rng, "cardboard", 0.2
    )
    return [solid(material, board)]
