"""The fields of ROS messages that are used, and the arrays that clouds and images hold."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.cloud import Cloud

CLOUD = "sensor_msgs/msg/PointCloud2"
IMAGE = "sensor_msgs/msg/Image"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
DEPTH_ENCODINGS = {"16UC1": ("u2", 1000.0), "mono16": ("u2", 1000.0), "32FC1": ("f4", 1.0)}
COLOUR_ENCODINGS = {"rgb8": (0, 1, 2), "bgr8": (2, 1, 0), "rgba8": (0, 1, 2), "bgra8": (2, 1, 0)}
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
_PACKED = ("rgb", "rgba")


class Time(Protocol):
    """A moment."""

    sec: int
    nanosec: int


class Header(Protocol):
    """When and in which frame."""

    stamp: Time
    frame_id: str


class Field(Protocol):
    """A field of the points of a cloud."""

    name: str
    offset: int
    datatype: int
    count: int


class PointCloud2(Protocol):
    """``sensor_msgs/PointCloud2``."""

    header: Header
    height: int
    width: int
    fields: list[Field]
    is_bigendian: bool
    point_step: int
    row_step: int
    data: NDArray[np.uint8]


class Image(Protocol):
    """``sensor_msgs/Image``."""

    header: Header
    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    data: NDArray[np.uint8]


def time_ns(time: Time) -> int:
    """Return a moment as nanoseconds."""
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def points_of(path: Path, message: PointCloud2, *, drops_zeros: bool) -> Cloud:
    """Take the points of a cloud; those without coordinates are dropped.

    Args:
        path: The bag, for messages.
        message: The cloud.
        drops_zeros: Whether points at the origin, where the sensor is, are none.

    Raises:
        InputError: It is damaged, or has no x y z.
    """
    table = _table(path, message)
    names = list(table.dtype.names or ())
    if missing := [axis for axis in "xyz" if axis not in names]:
        found = f"a cloud without {', '.join(missing)}, of {', '.join(names)[:80]}"
        raise InputError(path, found, "fields x y z", "choose another topic (--topic)")
    with np.errstate(invalid="ignore"):  # a signalling NaN is as bad as a quiet one
        axes = [table[axis].astype(np.float64) for axis in "xyz"]
    valid = np.isfinite(axes).all(axis=0)
    if drops_zeros:
        valid &= (np.array(axes) != 0).any(axis=0)

    columns: dict[str, NDArray[np.generic]] = {}
    for name in names:
        values = table[name][valid]
        if name in _PACKED and values.dtype.itemsize == 4:
            packed = np.ascontiguousarray(values).view("<u4")
            for shift, colour in zip((16, 8, 0), ("red", "green", "blue"), strict=True):
                columns[colour] = (packed >> shift & 255).astype(np.uint8)
        else:
            columns[name] = np.ascontiguousarray(values)
    return Cloud(columns)


def _table(path: Path, message: PointCloud2) -> NDArray[np.void]:
    """Lay the fields over the bytes; (N,) records in the byte order of this machine."""
    order = ">" if message.is_bigendian else "<"
    fields = [field for field in message.fields if field.datatype in _TYPES]
    try:
        dtype = _point_type(fields, order, message.point_step)
    except (ValueError, TypeError, OverflowError) as error:
        found = f"fields that do not fit points of {message.point_step} bytes"
        raise InputError(path, found, "a sound PointCloud2", "record it again") from error
    rows = _rows(path, message, message.row_step, message.width * message.point_step)
    table = rows.reshape(-1).view(dtype)
    return table if order == "<" else table.astype(table.dtype.newbyteorder("<"))


def _point_type(fields: Sequence[Field], order: str, size: int) -> np.dtype[np.void]:
    """Lay fields out over a point."""
    kinds = [order + _TYPES[field.datatype] for field in fields]
    return np.dtype(
        {
            "names": [field.name for field in fields],
            "formats": [
                (kind, (field.count,)) if field.count > 1 else kind
                for kind, field in zip(kinds, fields, strict=True)
            ],
            "offsets": [field.offset for field in fields],
            "itemsize": size,
        }
    )


def _rows(path: Path, message: PointCloud2 | Image, step: int, used: int) -> NDArray[np.uint8]:
    """Take the used bytes of every row: (height, used) uint8."""
    data = np.asarray(message.data, np.uint8)
    step = step or used
    if step < used or len(data) < (message.height - 1) * step + used:
        found = f"{len(data):,} bytes for {message.height} rows of {used:,}"
        raise InputError(path, found, "a whole message", "record it again")
    if message.height == 1:
        step = used  # the padding of a single row may be any number
    padded = np.zeros(message.height * step, np.uint8)
    padded[: len(data)] = data[: len(padded)]
    return np.ascontiguousarray(padded.reshape(message.height, step)[:, :used])


def depth_of(path: Path, message: Image) -> NDArray[np.float64]:
    """Take the depths of an image: (H, W) float64 metres, 0 or NaN where there is none.

    Raises:
        InputError: It is damaged, or of another encoding.
    """
    if message.encoding not in DEPTH_ENCODINGS:
        found = f"an image encoded {message.encoding}"
        raise InputError(path, found, ", ".join(DEPTH_ENCODINGS), "choose another topic (--topic)")
    kind, per_metre = DEPTH_ENCODINGS[message.encoding]
    dtype = np.dtype((">" if message.is_bigendian else "<") + kind)
    rows = _rows(path, message, message.step, message.width * dtype.itemsize)
    with np.errstate(invalid="ignore"):
        depth: NDArray[np.float64] = rows.view(dtype).astype(np.float64) / per_metre
    return depth


def colour_of(path: Path, message: Image) -> NDArray[np.uint8] | None:
    """Take the colours of an image: (H, W, 3) uint8; None for an encoding that has none."""
    order = COLOUR_ENCODINGS.get(message.encoding)
    if order is None:
        return None
    channels = 4 if "a" in message.encoding else 3
    rows = _rows(path, message, message.step, message.width * channels)
    return rows.reshape(message.height, message.width, channels)[:, :, list(order)]
