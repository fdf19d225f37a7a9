"""Rigid motions: 4 x 4 matrices of a rotation and a translation, and those between two of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from mcpseg_cli.errors import InputError

UNIT_TOLERANCE = 0.02
"""Of a quaternion's norm or a rotation matrix's columns."""
LONGEST_GAP_NS = 500_000_000
"""Nanoseconds between two poses up to which a moment between them has a pose."""
NEAREST_NS = 20_000_000
"""Nanoseconds up to which a pose before the first, after the last or at a gap's edge will do."""


@dataclass(frozen=True)
class Trajectory:
    """Poses over time.

    Attributes:
        times_ns: (P,) int64 nanoseconds, ascending.
        poses: (P, 4, 4) float64.
    """

    times_ns: NDArray[np.int64]
    poses: NDArray[np.float64]

    @classmethod
    def of(cls, times_ns: NDArray[np.int64], poses: NDArray[np.float64]) -> Trajectory:
        """Sort poses by time; of several at one moment the last counts."""
        order = np.argsort(times_ns, kind="stable")
        times, sorted_poses = times_ns[order], poses[order]
        last = np.append(np.diff(times) > 0, True)[: len(times)]
        return cls(times[last], sorted_poses[last])

    def at(self, time_ns: int) -> NDArray[np.float64] | None:
        """Return the pose at a moment, see ``pose_at``."""
        return pose_at(self.times_ns, self.poses, time_ns)


def pose_at(
    times_ns: NDArray[np.int64], poses: NDArray[np.float64], time_ns: int
) -> NDArray[np.float64] | None:
    """Find the pose at a moment: that of the moment itself, else between its neighbours.

    Args:
        times_ns: (P,) int64 nanoseconds, ascending.
        poses: (P, 4, 4) float64.
        time_ns: The moment.

    Returns:
        (4, 4) float64: the very pose of that moment; or position linearly and orientation
        spherically interpolated over at most ``LONGEST_GAP_NS``; or the nearest within
        ``NEAREST_NS``; else None.
    """
    if len(times_ns) == 0:
        return None
    after = int(np.searchsorted(times_ns, time_ns))
    if after < len(times_ns) and times_ns[after] == time_ns:
        exact: NDArray[np.float64] = poses[after]
        return exact

    # between two
    if 0 < after < len(times_ns):
        gap = int(times_ns[after] - times_ns[after - 1])
        if gap <= LONGEST_GAP_NS:
            share = (time_ns - int(times_ns[after - 1])) / gap
            return between(poses[after - 1], poses[after], share)

    # near one
    near = [row for row in (after - 1, after) if 0 <= row < len(times_ns)]
    row = min(near, key=lambda one: abs(int(times_ns[one]) - time_ns))
    nearest: NDArray[np.float64] = poses[row]
    return nearest if abs(int(times_ns[row]) - time_ns) <= NEAREST_NS else None


def between(
    first: NDArray[np.float64], second: NDArray[np.float64], share: float
) -> NDArray[np.float64]:
    """Return the pose that far between two (4, 4), 0 to 1: linear and spherical."""
    pose = np.eye(4)
    pose[:3, 3] = (1 - share) * first[:3, 3] + share * second[:3, 3]
    turns = Rotation.from_matrix(np.stack([first[:3, :3], second[:3, :3]]))
    pose[:3, :3] = Slerp([0.0, 1.0], turns)(share).as_matrix()
    return pose


def is_lost(position: list[float], quaternion: list[float]) -> bool:
    """Tell whether a pose is what tools write while tracking is lost: not finite, or no turn."""
    return not np.isfinite([*position, *quaternion]).all() or not any(quaternion)


def from_quaternion(
    path: Path, position: list[float], quaternion: list[float], name: str
) -> NDArray[np.float64]:
    """Build a pose (4, 4) from a position and a quaternion x y z w.

    Raises:
        InputError: The quaternion is not of unit length; ``name`` says which pose it is of.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        length = float(np.linalg.norm(quaternion))
    if not abs(length - 1) < UNIT_TOLERANCE:
        found = f"{name} has a quaternion of length {length:.3g}"
        raise InputError(path, found, "a unit quaternion qx qy qz qw", "record it again")
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
    pose[:3, 3] = position
    return pose


def check_rotations(path: Path, poses: NDArray[np.float64], name_of: Callable[[int], str]) -> None:
    """Refuse matrices that are no rotation and translation.

    Args:
        path: Where they are from.
        poses: (P, 4, 4) float64.
        name_of: What to call one of them.

    Raises:
        InputError: Names the first that is none.
    """
    wrong = np.flatnonzero(~are_rotations(poses[:, :3, :3]))
    if len(wrong):
        found = f"{name_of(int(wrong[0]))} is no rotation and translation"
        raise InputError(path, found, "a 4 x 4 matrix of both", "check how it was written")


def are_rotations(matrices: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which (P, 3, 3) matrices are rotations, but for rounding; (P,) bool."""
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        residual = np.abs(matrices @ matrices.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        rigid: NDArray[np.bool_] = (residual < UNIT_TOLERANCE) & (np.linalg.det(matrices) > 0)
    return rigid
