"""Region growing by normals and colour (table II): what it takes for two neighbouring voxels to be one surface.

As in the Point Cloud Library: a normal from the points around, facing the sensor; smooth points join all neighbours
that face the same way in the same colour; rough ones, on edges and thin things, join a region but do not make it grow
(Rabbani et al. 2006). Here it runs scan by scan, on voxels new to the map, and clusters keep the regions.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.config import RegionGrowingSettings
from mcpseg_cli.voxel_map import VoxelMap

_NONE = -1


def estimate_normals(
    voxel_map: VoxelMap, ids: NDArray[np.int32], position: NDArray[np.float64], settings: RegionGrowingSettings
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
    around = voxel_map.neighbours(ids, settings.reach)
    limits = (settings.min_points, settings.max_curvature)
    normals: NDArray[np.float32] = _fit_planes(ids, around, voxel_map.xyz, np.ascontiguousarray(position), *limits)
    return normals


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
        normal: (M, E) int16 of the new voxels, the normal first, as ``clustering.quantise`` stores it; 0 if rough.
        known: (V - M, E) int16 of the voxels before.
        rgb: (V, 3) uint8 colours.
        settings: What is alike.

    Returns:
        (M, 26) int32: -1 for neighbours that are not alike, too. A smooth voxel joins smooth ones that face the same
        way in the same colour; a rough one joins the one neighbour whose colour is nearest, if that is near.
    """
    least_cosine = np.cos(np.deg2rad(settings.max_angle_deg))
    kept: NDArray[np.int32] = _keep_alike(neighbours, normal, known, rgb, least_cosine, settings.max_colour)
    return kept


@njit(cache=True)
def _fit_planes(
    ids: NDArray[np.int32],
    around: NDArray[np.int32],
    xyz: NDArray[np.float32],
    position: NDArray[np.float64],
    min_points: int,
    max_curvature: float,
) -> NDArray[np.float32]:
    """Normals by principal components; curvature is the least variance's share of all."""
    normals = np.zeros((ids.size, 3), np.float32)
    for i in range(ids.size):
        here = xyz[ids[i]].astype(np.float64)
        count, total, products = 1, np.zeros(3), np.zeros((3, 3))
        for other in around[i]:
            if other != _NONE:
                offset = xyz[other] - here
                count += 1
                total += offset
                products += np.outer(offset, offset)
        if count < min_points:
            continue
        mean = total / count
        variance, axes = np.linalg.eigh(products / count - np.outer(mean, mean))
        if variance[0] > max_curvature * variance.sum() or variance[1] <= 0.0:
            continue
        normal = axes[:, 0].copy()
        normals[i] = normal if np.dot(normal, position - here) >= 0.0 else -normal
    return normals


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
            if is_smooth and colour <= max_colour and _cosine(normal[i], facing) >= least_cosine:
                kept[i, k] = other
            if not is_smooth and (colour < distance or (colour == distance and nearest == _NONE)):
                nearest, distance = k, colour
        if nearest != _NONE:
            kept[i, nearest] = neighbours[i, nearest]
    return kept
