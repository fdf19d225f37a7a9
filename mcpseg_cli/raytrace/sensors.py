"""Depth cameras and lidars: their rays, what they fail to see, and how well they measure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mcpseg_cli.choices import Sensor
from mcpseg_cli.config import RaytraceSettings
from mcpseg_cli.raytrace.carrying import pose_error
from mcpseg_cli.raytrace.depth_image import (
    IMAGE_SHAPE,
    DepthImage,
    draw_noise,
    find_lost,
    image_rays,
    shiny_voxels,
)
from mcpseg_cli.raytrace.rays import ScanPattern, cast_rays
from mcpseg_cli.raytrace.scanner import VirtualScan, VirtualScanner
from mcpseg_cli.raytrace.surfaces import find_surfaces

_NEAREST = {"depth-camera": 0.3, "lidar-16": 0.5, "lidar-32": 0.5}  # metres
_FIELDS_DEG = (60.0, 80.0)  # horizontal fields of view of depth cameras
_FIELD = 4  # what else is drawn by the seed
_FEWEST_RAYS = 50  # that a place is worth a scan for

# elevations of the rings, degrees: of a Velodyne VLP-16, and of a VLP-32C
_RINGS_16 = tuple(range(-15, 16, 2))
_RINGS_32 = (
    -25.0, -15.639, -11.31, -8.843, -7.254, -6.148, -5.333, -4.667, -4.0, -3.667, -3.333, -3.0,
    -2.667, -2.333, -2.0, -1.667, -1.333, -1.0, -0.667, -0.333, 0.0, 0.333, 0.667, 1.0, 1.333,
    1.667, 2.333, 3.333, 4.667, 7.0, 10.333, 15.0,
)  # fmt: skip
_RINGS: dict[Sensor, tuple[float, ...]] = {"lidar-16": _RINGS_16, "lidar-32": _RINGS_32}
_CAMERA_ELEVATIONS = (-60.0, 45.0)  # degrees that a camera carried around shows


def survey_pattern(settings: RaytraceSettings) -> ScanPattern:
    """Return all directions that a carried sensor may show: what routes are planned with."""
    if settings.sensor == "depth-camera":
        return ScanPattern(1.0, 1.0, *_CAMERA_ELEVATIONS, settings.reach)
    rings = _RINGS[settings.sensor]
    return ScanPattern(1.0, 1.0, rings[0], rings[-1], settings.reach)


def ring_rays(rings: tuple[float, ...], horizontal_deg: float) -> NDArray[np.float64]:
    """Return the rays of a lidar, ring after ring.

    Args:
        rings: Elevation of each, degrees.
        horizontal_deg: Angle between the rays of a ring, degrees.

    Returns:
        (R, 3) float64 unit directions, sensor frame: x ahead, y left, z up.
    """
    azimuth = np.radians(np.arange(0.0, 360.0 - 1e-9, horizontal_deg))
    elevation = np.radians(rings)[:, None]
    flat = np.cos(elevation)
    parts = (flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation) + 0.0 * azimuth)
    return np.stack(parts, axis=-1).reshape(-1, 3)


@dataclass(frozen=True)
class _Sight:
    """What the rays of one scan end on: (R, 3) rays in the sensor's frame, (R,) the rest."""

    rays: NDArray[np.float64]
    voxels: NDArray[np.int32]
    points: NDArray[np.int64]
    distance: NDArray[np.float64]
    cosine: NDArray[np.float64]


class SensorInBuilding:
    """A depth camera or a lidar in a building.

    Args:
        scanner: The building in its grid, and settings of another sensor than the sphere.
    """

    def __init__(self, scanner: VirtualScanner) -> None:
        self._scanner, self._settings = scanner, scanner.settings
        settings, building, grid = scanner.settings, scanner.building, scanner.grid
        self._surfaces = None if scanner.triangles else find_surfaces(grid, building.xyz)
        self._nearest = _NEAREST[settings.sensor]
        self._is_camera = settings.sensor == "depth-camera"

        # the camera of this seed, or the lidar
        if self._is_camera:
            field_deg = np.random.default_rng((settings.seed, 0, _FIELD)).uniform(*_FIELDS_DEG)
            self._rays = image_rays(float(field_deg))
            self._brightness = building.rgb[grid.points] @ np.array([0.299, 0.587, 0.114])
            self._is_shiny = shiny_voxels(building, grid.points, settings.seed)
        else:
            self._rays = ring_rays(_RINGS[settings.sensor], settings.horizontal_deg)

    def scan(self, number: int, pose: NDArray[np.float64]) -> VirtualScan:
        """Scan from one pose.

        Args:
            number: Number of the scan; with the seed it decides all that is drawn, so that scans
                may be made in any order.
            pose: (4, 4) float64, sensor to map, as odometry says; a camera is a little off it, and
                its points are where they are seen from the pose.

        Returns:
            One ray's point for each voxel in sight: on the surface in that voxel, but for noise.
        """
        rng = np.random.default_rng((self._settings.seed, number))
        sight = self._look(*self._aim(number, pose, rng))
        if not self._in_range(sight).any():  # places that are scanned from see something
            sight = self._look(pose, 0.0)

        # rays that come back, one for each voxel
        kept = np.flatnonzero(self._is_measured(sight, rng))
        if len(kept) == 0:  # a scan without a point is no scan
            kept = np.flatnonzero(self._in_range(sight))[:1]
        kept = kept[rng.permutation(len(kept))]
        voxels, first = np.unique(sight.voxels[kept], return_index=True)
        rays = kept[first]

        # measured along the ray, and seen from where the pose is said to be
        measured = sight.distance + self._errors(sight, rng)
        seen = _turned(sight.rays[rays] * measured[rays, None], pose[:3, :3])
        xyz = (seen + pose[:3, 3]).astype(np.float32)
        return VirtualScan(voxels, sight.points[rays], xyz)

    def sees_anything(self, pose: NDArray[np.float64]) -> bool:
        """Tell whether a scan from a pose, (4, 4) float64, would have some points."""
        return int(self._in_range(self._look(pose, 0.0)).sum()) >= _FEWEST_RAYS

    def _aim(
        self, number: int, pose: NDArray[np.float64], rng: np.random.Generator
    ) -> tuple[NDArray[np.float64], float]:
        """Return where a sensor really is, and by how many radians its first ray is turned."""
        if self._is_camera:
            return pose @ np.linalg.inv(pose_error(self._settings.seed, number)), 0.0
        return pose, np.radians(rng.uniform(0.0, self._settings.horizontal_deg))

    def _look(self, pose: NDArray[np.float64], turn: float) -> _Sight:
        """Cast the rays of a scan, turned about the sensor's upper side."""
        about_z = Rotation.from_euler("z", turn).as_matrix()
        rays = _turned(self._rays, about_z)
        on_map = _turned(rays, pose[:3, :3])
        scanner, origin, reach = self._scanner, pose[:3, 3], self._settings.reach
        if scanner.triangles is not None:
            hits = scanner.triangles.cast(origin, on_map, reach)
            return _Sight(rays, hits.voxels, hits.points, hits.distance, hits.cosine)
        assert self._surfaces is not None
        voxels = cast_rays(scanner.grid, origin, on_map, reach)
        points = scanner.grid.points[voxels]
        return _Sight(rays, voxels, points, *self._surfaces.meet(voxels, origin, on_map))

    def _in_range(self, sight: _Sight) -> NDArray[np.bool_]:
        """Mark the rays that end where the sensor can measure."""
        inside = (sight.distance >= self._nearest) & (sight.distance <= self._settings.reach)
        return inside & (sight.voxels >= 0)

    def _is_measured(self, sight: _Sight, rng: np.random.Generator) -> NDArray[np.bool_]:
        """Mark the rays that come back."""
        measured = self._in_range(sight)
        if self._is_camera:
            image = DepthImage(
                np.where(measured, sight.distance * sight.rays[:, 0], np.inf),
                sight.cosine,
                self._brightness[sight.voxels],
                self._is_shiny[sight.voxels],
            )
            measured &= ~find_lost(image, rng)
        return measured & (rng.random(len(measured)) >= self._settings.dropout)

    def _errors(self, sight: _Sight, rng: np.random.Generator) -> NDArray[np.float64]:
        """Draw the (R,) errors of the ranges, metres."""
        if not self._is_camera:
            return rng.normal(0.0, self._settings.noise, len(sight.distance))
        distance = np.where(np.isfinite(sight.distance), sight.distance, 0.0)
        return self._settings.noise * distance**2 * draw_noise(rng, IMAGE_SHAPE)


def _turned(rays: NDArray[np.float64], rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn (R, 3) vectors; summed in one order whatever library multiplies matrices."""
    x, y, z = rays[:, :1], rays[:, 1:2], rays[:, 2:]
    turned: NDArray[np.float64] = x * rotation[:, 0] + y * rotation[:, 1] + z * rotation[:, 2]
    return turned
