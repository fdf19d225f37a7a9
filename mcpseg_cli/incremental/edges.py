"""Edges of the graph of neighbouring voxels: what says that two of them are of one object."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.incremental.evidence import Evidence

_NONE = -1
_HALF = 13  # of the 26 neighbours; those from there on are forward ones
_FULL = 32767.0 * 32767.0  # the product of two equal embeddings as they are stored
_UNIT = 255  # evidence of an edge that embeddings tell of
_STEEPNESS = 25.0  # how fast the affinity rises with the cosine: 0.5 to 0.9 within 0.09


class Edges(Protocol):
    """What tells how much two neighbours belong together."""

    def of(
        self, ids: NDArray[np.int32], neighbours: NDArray[np.int32], embedding: NDArray[np.int16]
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Give the evidence about each voxel and each of its neighbours.

        Args:
            ids: (M,) int32 voxels.
            neighbours: (M, 26) int32 voxel ids, -1 for none.
            embedding: (V, E) int16 of those known; neighbours may be newer, and have no evidence.

        Returns:
            (M, 26) int32 evidence that both are of one object, and (M, 26) int32 evidence for or
            against; 0 where nothing is known.
        """


class EvidenceEdges:
    """Edges of a network that tells affinities: the evidence of all looks.

    Args:
        evidence: Read whenever asked.
    """

    def __init__(self, evidence: Evidence) -> None:
        self._evidence = evidence

    def of(
        self, ids: NDArray[np.int32], neighbours: NDArray[np.int32], embedding: NDArray[np.int16]
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Give what all looks say; see ``Edges``."""
        known: tuple[NDArray[np.int32], NDArray[np.int32]]
        known = _known_edges(ids, neighbours, self._evidence.together, self._evidence.apart)
        return known


class EmbeddingEdges:
    """Edges of a network that embeds voxels one by one: the more alike, the more of one object.

    Args:
        similarity: beta, the cosine that tells nothing either way.
    """

    def __init__(self, similarity: float) -> None:
        self._similarity = similarity

    def of(
        self, ids: NDArray[np.int32], neighbours: NDArray[np.int32], embedding: NDArray[np.int16]
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Give what their embeddings say; see ``Edges``."""
        alike: tuple[NDArray[np.int32], NDArray[np.int32]]
        alike = _alike_edges(ids, neighbours, embedding, self._similarity)
        return alike


@njit(cache=True, nogil=True)
def _known_edges(
    ids: NDArray[np.int32],
    neighbours: NDArray[np.int32],
    together: NDArray[np.uint16],
    apart: NDArray[np.uint16],
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Look evidence up: a pair's is kept with the voxel of which the other is a forward one."""
    joint = np.zeros(neighbours.shape, np.int32)
    total = np.zeros(neighbours.shape, np.int32)
    count = together.shape[0]
    for i in range(ids.size):
        voxel = ids[i]
        if voxel >= count:
            continue
        for k in range(neighbours.shape[1]):
            other = neighbours[i, k]
            if other == _NONE or other >= count:
                continue
            if k >= _HALF:
                row, column = voxel, k - _HALF
            else:
                row, column = other, _HALF - 1 - k
            joint[i, k] = together[row, column]
            total[i, k] = np.int32(together[row, column]) + np.int32(apart[row, column])
    return joint, total


@njit(cache=True, nogil=True)
def _alike_edges(
    ids: NDArray[np.int32],
    neighbours: NDArray[np.int32],
    embedding: NDArray[np.int16],
    similarity: float,
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Compare embeddings."""
    joint = np.zeros(neighbours.shape, np.int32)
    total = np.zeros(neighbours.shape, np.int32)
    count = embedding.shape[0]
    for i in range(ids.size):
        voxel = ids[i]
        if voxel >= count:
            continue
        for k in range(neighbours.shape[1]):
            other = neighbours[i, k]
            if other == _NONE or other >= count:
                continue
            product = np.int64(0)
            for e in range(embedding.shape[1]):
                product += np.int64(embedding[voxel, e]) * np.int64(embedding[other, e])
            logit = _STEEPNESS * (product / _FULL - similarity)
            joint[i, k] = np.int32(_UNIT / (1 + np.exp(-logit)) + 0.5)
            total[i, k] = _UNIT
    return joint, total
