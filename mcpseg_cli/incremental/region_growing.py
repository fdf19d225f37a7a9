"""Region growing by normals and colour (table II): when two neighbouring voxels are one surface.

As in the Point Cloud Library: a normal from the points around, facing the sensor; smooth points
join all neighbours that face the same way in the same colour; rough ones, on edges and thin things,
join a region but do not make it grow (Rabbani et al. 2006). Here it runs scan by scan, on voxels
new to the map, and clusters keep the regions.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.choices import Precision
from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.config import EMBEDDING, RegionGrowingSettings, SegmentSettings
from mcpseg_cli.incremental.clustering import ANY, quantise
from mcpseg_cli.incremental.map_rows import VoxelLabels
from mcpseg_cli.incremental.voxel_map import VoxelMap

_NONE = -1
_THIN = 1e-9  # variance across points on a line, of that along it


class RegionGrower:
    """Region growing by normals and colour (table II): objects without classes or learning.

    Args:
        growing: Which neighbours are alike.
        settings: Batch size and similarity mean nothing here.

    Attributes: See ``SegmentationMethod``; any similarity connects: who is alike is decided before.
    """

    def __init__(self, growing: RegionGrowingSettings, settings: SegmentSettings) -> None:
        self.name = "region-growing"
        self.weights = None
        self.settings = settings
        self.classes: tuple[str, ...] = ()
        self.similarity = ANY
        self.precision: Precision = "fp32"
        self._growing = growing

    def configuration(self) -> dict[str, object]:
        """Record its name and its numbers; see ``SegmentationMethod``."""
        growing = self._growing.model_dump()
        return {"weights": None, "method": self.name, "region_growing": growing}

    def classify(
        self,
        voxel_map: VoxelMap,
        ids: NDArray[np.int32],
        position: NDArray[np.float64],
        floor: float,
        rng: np.random.Generator,
    ) -> VoxelLabels:
        """Find normals, which take the first places of the embedding; no classes."""
        embedding = np.zeros((len(ids), EMBEDDING), np.float32)
        embedding[:, :3] = estimate_normals(voxel_map, ids, position, self._growing)
        unknown = np.full(len(ids), UNKNOWN, np.uint8)
        return VoxelLabels(unknown, np.zeros(len(ids), np.float32), quantise(embedding))

    def partners(
        self,
        voxel_map: VoxelMap,
        new: NDArray[np.int32],
        embedding: NDArray[np.int16],
        known: NDArray[np.int16],
    ) -> NDArray[np.int32]:
        """Give the neighbours of new voxels that are alike; see ``SegmentationMethod``."""
        return keep_alike(voxel_map.neighbours(new), embedding, known, voxel_map.rgb, self._growing)


def estimate_normals(
    voxel_map: VoxelMap,
    ids: NDArray[np.int32],
    position: NDArray[np.float64],
    settings: RegionGrowingSettings,
) -> NDArray[np.float32]:
    """Fit a plane to the points around each voxel.

    Args:
        voxel_map: The map, this scan included.
        ids: (M,) int32 voxels.
        position: (3,) float64 sensor position, metres, map frame; normals face it.
        settings: How far around, and what is rough.

    Returns:
        (M, 3) float32 unit normals; 0 where the surface is rough or the points too few.
    """
    # fit a plane: (M, 3) variances, ascending; (M, 3, 3) axes, in columns
    around = voxel_map.neighbours(ids, settings.reach)
    count, covariance = _spread(ids, around, voxel_map.xyz)
    variance, axes = np.linalg.eigh(covariance)
    is_line = variance[:, 1] <= _THIN * variance[:, 2]
    is_rough = variance[:, 0] > settings.max_curvature * variance.sum(axis=1)

    # face the sensor, unless rough
    normal = axes[:, :, 0]
    faces_away = np.einsum("ma,ma->m", normal, position - voxel_map.xyz[ids]) < 0
    normal[faces_away] *= -1
    normal[(count < settings.min_points) | is_line | is_rough] = 0
    return normal.astype(np.float32)


def keep_alike(
    neighbours: NDArray[np.int32],
    normal: NDArray[np.int16],
    known: NDArray[np.int16],
    rgb: NDArray[np.uint8],
    settings: RegionGrowingSettings,
) -> NDArray[np.int32]:
    """Keep the neighbours that new voxels join.

    Args:
        neighbours: (M, 26) int32 voxel ids, -1 for none; the new voxels have the last M ids.
        normal: (M, E) int16 of the new voxels, the normal first, as ``clustering.quantise`` stores
            it; 0 if rough.
        known: (V - M, E) int16 of the voxels before.
        rgb: (V, 3) uint8 colours.
        settings: What is alike.

    Returns:
        (M, 26) int32: -1 for neighbours that are not alike, too. A smooth voxel joins smooth ones
        that face the same way in the same colour; a rough one joins the one neighbour whose colour
        is nearest, if that is near.
    """
    least_cosine = np.cos(np.deg2rad(settings.max_angle_deg))
    kept: NDArray[np.int32] = _keep_alike(
        neighbours, normal, known, rgb, least_cosine, settings.max_colour
    )
    return kept


@njit(cache=True)
def _spread(
    ids: NDArray[np.int32], around: NDArray[np.int32], xyz: NDArray[np.float32]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Count the points around each voxel, itself included, and find their covariance."""
    count = np.ones(ids.size, np.int64)
    covariance = np.zeros((ids.size, 3, 3))
    mean, offset = np.empty(3), np.empty(3)
    for i in range(ids.size):
        mean[:] = 0.0

        # sums relative to the voxel itself
        for other in around[i]:
            if other == _NONE:
                continue
            count[i] += 1
            for a in range(3):
                offset[a] = np.float64(xyz[other, a]) - np.float64(xyz[ids[i], a])
                mean[a] += offset[a]
                for b in range(a + 1):
                    covariance[i, a, b] += offset[a] * offset[b]

        # both triangles of the covariance
        for a in range(3):
            for b in range(a + 1):
                around_mean = covariance[i, a, b] - mean[a] * mean[b] / count[i]
                covariance[i, a, b] = around_mean / count[i]
                covariance[i, b, a] = covariance[i, a, b]
    return count, covariance


@njit(cache=True)
def _cosine(a: NDArray[np.int16], b: NDArray[np.int16]) -> float:
    """Cosine of the angle between two normals; 0 if one is none."""
    product = np.float64(0.0)
    for axis in range(3):
        product += np.float64(a[axis]) * np.float64(b[axis])
    return product / (32767.0 * 32767.0)


@njit(cache=True)
def _colour_distance(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    total = 0.0
    for channel in range(3):
        total += (np.float64(a[channel]) - np.float64(b[channel])) ** 2
    return float(np.sqrt(total))


@njit(cache=True)
def _is_smooth(normal: NDArray[np.int16]) -> bool:
    return bool(normal[0] != 0 or normal[1] != 0 or normal[2] != 0)


@njit(cache=True)
def _keep_alike(
    neighbours: NDArray[np.int32],
    normal: NDArray[np.int16],
    known: NDArray[np.int16],
    rgb: NDArray[np.uint8],
    least_cosine: float,
    max_colour: float,
) -> NDArray[np.int32]:
    kept = np.full_like(neighbours, _NONE)
    start = known.shape[0]
    for i in range(neighbours.shape[0]):
        is_smooth, nearest, distance = _is_smooth(normal[i]), _NONE, max_colour
        for k in range(neighbours.shape[1]):
            other = neighbours[i, k]
            if other == _NONE:
                continue
            colour = _colour_distance(rgb[start + i], rgb[other])
            facing = known[other] if other < start else normal[other - start]

            # smooth: all alike; rough: the one nearest in colour
            if is_smooth and colour <= max_colour and _cosine(normal[i], facing) >= least_cosine:
                kept[i, k] = other
            if not is_smooth and (colour < distance or (colour == distance and nearest == _NONE)):
                nearest, distance = k, colour

        if nearest != _NONE:
            kept[i, nearest] = neighbours[i, nearest]
    return kept
