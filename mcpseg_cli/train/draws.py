"""Which points make a batch (III-D), and how they are numbered in it: functions over arrays."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray


def choose_balanced(
    instance: NDArray[np.int32], count: int, per_instance: int, rng: np.random.Generator
) -> NDArray[np.intp]:
    """Draw points evenly from objects.

    A random object gives up to ``per_instance`` of its points, then another, until there are
    enough.

    Args:
        instance: (P,) int32 objects of the points to draw from, at least one.
        count: Points to draw.
        per_instance: Points taken from an object at a time; it may be its turn again.
        rng: Source of every choice.

    Returns:
        (count,) rows of ``instance``: each at most once, unless there are fewer than ``count``.
    """
    # object by object, the points of each in random order
    order = rng.permutation(len(instance))
    order = order[np.argsort(instance[order], kind="stable")]
    ends = [*(np.flatnonzero(np.diff(instance[order])) + 1).tolist(), len(order)]
    left = [list(span) for span in zip([0, *ends[:-1]], ends, strict=True)]

    chosen: list[NDArray[np.intp]] = []
    missing = count
    while missing > 0 and left:
        turn = int(rng.integers(len(left)))
        first, end = left[turn]
        taken = min(per_instance, end - first, missing)
        chosen.append(order[first : first + taken])
        missing -= taken

        # an object that has no points left gets no turn again
        left[turn][0] += taken
        if left[turn][0] == end:
            left[turn] = left[-1]
            left.pop()
    return fill_up(np.concatenate(chosen), len(instance), count, rng)


def choose_plain(num_rows: int, count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Draw (count,) of so many rows with equal odds; too few are repeated."""
    return fill_up(rng.permutation(num_rows)[:count], num_rows, count, rng)


class Order:
    """The order of the scans in each epoch, shuffled anew.

    Args:
        seed: Of the training.
        count: Scans.
    """

    def __init__(self, seed: int, count: int) -> None:
        self._seed, self._count = seed, count
        self._last: tuple[int, NDArray[np.int64]] = (-1, np.empty(0, np.int64))

    def places(self, number: int) -> NDArray[np.int64]:
        """Give (count,) scans in the order of epoch ``number``."""
        known, places = self._last
        if known != number:
            places = np.random.default_rng((self._seed, number)).permutation(self._count)
            self._last = (number, places)
        return places


def fill_up(
    rows: NDArray[np.intp], num_rows: int, count: int, rng: np.random.Generator
) -> NDArray[np.intp]:
    """Fill up to ``count`` rows by sampling with replacement."""
    return np.concatenate([rows, rng.integers(num_rows, size=count - len(rows))])


@njit(cache=True, nogil=True)
def number_locally(ids: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Number distinct ids in the order they first come.

    By a hash table: ``np.unique`` sorts, which takes far longer.

    Args:
        ids: (N,) int32, not negative.

    Returns:
        (L,) int32 the distinct ids, and (N,) int32 where each id is among them.
    """
    size = 1
    while size < 2 * ids.size:
        size *= 2
    keys, slots = np.full(size, -1, np.int32), np.empty(size, np.int32)
    unique, number = np.empty(ids.size, np.int32), np.empty(ids.size, np.int32)

    count = 0
    for i in range(ids.size):
        # the first slot from its own on that is its or free
        slot = (np.int64(ids[i]) * 2654435761 >> 8) & (size - 1)
        while keys[slot] != ids[i] and keys[slot] != -1:
            slot = (slot + 1) & (size - 1)
        if keys[slot] == -1:
            keys[slot] = ids[i]
            slots[slot] = count
            unique[count] = ids[i]
            count += 1
        number[i] = slots[slot]
    return unique[:count].copy(), number
