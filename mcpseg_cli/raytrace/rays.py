"""Rays through the voxel grid: each ends in the first occupied voxel it enters (paper III-A)."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.raytrace.occupancy import OccupancyGrid


@dataclass(frozen=True)
class ScanPattern:
    """Directions and reach of a rotating scanner; the defaults are the paper's full sphere.

    Attributes:
        horizontal_deg: Horizontal angle between rays, degrees.
        vertical_deg: Vertical angle between rays, degrees.
        lowest_deg: Elevation of the lowest ray; -90 is straight down.
        highest_deg: Elevation that the rays stay below (the highest ray of a full sphere is at 89
            degrees).
        reach: Farthest a ray goes, metres.
    """

    horizontal_deg: float = 1.0
    vertical_deg: float = 1.0
    lowest_deg: float = -90.0
    highest_deg: float = 90.0
    reach: float = 5.0

    def directions(self) -> NDArray[np.float64]:
        """Return the (R, 3) float64 unit directions, azimuth after azimuth from +x towards +y."""
        turn = np.arange(0.0, 360.0 - 1e-9, self.horizontal_deg)
        tilt = np.arange(self.lowest_deg, self.highest_deg - 1e-9, self.vertical_deg)
        every = np.meshgrid(np.radians(turn), np.radians(tilt), indexing="ij")
        azimuth, elevation = (grid.ravel() for grid in every)
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
    """Follow rays until they enter an occupied voxel (Amanatides and Woo, 1987).

    No voxel on the way is left out. The voxel the rays start in does not stop them: a sensor may
    stand inside an occupied one.

    Args:
        grid: The building.
        origin: (3,) float64, where the rays start, metres, map frame.
        directions: (R, 3) float64 unit vectors.
        reach: Farthest a ray goes, metres; a voxel counts when the ray enters it no farther than
            that.
        pool: Threads to share the rays among; None casts them in this thread.
        num_threads: Parts the rays are split into when there is a pool.

    Returns:
        (R,) int32 number of the voxel each ray ends in, -1 for none; the same for any number of
        threads.
    """
    # lengths in voxels: voxel v spans [v, v + 1) here
    start = origin / grid.voxel_size + 0.5 - grid.low
    longest = reach / grid.voxel_size

    cells = np.empty(len(directions), np.int64)
    if pool is None or num_threads == 1:
        _cast(start, directions, longest, grid.gaps, cells)
    else:
        rays, ends = (np.array_split(array, num_threads) for array in (directions, cells))
        list(pool.map(lambda ray, end: _cast(start, ray, longest, grid.gaps, end), rays, ends))
    return grid.ids_of_cells(cells)


def visible_voxels(
    grid: OccupancyGrid,
    origin: NDArray[np.float64],
    directions: NDArray[np.float64],
    reach: float,
    pool: ThreadPoolExecutor | None = None,
    num_threads: int = 1,
) -> NDArray[np.int32]:
    """Return the (V,) int32 numbers of the voxels that ``cast_rays`` ends in, once, ascending."""
    hits = cast_rays(grid, origin, directions, reach, pool, num_threads)
    is_seen = np.zeros(len(grid) + 1, bool)  # the last is where -1 points
    is_seen[hits] = True
    return np.flatnonzero(is_seen[:-1]).astype(np.int32)


@njit(cache=True)
def _face(place: float, cell: int, direction: float) -> float:
    """Return how far along a ray it leaves ``cell`` across one axis, in voxels; may be infinite."""
    if direction > 0.0:
        return (cell + 1 - place) / direction
    return (cell - place) / direction if direction < 0.0 else np.inf


@njit(cache=True, nogil=True)
def _cast(
    start: NDArray[np.float64],
    directions: NDArray[np.float64],
    longest: float,
    gaps: NDArray[np.uint8],
    hits: NDArray[np.int64],
) -> None:
    """Walk every ray to the first voxel without gap.

    Rays leap through free space and go face by face near surfaces. Lengths are in voxels and places
    from the grid's corner; ``hits`` gets the voxel's place in ``gaps``, -1 for none.
    """
    flat = gaps.ravel()
    num_x, num_y, num_z = gaps.shape
    for ray in range(len(directions)):
        toward_x, toward_y, toward_z = directions[ray, 0], directions[ray, 1], directions[ray, 2]
        fastest = max(abs(toward_x), abs(toward_y), abs(toward_z))
        x, y, z = int(np.floor(start[0])), int(np.floor(start[1])), int(np.floor(start[2]))
        hits[ray], gap, reached, is_start = -1, 1, 0.0, True
        while reached <= longest:
            # the ray ends in a voxel without gap, or where it leaves the grid for good
            if 0 <= x < num_x and 0 <= y < num_y and 0 <= z < num_z:
                gap = int(flat[(x * num_y + y) * num_z + z])
                if gap == 0 and not is_start:
                    hits[ray] = (x * num_y + y) * num_z + z
                    break
            elif (
                _is_leaving(x, toward_x, num_x)
                or _is_leaving(y, toward_y, num_y)
                or _is_leaving(z, toward_z, num_z)
            ):
                break
            else:
                gap = 1
            is_start = False

            # a leap: all voxels up to gap - 1 away are empty
            if gap > 1:
                reached += (gap - 1) / fastest
                x = int(np.floor(start[0] + reached * toward_x))
                y = int(np.floor(start[1] + reached * toward_y))
                z = int(np.floor(start[2] + reached * toward_z))
                continue

            # a step: across the nearest face
            to_x = _face(start[0], x, toward_x)
            to_y = _face(start[1], y, toward_y)
            to_z = _face(start[2], z, toward_z)
            reached = min(to_x, to_y, to_z)
            if reached == to_x:
                x += 1 if toward_x > 0.0 else -1
            elif reached == to_y:
                y += 1 if toward_y > 0.0 else -1
            else:
                z += 1 if toward_z > 0.0 else -1


@njit(cache=True)
def _is_leaving(cell: int, direction: float, size: int) -> bool:
    """Tell whether a ray outside the grid on one axis will never come in."""
    return (cell < 0 and direction <= 0.0) or (cell >= size and direction >= 0.0)
