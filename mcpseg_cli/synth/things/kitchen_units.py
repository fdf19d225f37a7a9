"""Fitted kitchens of class clutter: runs of base units, wall units, tall units, cookers, hoods."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from mcpseg_cli.synth.geometry.shapes import bend, boxes, lathe, pipe, solid, stand
from mcpseg_cli.synth.geometry.solids import Item, Part
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import Style, paint
from mcpseg_cli.synth.things.cabinet_parts import (
    FRONT,
    Cell,
    Finish,
    body_parts,
    edges_of,
    front_parts,
    pick_finish,
    pick_stone,
    stack,
)
from mcpseg_cli.synth.things.desk_things import dark_or_light

TOP = 0.038
"""How thick a worktop is, metres."""
_PLINTH = 0.1


@dataclass(frozen=True)
class KitchenLook:
    """What all units of one kitchen have in common.

    Attributes:
        finish: Of base and tall units.
        upper: Of wall units.
        worktop: Of the top.
        steel: Of sink, taps and appliances.
        depth: Of base units with the top, metres.
        height: Of the worktop, metres.
    """

    finish: Finish
    upper: Finish
    worktop: Material
    steel: Material
    depth: float
    height: float


def pick_kitchen(
    style: Style, rng: np.random.Generator, wall: Material | None = None
) -> KitchenLook:
    """Draw how a kitchen looks; ``wall`` is the surface of the walls where it is known."""
    finish = pick_finish(style, rng, wall)
    upper = finish if rng.random() < 0.7 else pick_finish(style, rng, wall)
    steel = paint(((176, 178, 180), (60, 62, 64), (236, 236, 233))[rng.integers(3)], rng, "metal")
    depth, height = rng.uniform(0.58, 0.66), rng.uniform(0.86, 0.95)
    return KitchenLook(finish, upper, pick_stone(style, rng), steel, depth, height)


def base_run(
    width: float, look: KitchenLook, rng: np.random.Generator, *, wet: bool, hot: bool
) -> tuple[Item, float | None]:
    """Make base units under one worktop.

    Args:
        width: Along the wall, metres.
        look: Of the kitchen.
        rng: Random numbers.
        wet: Whether there are a sink and, where it fits, a dishwasher.
        hot: Whether there are a hob and an oven under it.

    Returns:
        An object of class clutter, and where its hob is, x from its middle; None if there is none.
    """
    edges = edges_of(width, rng.uniform(0.45, 0.62))
    spots = rng.permutation(len(edges) - 1).tolist()
    oven = spots.pop() if hot and spots else None
    sink = spots.pop() if wet and spots else None
    washer = spots.pop() if wet and spots and rng.random() < 0.6 else None

    # bodies and fronts
    inset, low, high = look.depth - 0.03, _PLINTH, look.height - TOP
    parts = body_parts(width, inset, low, high, look.finish, hollow=False)
    foot = boxes((-width / 2, 0, 0), (width / 2, inset - 0.05, low))
    parts.append(solid(paint((60, 58, 56), rng) if rng.random() < 0.5 else look.finish.body, foot))
    plain = [n for n in range(len(edges) - 1) if n not in (oven, washer)]
    cells = [cell for n in plain for cell in _column(edges[n], edges[n + 1], low, high, rng)]
    parts += front_parts(cells, inset, look.finish, rng, ajar=0.02)
    for n in (oven, washer):
        if n is not None:
            parts += _appliance(
                (edges[n], low, edges[n + 1], high), inset, look, rng, glass=n == oven
            )

    parts += _worktop(width, look, rng, None if sink is None else (edges[sink], edges[sink + 1]))
    hob = None
    if oven is not None:
        hob = (edges[oven] + edges[oven + 1]) / 2
        plate = boxes(
            (hob - 0.28, 0.07, look.height), (hob + 0.28, look.depth - 0.06, look.height + 0.006)
        )
        parts.append(solid(paint((26, 26, 28), rng, "glass"), plate))
    return stand("clutter", parts, "kitchen"), hob


def _column(
    left: float, right: float, low: float, high: float, rng: np.random.Generator
) -> list[Cell]:
    """Return the fronts of one base unit."""
    shares = ((1.0,), (3.0, 1.0), (3.0, 1.0), (2.0, 2.0, 1.0), (1.0, 1.0, 1.0))[rng.integers(5)]
    return stack(left, right, low, high, shares)


def _appliance(
    cell: Cell, y: float, look: KitchenLook, rng: np.random.Generator, *, glass: bool
) -> list[Part]:
    """Make the door, window, panel and bar of a built-in oven or a dishwasher."""
    left, low, right, high = cell
    case = look.steel if rng.random() < 0.6 else dark_or_light(rng)
    face = boxes((left + 0.003, y, low), (right - 0.003, y + FRONT, high - 0.003))
    bar = boxes((left + 0.06, y + 0.045, high - 0.16), (right - 0.06, y + 0.06, high - 0.145))
    ends = [(left + 0.06, y + FRONT, high - 0.16), (right - 0.075, y + FRONT, high - 0.16)]
    feet = boxes(ends, [(x + 0.015, y + 0.045, z + 0.015) for x, _, z in ends])
    panel = boxes(
        (left + 0.02, y + FRONT, high - 0.11), (right - 0.02, y + FRONT + 0.004, high - 0.02)
    )
    dark = paint((24, 24, 26), rng, "glass")
    parts = [solid(case, face), solid(look.steel, bar, feet), solid(dark, panel)]
    if glass:
        top = high - 0.2
        pane = boxes((left + 0.05, y + FRONT, low + 0.1), (right - 0.05, y + FRONT + 0.005, top))
        parts.append(solid(dark, pane))
    return parts


def _worktop(
    width: float, look: KitchenLook, rng: np.random.Generator, sink: tuple[float, float] | None
) -> list[Part]:
    """Make the top, round a sink with a tap behind it, and at times an upstand."""
    w, low, high, deep = width / 2, look.height - TOP, look.height, look.depth
    parts = []
    if rng.random() < 0.4:
        upstand = boxes((-w, 0, high), (w, 0.015, high + rng.uniform(0.04, 0.09)))
        parts.append(solid(look.worktop, upstand))
    if sink is None:
        return [solid(look.worktop, boxes((-w, 0, low), (w, deep, high))), *parts]

    left, right, rear, front = sink[0] + 0.05, sink[1] - 0.05, 0.12, deep - 0.1
    lows = [(-w, 0, low), (right, 0, low), (left, 0, low), (left, front, low)]
    highs = [(left, deep, high), (w, deep, high), (right, rear, high), (right, deep, high)]
    bowl = boxes((left, rear, low), (right, front, low + 0.004))
    x, tall = (left + right) / 2, high + rng.uniform(0.18, 0.36)
    bent = [(x, 0.07, high), (x, 0.07, tall), (x, 0.26, tall), (x, 0.26, tall - 0.08)]
    tap = pipe(bend(bent, 0.1), 0.012)
    metals = [solid(look.steel, bowl), solid(look.steel, tap)]
    return [solid(look.worktop, boxes(lows, highs)), *metals, *parts]


def wall_run(width: float, look: KitchenLook, rng: np.random.Generator) -> Item:
    """Make wall units side by side, one of them at times an open shelf."""
    depth, height = rng.uniform(0.3, 0.38), rng.uniform(0.5, 0.85)
    edges, inset = edges_of(width, rng.uniform(0.4, 0.62)), depth - FRONT
    flaps = rng.random() < 0.2
    shares = (1.0, 1.0) if flaps else (1.0,)
    pairs = list(pairwise(edges))
    cells = [cell for a, b in pairs for cell in stack(a, b, 0.0, height, shares)]
    parts = body_parts(width, inset, 0.0, height, look.upper, hollow=False)
    parts += front_parts(cells, inset, look.upper, rng, ajar=0.04)
    if rng.random() < 0.3:
        edge = boxes((-width / 2, 0, height), (width / 2, depth + 0.02, height + 0.04))
        parts.append(solid(look.upper.front, edge))
    return stand("clutter", parts, "kitchen")


def tall_unit(width: float, height: float, look: KitchenLook, rng: np.random.Generator) -> Item:
    """Make a tall unit: a built-in fridge, a larder, or an oven at the height of the chest."""
    inset, w = look.depth - 0.03, width / 2
    parts = body_parts(width, inset, _PLINTH, height, look.finish, hollow=False)
    parts.append(solid(look.finish.body, boxes((-w, 0, 0), (w, inset - 0.05, _PLINTH))))
    if rng.random() < 0.4:
        cells = [(-w, _PLINTH, w, 0.75), (-w, 1.35, w, height)]
        parts += _appliance((-w, 0.75, w, 1.35), inset, look, rng, glass=True)
    else:
        cells = stack(-w, w, _PLINTH, height, (1.0, rng.uniform(0.8, 2.5)))
    parts += front_parts(cells, inset, look.finish, rng)
    return stand("clutter", parts, "kitchen")


def hood(style: Style, rng: np.random.Generator) -> list[Part]:
    """Cooker hood: a pyramid or a box with its duct."""
    half, deep, tall = rng.uniform(0.28, 0.45), rng.uniform(0.4, 0.52), rng.uniform(0.45, 0.8)
    steel = paint(((176, 178, 180), (52, 52, 54), (232, 232, 230))[rng.integers(3)], rng, "metal")
    rim, duct = rng.uniform(0.04, 0.09), boxes((-0.13, 0, 0.1), (0.13, 0.26, tall))
    plate = boxes((-half, 0, 0), (half, deep, rim))
    if rng.random() < 0.5:
        return [solid(steel, plate), solid(steel, duct)]
    cosine = np.sqrt(0.5)
    spin = np.array([[cosine, -cosine, 0], [cosine, cosine, 0], [0, 0, 1]])
    square = lathe([(half * np.sqrt(2), rim), (0.18, rim + 0.22)], 4) @ spin.T
    square = square * np.array([1.0, deep / (2 * half), 1.0]) + np.array([0, deep / 2, 0])
    return [solid(steel, plate), solid(replace(steel, seed=7), square), solid(steel, duct)]


def cooker(style: Style, rng: np.random.Generator) -> list[Part]:
    """Free-standing cooker with its hob, oven window, knobs and rear rim."""
    w, d, h = rng.uniform(0.5, 0.62) / 2, rng.uniform(0.56, 0.64), rng.uniform(0.85, 0.93)
    case, dark = dark_or_light(rng), paint((26, 26, 28), rng, "glass")
    body = boxes((-w, 0, 0), (w, d - 0.03, h))
    pane = boxes((-w + 0.06, d - 0.03, 0.3), (w - 0.06, d - 0.022, 0.62))
    front = boxes((-w + 0.01, d - 0.03, 0.76), (w - 0.01, d - 0.015, h - 0.02))
    hob = boxes((-w + 0.02, 0.06, h), (w - 0.02, d - 0.06, h + 0.008))
    rim = boxes((-w, 0, h), (w, 0.03, h + rng.uniform(0.03, 0.16)))
    bar = boxes((-w + 0.05, d - 0.01, 0.68), (w - 0.05, d, 0.7))
    feet = boxes([(-w + 0.05, d - 0.03, 0.68)], [(-w + 0.07, d - 0.01, 0.7)])
    steel = paint((178, 180, 182), rng, "metal")
    return [
        solid(case, body, rim), solid(dark, pane), solid(dark, hob), solid(case, front),
        solid(steel, bar, feet),
    ]  # fmt: skip


def dishwasher(style: Style, rng: np.random.Generator) -> list[Part]:
    """Free-standing dishwasher."""
    w, d, h = rng.choice([0.225, 0.3]), rng.uniform(0.56, 0.62), rng.uniform(0.82, 0.87)
    case = paint(((238, 238, 236), (180, 182, 184))[rng.integers(2)], rng)
    panel = boxes((-w + 0.01, d, h - 0.13), (w - 0.01, d + 0.008, h - 0.02))
    pull = boxes((-0.14, d + 0.008, h - 0.1), (0.14, d + 0.02, h - 0.06))
    door = boxes((-w + 0.005, d, 0.1), (w - 0.005, d + 0.012, h - 0.135))
    grey = paint((120, 122, 126), rng)
    return [solid(case, boxes((-w, 0, 0), (w, d, h)), door), solid(grey, panel, pull)]


def pots(style: Style, rng: np.random.Generator) -> list[Part]:
    """A pot or a kettle with its lid and handles."""
    r, h = rng.uniform(0.08, 0.15), rng.uniform(0.09, 0.2)
    colour = ((170, 172, 174), (40, 40, 42), (150, 40, 34))[rng.integers(3)]
    metal = paint(colour, rng, "metal")
    body = lathe(
        [(0, 0), (r, 0), (r, h), (r * 0.5, h + 0.02), (0.015, h + 0.025), (0, h + 0.05)], 14
    )
    grips = boxes(
        [(-r - 0.03, -0.03, h - 0.03), (r, -0.03, h - 0.03)],
        [(-r, 0.03, h - 0.01), (r + 0.03, 0.03, h - 0.01)],
    )
    return [solid(metal, body), solid(metal, grips)]


def dish_rack(style: Style, rng: np.random.Generator) -> list[Part]:
    """Plates drying in a rack."""
    w, d = rng.uniform(0.18, 0.26), 0.15
    frame = boxes(
        [(-w, -d, 0), (-w, -d, 0.1), (-w, d - 0.01, 0.1)],
        [(w, d, 0.02), (w, -d + 0.01, 0.115), (w, d, 0.115)],
    )
    posts = boxes(
        [(x, y, 0.02) for x in (-w, w - 0.01) for y in (-d, d - 0.01)],
        [(x + 0.01, y + 0.01, 0.1) for x in (-w, w - 0.01) for y in (-d, d - 0.01)],
    )
    spots = np.arange(-w + 0.04, w - 0.03, 0.045)
    plates = boxes([(x, -0.1, 0.02) for x in spots], [(x + 0.01, 0.1, 0.2) for x in spots])
    steel, white = paint((180, 182, 184), rng, "metal"), paint((232, 231, 226), rng)
    return [solid(steel, frame, posts), solid(white, plates)]


def toaster(style: Style, rng: np.random.Generator) -> list[Part]:
    """Toaster, bread box or kitchen machine: a rounded box."""
    w, d, h = rng.uniform(0.12, 0.2), rng.uniform(0.16, 0.24), rng.uniform(0.16, 0.26)
    case = dark_or_light(rng)
    slots = boxes(
        [(-w * 0.7, d * 0.3, h), (-w * 0.7, d * 0.6, h)],
        [(w * 0.7, d * 0.4, h + 0.004), (w * 0.7, d * 0.7, h + 0.004)],
    )
    return [solid(case, boxes((-w, 0, 0), (w, d, h))), solid(paint((30, 30, 32), rng), slots)]
