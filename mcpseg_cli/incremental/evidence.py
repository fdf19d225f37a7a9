"""Evidence: what all looks at a voxel say together about its class and about who it belongs with.

Looks differ in worth: one with much around the voxel says more than one from the rim of what is
seen. Each is counted by its weight, in whole numbers of 16 bits, so that a resumed run has the same
evidence bit for bit and two maps of one frame are united by adding theirs. What grows too large is
halved: old looks, which saw less, fade.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.incremental.column import IN_MEMORY, Column, Memory
from mcpseg_cli.networks.stencil import NUM_FORWARD

UNIT = 255
"""Evidence of one look of full weight."""

FULL = 65535 - UNIT  # sums above this are halved before the next look
BLOCK = 64
"""Voxels, by id, whose evidence is written together."""

HUNDREDTHS = 100
"""Confidence is given in these: it settles, and labels are written less often."""


@dataclass(frozen=True)
class Look:
    """What one look says about M voxels.

    Attributes:
        ids: (M,) int32 voxels, each once.
        probability: (M, C) float32 of each class; rows sum to 1.
        weight: (M,) float32 in 0-1: how much the look is worth.
        affinity: (M, 13) float32 in 0-1: that the voxel and its forward neighbour are of one
            object; NaN where there is no such neighbour. None for networks that do not say.
    """

    ids: NDArray[np.int32]
    probability: NDArray[np.float32]
    weight: NDArray[np.float32]
    affinity: NDArray[np.float32] | None = None

    def of(self, rows: NDArray[np.bool_]) -> Look:
        """Give what it says about some of the voxels."""
        affinity = None if self.affinity is None else self.affinity[rows]
        return Look(self.ids[rows], self.probability[rows], self.weight[rows], affinity)


@njit(cache=True, nogil=True)
def compute_affinities(
    embedding: NDArray[np.float32], neighbours: NDArray[np.int32], even: float, steepness: float
) -> NDArray[np.float32]:
    """Compute how likely voxels and their forward neighbours are of one object.

    Args:
        embedding: (M, E) float32 of unit length.
        neighbours: (M, 27) int32 from ``networks.sparse.find_neighbours``.
        even: The affinity of equal embeddings, as a logit.
        steepness: How fast it falls with their squared distance.

    Returns:
        (M, 13) float32 in 0-1; NaN where there is no neighbour.
    """
    count, width = embedding.shape
    affinity = np.full((count, NUM_FORWARD), np.nan, np.float32)
    for i in range(count):
        for k in range(NUM_FORWARD):
            j = neighbours[i, NUM_FORWARD + 1 + k]
            if j >= 0:
                cosine = np.float32(0)
                for e in range(width):
                    cosine += embedding[i, e] * embedding[j, e]
                logit = even - steepness * (2 - 2 * cosine)
                affinity[i, k] = 1 / (1 + np.exp(-logit))
    return affinity


class Evidence:
    """Sums over looks, one row a voxel.

    Args:
        num_classes: C.
        memory: Where its rows are.
    """

    def __init__(self, num_classes: int, memory: Memory = IN_MEMORY) -> None:
        self._of_class = Column(np.uint16, num_classes, memory=memory)
        self._together = Column(np.uint16, NUM_FORWARD, memory=memory)
        self._apart = Column(np.uint16, NUM_FORWARD, memory=memory)
        self._looks = Column(np.uint16, memory=memory)

    def __len__(self) -> int:
        return len(self.looks)

    @property
    def of_class(self) -> NDArray[np.uint16]:
        """(V, C) uint16 evidence of each class: a view, until the next ``extend``."""
        return self._of_class.rows

    @property
    def together(self) -> NDArray[np.uint16]:
        """(V, 13) uint16 evidence that a voxel and its forward neighbour are of one object."""
        return self._together.rows

    @property
    def apart(self) -> NDArray[np.uint16]:
        """(V, 13) uint16 evidence that they are of two."""
        return self._apart.rows

    @property
    def looks(self) -> NDArray[np.uint16]:
        """(V,) uint16 how many scans saw each voxel: a view, until the next ``extend``."""
        return self._looks.rows

    def extend(self, count: int) -> None:
        """Add so many voxels that nothing is known of."""
        for column in (self._of_class, self._together, self._apart, self._looks):
            column.append_zeros(count)

    def count_looks(self, ids: NDArray[np.int32]) -> None:
        """Note that a scan saw these (M,) int32 voxels, each once."""
        seen = self.looks[ids]
        self.looks[ids] = np.where(seen < np.iinfo(np.uint16).max, seen + 1, seen)

    def add(self, look: Look) -> None:
        """Add what a look says."""
        _add_classes(look.ids, look.probability, look.weight, self.of_class)
        if look.affinity is not None:
            _add_affinities(look.ids, look.affinity, look.weight, self.together, self.apart)

    def labels(
        self, ids: NDArray[np.int32], prior: NDArray[np.float32] | None = None
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Decide about voxels.

        Args:
            ids: (M,) int32; something must be known of each.
            prior: (M, C) float32 shares of the classes in what each is a part of, rows of sum 1 or
                0; they count as much as the voxel's own. None: they do not count.

        Returns:
            (M,) uint8 class with the most evidence, the lowest of equals, and (M,) float32 its
            share of all evidence, in hundredths.
        """
        shares = self.of_class[ids].astype(np.float32)
        shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1)
        if prior is not None:
            shares += prior
            shares /= 1 + prior.sum(axis=1, keepdims=True)
        semantic = shares.argmax(axis=1).astype(np.uint8)
        confidence = np.round(shares.max(axis=1, initial=0) * HUNDREDTHS) / np.float32(HUNDREDTHS)
        return semantic, confidence.astype(np.float32)

    def rows(self, start: int, stop: int) -> NDArray[np.uint16]:
        """Copy (M, C + 27) uint16 all that is known of voxels ``start`` to ``stop``."""
        part = slice(start, stop)
        columns = (self.of_class, self.together, self.apart, self.looks[:, None])
        return np.concatenate([column[part] for column in columns], axis=1)

    def blocks(self, ids: NDArray[np.int32]) -> dict[int, NDArray[np.uint16]]:
        """Copy all that is known of the blocks in which some voxels lie.

        Args:
            ids: (M,) int32, in any order.

        Returns:
            Rows as of ``rows``, 64 or, of the last block, what there is, by number of the block.
        """
        numbers = np.unique(ids // BLOCK).tolist()
        ends = [min((number + 1) * BLOCK, len(self)) for number in numbers]
        return {
            number: self.rows(number * BLOCK, end)
            for number, end in zip(numbers, ends, strict=True)
        }

    def restore(self, rows: NDArray[np.uint16]) -> None:
        """Append voxels as ``rows`` gave them.

        Args:
            rows: (M, C + 27) uint16.

        Raises:
            ValueError: Rows of another number of classes.
        """
        num_classes = self.of_class.shape[1]
        if rows.shape[1] != num_classes + 2 * NUM_FORWARD + 1:
            raise ValueError("evidence about other classes")
        ends = np.cumsum([num_classes, NUM_FORWARD, NUM_FORWARD])
        of_class, together, apart, looks = np.split(rows, ends, axis=1)
        self._of_class.append(of_class)
        self._together.append(together)
        self._apart.append(apart)
        self._looks.append(looks[:, 0])


def class_shares(evidence: NDArray[np.integer]) -> NDArray[np.float32]:
    """Give (O, C) float32 shares of (O, C) class evidence; rows sum to 1, to 0 where is none."""
    shares: NDArray[np.float32] = evidence.astype(np.float32)
    shares /= np.maximum(shares.sum(axis=1, keepdims=True), 1)
    return shares


@njit(cache=True)
def _add_classes(
    ids: NDArray[np.int32],
    probability: NDArray[np.float32],
    weight: NDArray[np.float32],
    evidence: NDArray[np.uint16],
) -> None:
    """Add weighted probabilities; a row in which one would not fit is halved first."""
    for row in range(ids.size):
        known = evidence[ids[row]]
        if known.max() > FULL:
            known[:] = known >> 1
        for c in range(known.size):
            known[c] += np.uint16(weight[row] * probability[row, c] * UNIT + np.float32(0.5))


@njit(cache=True)
def _add_affinities(
    ids: NDArray[np.int32],
    affinity: NDArray[np.float32],
    weight: NDArray[np.float32],
    together: NDArray[np.uint16],
    apart: NDArray[np.uint16],
) -> None:
    """Add weighted affinities and what they lack to one, pair by pair."""
    for row in range(ids.size):
        i = ids[row]
        for k in range(affinity.shape[1]):
            if not np.isnan(affinity[row, k]):
                if max(together[i, k], apart[i, k]) > FULL:
                    together[i, k] >>= 1
                    apart[i, k] >>= 1
                share = weight[row] * affinity[row, k] * UNIT + np.float32(0.5)
                together[i, k] += np.uint16(share)
                apart[i, k] += np.uint16(weight[row] * UNIT + 1 - share)
