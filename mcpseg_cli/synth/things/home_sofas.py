"""Sofas of living rooms: straight, with a chaise longue or round a corner."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mcpseg_cli.synth.geometry.shapes import boxes, cushion, shell, slanted, solid, stand
from mcpseg_cli.synth.geometry.solids import Item, Part, shifted, tilted
from mcpseg_cli.synth.models.stand_in import stand_in
from mcpseg_cli.synth.surfaces.materials import Colour, Material, Pattern
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_fabric, pick_metal, pick_wood

_LEATHERS: tuple[Colour, ...] = (
    *((34, 30, 30), (52, 38, 32), (84, 52, 36), (118, 72, 44), (70, 26, 26), (196, 184, 166)),
)
_PILLOWS: tuple[Colour, ...] = (
    *((40, 40, 44), (176, 92, 54), (196, 160, 84), (58, 96, 104), (122, 44, 50)),
    *((212, 204, 188), (86, 98, 66), (104, 76, 112), (150, 140, 126)),
)
_WEAVES: tuple[Pattern, ...] = ("weave", "plain", "stripes", "checks", "print")


@dataclass(frozen=True)
class HomeSofa:
    """A sofa and where one puts the table.

    Attributes:
        item: The sofa, its back to y = 0, centred on x = 0.
        middle: Where along x the middle of the seats that face +y is, metres.
        depth: How far these seats reach from the back, metres.
    """

    item: Item
    middle: float
    depth: float


@dataclass(frozen=True)
class _Build:
    """What all runs of seats of one sofa share: covers and sizes in metres."""

    cover: Material
    frame: Material
    depth: float
    height: float
    foot: float
    seat: float
    arm: float
    arm_top: float
    back: float
    place: float
    softness: float
    lean: float
    is_slim: bool
    has_back_cushions: bool


def make_home_sofa(
    seats: int, style: Style, rng: np.random.Generator, corner: float = 0.0
) -> HomeSofa:
    """Make a sofa as homes have them.

    Args:
        seats: How many sit side by side on it, 1-4; a corner or a chaise longue comes on top.
        style: Colours and materials of the building.
        rng: Decides sizes, shape and colours.
        corner: Side of a second run of seats or a chaise longue, +1 at +x, -1 at -x; 0 for a
            straight sofa.

    Returns:
        The sofa, of class sofa like the pillows and blankets on it; it stands on z = 0.
    """
    kind = "corner sofa" if corner else "sofa"
    model = stand_in("sofa", kind, style, rng, 0.66 * seats + 0.4 + 0.6 * abs(corner))
    if model is not None:
        return HomeSofa(model, 0.0, float(model.bounds()[1, 1]))

    build = _draw_build(style, rng)
    width = seats * build.place + 2 * build.arm
    parts = _run(build, width, (corner >= 0, corner <= 0), rng)
    if corner and rng.random() < 0.45:
        parts += _chaise(build, corner, width, rng)
    elif corner:
        parts += _second_run(build, corner, width, rng)

    # what lies on it
    parts += _pillows(build, width, int(rng.integers(0, seats + 3)), rng)
    if rng.random() < 0.45:
        parts.append(_blanket(build, width, rng))
    item = stand("sofa", parts)
    taken = build.depth if corner else 0.0
    return HomeSofa(item, -corner * taken / 2, build.depth)


def _draw_build(style: Style, rng: np.random.Generator) -> _Build:
    """Draw covers and sizes: blocks, rolled arms, slim ones on legs, low ones without arms."""
    cover = pick_fabric(style, rng)
    if rng.random() < 0.3:
        cover = paint(_LEATHERS[rng.integers(len(_LEATHERS))], rng, "leather", 0.05)
    frame = pick_wood(style, rng) if rng.random() < 0.65 else pick_metal(style, rng)
    is_slim = rng.random() < 0.25
    height, seat, arm = rng.uniform(0.66, 1.0), rng.uniform(0.36, 0.48), 0.0
    if rng.random() >= 0.15:
        arm = rng.uniform(0.05, 0.08) if is_slim else rng.uniform(0.12, 0.32)

    return _Build(
        cover,
        frame,
        depth=rng.uniform(0.8, 1.08),
        height=height,
        foot=rng.uniform(0.12, 0.2) if is_slim else rng.uniform(0.02, 0.12),
        seat=seat,
        arm=arm,
        arm_top=height - 0.06 if rng.random() < 0.15 else rng.uniform(seat + 0.08, seat + 0.26),
        back=rng.uniform(0.12, 0.24),
        place=rng.uniform(0.56, 0.8),
        softness=rng.uniform(0.15, 0.6),
        lean=rng.uniform(0.06, 0.26),
        is_slim=is_slim,
        has_back_cushions=rng.random() < 0.8,
    )


def _run(build: _Build, width: float, arms: Sequence[bool], rng: np.random.Generator) -> list[Part]:
    """Make seats side by side, their back to y = 0, with arms at the low and high end or not."""
    half, b = width / 2, build
    low = b.seat - (0.1 if b.is_slim else 0.16)
    base = cushion((-half, 0.02, b.foot), (half, b.depth - 0.02, low), 0.06, 0.12)
    top = b.height - rng.uniform(0.0, 0.08)
    rear = cushion((-half, 0, b.foot), (half, b.back, top), 0.1, 0.1 + b.softness / 2)
    spots = [(x * (half - 0.07), y) for x in (-1, 1) for y in (0.08, b.depth - 0.1)]
    feet = [slanted((x, y, 0), (x, y, b.foot + 0.02), (0.045, 0.045)) for x, y in spots]
    parts = [solid(b.cover, base), solid(b.cover, rear), *(solid(b.frame, foot) for foot in feet)]

    # arms take their space from the seats
    ends = [-half, half]
    for number, has_arm in enumerate(arms):
        if has_arm and b.arm:
            x = ends[number] if number == 0 else ends[number] - b.arm
            parts += _arm(b, x)
            ends[number] += b.arm if number == 0 else -b.arm
    return parts + _seats(b, ends[0], ends[1], low, rng)


def _arm(build: _Build, x: float) -> list[Part]:
    """Make the arm that begins at x: a block or a roll, on slim sofas a frame."""
    b, end = build, x + build.arm
    if b.is_slim:
        bars = boxes(
            [(x, 0.03, 0), (x, b.depth - 0.08, 0), (x, 0.03, b.arm_top - 0.04)],
            [(end, 0.09, b.arm_top), (end, b.depth - 0.02, b.arm_top), (end, b.depth, b.arm_top)],
        )
        return [solid(b.frame, bars[12 * row : 12 * row + 12]) for row in range(3)]
    return [solid(b.cover, cushion((x, 0.01, b.foot), (end, b.depth, b.arm_top), 0.12, b.softness))]


def _seats(
    build: _Build, first: float, last: float, low: float, rng: np.random.Generator
) -> list[Part]:
    """Put seat and back cushions between two ends: one each, or long ones for two."""
    b, parts = build, []
    count = max(round((last - first) / b.place), 1)
    if count > 1 and rng.random() < 0.25:
        count = count // 2
    edges, thick = np.linspace(first, last, count + 1), rng.uniform(0.11, 0.19)
    for start, end in itertools.pairwise(edges.tolist()):
        # each sags a little differently
        rear, front = (start + 0.004, b.back, low - 0.02), (end - 0.004, b.depth + 0.01)
        top = b.seat - rng.uniform(0, 0.03)
        parts.append(solid(b.cover, cushion(rear, (*front, top), 0.14, 0.2 + b.softness / 2)))
        if not b.has_back_cushions:
            continue

        tall, half = b.height - b.seat + rng.uniform(-0.06, 0.06), thick / 2
        high = (end - start - 0.01, half, tall)
        rest = cushion((0.01, -half, 0), high, 0.25, 0.3 + b.softness / 2)
        leaned = tilted(rest, b.lean * rng.uniform(0.8, 1.2))
        placed = shifted(leaned, start, b.back + thick * 0.7, b.seat - 0.02)
        parts.append(solid(b.cover, placed))
    return parts


def _second_run(build: _Build, side: float, width: float, rng: np.random.Generator) -> list[Part]:
    """Make the run of seats that goes round the corner."""
    length = int(rng.integers(1, 3)) * build.place + build.arm
    parts = _run(build, length, (side < 0, side > 0), rng)
    parts += _pillows(build, length, int(rng.integers(0, 3)), rng)
    x, y = side * width / 2, build.depth + length / 2 - 0.01
    return [part.moved(x=x, y=y, yaw=side * np.pi / 2) for part in parts]


def _chaise(build: _Build, side: float, width: float, rng: np.random.Generator) -> list[Part]:
    """Make the long seat at one end, at times with a low wall along its outer side."""
    b, end = build, side * width / 2
    inner, reach = end - side * b.depth * 0.9, b.depth + rng.uniform(0.5, 0.95)
    low, high, near = min(inner, end), max(inner, end), b.depth - 0.04
    body = cushion((low, near, b.foot), (high, reach, b.seat - 0.12), 0.1, 0.15)
    upper = (high - 0.005, reach + 0.01, b.seat)
    top = cushion((low + 0.005, near, b.seat - 0.14), upper, 0.15, 0.35)

    y, thin = reach - 0.1, (0.045, 0.045)
    feet = [slanted((x, y, 0), (x, y, b.foot + 0.02), thin) for x in (low + 0.08, high - 0.08)]
    parts = [solid(b.cover, body), solid(b.cover, top), *(solid(b.frame, foot) for foot in feet)]

    # the arm goes on along it, or ends where the others do
    if b.arm and not b.is_slim:
        x0, x1 = sorted((end, end - side * b.arm))
        far = reach if rng.random() < 0.3 else b.depth
        wall = cushion((x0, 0.01, b.foot), (x1, far, b.arm_top), 0.12, b.softness)
        parts.append(solid(b.cover, wall))
    return parts


def _pillows(build: _Build, width: float, count: int, rng: np.random.Generator) -> list[Part]:
    """Lean loose pillows against the back or lay them on the seats, some alike."""
    parts, b = [], build
    cover = paint(_PILLOWS[rng.integers(len(_PILLOWS))], rng, "weave", 0.03)
    for _ in range(count):
        if rng.random() < 0.6:
            pattern, colour = _WEAVES[rng.integers(len(_WEAVES))], rng.integers(len(_PILLOWS))
            cover = paint(_PILLOWS[colour], rng, pattern, rng.uniform(0.03, 0.2))
        wide, tall = rng.uniform(0.36, 0.56), rng.uniform(0.3, 0.46)
        pad = cushion((-wide / 2, -0.065, 0), (wide / 2, 0.065, tall), 0.45, 0.5)

        # upright as a rule
        x = rng.uniform(-1, 1) * max(width / 2 - b.arm - wide / 2, 0.02)
        if rng.random() < 0.8:
            place = shifted(tilted(pad, rng.uniform(0.2, 0.5)), x, b.back + 0.26, b.seat - 0.01)
        else:
            flat = tilted(pad, np.pi / 2 - 0.1)
            place = shifted(flat, x, b.depth - 0.05, b.seat + 0.05)
        parts.append(solid(cover, place))
    return parts


def _blanket(build: _Build, width: float, rng: np.random.Generator) -> Part:
    """Throw a blanket over back and seat, at times down to the front."""
    b, wide = build, rng.uniform(0.35, 0.9)
    colour = _PILLOWS[rng.integers(len(_PILLOWS))]
    cover = paint(colour, rng, _WEAVES[rng.integers(len(_WEAVES))], rng.uniform(0.05, 0.25))

    # its line from behind the back over the seat
    top, front = b.height + 0.05, b.back + (0.22 if b.has_back_cushions else 0.02)
    profile = [(0.03, top), (front - 0.04, top), (front + 0.06, b.seat + 0.06)]
    profile.append((b.depth - 0.05, b.seat + 0.025))
    if rng.random() < 0.5:
        edge = (b.depth + 0.04, b.seat - rng.uniform(0.1, 0.25))
        profile += [(b.depth + 0.035, b.seat - 0.02), edge]

    # folds across it
    path = np.array(profile)
    along = np.linspace(-wide / 2, wide / 2, 9)
    x = along[:, None] + rng.normal(0, 0.02, (1, len(path)))
    fold = 0.008 * np.sin(along * rng.uniform(20, 40))[:, None]
    grid = np.stack([x, path[:, 0] + fold, path[:, 1] + fold], axis=-1)
    free = max(width / 2 - b.arm - wide / 2, 0.0)
    return solid(cover, shifted(shell(grid, 0.012), rng.uniform(-1, 1) * free))
