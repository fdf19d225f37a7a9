"""Which way is up, where floor and ceiling are, as points around a moving sensor show it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import UpAxis

_BINS = 60  # within the usual range
_PLANE = 0.04  # share of all points that makes a floor or a ceiling
_BEYOND = 0.05  # share of all points that may lie beyond it
_FLAT = 0.2  # of the next axis' spread: the spread of positions along the vertical
_MOVED = 0.15  # of the usual range: spread of positions that says something
_UPRIGHT = 0.35  # of the turns about the main axis: turns about others, of an upright sensor
_TURNED = np.radians(20.0)  # turns that say something
_NEARER = 0.8  # of the way to the floor: a ceiling this near is rather the floor


@dataclass(frozen=True)
class Room:
    """Floor and ceiling along one axis, as seen from the sensor.

    Attributes:
        below: How far the floor is below the sensor; None where none is seen.
        above: How far the ceiling is above it; None where none is seen.
    """

    below: float | None
    above: float | None

    @property
    def height(self) -> float | None:
        """From floor to ceiling; None where not both are seen."""
        if self.below is None or self.above is None:
            return None
        return self.below + self.above


def usual_range(around: NDArray[np.floating]) -> float:
    """Return the median distance of (N, 3) points from the sensor at 0."""
    return float(np.median(np.linalg.norm(around, axis=1))) if len(around) else 0.0


def find_room(around: NDArray[np.floating], up: NDArray[np.float64]) -> Room:
    """Find floor and ceiling.

    Args:
        around: (N, 3) points of several scans, each less its sensor's position.
        up: (3,) unit vector that is taken for upwards.
    """
    height = around @ up
    width = max(usual_range(around), 1e-12) / _BINS
    below = _plane(-height[height < 0], len(height), width)
    above = _plane(height[height > 0], len(height), width)
    return Room(below, above)


def _plane(distance: NDArray[np.floating], num_points: int, width: float) -> float | None:
    """Find the outermost layer of points; (N,) distances on one side, positive."""
    if len(distance) < _PLANE * num_points or num_points == 0:
        return None
    farthest = float(np.quantile(distance, 0.998))
    counts = np.bincount(np.minimum(distance / width, farthest / width + 1).astype(np.int64))
    layers = np.convolve(counts, [1, 1, 1], mode="same")
    peak = int(layers.argmax())
    beyond = counts[peak + 3 :].sum() / num_points
    if layers[peak] < _PLANE * num_points or beyond > _BEYOND:
        return None
    nearby = distance[np.abs(distance / width - peak - 0.5) <= 1.5]
    return float(np.median(nearby))


def flat_axis(positions: NDArray[np.float64], reach: float) -> int | None:
    """Find the axis along which a sensor that moves in a plane does not move.

    Args:
        positions: (P, 3) of all scans.
        reach: The usual range of the sensor.

    Returns:
        0 to 2; None where it moves along one line only, hardly, or in all directions.
    """
    if len(positions) < 4:
        return None
    low, high = np.quantile(positions, [0.05, 0.95], axis=0)
    spread = high - low
    order = np.argsort(spread)
    if spread[order[1]] < _MOVED * reach or spread[order[0]] > _FLAT * spread[order[1]]:
        return None
    return int(order[0])


def turning_axis(rotations: NDArray[np.float64]) -> int | None:
    """Find the axis of the map that a carried sensor turns about.

    Args:
        rotations: (P, 3, 3) of all scans, sensor to map.

    Returns:
        0 to 2; None where it hardly turns, or about several axes.
    """
    if len(rotations) < 3:
        return None
    relative = rotations[1:] @ rotations[:-1].transpose(0, 2, 1)
    skew = (relative - relative.transpose(0, 2, 1)) / 2
    axis = np.stack([skew[:, 2, 1], skew[:, 0, 2], skew[:, 1, 0]], axis=1)  # times sin(angle)
    turns = np.abs(axis).sum(axis=0)
    order = np.argsort(turns)[::-1]
    if turns[order[0]] < _TURNED or turns[order[1]] > _UPRIGHT * turns[order[0]]:
        return None
    return int(order[0])


def upward(around: NDArray[np.floating], axis: int) -> int:
    """Tell which way along a vertical axis is up: sensors are nearer to the floor.

    Args:
        around: As for ``find_room``.
        axis: The vertical, 0 to 2.

    Returns:
        1 or -1.
    """
    room = find_room(around, np.eye(3)[axis])
    if room.above is None:
        return 1
    return -1 if room.below is None or room.above < _NEARER * room.below else 1


def axis_name(axis: int, sign: int) -> UpAxis:
    """Name an axis as ``--up`` does."""
    names: Sequence[UpAxis] = ("x", "y", "z") if sign >= 0 else ("-x", "-y", "-z")
    return names[axis]
