"""Which way the surface of a map faces at each of its voxels."""

from __future__ import annotations

from itertools import product

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.grid import voxel_of

_ROOM = 1 << 21  # voxels along an axis that a key tells apart
_LEAST = 3  # points, the one itself among them, that make a surface


def surface_normals(
    xyz: NDArray[np.float32], eyes: NDArray[np.floating], voxel_size: float
) -> NDArray[np.float32]:
    """Find the normals of points by those in the 26 voxels around them.

    Args:
        xyz: (N, 3) float32, metres, map frame; at most one a voxel counts.
        eyes: (N, 3) where each was seen from, metres, map frame.
        voxel_size: Metres.

    Returns:
        (N, 3) float32 unit normals towards the eye; straight up where too few points are around.
    """
    # voxels in the order of their keys: those at one step from all others are found in one sweep
    voxel = voxel_of(xyz, voxel_size).astype(np.int64)
    voxel -= voxel.min(axis=0) - 1
    keys = (voxel[:, 0] * _ROOM + voxel[:, 1]) * _ROOM + voxel[:, 2]
    order = np.argsort(keys, kind="stable")
    steps = [(x * _ROOM + y) * _ROOM + z for x, y, z in product((-1, 0, 1), repeat=3)]
    forward = np.array([step for step in steps if step > 0])
    moments = np.zeros((len(xyz), 10))
    moments[:, 0] = 1
    local = (xyz - xyz.mean(axis=0)).astype(np.float64)
    _add_neighbours(keys[order], local[order], forward, moments)

    # the way in which the points around spread least
    normal = np.empty((len(xyz), 3), np.float32)
    normal[order] = _least_spread(moments)
    away = np.einsum("ij,ij->i", normal, eyes - xyz) < 0
    away &= moments[np.argsort(order), 0] >= _LEAST
    normal[away] *= -1
    return normal


def _least_spread(moments: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the eigenvector of each covariance's least eigenvalue."""
    count = moments[:, :1]
    mean, square = moments[:, 1:4] / count, moments[:, 4:] / count
    rows, columns = np.array([0, 0, 0, 1, 1, 2]), np.array([0, 1, 2, 1, 2, 2])
    covariance = np.empty((len(moments), 3, 3))
    covariance[:, rows, columns] = square - mean[:, rows] * mean[:, columns]
    covariance[:, columns, rows] = covariance[:, rows, columns]
    vectors: NDArray[np.float64] = np.linalg.eigh(covariance)[1][:, :, 0]
    vectors[count[:, 0] < _LEAST] = (0.0, 0.0, 1.0)
    return vectors


@njit(cache=True)
def _add_neighbours(
    keys: NDArray[np.int64],
    xyz: NDArray[np.float64],
    steps: NDArray[np.int64],
    moments: NDArray[np.float64],
) -> None:
    """Add to each voxel's count, sums and sums of products the offsets to those around it.

    ``keys`` ascend, so that the partner of the next voxel lies never before that of this one.
    """
    for step in steps:
        j = 0
        for i in range(keys.size):
            while j < keys.size and keys[j] < keys[i] + step:
                j += 1
            if j == keys.size:
                break
            if keys[j] != keys[i] + step:
                continue
            x, y, z = xyz[j] - xyz[i]
            for row, sign in ((i, 1.0), (j, -1.0)):
                moments[row, 0] += 1.0
                moments[row, 1] += sign * x
                moments[row, 2] += sign * y
                moments[row, 3] += sign * z
                moments[row, 4] += x * x
                moments[row, 5] += x * y
                moments[row, 6] += x * z
                moments[row, 7] += y * y
                moments[row, 8] += y * z
                moments[row, 9] += z * z
