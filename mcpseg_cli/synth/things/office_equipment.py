"""Office equipment on the floor: cabinets, lockers, copiers, trolleys, partitions, screens."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import bend, boxes, pipe, rod, solid
from mcpseg_cli.synth.geometry.solids import Part, shifted, tilted
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_fabric, pick_metal
from mcpseg_cli.synth.things.desk_things import screen_parts


def filing_cabinet(style: Style, rng: np.random.Generator) -> list[Part]:
    """Metal filing cabinet."""
    width, depth = rng.uniform(0.4, 0.5), rng.uniform(0.45, 0.62)
    return _cabinet(width, depth, int(rng.integers(2, 5)), 0.33, rng)


def drawer_unit(style: Style, rng: np.random.Generator) -> list[Part]:
    """Low drawers on castors."""
    return _cabinet(rng.uniform(0.38, 0.44), rng.uniform(0.48, 0.58), 3, 0.18, rng)


def _cabinet(
    width: float, depth: float, rows: int, step: float, rng: np.random.Generator
) -> list[Part]:
    """Make a body with drawer fronts and handles."""
    metal = paint((150, 152, 156) if rng.random() < 0.5 else (215, 214, 208), rng, "metal")
    height, w = rows * step + 0.06, width / 2
    edges = 0.05 + step * np.arange(rows)
    pulled = np.where(rng.random(rows) < 0.08, rng.uniform(0.05, 0.2), 0.018)
    lows, highs = [(-w, 0, 0.03), (-w + 0.02, 0.03, 0)], [(w, depth, height)]
    body = boxes(lows, [*highs, (w - 0.02, depth - 0.04, 0.03)])

    # fronts of drawers, some of them pulled out, with their handles
    one, front = np.ones(rows), depth + pulled
    low = np.column_stack([one * (-w + 0.006), one * (depth - 0.001), edges + 0.004])
    faces = boxes(low, np.column_stack([one * (w - 0.006), front, edges + step - 0.004]))
    grip = np.column_stack([one * -0.06, front, edges + step - 0.07])
    pulls = boxes(grip, np.column_stack([one * 0.06, front + 0.02, edges + step - 0.05]))
    return [solid(metal, body, faces), solid(paint((120, 120, 124), rng, "metal"), pulls)]


def lockers(style: Style, rng: np.random.Generator) -> list[Part]:
    """Row of tall lockers with slits and locks."""
    count, depth, height = int(rng.integers(2, 6)), rng.uniform(0.35, 0.5), rng.uniform(1.6, 1.95)
    wide, rows = rng.uniform(0.28, 0.36), int(rng.integers(1, 4))
    body = boxes((0, 0, 0), (count * wide, depth, height))

    # doors side by side and over each other
    tall = (height - 0.08) / rows
    across, up = np.arange(count) * wide, 0.06 + np.arange(rows) * (height - 0.08) / rows
    x, z = (grid.ravel() for grid in np.meshgrid(across, up))
    front = np.full(len(x), depth)
    low = np.column_stack([x + 0.006, front, z + 0.006])
    faces = boxes(low, np.column_stack([x + wide - 0.006, front + 0.014, z + tall - 0.006]))
    left = np.column_stack([x + wide * 0.3, front + 0.014, z + tall - 0.09])
    slits = boxes(left, np.column_stack([x + wide * 0.7, front + 0.018, z + tall - 0.05]))

    colour = ((170, 174, 178), (90, 110, 140), (200, 196, 184), (120, 60, 54))[rng.integers(4)]
    shade = paint(colour, rng, "metal")
    grey, dark = paint((150, 152, 156), rng, "metal"), paint((60, 60, 64), rng)
    return [solid(grey, body), solid(shade, faces), solid(dark, slits)]


def copier(style: Style, rng: np.random.Generator) -> list[Part]:
    """Copier with paper drawers, scanner lid, panel and output tray."""
    light, dark = paint((222, 220, 214), rng), paint((70, 72, 78), rng)
    w, d, h = rng.uniform(0.52, 0.66) / 2, rng.uniform(0.56, 0.68), rng.uniform(0.9, 1.15)

    # a gap between body and scanner
    body = boxes(
        [(-w, 0, 0.03), (-w, 0, h * 0.82), (-w + 0.02, 0.05, 0)],
        [(w, d, h * 0.72), (w, d - 0.04, h), (w - 0.02, d - 0.06, 0.03)],
    )
    rear = boxes((-w, 0, h * 0.72), (w, d * 0.4, h * 0.82))
    levels = (0.06, 0.22, 0.38)
    highs = [(w - 0.02, d + 0.012, z + 0.14) for z in levels]
    drawers = boxes([(-w + 0.02, d, z) for z in levels], highs)

    panel = shifted(tilted(boxes((-0.22, 0, 0), (0.2, 0.16, 0.03)), -0.35), 0, d - 0.04, h - 0.02)
    lid = boxes((-w + 0.03, 0.02, h), (w - 0.03, d - 0.1, h + rng.uniform(0.03, 0.14)))
    side = boxes((-w - 0.25, 0.12, h * 0.5), (-w, d - 0.15, h * 0.52))
    return [solid(light, body, rear, lid), solid(dark, drawers, panel), solid(dark, side)]


def trolley(style: Style, rng: np.random.Generator) -> list[Part]:
    """Trolley with two or three shelves, or a hand truck's platform, loaded."""
    metal, w, d = pick_metal(style, rng), rng.uniform(0.6, 0.9) / 2, rng.uniform(0.4, 0.55)
    h = rng.uniform(0.8, 1.0)

    # shelves between four posts
    levels = np.linspace(0.14, h - 0.12, int(rng.integers(2, 4)))
    parts = [solid(metal, boxes((-w, 0, z), (w, d, z + 0.03))) for z in levels]
    spots = [(x, y) for x in (-w, w - 0.025) for y in (0, d - 0.025)]
    parts += [solid(metal, boxes((x, y, 0.1), (x + 0.025, y + 0.025, h))) for x, y in spots]
    wheel = tilted(rod(0.05, -0.015, 0.015, sides=9), np.pi / 2)
    corners = [(x, y) for x in (-w + 0.06, w - 0.06) for y in (0.06, d - 0.06)]
    wheels = [shifted(wheel, x, y, 0.05) for x, y in corners]

    # a handle, and what lies on it
    low, high = h - 0.05, h + 0.06
    near, far = [(w - 0.02, 0.02, low), (w + 0.12, 0.02, high)], (w + 0.12, d - 0.02, high)
    handle = pipe(bend([*near, far, (w - 0.02, d - 0.02, low)], 0.06), 0.012)
    end = (w * rng.uniform(-0.2, 0.6), d - 0.06, 0.17 + rng.uniform(0.1, 0.3))
    load = boxes((-w * 0.7, 0.06, 0.17), end)
    rubber, cardboard = paint((40, 40, 42), rng), paint((180, 144, 100), rng, "cardboard", 0.2)
    return [*parts, solid(rubber, *wheels), solid(metal, handle), solid(cardboard, load)]


def partition(style: Style, rng: np.random.Generator) -> list[Part]:
    """Screen of an open-plan office on feet, upholstered."""
    return partition_parts(rng.uniform(0.8, 1.8), rng.uniform(1.2, 1.7), style, rng)


def partition_parts(
    width: float, height: float, style: Style, rng: np.random.Generator
) -> list[Part]:
    """Make a partition of a size, x centred, 4 cm thick."""
    fabric, metal = pick_fabric(style, rng), pick_metal(style, rng)
    w, low = width / 2, rng.choice([0.03, 0.12])

    # the panel in its rim
    lows = [(-w, 0.0, low), (-w, 0.0, height - 0.02), (-w, 0.0, low), (w - 0.02, 0.0, low)]
    highs = [(w, 0.045, low + 0.02), (w, 0.045, height), (-w + 0.02, 0.045, height)]
    rim = boxes(lows, [*highs, (w, 0.045, height)])
    panel = boxes((-w + 0.02, 0.004, low + 0.02), (w - 0.02, 0.041, height - 0.02))

    ends = (-w + 0.12, w - 0.12)
    feet = boxes([(x - 0.03, -0.12, 0) for x in ends], [(x + 0.03, 0.165, 0.02) for x in ends])
    posts = boxes([(x - 0.015, 0.01, 0.02) for x in ends], [(x + 0.015, 0.035, low) for x in ends])
    return [solid(fabric, panel), solid(metal, rim, posts), solid(metal, feet)]


def tv_stand(style: Style, rng: np.random.Generator) -> list[Part]:
    """Television on a rolling stand."""
    casing = paint((34, 34, 37), rng)
    width, lift = rng.uniform(1.0, 1.5), rng.uniform(0.95, 1.2)
    screen = [part.moved(y=0.06, z=lift) for part in screen_parts(width, casing, rng)]

    # two posts on a foot with wheels
    ends, top = (-0.15, 0.15), lift + 0.4
    posts = boxes([(x - 0.02, -0.03, 0.06) for x in ends], [(x + 0.02, 0.01, top) for x in ends])
    foot = boxes(
        [(-0.4, -0.3, 0.03), (-0.4, -0.3, 0.03), (0.34, -0.3, 0.03)],
        [(0.4, -0.24, 0.07), (-0.34, 0.35, 0.07), (0.4, 0.35, 0.07)],
    )
    wheels = [rod(0.03, 0, 0.05, x, y, 8) for x in (-0.37, 0.37) for y in (-0.27, 0.32)]
    shelf = boxes((-0.22, -0.02, 0.7), (0.22, 0.25, 0.72))
    beam = boxes((-0.4, -0.03, 0.05), (0.4, 0.01, 0.08))
    stand = [solid(casing, posts), solid(casing, foot, *wheels)]
    return [*screen, *stand, solid(casing, shelf), solid(casing, beam)]
