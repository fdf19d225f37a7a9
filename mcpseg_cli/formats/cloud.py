"""A point cloud as a file holds it: every attribute of every point, with its own type."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import ColourUnit
from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.errors import InputError, NoPointsError, OutputError
from mcpseg_cli.formats.colours import as_bytes, contradiction, find_colour
from mcpseg_cli.scan import Labels

if TYPE_CHECKING:
    from laspy import LasHeader

LABEL_NAMES = ("semantic", "instance", "confidence")


@dataclass(frozen=True)
class Organisation:
    """How a PCD file lays out its points: rows of pixels, seen from a viewpoint.

    Attributes:
        viewpoint: Position and quaternion w x y z.
        width: Points of a row; of no use unless ``width * height`` are the points.
        height: Rows; 1 for a cloud that is not organised.
    """

    viewpoint: tuple[float, ...]
    width: int
    height: int


@dataclass(frozen=True)
class Cloud:
    """All that a cloud file says about its points.

    Attributes:
        columns: (N, ...) array by attribute name, file order and file type; always has ``x``, ``y``
            and ``z``.
        classes: Class names its labels index; empty when the file does not say.
        las_header: Where it came from LAS/LAZ: scales, offsets, reference system; kept for writing.
        organisation: Where it came from PCD: its VIEWPOINT (position, quaternion w x y z) and its
            width and height; kept for writing.
        excluded: (N,) bool points that the file marks as none, LAS withheld and noise; None: none.
        valid: (N,) bool points that are measured, see ``mark_valid``; None: all of them.
    """

    columns: dict[str, NDArray[np.generic]]
    classes: tuple[str, ...] = ()
    las_header: LasHeader | None = field(default=None, repr=False)
    organisation: Organisation | None = None
    excluded: NDArray[np.bool_] | None = field(default=None, repr=False)
    valid: NDArray[np.bool_] | None = field(default=None, repr=False)

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
        found = find_colour(self.columns)
        return None if found is None else as_bytes(found.values, found.unit)

    def colour(self, unit: ColourUnit | None, source: Path) -> NDArray[np.uint8] | None:
        """Return the colour of a scan.

        Args:
            unit: Of the recording; None: told from this scan alone.
            source: The file, for the message.

        Returns:
            (N, 3) uint8; None without colour, which all that is 0 is, too.

        Raises:
            InputError: The colours are brighter than the unit has them.
        """
        found = find_colour(self.columns)
        if found is None or not np.nan_to_num(found.values).any():
            return None
        brightest = contradiction(found.values, unit) if unit and not found.unit else None
        if brightest is not None:
            was = f"colours up to {brightest:,.0f}"
            remedy = "give --colour 16-bit (or 8-bit, 0-1) and --overwrite"
            raise InputError(source, was, f"{unit} colours as in the first scans", remedy)
        return as_bytes(found.values, found.unit or unit)

    def measured(self) -> Cloud:
        """Return its valid points only; itself where all are."""
        if self.valid is None:
            return self
        columns = {name: column[self.valid] for name, column in self.columns.items()}
        return replace(self, columns=columns, organisation=None, excluded=None, valid=None)

    def label(self, name: str) -> NDArray[np.generic] | None:
        """Return a label by its name or, as CloudCompare has it, ``scalar_`` and its name."""
        for candidate in (name, f"scalar_{name}"):
            if candidate in self.columns:
                return self.columns[candidate]
        return None

    def with_labels(self, labels: Labels) -> Cloud:
        """Return this cloud with these labels behind its other attributes, which are shared.

        Args:
            labels: Of every point, or of the valid ones: the others get 255, 0 and 0.
        """
        columns = {name: column for name, column in self.columns.items() if name not in LABEL_NAMES}
        for name, nothing in zip(LABEL_NAMES, (UNKNOWN, 0, 0.0), strict=True):
            given = getattr(labels, name)
            if self.valid is not None and len(given) != len(self):
                columns[name] = np.full(len(self), nothing, given.dtype)
                columns[name][self.valid] = given
            else:
                columns[name] = given
        return replace(self, columns=columns, classes=labels.classes)


def checked(path: Path, cloud: Cloud) -> Cloud:
    """Return ``cloud`` if it has points with finite coordinates.

    Raises:
        InputError: No points, NaN or infinite coordinates, or a class whose name breaks headers.
    """
    _check_points(path, cloud)
    finite = _finite(cloud)
    if not finite.all():
        bad = np.flatnonzero(~finite)
        share = f"{len(bad):,} of {len(cloud):,} points"
        found = f"{share} have NaN or infinite coordinates (first: point {bad[0]:,})"
        raise InputError(path, found, "finite coordinates", "drop these points before segmenting")
    return cloud


def mark_valid(path: Path, cloud: Cloud) -> Cloud:
    """Mark the points of a scan that are measured: finite, and not excluded by the file.

    Returns:
        The cloud with ``valid``; None where all are.

    Raises:
        InputError: No points, or none that is measured.
    """
    _check_points(path, cloud)
    finite = _finite(cloud)
    valid = finite if cloud.excluded is None else finite & ~cloud.excluded
    if not valid.any():
        counts = [f"{int((~finite).sum()):,} have NaN or infinite coordinates"]
        if finite.any():
            counts.append(f"{int(finite.sum()):,} are flagged as withheld or noise")
        found = f"none of {len(cloud):,} points is measured: {', '.join(counts)}"
        raise InputError(path, found, "finite coordinates", "remove the scan or record it again")
    return replace(cloud, valid=None if valid.all() else valid)


def _check_points(path: Path, cloud: Cloud) -> None:
    """Refuse a cloud without points, or with a class whose name breaks headers."""
    if unclean := [name for name in cloud.classes if not name.isprintable()]:
        expected = "names without line breaks and control characters"
        raise InputError(path, f"a class named {unclean[0][:40]!a}", expected, "rename it")
    if len(cloud) == 0:
        remedy = "remove the file or record the scan again"
        raise NoPointsError(path, "zero points", "at least one point", remedy)


def _finite(cloud: Cloud) -> NDArray[np.bool_]:
    """Tell which points have finite coordinates; (N,)."""
    finite = np.ones(len(cloud), bool)
    with np.errstate(invalid="ignore"):  # a signalling NaN is as bad as a quiet one
        for axis in "xyz":
            finite &= np.isfinite(cloud.columns[axis].astype(np.float64, copy=False))
    return finite


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
