"""Bathrooms and halls, class clutter: showers, vanities, towels, shoes, coats, ironing, drying."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mcpseg_cli.synth.geometry.shapes import bend, boxes, cushion, lathe, pipe, rod, shell, solid
from mcpseg_cli.synth.geometry.solids import Part, shifted, tilted
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_metal, pick_wood
from mcpseg_cli.synth.things.boxes_and_bags import bright
from mcpseg_cli.synth.things.cabinet_parts import (
    body_parts,
    edges_of,
    front_parts,
    pick_finish,
    stack,
)


def shower(style: Style, rng: np.random.Generator) -> list[Part]:
    """Shower tray between glass panes or with a curtain, with its riser."""
    w, d, h = rng.uniform(0.75, 1.0) / 2, rng.uniform(0.75, 1.0), rng.uniform(1.85, 2.05)
    white, steel = paint((238, 238, 236), rng), paint((178, 180, 182), rng, "metal")
    tray = boxes((-w, 0, 0), (w, d, rng.uniform(0.03, 0.14)))
    bent = [(0, 0.03, 1.0), (0, 0.03, 1.95), (0, 0.3, 1.95), (0, 0.3, 1.9)]
    head = lathe([(0.0, 1.87), (0.09, 1.87), (0.09, 1.89), (0.0, 1.9)], 12, 0, 0.3)
    parts = [solid(white, tray), solid(steel, pipe(bend(bent, 0.08), 0.011)), solid(steel, head)]
    rail = boxes(
        [(-w, d - 0.02, h), (w - 0.02, 0, h)], [(w, d, h + 0.025), (w, d - 0.02, h + 0.025)]
    )
    parts.append(solid(steel, rail))
    if rng.random() < 0.4:
        cloth = paint(bright(rng), rng, ("plain", "stripes", "print")[rng.integers(3)], 0.2)
        x, z = np.meshgrid(
            np.linspace(-w, w * rng.uniform(-0.3, 0.9), 25), [0.16, 1.0, h], indexing="ij"
        )
        y = d - 0.01 + 0.018 * np.sin(x * rng.uniform(45, 70))
        return [*parts, solid(cloth, shell(np.stack([x, y, z], axis=-1), 0.004))]
    glass = paint((196, 208, 210), rng, "glass")
    panes = boxes((-w, d - 0.012, 0.15), (w * rng.uniform(0.0, 0.95), d - 0.006, h))
    side = boxes((w - 0.012, 0, 0.15), (w - 0.006, d - 0.03, h))
    return [*parts, solid(glass, panes), solid(glass, side)]


def vanity(style: Style, rng: np.random.Generator) -> list[Part]:
    """Basin on a cabinet with its tap."""
    width, depth, height = rng.uniform(0.45, 1.2), rng.uniform(0.38, 0.52), rng.uniform(0.76, 0.86)
    finish, low = pick_finish(style, rng), rng.choice([0.0, 0.08, 0.3])
    inset, w, white = depth - 0.03, width / 2, paint((240, 240, 238), rng)
    parts = body_parts(width - 0.02, inset, low, height, finish, hollow=False)
    if low:
        legs = boxes(
            [(-w + 0.05, 0, 0), (w - 0.09, 0, 0)], [(-w + 0.09, inset, low), (w - 0.05, inset, low)]
        )
        parts.append(solid(finish.body, legs))
    pairs = edges_of(width - 0.02, 0.45)
    cells = [c for a, b in pairwise(pairs) for c in stack(a, b, low, height, (1.0,))]
    parts += front_parts(cells, inset, finish, rng)
    rim = height + rng.uniform(0.04, 0.14)
    lows = [(-w, 0, height), (-w, depth - 0.03, height), (-w, 0.1, height), (w - 0.03, 0.1, height)]
    highs = [(w, 0.1, rim), (w, depth, rim), (-w + 0.03, depth - 0.03, rim), (w, depth - 0.03, rim)]
    bent = [(0, 0.05, rim), (0, 0.05, rim + 0.14), (0, 0.16, rim + 0.14), (0, 0.16, rim + 0.1)]
    steel = paint((182, 184, 186), rng, "metal")
    bowl = boxes((-w, 0.1, height), (w, depth, height + 0.012))
    return [
        *parts,
        solid(white, boxes(lows, highs), bowl),
        solid(steel, pipe(bend(bent, 0.05), 0.012)),
    ]


def mirror_cabinet(style: Style, rng: np.random.Generator) -> list[Part]:
    """Cabinet with mirrors for doors."""
    width, depth, height = rng.uniform(0.4, 1.0), rng.uniform(0.1, 0.17), rng.uniform(0.5, 0.75)
    body = paint((234, 234, 231), rng)
    edges = edges_of(width, 0.4)
    panes = boxes(
        [(x + 0.003, depth, 0.004) for x in edges[:-1]],
        [(x - 0.003, depth + 0.012, height - 0.004) for x in edges[1:]],
    )
    glass = paint((192, 202, 206), rng, "glass")
    return [solid(body, boxes((-width / 2, 0, 0), (width / 2, depth, height))), solid(glass, panes)]


def towel_rail(style: Style, rng: np.random.Generator) -> list[Part]:
    """Ladder of warm pipes with towels over it."""
    w, tall = rng.uniform(0.22, 0.32), rng.uniform(0.7, 1.5)
    colour = ((238, 238, 236), (190, 192, 194), (50, 50, 52))[rng.integers(3)]
    metal, rungs = paint(colour, rng, "metal"), np.arange(0.05, tall, rng.uniform(0.05, 0.09))
    posts = boxes([(-w, 0, 0), (w - 0.03, 0, 0)], [(-w + 0.03, 0.06, tall), (w, 0.06, tall)])
    bars = boxes(
        [(-w + 0.03, 0.03, z) for z in rungs], [(w - 0.03, 0.055, z + 0.02) for z in rungs]
    )
    parts = [solid(metal, posts), solid(metal, bars)]
    for level in rng.choice(rungs, int(rng.integers(1, 3)), replace=False):
        drop, a = min(rng.uniform(0.2, 0.6), float(level)), rng.uniform(0.1, w - 0.01)
        sheet = boxes((-a, 0.062, level - drop), (a, 0.08, level + 0.03))
        parts.append(solid(paint(bright(rng), rng, "weave", 0.03), sheet))
    return parts


def towel(style: Style, rng: np.random.Generator) -> list[Part]:
    """Towel or bathrobe that hangs from a hook in folds."""
    wide, drop = rng.uniform(0.15, 0.35), rng.uniform(0.5, 1.1)
    x, share = np.meshgrid(np.linspace(-1, 1, 15), np.linspace(0, 1, 6), indexing="ij")
    spread = wide * (0.25 + 0.75 * np.minimum(1, 2.5 * (1 - share)))
    y = 0.05 + 0.02 * np.sin(x * rng.uniform(6, 12) + rng.uniform(0, 6)) * (1 - 0.5 * share)
    grid = np.stack([x * spread / 2, y, share * drop], axis=-1)
    hook = boxes((-0.015, 0, drop - 0.02), (0.015, 0.06, drop + 0.03))
    cloth = paint(bright(rng), rng, "weave", 0.03)
    return [solid(cloth, shell(grid, 0.012)), solid(pick_metal(style, rng), hook)]


def shoes(style: Style, rng: np.random.Generator) -> list[Part]:
    """Pairs of shoes and boots side by side."""
    parts = []
    for number in range(int(rng.integers(2, 6))):
        colour, tall = (
            paint(bright(rng), rng),
            0.09 if rng.random() < 0.75 else rng.uniform(0.16, 0.4),
        )
        for side in (-1, 1):
            x, long = number * 0.24 + side * 0.05, rng.uniform(0.22, 0.3)
            sole = cushion((x - 0.045, 0, 0), (x + 0.045, long, 0.07), 0.5, 0.6)
            heel = cushion((x - 0.045, 0, 0), (x + 0.045, 0.13, tall), 0.5, 0.4)
            parts.append(solid(colour, sole, heel).moved(y=rng.uniform(0, 0.06)))
    return parts


def shoe_rack(style: Style, rng: np.random.Generator) -> list[Part]:
    """Open rack of two or three levels with shoes on it."""
    width, depth, count = rng.uniform(0.6, 1.1), 0.3, int(rng.integers(2, 4))
    frame = pick_wood(style, rng) if rng.random() < 0.5 else pick_metal(style, rng)
    w, tall = width / 2, 0.22 * count
    ends = boxes([(-w, 0, 0), (w - 0.02, 0, 0)], [(-w + 0.02, depth, tall), (w, depth, tall)])
    parts = [solid(frame, ends)]
    for level in range(count):
        z = 0.04 + 0.22 * level
        parts.append(solid(frame, boxes((-w + 0.02, 0, z), (w - 0.02, depth, z + 0.015))))
        spots = np.arange(-w + 0.08, w - 0.07, 0.11)
        for x in spots[rng.random(len(spots)) < 0.7]:
            shoe = cushion((x - 0.04, 0.02, z + 0.015), (x + 0.04, 0.28, z + 0.1), 0.5, 0.6)
            parts.append(solid(paint(bright(rng), rng), shoe))
    return parts


def coats(style: Style, rng: np.random.Generator) -> list[Part]:
    """Many coats side by side on a board with a shelf over them."""
    width, metal = rng.uniform(0.6, 1.6), pick_metal(style, rng)
    w, wood = width / 2, pick_wood(style, rng)
    board = boxes([(-w, 0, 1.0), (-w, 0, 1.24)], [(w, 0.018, 1.2), (w, 0.26, 1.262)])
    parts = [solid(wood, board[:12]), solid(wood, board[12:])]
    parts.append(solid(metal, boxes((-w, 0.018, 1.05), (w, 0.06, 1.07))))
    angle, down = np.meshgrid(np.linspace(0, 2 * np.pi, 13), np.linspace(0, 1, 6), indexing="ij")
    for a in np.arange(-w + 0.1, w - 0.08, rng.uniform(0.12, 0.2)):
        if rng.random() < 0.25:
            continue
        drop, fold = rng.uniform(0.6, 1.0), 1 + 0.15 * np.sin(4 * angle + rng.uniform(0, 6)) * down
        wide = (0.04 + 0.09 * np.minimum(1, 4 * down) + 0.05 * down) * fold
        y = 0.15 + 0.085 * np.sin(angle) * fold * np.minimum(1, 3 * down + 0.3)
        grid = np.stack([a + wide * np.cos(angle), y, 1.05 - drop * down], axis=-1)
        parts.append(solid(paint(bright(rng), rng, "weave", 0.03), shell(grid, 0.008)))
    for x in (-w * 0.5, w * 0.5):
        if rng.random() < 0.5:
            hat = boxes((x - 0.14, 0.02, 1.262), (x + 0.14, 0.24, 1.262 + rng.uniform(0.08, 0.25)))
            parts.append(solid(paint(bright(rng), rng), hat))
    return parts


def drying_rack(style: Style, rng: np.random.Generator) -> list[Part]:
    """Folding rack with washing on it."""
    w, d, tall = rng.uniform(0.5, 0.85), rng.uniform(0.25, 0.33), rng.uniform(0.85, 1.05)
    metal = paint((220, 222, 222), rng, "metal")
    lines = np.linspace(-d, d, 7)
    wires = boxes([(-w, y, tall) for y in lines], [(w, y + 0.008, tall + 0.008) for y in lines])
    legs = [pipe(np.array([(x, -d, 0), (x, d, tall)]), 0.009) for x in (-w, w)]
    legs += [pipe(np.array([(x, d, 0), (x, -d, tall)]), 0.009) for x in (-w, w)]
    parts = [solid(metal, wires), solid(metal, *legs)]
    for y in lines[rng.random(7) < 0.6]:
        a, b = np.sort(rng.uniform(-w, w, 2))
        if b - a > 0.15:
            drop = rng.uniform(0.2, 0.6)
            sheet = boxes((a, y - 0.006, tall - drop), (b, y + 0.014, tall + 0.012))
            parts.append(solid(paint(bright(rng), rng, "weave", 0.04), sheet))
    return parts


def ironing_board(style: Style, rng: np.random.Generator) -> list[Part]:
    """Ironing board on crossed legs."""
    cloth, tall = paint(bright(rng), rng, "print", 0.1), rng.uniform(0.8, 0.92)
    top = cushion((-0.65, -0.19, tall), (0.65, 0.19, tall + 0.04), 0.35, 0.2)
    legs = [
        pipe(np.array([(-x, y, 0), (x, y, tall + 0.01)]), 0.011)
        for x, y in ((0.4, -0.1), (-0.4, 0.1))
    ]
    feet = boxes([(-0.42, -0.2, 0), (0.38, -0.2, 0)], [(-0.38, 0.2, 0.02), (0.42, 0.2, 0.02)])
    return [solid(cloth, top), solid(pick_metal(style, rng), *legs, feet)]


def pouffe(style: Style, rng: np.random.Generator) -> list[Part]:
    """Pouffe or beanbag."""
    r, h = rng.uniform(0.2, 0.45), rng.uniform(0.3, 0.5)
    shape = cushion((-r, -r, 0), (r, r, h), 1.0, rng.uniform(0.3, 0.8))
    return [solid(paint(bright(rng), rng, "weave", 0.06), shape)]


def pushchair(style: Style, rng: np.random.Generator) -> list[Part]:
    """Pushchair: wheels, frame, seat and hood."""
    cloth, metal = paint(bright(rng), rng, "weave", 0.04), pick_metal(style, rng)
    wheels = [tilted(rod(0.11, -0.02, 0.02, 0, 0, 12), np.pi / 2) for _ in range(4)]
    spots = [(x, y) for x in (-0.24, 0.24) for y in (0.15, 0.75)]
    rims = []
    for wheel, (x, y) in zip(wheels, spots, strict=True):
        side = wheel[..., [1, 0, 2]]
        rims.append(shifted(side[:, ::-1], x, y, 0.11))
    bars = [
        pipe(bend([(x, 0.75, 0.14), (x, 0.35, 0.6), (x, 0.0, 1.0)], 0.1), 0.014)
        for x in (-0.22, 0.22)
    ]
    bars.append(boxes((-0.22, 0.0, 0.99), (0.22, 0.03, 1.02)))
    seat = cushion((-0.2, 0.2, 0.35), (0.2, 0.75, 0.5), 0.3, 0.4)
    back = shifted(
        tilted(cushion((-0.2, -0.04, 0), (0.2, 0.04, 0.5), 0.3, 0.3), -0.4), 0, 0.3, 0.42
    )
    roof = cushion((-0.22, 0.05, 0.8), (0.22, 0.5, 1.05), 0.5, 0.7)
    return [
        solid(paint((36, 36, 38), rng), *rims),
        solid(metal, *bars),
        solid(cloth, seat, back),
        solid(cloth, roof),
    ]
