"""Which voxel a coordinate falls into, by the one rounding rule, and which columns a voxel."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

MAX_VOXEL = 1 << 22
"""Voxel indices lie in [-MAX_VOXEL, MAX_VOXEL): three of them pack into one 64-bit key."""


def voxel_of(xyz: NDArray[np.float32], voxel_size: float) -> NDArray[np.int32]:
    """Return the voxel of each point: the nearest multiple of ``voxel_size``, halves upwards.

    Args:
        xyz: (N, 3) float32, metres, map frame; finite and within ``MAX_VOXEL`` voxels of the
            origin.
        voxel_size: Edge of a voxel, metres.

    Returns:
        (N, 3) int32 voxel indices; empty for no points.
    """
    return np.floor(xyz.astype(np.float64) / voxel_size + 0.5).astype(np.int32)


def by_column(
    columns: NDArray[np.integer],
) -> Iterator[tuple[tuple[int, ...], NDArray[np.int64]]]:
    """Group rows by their columns, squares of the ground or of other grids.

    Args:
        columns: (N, C) integers.

    Yields:
        Each column there is, in order, and its rows, ascending.
    """
    if len(columns) == 0:
        return
    order = np.lexsort(columns.T[::-1])
    changes = np.flatnonzero((np.diff(columns[order], axis=0) != 0).any(axis=1)) + 1
    for rows in np.split(order, changes):
        yield tuple(columns[rows[0]].tolist()), rows


def rims_of(
    voxel: NDArray[np.int32], width: int
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int32]]]:
    """Find the voxels that touch columns other than their own: up to three each.

    Args:
        voxel: (N, 2) int32 x and y.
        width: Voxels along the edge of a column.

    Yields:
        (M,) rows, and (M, 2) int32 the columns that these touch.
    """
    own = voxel // np.int32(width)
    place = voxel - own * np.int32(width)
    step = (place == width - 1).astype(np.int32) - (place == 0)
    for which in ((1, 0), (0, 1), (1, 1)):
        rows = np.flatnonzero(np.all((step != 0) >= np.array(which, bool), axis=1))
        yield rows, own[rows] + step[rows] * np.array(which, np.int32)
