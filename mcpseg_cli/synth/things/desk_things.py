"""What stands and lies on desks: screens, keyboards, laptops, lamps, telephones, printers."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import bend, boxes, cushion, lathe, pipe, rod, shell, solid
from mcpseg_cli.synth.geometry.solids import Part, Triangles, shifted, tilted, turned
from mcpseg_cli.synth.surfaces.materials import Colour, Material
from mcpseg_cli.synth.surfaces.styles import Style, paint
from mcpseg_cli.synth.things.boxes_and_bags import bright

_CASINGS: tuple[Colour, ...] = (
    *((32, 32, 35), (32, 32, 35), (80, 82, 86), (215, 214, 208), (178, 180, 184)),
)


def dark_or_light(rng: np.random.Generator) -> Material:
    """Pick the casing of a device: black, grey, white or silver."""
    return paint(_CASINGS[rng.integers(len(_CASINGS))], rng)


def screen_parts(
    width: float, casing: Material, rng: np.random.Generator, *, curve: float = 0.0
) -> list[Part]:
    """Make a flat or bent screen about y = 0, its lower edge at z = 0, facing +y."""
    height, rim = width * rng.uniform(0.55, 0.64), 0.008 / width
    along = np.linspace(-0.5, 0.5, 7 if curve else 2) * width
    x, z = np.meshgrid(along, np.linspace(0, 1, 2), indexing="ij")
    y = curve * (2 * x / width) ** 2

    # the panel, glass before it and a bulge behind
    body = shell(np.stack([x, y, z * height], axis=-1), 0.022)
    pane = np.stack([x * (1 - 2 * rim), y + 0.0115, 0.02 + z * (height - 0.03)], axis=-1)
    bulge = boxes((-width * 0.28, -0.045, height * 0.2), (width * 0.28, -0.01, height * 0.75))
    return [solid(casing, body, bulge), solid(_screen_face(rng, 0.35), shell(pane, 0.002))]


def _screen_face(rng: np.random.Generator, lit: float) -> Material:
    """Make the face of a screen: dark and glossy, or lit as often as ``lit``."""
    seed = int(rng.integers(1 << 30))
    if rng.random() < lit:
        desktop = ((70, 110, 165), (60, 120, 125), (90, 90, 130))[rng.integers(3)]
        return Material("screen", desktop, (228, 231, 235), 0.3, seed)
    return Material("screen", (24, 26, 30), (84, 90, 98), 0.3, seed)


def monitor(style: Style, rng: np.random.Generator) -> list[Part]:
    """Screen on a foot."""
    casing, lift = dark_or_light(rng), rng.uniform(0.07, 0.18)
    wide = rng.random() < 0.2
    width = rng.uniform(0.65, 0.85) if wide else rng.uniform(0.4, 0.62)
    screen = screen_parts(width, casing, rng, curve=rng.uniform(0.02, 0.05) if wide else 0.0)
    yaw = rng.normal(0, 0.08)
    parts = [part.moved(y=0.04, z=lift, yaw=yaw) for part in screen]

    # a disc or a plate, and the neck
    disc = lathe([(0, 0), (0.12, 0), (0.11, 0.012), (0, 0.018)], 14)
    foot = disc * [1.0, rng.uniform(0.7, 1.0), 1.0]
    if rng.random() < 0.5:
        foot = boxes((-0.13, -0.09, 0), (0.13, 0.09, 0.012))
    neck = boxes((-0.025, -0.045, 0.01), (0.025, -0.015, lift + width * 0.3))
    return [*parts, solid(casing, foot), solid(casing, neck)]


def monitor_pair(style: Style, rng: np.random.Generator) -> list[Part]:
    """Two screens side by side, on feet or on an arm."""
    casing, width = dark_or_light(rng), rng.uniform(0.48, 0.58)
    angle, lift, seed = rng.uniform(0.05, 0.35), rng.uniform(0.1, 0.2), int(rng.integers(1 << 30))
    has_feet, middle = bool(seed % 2), lift + 0.16
    parts: list[Part] = []

    # both screens are of one make
    for sign in (-1, 1):
        screen = screen_parts(width, casing, np.random.default_rng(seed))
        x, y = sign * (width / 2 * np.cos(angle) + 0.012), 0.5 * width * np.sin(angle)
        parts += [part.moved(x=x, y=y, z=lift, yaw=sign * angle) for part in screen]
        if has_feet:
            foot = boxes((x - 0.1, y - 0.1, 0), (x + 0.1, y + 0.06, 0.012))
            neck = boxes((x - 0.02, y - 0.07, 0.01), (x + 0.02, y - 0.045, middle))
            parts += [solid(casing, foot), solid(casing, neck)]
        else:
            path = [(0, -0.09, middle), (x * 0.5, -0.1, middle), (x, y - 0.04, middle)]
            parts.append(solid(casing, pipe(bend(path, 0.08), 0.016)))

    if not has_feet:
        post, plate = (
            rod(0.018, 0, lift + 0.22, 0, -0.09),
            ((-0.05, -0.13, 0), (0.05, -0.04, 0.015)),
        )
        parts.append(solid(casing, post, boxes(*plate)))
    return parts


def keyboard(style: Style, rng: np.random.Generator) -> list[Part]:
    """Keyboard and mouse, at times with a mat."""
    casing, half = dark_or_light(rng), rng.uniform(0.28, 0.46) / 2
    rows = np.linspace(-0.055, 0.045, 5)
    lows, highs = (
        [(-half + 0.008, y, 0.014) for y in rows],
        [(half - 0.008, y + 0.016, 0.021) for y in rows],
    )
    board = boxes((-half, -0.07, 0), (half, 0.07, 0.015))

    mouse, x = (
        cushion((-0.03, -0.05, 0.002), (0.03, 0.05, 0.035), 0.7, 0.8),
        half + rng.uniform(0.07, 0.16),
    )
    keys = solid(dark_or_light(rng), boxes(lows, highs))
    placed = shifted(turned(mouse, rng.normal(0, 0.3)), x, rng.normal(0, 0.02))
    parts = [solid(casing, board), keys, solid(casing, placed)]
    if rng.random() < 0.4:
        mat = boxes((x - 0.1, -0.1, 0), (x + 0.12, 0.1, 0.003))
        parts.append(solid(paint(bright(rng), rng), mat))
    return parts


def laptop(style: Style, rng: np.random.Generator) -> list[Part]:
    """Laptop, open at some angle, or shut."""
    casing, width = dark_or_light(rng), rng.uniform(0.3, 0.38)
    depth, half = width * 0.68, width / 2
    base = boxes((-half, 0, 0.002), (half, depth, 0.016))
    keys = boxes((-width * 0.44, depth * 0.12, 0.016), (width * 0.44, depth * 0.55, 0.0175))
    if rng.random() < 0.2:
        return [solid(casing, base, shifted(base, z=0.012))]

    # the lid with the screen in it
    angle = rng.uniform(0.05, 0.6)
    lid = tilted(boxes((-half, -0.006, 0), (half, 0.002, depth)), angle)
    glass = tilted(boxes((-half + 0.01, 0.002, 0.015), (half - 0.01, 0.003, depth - 0.01)), angle)
    parts = [solid(casing, base), solid(paint((40, 40, 42), rng), keys)]
    parts.append(solid(casing, shifted(lid, z=0.014)))
    return [*parts, solid(_screen_face(rng, 0.5), shifted(glass, z=0.014))]


def desk_lamp(style: Style, rng: np.random.Generator) -> list[Part]:
    """Lamp with a jointed arm, or a shade on a foot."""
    material = paint(bright(rng), rng) if rng.random() < 0.5 else dark_or_light(rng)
    if rng.random() < 0.35:
        height, wide = rng.uniform(0.3, 0.5), rng.uniform(0.1, 0.16)
        foot = [(0, 0), (wide * 0.6, 0), (wide * 0.55, 0.02), (0.012, 0.04)]
        body = lathe([*foot, (0.012, height - 0.1)], 12)
        shade = lathe([(wide, height - 0.18), (wide * 0.7, height)], 14)
        return [solid(material, body), solid(paint((235, 228, 205), rng), shade)]

    # two arms from the foot over the elbow to the head
    elbow = (rng.uniform(-0.12, -0.04), 0.0, rng.uniform(0.28, 0.42))
    head = (elbow[0] + rng.uniform(0.22, 0.36), 0.0, elbow[2] + rng.uniform(-0.08, 0.14))
    disc = lathe([(0, 0), (0.09, 0), (0.085, 0.018), (0, 0.025)], 14)
    lower, upper = pipe([(0, 0, 0.02), elbow], 0.008, 5), pipe([elbow, head], 0.007, 5)
    bell = lathe([(0.07, -0.09), (0.05, -0.03), (0.02, 0.01), (0, 0.012)], 10)
    cone = shifted(tilted(bell, rng.normal(0, 0.3)), *head)
    yaw = rng.uniform(0, 6.28)
    return [solid(material, part).moved(yaw=yaw) for part in (disc, lower, upper, cone)]


def telephone(style: Style, rng: np.random.Generator) -> list[Part]:
    """Desk telephone with its receiver and cord."""
    casing = dark_or_light(rng)
    body = boxes((-0.1, -0.1, 0), (0.1, 0.1, 0.03))
    body[..., 2] *= 1.6 - 5 * body[..., 1] * (body[..., 2] > 0.01)
    receiver = cushion((-0.1, -0.095, 0.05), (-0.045, 0.1, 0.09), 0.3, 0.5)
    receiver[..., 2] += 0.02 * np.abs(receiver[..., 1]) / 0.1

    # keys on its slope
    spots = [(x, y) for x in (0.0, 0.03, 0.06) for y in (-0.05, -0.01, 0.03)]
    keys = boxes(
        [(x, y, 0.045 - 0.1 * y) for x, y in spots],
        [(x + 0.02, y + 0.02, 0.052 - 0.1 * y) for x, y in spots],
    )
    steps = np.linspace(0, 1, 9)
    x, y = -0.1 - 0.05 * np.sin(np.pi * steps), -0.08 + 0.16 * steps
    cord = pipe(np.column_stack([x, y, np.full(9, 0.008)]), 0.006, 4)
    handle, white = dark_or_light(rng), paint((200, 200, 198), rng)
    return [solid(casing, body, cord), solid(handle, receiver), solid(white, keys)]


def printer(style: Style, rng: np.random.Generator) -> list[Part]:
    """Desk printer with trays and paper."""
    casing, width, depth = dark_or_light(rng), rng.uniform(0.36, 0.48), rng.uniform(0.32, 0.42)
    height, w, d = rng.uniform(0.18, 0.34), width / 2, depth / 2
    body = boxes(
        [(-w, -d, 0), (-w + 0.02, -d + 0.02, height * 0.75)],
        [(w, d, height * 0.75), (w - 0.02, d - 0.05, height)],
    )

    # paper comes in from above and out at the front
    mouth = boxes((-w + 0.05, d, height * 0.32), (w - 0.05, d + 0.09, height * 0.36))
    paper = boxes((-0.1, d - 0.05, height * 0.36), (0.1, d + 0.08, height * 0.4))
    tray = tilted(boxes((-0.11, 0, 0), (0.11, 0.004, 0.2)), 0.4)
    feed = shifted(tray, 0, -d + 0.08, height * 0.97)
    white, dark = paint((238, 238, 235), rng, "paper", 0.2), paint((60, 60, 64), rng)
    return [solid(casing, body, mouth), solid(white, paper), solid(dark, feed)]


def pc_tower(style: Style, rng: np.random.Generator) -> list[Part]:
    """Computer case with its drive bays."""
    casing, height, depth = dark_or_light(rng), rng.uniform(0.34, 0.48), rng.uniform(0.38, 0.48)
    width = rng.uniform(0.1, 0.21)
    half, wide = width / 2, width * 0.42
    body = boxes((-half, 0, 0.01), (half, depth, height))
    places = (0.03, depth - 0.06)
    feet = boxes([(-half, y, 0) for y in places], [(half, y + 0.03, 0.01) for y in places])

    levels = [z * height for z in (0.66, 0.78, 0.9)]
    highs = [(wide, depth + 0.006, z + 0.04) for z in levels]
    bays = boxes([(-wide, depth, z) for z in levels], highs)
    return [solid(casing, body, feet), solid(paint((60, 62, 66), rng), bays)]


def cables(style: Style, rng: np.random.Generator) -> list[Part]:
    """Tangle of cables on the floor, with a socket strip."""
    parts = [solid(paint((225, 225, 222), rng), boxes((-0.16, 0.0, 0), (0.16, 0.055, 0.045)))]
    for _ in range(int(rng.integers(2, 5))):
        # from the strip to anywhere, swinging in between
        steps = np.linspace(0, 1, 12)[:, None]
        end = rng.uniform([-0.5, 0.1], [0.5, 0.45])
        swing = np.cumsum(rng.normal(0, 0.035, (12, 2)), axis=0) * np.sin(np.pi * steps)
        plug = np.array([rng.uniform(-0.12, 0.12), 0.05])
        path = np.column_stack([plug * (1 - steps) + end * steps + swing, np.full(12, 0.007)])
        path[:, 1] = np.maximum(path[:, 1], 0.01)
        parts.append(solid(dark_or_light(rng), pipe(path, 0.006, 4)))
    return parts


def loudspeaker(style: Style, rng: np.random.Generator) -> list[Part]:
    """Small loudspeaker."""
    w, d, h = rng.uniform(0.09, 0.2), rng.uniform(0.1, 0.22), rng.uniform(0.16, 0.34)
    cones = []
    for radius, z in ((w * 0.4, h * 0.35), (w * 0.2, h * 0.78)):
        rim = [(0, -0.004), (radius, -0.004), (radius, 0.006)]
        cone = lathe([*rim, (radius * 0.3, 0.001), (0, 0.003)], 12)
        cones.append(shifted(tilted(cone, -np.pi / 2), 0, d, z))
    body = solid(dark_or_light(rng), boxes((-w / 2, 0, 0), (w / 2, d, h)))
    return [body, solid(paint((28, 28, 30), rng), *cones)]


def pen_pot(style: Style, rng: np.random.Generator) -> list[Part]:
    """Pot of pens."""
    pot = lathe([(0, 0), (0.036, 0), (0.038, 0.1), (0.033, 0.1), (0.032, 0.005), (0, 0.005)], 10)
    parts: list[Triangles] = []
    for _ in range(int(rng.integers(3, 8))):
        angle, out = rng.uniform(0, 6.28), rng.uniform(0.02, 0.05)
        tip = (out * np.cos(angle), out * np.sin(angle), rng.uniform(0.13, 0.17))
        parts.append(pipe([(-0.2 * tip[0], -0.2 * tip[1], 0.01), tip], 0.004, 4))
    return [solid(dark_or_light(rng), pot), solid(paint(bright(rng), rng), *parts)]


def projector(style: Style, rng: np.random.Generator) -> list[Part]:
    """Video projector that stands on its feet."""
    casing = dark_or_light(rng)
    body = cushion((-0.17, -0.13, 0.01), (0.17, 0.13, 0.12), 0.12, 0.2)
    lens = shifted(tilted(rod(0.035, 0, 0.04, sides=10), -np.pi / 2), 0.08, 0.12, 0.065)
    spots = [(x, y) for x in (-0.13, 0.1) for y in (-0.09, 0.06)]
    feet = boxes([(x, y, 0) for x, y in spots], [(x + 0.03, y + 0.03, 0.02) for x, y in spots])
    return [solid(casing, body, feet), solid(paint((40, 40, 48), rng), lens)]
