"""What the network at inference gathers for a tile of rows: numba kernels, one call a tile."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.networks.stencil import NUM_NEIGHBOURS

_AT_ONCE = 4  # neighbours: one at a time takes five times as long


class Pairs(NamedTuple):
    """The neighbours that there are, voxel by voxel, in fours.

    Attributes:
        starts: (V + 1,) int32 where the pairs of each voxel begin; multiples of four.
        rows: (P,) int32 neighbours, the voxel itself among them; filled up with the voxel itself.
        places: (P,) int32 where each is, of 27; 27, which weighs nothing, where filled up.
    """

    starts: NDArray[np.int32]
    rows: NDArray[np.int32]
    places: NDArray[np.int32]


def pair_up(neighbours: NDArray[np.int32]) -> Pairs:
    """List the neighbours of (V, 27) int32 ``sparse.find_neighbours`` that there are."""
    return Pairs(*_pair_up(neighbours))


@njit(cache=True, nogil=True)
def _pair_up(
    neighbours: NDArray[np.int32],
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Count the neighbours, then list them; branches that depend on them would cost most."""
    count = neighbours.shape[0]
    starts = np.zeros(count + 1, np.int32)
    for i in range(count):
        there = 0
        for k in range(NUM_NEIGHBOURS):
            there += neighbours[i, k] >= 0
        starts[i + 1] = starts[i] + (there + _AT_ONCE - 1) // _AT_ONCE * _AT_ONCE

    # one more of each, as the place after the last is written, too
    rows, places = np.empty(starts[-1] + 1, np.int32), np.empty(starts[-1] + 1, np.int32)
    for i in range(count):
        end = starts[i]
        for k in range(NUM_NEIGHBOURS):
            rows[end], places[end] = neighbours[i, k], k
            end += neighbours[i, k] >= 0
        for n in range(end, starts[i + 1]):
            rows[n], places[n] = i, NUM_NEIGHBOURS
    return starts, rows, places


@njit(cache=True, nogil=True, fastmath={"contract", "nsz"})
def look_around(
    features: NDArray[np.float32],
    starts: NDArray[np.int32],
    rows: NDArray[np.int32],
    places: NDArray[np.int32],
    weight: NDArray[np.float32],
    seen: NDArray[np.float32],
    first: int,
    last: int,
) -> None:
    """Convolve depthwise.

    Args:
        features: (V, F) float32.
        starts: These three as in ``Pairs``.
        rows: Neighbours.
        places: Where they are.
        weight: (28, F) float32 of each place; the last is 0.
        seen: Filled: at least (last - first, F) float32.
        first: Row of the first voxel.
        last: Row after the last.
    """
    width = features.shape[1]
    for i in range(first, last):
        for c in range(width):
            seen[i - first, c] = 0
        for n in range(starts[i], starts[i + 1], _AT_ONCE):
            a, b, d, e = rows[n], rows[n + 1], rows[n + 2], rows[n + 3]
            p, q, r, s = places[n], places[n + 1], places[n + 2], places[n + 3]
            for c in range(width):
                seen[i - first, c] += (
                    weight[p, c] * features[a, c]
                    + weight[q, c] * features[b, c]
                    + weight[r, c] * features[d, c]
                    + weight[s, c] * features[e, c]
                )


@njit(cache=True, nogil=True)
def gather_children(
    features: NDArray[np.float32],
    children: NDArray[np.int64],
    parts: NDArray[np.float32],
    first: int,
    last: int,
) -> None:
    """Fill (P, 8·F) ``parts`` with the features of the children of voxels ``first`` to ``last``.

    A child that is not there has zeros.
    """
    count, width = features.shape
    for i in range(first, last):
        for k in range(children.shape[1]):
            row, start = children[i, k], k * width
            if row < count:
                for c in range(width):
                    parts[i - first, start + c] = features[row, c]
            else:
                for c in range(width):
                    parts[i - first, start + c] = 0


@njit(cache=True, nogil=True)
def gather_parents(
    answers: NDArray[np.float32],
    features: NDArray[np.float32],
    parent: NDArray[np.int64],
    corner: NDArray[np.int64],
    both: NDArray[np.float32],
    first: int,
    last: int,
) -> None:
    """Fill (V, 2·F) ``both``: what the voxel above answers, if above 0, beside what was known.

    ``answers`` is (P, 8·F), one answer for each corner; ``features`` (V, F).
    """
    width = features.shape[1]
    for i in range(first, last):
        row, start = parent[i], corner[i] * width
        for c in range(width):
            both[i - first, c] = max(answers[row, start + c], np.float32(0))
        for c in range(width):
            both[i - first, width + c] = features[i, c]


@njit(cache=True, nogil=True)
def scale_to_unit_length(vectors: NDArray[np.float32]) -> None:
    """Scale (V, E) vectors to length 1, those of no length left as they are."""
    for i in range(vectors.shape[0]):
        square = np.float32(0)
        for e in range(vectors.shape[1]):
            square += vectors[i, e] * vectors[i, e]
        factor = 1 / max(np.sqrt(square), np.float32(1e-6))
        for e in range(vectors.shape[1]):
            vectors[i, e] *= factor
