"""Growing arrays: what a map knows of its voxels and objects, one row each."""

from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

ScalarT = TypeVar("ScalarT", bound=np.generic)

RESERVED_ROWS = 1 << 22
"""Rows asked for at first; from there on capacity doubles.

Memory is given by the page on first touch, so that unused rows cost nothing and a map does not stop
to copy itself until it has four million voxels.
"""


class Column(Generic[ScalarT]):
    """Rows that are appended; an append costs O(rows appended), on average.

    Args:
        dtype: Type of an element.
        shape: Shape of one row; () for a plain number.
    """

    def __init__(self, dtype: type[ScalarT], *shape: int) -> None:
        self._data: NDArray[ScalarT] = np.empty((RESERVED_ROWS, *shape), dtype)
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
            grown = np.empty((capacity, *self._data.shape[1:]), self._data.dtype)
            grown[:start] = self.rows
            self._data = grown
        self._count = end
        return self._data[start:end]

    def truncate(self, count: int) -> None:
        """Forget the rows from ``count`` on."""
        self._count = min(count, self._count)
