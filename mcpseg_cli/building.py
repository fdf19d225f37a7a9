"""The record of a labelled building: what ray tracing drives a robot through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import S3DIS_CLASSES


@dataclass(frozen=True)
class Mesh:
    """The triangles that a building's points lie on.

    Attributes:
        triangles: (T, 3, 3) float32 corners, metres, map frame.
        points: (T,) int64 a point of the building on each.
    """

    triangles: NDArray[np.float32]
    points: NDArray[np.int64]


@dataclass(frozen=True)
class Building:
    """A labelled point cloud of one building (an S3DIS area), room after room.

    Attributes:
        xyz: (N, 3) float32, metres, map frame, z up.
        rgb: (N, 3) uint8.
        semantic: (N,) uint8 index into ``classes``, 255 unknown.
        instance: (N,) int32 object id, 0 none; ``object_names[id - 1]`` is what the object is
            called.
        classes: Class names.
        rooms: Name of each room.
        room_starts: (rooms + 1,) int64; room ``r`` holds the points from ``room_starts[r]`` to
            ``room_starts[r + 1]``.
        object_names: ``room/class_k`` by object; empty when the source does not name them.
        mesh: The triangles that rays end on; None where there are only points.
    """

    xyz: NDArray[np.float32]
    rgb: NDArray[np.uint8]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]
    classes: tuple[str, ...] = S3DIS_CLASSES
    rooms: tuple[str, ...] = ()
    room_starts: NDArray[np.int64] | None = None
    object_names: tuple[str, ...] = ()
    mesh: Mesh | None = None

    def __post_init__(self) -> None:
        shapes = (self.xyz.shape, self.rgb.shape, self.semantic.shape, self.instance.shape)
        count = len(self.xyz)
        if shapes != ((count, 3), (count, 3), (count,), (count,)):
            raise ValueError(f"xyz, rgb, semantic and instance have shapes {shapes}")
        types = (self.xyz.dtype, self.rgb.dtype, self.semantic.dtype, self.instance.dtype)
        if [str(dtype) for dtype in types] != ["float32", "uint8", "uint8", "int32"]:
            raise ValueError(f"xyz, rgb, semantic and instance have types {types}")

    def __len__(self) -> int:
        return len(self.xyz)

    def class_counts(self) -> dict[str, int]:
        """Count the points of each class, in the order of ``classes``."""
        counts = np.bincount(self.semantic, minlength=256)
        return {name: int(counts[index]) for index, name in enumerate(self.classes)}

    def room_of(self) -> NDArray[np.int32]:
        """Return the (N,) int32 room number of every point; all zero when rooms are not known."""
        if self.room_starts is None:
            return np.zeros(len(self), np.int32)
        return np.repeat(np.arange(len(self.rooms), dtype=np.int32), np.diff(self.room_starts))
