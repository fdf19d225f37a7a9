"""The chosen voxels of a map by the columns of the deepest tiles, on the disk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.export.column_files import Column, ColumnFiles
from mcpseg_cli.export.octree import CELL_BITS, CELLS
from mcpseg_cli.grid import rims_of, voxel_of
from mcpseg_cli.segment.labelled_run import MapPart

SEEN = np.dtype(
    [("xyz", "<f4", (3,)), ("rgb", "u1", (3,)), ("semantic", "u1"), ("confidence", "<f4"),
     ("instance", "<i4"), ("scan", "<i4")]
)  # fmt: skip
"""A voxel, columns as those of ``MapPart``."""
_RIM = np.dtype([("xyz", "<f4", (3,))])


class SpooledMap:
    """Voxels by columns, square and as wide as a tile, and what is counted on the way.

    Args:
        folder: An empty one.
        voxel_size: Metres.

    Attributes:
        low, high: (3,) int32 least and greatest voxel.
        lowest, highest: (3,) float32 corners of the points, metres, map frame.
        num_points: (256,) int64 points of each class.
    """

    def __init__(self, folder: Path, voxel_size: float) -> None:
        self._voxel_size = voxel_size
        self._seen = ColumnFiles(folder, SEEN, "seen")
        self._rims = ColumnFiles(folder, _RIM, "rim")
        self.low, self.high = np.full(3, 1 << 30, np.int32), np.full(3, -(1 << 30), np.int32)
        self.lowest, self.highest = np.full(3, np.inf, np.float32), np.full(3, -np.inf, np.float32)
        self.num_points = np.zeros(256, np.int64)
        self._sizes = np.zeros(1, np.int64)  # and zeros behind those that there are

    def __len__(self) -> int:
        return int(self.num_points.sum())

    @property
    def sizes(self) -> NDArray[np.int64]:
        """(K,) points of each object by id, 0 of none first, up to the last that has a point."""
        return np.trim_zeros(self._sizes, "b")

    @property
    def columns(self) -> list[Column]:
        """Places of all columns that have a voxel, x and y in tiles from voxel 0, in order."""
        return self._seen.columns

    def add(self, part: MapPart) -> None:
        """Write voxels to their columns, and to the rims of the columns next to them.

        Raises:
            OSError: The disk is full.
        """
        rows = np.empty(len(part), SEEN)
        for name in SEEN.names or ():
            rows[name] = getattr(part, name)
        voxel = voxel_of(part.xyz, self._voxel_size)
        self._seen.add(voxel[:, :2] >> CELL_BITS, rows)
        for touching, columns in rims_of(voxel[:, :2], CELLS):
            rim = np.empty(len(touching), _RIM)
            rim["xyz"] = part.xyz[touching]
            self._rims.add(columns, rim)
        self._count(part, voxel)

    def take(self, column: Column) -> tuple[NDArray[np.void], NDArray[np.float32]]:
        """Read a column and forget it.

        Returns:
            Its voxels, and (R, 3) positions of those around it, within a voxel of it.
        """
        rim: NDArray[np.float32] = self._rims.take(column)["xyz"]
        return self._seen.take(column), rim

    def _count(self, part: MapPart, voxel: NDArray[np.int32]) -> None:
        self.low = np.minimum(self.low, voxel.min(axis=0))
        self.high = np.maximum(self.high, voxel.max(axis=0))
        self.lowest = np.minimum(self.lowest, part.xyz.min(axis=0))
        self.highest = np.maximum(self.highest, part.xyz.max(axis=0))
        self.num_points += np.bincount(part.semantic, minlength=256)
        ids, counts = np.unique(part.instance, return_counts=True)
        if ids[-1] >= len(self._sizes):
            self._sizes = np.pad(self._sizes, (0, int(ids[-1])))
        self._sizes[ids] += counts
