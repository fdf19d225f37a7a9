"""Labels of a cloud's points, checked in one place: classes, object ids and confidence."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import Cloud
from mcpseg_cli.formats.magic import saw

_LAST_OBJECT = np.iinfo(np.int32).max
_REMEDY = "mend the labels"
_NAMES = {  # by which label, the first wins; compared without case, "scalar_" and separators
    "semantic": (
        "semantic", "semantics", "semanticlabel", "semanticid", "sem", "semlabel", "semid",
        "label", "labels", "class", "classes", "classid", "classlabel", "classindex", "cls",
        "category", "categoryid", "categories", "gt", "gtlabel", "gtsemantic",
    ),
    "instance": (
        "instance", "instances", "instanceid", "instancelabel", "inst", "instid", "instlabel",
        "ins", "insid", "object", "objectid", "objects", "obj", "objid", "gtinstance",
    ),
}  # fmt: skip
_STANDARD_CLASSES = 64  # classifications below that are those of the LAS standard
_OTHER = 1  # a classification: unclassified


@dataclass(frozen=True)
class LabelFields:
    """Which attributes of a cloud are its labels.

    Attributes:
        semantic: Name of the classes; None: a usual name.
        instance: Name of the objects; None: a usual name.
    """

    semantic: str | None = None
    instance: str | None = None


USUAL = LabelFields()


def point_labels(
    cloud: Cloud, source: Path, classes: tuple[str, ...] = (), fields: LabelFields = USUAL
) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
    """Take class and object of every point.

    Args:
        cloud: N points.
        source: Its file, for messages.
        classes: Table for a cloud that names none; without any, all classes up to 255 are right.
        fields: Which attributes the labels are.

    Returns:
        (N,) uint8 class index, 255 unknown and so what was -1; (N,) int32 object id, 0 none and so
        what was below.

    Raises:
        InputError: No ``semantic`` or no ``instance``, or not a whole number in range for each
            point.
    """
    # classes, of the cloud's table or the one given
    semantic = _whole_numbers(cloud, "semantic", source, fields.semantic)
    semantic = np.where(semantic == -1, UNKNOWN, semantic)
    if table := cloud.classes or classes:
        check_classes(semantic, table, source)
    elif (wrong := (semantic < 0) | (semantic > UNKNOWN)).any():
        raise _wrong_point("class", semantic, wrong, source, f"0 to {UNKNOWN}", _REMEDY)

    # objects, none for numbers below 1
    instance = np.maximum(_whole_numbers(cloud, "instance", source, fields.instance), 0)
    if (wrong := instance > _LAST_OBJECT).any():
        remedy = "number objects from 1"
        raise _wrong_point("object", instance, wrong, source, f"at most {_LAST_OBJECT}", remedy)
    return semantic.astype(np.uint8), instance.astype(np.int32)


def confidence_column(cloud: Cloud, source: Path) -> NDArray[np.float64] | None:
    """Take the confidence of every point, (N,) float64; None if the cloud has none.

    Raises:
        InputError: Not a finite number for each point.
    """
    column = cloud.label("confidence")
    if column is None:
        return None
    is_number = column.ndim == 1 and column.dtype.kind in "iufb"
    if not is_number or not np.isfinite(column).all():
        raise InputError(source, "confidence that is no number", "a number for each point", _REMEDY)
    return column.astype(np.float64)


def check_classes(semantic: NDArray[np.integer], classes: tuple[str, ...], source: Path) -> None:
    """Refuse classes beyond the table, and a table that is too long.

    Args:
        semantic: (N,) class index, 255 unknown.
        classes: The table.
        source: The file, for the message.

    Raises:
        InputError: Names the first such class and its point, or the length of the table.
    """
    if len(classes) > UNKNOWN:
        raise InputError(source, f"{len(classes)} classes", f"at most {UNKNOWN}", "merge classes")
    wrong = (semantic < 0) | ((semantic >= len(classes)) & (semantic != UNKNOWN))
    if wrong.any():
        expected = f"0 to {len(classes) - 1}, or {UNKNOWN} for unknown"
        remedy = "give it its class table"
        raise _wrong_point("class", semantic, wrong, source, expected, remedy)


def find_label(
    cloud: Cloud, what: str, source: Path, named: str | None = None
) -> NDArray[np.generic] | None:
    """Find the classes or the objects of a cloud.

    Args:
        cloud: N points.
        what: ``semantic`` or ``instance``.
        source: Its file, for messages.
        named: The attribute that it is; None: that of a usual name, such as ``label`` or
            ``object_id``; of LAS without one, classifications of 64 and more.

    Returns:
        (N,) of any type; None if there is none.

    Raises:
        InputError: The cloud has no attribute of the name given.
    """
    if named is not None:
        column = cloud.columns.get(named, cloud.label(named))
        if column is None:
            found = f"no attribute {named} among {saw(cloud.columns, [named])}"
            raise InputError(source, found, "the one named", f"name another --{what}-field")
        return column

    # its own name, other usual ones, the classification of LAS
    if (column := cloud.label(what)) is not None:
        return column
    plain = {_plain(name): name for name in reversed(list(cloud.columns))}
    for name in _NAMES[what]:
        if name in plain:
            return cloud.columns[plain[name]]
    return _classification(cloud, source) if what == "semantic" else None


def _plain(name: str) -> str:
    """Return a name without case, separators and CloudCompare's prefix."""
    return "".join(letter for letter in name.lower().removeprefix("scalar_") if letter.isalnum())


def _classification(cloud: Cloud, source: Path) -> NDArray[np.generic] | None:
    """Take classes from a classification: of LAS, the user's own start at 64.

    Raises:
        InputError: The classification is that of the LAS standard, whose classes are others.
    """
    column = cloud.columns.get("classification")
    if column is None or cloud.las_header is None:
        return cloud.label("classification")
    numbers = column.astype(np.int64)
    if (numbers >= _STANDARD_CLASSES).any():
        return np.where(numbers >= _STANDARD_CLASSES, numbers - _STANDARD_CLASSES, UNKNOWN)
    if (numbers > _OTHER).any():
        found = f"classification {numbers.max()}, of the LAS standard (2 ground, 6 building)"
        remedy = "give --semantic-field classification if these are the classes"
        raise InputError(source, found, "semantic, or classification from 64 up", remedy)
    return None


def _whole_numbers(
    cloud: Cloud, name: str, source: Path, named: str | None = None
) -> NDArray[np.int64]:
    """Take a label as int64, if it is one whole number for each point."""
    column = find_label(cloud, name, source, named)
    if column is None:
        expected = "semantic and instance for every point"
        remedy = f"label them, or name the attribute by --{name}-field"
        found = f"points without {name}, with {saw(cloud.columns, [name])}"
        raise InputError(source, found, expected, remedy)
    if column.ndim != 1 or column.dtype.kind not in "iufb":
        found = f"{name} {column.dtype} {column.shape}"
        raise InputError(source, found, "a whole number for every point", _REMEDY)

    # what int64 does not hold is not whole either
    with np.errstate(invalid="ignore", over="ignore"):
        is_small = column.dtype.kind in "bi" or np.abs(column) < 2.0**62
        numbers = np.where(is_small, column, 0).astype(np.int64)
        wrong = ~np.broadcast_to(is_small, column.shape) | (numbers != column)
    if wrong.any():
        expected = "a whole number for every point"
        raise _wrong_point(name, column, wrong, source, expected, _REMEDY)
    return numbers


def _wrong_point(
    what: str,
    values: NDArray[np.generic],
    wrong: NDArray[np.bool_],
    source: Path,
    expected: str,
    remedy: str,
) -> InputError:
    """Name the first point that is wrong and its value."""
    point = int(wrong.argmax())
    return InputError(source, f"{what} {values[point]} (point {point:,})", expected, remedy)
