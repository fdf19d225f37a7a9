"""LAS and LAZ through laspy: read and written in chunks, scales, reference system and extra bytes kept."""

import copy
from pathlib import Path
from typing import BinaryIO

import laspy
import numpy as np
from lazrs import LazrsError
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.cloud import Cloud

_CHUNK = 1_000_000  # points decompressed at a time
_CLASS_BASE = 64  # classifications 64-255 are the user's (LAS 1.4, table 17)
_COORDINATES = {"x": "X", "y": "Y", "z": "Z"}
_LABELS = {"semantic": np.uint8, "instance": np.int32, "confidence": np.float32}
_CLASSES_RECORD = ("mcpseg", 1)


def read_las(path: Path) -> Cloud:
    """Read a LAS or LAZ file with all its dimensions; coordinates are scaled to float64 metres.

    Args:
        path: The file.

    Returns:
        Its points, and its header for writing them back.

    Raises:
        InputError: Not LAS, cut short, or a compressed chunk that does not decode.
    """
    try:
        with laspy.open(path) as reader:
            header = reader.header
            records = [record.array.copy() for record in reader.chunk_iterator(_CHUNK)]
    except (laspy.LaspyException, LazrsError, ValueError, EOFError, OverflowError, MemoryError) as error:
        raise InputError(
            path,
            f"a file that does not decode ({str(error).strip() or type(error).__name__})",
            "an undamaged LAS or LAZ",
            "copy it again",
        ) from error
    table = np.concatenate(records) if records else np.empty(0, header.point_format.dtype())
    if len(table) != header.point_count:
        raise InputError(
            path,
            f"{header.point_count:,} points promised, {len(table):,} found",
            "all of them",
            "the file is cut short; copy it again",
        )
    points = laspy.ScaleAwarePointRecord(table, header.point_format, header.scales, header.offsets)
    columns: dict[str, NDArray[np.generic]] = {name: np.asarray(points[name]) for name in "xyz"}
    for name in header.point_format.dimension_names:
        if name not in _COORDINATES.values():
            columns[name] = np.asarray(points[name])
    return Cloud(columns, _read_classes(header), header)


def write_las(file: BinaryIO, cloud: Cloud, *, compress: bool) -> None:
    """Write a cloud as LAS 1.4 or LAZ, in chunks; labels go to extra bytes and, from 64 up, to ``classification``.

    Args:
        file: Where to write.
        cloud: The points; attributes LAS has no dimension for become extra bytes.
        compress: Whether to write LAZ.
    """
    header = _header_for(cloud)
    with laspy.open(file, mode="w", header=header, do_compress=compress, closefd=False) as writer:
        for start in range(0, len(cloud), _CHUNK):
            writer.write_points(_record(header, cloud, slice(start, start + _CHUNK)))


def _header_for(cloud: Cloud) -> laspy.LasHeader:
    """Make a header that has room for every attribute of the cloud."""
    if cloud.las_header is not None:
        header = copy.deepcopy(cloud.las_header)
    else:
        header = laspy.LasHeader(point_format=7 if cloud.rgb is not None else 6, version="1.4")
        header.scales = np.full(3, 1e-4)
        header.offsets = np.floor([cloud.columns[axis].astype(np.float64).min(initial=0.0) for axis in "xyz"])
    known = set(header.point_format.dimension_names)
    for name, column in cloud.columns.items():
        if name not in known and name not in _COORDINATES:
            dtype = _LABELS.get(name, column.dtype.type)
            header.add_extra_dim(laspy.ExtraBytesParams(name=name[:32], type=np.dtype(dtype)))
    if cloud.classes:
        header.vlrs = [vlr for vlr in header.vlrs if (vlr.user_id, vlr.record_id) != _CLASSES_RECORD]
        header.vlrs.append(laspy.VLR(*_CLASSES_RECORD, "class names", ",".join(cloud.classes).encode()))
    return header


def _record(header: laspy.LasHeader, cloud: Cloud, rows: slice) -> laspy.ScaleAwarePointRecord:
    """Fill a point record with some rows of the cloud."""
    points = laspy.ScaleAwarePointRecord.zeros(len(cloud.columns["x"][rows]), header=header)
    for name, column in cloud.columns.items():
        points[name[:32]] = column[rows]
    if cloud.las_header is None and (rgb := cloud.rgb) is not None:
        for channel, name in enumerate(("red", "green", "blue")):
            points[name] = rgb[rows, channel].astype(np.uint16) * 257
    if "semantic" in cloud.columns and header.point_format.id >= 6:
        semantic = cloud.columns["semantic"][rows].astype(np.int64)
        points["classification"] = np.where(semantic < 255 - _CLASS_BASE, semantic + _CLASS_BASE, 1)
    return points


def _read_classes(header: laspy.LasHeader) -> tuple[str, ...]:
    for vlr in header.vlrs:
        if (vlr.user_id, vlr.record_id) == _CLASSES_RECORD:
            return tuple(vlr.record_data_bytes().decode("latin-1").split(","))
    return ()
