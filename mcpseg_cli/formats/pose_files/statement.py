"""What the columns of a pose table are: as a header or a comment says, or as its numbers show."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
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
from mcpseg_cli.formats.pose_files.matrices import are_rigid, are_unit
from mcpseg_cli.formats.pose_files.text import separator_of, split_words, to_moment, to_number

_W_FIRST = (QUATERNION[3], *QUATERNION[:3])
_TUM = ("stamp", *POSITION, *QUATERNION)
_EUROC_COLUMNS = 17
_NANOSECONDS = 1e17  # time stamps beyond that cannot be anything else
_ROWS_JUDGED = 1000
_FULL = tuple(f"m{row}{column}" for row in range(4) for column in range(4))
_ACROSS = tuple(f"m{row}{column}" for column in range(4) for row in range(4))


@dataclass(frozen=True)
class Statement:
    """What columns are, and how that is known, in words."""

    columns: Columns
    told: str


def stated_by_header(words: Sequence[str], where: str) -> Statement | None:
    """Take words for the names of columns; None where they name no position or matrix."""
    columns = columns_of(words)
    if not (columns.has(POSITION) or columns.has(MATRIX)):
        return None
    used = sorted(columns.places.items(), key=lambda item: item[1])
    told = f"{' '.join(columns.words[place] for _, place in used)}, as {where}"
    unused = columns.unused
    if unused:
        told += f" ({', '.join(unused)[:80]} passed over)"
    return Statement(columns, told)


def stated_by_comment(
    comments: Sequence[tuple[int, str]], num_columns: int, separator: str | None
) -> Statement | None:
    """Find the last comment that names the columns.

    Args:
        comments: Line numbers and texts, without the sign that makes them comments.
        num_columns: How many the data have.
        separator: What parts the data's words.
    """
    for number, comment in reversed(comments):
        for text in (*re.split(r"[:=]", comment, maxsplit=1)[1:], comment):
            for words in _ways_to_split(text, separator, num_columns):
                stated = stated_by_header(words, f"line {number} says")
                if stated and _is_possible(stated.columns, num_columns):
                    return stated
    return None


def _ways_to_split(text: str, separator: str | None, num_columns: int) -> list[list[str]]:
    """Part a comment as the data are, as it looks itself, and at anything, with words around."""
    bare = re.sub(r"\[[^\]]*\]", "", text)
    ways = [split_words(text, mark) for mark in {separator: 0, separator_of(text): 0}]
    words = [word for word in re.split(r"[\s,;|()]+", bare) if word]
    ways.append(words)
    for first in range(len(words) - num_columns + 1):
        part = words[first : first + num_columns]
        if not columns_of(part).unused:
            ways.append(part)
    return ways


def _is_possible(columns: Columns, num_columns: int) -> bool:
    """Tell whether a table may have these columns, and perhaps more behind them."""
    needed = [place for name, place in columns.places.items() if name not in ("scan", "id")]
    is_whole = len(columns.words) == num_columns or (
        columns.has(QUATERNION) and len(columns.words) < num_columns
    )
    return is_whole and max(needed) < num_columns and not columns.twice


def judged(
    path: Path, rows: list[list[str]], comments: Sequence[tuple[int, str]], separator: str | None
) -> Statement:
    """Tell columns that nothing names by how many there are, and by which can be a rotation.

    Args:
        path: The file, for messages.
        rows: Words by row, all as many.
        comments: As for ``stated_by_comment``; they may say the order of the quaternion.
        separator: What parts the words.

    Raises:
        InputError: It cannot be told.
    """
    # words that are no numbers are names or dates; the others are told by their values
    texts = [place for place, word in enumerate(rows[0]) if to_number(word) is None]
    dates = [place for place in texts if to_moment(rows[0][place]) is not None]
    texts = [place for place in texts if place not in dates]
    places = [place for place in range(len(rows[0])) if place not in texts + dates]
    names: tuple[str, ...] | None = None
    if len(texts) <= 1 and len(dates) <= 1:
        names = _by_count(_values(rows, places), len(rows[0]), has_date=bool(dates))
    if names is None:
        expected, remedy = "8 (TUM), 12 (KITTI) or a CSV with a header", "add a header line"
        raise InputError(path, f"{len(rows[0])} columns", expected, f"{remedy} or export it again")

    found = {name: place for name, place in zip(names, places, strict=True) if name}
    found |= dict(zip(("scan",), texts, strict=False))
    found |= dict(zip(("stamp",), dates, strict=False))
    told = " ".join(names).strip()
    if "qx" in found:
        order, reason = _order(path, rows, found, comments, separator)
        first = found["qx"]
        found |= {name: first + place for place, name in enumerate(order)}
        told = f"{' '.join(names[: names.index('qx')])} {' '.join(order)}, {reason}".strip()
    elif "m00" in found:
        kind = "KITTI, " if len(rows[0]) == len(MATRIX) else ""
        told = f"{kind}rows of a matrix, by {len(rows[0])} columns"
    return Statement(Columns(found), told)


def _values(rows: list[list[str]], places: list[int]) -> NDArray[np.float64]:
    """Read the numbers of some columns of the first rows; NaN for what is none."""
    numbers = [[to_number(row[place]) for place in places] for row in rows[:_ROWS_JUDGED]]
    values = np.array([[np.nan if x is None else x for x in row] for row in numbers], float)
    return values.reshape(-1, len(places))


def _by_count(
    values: NDArray[np.float64], num_columns: int, *, has_date: bool
) -> tuple[str, ...] | None:
    """Name (P, C) numbers by how many there are; several ways must not fit alike."""
    count = values.shape[1]
    ways: list[tuple[str, ...]] = []
    if count == 7 and (has_date or are_unit(values[:, 3:7])):
        ways.append(_TUM[1:])
    if count == 3 and num_columns > 3:  # behind a name or a date
        return POSITION
    if count == 8:
        return _TUM
    if count == 9:
        ways += [(*_TUM, "id")] if are_unit(values[:, 4:8]) else []
        ways += [("id", *_TUM)] if are_unit(values[:, 5:9]) else []
    if count == 12 and num_columns in (12, 13):
        return MATRIX
    if count == 13:
        ways += [(_counter(values[:, 0]), *MATRIX)] if _fits(values[:, 1:]) else []
        ways += [(*MATRIX, _counter(values[:, 12]))] if _fits(values[:, :12]) else []
    if count == _EUROC_COLUMNS and are_unit(values[:, 4:8]):
        ways.append((*_TUM, *[""] * (count - len(_TUM))))
    for first in (0, 1):
        if count == first + 16:
            label = (_counter(values[:, 0]),)[:first]
            ways += [(*label, *way) for way in _squares(values[:, first:])]
    return ways[0] if len(ways) == 1 else None


def _fits(rows: NDArray[np.float64]) -> bool:
    """Tell whether (P, 12) numbers are rigid, but for rows without numbers."""
    rows = rows[np.isfinite(rows).all(axis=1)]
    return len(rows) > 0 and bool(are_rigid(rows).all())


def _squares(values: NDArray[np.float64]) -> list[tuple[str, ...]]:
    """Tell 4 x 4 matrices by their last row, written as a row or as a column."""
    squares = values[np.isfinite(values).all(axis=1)].reshape(-1, 4, 4)
    last = (0, 0, 0, 1)
    if len(squares) and (squares[:, 3] == last).all():
        return [_FULL]
    return [_ACROSS] if len(squares) and (squares[:, :, 3] == last).all() else []


def _counter(values: NDArray[np.float64]) -> str:
    """Tell a number that counts from a time stamp."""
    values = values[np.isfinite(values)]
    is_whole = bool((values == np.round(values)).all())
    return "id" if is_whole and np.abs(values).max(initial=0) < 1e8 else "stamp"


def _order(
    path: Path,
    rows: list[list[str]],
    found: dict[str, int],
    comments: Sequence[tuple[int, str]],
    separator: str | None,
) -> tuple[tuple[str, ...], str]:
    """Tell the order of a quaternion, and how it is known; x y z w where nothing says otherwise."""
    for number, comment in comments:
        for order in (_W_FIRST, QUATERNION):
            words = (f"q?_?{name[1]}" for name in order)
            if re.search(rf"\b{'[ ,;]+'.join(words)}\b", comment.lower()):
                return order, f"as line {number} says"
    if len(rows[0]) == _EUROC_COLUMNS:
        return _W_FIRST, "EuRoC by 17 columns"

    # no rotation at all is often met, half a turn about x to the last digit is not
    first = found["qx"]
    values = np.abs(_values(rows, list(range(first, first + 4))))
    starts, ends = (
        bool(np.isclose(values, axis, atol=1e-6).all(axis=1).any())
        for axis in ([1, 0, 0, 0], [0, 0, 0, 1])
    )
    if starts and not ends:
        return _W_FIRST, "qw first as it is 1 where nothing is turned"

    stamp = to_number(rows[0][found["stamp"]]) if "stamp" in found else None
    if separator == "," and not ends and stamp is not None and stamp > _NANOSECONDS:
        expected = "a header that says whether they are qx qy qz qw (TUM) or qw qx qy qz (EuRoC)"
        raise InputError(path, "nanoseconds, 7 numbers and no header", expected, "add it")
    return QUATERNION, "as nothing says otherwise"


def check_complete(path: Path, columns: Columns) -> None:
    """Refuse columns that do not make a pose, or make several.

    Raises:
        InputError: Says what is there.
    """
    quaternion = [name for name in QUATERNION if name in columns.places]
    angles = [name for name in ANGLES if name in columns.places]
    has_base = columns.has(POSITION) or columns.has(MATRIX)
    if has_base and not columns.twice and len(quaternion) in (0, 4) and len(angles) in (0, 3):
        return
    found = f"columns {', '.join(columns.words)[:160]}"
    if has_base and len(quaternion) == 3 and "qw" not in quaternion:
        remedy = "rename them to roll, pitch, yaw if they are angles, or add qw"
        raise InputError(path, found, "qx, qy, qz, qw or roll, pitch, yaw", remedy)
    expected = "scan, timestamp, x, y, z, qx, qy, qz, qw (scan, timestamp and q… optional)"
    raise InputError(path, found, expected, "rename the columns")
