"""E57 (ASTM E2807) through pye57: labels are an extension of what the standard has."""

from __future__ import annotations

import uuid
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pye57 import E57, libe57

from mcpseg_cli.errors import OutputError
from mcpseg_cli.formats.cloud import Cloud
from mcpseg_cli.formats.parts import CloudParts

_EXTENSION = ("mcpseg", "urn:mcpseg:labels:1")
_FIELDS = {  # by attribute
    "x": "cartesianX",
    "y": "cartesianY",
    "z": "cartesianZ",
    "red": "colorRed",
    "green": "colorGreen",
    "blue": "colorBlue",
    "semantic": "mcpseg:semantic",
    "instance": "mcpseg:instance",
    "confidence": "mcpseg:confidence",
}
_BUFFER = 1 << 16


def write_e57(path: Path, parts: CloudParts) -> None:
    """Write a labelled cloud as one scan of an E57 file, part by part.

    The class table is the scan's description: ``classes: ceiling,floor,…``.

    Args:
        path: The file; replaced if there.
        parts: The points; attributes other than coordinates, colour and labels are refused.

    Raises:
        OutputError: An attribute without a place, or libE57 fails, as on a full disk.
    """
    first = next(iter(parts))
    if foreign := [name for name in first.columns if name not in _FIELDS]:
        raise OutputError(
            f"E57 has no place for {', '.join(foreign)}; expected coordinates, colour and labels"
        )

    try:
        with E57(str(path), mode="w") as target:
            target.image_file.extensionsAdd(*_EXTENSION)
            points = _add_scan(target, first, _bounds(parts))
            _write_points(target, points, parts, list(first.columns))
    except libe57.E57Exception as error:
        raise OutputError(
            "cannot be written; expected room on the disk; make space and run the command again"
        ) from error


def _bounds(parts: CloudParts) -> NDArray[np.float64]:
    """Return (2, 3) lowest and highest coordinates, metres."""
    corners = np.array([(cloud.xyz.min(axis=0), cloud.xyz.max(axis=0)) for cloud in parts])
    return np.array([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)], np.float64)


def _add_scan(
    target: E57, first: Cloud, bounds: NDArray[np.float64]
) -> libe57.CompressedVectorNode:
    """Describe the one scan of the file; return where its points go."""
    file = target.image_file
    scan = libe57.StructureNode(file)
    texts = {
        "guid": f"{{{uuid.uuid4()}}}",
        "name": "mcpseg map",
        "description": f"classes: {','.join(first.classes)}",
    }
    for name, text in texts.items():
        scan.set(name, libe57.StringNode(file, text))
    for name, limits in (("cartesianBounds", _box(file, bounds)), ("colorLimits", _colours(file))):
        scan.set(name, limits)
    target.data3d.append(scan)

    # what its points have
    prototype = libe57.StructureNode(file)
    for name, column in first.columns.items():
        prototype.set(_FIELDS[name], _field(file, column.dtype))
    points = libe57.CompressedVectorNode(file, prototype, libe57.VectorNode(file, True))
    scan.set("points", points)
    return points


def _box(file: libe57.ImageFile, bounds: NDArray[np.float64]) -> libe57.StructureNode:
    """Describe between which coordinates (2, 3) all points lie."""
    box = libe57.StructureNode(file)
    for axis, low, high in zip("xyz", *bounds.tolist(), strict=True):
        box.set(f"{axis}Minimum", libe57.FloatNode(file, low))
        box.set(f"{axis}Maximum", libe57.FloatNode(file, high))
    return box


def _colours(file: libe57.ImageFile) -> libe57.StructureNode:
    """Describe colours of 8 bits."""
    colour = libe57.StructureNode(file)
    for name in ("Red", "Green", "Blue"):
        colour.set(f"color{name}Minimum", libe57.IntegerNode(file, 0))
        colour.set(f"color{name}Maximum", libe57.IntegerNode(file, 255))
    return colour


def _field(file: libe57.ImageFile, dtype: np.dtype[np.generic]) -> libe57.Node:
    """Describe an attribute of this type."""
    if dtype.kind == "f":
        precision = libe57.E57_DOUBLE if dtype.itemsize > 4 else libe57.E57_SINGLE
        return libe57.FloatNode(file, 0.0, precision)
    limits = np.iinfo(np.dtype(dtype.str))
    return libe57.IntegerNode(file, 0, int(limits.min), int(limits.max))


def _write_points(
    target: E57, points: libe57.CompressedVectorNode, parts: CloudParts, names: list[str]
) -> None:
    """Send the points through one buffer for each attribute."""
    # the buffers
    first = next(iter(parts))
    arrays = {name: np.empty(_BUFFER, _buffered(first.columns[name].dtype)) for name in names}
    buffers = libe57.VectorSourceDestBuffer()
    file = target.image_file
    for name, array in arrays.items():
        buffers.append(libe57.SourceDestBuffer(file, _FIELDS[name], array, _BUFFER, True, True))

    # filled and sent again and again
    writer = points.writer(buffers)
    for cloud in parts:
        for start in range(0, len(cloud), _BUFFER):
            count = min(_BUFFER, len(cloud) - start)
            for name, array in arrays.items():
                array[:count] = cloud.columns[name][start : start + count]
            writer.write(count)
    writer.close()


def _buffered(dtype: np.dtype[np.generic]) -> np.dtype[np.generic]:
    """Return the type of a buffer: pye57 takes numpy's int64 for 32 bits, longlong for 64."""
    return np.dtype(np.longlong) if dtype.kind in "iu" and dtype.itemsize > 2 else dtype
