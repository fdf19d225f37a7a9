"""What hangs on walls and ceilings: pictures, clocks, coat hooks, mirrors, projectors."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import bend, boxes, lathe, pipe, rod, shell, solid
from mcpseg_cli.synth.geometry.solids import Part, tilted
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_metal, pick_wood
from mcpseg_cli.synth.things.boxes_and_bags import bright
from mcpseg_cli.synth.things.desk_things import dark_or_light, projector, screen_parts


def picture(style: Style, rng: np.random.Generator) -> list[Part]:
    """Framed picture, poster, calendar or notice."""
    width, height = rng.uniform(0.2, 1.2), rng.uniform(0.25, 0.9)
    face = paint(bright(rng), rng, "print", rng.uniform(0.1, 0.4))
    w = width / 2
    if rng.random() < 0.4:
        return [solid(face, boxes((-w, 0, 0), (w, 0.004, height)))]

    # below, above, left and right
    wide, thick = rng.uniform(0.012, 0.05), rng.uniform(0.012, 0.035)
    top, inner = height - wide, w - wide
    rim = boxes(
        [(-w, 0, 0), (-w, 0, top), (-w, 0, wide), (inner, 0, wide)],
        [(w, thick, wide), (w, thick, height), (-inner, thick, top), (w, thick, top)],
    )
    frame = pick_wood(style, rng) if rng.random() < 0.5 else dark_or_light(rng)
    sheet = boxes((-inner, 0, wide), (inner, thick * 0.5, top))
    return [solid(frame, rim), solid(face, sheet)]


def clock(style: Style, rng: np.random.Generator) -> list[Part]:
    """Wall clock."""
    radius, parts = rng.uniform(0.11, 0.19), []
    edge = [(0, 0), (radius, 0), (radius, 0.04)]
    rim = [(radius * 0.92, 0.045), (radius * 0.9, 0.03), (0, 0.03)]
    body = tilted(lathe([*edge, *rim], 20), -np.pi / 2)
    for size in (0.5, 0.75):
        hand = boxes((-0.005, -0.01, 0.032), (0.005, radius * size, 0.035))
        parts.append(tilted(hand, -np.pi / 2))
    return [solid(dark_or_light(rng), body), solid(paint((20, 20, 22), rng), *parts)]


def wall_tv(style: Style, rng: np.random.Generator) -> list[Part]:
    """Television on a wall bracket."""
    casing, width = paint((30, 30, 33), rng), rng.uniform(0.8, 1.7)
    out = rng.uniform(0.05, 0.12)
    parts = [part.moved(y=out + 0.03) for part in screen_parts(width, casing, rng)]
    return [*parts, solid(casing, boxes((-0.2, 0, width * 0.18), (0.2, out, width * 0.42)))]


def coat_hooks(style: Style, rng: np.random.Generator) -> list[Part]:
    """Rail of hooks with coats on it."""
    width, metal = rng.uniform(0.4, 1.2), pick_metal(style, rng)
    rail = boxes((-width / 2, 0, 1.0), (width / 2, 0.02, 1.08))
    places = np.linspace(-width / 2 + 0.06, width / 2 - 0.06, max(int(width / 0.18), 2))
    bent = [bend([(a, 0.02, 1.03), (a, 0.07, 1.02), (a, 0.07, 1.06)], 0.02) for a in places]
    hooks = [pipe(path, 0.006, 5) for path in bent]
    parts = [solid(pick_wood(style, rng), rail), solid(metal, *hooks)]

    # coats hang in folds, from the shoulders down
    angle, down = np.meshgrid(np.linspace(0, 2 * np.pi, 13), np.linspace(0, 1, 6), indexing="ij")
    for a in places[rng.random(len(places)) < 0.5]:
        drop, fold = rng.uniform(0.6, 1.0), 1 + 0.15 * np.sin(4 * angle + rng.uniform(0, 6)) * down
        wide = (0.03 + 0.1 * np.minimum(1, 4 * down) + 0.03 * down) * fold
        x = a + wide * np.cos(angle)
        y = 0.09 + 0.055 * np.sin(angle) * fold * np.minimum(1, 3 * down + 0.3)
        grid = np.stack([x, y, 1.05 - drop * down], axis=-1)
        parts.append(solid(paint(bright(rng), rng, "weave", 0.03), shell(grid, 0.008)))
    return parts


def wall_box(style: Style, rng: np.random.Generator) -> list[Part]:
    """Fuse box, thermostat, post box or first-aid cabinet."""
    w, d, h = rng.uniform(0.06, 0.25), rng.uniform(0.03, 0.15), rng.uniform(0.12, 0.6)
    body = boxes((-w, 0, 0), (w, d, h))
    door = boxes((-w + 0.01, d, 0.01), (w - 0.01, d + 0.008, h - 0.01))
    knob = rod(0.01, h * 0.45, h * 0.55, w * 0.8, d + 0.015, 6)
    return [solid(dark_or_light(rng), body), solid(dark_or_light(rng), door, knob)]


def cable_run(style: Style, rng: np.random.Generator) -> list[Part]:
    """Cable duct up a wall with a socket."""
    height, x = rng.uniform(0.8, 2.0), rng.uniform(-0.3, 0.3)
    duct = boxes(
        [(-0.02, 0, 0), (min(x, -0.02), 0, height - 0.04)],
        [(0.02, 0.025, height), (max(x, 0.02), 0.025, height)],
    )
    socket = boxes((x - 0.04, 0, height - 0.06), (x + 0.04, 0.03, height + 0.02))
    return [solid(paint((228, 227, 222), rng), duct, socket)]


def mirror(style: Style, rng: np.random.Generator) -> list[Part]:
    """Mirror."""
    w, h = rng.uniform(0.4, 1.0) / 2, rng.uniform(0.5, 1.0)
    face = boxes((-w, 0.006, 0), (w, 0.012, h))
    rear = boxes((-w * 0.9, 0, 0.02), (w * 0.9, 0.006, h - 0.02))
    glass, metal = paint((196, 206, 210), rng, "glass"), paint((160, 160, 162), rng, "metal")
    return [solid(glass, face), solid(metal, rear)]


def ceiling_projector(style: Style, rng: np.random.Generator) -> list[Part]:
    """Projector on a rod that hangs from the ceiling; its top is the highest point."""
    drop = rng.uniform(0.2, 0.6)
    rod_ = rod(0.02, 0.1, 0.1 + drop)
    plate = boxes((-0.08, -0.08, 0.09 + drop), (0.08, 0.08, 0.1 + drop))
    return [*projector(style, rng), solid(paint((210, 210, 208), rng, "metal"), rod_, plate)]
