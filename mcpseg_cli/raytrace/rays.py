"""Rays through the voxel grid: each ends in the first occupied voxel it enters (paper III-A)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.raytrace.occupancy import OccupancyGrid, _bits


@dataclass(frozen=True)
class ScanPattern:
    """Directions and reach of a rotating scanner; the defaults are the paper's full sphere.

    Attributes:
        horizontal_deg: Horizontal angle between rays, degrees.
        vertical_deg: Vertical angle between rays, degrees.
        lowest_deg: Elevation of the lowest ray; -90 is straight down.
        highest_deg: Elevation that the rays stay below (the highest ray of a full sphere is at 89 degrees).
        reach: Farthest a ray goes, metres.
    """

    horizontal_deg: float = 1.0
    vertical_deg: float = 1.0
    lowest_deg: float = -90.0
    highest_deg: float = 90.0
    reach: float = 5.0

    def directions(self) -> NDArray[np.float64]:
        """Return the (R, 3) float64 unit directions of the rays, azimuth after azimuth from +x towards +y."""
        azimuth = np.radians(np.arange(0.0, 360.0 - 1e-9, self.horizontal_deg))
        elevation = np.radians(np.arange(self.lowest_deg, self.highest_deg - 1e-9, self.vertical_deg))
        azimuth, elevation = (grid.ravel() for grid in np.meshgrid(azimuth, elevation, indexing="ij"))
        flat = np.cos(elevation)
        return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=1)


def cast_rays(
    grid: OccupancyGrid,
    origin: NDArray[np.float64],
    directions: NDArray[np.float64],
    reach: float,
    pool: ThreadPoolExecutor | None = None,
    num_threads: int = 1,
) -> NDArray[np.int32]:
    """Follow rays until they enter an occupied voxel (Amanatides and Woo, 1987: no voxel on the way is left out).

    The voxel the rays start in does not stop them, so that a sensor may stand inside an occupied one.

    Args:
        grid: The building.
        origin: (3,) float64, where the rays start, metres, map frame.
        directions: (R, 3) float64 unit vectors.
        reach: Farthest a ray goes, metres; a voxel counts when the ray enters it no farther than that.
        pool: Threads to share the rays among; None casts them in this thread.
        num_threads: Parts the rays are split into when there is a pool.

    Returns:
        (R,) int32 number of the voxel each ray ends in, -1 for none; the same for any number of threads.
    """
    start = origin / grid.voxel_size + 0.5 - grid.low  # voxel v spans [v, v + 1) here
    hits = np.empty(len(directions), np.int32)
    longest = reach / grid.voxel_size
    if pool is None or num_threads == 1:
        _cast(start, directions, longest, grid.masks, grid.ranks, hits)
        return hits
    parts = zip(np.array_split(directions, num_threads), np.array_split(hits, num_threads), strict=True)
    list(pool.map(lambda part: _cast(start, part[0], longest, grid.masks, grid.ranks, part[1]), parts))
    return hits


def visible_voxels(
    grid: OccupancyGrid,
    origin: NDArray[np.float64],
    directions: NDArray[np.float64],
    reach: float,
    pool: ThreadPoolExecutor | None = None,
    num_threads: int = 1,
) -> NDArray[np.int32]:
    """Return the (V,) int32 numbers of the voxels that ``cast_rays`` ends in, each once, in ascending order."""
    hits = cast_rays(grid, origin, directions, reach, pool, num_threads)
    return np.unique(hits[hits >= 0])


@njit(cache=True)
def _first_face(place: float, direction: float) -> tuple[float, float]:
    """Return how far along the ray the first voxel face across one axis is, and how far apart these faces are."""
    if direction == 0.0:
        return np.inf, np.inf
    if direction > 0.0:
        return (np.floor(place) + 1.0 - place) / direction, 1.0 / direction
    return (np.floor(place) - place) / direction, -1.0 / direction


@njit(cache=True, nogil=True)
def _cast(
    start: NDArray[np.float64],
    directions: NDArray[np.float64],
    longest: float,
    masks: NDArray[np.uint64],
    ranks: NDArray[np.int32],
    hits: NDArray[np.int32],
) -> None:
    """Walk every ray from voxel to voxel; lengths in voxels, places from the grid's corner."""
    blocks, firsts = masks.ravel(), ranks.ravel()
    num_y, num_z = masks.shape[1], masks.shape[2]
    end_x, end_y, end_z = 4 * masks.shape[0], 4 * num_y, 4 * num_z
    for ray in range(len(directions)):
        x, y, z = int(np.floor(start[0])), int(np.floor(start[1])), int(np.floor(start[2]))
        to_x, apart_x = _first_face(start[0], directions[ray, 0])
        to_y, apart_y = _first_face(start[1], directions[ray, 1])
        to_z, apart_z = _first_face(start[2], directions[ray, 2])
        step_x = 1 if directions[ray, 0] > 0.0 else -1
        step_y = 1 if directions[ray, 1] > 0.0 else -1
        step_z = 1 if directions[ray, 2] > 0.0 else -1
        hits[ray] = -1
        while True:
            if to_x <= to_y and to_x <= to_z:
                if to_x > longest:
                    break
                x += step_x
                to_x += apart_x
            elif to_y <= to_z:
                if to_y > longest:
                    break
                y += step_y
                to_y += apart_y
            else:
                if to_z > longest:
                    break
                z += step_z
                to_z += apart_z
            if x < 0 or y < 0 or z < 0 or x >= end_x or y >= end_y or z >= end_z:
                continue
            block = ((x >> 2) * num_y + (y >> 2)) * num_z + (z >> 2)
            bit = np.uint64(((x & 3) << 4) | ((y & 3) << 2) | (z & 3))
            if (blocks[block] >> bit) & np.uint64(1):
                hits[ray] = firsts[block] + _bits(blocks[block] & ((np.uint64(1) << bit) - np.uint64(1)))
                break
