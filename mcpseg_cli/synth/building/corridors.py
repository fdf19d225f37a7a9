"""Corridors: legs of a shape, cut into pieces, with passages where they meet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcpseg_cli.synth.building.spaces import Rectangle, Space, facing
from mcpseg_cli.synth.plan import Opening
from mcpseg_cli.synth.surfaces.styles import CorridorShape, Style

_LEGS: dict[CorridorShape, int] = {"straight": 1, "L": 2, "T": 2, "U": 3, "loop": 4}
_WALL = 0.12  # between pieces of a corridor, metres


def draw_corridors(
    style: Style, count: int, length: float, rng: np.random.Generator
) -> list[Space]:
    """Draw the boxes of the corridors of a floor.

    Args:
        style: The building's; has the shapes to choose from.
        count: How many pieces there are in all.
        length: How long they are together, metres, about.
        rng: Random numbers.

    Returns:
        The pieces, without openings and ceiling heights.
    """
    width = rng.uniform(*style.hall_width)
    shapes = [shape for shape in style.corridors if _LEGS[shape] <= count]
    shape = shapes[int(rng.integers(len(shapes)))] if shapes else "straight"
    legs = _legs(shape, length, width, rng)

    # the longest leg is cut first
    lengths = np.array([max(leg[2] - leg[0], leg[3] - leg[1]) for leg in legs])
    pieces = np.ones(len(legs), int)
    while pieces.sum() < count:
        pieces[int(np.argmax(lengths / pieces))] += 1
    boxes = [_cut(leg, number, rng) for leg, number in zip(legs, pieces, strict=True)]
    return [Space("hallway", box, 0.0) for leg in boxes for box in leg]


def _legs(
    shape: CorridorShape, length: float, width: float, rng: np.random.Generator
) -> list[Rectangle]:
    """Return the boxes of the straight legs of a shape; the first lies along x at y = 0."""
    if shape == "straight":
        return [(0.0, 0.0, length, width)]
    if shape == "L":
        first = length * rng.uniform(0.4, 0.6) + 4
        end = width + length - first + 8
        return [(0.0, 0.0, first, width), (first - width, width, first, end)]
    if shape == "T":
        first = length * rng.uniform(0.5, 0.65) + 2
        middle = first * rng.uniform(0.4, 0.6)
        end = width + length - first + 7
        return [(0.0, 0.0, first, width), (middle, width, middle + width, end)]

    # two arms, and for a loop what joins their ends
    is_loop = shape == "loop"
    first = max(length * 0.3 + 4, 16.0) if is_loop else length * 0.4 + 12
    side = max(length * 0.2, 12.0) if is_loop else length * 0.3 + 3
    end = width + side
    arms = [(0.0, width, width, end), (first - width, width, first, end)]
    joint = [(0.0, end, first, 2 * width + side)] if is_loop else []
    return [(0.0, 0.0, first, width), *arms, *joint]


def _cut(leg: Rectangle, count: int, rng: np.random.Generator) -> list[Rectangle]:
    """Cut a leg across into pieces with thin walls between; its ends keep off legs they meet."""
    x0, y0, x1, y1 = leg
    along_x = x1 - x0 > y1 - y0
    low, high = (x0, x1) if along_x else (y0 + _WALL, y1 - _WALL)
    cuts = low + (high - low) * (np.arange(1, count) + rng.uniform(-0.15, 0.15, count - 1)) / count

    half = _WALL / 2
    starts = [low, *(cut + half for cut in cuts.tolist())]
    ends = [*(cut - half for cut in cuts.tolist()), high]
    spans = zip(starts, ends, strict=True)
    return [(a, y0, b, y1) if along_x else (x0, a, x1, b) for a, b in spans]


def join_corridors(halls: list[Space], height: float, rng: np.random.Generator) -> bool:
    """Open passages between corridors that meet and give each its ceiling.

    Args:
        halls: The corridors; get openings and ceilings.
        height: That of the building's rooms, metres.
        rng: Random numbers.

    Returns:
        Whether one can walk from each to every other.
    """
    network = list(range(len(halls)))  # number of the part of the network that each belongs to
    lowered = rng.uniform(0.0, 0.35)
    for hall in halls:
        hall.ceiling = max(height - lowered, 2.45)

    for number, first in enumerate(halls):
        for other in range(number + 1, len(halls)):
            second = halls[other]
            side, low, high, gap = facing(first.box, second.box)
            if side < 0 or gap > 0.2 or high - low < 1.4:
                continue

            # as high and wide as the corridor, or less
            header = rng.uniform(0.2, 0.4) if rng.random() < 0.5 and height - lowered > 2.6 else 0.0
            inset = rng.uniform(0.05, 0.2) if rng.random() < 0.4 else 0.0
            top = first.ceiling - header
            opening = Opening("passage", side, low + inset, high - inset, 0.0, top, depth=gap / 2)
            first.openings.append(opening)
            second.openings.append(replace(opening, side=(side + 2) % 4))

            kept, dropped = network[number], network[other]
            network = [kept if part == dropped else part for part in network]
    return len(set(network)) == 1
