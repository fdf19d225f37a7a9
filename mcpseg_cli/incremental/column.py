"""Growing arrays: what a map knows of its voxels and objects, one row each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

ScalarT = TypeVar("ScalarT", bound=np.generic)

RESERVED_ROWS = 1 << 22
"""Rows asked for at first; from there on capacity doubles.

Memory is given by the page on first touch, so that unused rows cost nothing and a map does not stop
to copy itself until it has four million voxels.
"""


class Memory:
    """Where rows are: in memory, all of them; ``segment.paging`` keeps those near the robot."""

    holds_all = True
    """Whether all rows are in memory."""

    def rows(self, dtype: type[ScalarT], shape: tuple[int, ...], count: int) -> NDArray[ScalarT]:
        """Give an array of at least so many rows of a shape, all zero."""
        return np.zeros((count, *shape), dtype)

    def leave(self, position: NDArray[np.float64], near: Near) -> None:
        """Note where the robot is after a scan; what is far from it may leave memory.

        Args:
            position: (3,) float64, metres, map frame.
            near: Lists the voxels within a distance of a place.
        """

    def leave_all(self) -> None:
        """Let all rows leave memory; they come back when they are touched."""


Near = Callable[[NDArray[np.float64], float, float], NDArray[np.int32]]
"""As ``VoxelMap.near``: position, radius, height; ascending ids."""

IN_MEMORY = Memory()


class Column(Generic[ScalarT]):
    """Rows that are appended; an append costs O(rows appended), on average.

    Args:
        dtype: Type of an element.
        shape: Shape of one row; () for a plain number.
        memory: Where they are.
    """

    def __init__(self, dtype: type[ScalarT], *shape: int, memory: Memory = IN_MEMORY) -> None:
        self._memory = memory
        self._data: NDArray[ScalarT] = memory.rows(dtype, shape, RESERVED_ROWS)
        self._count = 0

    @property
    def rows(self) -> NDArray[ScalarT]:
        """All rows so far: a view, valid until the next append."""
        return self._data[: self._count]

    def append(self, rows: NDArray[ScalarT]) -> None:
        """Copy rows to the end."""
        self._extend(len(rows))[:] = rows

    def append_zeros(self, count: int) -> None:
        """Append so many rows of zeros."""
        self._extend(count)[:] = 0

    def _extend(self, count: int) -> NDArray[ScalarT]:
        """Make room at the end; return the new rows, to be filled."""
        start, end = self._count, self._count + count
        if end > len(self._data):
            capacity = max(end, 2 * len(self._data))
            dtype = self._data.dtype.type
            grown: NDArray[ScalarT] = self._memory.rows(dtype, self._data.shape[1:], capacity)
            grown[:start] = self.rows
            self._data = grown
        self._count = end
        return self._data[start:end]

    def truncate(self, count: int) -> None:
        """Forget the rows from ``count`` on."""
        self._count = min(count, self._count)
