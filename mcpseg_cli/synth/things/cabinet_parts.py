"""What cabinets are made of: finishes, bodies, doors, drawers, handles, feet, worktops."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from mcpseg_cli.synth.geometry.shapes import boxes, rod, solid
from mcpseg_cli.synth.geometry.solids import Part, tilted
from mcpseg_cli.synth.surfaces.materials import Colour, Material, Pattern
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_colour, pick_metal, pick_wood
from mcpseg_cli.synth.things.boxes_and_bags import bright

Handle = Literal["bar", "knob", "rail", "lip", "none"]
Cell = tuple[float, float, float, float]
"""Lowest x and z, highest x and z of one front, metres."""

_WHITES: tuple[Colour, ...] = ((236, 236, 232), (228, 224, 214), (242, 242, 240), (216, 214, 208))
_PAINTS: tuple[Colour, ...] = (
    *((72, 76, 82), (150, 152, 152), (196, 190, 178), (110, 126, 112), (60, 76, 98)),
    *((202, 176, 140), (128, 44, 42), (40, 42, 44), (176, 196, 200), (214, 190, 120)),
)
_HANDLES: tuple[Handle, ...] = ("bar", "bar", "knob", "knob", "rail", "lip", "none", "none")
FRONT = 0.018
"""How thick doors and drawer fronts are, metres."""


@dataclass(frozen=True)
class Finish:
    """How a cabinet looks.

    Attributes:
        body: Material of sides and top.
        front: Material of doors and drawers.
        pull: Material of handles.
        handle: Their form.
        gap: Between two fronts, metres.
        framed: Whether fronts have a raised frame.
    """

    body: Material
    front: Material
    pull: Material
    handle: Handle
    gap: float
    framed: bool


def pick_finish(style: Style, rng: np.random.Generator, wall: Material | None = None) -> Finish:
    """Draw a finish: white, wood, a paint, or the paint of the wall behind.

    Args:
        style: The building's.
        rng: Random numbers.
        wall: Surface of the walls; None where it is not known.
    """
    draw, front = rng.random(), paint(_WHITES[rng.integers(len(_WHITES))], rng)
    if wall is not None and wall.pattern in ("plain", "plaster") and draw < 0.35:
        front = paint(wall.base, rng)
    elif draw > 0.62:
        front = pick_wood(style, rng)
    elif draw > 0.5:
        front = paint(pick_colour((*_PAINTS, *style.accents), rng), rng)

    # the body is mostly alike
    other = pick_wood(style, rng) if rng.random() < 0.5 else paint(_WHITES[0], rng)
    body = other if rng.random() < 0.2 else replace(front, seed=front.seed + 1)
    dark = paint((44, 44, 46), rng)
    pull = pick_metal(style, rng) if rng.random() < 0.7 else (dark, front)[rng.integers(2)]
    handle = _HANDLES[rng.integers(len(_HANDLES))]
    return Finish(body, front, pull, handle, rng.uniform(0.002, 0.006), bool(rng.random() < 0.3))


def pick_stone(style: Style, rng: np.random.Generator) -> Material:
    """Draw a worktop: wood, stone or laminate."""
    if rng.random() < 0.4:
        return pick_wood(style, rng)
    colours: tuple[Colour, ...] = ((48, 48, 50), (202, 198, 190), (120, 116, 110), (90, 74, 60))
    patterns: tuple[Pattern, ...] = ("marble", "plain", "concrete")
    pattern = patterns[rng.integers(3)]
    return paint(pick_colour(colours, rng), rng, pattern, rng.uniform(0.1, 0.5))


def edges_of(width: float, pitch: float) -> list[float]:
    """Return where fronts of about a width begin and end across a cabinet, x = 0 its middle."""
    count = max(round(width / pitch), 1)
    return [float(x) for x in np.linspace(-width / 2, width / 2, count + 1)]


def stack(
    left: float, right: float, low: float, high: float, shares: tuple[float, ...]
) -> list[Cell]:
    """Return fronts over each other in one column, their heights in these proportions."""
    cuts = low + (high - low) * np.cumsum([0.0, *shares]) / sum(shares)
    return [(left, float(a), right, float(b)) for a, b in pairwise(cuts)]


def body_parts(
    width: float, depth: float, low: float, high: float, finish: Finish, *, hollow: bool
) -> list[Part]:
    """Make a closed body up to y = ``depth``, or an open one with a rail, shelves and things."""
    w, thick = width / 2, 0.018
    if not hollow:
        return [solid(finish.body, boxes((-w, 0, low), (w, depth, high)))]
    lows = [(-w, 0.0, low), (w - thick, 0.0, low), (-w + thick, 0.0, low)]
    highs = [(-w + thick, depth, high), (w, depth, high), (w - thick, 0.008, high)]
    levels = [low, low + 0.25 * (high - low), high - thick]
    lows += [(-w + thick, 0.008, z) for z in levels]
    highs += [(w - thick, depth, z + thick) for z in levels]
    return [solid(finish.body, boxes(a, b)) for a, b in zip(lows, highs, strict=True)]


def inside_parts(
    width: float, depth: float, low: float, high: float, rng: np.random.Generator
) -> list[Part]:
    """Make clothes that hang in a row and lie on the shelf of an open body."""
    w, level, parts = width / 2 - 0.05, low + 0.25 * (high - low) + 0.018, []
    spots = np.arange(-w, w - 0.08, rng.uniform(0.07, 0.14))
    for x in spots[rng.random(len(spots)) < 0.75]:
        drop = rng.uniform(0.45, 0.85) * (high - level)
        sheet = boxes((x, 0.08, high - 0.1 - drop), (x + 0.05, depth - 0.06, high - 0.08))
        parts.append(solid(paint(bright(rng), rng, "weave", 0.04), sheet))
    heap = boxes((-w, 0.06, low + 0.018), (w * rng.uniform(-0.2, 0.9), depth - 0.1, level - 0.08))
    return [*parts, solid(paint(bright(rng), rng, "weave", 0.05), heap)]


def front_parts(
    cells: list[Cell], y: float, finish: Finish, rng: np.random.Generator, *, ajar: float = 0.0
) -> list[Part]:
    """Make doors and drawers before y: wide ones are drawers, those ajar stand out or open.

    Args:
        cells: Where they are.
        y: Front of the body.
        finish: How they look.
        rng: Random numbers.
        ajar: Share of drawers pulled out and of doors swung open.
    """
    shut: list[Cell] = []
    parts: list[Part] = []
    for cell in cells:
        wide, tall = cell[2] - cell[0], cell[3] - cell[1]
        if rng.random() >= ajar:
            shut.append(cell)
        elif wide > tall:
            parts.append(_pulled(cell, y, finish, rng))
        else:
            parts += _swung(cell, y, finish, rng)
    if shut:
        parts.append(solid(finish.front, _sheets(shut, y, finish)))
        parts += [handle for cell in shut for handle in _handle(cell, y + FRONT, finish)]
    return parts


def _sheets(cells: list[Cell], y: float, finish: Finish) -> np.ndarray:
    """Return the fronts of closed doors, with the raised frames of framed ones."""
    gap = finish.gap / 2
    inner = [(a + gap, b + gap, c - gap, d - gap) for a, b, c, d in cells]
    lows, highs = [(a, y, b) for a, b, _, _ in inner], [(c, y + FRONT, d) for *_, c, d in inner]
    if finish.framed:
        far, rim = y + FRONT, 0.05
        for a, b, c, d in inner:
            if min(c - a, d - b) > 0.2:
                lows += [(a, far, b), (c - rim, far, b), (a + rim, far, b), (a + rim, far, d - rim)]
                highs += [(a + rim, far + 0.008, d), (c, far + 0.008, d)]
                highs += [(c - rim, far + 0.008, b + rim), (c - rim, far + 0.008, d)]
    return boxes(lows, highs)


def _handle(cell: Cell, y: float, finish: Finish) -> list[Part]:
    """Make the handle of a closed front; hinges are left and right in turn."""
    left, low, right, high = cell
    wide, tall, middle = right - left, high - low, (left + right) / 2
    is_door, y = tall > wide, y + (0.008 if finish.framed else 0.0)
    x = middle if not is_door else (right - 0.05 if round(left * 100) % 2 else left + 0.05)
    z = min(max(1.0, low + 0.1), high - 0.1) if is_door else (low + high) / 2
    if is_door and low > 1.2:
        z = low + 0.1
    if finish.handle == "bar":
        return [_bar(x, y, z, 0.08 if wide > 0.2 else 0.03, finish, upright=is_door)]
    if finish.handle == "knob":
        knob = tilted(rod(0.014, 0.0, 0.026, 0, 0, 8), -np.pi / 2)
        return [solid(finish.pull, knob + np.array([x, y, z]))]
    if finish.handle == "rail":
        rail = boxes((left + 0.02, y, high - 0.032), (right - 0.02, y + 0.02, high - 0.012))
        return [solid(finish.pull, rail)]
    if finish.handle == "lip":
        shade = replace(finish.pull, base=(52, 50, 48), accent=(40, 38, 36))
        lip = boxes((left + 0.01, y, high - 0.024), (right - 0.01, y + 0.001, high))
        return [solid(shade, lip)]
    return []


def _bar(x: float, y: float, z: float, half: float, finish: Finish, *, upright: bool) -> Part:
    """Make a bar on two posts about a spot of a front."""
    out = (0.006, half) if upright else (half, 0.006)
    shape = boxes((x - out[0], y + 0.02, z - out[1]), (x + out[0], y + 0.032, z + out[1]))
    feet = [(-out[0], -out[1] + 0.01), (out[0] - 0.01, out[1] - 0.02)]
    posts = boxes(
        [(x + a, y, z + b) for a, b in feet],
        [(x + a + 0.01, y + 0.02, z + b + 0.01) for a, b in feet],
    )
    return solid(finish.pull, shape, posts)


def _pulled(cell: Cell, y: float, finish: Finish, rng: np.random.Generator) -> Part:
    """Make a drawer that is pulled out a little."""
    left, low, right, high = cell
    out = rng.uniform(0.03, 0.25)
    tray = boxes((left + 0.03, y, low + 0.02), (right - 0.03, y + out, high - 0.05))
    face = boxes((left, y + out, low + 0.002), (right, y + out + FRONT, high - 0.002))
    return solid(finish.front, tray, face)


def _swung(cell: Cell, y: float, finish: Finish, rng: np.random.Generator) -> list[Part]:
    """Make a door that stands open at 10 to 100 degrees."""
    left, low, right, high = cell
    wide, angle = right - left, np.radians(rng.uniform(10, 100))
    leaf = solid(finish.front, boxes((0.0, 0, low + 0.002), (wide, FRONT, high - 0.002)))
    if rng.random() < 0.5:
        return [leaf.moved(x=left, y=y, yaw=float(angle))]
    other = solid(finish.front, boxes((-wide, 0, low + 0.002), (0.0, FRONT, high - 0.002)))
    return [other.moved(x=right, y=y, yaw=-float(angle))]


def feet_parts(
    width: float, depth: float, height: float, finish: Finish, rng: np.random.Generator
) -> list[Part]:
    """Make a set-back plinth, or four legs where it stands high."""
    w = width / 2
    if height < 0.1 or rng.random() < 0.3:
        return [solid(finish.body, boxes((-w + 0.01, 0, 0), (w - 0.01, depth - 0.04, height)))]
    spots = [(x, y) for x in (-w + 0.05, w - 0.05) for y in (0.05, depth - 0.06)]
    leg = finish.pull if rng.random() < 0.5 else finish.body
    return [
        solid(leg, boxes((x - 0.02, y - 0.02, 0), (x + 0.02, y + 0.02, height))) for x, y in spots
    ]
