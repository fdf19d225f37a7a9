"""Pose tables: CSV with a header, TUM (8 columns), KITTI (12 columns)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mcpseg_cli.errors import InputError

_POSITION = ("x", "y", "z")
_QUATERNION = ("qx", "qy", "qz", "qw")
_CSV_COLUMNS = ("scan", "timestamp", *_POSITION, *_QUATERNION)
_UNIT_TOLERANCE = 0.02  # of a quaternion's norm or a rotation matrix's columns


@dataclass(frozen=True)
class PoseTable:
    """Where the sensor was for each scan.

    Attributes:
        poses: (P, 4, 4) float64, sensor to map, metres.
        scans: Scan names by row, or None when rows pair with scans by order.
        has_rotation: False when the file gave positions only.
    """

    poses: NDArray[np.float64]
    scans: tuple[str, ...] | None = None
    has_rotation: bool = True

    def __len__(self) -> int:
        return len(self.poses)


def read_poses(path: Path) -> PoseTable:
    """Read a pose file; its kind is told by its header or its number of columns.

    Args:
        path: CSV with a header (``scan`` and ``timestamp`` optional, ``x y z`` and perhaps ``qx qy
            qz qw``), TUM (``timestamp x y z qx qy qz qw``) or KITTI (the first three rows of the
            matrix).

    Returns:
        At least one pose.

    Raises:
        InputError: Names the line and column at fault.
        OSError: The file cannot be opened.
    """
    text = path.read_bytes().decode("utf-8-sig", errors="replace")
    if "\0" in text:
        expected = "a text table of poses (CSV, TUM or KITTI)"
        raise InputError(path, "binary data", expected, "give the pose file second")

    # lines that say something
    lines = [(number, line.strip()) for number, line in enumerate(text.splitlines(), start=1)]
    lines = [(number, line) for number, line in lines if line and not line.startswith("#")]
    if not lines:
        remedy = "give a CSV, TUM or KITTI pose file"
        raise InputError(path, "no poses", "a line for each scan", remedy)

    # a header, or as many columns as a kind without one has
    if any(not _is_number(word) for word in _words(lines[0][1])):
        return _read_csv(path, lines)
    num_columns = len(_words(lines[0][1]))
    if num_columns not in (8, 12):
        expected, remedy = "8 (TUM), 12 (KITTI) or a CSV with a header", "add a header line"
        raise InputError(path, f"{num_columns} columns", expected, f"{remedy} or export it again")

    rows = _numbers(path, [(number, _words(line)) for number, line in lines], num_columns)
    numbers = [number for number, _ in lines]
    if num_columns == 8:
        return PoseTable(_from_quaternions(path, numbers, rows[:, 1:4], rows[:, 4:8]))
    return PoseTable(_from_matrices(path, numbers, rows))


def _words(line: str) -> list[str]:
    return [word.strip() for word in line.split(",")] if "," in line else line.split()


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _read_csv(path: Path, lines: list[tuple[int, str]]) -> PoseTable:
    """Read a table whose first line names its columns."""
    header = [name.lower() for name in _words(lines[0][1])]
    unknown = [name for name in header if name not in _CSV_COLUMNS]
    missing = [name for name in _POSITION if name not in header]
    quaternion = [name for name in _QUATERNION if name in header]
    if unknown or missing or len(set(header)) != len(header) or len(quaternion) not in (0, 4):
        found = f"columns {', '.join(header)[:120]}"
        expected = f"{', '.join(_CSV_COLUMNS)} (scan, timestamp and q… optional)"
        raise InputError(path, found, expected, "rename the columns")

    # rows with a word for every column
    rows = [(number, _words(line)) for number, line in lines[1:]]
    if not rows:
        raise InputError(path, "a header and no poses", "a line for each scan", "add the poses")
    for number, words in rows:
        if len(words) != len(header):
            found = f"line {number} has {len(words)} columns"
            raise InputError(path, found, f"{len(header)} as in the header", "mend the line")

    # names are no numbers; the columns behind them keep theirs
    scans = None
    if "scan" in header:
        place = header.index("scan")
        scans = _scan_names(path, [words[place] for _, words in rows])
        rows = [(number, [*words[:place], "0", *words[place + 1 :]]) for number, words in rows]

    # positions, and orientations if there are any
    table = _numbers(path, rows, len(header))
    position = table[:, [header.index(name) for name in _POSITION]]
    if not quaternion:
        poses = np.tile(np.eye(4), (len(rows), 1, 1))
        poses[:, :3, 3] = position
        return PoseTable(poses, scans, has_rotation=False)
    orientation = table[:, [header.index(name) for name in _QUATERNION]]
    numbers = [number for number, _ in rows]
    return PoseTable(_from_quaternions(path, numbers, position, orientation), scans)


def _scan_names(path: Path, names: list[str]) -> tuple[str, ...]:
    """Return the names of the scans, each of which has one row."""
    if len(set(names)) != len(names):
        repeated = next(name for name in names if names.count(name) > 1)
        found = f"scan {repeated} appears {names.count(repeated)} times"
        raise InputError(path, found, "one row a scan", "remove all but one")
    return tuple(names)


def _numbers(
    path: Path, rows: list[tuple[int, list[str]]], num_columns: int
) -> NDArray[np.float64]:
    """Parse every word as a finite number."""
    table = np.empty((len(rows), num_columns))
    for row, (number, words) in enumerate(rows):
        if len(words) != num_columns:
            found = f"line {number} has {len(words)} columns"
            raise InputError(path, found, f"{num_columns} as before it", "mend the line")
        for column, word in enumerate(words):
            if not _is_number(word) or not math.isfinite(float(word)):
                found = f"{word[:40]!r} in line {number}, column {column + 1}"
                raise InputError(path, found, "a finite number", "mend the line")
            table[row, column] = float(word)
    return table


def _from_quaternions(
    path: Path, numbers: list[int], position: NDArray[np.float64], quaternion: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Build (P, 4, 4) poses from positions and quaternions (x, y, z, w)."""
    # unit quaternions, but for rounding
    with np.errstate(over="ignore"):
        norms = np.linalg.norm(quaternion, axis=1)
    wrong = np.flatnonzero(~(np.abs(norms - 1.0) < _UNIT_TOLERANCE))
    if len(wrong):
        row = wrong[0]
        found = f"quaternion of length {norms[row]:.3g} in line {numbers[row]}"
        raise InputError(path, found, "a unit quaternion qx qy qz qw", "check the column order")

    poses = np.tile(np.eye(4), (len(position), 1, 1))
    poses[:, :3, :3] = Rotation.from_quat(quaternion).as_matrix()
    poses[:, :3, 3] = position
    return poses


def _from_matrices(
    path: Path, numbers: list[int], rows: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Build (P, 4, 4) poses from KITTI's twelve numbers a line."""
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :] = rows.reshape(-1, 3, 4)

    # rotations, but for rounding, and no mirrors
    rotation = poses[:, :3, :3]
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        residual = np.abs(rotation @ rotation.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
        mirrored = np.linalg.det(rotation) < 0
    wrong = np.flatnonzero(~(residual < _UNIT_TOLERANCE) | mirrored)
    if len(wrong):
        found = f"line {numbers[wrong[0]]} is no rotation and translation"
        raise InputError(path, found, "r11 r12 r13 tx r21 … tz", "check the column order")
    return poses
