"""Surfaces of a building as rays meet them: the plane through each voxel's points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.grid import voxel_of
from mcpseg_cli.raytrace.occupancy import OccupancyGrid

_CHUNK = 1 << 20  # points entered at once
_BATCH = 1 << 16  # voxels whose planes are found at once
_FEWEST = 5  # points that make a plane
_FLATNESS = 0.1  # of the least variance to the middle one, below which points are a plane
_STEEPEST = 0.05  # cosine between ray and normal, below which a ray runs along its surface
_FARTHEST = 5.0  # voxels along the ray from the voxel's point to its plane


@dataclass(frozen=True)
class Surfaces:
    """The planes of an occupancy grid's voxels.

    Attributes:
        xyz: (V, 3) float32 the point that stands for each voxel, metres, map frame.
        normal: (V, 3) float32 unit normals, to either side; zeros where points are no plane.
        voxel_size: Edge of a voxel, metres.
    """

    xyz: NDArray[np.float32]
    normal: NDArray[np.float32]
    voxel_size: float

    def meet(
        self, voxels: NDArray[np.int32], origin: NDArray[np.float64], rays: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Find where rays meet the surfaces of the voxels they end in.

        Args:
            voxels: (R,) int32, -1 for none.
            origin: (3,) float64, where the rays start, metres, map frame.
            rays: (R, 3) float64 unit directions, map frame.

        Returns:
            (R,) float64 range, metres, infinite for none, and (R,) float64 cosine of the angle
            between ray and normal, 0 to 1; 1 where there is no plane.
        """
        # abreast of the voxel's point
        normal = self.normal[voxels].astype(np.float64)
        offset = self.xyz[voxels] - origin
        abreast = np.einsum("ra,ra->r", offset, rays)

        # on its plane, unless that is far off
        cosine = np.einsum("ra,ra->r", normal, rays)
        steep = np.where(np.abs(cosine) < _STEEPEST, np.inf, cosine)
        on_plane = np.einsum("ra,ra->r", normal, offset) / steep
        far = np.abs(on_plane - abreast) > _FARTHEST * self.voxel_size
        distance = np.where(far | np.isinf(steep), abreast, on_plane)

        cosine = np.where(normal.any(axis=1), np.abs(cosine), 1.0)
        return np.where(voxels >= 0, distance, np.inf), cosine


def find_surfaces(grid: OccupancyGrid, xyz: NDArray[np.float32]) -> Surfaces:
    """Fit a plane to the points of each voxel and of the 26 around it.

    Args:
        grid: The building's grid.
        xyz: (N, 3) float32 the building, metres, map frame: the points the grid was built from.

    Returns:
        The planes of all voxels.
    """
    # sums over each voxel's points: number, places, products
    origin = xyz[grid.points].astype(np.float64)
    voxel = np.empty((len(grid), 3), np.int32)
    sums = np.zeros((len(grid), 10))
    for start in range(0, len(xyz), _CHUNK):
        part = xyz[start : start + _CHUNK]
        its_voxel = voxel_of(part, grid.voxel_size)
        ids = grid.voxel_ids(its_voxel)
        voxel[ids] = its_voxel
        _add(part, ids, origin, sums)

    # planes of the sums of 3 x 3 x 3 voxels
    normal = np.zeros((len(grid), 3), np.float32)
    around = np.stack(np.meshgrid(*3 * [np.arange(-1, 2)], indexing="ij"), -1).reshape(-1, 3)
    for start in range(0, len(grid), _BATCH):
        rows = np.arange(start, min(start + _BATCH, len(grid)))
        near = (voxel[rows, None] + around).astype(np.int32).reshape(-1, 3)
        ids = grid.voxel_ids(near).reshape(len(rows), -1)
        normal[rows] = _planes(_gather(rows, ids, origin, sums))
    return Surfaces(xyz[grid.points], normal, grid.voxel_size)


@njit(cache=True, nogil=True)
def _add(
    xyz: NDArray[np.float32],
    ids: NDArray[np.int32],
    origin: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> None:
    """Add points to the sums of their voxels, as seen from the voxel's own point."""
    for row in range(len(xyz)):
        voxel = ids[row]
        x, y, z = xyz[row, 0], xyz[row, 1], xyz[row, 2]
        x, y, z = x - origin[voxel, 0], y - origin[voxel, 1], z - origin[voxel, 2]
        for place, value in enumerate((1.0, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z)):
            sums[voxel, place] += value


@njit(cache=True, nogil=True)
def _gather(
    rows: NDArray[np.int64],
    ids: NDArray[np.int32],
    origin: NDArray[np.float64],
    sums: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Add up the sums of the voxels around each, as seen from its point; (B, 10)."""
    total = np.zeros((len(rows), 10))
    for i in range(len(rows)):
        for other in ids[i]:
            if other < 0:
                continue
            n, s = sums[other, 0], sums[other]
            x, y, z = origin[other] - origin[rows[i]]
            total[i, 0] += n
            total[i, 1] += s[1] + n * x
            total[i, 2] += s[2] + n * y
            total[i, 3] += s[3] + n * z
            total[i, 4] += s[4] + 2 * x * s[1] + n * x * x
            total[i, 5] += s[5] + 2 * y * s[2] + n * y * y
            total[i, 6] += s[6] + 2 * z * s[3] + n * z * z
            total[i, 7] += s[7] + x * s[2] + y * s[1] + n * x * y
            total[i, 8] += s[8] + x * s[3] + z * s[1] + n * x * z
            total[i, 9] += s[9] + y * s[3] + z * s[2] + n * y * z
    return total


def _planes(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (B, 3) unit normals of sums of points; zeros where these are no plane."""
    num, mean = sums[:, 0], sums[:, 1:4] / sums[:, :1]
    square = sums[:, 4:] / sums[:, :1]

    # covariance; its least direction is the normal
    covariance = np.empty((len(sums), 3, 3))
    places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    for column, (a, b) in enumerate(places):
        covariance[:, a, b] = covariance[:, b, a] = square[:, column] - mean[:, a] * mean[:, b]
    variance, direction = np.linalg.eigh(covariance)
    flat = (num >= _FEWEST) & (variance[:, 0] < _FLATNESS * variance[:, 1])
    return np.where(flat[:, None], direction[:, :, 0], 0.0)
