"""The nearest of points that are offered bit by bit, without ever holding them all."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.incremental.voxel_map import VoxelMap

_SLACK = 1e-6  # metres; what float32 coordinates may lose
_CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)


class NearestPoints:
    """For every point of a cloud, the nearest of others that are offered bit by bit.

    Args:
        xyz: (N, 3) the cloud, metres; at least one point.
        reach: Metres beyond which nothing is near.
    """

    def __init__(self, xyz: NDArray[np.floating], reach: float) -> None:
        # the cloud and the box around it, from a corner of its own
        self._origin = xyz.min(axis=0).astype(np.float64)
        self._xyz = xyz - self._origin
        self._reach = reach + _SLACK
        self._low, self._high = -self._reach, self._xyz.max(axis=0) + self._reach

        # its points by cells: a cube around an offered point touches two along each axis
        self._cells = VoxelMap(2.01 * self._reach)
        cell = self._cells.insert(self._xyz.astype(np.float32), np.zeros((len(xyz), 3), np.uint8))
        self._members = np.argsort(cell, kind="stable").astype(np.int32)
        self._starts = np.append(0, np.cumsum(np.bincount(cell)))

        self._best = np.full(len(xyz), np.inf)  # squared metres
        self._row = np.full(len(xyz), -1, np.int64)

    def offer(self, xyz: NDArray[np.floating]) -> tuple[NDArray[np.int32], NDArray[np.int64], int]:
        """Offer points.

        Args:
            xyz: (M, 3) metres.

        Returns:
            (Q,) int32 points of the cloud to which one of these is nearer than all offered before,
            (Q,) int64 the row of that one, and how many of the M are within reach of the cloud.
        """
        # what lies in the box around the cloud
        offered = xyz - self._origin
        rows = np.flatnonzero(((offered >= self._low) & (offered <= self._high)).all(axis=1))
        offered = offered[rows]

        # the cells around each of them
        corners = [
            self._cells.find((offered + 1.002 * self._reach * way).astype(np.float32))
            for way in _CORNERS
        ]
        grid = (np.stack(corners), self._starts, self._members)

        ids, num_near = _offer_points(
            offered, self._xyz, self._reach**2, grid, self._best, self._row
        )
        found = rows[self._row[ids]]
        self._row[ids] = -1
        return ids, found, num_near


@njit(cache=True)
def _offer_points(
    offered: NDArray[np.float64],
    xyz: NDArray[np.float64],
    limit: float,
    grid: tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int32]],
    best: NDArray[np.float64],
    row: NDArray[np.int64],
) -> tuple[NDArray[np.int32], int]:
    """Update ``best`` and ``row`` of the points near offered ones.

    The grid is (8, M) cells around offered points, where the members of each cell start, and these.
    """
    cells, starts, members = grid
    ids = []
    num_near = 0
    for i in range(offered.shape[0]):
        is_near = False
        for corner in range(8):
            cell = cells[corner, i]
            if cell < 0 or (corner > 0 and cell == cells[corner - 1, i]):
                continue

            # its members, which may be near
            for point in members[starts[cell] : starts[cell + 1]]:
                distance = 0.0
                for axis in range(3):
                    distance += (offered[i, axis] - xyz[point, axis]) ** 2
                is_near |= distance <= limit
                if distance <= limit and distance < best[point]:
                    if row[point] < 0:
                        ids.append(point)
                    best[point], row[point] = distance, i
        num_near += is_near
    return np.array(ids, np.int32), num_near
