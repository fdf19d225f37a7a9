"""Which boxes meet: upright boxes turned about the z axis, thousands of them against a few."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.synth.geometry.solids import Item

Boxes = NDArray[np.float64]
"""(N, 8): centre x, y; cosine and sine of the yaw; half sizes along its x, y; its z range."""


def boxes_of(item: Item) -> Boxes:
    """Return the boxes of an object's parts, (P, 8), in the frame the object stands in."""
    low = np.array([part.low for part in item.parts])
    high = np.array([part.high for part in item.parts])
    origin = np.array([part.origin for part in item.parts])
    yaw = np.array([part.yaw for part in item.parts])
    cosine, sine = np.cos(yaw), np.sin(yaw)
    middle, half = (low + high) / 2, (high - low) / 2

    # from the part's own frame into the object's
    x = cosine * middle[:, 0] - sine * middle[:, 1] + origin[:, 0]
    y = sine * middle[:, 0] + cosine * middle[:, 1] + origin[:, 1]
    bottom, top = low[:, 2] + origin[:, 2], high[:, 2] + origin[:, 2]
    return np.column_stack([x, y, cosine, sine, half[:, :2], bottom, top])


def upright(low: NDArray[np.float64], high: NDArray[np.float64]) -> Boxes:
    """Return one box, (1, 8), between two corners, (3,) each."""
    middle, half = (low + high) / 2, (high - low) / 2
    return np.array([[middle[0], middle[1], 1.0, 0.0, half[0], half[1], low[2], high[2]]])


def moved(boxes: Boxes, x: float, y: float, z: float, yaw: float) -> Boxes:
    """Return the boxes turned about the z axis, then shifted."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    result = boxes.copy()
    result[:, 0] = cosine * boxes[:, 0] - sine * boxes[:, 1] + x
    result[:, 1] = sine * boxes[:, 0] + cosine * boxes[:, 1] + y
    result[:, 2] = cosine * boxes[:, 2] - sine * boxes[:, 3]
    result[:, 3] = sine * boxes[:, 2] + cosine * boxes[:, 3]
    result[:, 6:] += z
    return result


def extent(boxes: Boxes) -> NDArray[np.float64]:
    """Return the (2, 3) corners of what the boxes fill."""
    reach, corners = reach_of(boxes), np.empty((2, 3))
    corners[0, :2], corners[0, 2] = (boxes[:, :2] - reach).min(axis=0), boxes[:, 6].min()
    corners[1, :2], corners[1, 2] = (boxes[:, :2] + reach).max(axis=0), boxes[:, 7].max()
    return corners


def reach_of(boxes: Boxes) -> NDArray[np.float64]:
    """Return how far each box reaches from its centre along x and y, (N, 2)."""
    cosine, sine = np.abs(boxes[:, 2]), np.abs(boxes[:, 3])
    reach = np.empty((len(boxes), 2))
    reach[:, 0] = cosine * boxes[:, 4] + sine * boxes[:, 5]
    reach[:, 1] = sine * boxes[:, 4] + cosine * boxes[:, 5]
    return reach


class Collisions:
    """Boxes that are there already; asked for those that a new one would meet."""

    def __init__(self, slack: float = 0.002) -> None:
        """Start empty; boxes that overlap by less than ``slack`` metres do not meet."""
        self._slack = slack
        self._boxes: Boxes = np.empty((256, 8))
        self._reach: NDArray[np.float64] = np.empty((256, 2))
        self._count = 0

    def add(self, boxes: Boxes) -> None:
        """Enter boxes, (N, 8)."""
        total = self._count + len(boxes)
        while total > len(self._boxes):
            self._boxes = np.concatenate([self._boxes, np.empty_like(self._boxes)])
            self._reach = np.concatenate([self._reach, np.empty_like(self._reach)])
        self._boxes[self._count : total] = boxes
        self._reach[self._count : total] = reach_of(boxes)
        self._count = total

    def meets(self, boxes: Boxes) -> bool:
        """Tell whether any of the boxes, (P, 8), meets one that is there."""
        corners = extent(boxes)
        there, reach = self._boxes[: self._count], self._reach[: self._count]

        # those whose outlines come near at all
        middle, half = (corners[0] + corners[1])[:2] / 2, (corners[1] - corners[0])[:2] / 2
        near = (np.abs(there[:, :2] - middle) < reach + half).all(axis=1)
        near &= (there[:, 6] < corners[1, 2]) & (there[:, 7] > corners[0, 2])
        rows = np.flatnonzero(near)
        return len(rows) > 0 and bool(_overlap(boxes, there[rows], self._slack).any())


def _overlap(first: Boxes, second: Boxes, slack: float) -> NDArray[np.bool_]:
    """Return which of P boxes meet which of N, (P, N)."""
    a, b = first[:, None], second[None]
    step = b[..., :2] - a[..., :2]
    cosine = np.abs(a[..., 2] * b[..., 2] + a[..., 3] * b[..., 3])
    sine = np.abs(a[..., 2] * b[..., 3] - a[..., 3] * b[..., 2])

    # heights, then the separating axes of both
    shared = np.minimum(a[..., 7], b[..., 7]) - np.maximum(a[..., 6], b[..., 6])
    met: NDArray[np.bool_] = shared > slack
    for one, other in ((a, b), (b, a)):
        along = np.abs(step[..., 0] * one[..., 2] + step[..., 1] * one[..., 3])
        across = np.abs(step[..., 1] * one[..., 2] - step[..., 0] * one[..., 3])
        met &= along < one[..., 4] + other[..., 4] * cosine + other[..., 5] * sine - slack
        met &= across < one[..., 5] + other[..., 4] * sine + other[..., 5] * cosine - slack
    return met
