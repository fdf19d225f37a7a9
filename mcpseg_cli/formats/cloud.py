"""A point cloud as a file holds it: every attribute of every point, with its own type."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError, NoPointsError, OutputError
from mcpseg_cli.scan import Labels

if TYPE_CHECKING:
    from laspy import LasHeader

COLOUR_NAMES = (
    ("red", "green", "blue"),
    ("r", "g", "b"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
)
LABEL_NAMES = ("semantic", "instance", "confidence")


@dataclass(frozen=True)
class Cloud:
    """All that a cloud file says about its points.

    Attributes:
        columns: (N, ...) array by attribute name, file order and file type; always has ``x``, ``y``
            and ``z``.
        classes: Class names its labels index; empty when the file does not say.
        las_header: Where it came from LAS/LAZ: scales, offsets, reference system; kept for writing.
    """

    columns: dict[str, NDArray[np.generic]]
    classes: tuple[str, ...] = ()
    las_header: LasHeader | None = field(default=None, repr=False)

    def __len__(self) -> int:
        return len(self.columns["x"])

    @property
    def xyz(self) -> NDArray[np.floating]:
        """(N, 3) coordinates as stored, float32 or float64, a copy."""
        axes = [self.columns[name] for name in "xyz"]
        dtype = np.float32 if all(axis.dtype == np.float32 for axis in axes) else np.float64
        xyz = np.empty((len(self), 3), dtype)
        for column, axis in enumerate(axes):
            xyz[:, column] = axis
        return xyz

    @property
    def rgb(self) -> NDArray[np.uint8] | None:
        """(N, 3) uint8 colour, or None; 16-bit and 0-1 colours are scaled to 0-255."""
        for names in COLOUR_NAMES:
            if all(name in self.columns for name in names):
                return _as_uint8(np.stack([self.columns[name] for name in names], axis=1))
        return None

    def label(self, name: str) -> NDArray[np.generic] | None:
        """Return a label by its name or, as CloudCompare has it, ``scalar_`` and its name."""
        for candidate in (name, f"scalar_{name}"):
            if candidate in self.columns:
                return self.columns[candidate]
        return None

    def with_labels(self, labels: Labels) -> Cloud:
        """Return this cloud with these labels behind its other attributes, which are shared."""
        columns = {name: column for name, column in self.columns.items() if name not in LABEL_NAMES}
        columns |= {name: getattr(labels, name) for name in LABEL_NAMES}
        return replace(self, columns=columns, classes=labels.classes)


def checked(path: Path, cloud: Cloud) -> Cloud:
    """Return ``cloud`` if it has points with finite coordinates.

    Raises:
        InputError: No points, NaN or infinite coordinates, or a class whose name breaks headers.
    """
    if unclean := [name for name in cloud.classes if not name.isprintable()]:
        expected = "names without line breaks and control characters"
        raise InputError(path, f"a class named {unclean[0][:40]!a}", expected, "rename it")
    if len(cloud) == 0:
        remedy = "remove the file or record the scan again"
        raise NoPointsError(path, "zero points", "at least one point", remedy)

    finite = np.ones(len(cloud), bool)
    with np.errstate(invalid="ignore"):  # a signalling NaN is as bad as a quiet one
        for axis in "xyz":
            finite &= np.isfinite(cloud.columns[axis].astype(np.float64, copy=False))
    if not finite.all():
        bad = np.flatnonzero(~finite)
        share = f"{len(bad):,} of {len(cloud):,} points"
        found = f"{share} have NaN or infinite coordinates (first: point {bad[0]:,})"
        raise InputError(path, found, "finite coordinates", "drop these points before segmenting")
    return cloud


def as_number(name: str, column: NDArray[np.generic]) -> NDArray[np.generic]:
    """Return an attribute in a type that every format has.

    Booleans become bytes, half floats float32.

    Raises:
        OutputError: It does not hold numbers.
    """
    if column.dtype.kind not in "biuf" or column.dtype.itemsize > 8:
        raise OutputError(
            f"attribute {name}: holds {column.dtype}; expected numbers; remove it or write NPZ"
        )
    small = {"b1": np.uint8, "f2": np.float32}.get(column.dtype.str[1:])
    return column if small is None else column.astype(small)


def scalar_columns(columns: dict[str, NDArray[np.generic]]) -> dict[str, NDArray[np.generic]]:
    """Split attributes for a format of scalars: (N, K) becomes ``name_0`` … ``name_K-1``.

    Raises:
        OutputError: An attribute does not hold numbers.
    """
    scalars: dict[str, NDArray[np.generic]] = {}
    for name, column in columns.items():
        numbers = as_number(name, column)
        if column.ndim == 1:
            scalars[free_name(name, scalars)] = numbers
        else:
            for part, values in enumerate(numbers.reshape(len(column), -1).T):
                scalars[free_name(f"{name}_{part}", scalars)] = values
    return scalars


def without_spaces(columns: dict[str, NDArray[np.generic]]) -> dict[str, NDArray[np.generic]]:
    """Rename attributes for a format whose header separates names by spaces."""
    renamed: dict[str, NDArray[np.generic]] = {}
    for name, column in columns.items():
        renamed[free_name("_".join(name.split()), renamed)] = column
    return renamed


def free_name(name: str, taken: Container[str]) -> str:
    """Return ``name``, with underscores behind it if something has that name already."""
    while name in taken:
        name += "_"
    return name


def _as_uint8(colour: NDArray[np.generic]) -> NDArray[np.uint8]:
    """Scale colours to 0-255: floats up to 1 are fractions, integers above 255 are 16-bit."""
    if colour.dtype == np.uint8:
        return colour.astype(np.uint8)
    values = np.nan_to_num(colour.astype(np.float64))
    if np.issubdtype(colour.dtype, np.floating) and values.max(initial=0.0) <= 1.0:
        values = values * 255.0
    elif np.issubdtype(colour.dtype, np.integer) and values.max(initial=0.0) > 255.0:
        values = values // 257.0
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)
