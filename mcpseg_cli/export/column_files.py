"""Points of a map by columns on the disk: what is in memory is one column, whatever the map."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import naming
from mcpseg_cli.grid import by_column

Column = tuple[int, ...]


class ColumnFiles:
    """Rows of one kind in a file for each column, in the order they came in.

    Args:
        folder: An empty one, or one with columns of other suffixes.
        kind: Of the rows.
        suffix: Of the files.
    """

    def __init__(self, folder: Path, kind: np.dtype[np.void], suffix: str) -> None:
        self._folder, self._kind, self._suffix = folder, kind, suffix
        self._columns: set[Column] = set()

    @property
    def columns(self) -> list[Column]:
        """Those that have a row, in order."""
        return sorted(self._columns)

    def append(self, column: Column, rows: NDArray[np.void]) -> None:
        """Add rows to a column.

        Raises:
            OSError: The disk is full.
        """
        path = self._path(column)
        with naming(path), path.open("ab") as file:
            file.write(rows.tobytes())
        self._columns.add(column)

    def add(self, columns: NDArray[np.integer], rows: NDArray[np.void]) -> None:
        """Add (N,) rows to their columns, (N, C)."""
        for column, which in by_column(columns):
            self.append(column, rows[which])

    def take(self, column: Column) -> NDArray[np.void]:
        """Read a column and delete its file; nothing for one that has no row."""
        if column not in self._columns:
            return np.empty(0, self._kind)
        path = self._path(column)
        rows: NDArray[np.void] = np.fromfile(path, self._kind)
        path.unlink()
        self._columns.remove(column)
        return rows

    def _path(self, column: Column) -> Path:
        return self._folder / f"{'_'.join(map(str, column))}.{self._suffix}"
