"""The tree of tiles: cubes that halve, each with an even sample of what its children do not have.

Cells are voxels at the deepest level, and twice as long at every level up. What a level and all
above it have is one point a cell; so a tile has the points of its cells that no cell of the level
above has taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.errors import OutputError
from mcpseg_cli.grid import voxel_of

CELLS = 64
"""Cells along an edge of a tile, at every level."""
CELL_BITS = 6
_FINEST = 128  # steps that positions have within a voxel, at least while 16 bits suffice
_MOST_STEPS = 65_535
_MOST_TILES = 1 << 15  # along an axis: 21 bits of a key tell cells apart


@dataclass(frozen=True)
class TileGrid:
    """Where the cubes of a tree are.

    Attributes:
        voxel_size: Metres.
        first: (3,) int64 the voxel at the lowest corner of all.
        depth: The deepest level, whose cells are voxels; the one cube of level 0 has all.
    """

    voxel_size: float
    first: NDArray[np.int64]
    depth: int

    @classmethod
    def around(cls, low: NDArray[np.int32], high: NDArray[np.int32], voxel_size: float) -> TileGrid:
        """Return the smallest tree around voxels.

        Args:
            low: (3,) least index along each axis.
            high: (3,) greatest.
            voxel_size: Metres.

        Raises:
            OutputError: They reach farther than keys tell apart.
        """
        first, last = low.astype(np.int64) // CELLS, high.astype(np.int64) // CELLS
        tiles = int((last - first).max()) + 1
        if tiles > _MOST_TILES:
            raise OutputError(
                f"a map {tiles * CELLS * voxel_size / 1000:,.0f} km long; expected at most "
                f"{_MOST_TILES * CELLS * voxel_size / 1000:,.0f} km on a page in tiles; take a "
                "part of it with --box"
            )
        return cls(voxel_size, first * CELLS, (tiles - 1).bit_length())

    @property
    def corner(self) -> NDArray[np.float64]:
        """(3,) the lowest corner of all, metres, map frame."""
        return (self.first.astype(np.float64) - 0.5) * self.voxel_size

    def edge(self, level: int) -> float:
        """Return the edge of the cubes of a level, metres."""
        return self.spacing(level) * CELLS

    def spacing(self, level: int) -> float:
        """Return the edge of the cells of a level, metres."""
        return float(self.voxel_size * (1 << (self.depth - level)))

    def step(self, level: int) -> float:
        """Return what positions in tiles of a level are exact to, metres; 16 bits hold an edge."""
        finest = (CELLS * _FINEST) << (self.depth - level)
        return self.edge(level) / min(finest, _MOST_STEPS)

    def keys(self, xyz: NDArray[np.float32]) -> NDArray[np.int64]:
        """Return (N,) the cells of the deepest level as keys, in the order of a Z curve.

        Args:
            xyz: (N, 3) float32 points in the tree, metres, map frame.
        """
        cell = voxel_of(xyz, self.voxel_size) - self.first
        return _spread(cell[:, 0]) | _spread(cell[:, 1]) << 1 | _spread(cell[:, 2]) << 2

    def tiles_of(self, keys: NDArray[np.int64], level: int) -> NDArray[np.int64]:
        """Return (N,) keys of the tiles of a level that cells are in."""
        return keys >> (3 * (self.depth - level + CELL_BITS))

    def taken_up(
        self, keys: NDArray[np.int64], xyz: NDArray[np.float32], level: int
    ) -> NDArray[np.bool_]:
        """Mark what the level above takes: in each of its cells the point nearest to its middle.

        Args:
            keys: (N,) ascending; all that this level and those above it have in some cubes.
            xyz: (N, 3) float32, metres, map frame.
            level: This level, above 0.

        Returns:
            (N,) bool.
        """
        above = keys >> (3 * (self.depth - level + 1))
        spacing = self.spacing(level - 1)
        inside = (xyz - self.corner) / spacing
        inside -= np.floor(inside) + 0.5
        return _nearest_of_runs(above, np.einsum("ij,ij->i", inside, inside))


def places_of(tiles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return (T, 3) x, y, z of tiles, counted from the lowest corner of the tree."""
    return np.stack([_gathered(tiles >> axis) for axis in range(3)], axis=-1)


_STEPS = (
    (32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F),
    (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249),
)  # fmt: skip


def _spread(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Put two zeros between any two bits of numbers of at most 21 bits."""
    for shift, mask in _STEPS:
        values = (values | values << shift) & mask
    return values


def _gathered(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Take every third bit: undo ``_spread``."""
    values = values & _STEPS[-1][1]
    for (shift, _), (_, mask) in zip(
        reversed(_STEPS), [*reversed(_STEPS[:-1]), (0, 0x1FFFFF)], strict=True
    ):
        values = (values | values >> shift) & mask
    return values


@njit(cache=True)
def _nearest_of_runs(groups: NDArray[np.int64], away: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mark the least ``away`` of each run of equal groups, the first of equals."""
    chosen = np.zeros(groups.size, np.bool_)
    best = 0
    for i in range(groups.size):
        if groups[i] != groups[best]:
            chosen[best] = True
            best = i
        elif away[i] < away[best]:
            best = i
    if groups.size:
        chosen[best] = True
    return chosen
