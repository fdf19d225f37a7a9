"""Label attributes of a cloud as checked integers: classes, object ids and confidence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import Cloud

_RANGES = {"semantic": (-1, UNKNOWN), "instance": (-(2**31), 2**31 - 1)}


def class_column(cloud: Cloud, source: Path) -> NDArray[np.uint8]:
    """Take the class of every point.

    Args:
        cloud: N points.
        source: Its file, for messages.

    Returns:
        (N,) uint8 class index; -1 has become 255, unknown.

    Raises:
        InputError: No ``semantic``, or not a whole number from -1 to 255 for each point.
    """
    return _whole_numbers(cloud, "semantic", source).astype(np.uint8)  # -1 wraps to 255


def object_column(cloud: Cloud, source: Path) -> NDArray[np.int32]:
    """Take the object of every point.

    Args:
        cloud: N points.
        source: Its file, for messages.

    Returns:
        (N,) int32 object id; 0 none, and so what was below.

    Raises:
        InputError: No ``instance``, or not a whole number of 32 bits for each point.
    """
    return np.maximum(_whole_numbers(cloud, "instance", source), 0).astype(np.int32)


def confidence_column(cloud: Cloud, source: Path) -> NDArray[np.float64] | None:
    """Take the confidence of every point, (N,) float64; None if the cloud has none.

    Raises:
        InputError: Not a finite number for each point.
    """
    column = cloud.label("confidence")
    if column is None:
        return None
    if (
        column.ndim != 1
        or column.dtype.kind not in "iufb"
        or not np.isfinite(column.astype(np.float64)).all()
    ):
        raise InputError(
            source, "confidence that is no number", "a number for each point", "mend the labels"
        )
    return column.astype(np.float64)


def check_classes(semantic: NDArray[np.uint8], classes: tuple[str, ...], source: Path) -> None:
    """Refuse classes beyond the table, and a table that is too long.

    Args:
        semantic: (N,) uint8, 255 unknown.
        classes: The table.
        source: The file, for the message.

    Raises:
        InputError: Names the first such class and its point, or the length of the table.
    """
    if len(classes) > UNKNOWN:
        raise InputError(source, f"{len(classes)} classes", f"at most {UNKNOWN}", "merge classes")
    wrong = (semantic >= len(classes)) & (semantic != UNKNOWN)
    if wrong.any():
        point = int(wrong.argmax())
        expected = f"0 to {len(classes) - 1}, or {UNKNOWN} for unknown"
        raise InputError(
            source,
            f"class {semantic[point]} (point {point:,})",
            expected,
            "give it its class table",
        )


def _whole_numbers(cloud: Cloud, name: str, source: Path) -> NDArray[np.int64]:
    """Take a label as int64, if it is one whole number in range for each point."""
    column = cloud.label(name)
    if column is None:
        expected = "labelled clouds with semantic and instance"
        raise InputError(source, f"points without {name}", expected, "check the path")
    if column.ndim != 1 or column.dtype.kind not in "iufb":
        found = f"{name} is {column.dtype} {column.shape}"
        raise InputError(source, found, "a number for each point", "mend the labels")
    low, high = _RANGES[name]
    values = column.astype(np.float64)  # exact for what is in range
    right = (values >= low) & (values <= high) & (values == np.floor(values))
    if not right.all():
        found = f"{name} from {values.min():g} to {values.max():g}, {values[~right][0]:g} for one"
        raise InputError(source, found, f"whole numbers from {low} to {high}", "mend the labels")
    return column.astype(np.int64)
