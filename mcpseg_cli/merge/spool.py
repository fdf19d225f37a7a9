"""The voxels of all maps by column, on the disk: what is read is one column, whatever their sum."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import naming
from mcpseg_cli.grid import by_column, rims_of
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
        for column, ids in by_column(column_of(rows.voxel)):
            self._columns.add((column[0], column[1]))
            self._append(column, rows.select(ids))
        for touching, others in rims_of(rows.voxel[:, :2], WIDTH):
            for column, ids in by_column(others):
                self._append(column, rows.select(touching[ids]))

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

    def _append(self, column: tuple[int, ...], rows: PartVoxels) -> None:
        path = self._path(column)
        with naming(path), path.open("ab") as file:
            for values in vars(rows).values():
                np.save(file, values, allow_pickle=False)

    def _path(self, column: tuple[int, ...]) -> Path:
        return self._folder / f"{column[0]}_{column[1]}.rows"
