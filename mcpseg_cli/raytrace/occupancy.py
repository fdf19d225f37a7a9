"""The voxel grid that rays are cast in: a bit per voxel in blocks of 4 x 4 x 4, and its point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.grid import voxel_of

MAX_BLOCKS = 1 << 24
"""Blocks of a grid: 1.3 GB, a box of 300 m x 300 m x 12 m at 0.1 m."""
_CHUNK = 1 << 20  # points voxelised at once


@dataclass(frozen=True)
class OccupancyGrid:
    """Which voxels of a building hold points, and which point stands for each.

    A voxel is occupied where its bit in ``masks`` is set. Occupied voxels are numbered block after
    block, bit after bit: the number of one is ``ranks`` of its block plus the bits set before its
    own.

    Attributes:
        voxel_size: Edge of a voxel, metres.
        low: (3,) int64 voxel at the corner of block (0, 0, 0), a multiple of 4.
        masks: (X, Y, Z) uint64, a bit per voxel of each block; bit ``16 x + 4 y + z`` for the voxel
            (x, y, z) in it.
        ranks: (X, Y, Z) int32, number of occupied voxels in all blocks before.
        gaps: (4 X, 4 Y, 4 Z) uint8, voxels (steps of a king) from each to the nearest occupied one,
            0 for occupied ones, at most 255: rays leap by it.
        points: (V,) int64, for each occupied voxel the point of the building that stands for it.
    """

    voxel_size: float
    low: NDArray[np.int64]
    masks: NDArray[np.uint64]
    ranks: NDArray[np.int32]
    gaps: NDArray[np.uint8]
    points: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.points)

    def voxel_ids(self, voxel: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return the (N,) int32 numbers of voxels (N, 3); -1 for empty ones and those outside."""
        return _look_up(voxel.astype(np.int64) - self.low, self.masks, self.ranks)

    def ids_of_cells(self, cells: NDArray[np.int64]) -> NDArray[np.int32]:
        """Return the (N,) int32 numbers of voxels given as places in flat ``gaps``; -1 stays -1."""
        return _look_up_cells(cells, self.gaps.shape, self.masks, self.ranks)


def build_grid(xyz: NDArray[np.float32], voxel_size: float, seed: int = 0) -> OccupancyGrid:
    """Enter a building into a voxel grid; a random one of each voxel's points stands for it.

    Args:
        xyz: (N, 3) float32, metres, map frame; at least one point.
        voxel_size: Edge of a voxel, metres.
        seed: Decides which point stands for a voxel; it is the same for the same seed.

    Returns:
        The grid; about 1.2 bytes for each voxel of the bounding box and 8 for each occupied one.

    Raises:
        InputError: The bounding box is too large for the voxel size.
    """
    # blocks around all points
    corners = voxel_of(np.stack([xyz.min(axis=0), xyz.max(axis=0)]), voxel_size).astype(np.int64)
    low = corners[0] // 4 * 4
    shape = (corners[1] - low) // 4 + 1
    if int(shape[0]) * int(shape[1]) * int(shape[2]) > MAX_BLOCKS:
        extent = " x ".join(f"{size:,.0f}" for size in np.ptp(corners, axis=0) * voxel_size)
        raise InputError(
            "the building",
            f"{extent} m in voxels of {voxel_size:g} m",
            f"at most {MAX_BLOCKS * 64:,} voxels",
            "remove stray points, give larger voxels, or check that lengths are in metres",
        )

    # a bit for each occupied voxel, which numbers them
    masks = np.zeros(tuple(shape), np.uint64)
    for start in range(0, len(xyz), _CHUNK):
        _mark(voxel_of(xyz[start : start + _CHUNK], voxel_size), low, masks)
    ranks = _count(masks)
    num_voxels = int(ranks.flat[-1]) + int(masks.flat[-1]).bit_count()

    # the point with the highest draw stands for its voxel
    points = np.full(num_voxels, -1, np.int64)
    draws = np.zeros(num_voxels, np.uint64)
    for start in range(0, len(xyz), _CHUNK):
        voxel = voxel_of(xyz[start : start + _CHUNK], voxel_size).astype(np.int64) - low
        _choose(_look_up(voxel, masks, ranks), start, np.uint64(seed), draws, points)
    return OccupancyGrid(voxel_size, low, masks, ranks, _measure_gaps(masks), points)


@njit(cache=True, nogil=True)
def _mark(voxel: NDArray[np.int32], low: NDArray[np.int64], masks: NDArray[np.uint64]) -> None:
    """Set the bit of each voxel."""
    for row in range(len(voxel)):
        x, y, z = voxel[row, 0] - low[0], voxel[row, 1] - low[1], voxel[row, 2] - low[2]
        bit = np.uint64(((x & 3) << 4) | ((y & 3) << 2) | (z & 3))
        masks[x >> 2, y >> 2, z >> 2] |= np.uint64(1) << bit


@njit(cache=True)
def _bits(mask: np.uint64) -> int:
    """Count the bits that are set."""
    mask = mask - ((mask >> np.uint64(1)) & np.uint64(0x5555555555555555))
    mask = (mask & np.uint64(0x3333333333333333)) + (
        (mask >> np.uint64(2)) & np.uint64(0x3333333333333333)
    )
    mask = (mask + (mask >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return int((mask * np.uint64(0x0101010101010101)) >> np.uint64(56))


@njit(cache=True)
def _count(masks: NDArray[np.uint64]) -> NDArray[np.int32]:
    """Number the occupied voxels: how many there are in all blocks before each."""
    ranks = np.empty(masks.shape, np.int32)
    total = 0
    for x in range(masks.shape[0]):
        for y in range(masks.shape[1]):
            for z in range(masks.shape[2]):
                ranks[x, y, z] = total
                total += _bits(masks[x, y, z])
    return ranks


@njit(cache=True, nogil=True)
def _look_up(
    voxel: NDArray[np.int64], masks: NDArray[np.uint64], ranks: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Return the number of each voxel, given from the grid's corner; -1 if empty or outside."""
    ids = np.full(len(voxel), -1, np.int32)
    num_x, num_y, num_z = 4 * masks.shape[0], 4 * masks.shape[1], 4 * masks.shape[2]
    for row in range(len(voxel)):
        x, y, z = voxel[row, 0], voxel[row, 1], voxel[row, 2]
        if 0 <= x < num_x and 0 <= y < num_y and 0 <= z < num_z:
            ids[row] = _number(x, y, z, masks, ranks)
    return ids


@njit(cache=True, nogil=True)
def _look_up_cells(
    cells: NDArray[np.int64],
    size: tuple[int, int, int],
    masks: NDArray[np.uint64],
    ranks: NDArray[np.int32],
) -> NDArray[np.int32]:
    """Return the number of each voxel, given by its place in a grid of ``size``; -1 for -1."""
    ids = np.full(len(cells), -1, np.int32)
    for row in range(len(cells)):
        cell = cells[row]
        if cell >= 0:
            x, y, z = cell // (size[1] * size[2]), cell // size[2] % size[1], cell % size[2]
            ids[row] = _number(x, y, z, masks, ranks)
    return ids


@njit(cache=True)
def _number(x: int, y: int, z: int, masks: NDArray[np.uint64], ranks: NDArray[np.int32]) -> int:
    """Return the number of a voxel of the grid, -1 when it is empty."""
    mask = masks[x >> 2, y >> 2, z >> 2]
    bit = np.uint64(((x & 3) << 4) | ((y & 3) << 2) | (z & 3))
    if (mask >> bit) & np.uint64(1):
        before = mask & ((np.uint64(1) << bit) - np.uint64(1))
        return int(ranks[x >> 2, y >> 2, z >> 2] + _bits(before))
    return -1


@njit(cache=True, nogil=True)
def _measure_gaps(masks: NDArray[np.uint64]) -> NDArray[np.uint8]:
    """Measure how far from every voxel the nearest occupied one is (Rosenfeld and Pfaltz, 1966)."""
    # none at occupied voxels
    num_x, num_y, num_z = 4 * masks.shape[0], 4 * masks.shape[1], 4 * masks.shape[2]
    gaps = np.full((num_x + 2, num_y + 2, num_z + 2), 255, np.uint8)
    for x in range(num_x):
        for y in range(num_y):
            for z in range(num_z):
                bit = np.uint64(((x & 3) << 4) | ((y & 3) << 2) | (z & 3))
                if (masks[x >> 2, y >> 2, z >> 2] >> bit) & np.uint64(1):
                    gaps[x + 1, y + 1, z + 1] = 0

    # there and back again, each time from the neighbours that are done; diagonals count one
    for x in range(1, num_x + 1):
        for y in range(1, num_y + 1):
            for z in range(1, num_z + 1):
                gaps[x, y, z] = _least_gap(gaps, x, y, z, -1)
    for x in range(num_x, 0, -1):
        for y in range(num_y, 0, -1):
            for z in range(num_z, 0, -1):
                gaps[x, y, z] = _least_gap(gaps, x, y, z, 1)
    return gaps[1:-1, 1:-1, 1:-1].copy()


@njit(cache=True)
def _least_gap(gaps: NDArray[np.uint8], x: int, y: int, z: int, side: int) -> int:
    """Return the gap of a voxel as the half of its neighbours on one side knows it."""
    least = int(gaps[x, y, z])
    if least == 0:
        return least
    for i in range(-1, 2):
        for j in range(-1, 2):
            for k in range(-1, 2):
                if 9 * i + 3 * j + k < 0:
                    least = min(least, int(gaps[x - side * i, y - side * j, z - side * k]) + 1)
    return least


@njit(cache=True, nogil=True)
def _choose(
    ids: NDArray[np.int32],
    first: int,
    seed: np.uint64,
    draws: NDArray[np.uint64],
    points: NDArray[np.int64],
) -> None:
    """Let the point with the highest draw stand for its voxel."""
    for row in range(len(ids)):
        # SplitMix64 of the seed and the point's place
        draw = (np.uint64(first + row) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15) + seed
        draw = (draw ^ (draw >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        draw = (draw ^ (draw >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        draw ^= draw >> np.uint64(31)

        voxel = ids[row]
        if points[voxel] < 0 or draw > draws[voxel]:
            draws[voxel], points[voxel] = draw, first + row
