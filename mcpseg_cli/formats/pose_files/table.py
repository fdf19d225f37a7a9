"""Pose tables: a row a pose, with a header, a comment that stands for one, or neither."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.pose_files.columns import (
    ANGLES,
    MATRIX,
    POSITION,
    QUATERNION,
    Columns,
    columns_of,
)
from mcpseg_cli.formats.pose_files.matrices import (
    Lost,
    from_angles,
    from_matrices,
    from_positions,
    from_quaternions,
)
from mcpseg_cli.formats.pose_files.statement import (
    Statement,
    check_complete,
    judged,
    stated_by_comment,
    stated_by_header,
)
from mcpseg_cli.formats.pose_files.text import separator_of, split_words, to_moment, to_number
from mcpseg_cli.formats.poses import Poses
from mcpseg_cli.formats.time_stamps import in_seconds

_NO_NUMBER = re.compile(r"[-+]?(?:nan|inf(?:inity)?)(?:\([a-z]*\))?|[-+]?1\.#\w+", re.IGNORECASE)
_NOTHING = {"", "-", "null", "none", "na", "n/a"}
_MOST_PREAMBLE = 20  # lines
_FULL_TURN = 2 * math.pi + 0.01  # angles beyond a full turn of radians are degrees


@dataclass(frozen=True)
class _Rows:
    """The data of a table: lines of the file and their words, all as many."""

    path: Path
    numbers: list[int]
    words: list[list[str]]

    def column(self, place: int) -> list[str]:
        """Return the words of one column."""
        return [words[place] for words in self.words]


def read_table(
    path: Path, data: list[tuple[int, str]], comments: Sequence[tuple[int, str]]
) -> Poses:
    """Read a table of poses.

    Args:
        path: The file, for messages.
        data: Numbers and texts of the lines that are no comments, at least one.
        comments: Those of the comments.

    Raises:
        InputError: The columns cannot be told, or a line does not fit.
    """
    data = _from_header(data)

    # a header, a comment that says what the columns are, or what their numbers show
    _, first = data[0]
    header = split_words(re.sub(r"\s+(?=\[)", "", first), separator_of(first))
    if len(header) > 1 and not header[-1]:  # a separator at the end
        header.pop()
    statement = stated_by_header(header, "its header says")
    if statement is None and not _is_data(header):
        statement = Statement(columns_of(header), "")
    if statement:
        check_complete(path, statement.columns)
        rows = _rows_of(path, data[1:], len(header), "in the header")
        return _build(rows, statement)

    separator = separator_of(first)
    rows = _rows_of(path, data, len(header), "before it")
    statement = stated_by_comment(comments, len(header), separator)
    if statement:
        check_complete(path, statement.columns)
    else:
        statement = judged(path, rows.words, comments, separator)
    return _build(rows, statement)


def _from_header(data: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Leave out what some programs write above the header: their name, a date."""
    for place, (_, line) in enumerate(data[:_MOST_PREAMBLE]):
        words = split_words(line, separator_of(line))
        if _is_data(words):
            return data
        if stated_by_header(words, ""):
            return data[place:]
    return data


def _is_data(words: list[str]) -> bool:
    """Tell a row of data from a header: most of its words are numbers."""
    numbers = [to_number(word) is not None or to_moment(word) is not None for word in words]
    return sum(numbers) >= min(3, len(words)) and sum(numbers) > len(words) / 2


def _rows_of(path: Path, lines: list[tuple[int, str]], num_columns: int, where: str) -> _Rows:
    """Part lines into words, as many in each."""
    if not lines:
        raise InputError(path, "a header and no poses", "a line for each scan", "add the poses")
    separator = separator_of(lines[0][1])
    words = [split_words(line, separator) for _, line in lines]
    for (number, _), row in zip(lines, words, strict=True):
        if len(row) == num_columns + 1 and not row[-1]:
            row.pop()
        if len(row) != num_columns:
            found = f"line {number} has {len(row)} columns"
            raise InputError(path, found, f"{num_columns} as {where}", "mend the line")
    return _Rows(path, [number for number, _ in lines], words)


def _build(rows: _Rows, statement: Statement) -> Poses:
    """Make poses of a table whose columns are known."""
    columns = statement.columns
    if columns.has(MATRIX):
        wanted: tuple[str, ...] = MATRIX
    elif columns.has(QUATERNION):
        wanted = (*POSITION, *QUATERNION)
    else:
        wanted = (*POSITION, *(ANGLES if columns.has(ANGLES) else ()))
    values, lost = _numbers(rows, columns.of(wanted))

    # as many ways to say how it is turned
    path, numbers = rows.path, rows.numbers
    if columns.has(MATRIX):
        poses = from_matrices(path, numbers, values, lost)
    elif columns.has(QUATERNION):
        poses = from_quaternions(path, numbers, values[:, :3], values[:, 3:], lost)
    elif columns.has(ANGLES):
        angles = _in_radians(path, columns, values[:, 3:])
        poses = from_angles(values[:, :3], angles, lost)
    else:
        poses = from_positions(values)
        poses[list(lost)] = np.nan

    labelled = _labels(rows, columns)
    has_rotation = len(wanted) > len(POSITION)
    return _without_repetition(path, Poses(poses, *labelled, has_rotation, lost, statement.told))


def _labels(
    rows: _Rows, columns: Columns
) -> tuple[tuple[str, ...] | None, NDArray[np.float64] | None, NDArray[np.int64] | None]:
    """Read names, time stamps and numbers of the rows."""
    scans = tuple(rows.column(columns.places["scan"])) if "scan" in columns.places else None
    stamps = _stamps(rows, columns) if "stamp" in columns.places else None
    ids = None
    if "id" in columns.places:
        words = rows.column(columns.places["id"])
        if all(re.fullmatch(r"\d{1,15}", word) for word in words):
            ids = np.array(words, np.int64)
        elif scans is None and len(set(words)) == len(words):
            scans = tuple(words)
    return scans, stamps, ids


def _stamps(rows: _Rows, columns: Columns) -> NDArray[np.float64]:
    """Read time stamps as seconds; their unit is stated, or as large as they are."""
    place = columns.places["stamp"]
    words = rows.column(place)
    numbers = [to_number(word) for word in words]
    values = np.empty(len(words))
    for row, x in enumerate(numbers):
        value = to_moment(words[row]) if x is None else x
        if value is None or not math.isfinite(value):
            found = f"{words[row][:40]!r} in line {rows.numbers[row]}, column {place + 1}"
            raise InputError(rows.path, found, "a time stamp", "mend the line")
        values[row] = value
    if None in numbers:
        return values
    if "nsec" in columns.places:
        parts = [to_number(word) or 0.0 for word in rows.column(columns.places["nsec"])]
        return values + 1e-9 * np.array(parts)
    return in_seconds(values, columns.unit)


def _in_radians(path: Path, columns: Columns, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Tell degrees from radians, by what is stated or by their size."""
    is_degrees = columns.is_degrees
    if is_degrees is None:
        is_degrees = bool(np.nanmax(np.abs(angles)) > _FULL_TURN)
        if not is_degrees and np.nanmax(np.abs(angles)) > 0:
            found = "roll, pitch, yaw without a unit, none beyond 2 pi"
            expected = "degrees or radians, and which of them"
            raise InputError(path, found, expected, "name the columns roll_deg … or roll_rad …")
    return np.radians(angles) if is_degrees else angles


def _numbers(rows: _Rows, places: list[int]) -> tuple[NDArray[np.float64], Lost]:
    """Parse the numbers of some columns; rows that say that there is none are lost."""
    flat = [row[place] for row in rows.words for place in places]
    try:
        values = np.array(list(map(float, flat))).reshape(-1, len(places))
    except ValueError:
        values = np.full((len(rows.words), len(places)), np.nan)
    else:
        if np.isfinite(values).all():
            return values, {}

    # word by word
    lost: Lost = {}
    for row, words in enumerate(rows.words):
        own = [words[place] for place in places]
        numbers = [to_number(word) for word in own]
        if any(_NO_NUMBER.fullmatch(word) for word in own):
            word = next(word for word in own if _NO_NUMBER.fullmatch(word))
            lost[row] = f"{word} in line {rows.numbers[row]}"
        elif all(word.lower() in _NOTHING for word in own):
            lost[row] = f"nothing in line {rows.numbers[row]}"
        for place, word, x in zip(places, own, numbers, strict=True):
            if row not in lost and (x is None or not math.isfinite(x)):
                found = f"{word[:40]!r} in line {rows.numbers[row]}, column {place + 1}"
                raise InputError(rows.path, found, "a finite number", "mend the line")
        if row not in lost:
            values[row] = np.array(numbers, float)
    values[list(lost)] = np.nan
    return values, lost


def _without_repetition(path: Path, poses: Poses) -> Poses:
    """Drop rows that say the same again; a scan has one row."""
    if poses.stamps is not None and len(poses) > 1 and len(np.unique(poses.stamps)) == 1:
        poses = replace(poses, stamps=None)  # what is the same everywhere is no time
    if poses.scans is None and poses.stamps is None and poses.ids is None:
        return poses
    seen: dict[tuple[object, ...], int] = {}
    kept = []
    for row in range(len(poses)):
        name = None if poses.scans is None else poses.scans[row]
        stamp = None if poses.stamps is None else float(poses.stamps[row])
        key = (name, stamp, None if poses.ids is None else int(poses.ids[row]))
        before = seen.get(key)
        if before is not None and np.array_equal(
            poses.poses[before], poses.poses[row], equal_nan=True
        ):
            continue
        seen.setdefault(key, row)
        kept.append(row)
    poses = poses.select(np.array(kept, np.intp))

    names = poses.scans or ()
    is_told_otherwise = poses.stamps is not None or poses.ids is not None
    if len(set(names)) != len(names) and not (len(set(names)) == 1 and is_told_otherwise):
        repeated = next(name for name in names if names.count(name) > 1)
        found = f"scan {repeated} appears {names.count(repeated)} times"
        raise InputError(path, found, "one row a scan", "remove all but one")

    # what is the same everywhere names nothing
    if len(set(names)) != len(names):
        poses = replace(poses, scans=None)
    if poses.ids is not None and len(np.unique(poses.ids)) != len(poses):
        poses = replace(poses, ids=None)
    return poses
