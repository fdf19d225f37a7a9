"""Whether scans lie on one another: as they are, when moved by their poses, or neither."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Placement = Literal["as they are", "by the poses", "by the inverse poses", "by camera poses"]
"""How scans may be brought together."""

_CAMERA = np.array(  # from a lidar (x forwards, z up) to a camera (z forwards, y down)
    [[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
)
_PLACEMENTS: tuple[Placement, ...] = get_args(Placement)
_CELLS = 40  # within the usual range: how evenly, and how finely, scans are compared
_SPARSE = 4.0  # cells: the sparsest that points may lie and yet coincide
_FEWEST = 0.3  # of a scan's points: fewer within the other's bounds count as if they were as many
_MOST_POINTS = 40_000  # of a scan that are searched in
_MOST_ASKED = 1_500  # of a scan that are searched for
_MIN_POINTS = 100
_CLEAR, _AHEAD = 1.25, 0.1  # how much better the best placement is than the next
_MOVED = 0.15  # of the usual range: how far a sensor moves between scans of a pair
_TURN = np.cos(np.radians(12.0))  # or how far it turns


@dataclass(frozen=True)
class Coincidence:
    """How well scans lie on one another.

    Attributes:
        shares: Share of points that lie on another scan's, 0-1, by placement.
        num_pairs: Pairs of scans that were compared; without any, shares are 0.
    """

    shares: dict[Placement, float]
    num_pairs: int

    @property
    def best(self) -> Placement | None:
        """The placement that is clearly better than the others; None where none is."""
        if not self.num_pairs:
            return None
        ordered = sorted(self.shares, key=lambda name: -self.shares[name])
        first, second = self.shares[ordered[0]], self.shares[ordered[1]]
        return ordered[0] if first >= _CLEAR * second and first - second >= _AHEAD else None


def compare_scans(
    scans: Sequence[NDArray[np.floating]], poses: Sequence[NDArray[np.float64]]
) -> Coincidence:
    """Compare scans with one another in pairs that the sensor moved or turned between.

    Args:
        scans: (N, 3) points of each, in the file's frame.
        poses: (4, 4) of each, in the same unit.

    Returns:
        Means over the pairs.
    """
    found: list[dict[Placement, float]] = []
    for first, second in _pairs(scans, poses):
        found.append(_compare(scans[first], scans[second], poses[first], poses[second]))
    shares = {
        name: float(np.mean([pair[name] for pair in found])) if found else 0.0
        for name in _PLACEMENTS
    }
    return Coincidence(shares, len(found))


def _pairs(
    scans: Sequence[NDArray[np.floating]], poses: Sequence[NDArray[np.float64]]
) -> list[tuple[int, int]]:
    """Choose pairs that are near and yet apart, each scan with the next such one."""
    usable = [number for number, xyz in enumerate(scans) if len(xyz) >= _MIN_POINTS]
    pairs = []
    for place, first in enumerate(usable):
        for second in usable[place + 1 :]:
            reach = _usual_range(scans[second])
            moved = float(np.linalg.norm(poses[first][:3, 3] - poses[second][:3, 3]))
            cosine = (np.trace(poses[first][:3, :3].T @ poses[second][:3, :3]) - 1) / 2
            if moved > _MOVED * reach or cosine < _TURN:
                pairs.append((first, second))
                break
    return pairs


def _usual_range(xyz: NDArray[np.floating]) -> float:
    """Give the half-width of a scan, whatever its frame."""
    return float(np.median(np.linalg.norm(xyz - np.median(xyz, axis=0), axis=1)))


def _compare(
    first: NDArray[np.floating],
    second: NDArray[np.floating],
    pose_first: NDArray[np.float64],
    pose_second: NDArray[np.float64],
) -> dict[Placement, float]:
    """Give the share of the second scan's points that lie on the first's, by placement."""
    # both as evenly dense as each other
    edge = max(_usual_range(second), 1e-9) / _CELLS
    kept = _thinned(first, edge)
    tree = cKDTree(kept)
    spacing = np.clip(tree.query(kept, k=min(4, len(kept)))[0][:, -1], edge, _SPARSE * edge)
    asked = _thinned(second, edge)
    asked = asked[:: max(1, len(asked) // _MOST_ASKED)]
    low, high = kept.min(axis=0) - edge, kept.max(axis=0) + edge  # others have nothing to lie on

    moves: dict[Placement, NDArray[np.float64]] = {
        "as they are": np.eye(4),
        "by the poses": np.linalg.inv(pose_first) @ pose_second,
        "by the inverse poses": pose_first @ np.linalg.inv(pose_second),
        "by camera poses": np.linalg.inv(pose_first @ _CAMERA) @ pose_second @ _CAMERA,
    }
    shares: dict[Placement, float] = {}
    for name, move in moves.items():
        moved = asked @ move[:3, :3].T + move[:3, 3]
        inside = ((moved >= low) & (moved <= high)).all(axis=1)
        distance, nearest = tree.query(moved[inside])
        num_near = int((distance <= spacing[nearest]).sum())
        shares[name] = num_near / max(int(inside.sum()), _FEWEST * len(moved))
    return shares


def _thinned(xyz: NDArray[np.floating], edge: float) -> NDArray[np.float64]:
    """Keep one point in each cell of a grid; (M, 3)."""
    some = xyz[:: max(1, len(xyz) // _MOST_POINTS)].astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        cell = np.floor((some - some.min(axis=0)) / edge).astype(np.int64)
    key = (cell[:, 0] * 1_000_003 + cell[:, 1]) * 1_000_003 + cell[:, 2]
    return some[np.unique(key, return_index=True)[1]]
