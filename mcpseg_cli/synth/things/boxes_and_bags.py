"""Cardboard boxes, bags, mugs, bottles and other loose things."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import bend, boxes, cushion, lathe, pipe, rod, slanted, solid
from mcpseg_cli.synth.geometry.solids import Part, ball, quad, shifted, tilted, turned
from mcpseg_cli.synth.surfaces.materials import Colour
from mcpseg_cli.synth.surfaces.styles import Style, paint
from mcpseg_cli.synth.things.books import book_stack

_BRIGHT: tuple[Colour, ...] = (
    *((180, 50, 45), (40, 80, 150), (60, 120, 70), (220, 180, 60), (40, 40, 44), (230, 230, 228)),
    *((120, 120, 124), (150, 80, 130)),
)


def bright(rng: np.random.Generator) -> Colour:
    """Return a colour of consumer goods."""
    return _BRIGHT[rng.integers(len(_BRIGHT))]


def carton_parts(
    rng: np.random.Generator, most: tuple[float, float, float] = (0.6, 0.45, 0.5)
) -> list[Part]:
    """Make a cardboard or plastic box about the origin on z = 0, at most so large."""
    width, depth, height = (rng.uniform(0.45, 1.0, 3) * most).tolist()
    w, d = width / 2, depth / 2
    if rng.random() < 0.75:
        base: Colour = (178, 142, 98) if rng.random() < 0.8 else (225, 222, 214)
        material = paint(base, rng, "cardboard", rng.uniform(0.1, 0.3))
    else:
        material = paint(bright(rng), rng)

    # shut, with tape over it
    if rng.random() < 0.65 or min(width, depth) < 0.15:
        tape = boxes((-w, -0.025, height), (w, 0.025, height + 0.001))
        body = boxes((-w, -d, 0), (w, d, height))
        return [solid(material, body), solid(paint((196, 170, 120), rng), tape)]

    # or open: bottom, walls and two flaps up
    rim, thin = height * rng.uniform(0.7, 0.85), 0.006
    walls = boxes(
        [(-w, -d, 0), (-w, -d, 0), (w - thin, -d, 0), (-w, -d, 0), (-w, d - thin, 0)],
        [(w, d, thin), (-w + thin, d, rim), (w, d, rim), (w, -d + thin, rim), (w, d, rim)],
    )
    flap = min(depth * 0.45, 0.12, height - rim)
    _, out = rng.uniform(0.0, 0.05, 2).tolist()
    near = quad((-w, -d, rim), (width, 0, 0), (0, 0, flap))
    far = quad((-w, d, rim), (width, 0, 0), (0, -out, flap))
    full = rim * rng.uniform(0.3, 0.85)
    inside = boxes((-w + 0.02, -d + 0.02, 0.006), (w - 0.02, d - 0.02, full))
    content = paint(bright(rng), rng, "print", 0.1)
    return [solid(material, walls, near, far), solid(content, inside)]


def carton(style: Style, rng: np.random.Generator) -> list[Part]:
    """Cardboard box."""
    return [part.moved(yaw=rng.normal(0, 0.2)) for part in carton_parts(rng)]


def small_carton(style: Style, rng: np.random.Generator) -> list[Part]:
    """Box of a size that fits on a cupboard, or two on each other."""
    size = (rng.uniform(0.2, 0.5), rng.uniform(0.2, 0.32), rng.uniform(0.15, 0.34))
    parts = carton_parts(rng, size)
    if rng.random() < 0.3:
        top = max(float(part.high[2]) for part in parts)
        cardboard = paint((180, 146, 104), rng, "cardboard", 0.2)
        upper = solid(cardboard, boxes((-0.1, -0.09, 0), (0.1, 0.09, 0.12)))
        parts = [upper.moved(z=top), *parts] if len(parts[0].triangles) == 12 else parts
    return parts


def carton_pile(style: Style, rng: np.random.Generator) -> list[Part]:
    """Boxes on top of each other."""
    level, parts, size = 0.0, [], np.array([0.6, 0.45, 0.45])
    for _ in range(int(rng.integers(2, 5))):
        # smaller than the one below
        low = size * rng.uniform(0.7, 1.0, 3)
        colour = (178, 142, 98) if rng.random() < 0.7 else (222, 220, 214)
        material = paint(colour, rng, "cardboard", 0.2)
        w, d, h = low[0] / 2, low[1] / 2, low[2]
        body = boxes((-w, -d, 0), (w, d, h))
        tape = boxes((-w - 0.001, -0.025, h * 0.8), (w + 0.001, 0.025, h + 0.001))

        # a little off and turned
        shift, angle = rng.normal(0, 0.02, 2), rng.normal(0, 0.06)
        layer = (solid(material, body), solid(paint((200, 175, 125), rng), tape))
        parts += [part.moved(float(shift[0]), float(shift[1]), level, angle) for part in layer]
        level += float(h)
        size = np.minimum(size, low * [1.0, 1.0, 1.2])
    return parts


def mug(style: Style, rng: np.random.Generator) -> list[Part]:
    """Mug with a handle."""
    radius, height = rng.uniform(0.033, 0.045), rng.uniform(0.08, 0.115)
    outside = [(0, 0), (radius * 0.85, 0), (radius, 0.02), (radius, height)]
    inside = [(radius - 0.005, height), (radius - 0.006, 0.01), (0, 0.01)]
    body = lathe([*outside, *inside], 12)

    top, out = height * 0.8, radius + 0.03
    ear = [(radius, 0, top), (out, 0, top), (out, 0, 0.02), (radius, 0, 0.02)]
    handle = pipe(bend(ear, 0.02), 0.005, 5)
    return [solid(paint(bright(rng), rng), body, turned(handle, rng.uniform(0, 6)))]


def bottle(style: Style, rng: np.random.Generator) -> list[Part]:
    """Bottle."""
    radius, height = rng.uniform(0.03, 0.045), rng.uniform(0.2, 0.33)
    neck = height * rng.uniform(0.6, 0.75)
    body, top = [(0, 0), (radius, 0.004), (radius, neck)], [(0.014, height), (0, height)]
    shape = lathe([*body, (0.014, neck + 0.07), *top], 10)
    colour = ((40, 90, 60), (120, 160, 190), (70, 40, 25), (220, 225, 228))[rng.integers(4)]
    return [solid(paint(colour, rng), shape)]


def vase(style: Style, rng: np.random.Generator) -> list[Part]:
    """Vase, tin or bowl."""
    height = rng.uniform(0.08, 0.3)
    z, wide = np.linspace(0, height, 8), rng.uniform(0.04, 0.07)
    belly = rng.uniform(-0.35, 0.5) * np.sin(np.pi * z / height * rng.uniform(0.6, 1.4))
    radius = np.concatenate([[0], wide * (1 + belly), [0]])
    profile = np.column_stack([radius, np.concatenate([[0], z, [height * 0.9]])])
    return [solid(paint(bright(rng), rng), lathe(profile, 14))]


def figure(style: Style, rng: np.random.Generator) -> list[Part]:
    """Small figure, toy or trophy of balls and blocks."""
    size = rng.uniform(0.05, 0.12)
    material = paint(bright(rng), rng)
    shapes = [
        ball((size * 0.5, size * 0.45, size * 0.6), (0, 0, size * 0.6), 5),
        ball((size * 0.35,) * 3, (0, 0, size * 1.4), 5),
    ]
    feet = boxes((-size * 0.5, -size * 0.4, 0), (size * 0.5, size * 0.5, size * 0.15))
    return [solid(material, *shapes), solid(paint(bright(rng), rng), feet)]


def small_parts(style: Style, rng: np.random.Generator) -> list[Part]:
    """Make something small for a shelf, about the origin on z = 0."""
    maker = (mug, bottle, vase, figure, tray)[rng.integers(5)]
    return maker(style, rng)


def tray(style: Style, rng: np.random.Generator) -> list[Part]:
    """Letter trays on top of each other, with paper in them."""
    material, white = paint(bright(rng), rng), paint((236, 235, 230), rng, "paper", 0.2)
    levels = [row * 0.065 for row in range(int(rng.integers(1, 4)))]

    # bottom, two sides and a rear of each
    lows, highs = [], []
    for z in levels:
        top = z + 0.06
        lows += [(-0.12, -0.16, z), (-0.12, -0.16, z), (0.116, -0.16, z), (-0.12, -0.16, z)]
        highs += [(0.12, 0.16, z + 0.004), (-0.116, 0.16, top)]
        highs += [(0.12, 0.16, top), (0.12, -0.156, top)]

    sheets = [(z + 0.004, rng.uniform(0.005, 0.05)) for z in levels]
    tops = [(0.105, 0.15, z + high) for z, high in sheets]
    paper = boxes([(-0.105, -0.15, z) for z, _ in sheets], tops)
    return [solid(material, boxes(lows, highs)), solid(white, paper)]


def paper_stack(style: Style, rng: np.random.Generator) -> list[Part]:
    """Sheets and folders lying about on each other."""
    level, parts = 0.0, []
    for _ in range(int(rng.integers(1, 4))):
        thick = rng.uniform(0.003, 0.03)
        if rng.random() < 0.7:
            material = paint((238, 237, 232), rng, "paper", 0.2)
        else:
            material = paint(bright(rng), rng, "plain", 0.2)

        # askew on the sheets below
        sheet = turned(boxes((-0.105, -0.1485, 0), (0.105, 0.1485, thick)), rng.normal(0, 0.25))
        x, y = rng.normal(0, 0.02), rng.normal(0, 0.02)
        parts.append(solid(material, shifted(sheet, x, y, level)))
        level += thick
    return parts


def books_lying(style: Style, rng: np.random.Generator) -> list[Part]:
    """A few books on each other."""
    return book_stack(rng, int(rng.integers(1, 6)))


def backpack(style: Style, rng: np.random.Generator) -> list[Part]:
    """Backpack that leans against something, with a pocket and straps."""
    material, dark = paint(bright(rng), rng, "weave", 0.03), paint((40, 40, 44), rng)
    body = cushion((-0.16, -0.1, 0), (0.16, 0.1, 0.46), 0.4, 0.4)
    body[..., 0] += 0.012 * np.sin(body[..., 2] * 14)
    pocket = cushion((-0.12, 0.05, 0.03), (0.12, 0.16, 0.24), 0.4, 0.4)

    # two straps behind, a handle on top
    paths = [[(x, -0.1, 0.42), (x * 1.4, -0.14, 0.25), (x, -0.1, 0.06)] for x in (-0.08, 0.08)]
    straps = [pipe(bend(path, 0.1), 0.014, 4) for path in paths]
    loop = bend([(-0.04, -0.03, 0.44), (0, -0.03, 0.5), (0.04, -0.03, 0.44)], 0.04)
    straps.append(pipe(loop, 0.008, 4))
    angle = rng.uniform(0.0, 0.25)
    leaning = tilted(np.concatenate([body, pocket]), angle)
    return [solid(material, leaning), solid(dark, tilted(np.concatenate(straps), angle))]


def bag(style: Style, rng: np.random.Generator) -> list[Part]:
    """Handbag, shopping or sports bag, slumped."""
    width, height = rng.uniform(0.3, 0.55), rng.uniform(0.22, 0.36)
    body = cushion((-width / 2, -0.09, 0), (width / 2, 0.09, height), 0.4, 0.5)
    body[..., 1] *= 1.2 - 0.9 * body[..., 2:3].squeeze(-1) / height
    body[..., 2] *= 1 + 0.08 * np.sin(body[..., 0] * 20)

    # two handles
    x, z, loops = width / 4, height * 0.9, []
    for y in (-0.02, 0.02):
        path = bend([(-x, y, z), (0, y * 2, height + 0.16), (x, y, z)], 0.1)
        loops.append(pipe(path, 0.008, 4))
    material = paint(bright(rng), rng, "leather" if rng.random() < 0.4 else "weave", 0.03)
    return [solid(material, body, *loops)]


def suitcase(style: Style, rng: np.random.Generator) -> list[Part]:
    """Trolley case with its handle up or down."""
    width, height, depth = rng.uniform(0.34, 0.48), rng.uniform(0.5, 0.72), rng.uniform(0.2, 0.28)
    material, metal = paint(bright(rng), rng), paint((160, 160, 162), rng, "metal")
    half = width / 2

    # a shell with ribs
    body = cushion((-half, 0, 0.04), (half, depth, height), 0.2, 0.2)
    places = np.linspace(-0.35, 0.3, 5) * width
    tops = [(x + 0.015, depth + 0.006, height - 0.06) for x in places]
    ribs = boxes([(x, depth - 0.004, 0.1) for x in places], tops)

    # wheels and handle
    wheel = tilted(rod(0.025, -0.015, 0.015, sides=8), np.pi / 2)
    spots = [(x * (half - 0.05), y) for x in (-1, 1) for y in (0.05, depth - 0.05)]
    wheels = [shifted(wheel, x, y, 0.025) for x, y in spots]
    low, up = height - 0.05, height + rng.choice([0.03, 0.3, 0.4])
    path = [(-0.09, 0.03, low), (-0.09, 0.03, up), (0.09, 0.03, up), (0.09, 0.03, low)]
    handle = solid(metal, pipe(bend(path, 0.03), 0.009, 5))
    return [solid(material, body, ribs), handle, solid(paint((40, 40, 42), rng), *wheels)]


def umbrella_stand(style: Style, rng: np.random.Generator) -> list[Part]:
    """Umbrellas in a stand."""
    stand = lathe([(0, 0), (0.1, 0), (0.115, 0.5), (0.105, 0.5), (0.09, 0.02), (0, 0.02)], 14)
    parts = [solid(paint((90, 90, 94), rng, "metal"), stand)]
    for _ in range(int(rng.integers(1, 5))):
        foot, tip = rng.normal(0, 0.02, 2), np.clip(rng.normal(0, 0.05, 2), -0.09, 0.09)
        rolled = slanted((*foot, 0.03), (*tip, rng.uniform(0.7, 0.85)), (0.04, 0.04))
        parts.append(solid(paint(bright(rng), rng), rolled))
    return parts
