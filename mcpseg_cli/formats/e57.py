"""E57 (ASTM E2807) through pye57: coordinates and colours as the standard has them, labels as an extension."""

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
            _write_points(
                target, _add_scan(target, first, _bounds(parts)), parts, list(first.columns)
            )
    except libe57.E57Exception as error:
        raise OutputError(
            f"libE57: {error}; expected room on the disk; make space and try again"
        ) from error


def _bounds(parts: CloudParts) -> NDArray[np.float64]:
    """Return (2, 3) lowest and highest coordinates, metres."""
    corners = [
        corner for cloud in parts for corner in (cloud.xyz.min(axis=0), cloud.xyz.max(axis=0))
    ]
    return np.array([np.min(corners, axis=0), np.max(corners, axis=0)], np.float64)


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
    box = libe57.StructureNode(file)
    for axis, low, high in zip("xyz", *bounds.tolist(), strict=True):
        box.set(f"{axis}Minimum", libe57.FloatNode(file, low))
        box.set(f"{axis}Maximum", libe57.FloatNode(file, high))
    scan.set("cartesianBounds", box)
    colour = libe57.StructureNode(file)
    for name in ("Red", "Green", "Blue"):
        colour.set(f"color{name}Minimum", libe57.IntegerNode(file, 0))
        colour.set(f"color{name}Maximum", libe57.IntegerNode(file, 255))
    scan.set("colorLimits", colour)
    target.data3d.append(scan)
    prototype = libe57.StructureNode(file)
    for name, column in first.columns.items():
        if column.dtype.kind == "f":
            precision = libe57.E57_DOUBLE if column.dtype.itemsize > 4 else libe57.E57_SINGLE
            prototype.set(_FIELDS[name], libe57.FloatNode(file, 0.0, precision))
        else:
            limits = np.iinfo(np.dtype(column.dtype.str))
            prototype.set(
                _FIELDS[name], libe57.IntegerNode(file, 0, int(limits.min), int(limits.max))
            )
    points = libe57.CompressedVectorNode(file, prototype, libe57.VectorNode(file, True))
    scan.set("points", points)
    return points


def _write_points(
    target: E57, points: libe57.CompressedVectorNode, parts: CloudParts, names: list[str]
) -> None:
    """Send the points through one buffer for each attribute."""
    first = next(iter(parts))
    arrays = {name: np.empty(_BUFFER, _buffered(first.columns[name].dtype)) for name in names}
    buffers = libe57.VectorSourceDestBuffer()
    for name, array in arrays.items():
        buffers.append(
            libe57.SourceDestBuffer(target.image_file, _FIELDS[name], array, _BUFFER, True, True)
        )
    writer = points.writer(buffers)
    for cloud in parts:
        for start in range(0, len(cloud), _BUFFER):
            count = min(_BUFFER, len(cloud) - start)
            for name, array in arrays.items():
                array[:count] = cloud.columns[name][start : start + count]
            writer.write(count)
    writer.close()


def _buffered(dtype: np.dtype[np.generic]) -> np.dtype[np.generic]:
    """Return the type that values go through the buffer in: pye57 takes numpy's int64 for 32 bits, longlong for 64."""
    return np.dtype(np.longlong) if dtype.kind in "iu" and dtype.itemsize > 2 else dtype
