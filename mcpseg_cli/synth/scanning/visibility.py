"""What can be seen from where: a grid of voxels that know how far the next surface is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_cdt

VOXEL = 0.05
"""Edge of a voxel, metres."""
TOLERANCE = 2.0
"""Voxels along a ray in which a surface does not hide itself."""


@dataclass(frozen=True)
class RoomGrid:
    """The surfaces of a room in voxels.

    Attributes:
        low: (3,) float64 corner of voxel (0, 0, 0), metres, map frame.
        distance: (X, Y, Z) uint8 voxels to the next surface, 0 on one (the longest of the three
            axes counts).
    """

    low: NDArray[np.float64]
    distance: NDArray[np.uint8]

    def at(self, xyz: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the (N,) distance at points (N, 3), at the border for those outside."""
        voxel = np.floor((xyz - self.low) / VOXEL).astype(np.int64)
        voxel = np.clip(voxel, 0, np.array(self.distance.shape) - 1)
        found: NDArray[np.uint8] = self.distance[voxel[:, 0], voxel[:, 1], voxel[:, 2]]
        return found


def build_room_grid(triangles: NDArray[np.float64]) -> RoomGrid:
    """Enter triangles, (F, 3, 3) in metres, into a grid around them."""
    corners = triangles.reshape(-1, 3)
    low = corners.min(axis=0) - 2 * VOXEL
    shape = np.ceil((corners.max(axis=0) - low) / VOXEL).astype(np.int64) + 3
    is_free = np.ones(tuple(shape), np.uint8)
    _rasterise(triangles, low, is_free)
    distance = distance_transform_cdt(is_free, "chessboard")
    return RoomGrid(low, np.minimum(distance, 255).astype(np.uint8))


def sees(
    grid: RoomGrid, points: NDArray[np.float64], targets: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return for each point, (N, 3), whether nothing lies between it and its target, (N, 3)."""
    visible = np.empty(len(points), np.bool_)
    _sees((points - grid.low) / VOXEL, (targets - grid.low) / VOXEL, grid.distance, visible)
    return visible


def facing_of(normals: NDArray[np.float32]) -> NDArray[np.int64]:
    """Return (N,) which of the six directions of the axes each normal is nearest to."""
    axis = np.argmax(np.abs(normals), axis=1)
    facing: NDArray[np.int64] = 2 * axis + (normals[np.arange(len(axis)), axis] > 0)
    return facing


@njit(cache=True, nogil=True)
def number_cells(
    cell: NDArray[np.int32],
    facing: NDArray[np.int64],
    shape: NDArray[np.int64],
    table: NDArray[np.int32],
    own: NDArray[np.int32],
) -> NDArray[np.int64]:
    """Number the cells that hold points by which way those face; return the first point of each.

    Args:
        cell: (N, 3) int32.
        facing: (N,) int64 0-5, from ``facing_of``.
        shape: (3,) int64 number of cells.
        table: zeros for every cell and facing; filled with numbers from 1.
        own: (N,) int32, filled with the number of each point's cell, from 0.
    """
    firsts = np.empty(len(cell), np.int64)
    count = 0
    for row in range(len(cell)):
        key = ((cell[row, 0] * shape[1] + cell[row, 1]) * shape[2] + cell[row, 2]) * 6 + facing[row]
        if table[key] == 0:
            firsts[count] = row
            count += 1
            table[key] = count
        own[row] = table[key] - 1
    return firsts[:count].copy()


@njit(cache=True, nogil=True)
def _rasterise(
    triangles: NDArray[np.float64], low: NDArray[np.float64], is_free: NDArray[np.uint8]
) -> None:
    """Clear the voxels that triangles pass through, by points half a voxel apart."""
    for face in range(len(triangles)):
        a = (triangles[face, 0] - low) / VOXEL
        u = (triangles[face, 1] - triangles[face, 0]) / VOXEL
        v = (triangles[face, 2] - triangles[face, 0]) / VOXEL

        # rows of points along both of its sides
        steps_u = int(np.ceil(np.sqrt((u * u).sum()) * 2)) + 1
        steps_v = int(np.ceil(np.sqrt((v * v).sum()) * 2)) + 1
        for i in range(steps_u + 1):
            for j in range(int(np.ceil(steps_v * (1 - i / steps_u))) + 1):
                s = i / steps_u
                t = min(j / steps_v, 1 - s)
                x, y = a[0] + s * u[0] + t * v[0], a[1] + s * u[1] + t * v[1]
                z = a[2] + s * u[2] + t * v[2]
                is_free[int(x), int(y), int(z)] = 0


@njit(cache=True, nogil=True)
def is_clear(
    x: float, y: float, z: float, to_x: float, to_y: float, to_z: float, distance: NDArray[np.uint8]
) -> bool:
    """Return whether a ray, in voxels, reaches its target.

    Surfaces within ``TOLERANCE`` of its start do not count.
    """
    dx, dy, dz = to_x - x, to_y - y, to_z - z
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    if length < 1e-6:
        return True
    dx, dy, dz = dx / length, dy / length, dz / length

    # leaps as far as nothing can be in the way
    gone = 0.0
    a, b, c = distance.shape
    while gone < length:
        i, j, k = int(x + gone * dx), int(y + gone * dy), int(z + gone * dz)
        step = 1.0
        if 0 <= i < a and 0 <= j < b and 0 <= k < c:
            free = distance[i, j, k]
            if free == 0 and gone > TOLERANCE:
                return False
            step = max(float(free) - 1.0, 0.6)
        gone += step
    return True


@njit(cache=True, nogil=True)
def _sees(
    points: NDArray[np.float64],
    targets: NDArray[np.float64],
    distance: NDArray[np.uint8],
    visible: NDArray[np.bool_],
) -> None:
    """Test every ray, in voxels."""
    for row in range(len(points)):
        p, t = points[row], targets[row]
        visible[row] = is_clear(p[0], p[1], p[2], t[0], t[1], t[2], distance)
