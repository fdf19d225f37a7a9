"""What stands about on floors: bins, lamps, coat stands, fans, ladders, bicycles, cushions."""

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

    # square with a lid
    if rng.random() < 0.3:
        foot, rim = rectangle(radius * 1.6, radius * 1.3), rectangle(radius * 2, radius * 1.7)
        a, b = radius + 0.01, radius * 0.85 + 0.01
        lid = boxes((-a, -b, height), (a, b, height + 0.06))
        body = frustum(foot, rim, 0, height)
        return [solid(material, body), solid(paint(bright(rng), rng), lid)]

    # round and open, with paper in it
    edge, level = [(radius, height), (radius - 0.006, height)], height * rng.uniform(0.5, 0.75)
    inner = lathe([*edge, (radius * 0.8, height * 0.6), (0, level)], 14)
    body = lathe([(0, 0), (radius * 0.78, 0), (radius, height)], 14)
    parts = [solid(material, body), solid(paint((230, 228, 224), rng), inner)]
    if rng.random() < 0.5:
        over = [(radius + 0.006, height * 0.8), (radius + 0.01, height + 0.01)]
        bag = lathe([*over, (radius - 0.01, height + 0.012)], 14)
        parts.append(solid(paint(((225, 228, 232), (40, 40, 44))[rng.integers(2)], rng), bag))
    return parts


def floor_lamp(style: Style, rng: np.random.Generator) -> list[Part]:
    """Floor lamp: uplighter, shade or arc."""
    metal, height = pick_metal(style, rng), rng.uniform(1.4, 1.85)
    foot = lathe([(0, 0), (0.15, 0), (0.14, 0.02), (0.012, 0.035)], 16)
    cloth = paint((236, 228, 206), rng)

    # an arc with a bell at its end
    if rng.random() < 0.3:
        corners = [(0, 0, 0.03), (0, 0, height), (0, 0.45, height), (0, 0.5, height - 0.3)]
        arc = bend(corners, 0.4, 6)
        bell = shifted(lathe([(0.14, -0.1), (0.06, 0.04), (0, 0.05)], 14), 0, 0.5, height - 0.28)
        metals = [foot, pipe(arc[:3], 0.012), pipe(arc[2:], 0.012)]
        return [*(solid(metal, piece) for piece in metals), solid(cloth, bell)]

    wide = rng.uniform(0.12, 0.2)
    if rng.random() < 0.6:
        profile = [(wide, height - 0.25), (wide * 0.7, height)]
    else:
        profile = [(0.02, height - 0.12), (wide, height)]
    post = rod(0.012, 0.03, height - 0.1)
    return [solid(metal, foot, post), solid(cloth, lathe(profile, 16))]


def coat_stand(style: Style, rng: np.random.Generator) -> list[Part]:
    """Coat stand with coats and bags hung on it."""
    material = pick_wood(style, rng) if rng.random() < 0.5 else pick_metal(style, rng)
    height, feet, hooks = rng.uniform(1.65, 1.85), [], []
    angles = np.arange(4) * np.pi / 2 + 0.4
    for a in angles:
        x, y = np.cos(a), np.sin(a)
        leg = bend([(0, 0, 0.25), (0.12 * x, 0.12 * y, 0.18), (0.26 * x, 0.26 * y, 0.015)], 0.1)
        feet.append(pipe(leg, 0.014, 5))
        hooks.append(pipe([(0, 0, height - 0.15), (0.14 * x, 0.14 * y, height - 0.05)], 0.01, 5))
    parts = [solid(material, *feet), solid(material, rod(0.02, 0.1, height))]
    parts.append(solid(material, *hooks))

    # a coat on some hooks
    for angle in angles[: int(rng.integers(0, 4))]:
        cloth = paint(bright(rng), rng, "weave", 0.03)
        coat = shifted(turned(_coat(rng), angle - np.pi / 2), z=height - 0.1)
        parts.append(solid(cloth, coat))
    return parts


def _coat(rng: np.random.Generator) -> Triangles:
    """Make a hanging coat with folds, its neck at the origin, towards +y."""
    drop = rng.uniform(0.7, 1.1)
    angle, down = np.meshgrid(np.linspace(0, 2 * np.pi, 15), np.linspace(0, 1, 7), indexing="ij")
    width = 0.04 + 0.16 * np.minimum(1, down * 4) + 0.04 * down
    fold = 1 + 0.12 * np.sin(angle * 4 + rng.uniform(0, 6)) * down
    x = width * np.cos(angle) * fold
    y = 0.13 + 0.1 * np.minimum(1, down * 3) * np.sin(angle) * fold
    return shell(np.stack([x, y, -drop * down], axis=-1), 0.01)


def fan(style: Style, rng: np.random.Generator) -> list[Part]:
    """Standing fan with its guard and blades."""
    height, radius, material = rng.uniform(0.9, 1.3), rng.uniform(0.18, 0.24), dark_or_light(rng)
    around = np.linspace(0, 2 * np.pi, 17)
    cosine, sine, wires = np.cos(around), np.sin(around), []

    # the guard: rings, and spokes to the largest of them
    half = radius * 0.5
    for r, y in ((radius, 0.0), (radius * 0.98, 0.06), (half, 0.09), (half, -0.03)):
        ring = np.column_stack([r * cosine, np.full(17, y), height + r * sine])
        wires.append(pipe(ring, 0.005, 4))
    for a in around[::2]:
        end = (radius * np.cos(a), 0.03, height + radius * np.sin(a))
        wires.append(pipe([(0, 0.1, height), end], 0.003, 4))

    # blades
    blade, wings = boxes((0.02, -0.004, -0.05), (radius * 0.85, 0.004, 0.05)), []
    for a in (0.3, 2.4, 4.5):
        turn = np.array([[np.cos(a), 0, -np.sin(a)], [0, 1, 0], [np.sin(a), 0, np.cos(a)]])
        wings.append(shifted(tilted(blade, 0.3) @ turn.T, 0, 0.03, height))

    motor = shifted(tilted(rod(0.05, -0.03, 0.12, sides=10), np.pi / 2), 0, 0.02, height)
    foot = lathe([(0, 0), (0.2, 0), (0.19, 0.02), (0.02, 0.04)], 16)
    parts = [solid(material, *wires, motor), solid(paint((150, 170, 190), rng), *wings)]
    return [*parts, solid(material, foot), solid(material, rod(0.015, 0.03, height - 0.05))]


def ladder(style: Style, rng: np.random.Generator) -> list[Part]:
    """Step ladder, open."""
    height, spread, width = rng.uniform(1.1, 1.9), 0.32, 0.42
    metal = paint((190, 192, 194), rng, "metal")
    half, parts = width / 2, []

    # rails before, legs behind
    for x in (-half, half):
        rail = slanted((x, spread, 0), (x * 0.8, 0.03, height), (0.025, 0.06))
        parts.append(solid(metal, rail))
    feet = [(x, -spread, 0) for x in (-half, half)]
    tops = [(x, -0.03, height - 0.1) for x in (-width * 0.4, width * 0.4)]
    parts.append(solid(metal, slanted(feet, tops, (0.025, 0.03))))

    # steps get narrower towards the top
    z = np.arange(0.25, height - 0.1, 0.26)
    out, wide = spread * (1 - z / height), half * (1 - 0.2 * z / height)
    low = np.column_stack([-wide, out - 0.05, z])
    steps = boxes(low, np.column_stack([wide, out + 0.06, z + 0.025]))
    top = boxes((-width * 0.42, -0.08, height), (width * 0.42, 0.1, height + 0.03))
    return [*parts, solid(metal, steps, top)]


def bicycle(style: Style, rng: np.random.Generator) -> list[Part]:
    """Bicycle that leans a little, along x, its back to y = 0."""
    radius, base = 0.33, 1.02
    wheel = _wheel(radius)

    # the frame
    crank, seat, head = (-0.08, 0, 0.28), (-0.22, 0, 0.8), (0.34, 0, 0.82)
    rear, front = (-base / 2, 0, radius), (base / 2, 0, radius)
    tubes = [(crank, seat), (crank, head), (seat, head), (rear, crank), (rear, seat), (head, front)]
    frame = np.concatenate([pipe([a, b], 0.016, 6) for a, b in tubes])

    # handlebar, saddle and pedals
    left, right = [(0.2, -0.3, 0.98), (0.33, -0.2, 1.0)], [(0.33, 0.2, 1.0), (0.2, 0.3, 0.98)]
    bar = pipe(bend([*left, (0.32, 0, 0.95), *right], 0.08), 0.012)
    stem = pipe([head, (0.32, 0, 0.96)], 0.014)
    saddle = cushion((-0.36, -0.07, 0.86), (-0.1, 0.07, 0.92), 0.6, 0.6)
    post = pipe([seat, (-0.23, 0, 0.88)], 0.012)
    lows, highs = [(-0.2, 0.06, 0.15), (-0.02, -0.14, 0.39)], [(-0.1, 0.14, 0.17)]
    pedals = boxes(lows, [*highs, (0.06, -0.06, 0.41)])

    rubber, colour = paint((36, 36, 38), rng), paint(bright(rng), rng)
    pieces = [(rubber, shifted(wheel, -base / 2)), (rubber, shifted(wheel, base / 2))]
    pieces += [(colour, frame), (rubber, bar), (colour, stem)]
    pieces += [(rubber, np.concatenate([saddle, post])), (rubber, pedals)]
    angle = rng.uniform(-0.03, 0.12)
    return [solid(material, tilted(shape, angle)) for material, shape in pieces]


def _wheel(radius: float) -> Triangles:
    """Return a wheel with its spokes that stands on the origin, along x."""
    around = np.linspace(0, 2 * np.pi, 21)
    x, z = radius * np.cos(around), radius + radius * np.sin(around)
    tyre = pipe(np.column_stack([x, np.zeros(21), z]), 0.02, 6)
    rims = list(zip(x[:-1:2], z[:-1:2], strict=True))
    spokes = [pipe([(0, 0, radius), (a, 0, b)], 0.002, 3) for a, b in rims]
    return np.concatenate([tyre, *spokes])


def loose_cushion(style: Style, rng: np.random.Generator) -> list[Part]:
    """Floor cushion or beanbag."""
    across = rng.uniform(0.4, 0.8)
    below, above = [(0.0, 0.0), (0.42, 0.0), (0.5, 0.12), (0.47, 0.3)], [(0.33, 0.5), (0.15, 0.62)]
    profile: Points = np.array([*below, *above, (0.0, 0.64)]) * across
    body = lathe(profile, 16)
    body *= 1 + 0.04 * np.sin(body[..., 0:1] * 23) * np.cos(body[..., 1:2] * 19)
    return [solid(pick_fabric(style, rng), body)]


def side_slab(style: Style, rng: np.random.Generator) -> list[Part]:
    """Boards, rolls and panels that lean against a wall."""
    width, height = rng.uniform(0.4, 1.2), rng.uniform(0.6, 1.5)
    board = tilted(boxes((-width / 2, 0, 0), (width / 2, 0.025, height)), rng.uniform(0.1, 0.2))
    colour = ((178, 142, 98), (230, 228, 222), (120, 90, 60))[rng.integers(3)]
    return [solid(paint(colour, rng, "cardboard", 0.2), board)]
