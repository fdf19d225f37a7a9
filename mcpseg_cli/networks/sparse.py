"""Voxels as a sparse grid: neighbours, coarser grids, and products that skip empty space.

A window of the map is a few thousand occupied voxels of some hundred thousand. Tables name each
voxel's 27 neighbours and its place in the next coarser grid; they are made once for a window and
serve all layers. A depthwise convolution sums over the neighbours that exist; everything else a
network does is a dense product of all voxels at once, so no empty neighbour is ever multiplied.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import TypeVar

import numpy as np
import torch
from numba import njit
from numpy.typing import NDArray
from torch import Tensor, nn

from mcpseg_cli.networks.stencil import NUM_NEIGHBOURS

_CENTRE = 13
NUM_CHILDREN = 8
_NUM_COLUMNS = 5  # of voxels that hold the forward neighbours
_COLUMN_AHEAD = (0, 1 << 21, (1 << 42) - (1 << 21), 1 << 42, (1 << 42) + (1 << 21))  # see _key
_BIAS = 1 << 20  # voxel indices are 21-bit within a window
_EMPTY = -1
Result = TypeVar("Result")
_FEW_ROWS = 512  # fewer are not worth a second thread
_GATHERED = 1 << 27  # numbers at once: half a gigabyte


@dataclass(frozen=True)
class Level:
    """One resolution of a window.

    Attributes:
        neighbours: (V, 27) int32 rows of the voxels at offsets -1 to 1, x slowest; -1 where there
            is none. Column 13 is the voxel itself, and 26 - k the opposite of k.
        parent: (V,) int64 the voxel of the next coarser level that holds each; None at the
            coarsest.
        corner: (V,) int64 which of its parent's eight parts it is.
        children: (P, 8) int64 the voxels of each coarser one, V where there is none.
    """

    neighbours: Tensor
    parent: Tensor | None = None
    corner: Tensor | None = None
    children: Tensor | None = None

    def __len__(self) -> int:
        return len(self.neighbours)

    def tables(self) -> tuple[Tensor | None, ...]:
        """List all tables in the order that they are given in."""
        return self.neighbours, self.parent, self.corner, self.children

    def to(self, device: torch.device) -> Level:
        """Copy the tables to a device."""
        moved = [None if table is None else table.to(device) for table in self.tables()[1:]]
        return Level(self.neighbours.to(device), *moved)


def make_levels(voxel: NDArray[np.int32], num_levels: int) -> list[Level]:
    """Make the tables of a window, from its own resolution to the coarsest.

    Args:
        voxel: (V, 3) int32 distinct voxel indices, less than a million from 0.
        num_levels: How many, each of voxels twice as wide.

    Returns:
        ``num_levels`` levels, the finest first.
    """
    levels = []
    for _ in range(num_levels - 1):
        neighbours = torch.from_numpy(find_neighbours(voxel))
        coarse, parent, corner, children = _coarsen(voxel)
        levels.append(Level(neighbours, *map(torch.from_numpy, (parent, corner, children))))
        voxel = coarse
    return [*levels, Level(torch.from_numpy(find_neighbours(voxel)))]


@njit(cache=True, nogil=True)
def _key(x: int, y: int, z: int) -> int:
    """Pack voxel indices into 63 bits."""
    bias = np.int64(_BIAS)
    return int(((np.int64(x) + bias) << 42) | ((np.int64(y) + bias) << 21) | (np.int64(z) + bias))


@njit(cache=True, nogil=True)
def _probe(keys: NDArray[np.int64], key: int) -> int:
    """Find the slot that holds ``key``, or the free one where it belongs."""
    mask = keys.size - 1
    mixed = key * np.int64(-7046029254386353131)
    slot = (mixed ^ (mixed >> 29)) & mask
    while keys[slot] != key and keys[slot] != _EMPTY:
        slot = (slot + 1) & mask
    return int(slot)


@njit(cache=True, nogil=True)
def _empty_table(count: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Make a hash table for so many voxels, at most half full."""
    size = 16
    while size < 2 * count:
        size *= 2
    return np.full(size, _EMPTY, np.int64), np.empty(size, np.int32)


@njit(cache=True, nogil=True)
def number_voxels(voxel: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Number the distinct voxels of (N, 3) int32 in the order they first come.

    Returns:
        (V,) int64 the row where each first comes, and (N,) int64 the number of each row's voxel.
    """
    count = voxel.shape[0]
    keys, rows = _empty_table(count)
    first, number = np.empty(count, np.int64), np.empty(count, np.int64)
    num_distinct = 0
    for i in range(count):
        key = _key(voxel[i, 0], voxel[i, 1], voxel[i, 2])
        slot = _probe(keys, key)
        if keys[slot] == _EMPTY:
            keys[slot], rows[slot] = key, num_distinct
            first[num_distinct] = i
            num_distinct += 1
        number[i] = rows[slot]
    return first[:num_distinct].copy(), number


@njit(cache=True, nogil=True)
def find_neighbours(voxel: NDArray[np.int32]) -> NDArray[np.int32]:
    """Find (V, 27) int32 neighbours of (V, 3) int32 distinct voxels, each pair once.

    In ascending order, x first, the voxels of a neighbouring column lie ahead, at places that only
    move on; voxels already in that order are found fastest.
    """
    count = voxel.shape[0]
    keys, order = _sort_voxels(voxel)
    table = np.full((count, NUM_NEIGHBOURS), _EMPTY, np.int32)
    ahead = np.zeros(_NUM_COLUMNS, np.int64)
    for n in range(count):
        i = order[n]
        table[i, _CENTRE] = i
        for column in range(_NUM_COLUMNS):
            # forward columns: the voxel's own, and the four after it
            middle = keys[n] + _COLUMN_AHEAD[column]
            place = ahead[column]
            while place < count and keys[place] < middle - 1:
                place += 1
            ahead[column] = place

            while place < count and keys[place] <= middle + 1:
                k = _CENTRE + 3 * column + keys[place] - middle
                if k > _CENTRE:
                    table[i, k] = order[place]
                    table[order[place], NUM_NEIGHBOURS - 1 - k] = i
                place += 1
    return table


@njit(cache=True, nogil=True)
def _sort_voxels(voxel: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Give (V,) int64 keys of voxels, ascending, and the rows in that order."""
    count = voxel.shape[0]
    keys = np.empty(count, np.int64)
    is_sorted = True
    for i in range(count):
        keys[i] = _key(voxel[i, 0], voxel[i, 1], voxel[i, 2])
        is_sorted &= i == 0 or keys[i - 1] < keys[i]
    if is_sorted:
        return keys, np.arange(count)
    order = np.argsort(keys)
    return keys[order], order


@njit(cache=True, nogil=True)
def _coarsen(
    voxel: NDArray[np.int32],
) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Join voxels two by two by two: coarse voxels; parent, corner, children as in ``Level``."""
    count = voxel.shape[0]
    keys, rows = _empty_table(count)
    coarse = np.empty((count, 3), np.int32)
    parent, corner = np.empty(count, np.int64), np.empty(count, np.int64)
    children = np.full((count, NUM_CHILDREN), count, np.int64)
    num_coarse = 0
    for i in range(count):
        x, y, z = voxel[i, 0], voxel[i, 1], voxel[i, 2]
        key = _key(x >> 1, y >> 1, z >> 1)
        slot = _probe(keys, key)
        if keys[slot] == _EMPTY:
            keys[slot], rows[slot] = key, num_coarse
            coarse[num_coarse, 0], coarse[num_coarse, 1], coarse[num_coarse, 2] = (
                x >> 1,
                y >> 1,
                z >> 1,
            )
            num_coarse += 1
        parent[i] = rows[slot]
        corner[i] = (x & 1) * 4 + (y & 1) * 2 + (z & 1)
        children[parent[i], corner[i]] = i
    return coarse[:num_coarse].copy(), parent, corner, children[:num_coarse].copy()


class DepthwiseConv(nn.Module):
    """A 3 x 3 x 3 convolution of each feature by itself, over the voxels there are.

    Args:
        width: F, features.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(0.1 * torch.randn(NUM_NEIGHBOURS, width))
        with torch.no_grad():
            self.weight[_CENTRE] += 0.5  # begin near what a point alone says

    def forward(self, features: Tensor, level: Level) -> Tensor:
        """Sum over neighbours.

        Args:
            features: (V, F) float32.
            level: The tables of these voxels.

        Returns:
            (V, F) float32.
        """
        inputs = (features, level.neighbours, self.weight)
        if torch.onnx.is_in_onnx_export():
            return sum_neighbours(*inputs)
        if features.device.type != "cpu":
            return gather_neighbours(*inputs)
        summed: Tensor = _DepthwiseOnCpu.apply(*inputs)  # type: ignore[no-untyped-call]
        return summed


def sum_neighbours(features: Tensor, neighbours: Tensor, weight: Tensor) -> Tensor:
    """Convolve depthwise in plain torch, on any device: a gather and a product for each offset.

    Args:
        features: (V, F).
        neighbours: (V, 27) integer rows, -1 for none.
        weight: (27, F).

    Returns:
        (V, F).
    """
    padded = torch.cat([features, features.new_zeros(1, features.shape[1])])
    total = features * weight[_CENTRE]
    for k in range(NUM_NEIGHBOURS):
        if k != _CENTRE:
            total = total + padded[neighbours[:, k].long()] * weight[k]
    return total


def gather_neighbours(features: Tensor, neighbours: Tensor, weight: Tensor) -> Tensor:
    """Convolve as ``sum_neighbours`` does, in few calls: for devices with memory to spare."""
    summed: Tensor = _DepthwiseByGathering.apply(  # type: ignore[no-untyped-call]
        features, neighbours, weight
    )
    return summed


class _DepthwiseByGathering(torch.autograd.Function):
    """All neighbours at once. Being one is symmetric, so that gradients are gathered, too."""

    @staticmethod
    def forward(ctx, features, neighbours, weight):  # type: ignore[no-untyped-def]
        features = features.float()
        ctx.save_for_backward(features, neighbours, weight)
        parts = _gathered(features, neighbours)
        return torch.cat([(gathered * weight).sum(dim=1) for _, gathered in parts])

    @staticmethod
    def backward(ctx, slope):  # type: ignore[no-untyped-def]
        features, neighbours, weight = ctx.saved_tensors
        opposite, of_weight = weight.flip(0), torch.zeros_like(weight)
        of_features = torch.cat(
            [(gathered * opposite).sum(dim=1) for _, gathered in _gathered(slope, neighbours)]
        )
        for rows, gathered in _gathered(features, neighbours):
            of_weight += (gathered * slope[rows, None]).sum(dim=0)
        return of_features, None, of_weight


def _gathered(features: Tensor, neighbours: Tensor) -> Iterator[tuple[slice, Tensor]]:
    """Yield rows and their (R, 27, F) neighbours, 0 where there is none, bounded in memory."""
    padded = torch.cat([features, features.new_zeros(1, features.shape[1])])
    at_once = max(_GATHERED // (NUM_NEIGHBOURS * features.shape[1]), 1)
    for first in range(0, max(len(neighbours), 1), at_once):
        rows = slice(first, first + at_once)
        yield rows, padded[neighbours[rows].long()]  # -1 is the last row, of zeros


class _DepthwiseOnCpu(torch.autograd.Function):
    """The same in numba. Being a neighbour is symmetric, so that gradients are gathered, too."""

    @staticmethod
    def forward(ctx, features, neighbours, weight):  # type: ignore[no-untyped-def]
        features = features.float().contiguous()
        ctx.save_for_backward(features, neighbours, weight)
        total = torch.empty_like(features)
        known, table, answer = _arrays(features, neighbours, total)  # type: ignore[no-untyped-call]
        by = _padded(weight)
        _share_rows(
            len(known), lambda *rows: _convolve(known, table, by, answer[slice(*rows)], *rows)
        )
        return total

    @staticmethod
    def backward(ctx, slope):  # type: ignore[no-untyped-def]
        features, neighbours, weight = ctx.saved_tensors
        of_features = torch.empty_like(features)
        known, table, answer, slopes = _arrays(  # type: ignore[no-untyped-call]
            features, neighbours, of_features, slope.contiguous()
        )
        by = _padded(weight.flip(0))

        def gather(first, last):  # type: ignore[no-untyped-def]
            _convolve(slopes, table, by, answer[first:last], first, last)
            of_weight = np.zeros((NUM_NEIGHBOURS, known.shape[1]), np.float32)
            _correlate(known, table, slopes, of_weight, first, last)
            return of_weight

        of_weights = _share_rows(len(known), gather)
        return of_features, None, torch.from_numpy(np.sum(of_weights, axis=0))


def _padded(weight: Tensor) -> NDArray[np.float32]:
    """Give (28, F) float32 weights of the neighbours and, last, of none: 0."""
    padded = np.zeros((NUM_NEIGHBOURS + 1, weight.shape[1]), np.float32)
    padded[:-1] = weight.detach().numpy()
    return padded


def _arrays(*tensors):  # type: ignore[no-untyped-def]
    """View tensors as numpy arrays."""
    return [tensor.detach().numpy() for tensor in tensors]


def _share_rows(count: int, work: Callable[[int, int], Result]) -> list[Result]:
    """Share rows among as many threads as torch uses; results in the order of the rows."""
    threads = torch.get_num_threads() if count >= _FEW_ROWS else 1
    ends = [count * part // threads for part in range(threads + 1)]
    ranges = list(pairwise(ends))
    if threads == 1:
        return [work(*ranges[0])]

    others = [_workers(threads).submit(work, *each) for each in ranges[1:]]
    return [work(*ranges[0]), *[each.result() for each in others]]


@cache
def _workers(threads: int) -> ThreadPoolExecutor:
    """Keep the threads beside the one that asks."""
    return ThreadPoolExecutor(threads - 1)


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _convolve(
    features: NDArray[np.float32],
    neighbours: NDArray[np.int32],
    weight: NDArray[np.float32],
    total: NDArray[np.float32],
    first: int,
    last: int,
) -> None:
    """Sum the neighbours of voxels ``first`` to ``last``, weighted by where they are.

    Four neighbours at a time: one at a time takes five times as long, most of it for loops that end
    before they get going.
    """
    width = features.shape[1]
    rows, places = np.zeros(NUM_NEIGHBOURS + 3, np.int64), np.zeros(NUM_NEIGHBOURS + 3, np.int64)
    nothing = weight.shape[0] - 1  # weighs 0
    for i in range(first, last):
        count = 0
        for k in range(NUM_NEIGHBOURS):
            if neighbours[i, k] != _EMPTY:
                rows[count], places[count] = neighbours[i, k], k
                count += 1
        for k in range(count, (count + 3) // 4 * 4):
            rows[k], places[k] = i, nothing

        for c in range(width):
            total[i - first, c] = 0
        for n in range(0, count, 4):
            a, b, d, e = rows[n], rows[n + 1], rows[n + 2], rows[n + 3]
            p, q, r, s = places[n], places[n + 1], places[n + 2], places[n + 3]
            for c in range(width):
                total[i - first, c] += (
                    weight[p, c] * features[a, c]
                    + weight[q, c] * features[b, c]
                    + weight[r, c] * features[d, c]
                    + weight[s, c] * features[e, c]
                )


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def _correlate(
    features: NDArray[np.float32],
    neighbours: NDArray[np.int32],
    gradient: NDArray[np.float32],
    total: NDArray[np.float32],
    first: int,
    last: int,
) -> None:
    """Sum the gradient of the weights over rows ``first`` to ``last``."""
    width = features.shape[1]
    for i in range(first, last):
        for k in range(NUM_NEIGHBOURS):
            j = neighbours[i, k]
            if j != _EMPTY:
                for c in range(width):
                    total[k, c] += gradient[i, c] * features[j, c]
