"""The objects of a map that is never in memory as a whole: some at a time, from the disk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import OutputError
from mcpseg_cli.export.column_files import ColumnFiles
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.incremental.objects import MapObject, list_objects

MOST_OBJECTS = (1 << 24) - 1
"""The page keeps an object's place in three bytes."""
_TOGETHER = 1 << 20  # voxels whose objects are listed together, or one object that has more
_ROW = np.dtype(
    [("xyz", "<f4", (3,)), ("semantic", "u1"), ("confidence", "<f4"), ("instance", "<i4")]
)


class TiledObjects:
    """Collects the voxels of objects, in files of some objects each.

    Args:
        sizes: (K,) int64 points of each object by id, 0 of none first.
        classes: Class names.
        folder: For the files.

    Attributes:
        ids: (O,) int32 ids of all objects that have a voxel, ascending, after 0, none.

    Raises:
        OutputError: There are more than a page can tell apart.
    """

    def __init__(self, sizes: NDArray[np.int64], classes: tuple[str, ...], folder: Path) -> None:
        ids = np.flatnonzero(sizes)
        self.ids = np.union1d(np.zeros(1, np.int64), ids).astype(np.int32)
        if len(self.ids) > MOST_OBJECTS:
            raise OutputError(
                f"{len(self.ids) - 1:,} objects; expected at most {MOST_OBJECTS - 1:,} on a page; "
                "leave small ones out with --min-points"
            )
        self._classes = classes
        self._rows = ColumnFiles(folder, _ROW, "objects")
        counts = np.append(sizes, 0)[self.ids]
        self._batch = np.cumsum(counts) // _TOGETHER
        self._floors = np.zeros(len(self.ids))
        self._sizes = counts

    def add(self, seen: NDArray[np.void], floor: NDArray[np.float64]) -> NDArray[np.int64]:
        """Take note of voxels.

        Args:
            seen: (N,) of the kind ``spooled_map.SEEN``.
            floor: (N,) height of the floor at each, metres, map frame.

        Returns:
            (N,) places of their objects in ``ids``.
        """
        place: NDArray[np.int64] = np.searchsorted(self.ids, seen["instance"])
        np.add.at(self._floors, place, floor)
        owned = np.flatnonzero(place)
        rows = np.empty(len(owned), _ROW)
        for name in _ROW.names or ():
            rows[name] = seen[name][owned]
        self._rows.add(self._batch[place[owned], None], rows)
        return place

    @property
    def floors(self) -> NDArray[np.float64]:
        """(O,) mean height of the floor under each object, metres, map frame."""
        means: NDArray[np.float64] = self._floors / np.maximum(self._sizes, 1)
        return means

    def listed(self) -> list[MapObject]:
        """Take stock of all, by id; forgets their voxels."""
        found: list[MapObject] = []
        for batch in self._rows.columns:
            rows = self._rows.take(batch)
            nothing = np.empty((len(rows), 0), np.int16)
            known = MapRows(
                rows["xyz"], np.empty((len(rows), 3), np.uint8), rows["semantic"],
                rows["confidence"], rows["instance"], nothing,
            )  # fmt: skip
            found += list_objects(known, self._classes)
        return found
