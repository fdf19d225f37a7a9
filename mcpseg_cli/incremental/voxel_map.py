"""The global look-up table (III-B): 0.1 m voxels, one point each, in hashed blocks of 4 x 4 x 4.

Looking up a window of voxels costs a few hash probes for its blocks and then plain array reads, so
nothing here depends on how large the map is. Blocks after Niessner et al., Real-time 3D
Reconstruction at Scale using Voxel Hashing, 2013.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.choices import ContextWindow
from mcpseg_cli.grid import MAX_VOXEL, voxel_of
from mcpseg_cli.incremental.column import IN_MEMORY, RESERVED_ROWS, Column, Memory

_EMPTY = -1
_BLOCK_BIAS = 1 << 20  # block indices are 21-bit: see grid.MAX_VOXEL
# surfaces fill 16 of a block's 64 voxels, edges and clutter fewer
_RESERVED_BLOCKS = RESERVED_ROWS // 8
_FIRST_KEYS = 1 << 12
_CELLS_REACH = 3  # cells from a point to its context points (III-B)
NEIGHBOUR_REACH = 1  # cells from a point to its neighbours (III-C)

Blocks = tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.int32]]
"""Keys of the hash table, the block of each slot, (B, 64) voxel ids of the blocks, plus one."""


class VoxelMap:
    """One point per voxel, in the order first seen; the row of a voxel is its id.

    Args:
        voxel_size: Edge of a voxel, metres.
        memory: Where its rows are.
    """

    def __init__(self, voxel_size: float, memory: Memory = IN_MEMORY) -> None:
        self.voxel_size = voxel_size
        self._memory = memory
        self._xyz = Column(np.float32, 3, memory=memory)
        self._rgb = Column(np.uint8, 3, memory=memory)
        # id + 1, 0 for none: untouched memory is zero
        self._block_ids: NDArray[np.int32] = memory.rows(np.int32, (64,), _RESERVED_BLOCKS)
        self._num_blocks = 0
        self._keys = np.full(_FIRST_KEYS, _EMPTY, np.int64)
        self._slots = np.empty(_FIRST_KEYS, np.int32)

    def __len__(self) -> int:
        return len(self.xyz)

    @property
    def _blocks(self) -> Blocks:
        return self._keys, self._slots, self._block_ids

    @property
    def xyz(self) -> NDArray[np.float32]:
        """(V, 3) float32, metres, map frame: each voxel's first point. A view, until an insert."""
        return self._xyz.rows

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """(V, 3) uint8 colour of each voxel's first point: a view, valid until the next insert."""
        return self._rgb.rows

    def insert(self, xyz: NDArray[np.float32], rgb: NDArray[np.uint8]) -> NDArray[np.int32]:
        """Add the first point of every voxel not seen before (III-B).

        Args:
            xyz: (N, 3) float32, metres, map frame.
            rgb: (N, 3) uint8.

        Returns:
            (N,) int32: the id of the voxel each point falls into. New voxels have the ids from the
            old length on, in the order their first points come.
        """
        voxel = voxel_of(xyz, self.voxel_size)
        ids = np.empty(len(xyz), np.int32)
        first_point = np.empty(len(xyz), np.int64)

        # until all fit in
        done = num_new = 0
        while done < len(xyz):
            progress = (done, num_new, self._num_blocks)
            done, num_new, self._num_blocks = _insert_points(
                voxel, len(self), progress, self._blocks, ids, first_point
            )
            if done < len(xyz):
                self._grow()

        # one point a voxel
        chosen = first_point[:num_new]
        self._xyz.append(xyz[chosen])
        self._rgb.append(rgb[chosen])
        return ids

    def find(self, xyz: NDArray[np.float32]) -> NDArray[np.int32]:
        """Return the id of the voxel each point falls into, -1 where the map has none.

        Args:
            xyz: (N, 3) float32, metres, map frame; some may lie where no map goes.

        Returns:
            (N,) int32.
        """
        beyond = ~(np.abs(xyz) < (MAX_VOXEL - 16) * self.voxel_size)
        voxel = voxel_of(np.where(beyond, np.float32(0), xyz), self.voxel_size)
        ids: NDArray[np.int32] = _find_voxels(voxel, self._blocks)
        ids[beyond.any(axis=1)] = -1
        return ids

    def neighbours(self, ids: NDArray[np.int32], reach: int = NEIGHBOUR_REACH) -> NDArray[np.int32]:
        """Find the voxels at most one cell away (III-C), or a few.

        Args:
            ids: (M,) int32 voxel ids.
            reach: R, cells.

        Returns:
            (M, (2R + 1)³ - 1) int32 ids in a fixed order of directions, -1 where there is no voxel;
            (M, 26) for one cell.
        """
        voxel = voxel_of(self.xyz[ids], self.voxel_size)
        cubes = _gather_cubes(voxel - np.int32(reach), 2 * reach + 1, self._blocks)
        return np.delete(cubes, cubes.shape[1] // 2, axis=1)

    def sample_context(
        self, ids: NDArray[np.int32], window: ContextWindow, uniform: NDArray[np.float32]
    ) -> NDArray[np.int32]:
        """Sample context points for each voxel from this and all earlier scans (III-B).

        Args:
            ids: (M,) int32 voxel ids.
            window: Which voxels are candidates; a voxel always is its own.
            uniform: (M, K) float32 random numbers in [0, 1), one for each context point to draw:
                without replacement, unless there are fewer candidates than K.

        Returns:
            (M, K) int32 voxel ids.
        """
        low, width = context_window(voxel_of(self.xyz[ids], self.voxel_size), window)
        sample: NDArray[np.int32] = _sample_windows(low, width, uniform, self._blocks)
        return sample

    def occupancy(self, low: NDArray[np.int32], shape: tuple[int, int, int]) -> NDArray[np.int32]:
        """Copy a box of the map into a dense grid.

        Args:
            low: (3,) int32 lowest voxel of the box.
            shape: Voxels along x, y and z.

        Returns:
            ``shape`` int32 voxel ids, -1 where there is no voxel.
        """
        size = np.array(shape, np.int32)
        grid: NDArray[np.int32] = _gather_box(low, size, self._blocks)
        return grid

    def near(
        self, position: NDArray[np.float64], radius: float, height: float
    ) -> NDArray[np.int32]:
        """List the voxels around a place; the cost depends on how many there are.

        Args:
            position: (3,) float64, metres, map frame.
            radius: Horizontal distance up to which a voxel's point counts, metres.
            height: How far above and below ``position`` at most, to the voxel, metres.

        Returns:
            (M,) int32 ids, ascending.
        """
        reach = np.array([radius, radius, height])
        low = voxel_of((position - reach)[None].astype(np.float32), self.voxel_size)[0]
        high = voxel_of((position + reach)[None].astype(np.float32), self.voxel_size)[0]
        ids: NDArray[np.int32] = _list_between(low, high, self._blocks)

        offset = self.xyz[ids, :2] - position[:2].astype(np.float32)
        is_near = np.einsum("na,na->n", offset, offset) < np.float32(radius) ** 2
        return np.sort(ids[is_near])

    def restore(self, xyz: NDArray[np.float32], rgb: NDArray[np.uint8]) -> None:
        """Append voxels of an earlier map, in id order, as ``xyz`` and ``rgb`` gave them.

        Raises:
            ValueError: A voxel is there twice: the points are not a map's.
        """
        expected = len(self) + len(xyz)
        self.insert(xyz, rgb)
        if len(self) != expected:
            raise ValueError("two points in one voxel")

    def _grow(self) -> None:
        """Double what is full: the blocks, or the hash table, which is kept at most half full."""
        if self._num_blocks == len(self._block_ids):
            grown: NDArray[np.int32] = self._memory.rows(np.int32, (64,), 2 * len(self._block_ids))
            grown[: self._num_blocks] = self._block_ids
            self._block_ids = grown
            return

        keys = np.full(2 * len(self._keys), _EMPTY, np.int64)
        slots = np.empty(2 * len(self._slots), np.int32)
        _rehash(self._keys, self._slots, keys, slots)
        self._keys, self._slots = keys, slots


def context_window(
    voxel: NDArray[np.int32], window: ContextWindow
) -> tuple[NDArray[np.int32], int]:
    """Give the box of voxels that context points may come from.

    Args:
        voxel: (M, 3) int32.
        window: ``cells`` or ``coarse``.

    Returns:
        (M, 3) int32 lowest voxel of each box, and its width in voxels. The coarse cells are three
        voxels wide and the rounding rule makes their borders voxel borders, so that the 27 of them
        are a box of 9 voxels.
    """
    if window == "cells":
        return voxel - np.int32(_CELLS_REACH), 2 * _CELLS_REACH + 1
    coarse = np.floor_divide(voxel + 1, 3, dtype=np.int32)
    return 3 * coarse - np.int32(4), 9


@njit(cache=True)
def _key(bx: int, by: int, bz: int) -> int:
    """Pack block indices into 63 bits."""
    bias = np.int64(_BLOCK_BIAS)
    return int(
        ((np.int64(bx) + bias) << 42) | ((np.int64(by) + bias) << 21) | (np.int64(bz) + bias)
    )


@njit(cache=True)
def _probe(keys: NDArray[np.int64], key: int) -> int:
    """Find the slot that holds ``key``, or the free one where it belongs."""
    mask = keys.size - 1
    mixed = key * np.int64(-7046029254386353131)
    slot = (mixed ^ (mixed >> 29)) & mask
    while keys[slot] != key and keys[slot] != _EMPTY:
        slot = (slot + 1) & mask
    return int(slot)


@njit(cache=True)
def _find_block(bx: int, by: int, bz: int, blocks: Blocks) -> int:
    keys, slots, _ = blocks
    key = _key(bx, by, bz)
    slot = _probe(keys, key)
    return int(slots[slot]) if keys[slot] == key else _EMPTY


@njit(cache=True)
def _cell(x: int, y: int, z: int) -> int:
    """Place a voxel within its block: z runs fastest."""
    return ((x & 3) << 4) | ((y & 3) << 2) | (z & 3)


@njit(cache=True)
def _insert_points(
    voxel: NDArray[np.int32],
    num_known: int,
    progress: tuple[int, int, int],
    blocks: Blocks,
    ids: NDArray[np.int32],
    first_point: NDArray[np.int64],
) -> tuple[int, int, int]:
    """Insert voxels; stop early when blocks or keys are full.

    Progress is points done, new voxels, blocks used.
    """
    done, num_new, num_blocks = progress
    keys, slots, block_ids = blocks
    for i in range(done, voxel.shape[0]):
        x, y, z = voxel[i, 0], voxel[i, 1], voxel[i, 2]
        key = _key(x >> 2, y >> 2, z >> 2)
        slot = _probe(keys, key)

        # its block
        if keys[slot] == _EMPTY:
            if num_blocks == block_ids.shape[0] or 2 * num_blocks >= keys.size:
                return i, num_new, num_blocks
            keys[slot] = key
            slots[slot] = num_blocks
            num_blocks += 1
        block = slots[slot]

        # its place in the block
        cell = _cell(x, y, z)
        if block_ids[block, cell] == 0:
            first_point[num_new] = i
            num_new += 1
            block_ids[block, cell] = num_known + num_new
        ids[i] = block_ids[block, cell] - 1
    return voxel.shape[0], num_new, num_blocks


@njit(cache=True)
def _rehash(
    old_keys: NDArray[np.int64],
    old_slots: NDArray[np.int32],
    keys: NDArray[np.int64],
    slots: NDArray[np.int32],
) -> None:
    for i in range(old_keys.size):
        if old_keys[i] != _EMPTY:
            slot = _probe(keys, old_keys[i])
            keys[slot] = old_keys[i]
            slots[slot] = old_slots[i]


@njit(cache=True)
def _find_voxels(voxel: NDArray[np.int32], blocks: Blocks) -> NDArray[np.int32]:
    ids = np.full(voxel.shape[0], _EMPTY, np.int32)
    for i in range(voxel.shape[0]):
        x, y, z = voxel[i, 0], voxel[i, 1], voxel[i, 2]
        block = _find_block(x >> 2, y >> 2, z >> 2, blocks)
        if block != _EMPTY:
            ids[i] = blocks[2][block, _cell(x, y, z)] - 1
    return ids


@njit(cache=True)
def _gather_box(
    low: NDArray[np.int32], shape: NDArray[np.int32], blocks: Blocks
) -> NDArray[np.int32]:
    """Read a box of voxels block by block; the grid is filled with -1 elsewhere."""
    grid = np.full((shape[0], shape[1], shape[2]), _EMPTY, np.int32)
    high = low + shape
    for bx in range(low[0] >> 2, ((high[0] - 1) >> 2) + 1):
        for by in range(low[1] >> 2, ((high[1] - 1) >> 2) + 1):
            for bz in range(low[2] >> 2, ((high[2] - 1) >> 2) + 1):
                block = _find_block(bx, by, bz, blocks)
                if block == _EMPTY:
                    continue

                # the part of the block within the box
                for x in range(max(low[0], bx << 2), min(high[0], (bx + 1) << 2)):
                    for y in range(max(low[1], by << 2), min(high[1], (by + 1) << 2)):
                        for z in range(max(low[2], bz << 2), min(high[2], (bz + 1) << 2)):
                            found = blocks[2][block, _cell(x, y, z)]
                            grid[x - low[0], y - low[1], z - low[2]] = found - 1
    return grid


@njit(cache=True)
def _list_between(
    low: NDArray[np.int32], high: NDArray[np.int32], blocks: Blocks
) -> NDArray[np.int32]:
    """List the voxels of all blocks that have a part between two corners, block by block."""
    found = np.empty(1024, np.int32)
    size = 0
    for bx in range(low[0] >> 2, (high[0] >> 2) + 1):
        for by in range(low[1] >> 2, (high[1] >> 2) + 1):
            for bz in range(low[2] >> 2, (high[2] >> 2) + 1):
                block = _find_block(bx, by, bz, blocks)
                if block == _EMPTY:
                    continue
                if size + 64 > found.size:
                    found = np.concatenate((found, np.empty(found.size, np.int32)))
                for cell in range(64):
                    if blocks[2][block, cell]:
                        found[size] = blocks[2][block, cell] - 1
                        size += 1
    return found[:size].copy()


@njit(cache=True)
def _gather_cubes(low: NDArray[np.int32], width: int, blocks: Blocks) -> NDArray[np.int32]:
    """Read a cube of ``width`` voxels for each row of ``low``."""
    shape = np.array([width, width, width], np.int32)
    cubes = np.empty((low.shape[0], width**3), np.int32)
    for i in range(low.shape[0]):
        cubes[i] = _gather_box(low[i], shape, blocks).ravel()
    return cubes


@njit(cache=True, nogil=True)
def _list_box(low: NDArray[np.int32], width: int, blocks: Blocks, ids: NDArray[np.int32]) -> int:
    """List the voxels in a cube, block by block; return how many."""
    size = 0
    x0, y0, z0 = low[0], low[1], low[2]
    x1, y1, z1 = x0 + width, y0 + width, z0 + width
    for bx in range(x0 >> 2, ((x1 - 1) >> 2) + 1):
        for by in range(y0 >> 2, ((y1 - 1) >> 2) + 1):
            for bz in range(z0 >> 2, ((z1 - 1) >> 2) + 1):
                block = _find_block(bx, by, bz, blocks)
                if block == _EMPTY:
                    continue

                # the part of the block within the cube
                for x in range(max(x0, bx << 2), min(x1, (bx + 1) << 2)):
                    for y in range(max(y0, by << 2), min(y1, (by + 1) << 2)):
                        for z in range(max(z0, bz << 2), min(z1, (bz + 1) << 2)):
                            found = blocks[2][block, _cell(x, y, z)]
                            ids[size] = found - 1
                            size += found != 0
    return size


@njit(cache=True, nogil=True)
def _sample_windows(
    low: NDArray[np.int32], width: int, uniform: NDArray[np.float32], blocks: Blocks
) -> NDArray[np.int32]:
    """Draw ids from each window: a partial Fisher-Yates shuffle, or with replacement if too few."""
    sample = np.empty(uniform.shape, np.int32)
    candidates = np.empty(width**3, np.int32)
    for i in range(low.shape[0]):
        size = _list_box(low[i], width, blocks, candidates)
        for k in range(uniform.shape[1]):
            done = k if size >= uniform.shape[1] else 0
            pick = done + min(int(uniform[i, k] * (size - done)), size - done - 1)
            sample[i, k] = candidates[pick]
            candidates[pick] = candidates[done]
            candidates[done] = sample[i, k]
    return sample
