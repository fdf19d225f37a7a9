"""Objects in their places: where they stand, the tops that hold others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mcpseg_cli.synth.geometry.collisions import Boxes, boxes_of, extent
from mcpseg_cli.synth.geometry.shapes import Points
from mcpseg_cli.synth.geometry.solids import Item

Pose = tuple[float, float, float, float]
"""x, y, z of the origin of an object's own frame, metres, map frame, and yaw, radians."""


@dataclass(frozen=True)
class Placed:
    """An object, or one with the things on it, that found its place.

    Attributes:
        items: The objects in the map frame; the first is the main one.
        size: (3,) its width, depth and height in its own frame, metres.
        x: Where the origin of its own frame (the middle of its back) lies, map frame.
        y: The same along y.
        z: The same along z.
        yaw: How it is turned, radians.
    """

    items: tuple[Item, ...]
    size: Points
    x: float
    y: float
    z: float
    yaw: float

    @cached_property
    def top(self) -> tuple[float, Points] | None:
        """Height of the largest level surface of the main object, and its triangles from above.

        (T, 3, 2) triangles; None if it has no such surface of at least 0.02 square metres.
        """
        return _top_of(self.items[0])

    def at(self, along: float, out: float) -> tuple[float, float]:
        """Return the map x and y of a spot in its own frame."""
        cosine, sine = np.cos(self.yaw), np.sin(self.yaw)
        x, y = self.x + cosine * along - sine * out, self.y + sine * along + cosine * out
        return float(x), float(y)


def about_centre(item: Item, x: float, y: float, yaw: float, z: float = 0.0) -> Pose:
    """Return the pose that brings the middle of an object's foot to a spot."""
    corners = extent(boxes_of(item))
    out = float(corners[0, 1] + corners[1, 1]) / 2
    return x + np.sin(yaw) * out, y - np.cos(yaw) * out, z, yaw


def width_of(items: Sequence[Item]) -> float:
    """Return the width of items along x, symmetric about their frame's origin."""
    corners = extent(np.concatenate([boxes_of(item) for item in items]))
    return float(2 * np.abs(corners[:, 0]).max())


def _top_of(item: Item) -> tuple[float, Points] | None:
    """Return the largest level surface of an object; high ones are preferred."""
    # level triangles that face up
    triangles = np.concatenate([part.triangles for part in item.parts])
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    area = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    level = (np.ptp(triangles[..., 2], axis=1) < 1e-4) & (area > 1e-6)
    if not level.any():
        return None

    # those of one height, the highest counting for more
    heights = np.round(triangles[level, 0, 2], 3)
    values, which = np.unique(heights, return_inverse=True)
    areas = np.bincount(which, area[level])
    best = int(np.argmax(areas + 0.3 * areas.max() * (values == values.max())))
    chosen = triangles[level][which == best]
    return (float(chosen[0, 0, 2]), chosen[..., :2]) if areas[best] >= 0.02 else None


def holds(support: Placed, boxes: Boxes, z: float) -> bool:
    """Tell whether the corners of what touches a support's top at z all lie on it."""
    top = support.top
    if top is None or abs(top[0] - z) > 1e-3:
        return False

    # corners and middle of the foot
    feet = boxes[boxes[:, 6] < z + 0.012]
    corners = extent(feet)[:, :2]
    around = [[corners[a, 0], corners[b, 1]] for a in (0, 1) for b in (0, 1)]
    spots = np.array([*around, corners.mean(axis=0)])

    # each has to lie in one of the top's triangles
    a, b, c = top[1][:, 0], top[1][:, 1], top[1][:, 2]
    inside = np.ones((len(spots), len(a)), bool)
    for first, last in ((a, b), (b, c), (c, a)):
        edge, step = last - first, spots[:, None] - first
        inside &= edge[:, 0] * step[..., 1] - edge[:, 1] * step[..., 0] >= -1e-9
    return bool(inside.any(axis=1).all())
