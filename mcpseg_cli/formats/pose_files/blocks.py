"""Poses as 4 x 4 matrices of four lines each, as one array, or one file a pose in a folder."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.natural_order import natural_key
from mcpseg_cli.formats.npy import read_npy
from mcpseg_cli.formats.pose_files.json_poses import ENDING as JSON_ENDING
from mcpseg_cli.formats.pose_files.json_poses import read_frame_files
from mcpseg_cli.formats.pose_files.matrices import Lost, from_matrices
from mcpseg_cli.formats.pose_files.text import (
    read_text,
    separator_of,
    split_comments,
    split_words,
    to_number,
)
from mcpseg_cli.formats.poses import Poses

_TEXTS = (".txt", ".pose", ".csv", ".mat", ".dat", ".tfm", ".tf", "")
_LAST = (0.0, 0.0, 0.0, 1.0)
_MOST_COUNTED = 2.0**53  # what is larger counts nothing
_OPEN3D = "Open3D log, 4 x 4 matrices"


def are_blocks(data: list[tuple[int, str]]) -> bool:
    """Tell whether lines are matrices of four lines each, perhaps with a line of numbers before."""
    rows = [_numbers(line) for _, line in data[:5]]
    is_log = len(data) >= 5 and [len(row) for row in rows] in ([3, 4, 4, 4, 4], [1, 4, 4, 4, 4])
    return is_log or (len(rows) >= 4 and all(len(row) == 4 for row in rows[:4]))


def read_blocks(path: Path, data: list[tuple[int, str]]) -> Poses:
    """Read 4 x 4 matrices that follow one another; Open3D writes their numbers before each.

    Args:
        path: The file, for messages.
        data: Numbers and texts of its lines.

    Raises:
        InputError: A matrix is cut short or none.
    """
    # four lines each, or five
    has_head = len(_numbers(data[0][1])) != 4
    height = 4 + has_head
    if len(data) % height:
        found = f"{len(data):,} lines"
        raise InputError(path, found, f"{height} for each 4 x 4 matrix", "copy the file again")

    numbers, rows, ids = [], [], []
    for first in range(0, len(data), height):
        block = data[first : first + height]
        rows.append(_matrix(path, block[has_head:]))
        numbers.append(block[0][0])
        head = _numbers(block[0][1])
        if not head:
            found = f"{block[0][1].strip()[:40]!r} in line {block[0][0]}"
            raise InputError(path, found, "numbers", "copy the file again")
        ids.append(head[0])
    poses, lost = _poses(path, numbers, rows)
    told = _OPEN3D if has_head else "4 x 4 matrices, one after another"

    # a number that counts the scans, unless it counts something else
    whole = np.array(ids)
    is_count = has_head and (np.abs(whole) < _MOST_COUNTED).all()
    is_count = is_count and len(np.unique(whole)) == len(whole)
    return Poses(poses, ids=whole.astype(np.int64) if is_count else None, lost=lost, columns=told)


def read_array(path: Path) -> Poses:
    """Read a numpy array of (P, 4, 4), (P, 3, 4), (P, 16) or (P, 12) numbers.

    Raises:
        InputError: Of another shape, or no array of numbers.
    """
    expected = "numbers of shape (P, 4, 4), (P, 3, 4), (P, 16) or (P, 12)"
    array = read_npy(path, expected)
    try:
        rows = np.asarray(array, np.float64)
    except (ValueError, TypeError) as error:
        raise InputError(path, "no array of numbers", expected, "save it again") from error
    flat = rows.reshape(len(rows), -1) if rows.ndim in (2, 3) and len(rows) else np.empty((0, 0))
    if flat.shape[1] not in (12, 16) or (rows.ndim == 3 and rows.shape[2] != 4):
        raise InputError(path, f"an array of shape {rows.shape}", expected, "reshape it")
    numbers = list(range(1, len(flat) + 1))
    poses, lost = _poses(path, numbers, list(flat))
    return Poses(poses, lost=lost, columns="an array of matrices")


def read_folder(folder: Path) -> Poses:
    """Read a folder with one file a pose, each called like its scan: a 4 x 4 matrix or ARKit JSON.

    Args:
        folder: Other files and subfolders in it are passed over, as are texts without a number in
            their name, and all but ``NAME.pose.txt`` where there are such.

    Raises:
        InputError: No such file, or one that is no matrix.
    """
    files = [path for path in folder.iterdir() if path.is_file() and path.name[0] != "."]
    files.sort(key=lambda path: natural_key(path.name))
    texts = [path for path in files if path.suffix.lower() in _TEXTS or _is_numbered(path)]
    texts = [path for path in texts if ".pose" in path.name] or texts
    texts = [path for path in texts if re.search(r"\d", path.name)] or texts
    frames = [path for path in files if path.suffix.lower() == JSON_ENDING]
    if not texts and frames:
        return read_frame_files(folder, frames)
    if not texts:
        expected = "a text file with a 4 x 4 matrix for each scan"
        raise InputError(folder, "a folder without pose files", expected, "give the pose file")

    rows = []
    for path in texts:
        lines, _ = split_comments(read_text(path))
        rows.append(_matrix(path, lines))
    lost: Lost = {}
    read = enumerate(zip(texts, rows, strict=True))
    poses = np.concatenate([_one(path, row, number, lost) for number, (path, row) in read])
    names = tuple(path.name for path in texts)
    return Poses(poses, names, lost=lost, columns=f"{len(texts):,} files of a 4 x 4 matrix")


def _one(path: Path, row: NDArray[np.float64], number: int, lost: Lost) -> NDArray[np.float64]:
    """Make the (1, 4, 4) pose of a file; says why it has none under its number."""
    pose, why = _poses(path, [1], [row])
    if why:
        lost[number] = f"{why[0]} of {path.name}"
    return pose


def _is_numbered(path: Path) -> bool:
    """Tell a name that ends in digits behind a dot: a time stamp without an ending."""
    return path.suffix[1:].isdecimal()


def _numbers(line: str) -> list[float]:
    """Read a line of numbers; nothing where one is none."""
    numbers = [to_number(word) for word in split_words(line, separator_of(line))]
    return [x for x in numbers if x is not None] if None not in numbers else []


def _matrix(path: Path, lines: Sequence[tuple[int, str]]) -> NDArray[np.float64]:
    """Read the numbers of one matrix, (12,) or (16,), from lines of four or from one."""
    rows = [_numbers(line) for _, line in lines]
    flat = [x for row in rows for x in row]
    if len(flat) not in (12, 16) or not all(rows):
        number = lines[0][0] if lines else 1
        found = f"{len(flat)} numbers from line {number}"
        raise InputError(path, found, "the 16 of a 4 x 4 matrix", "check that it is a pose file")
    return np.array(flat)


def _poses(
    path: Path, numbers: list[int], rows: list[NDArray[np.float64]]
) -> tuple[NDArray[np.float64], Lost]:
    """Make poses of matrices; those that hold no numbers are lost, none may be anything else."""
    lost: Lost = {}
    for row, values in enumerate(rows):
        if not np.isfinite(values[:12]).all():
            lost[row] = f"a matrix of {values[~np.isfinite(values)][0]} in line {numbers[row]}"
        elif len(values) == 16 and tuple(values[12:]) != _LAST and values.any():
            found = f"a matrix in line {numbers[row]} whose last row is no 0 0 0 1"
            raise InputError(path, found, "4 x 4, row by row", "transpose it")
    upper = np.array([row[:12] for row in rows])
    upper[list(lost)] = np.nan
    return from_matrices(path, numbers, upper, lost), lost
