"""The voxels of all maps by column, on the disk: what is read is one column, whatever their sum."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import naming
from mcpseg_cli.incremental.uniting import WIDTH, PartVoxels, column_of

Column = tuple[int, int]


class Spool:
    """Columns of voxels in a folder.

    Args:
        folder: An empty one.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._columns: set[Column] = set()

    @property
    def columns(self) -> list[Column]:
        """Those that have a voxel of their own, in order."""
        return sorted(self._columns)

    def add(self, rows: PartVoxels) -> None:
        """Write voxels to their columns, and to the rims of the columns next to them.

        Raises:
            OSError: The disk is full.
        """
        own = column_of(rows.voxel)
        for column, ids in _grouped(own).items():
            self._columns.add(column)
            self._append(column, rows.select(ids))

        # a voxel at a border is of the rims of up to three others
        place = rows.voxel[:, :2] - own * np.int32(WIDTH)
        step = (place == WIDTH - 1).astype(np.int32) - (place == 0)
        for which in ((1, 0), (0, 1), (1, 1)):
            away = np.flatnonzero(np.all((step != 0) >= np.array(which, bool), axis=1))
            target = own[away] + step[away] * np.array(which, np.int32)
            for column, ids in _grouped(target).items():
                self._append(column, rows.select(away[ids]))

    def read(self, column: Column) -> PartVoxels:
        """Read the voxels of a column and of its rim."""
        pieces: list[list[NDArray[np.generic]]] = []
        with self._path(column).open("rb") as file:
            end = file.seek(0, 2)
            file.seek(0)
            while file.tell() < end:
                pieces.append([np.load(file, allow_pickle=False) for _ in range(7)])

        # embeddings were cut to what is not zero
        width = max(piece[4].shape[1] for piece in pieces)
        for piece in pieces:
            piece[4] = np.pad(piece[4], ((0, 0), (0, width - piece[4].shape[1])))
        return PartVoxels(*(np.concatenate(column) for column in zip(*pieces, strict=True)))

    def remove(self, column: Column) -> None:
        """Delete a column."""
        self._path(column).unlink()

    def _append(self, column: Column, rows: PartVoxels) -> None:
        path = self._path(column)
        with naming(path), path.open("ab") as file:
            for values in vars(rows).values():
                np.save(file, values, allow_pickle=False)

    def _path(self, column: Column) -> Path:
        return self._folder / f"{column[0]}_{column[1]}.rows"


def _grouped(columns: NDArray[np.int32]) -> dict[Column, NDArray[np.int64]]:
    """List the rows of each column."""
    if len(columns) == 0:
        return {}
    order = np.lexsort((columns[:, 1], columns[:, 0]))
    changes = np.flatnonzero(np.any(np.diff(columns[order], axis=0) != 0, axis=1)) + 1
    groups = np.split(order, changes)
    found: dict[Column, NDArray[np.int64]] = {}
    for ids in groups:
        x, y = columns[ids[0]].tolist()
        found[x, y] = ids
    return found
