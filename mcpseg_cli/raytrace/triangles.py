"""Rays on the triangles of a mesh, cast by Open3D (Embree)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.building import Building
from mcpseg_cli.errors import InputError
from mcpseg_cli.grid import voxel_of
from mcpseg_cli.raytrace.occupancy import OccupancyGrid

if TYPE_CHECKING:
    import open3d

_BORDER = 0.05  # of a voxel; rays that end so near its side may end in the next as well


@dataclass(frozen=True)
class Hits:
    """Where rays end.

    Attributes:
        voxels: (R,) int32 numbers of the grid's voxels, -1 for none.
        points: (R,) int64 points of the building that say what is there; 0 for none.
        distance: (R,) float64 range, metres, infinite for none.
        cosine: (R,) float64 cosine of the angle between ray and normal, 0 to 1.
    """

    voxels: NDArray[np.int32]
    points: NDArray[np.int64]
    distance: NDArray[np.float64]
    cosine: NDArray[np.float64]


class TriangleScene:
    """The triangles of a building, ready for rays.

    Args:
        building: One with a mesh.
        grid: The grid of its points.

    Raises:
        InputError: Open3D is not installed.
    """

    def __init__(self, building: Building, grid: OccupancyGrid) -> None:
        assert building.mesh is not None
        try:
            import open3d
        except ImportError as error:
            found, remedy = "a mesh to cast rays on", "run: pip install open3d"
            raise InputError("the building", found, "Open3D", remedy) from error

        self._mesh, self._instance, self._grid = building.mesh, building.instance, grid
        corners = self._mesh.triangles.reshape(-1, 3)
        rows = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
        self._scene: open3d.t.geometry.RaycastingScene = open3d.t.geometry.RaycastingScene(1)
        self._scene.add_triangles(open3d.core.Tensor(corners), open3d.core.Tensor(rows))

    def measure(
        self, starts: NDArray[np.float64], rays: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return how far (R,) rays go from places (R, 3) in directions (R, 3); may be infinite."""
        import open3d

        query = np.concatenate([starts, rays], axis=1).astype(np.float32)
        answer = self._scene.cast_rays(open3d.core.Tensor(query), nthreads=1)
        distance: NDArray[np.float64] = answer["t_hit"].numpy().astype(np.float64)
        return distance

    def cast(self, origin: NDArray[np.float64], rays: NDArray[np.float64], reach: float) -> Hits:
        """Follow rays to the first triangle, from either side.

        Args:
            origin: (3,) float64, where the rays start, metres, map frame.
            rays: (R, 3) float64 unit directions, map frame.
            reach: Farthest a ray goes, metres.

        Returns:
            Their ends. A point is of the object that was hit: the one that stands for the voxel,
            where it is of this object, else one on the triangle.
        """
        import open3d

        # the nearest triangle of each ray
        start = np.broadcast_to(origin, rays.shape)
        query = np.concatenate([start, rays], axis=1).astype(np.float32)
        answer = self._scene.cast_rays(open3d.core.Tensor(query), nthreads=1)
        distance = answer["t_hit"].numpy().astype(np.float64)
        normal = answer["primitive_normals"].numpy().astype(np.float64)
        is_hit = distance <= reach
        triangle = np.where(is_hit, answer["primitive_ids"].numpy(), 0).astype(np.int64)

        # the voxel it ends in, and a point that has its labels
        distance = np.where(is_hit, distance, np.inf)
        voxels = self._voxels(origin, rays, np.where(is_hit, distance, 0.0))
        voxels = np.where(is_hit, voxels, -1).astype(np.int32)
        own, there = self._mesh.points[triangle], self._grid.points[voxels]
        points = np.where(self._instance[own] == self._instance[there], there, own)
        cosine = np.abs(np.einsum("ra,ra->r", normal, rays))
        return Hits(voxels, np.where(voxels >= 0, points, 0), distance, cosine)

    def _voxels(
        self,
        origin: NDArray[np.float64],
        rays: NDArray[np.float64],
        distance: NDArray[np.float64],
    ) -> NDArray[np.int32]:
        """Return the voxels of places on rays; on a border, that of its sides which has points."""
        size = self._grid.voxel_size
        voxels = np.full(len(rays), -1, np.int32)
        for nudge in (0.0, _BORDER, -_BORDER):
            empty = np.flatnonzero(voxels < 0)
            ends = origin + rays[empty] * (distance[empty] + nudge * size)[:, None]
            voxels[empty] = self._grid.voxel_ids(voxel_of(ends.astype(np.float32), size))
        return voxels
