"""Colours of points: under the names, in the shapes and in the units that tools write them in."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import ColourUnit
from mcpseg_cli.scan import GREY

_CHANNELS = (("red", "green", "blue"), ("r", "g", "b"), ("rf", "gf", "bf"))
_BEFORE_CHANNEL = r"^(scalar[ _])?((diffuse|vertex|colou?r|col|point)[ _.]*)?(?=\w{1,5}$)"
_ARRAYS = ("rgb", "rgba", "rgbs", "color", "colors", "colour", "colours", "bgr", "bgra")
_SPLATS = ("f_dc_0", "f_dc_1", "f_dc_2")
_SPHERICAL_HARMONIC = 0.28209479177387814  # of degree 0: a splat's colour is 0.5 + this times f_dc

_BYTE = 255.0
_NEARLY_ONE = 1.5  # corrected and rounded colours of 0 to 1 exceed 1 here and there
_HIGHLIGHTS = 16.0  # as bright as light of 0 to 1 gets
_NEARLY_BYTE = 257.0
_CONTRADICTS = 1.1  # of what a unit reaches: beyond that it is another
_MOST_VALUES = 50_000  # values looked at in a scan; more say the same


@dataclass(frozen=True)
class Colour:
    """Colours as a file has them.

    Attributes:
        values: (N, 3) red, green, blue, in the file's type and unit.
        names: The file's columns that they are from.
        unit: Where the way they are written says it.
    """

    values: NDArray[np.generic]
    names: tuple[str, ...]
    unit: ColourUnit | None = None


@np.errstate(over="ignore", invalid="ignore")  # what is no number of any kind is grey
def find_colour(columns: Mapping[str, NDArray[np.generic]]) -> Colour | None:
    """Find the colours among the attributes of a cloud.

    Args:
        columns: (N, ...) array by name. Red, green and blue may stand by themselves (also as ``R``,
            ``scalar_R``, ``diffuse_red``), in one array (``rgb``, ``colors``, with alpha or
            without), packed into one number, or be those of Gaussian splats.

    Returns:
        The colours; None where there are none.
    """
    return _in_channels(columns) or _in_array(columns) or _of_splats(columns)


@np.errstate(over="ignore", invalid="ignore")  # what is no number of any kind is grey
def decide_unit(seen: Sequence[NDArray[np.generic]]) -> ColourUnit | None:
    """Tell what unit the colours of a recording are in, by those of several scans together.

    Args:
        seen: (N, 3) colours of each, of one kind of number.

    Returns:
        ``8-bit``, ``16-bit`` or ``0-1``; None where nothing but 0 was seen, which says nothing.
    """
    values = [part[np.isfinite(part)] for part in map(_some, seen) if part.dtype.kind in "biuf"]
    joined = np.concatenate(values).astype(np.float64) if values else np.empty(0)
    if not joined.any():
        return None
    if all(part.dtype == np.uint8 for part in seen):
        return "8-bit"
    if all(part.dtype.kind in "biu" for part in seen):
        return "8-bit" if joined.max() <= _BYTE else "16-bit"

    # single values beyond a unit do not make another; whole numbers are no shares of 1
    usual, brightest = np.quantile(joined, 0.99), joined.max()
    if usual <= _NEARLY_ONE:
        lit = joined[joined != 0]
        is_dark = brightest > _HIGHLIGHTS and (lit == np.rint(lit)).mean() > 0.5
        return "8-bit" if is_dark else "0-1"
    return "8-bit" if usual <= _NEARLY_BYTE else "16-bit"


def contradiction(values: NDArray[np.generic], unit: ColourUnit) -> float | None:
    """Return the brightest usual value of colours that are too bright for a unit, else None."""
    if values.dtype == np.uint8 or unit == "16-bit" or len(values) == 0:
        return None
    some = _some(values)
    some = some[np.isfinite(some)].astype(np.float64)
    usual = float(np.quantile(some, 0.99)) if len(some) else 0.0
    if values.dtype.kind in "iu":
        return usual if unit == "8-bit" and usual > _BYTE * _CONTRADICTS else None
    most = {"0-1": _HIGHLIGHTS, "8-bit": _NEARLY_BYTE * _CONTRADICTS}[unit]
    return usual if usual > most else None


@np.errstate(over="ignore", invalid="ignore")  # what is no number of any kind is grey
def as_bytes(values: NDArray[np.generic], unit: ColourUnit | None) -> NDArray[np.uint8]:
    """Scale colours to 0-255.

    Args:
        values: (N, 3) of any type; bytes stay as they are, NaN becomes grey.
        unit: Their unit; None: told from them alone. Integers are never of 0 to 1.

    Returns:
        (N, 3) uint8, a new array.
    """
    if values.dtype == np.uint8:
        return values.astype(np.uint8)
    is_whole = values.dtype.kind in "biu"
    if unit is None or (is_whole and unit == "0-1"):
        unit = decide_unit([values])

    numbers = values.astype(np.float64)
    if unit == "0-1":
        numbers = numbers * _BYTE
    elif unit == "16-bit":  # of bytes times 256 or 257, the byte
        numbers = np.floor(numbers / 256.0)
    is_known = np.isfinite(numbers).all(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):
        numbers = np.where(is_known, np.clip(np.rint(numbers), 0, _BYTE), float(GREY))
    return numbers.astype(np.uint8)


def _some(values: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return a sample of the values: the brightest of integers, every so many of others."""
    flat = values.reshape(-1)
    if flat.dtype.kind in "biu":
        return flat[[flat.argmax()]] if len(flat) else flat
    return flat[:: max(1, len(flat) // _MOST_VALUES)]


def _in_channels(columns: Mapping[str, NDArray[np.generic]]) -> Colour | None:
    """Find red, green and blue as attributes of their own."""
    plain = {name: name for name in columns}
    shortened = {
        re.sub(_BEFORE_CHANNEL, "", name.lower()): name for name in reversed(list(columns))
    }
    for known in (plain, shortened):
        for channels in _CHANNELS:
            names = tuple(known.get(channel, "") for channel in channels)
            if all(name and _is_plain(columns[name]) for name in names):
                return Colour(np.stack([columns[name] for name in names], axis=1), names)
    return None


def _in_array(columns: Mapping[str, NDArray[np.generic]]) -> Colour | None:
    """Find colours in one attribute: an array, its parts by number, or a packed number."""
    by_name = {name.lower().removeprefix("scalar_"): name for name in reversed(list(columns))}
    for short in _ARRAYS:
        parts = tuple(by_name.get(f"{short}_{part}", "") for part in range(3))
        names = (by_name[short],) if short in by_name else parts if all(parts) else ()
        if not names:
            continue
        arrays = [columns[name] for name in names]
        array = arrays[0] if len(arrays) == 1 else np.stack(arrays, axis=1)
        if array.ndim == 1 and array.dtype.itemsize >= 4 and array.dtype.kind in "fiu":
            return Colour(_unpacked(array), names)
        if array.ndim == 2 and array.shape[1] in (3, 4) and array.dtype.kind in "fiu":
            order = [2, 1, 0] if short.startswith("bgr") else [0, 1, 2]
            return Colour(array[:, order], names)
    return None


def _unpacked(packed: NDArray[np.generic]) -> NDArray[np.uint8]:
    """Take the three bytes out of packed colours, which are often kept as the bits of a float."""
    if packed.dtype.kind == "f":
        with np.errstate(invalid="ignore", over="ignore"):
            is_number = bool((np.nan_to_num(packed) >= 1).any())
            whole = np.nan_to_num(packed).astype(np.uint32) if is_number else None
            bits = packed.astype(np.float32).view(np.uint32) if whole is None else whole
    else:
        bits = packed.astype(np.int64)
    return np.stack([bits >> shift & 255 for shift in (16, 8, 0)], axis=1).astype(np.uint8)


def _of_splats(columns: Mapping[str, NDArray[np.generic]]) -> Colour | None:
    """Find the colours of Gaussian splats, as seen from all around."""
    if not all(name in columns and _is_plain(columns[name]) for name in _SPLATS):
        return None
    harmonics = np.stack([columns[name] for name in _SPLATS], axis=1).astype(np.float64)
    return Colour(np.clip(0.5 + _SPHERICAL_HARMONIC * harmonics, 0.0, 1.0), _SPLATS, "0-1")


def _is_plain(column: NDArray[np.generic]) -> bool:
    """Tell whether an attribute has a number for every point."""
    return column.ndim == 1 and column.dtype.kind in "fiu"
