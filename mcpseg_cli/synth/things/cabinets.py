"""Cabinets of class clutter: wardrobes, chests, sideboards, low units, built-in runs of doors."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from mcpseg_cli.synth.geometry.shapes import boxes, solid, stand
from mcpseg_cli.synth.geometry.solids import Item, Part
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import Style, paint
from mcpseg_cli.synth.things.cabinet_parts import (
    FRONT,
    Cell,
    Finish,
    body_parts,
    edges_of,
    feet_parts,
    front_parts,
    inside_parts,
    pick_finish,
    stack,
)

Span = tuple[float, float]
_Columns = Callable[[list[float], float, float, np.random.Generator], list[Cell]]


@dataclass(frozen=True)
class _Form:
    """Lowest and highest measures of a kind of cabinet, metres.

    Attributes:
        width: Along the wall.
        depth: Away from it.
        height: With its feet.
        foot: How high it stands on them.
        pitch: How wide doors are.
        columns: What makes the fronts from the edges of the doors, bottom and top.
        ajar: Share of fronts that are open.
    """

    width: Span
    depth: Span
    height: Span
    foot: Span
    pitch: Span
    columns: _Columns
    ajar: float = 0.04


def make_cabinet(
    kind: str,
    style: Style,
    rng: np.random.Generator,
    finish: Finish | None = None,
    widest: float = 9.0,
) -> Item:
    """Make a cabinet, its back to y = 0.

    Args:
        kind: One of ``CABINET_KINDS``.
        style: Colours and materials of the building.
        rng: Decides sizes, shape and colours.
        finish: How it looks; drawn by default.
        widest: It is no wider, metres, but 0.3 at the least.

    Returns:
        An object of class clutter that stands on z = 0.

    Raises:
        KeyError: There is no such kind.
    """
    form = _FORMS[kind]
    looks = finish or pick_finish(style, rng)
    width = max(min(rng.uniform(*form.width), widest), 0.3)
    size = (width, rng.uniform(*form.depth), rng.uniform(*form.height))
    return stand("clutter", _cabinet(size, form, looks, rng), "cabinet")


def _cabinet(
    size: tuple[float, float, float], form: _Form, finish: Finish, rng: np.random.Generator
) -> list[Part]:
    """Make feet, body, fronts and top."""
    (width, depth, height), foot = size, rng.uniform(*form.foot)
    inset, thick = depth - FRONT, rng.choice([0.0, 0.018, 0.03])
    edges = edges_of(width, rng.uniform(*form.pitch))
    cells = form.columns(edges, foot, height - thick, rng)
    ajar = form.ajar if rng.random() < 0.5 else 0.0
    opened = front_parts(cells, inset, finish, rng, ajar=ajar)
    is_tall = height > 1.5

    # one that stands open shows what is in it
    hollow = is_tall and ajar > 0 and any(abs(part.yaw) > 0.01 for part in opened)
    parts = feet_parts(width, depth, foot, finish, rng) if foot > 0.01 else []
    parts += body_parts(width, inset, foot, height - thick, finish, hollow=hollow)
    if hollow:
        parts += inside_parts(width, inset, foot, height - thick, rng)
    if thick:
        over = rng.uniform(0.0, 0.02)
        lid = boxes(
            (-width / 2 - over, 0, height - thick), (width / 2 + over, depth + over, height)
        )
        top = finish.body if rng.random() < 0.7 else finish.front
        parts.append(solid(replace(top, seed=top.seed + 2), lid))
    return parts + opened


def _doors(edges: list[float], low: float, high: float, rng: np.random.Generator) -> list[Cell]:
    """Doors over the whole height, at times over drawers or under short doors."""
    shares = ((1.0,), (1.0,), (1.0, 4.0), (3.0, 1.0), (1.0, 1.0, 7.0))[rng.integers(5)]
    pairs = pairwise(edges)
    return [cell for a, b in pairs for cell in stack(a, b, low, high, shares)]


def _drawers(edges: list[float], low: float, high: float, rng: np.random.Generator) -> list[Cell]:
    """Drawers over each other, the upper ones often lower."""
    count = max(round((high - low) / rng.uniform(0.15, 0.26)), 1)
    shares = np.linspace(1.0, rng.uniform(0.6, 1.0), count).tolist()
    pairs = pairwise(edges)
    return [cell for a, b in pairs for cell in stack(a, b, low, high, tuple(shares))]


def _mixed(edges: list[float], low: float, high: float, rng: np.random.Generator) -> list[Cell]:
    """Doors and columns of drawers side by side."""
    cells: list[Cell] = []
    for pair in pairwise(edges):
        column = _drawers if rng.random() < 0.4 else _plain
        cells += column(list(pair), low, high, rng)
    return cells


def _plain(edges: list[float], low: float, high: float, rng: np.random.Generator) -> list[Cell]:
    """One door or flap in each column."""
    return [(a, low, b, high) for a, b in pairwise(edges)]


_FORMS: dict[str, _Form] = {
    "wardrobe": _Form((0.8, 2.6), (0.54, 0.66), (1.8, 2.35), (0.0, 0.12), (0.4, 0.62), _doors),
    "tall cabinet": _Form((0.4, 1.2), (0.34, 0.6), (1.55, 2.3), (0.0, 0.14), (0.38, 0.6), _doors),
    "chest": _Form((0.45, 1.3), (0.38, 0.52), (0.7, 1.25), (0.0, 0.18), (0.45, 1.1), _drawers, 0.1),
    "sideboard": _Form((1.0, 2.1), (0.36, 0.5), (0.65, 0.95), (0.0, 0.2), (0.38, 0.7), _mixed),
    "low unit": _Form((0.9, 2.3), (0.34, 0.48), (0.28, 0.58), (0.0, 0.15), (0.45, 0.9), _mixed),
    "shoe cabinet": _Form((0.5, 1.1), (0.17, 0.32), (0.8, 1.3), (0.0, 0.1), (0.5, 1.0), _drawers),
    "bedside cabinet": _Form(
        (0.34, 0.58), (0.34, 0.44), (0.4, 0.68), (0.0, 0.2), (0.6, 0.7), _mixed
    ),
    "base cabinet": _Form((0.6, 2.0), (0.4, 0.62), (0.72, 1.1), (0.04, 0.12), (0.4, 0.6), _mixed),
}
CABINET_KINDS = tuple(_FORMS)
"""Kinds of cabinets that stand free."""


def sliding_wardrobe(
    size: tuple[float, float, float], finish: Finish, rng: np.random.Generator
) -> Item:
    """Make a wardrobe whose doors slide, at times with mirrors; one may stand open.

    Args:
        size: Width, depth and height, metres.
        finish: How it looks.
        rng: Random numbers.
    """
    width, depth, height = size
    inset, count = depth - 0.06, max(round(width / rng.uniform(0.7, 1.1)), 2)
    step, open_ = width / count, rng.random() < 0.25
    glass = paint((188, 198, 202), rng, "glass")
    parts = body_parts(width, inset, 0.04, height, finish, hollow=bool(open_))
    parts += feet_parts(width, inset, 0.04, finish, rng)
    if open_:
        parts += inside_parts(width, inset, 0.04, height, rng)

    # on two rails, one before the other
    mirrored = int(rng.integers(count)) if rng.random() < 0.4 else -1
    for number in range(count):
        slip = step * rng.uniform(0.3, 0.9) if open_ and number == 0 else 0.0
        x, y = -width / 2 + number * step + slip, inset + 0.005 + 0.028 * (number % 2 == 0)
        last = min(x + step + 0.02, width / 2)
        leaf = solid(finish.front, boxes((x, y, 0.03), (last, y + 0.022, height - 0.01)))
        parts.append(leaf)
        if number == mirrored:
            pane = boxes((x + 0.03, y + 0.022, 0.07), (last - 0.03, y + 0.024, height - 0.05))
            parts.append(solid(glass, pane))
    rails = boxes(
        [(-width / 2, inset, 0.0), (-width / 2, inset, height - 0.01)],
        [(width / 2, depth, 0.025), (width / 2, depth, height + 0.02)],
    )
    return stand("clutter", [*parts, solid(finish.body, rails)], "cabinet")


def built_in(size: tuple[float, float, float], finish: Finish, rng: np.random.Generator) -> Item:
    """Make a run of plain doors from wall to wall, up to the ceiling or nearly.

    Args:
        size: Width, depth and height, metres.
        finish: How it looks; handles are small or none.
        rng: Random numbers.
    """
    width, depth, height = size
    inset, low = depth - FRONT, float(rng.choice([0.0, 0.06, 0.1]))
    edges = edges_of(width, rng.uniform(0.4, 0.75))
    upper = height > 2.2 and rng.random() < 0.4
    cut = rng.uniform(1.9, 2.1) if upper else height - 0.005
    cells = _plain(edges, low, cut, rng)
    cells += _plain(edges, cut, height - 0.005, rng) if upper else []

    # a niche with shelves in place of a door, now and then
    ajar = 0.06 if rng.random() < 0.35 else 0.0
    opened = front_parts(cells, inset, finish, rng, ajar=ajar)
    hollow = any(abs(part.yaw) > 0.01 for part in opened)
    parts = body_parts(width, inset, low, height, finish, hollow=hollow)
    if hollow:
        parts += inside_parts(width, inset, low, height - 0.05, rng)
    if low:
        plinth = boxes((-width / 2, 0, 0), (width / 2, depth - 0.05, low))
        parts.append(solid(replace(finish.body, seed=finish.body.seed + 3), plinth))
    return stand("clutter", [*parts, *opened], "cabinet")


def cabinet_kind(kind: str) -> Callable[[Style, np.random.Generator], list[Part]]:
    """Return what makes a kind of cabinet for the catalogue of clutter."""

    def make(style: Style, rng: np.random.Generator) -> list[Part]:
        return list(make_cabinet(kind, style, rng).parts)

    return make


def wall_of(finish: Finish, wall: Material) -> Finish:
    """Return the finish with fronts and body in the paint of a wall."""
    return replace(finish, front=replace(wall, seed=wall.seed + 1), body=wall)
