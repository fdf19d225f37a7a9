"""Poses from quaternions, angles and matrices, with what makes none of them refused or lost."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.rigid import UNIT_TOLERANCE, are_rotations

Lost = dict[int, str]


def from_positions(position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Build (P, 4, 4) poses that look along the map's axes from (P, 3) positions."""
    poses = np.tile(np.eye(4), (len(position), 1, 1))
    poses[:, :3, 3] = position
    return poses


def from_quaternions(
    path: Path,
    numbers: list[int],
    position: NDArray[np.float64],
    quaternion: NDArray[np.float64],
    lost: Lost,
) -> NDArray[np.float64]:
    """Build poses from positions and quaternions.

    Args:
        path: The file, for messages.
        numbers: Its line of each row.
        position: (P, 3), metres, map frame.
        quaternion: (P, 4), x y z w.
        lost: Why rows have no pose; rows of a quaternion of zeros are added.

    Returns:
        (P, 4, 4), NaN in lost rows.

    Raises:
        InputError: A quaternion is not of unit length, but for rounding.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        norms = np.linalg.norm(quaternion, axis=1)
    for row in np.flatnonzero(norms == 0).tolist():
        lost.setdefault(row, f"a quaternion of zeros in line {numbers[row]}")
    used = _used(len(position), lost)
    wrong = used[~(np.abs(norms[used] - 1.0) < UNIT_TOLERANCE)]
    if len(wrong):
        found = f"quaternion of length {norms[wrong[0]]:.3g} in line {numbers[wrong[0]]}"
        raise InputError(path, found, "a unit quaternion qx qy qz qw", "check the column order")

    poses = np.full((len(position), 4, 4), np.nan)
    poses[used] = from_positions(position[used])
    if len(used):
        poses[used, :3, :3] = Rotation.from_quat(quaternion[used]).as_matrix()
    return poses


def from_angles(
    position: NDArray[np.float64], angles: NDArray[np.float64], lost: Lost
) -> NDArray[np.float64]:
    """Build (P, 4, 4) poses from (P, 3) roll, pitch, yaw in radians: about x, then y, then z."""
    used = _used(len(position), lost)
    poses = np.full((len(position), 4, 4), np.nan)
    poses[used] = from_positions(position[used])
    if len(used):
        poses[used, :3, :3] = Rotation.from_euler("xyz", angles[used]).as_matrix()
    return poses


def from_matrices(
    path: Path, numbers: list[int], rows: NDArray[np.float64], lost: Lost
) -> NDArray[np.float64]:
    """Build poses from the first three rows of their matrices.

    Args:
        path: The file, for messages.
        numbers: Its line of each row.
        rows: (P, 12), row by row of the matrix.
        lost: Why rows have no pose; rows of zeros are added.

    Returns:
        (P, 4, 4), NaN in lost rows.

    Raises:
        InputError: No rotation, but for rounding, or a mirror.
    """
    for row in np.flatnonzero(~rows.any(axis=1)).tolist():
        lost.setdefault(row, f"only zeros in line {numbers[row]}")
    used = _used(len(rows), lost)
    wrong = used[~are_rigid(rows[used])]
    if len(wrong):
        found = f"line {numbers[wrong[0]]} is no rotation and translation"
        raise InputError(path, found, "r11 r12 r13 tx r21 … tz", "check the column order")
    poses = np.full((len(rows), 4, 4), np.nan)
    poses[used] = np.eye(4)
    poses[used, :3, :] = rows[used].reshape(-1, 3, 4)
    return poses


def are_rigid(rows: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which (P, 12) rows are a rotation, but for rounding, and a translation; (P,) bool."""
    return are_rotations(rows.reshape(-1, 3, 4)[:, :, :3])


def are_unit(quaternion: NDArray[np.float64]) -> bool:
    """Tell whether all (P, 4) quaternions that are finite and not zero have unit length."""
    with np.errstate(over="ignore", invalid="ignore"):
        norms = np.linalg.norm(quaternion, axis=1)
    norms = norms[np.isfinite(quaternion).all(axis=1) & (norms > 0)]
    return len(norms) > 0 and bool((np.abs(norms - 1.0) < UNIT_TOLERANCE).all())


def _used(num_rows: int, lost: Lost) -> NDArray[np.intp]:
    """Return the rows that are not lost."""
    return np.array([row for row in range(num_rows) if row not in lost], np.intp)
