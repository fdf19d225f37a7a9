"""Rows shared among threads, tile by tile; each thread works in memory of its own, kept for later.

Tiles have few different heights: libraries that make code for each height of a product then make
it once. Which tiles there are depends on the number of rows only, so that one thread and many give
the same answer, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import torch
from torch import Tensor

_MOST_ROWS = 2048  # of a tile: few enough that what is computed of them stays near the core
_STEP = 128  # heights are multiples of this
_SMALL_STEP = 16  # and below it of this


class Scratch:
    """Memory that a thread works in, one block for each name and dtype."""

    def __init__(self) -> None:
        self._blocks: dict[tuple[str, torch.dtype], Tensor] = {}
        self._matrices: dict[tuple[str, torch.dtype, int, int], Tensor] = {}

    def matrix(
        self, name: str, rows: int, width: int, dtype: torch.dtype = torch.float32
    ) -> Tensor:
        """Give a (rows, width) matrix; what is in it holds until the name is asked for again."""
        key = name, dtype, rows, width
        matrix = self._matrices.get(key)
        if matrix is None:
            matrix = self._matrices[key] = self._block(name, dtype, rows * width).view(rows, width)
        return matrix

    def _block(self, name: str, dtype: torch.dtype, size: int) -> Tensor:
        """Give the first numbers of a block, a larger one if need be; numbers are always finite."""
        block = self._blocks.get((name, dtype))
        if block is None or len(block) < size:
            block = self._blocks[name, dtype] = torch.zeros(size, dtype=dtype)
            old = [key for key in self._matrices if key[:2] == (name, dtype)]
            for key in old:
                del self._matrices[key]
        return block[:size]


Work = Callable[[Scratch, slice], None]


class Workers:
    """The caller and the threads beside it, as many in all as torch is set to use."""

    def __init__(self) -> None:
        count = torch.get_num_threads()
        self._scratch = [Scratch() for _ in range(count)]
        self._others = ThreadPoolExecutor(
            max(count - 1, 1), initializer=torch.set_num_threads, initargs=(1,)
        )

    def share(self, count: int, work: Work) -> None:
        """Do so many rows, tile by tile; whoever is free takes the next.

        Args:
            count: Rows.
            work: Does the rows of a slice, in memory that is the thread's own.
        """
        tiles = iter(tiles_of(count))
        others = self._scratch[1:] if count > _MOST_ROWS else []
        helping = [self._others.submit(_take, tiles, work, each) for each in others]
        _take(tiles, work, self._scratch[0])
        for each in helping:
            if not each.cancel():  # one that never came finds nothing left
                each.result()


@torch.inference_mode()
def _take(tiles: Iterator[slice], work: Work, scratch: Scratch) -> None:
    """Do tiles until there are no more."""
    for rows in tiles:
        work(scratch, rows)


def tiles_of(count: int) -> list[slice]:
    """Cut so many rows into tiles of about the same height, all but the last of equal height."""
    number = -(-count // _MOST_ROWS)
    if number == 0:
        return []
    height = height_of(-(-count // number))
    ends = [min(place * height, count) for place in range(number + 1)]
    return [slice(first, last) for first, last in pairwise(ends) if first < last]


def height_of(count: int) -> int:
    """Round the rows of a tile up to a height that others have, too."""
    step = _STEP if count > _STEP else _SMALL_STEP
    return -(-count // step) * step
