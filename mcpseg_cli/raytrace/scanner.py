"""The virtual scanner: one point of the building for every voxel its rays end in (paper III-A)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mcpseg_cli.building import Building
from mcpseg_cli.config import RaytraceSettings
from mcpseg_cli.formats import Cloud
from mcpseg_cli.raytrace.occupancy import OccupancyGrid, build_grid
from mcpseg_cli.raytrace.rays import ScanPattern, cast_rays, visible_voxels
from mcpseg_cli.raytrace.triangles import TriangleScene

POSE_COLUMNS = "scan,x,y,z,qx,qy,qz,qw"
_DECIMALS = 6  # of a position in metres


@dataclass(frozen=True)
class VirtualScan:
    """What the scanner saw from one place.

    Attributes:
        voxels: (N,) int32 numbers of the grid's voxels, ascending, each once.
        points: (N,) int64 points of the building.
        xyz: (N, 3) float32, metres, map frame: the building's own coordinates; with noise, moved
            along the ray. Of meshes, the ends of rays.
    """

    voxels: NDArray[np.int32]
    points: NDArray[np.int64]
    xyz: NDArray[np.float32]


class VirtualScanner:
    """A scanner in a building.

    Args:
        building: At least one point.
        settings: Voxels, pattern, noise.

    Raises:
        InputError: The building is too large for the voxel size.
    """

    def __init__(self, building: Building, settings: RaytraceSettings) -> None:
        self.building = building
        self.settings = settings
        self.grid: OccupancyGrid = build_grid(building.xyz, settings.voxel_size, settings.seed)
        self.pattern = pattern_of(settings)
        self._directions = self.pattern.directions()
        self.triangles = None if building.mesh is None else TriangleScene(building, self.grid)

    def scan(self, number: int, position: NDArray[np.float64]) -> VirtualScan:
        """Scan from one place.

        Args:
            number: Number of the scan; with the seed it decides noise and drop-out, so that scans
                may be made in any order.
            position: (3,) float64, metres, map frame.

        Returns:
            A point for each voxel in sight; none where nothing is within reach.
        """
        sight = self._look(position)
        if self.settings.dropout == self.settings.noise == 0.0:
            return sight

        # some points are lost, but never all
        rng = np.random.default_rng((self.settings.seed, number))
        kept = rng.random(len(sight.voxels)) >= self.settings.dropout
        kept[:1] |= not kept.any()  # a scan without a point is no scan
        voxels, points = sight.voxels[kept], sight.points[kept]

        # the others move along their rays
        ray = sight.xyz[kept] - position
        distance = np.maximum(np.linalg.norm(ray, axis=1, keepdims=True), 1e-6)
        offset = ray / distance * rng.normal(0.0, self.settings.noise, (len(points), 1))
        return VirtualScan(voxels, points, (position + ray + offset).astype(np.float32))

    def _look(self, position: NDArray[np.float64]) -> VirtualScan:
        """Return what is in sight from a place, measured without error."""
        if self.triangles is None:
            voxels = visible_voxels(self.grid, position, self._directions, self.settings.reach)
            points = self.grid.points[voxels]
            return VirtualScan(voxels, points, self.building.xyz[points])

        # of a mesh, the end of one ray for each voxel
        hits = self.triangles.cast(position, self._directions, self.settings.reach)
        rays = np.flatnonzero(hits.voxels >= 0)
        voxels, first = np.unique(hits.voxels[rays], return_index=True)
        rays = rays[first]
        xyz = position + self._directions[rays] * hits.distance[rays, None]
        return VirtualScan(voxels, hits.points[rays], xyz.astype(np.float32))

    def sees_anything(self, position: NDArray[np.float64]) -> bool:
        """Tell whether a scan from a place, (3,) float64 metres, map frame, would have a point."""
        few = self._directions[:: max(1, len(self._directions) // 4000)]
        return any(
            (cast_rays(self.grid, position, rays, self.settings.reach) >= 0).any()
            for rays in (few, self._directions)
        )

    def clouds(self, scan: VirtualScan) -> tuple[Cloud, Cloud]:
        """Return a scan as two clouds: ``x y z red green blue``, and with the truth about them."""
        # what the sensor gives
        columns: dict[str, NDArray[np.generic]] = {
            axis: scan.xyz[:, column] for column, axis in enumerate("xyz")
        }
        rgb = self.building.rgb[scan.points]
        columns |= {name: rgb[:, column] for column, name in enumerate(("red", "green", "blue"))}

        # what is known of the same points
        truth: dict[str, NDArray[np.generic]] = {
            "semantic": self.building.semantic[scan.points],
            "instance": self.building.instance[scan.points],
        }
        return Cloud(columns), Cloud(columns | truth, self.building.classes)


def pattern_of(settings: RaytraceSettings) -> ScanPattern:
    """Return the directions and reach that settings describe."""
    resolution = settings.horizontal_deg, settings.vertical_deg
    elevations = settings.lowest_deg, settings.highest_deg
    return ScanPattern(*resolution, *elevations, settings.reach)


def scan_name(number: int) -> str:
    """Return what the files and the pose of a scan are called."""
    return f"{number:06d}"


def poses_table(poses: NDArray[np.float64]) -> str:
    """Write the text of ``poses.csv``.

    Args:
        poses: (S, 4, 4) float64, metres; their scans are called by number.
    """
    rows = [POSE_COLUMNS]
    for number, pose in enumerate(poses):
        x, y, z = (f"{value:.{_DECIMALS}f}" for value in pose[:3, 3].tolist())
        rows.append(f"{scan_name(number)},{x},{y},{z},{_quaternion(pose)}")
    return "\n".join(rows) + "\n"


def _quaternion(pose: NDArray[np.float64]) -> str:
    """Write the columns ``qx,qy,qz,qw`` of a pose."""
    if pose[2, 2] == 1.0:  # turned about z only
        half = np.arctan2(pose[1, 0], pose[0, 0]) / 2
        return f"0,0,{np.sin(half):.9f},{np.cos(half):.9f}"
    quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat(canonical=True)
    return ",".join(f"{value:.9f}" for value in quaternion.tolist())
