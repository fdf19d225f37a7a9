"""Clouds as text: ``.xyz``, ``.txt`` and ``.asc`` with or without names, ``.pts`` with a count."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.cloud import Cloud

_COLOUR, _NORMAL = ("red", "green", "blue"), ("nx", "ny", "nz")
_NAMES = {"r": "red", "g": "green", "b": "blue", "scalar_intensity": "intensity", "i": "intensity"}
_REMEDY = "name the columns in a first line: //X Y Z R G B"


def read_text(path: Path) -> Cloud:
    """Read a cloud of one point a line.

    Columns are named by a first line (``//X Y Z R G B``, as CloudCompare writes it), else told by
    their number and values: x y z, then intensity, colour, normal, or intensity and colour.

    Args:
        path: The file; numbers parted by spaces, commas, semicolons or tabs; ``.pts`` begins with
            the number of points.

    Raises:
        InputError: It is no such table, or its columns cannot be told.
        OSError: It cannot be opened.
    """
    lines = path.read_bytes().decode("utf-8-sig", "replace").splitlines()
    lines = [line.translate(_SPACES) for line in lines if line.strip()]

    # a header, a count
    names: list[str] | None = None
    first = next((n for n, line in enumerate(lines) if _are_numbers(line.split())), len(lines))
    if first:
        words = lines[first - 1].lstrip("/#").split()
        names = [word.strip("\"'").lower() for word in words]
    lines = lines[first:]
    count: int | None = None
    if lines and (word := lines[0].strip()).isdecimal() and len(word) <= _MOST_DIGITS:
        count, lines = int(word), lines[1:]
    if not lines:
        raise InputError(path, "no points", "a line for each point", "check the file")

    table = parse_numbers(path, lines)
    if count is not None and count != len(table):
        found = f"{count:,} points promised, {len(table):,} found"
        raise InputError(path, found, "all of them", "copy the file again")
    if _is_pose(table):
        remedy = "give the folder of poses second"
        raise InputError(path, "a 4 x 4 matrix, which is a pose", "a cloud", remedy)
    return Cloud(_columns(path, table, names))


_MOST_DIGITS = 18  # of a number of points
_SPACES = str.maketrans(",;\t", "   ")


def parse_numbers(path: Path, lines: list[str]) -> NDArray[np.float64]:
    """Parse lines of as many numbers each; (N, K) float64.

    Raises:
        InputError: A line has other words than numbers, or more or fewer than the first.
    """
    try:
        return np.loadtxt(io.StringIO("\n".join(lines)), np.float64, ndmin=2, comments=None)
    except ValueError as error:
        found = str(error).partition(";")[0]
        raise InputError(path, found, "a line of numbers for each point", "mend it") from error


def _are_numbers(words: list[str]) -> bool:
    try:
        [float(word) for word in words]
    except ValueError:
        return False
    return True


def _is_pose(table: NDArray[np.float64]) -> bool:
    return table.shape == (4, 4) and bool((table[3] == (0, 0, 0, 1)).all())


def _columns(
    path: Path, table: NDArray[np.float64], names: list[str] | None
) -> dict[str, NDArray[np.generic]]:
    """Name the columns; colours become bytes where they are whole numbers of a byte."""
    named = (
        _guess(path, table) if names is None else tuple(_NAMES.get(name, name) for name in names)
    )
    if len(named) != table.shape[1] or not set("xyz") <= set(named):
        found = f"columns {' '.join(named)[:80]} over {table.shape[1]} numbers a line"
        raise InputError(path, found, "a name for each, x y z among them", _REMEDY)
    columns: dict[str, NDArray[np.generic]] = {}
    for place, name in enumerate(named):
        values = table[:, place]
        is_byte = name in _COLOUR and _are_bytes(values)
        columns[name] = values.astype(np.uint8) if is_byte else values.copy()
    return columns


def _guess(path: Path, table: NDArray[np.float64]) -> tuple[str, ...]:
    """Name columns by their number and values."""
    rest = table[:, 3:]
    if rest.shape[1] == 0:
        return tuple("xyz")
    if rest.shape[1] == 1:
        return (*"xyz", "intensity")
    if rest.shape[1] == 3 and _are_colours(rest):
        return (*"xyz", *_COLOUR)
    if rest.shape[1] == 3 and _are_normals(rest):
        return (*"xyz", *_NORMAL)
    if rest.shape[1] == 4 and _are_colours(rest[:, 1:]):
        return (*"xyz", "intensity", *_COLOUR)
    if rest.shape[1] == 6 and _are_colours(rest[:, :3]) and _are_normals(rest[:, 3:]):
        return (*"xyz", *_COLOUR, *_NORMAL)
    found = f"{table.shape[1]} columns without names"
    raise InputError(path, found, "x y z and colour or intensity", _REMEDY)


def _are_bytes(values: NDArray[np.float64]) -> bool:
    return bool(((values == np.rint(values)) & (values >= 0) & (values <= 255)).all())


def _are_colours(values: NDArray[np.float64]) -> bool:
    """Tell bytes, or fractions that are no unit vectors."""
    if _are_bytes(values):
        return not _are_normals(values)
    in_range = bool(((values >= 0) & (values <= 1)).all())
    return in_range and not _are_normals(values)


def _are_normals(values: NDArray[np.float64]) -> bool:
    lengths = np.linalg.norm(values, axis=1)
    return bool((np.abs(lengths - 1) < 0.01).all())
