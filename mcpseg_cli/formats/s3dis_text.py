"""The lines of an S3DIS file, ``x y z r g b``: bytes to arrays and back."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

_SHORTEST = 12  # bytes of "0 0 0 0 0 0\n"
_LONGEST = 60  # bytes of a line written: three numbers of 15, three of 3, separators
_BLOCK = 1 << 16  # lines formatted at once
_LARGEST = 1e9  # metres that fit into a number of 15 bytes
_STRAY = re.compile(rb"[^\x20-\x7e\t\r\n]+")
_POWERS = np.array([float(f"1e{power}") for power in range(23)])  # exact as float64
_EXACT = 1 << 53  # integers up to here are exact as float64
_MOST = 10**17  # one more digit fits into int64


@dataclass(frozen=True)
class BadLine:
    """A line that is not six numbers.

    Attributes:
        line: Its number in the text, from 1.
        text: What it says, cut to 60 characters.
        mended: Whether it was read after all.
    """

    line: int
    text: str
    mended: bool


@dataclass(frozen=True)
class Lines:
    """The points of a text.

    Attributes:
        xyz: (N, 3) float32.
        rgb: (N, 3) uint8.
        num_lines: Lines read, blank ones included.
        bad: Every bad line.
        is_whole: False when so many lines were bad (more than 16 and one in 1,000 bytes) that
            reading was given up.
    """

    xyz: NDArray[np.float32]
    rgb: NDArray[np.uint8]
    num_lines: int
    bad: tuple[BadLine, ...]
    is_whole: bool


def read_lines(text: bytes) -> Lines:
    r"""Read lines ``x y z r g b``, separated by spaces or tabs, ended by LF or CRLF.

    Blank lines are passed over. Coordinates are at most one float32 step from the correctly rounded
    number; colours may be written as decimals and are rounded. A line is bad unless it is exactly
    six finite decimal numbers with colours in 0 to 255. One with stray bytes in it (control
    characters, anything not ASCII) is mended: they are taken for separators if that makes it good
    (``98 185\x10187``), else left out if that does (``103.0\x100000``). Other bad lines are
    dropped.

    Args:
        text: Whole lines; the last may lack its end.

    Returns:
        The points in the order of the lines, and what was wrong.
    """
    # the good lines; memory that no point reaches is never touched
    data = np.frombuffer(text, np.uint8)
    capacity = len(text) // _SHORTEST + 1
    xyz, rgb = np.empty((capacity, 3), np.float32), np.empty((capacity, 3), np.uint8)
    places = np.empty((16 + len(text) // 1000, 4), np.int64)
    num_points, num_lines, num_bad = _parse(data, xyz, rgb, places)
    xyz, rgb = xyz[:num_points], rgb[:num_points]
    if num_bad == 0:
        return Lines(xyz, rgb, num_lines, (), True)

    # the bad ones, of which some can be mended
    is_whole = num_bad <= len(places)
    bad, rows, xyz_mended, rgb_mended = [], [], [], []
    for line, row, start, end in places[:num_bad].tolist():
        mended = _mend(text[start:end]) if is_whole else None
        says = text[start : min(end, start + 60)].decode("latin-1").strip()
        bad.append(BadLine(line + 1, says, mended is not None))
        if mended is not None:
            rows.append(row)
            xyz_mended.append(mended[0])
            rgb_mended.append(mended[1])

    # mended points go where their lines were
    if rows:
        xyz = np.insert(xyz, rows, xyz_mended, axis=0)
        rgb = np.insert(rgb, rows, rgb_mended, axis=0)
    return Lines(xyz, rgb, num_lines, tuple(bad), is_whole)


def format_lines(xyz: NDArray[np.float32], rgb: NDArray[np.uint8]) -> Iterator[memoryview]:
    r"""Write points as lines, coordinates with three decimals: ``-13.521 2.340 1.001 123 98 77\n``.

    Args:
        xyz: (N, 3) float32, metres.
        rgb: (N, 3) uint8.

    Yields:
        The text in pieces of up to 65,536 lines; each is valid until the next is asked for.

    Raises:
        ValueError: A coordinate is not finite or beyond 1e9 m.
    """
    if not (np.abs(xyz) <= _LARGEST).all():
        raise ValueError("coordinates must be finite and within 1e9 m")
    text = np.empty(min(_BLOCK, len(xyz)) * _LONGEST, np.uint8)
    for start in range(0, len(xyz), _BLOCK):
        part = slice(start, start + _BLOCK)
        length = _format(np.ascontiguousarray(xyz[part]), np.ascontiguousarray(rgb[part]), text)
        yield text[:length].data


def _mend(line: bytes) -> tuple[NDArray[np.float32], NDArray[np.uint8]] | None:
    """Read a bad line with its stray bytes replaced; None if that does not make it good."""
    xyz, rgb = np.empty((1, 3), np.float32), np.empty((1, 3), np.uint8)
    for replacement in (b" ", b""):
        data = np.frombuffer(_STRAY.sub(replacement, line), np.uint8)
        if _parse(data, xyz, rgb, np.empty((0, 4), np.int64)) == (1, 1, 0):
            return xyz[0], rgb[0]
    return None


@njit(cache=True, nogil=True)
def _parse(
    text: NDArray[np.uint8],
    xyz: NDArray[np.float32],
    rgb: NDArray[np.uint8],
    bad: NDArray[np.int64],
) -> tuple[int, int, int]:
    """Read every line; of bad ones keep number, points before, start and end.

    Returns the numbers of points, lines and bad lines.
    """
    position = num_points = num_lines = num_bad = 0
    values = np.empty(6)
    while position < len(text) and num_bad <= len(bad):
        start = position
        position, num_values = _parse_line(text, position, values)
        if num_values == 6 and _is_point(values):
            for axis in range(3):
                xyz[num_points, axis] = values[axis]
                rgb[num_points, axis] = np.uint8(values[axis + 3] + 0.5)
            num_points += 1
        elif num_values != 0:
            if num_bad < len(bad):
                bad[num_bad, 0], bad[num_bad, 1] = num_lines, num_points
                bad[num_bad, 2], bad[num_bad, 3] = start, position
            num_bad += 1
        num_lines += 1
    return num_points, num_lines, num_bad


@njit(cache=True, nogil=True)
def _parse_line(
    text: NDArray[np.uint8], position: int, values: NDArray[np.float64]
) -> tuple[int, int]:
    """Read the numbers of one line; return where the next starts and their number, -1 if bad."""
    num_values = 0
    while position < len(text):
        byte = text[position]
        if byte == 10:
            return position + 1, num_values
        if byte == 32 or byte == 9 or byte == 13:
            position += 1
            continue

        # a number, and no seventh; else the rest of the line does not matter
        end = -1
        if num_values < 6:
            values[num_values], end = _parse_number(text, position)
        if end < 0:
            while position < len(text) and text[position] != 10:
                position += 1
            return position + 1, -1
        position = end
        num_values += 1
    return position, num_values


@njit(cache=True, nogil=True)
def _parse_number(text: NDArray[np.uint8], position: int) -> tuple[float, int]:
    """Read a decimal number that ends at a separator; return it and its end, -1 if it is none."""
    negative = text[position] == 45
    if negative or text[position] == 43:
        position += 1

    # digits, as many as int64 holds
    mantissa, power, num_digits, is_fraction = 0, 0, 0, False
    while position < len(text):
        digit = int(np.int64(text[position])) - 48
        if 0 <= digit <= 9:
            num_digits += 1
            if mantissa < _MOST:
                mantissa = mantissa * 10 + digit
                power -= is_fraction
            else:
                power += not is_fraction
        elif digit == -2 and not is_fraction:
            is_fraction = True
        else:
            break
        position += 1
    if num_digits == 0:
        return 0.0, -1

    # an exponent, and a separator behind all of it
    if position < len(text) and text[position] | 32 == 101:
        exponent, position = _parse_exponent(text, position + 1)
        power += exponent
    if position < 0:
        return 0.0, -1
    byte = text[position] if position < len(text) else 10
    if byte != 32 and byte != 10 and byte != 9 and byte != 13:
        return 0.0, -1

    value = _scaled(mantissa, power)
    return (-value if negative else value), position


@njit(cache=True, nogil=True)
def _parse_exponent(text: NDArray[np.uint8], position: int) -> tuple[int, int]:
    """Read the power of ten behind an e; return it and where it ends, -1 if there is none."""
    sign = 1
    if position < len(text) and (text[position] == 45 or text[position] == 43):
        sign = 44 - int(np.int64(text[position]))
        position += 1
    exponent, first = 0, position
    while position < len(text) and 48 <= text[position] <= 57:
        exponent = min(exponent * 10 + int(np.int64(text[position])) - 48, 1 << 40)
        position += 1
    return sign * exponent, position if position > first else -1


@njit(cache=True, nogil=True)
def _scaled(mantissa: int, power: int) -> float:
    """Return mantissa times ten to the power: rounded correctly, or to a few parts in 1e16."""
    if mantissa == 0:
        return 0.0
    if mantissa <= _EXACT and -22 <= power <= 22:
        return float(mantissa / _POWERS[-power] if power < 0 else mantissa * _POWERS[power])
    return float(mantissa * 10.0 ** float(min(max(power, -400), 400)))


@njit(cache=True, nogil=True)
def _is_point(values: NDArray[np.float64]) -> bool:
    """Whether six numbers are coordinates that float32 can hold and colours."""
    for axis in range(3):
        if not np.isfinite(np.float32(values[axis])):
            return False
        if not 0.0 <= np.float32(values[axis + 3]) <= 255.0:
            return False
    return True


@njit(cache=True, nogil=True)
def _format(xyz: NDArray[np.float32], rgb: NDArray[np.uint8], text: NDArray[np.uint8]) -> int:
    """Write one line a point into ``text``; return the bytes written."""
    length = 0
    for row in range(len(xyz)):
        # coordinates with three decimals
        for axis in range(3):
            thousandths = int(np.rint(np.float64(xyz[row, axis]) * 1000.0))
            if thousandths < 0:
                text[length] = 45
                length += 1
                thousandths = -thousandths
            length = _format_integer(thousandths // 1000, text, length)
            text[length] = 46
            rest = thousandths % 1000
            text[length + 1], text[length + 2] = 48 + rest // 100, 48 + rest // 10 % 10
            text[length + 3], text[length + 4] = 48 + rest % 10, 32
            length += 5

        # colours, the last before the end of the line
        for axis in range(3):
            length = _format_integer(int(np.int64(rgb[row, axis])), text, length)
            text[length] = 32 if axis < 2 else 10
            length += 1
    return length


@njit(cache=True, nogil=True)
def _format_integer(number: int, text: NDArray[np.uint8], length: int) -> int:
    """Write a number of 0 or more; return the bytes written so far."""
    digits, rest = 1, number
    while rest >= 10:
        digits, rest = digits + 1, rest // 10
    for place in range(length + digits - 1, length - 1, -1):
        text[place] = 48 + number % 10
        number //= 10
    return length + digits
