"""Incremental clustering (III-C): similar neighbours join; clusters seed, grow and merge.

The lowest object id survives a merge.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.config import EMBEDDING
from mcpseg_cli.incremental.column import IN_MEMORY, Column, Memory

_SCALE = 32767  # unit embeddings are kept as 16-bit fractions of this
_NONE = -1
ANY = -np.inf
"""The similarity above which all neighbours are connected."""


class Clusters:
    """Object ids of all voxels of a map, and the embeddings new voxels are compared with.

    Args:
        similarity: beta, the cosine similarity above which neighbours are connected.
        memory: Where the rows of voxels are.
    """

    def __init__(self, similarity: float, memory: Memory = IN_MEMORY) -> None:
        self._threshold = similarity * _SCALE**2
        self._embedding = Column(np.int16, EMBEDDING, memory=memory)
        self._instance = Column(np.int32, memory=memory)
        # the voxels of an object form a linked list
        self._next_member = Column(np.int32, memory=memory)
        self._first_member = Column(np.int32)  # by object id, as the next two
        self._last_member = Column(np.int32)
        self._survivor = Column(np.int32)
        self.num_objects = -1
        """How many objects there are now."""
        self._add_objects(1)  # object 0: none

    @property
    def instance(self) -> NDArray[np.int32]:
        """(V,) int32 object id of every voxel as known now: a view, until the next ``add``."""
        return self._instance.rows

    @property
    def embedding(self) -> NDArray[np.int16]:
        """(V, E) int16 unit embeddings, as fractions of 32767: a view, until the next ``add``."""
        return self._embedding.rows

    def add(
        self, embedding: NDArray[np.int16], neighbours: NDArray[np.int32]
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Cluster the next M voxels with their neighbours (III-C).

        Args:
            embedding: (M, E) int16 from ``quantise``.
            neighbours: (M, 26) int32 voxel ids, -1 for none; the new voxels have the M ids after
                those known.

        Returns:
            (P, 2) int32 merges of objects known before: old id, surviving id, in order of old id.
            (Q,) int32 ids of earlier voxels whose object id changed, ascending.
        """
        start, num_known = len(self.instance), len(self._survivor.rows)

        # connect similar neighbours
        self._embedding.append(embedding)
        self._survivor.append(np.arange(num_known, num_known + len(embedding), dtype=np.int32))
        joined, removed = _connect(
            neighbours, self.embedding, self._threshold, self.instance, self._survivor.rows
        )

        # number new objects
        instance, num_objects = _number_new(joined, num_known, self._survivor.rows)
        self._survivor.truncate(num_known)
        self._add_objects(num_objects)
        self._instance.append(instance)
        self._next_member.append(np.full(len(instance), _NONE, np.int32))

        # merge connected clusters
        lists = (self._next_member.rows, self._first_member.rows, self._last_member.rows)
        removed = np.sort(removed[removed < num_known])
        self.num_objects -= len(removed)
        merges = np.stack([removed, resolve(removed, self._survivor.rows)], axis=1)
        changed = _merge_members(merges, self.instance, *lists)
        _append_members(start, self.instance, *lists)
        return merges, np.sort(changed)

    def restore(self, embedding: NDArray[np.int16], instance: NDArray[np.int32]) -> None:
        """Append voxels kept of an earlier run; ``restore_merges`` must follow the last of them.

        Args:
            embedding: (V, E) int16.
            instance: (V,) int32 object ids as each voxel got them at first.
        """
        self._embedding.append(embedding)
        self._instance.append(instance)
        self._next_member.append(np.full(len(instance), _NONE, np.int32))
        self._add_objects(max(0, int(instance.max(initial=0)) + 1 - len(self._survivor.rows)))

    def restore_merges(self, merges: NDArray[np.int32]) -> None:
        """Apply the merges of an earlier run to the restored voxels.

        Args:
            merges: (P, 2) int32 old id, surviving id: all of them, in order.
        """
        self._survivor.rows[merges[:, 0]] = merges[:, 1]
        self.num_objects -= len(merges)
        self.instance[:] = resolve(self.instance, self._survivor.rows)
        lists = (self._next_member.rows, self._first_member.rows, self._last_member.rows)
        _append_members(0, self.instance, *lists)

    def _add_objects(self, count: int) -> None:
        """Give out the next ``count`` object ids."""
        self.num_objects += count
        known = len(self._survivor.rows)
        self._survivor.append(np.arange(known, known + count, dtype=np.int32))
        for members in (self._first_member, self._last_member):
            members.append(np.full(count, _NONE, np.int32))


def quantise(embedding: NDArray[np.float32]) -> NDArray[np.int16]:
    """Store unit vectors as 16-bit fractions: 1.5e-5 apart, and what is compared is what is saved.

    Args:
        embedding: (M, E) float32, unit length.

    Returns:
        (M, E) int16.
    """
    steps: NDArray[np.float32] = np.rint(embedding * np.float32(_SCALE))
    return steps.astype(np.int16)


def dequantise(embedding: NDArray[np.int16]) -> NDArray[np.float32]:
    """Return what ``quantise`` stored: (M, E) float32, of unit length but for rounding."""
    unit: NDArray[np.float32] = embedding.astype(np.float32) / np.float32(_SCALE)
    return unit


def embed_classes(semantic: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Stand in for an embedding where a network has none: neighbours of one class connect (IV-B).

    Args:
        semantic: (M,) uint8 class index.

    Returns:
        (M, E) float32 unit vectors: the bits of the class as signs, again and again. The cosine
        similarity is 1 within a class, and 0.75 or less between two.
    """
    signs = (
        2 * np.unpackbits(semantic.astype(np.uint8)[:, None], axis=1).astype(np.float32) - 1
    )  # (M, 8)
    repeats = EMBEDDING // signs.shape[1]
    embedding = np.zeros((len(semantic), EMBEDDING), np.float32)
    embedding[:, : 8 * repeats] = np.tile(signs, repeats) / np.sqrt(np.float32(8 * repeats))
    return embedding


@njit(cache=True)
def resolve(instance: NDArray[np.int32], survivor: NDArray[np.int32]) -> NDArray[np.int32]:
    """Bring object ids up to date with the merges since.

    Args:
        instance: (V,) int32 object ids.
        survivor: (O,) int32: the object that took over each object, itself if it lives; shortened
            along the way.

    Returns:
        (V,) int32, a new array.
    """
    current = np.empty_like(instance)
    for i in range(instance.size):
        current[i] = _root(survivor, instance[i])
    return current


@njit(cache=True)
def _root(parent: NDArray[np.int32], node: int) -> int:
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node


@njit(cache=True)
def _is_similar(a: NDArray[np.int16], b: NDArray[np.int16], threshold: float) -> bool:
    product = np.int64(0)
    for e in range(a.size):
        product += np.int64(a[e]) * np.int64(b[e])
    return bool(product > threshold)


@njit(cache=True)
def _connect(
    neighbours: NDArray[np.int32],
    embedding: NDArray[np.int16],
    threshold: float,
    instance: NDArray[np.int32],
    parent: NDArray[np.int32],
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Join each new voxel with its similar neighbours.

    The last ids of ``parent``, one a voxel, are provisional.
    """
    joined = np.empty(neighbours.shape[0], np.int32)
    removed = np.empty(neighbours.size, np.int32)
    start, num_removed, next_id = instance.size, 0, parent.size - neighbours.shape[0]
    for i in range(neighbours.shape[0]):
        node = _NONE
        for other in neighbours[i]:
            is_known = other != _NONE and other < start + i
            if not is_known or not _is_similar(embedding[start + i], embedding[other], threshold):
                continue
            found = _root(parent, instance[other] if other < start else joined[other - start])

            # connections to several clusters: merge; to one: join
            if node != _NONE and node != found:
                removed[num_removed] = max(node, found)
                parent[max(node, found)] = min(node, found)
                num_removed += 1
            node = found if node == _NONE else min(node, found)

        # no connections: seed
        if node == _NONE:
            node = next_id
            next_id += 1
        joined[i] = node
    return joined, removed[:num_removed]


@njit(cache=True)
def _number_new(
    joined: NDArray[np.int32], num_known: int, parent: NDArray[np.int32]
) -> tuple[NDArray[np.int32], int]:
    """Replace provisional ids by survivors; new objects get the next ids, by their first voxels."""
    number = np.zeros(joined.size, np.int32)  # of each provisional id, once given
    num_objects = 0
    instance = np.empty(joined.size, np.int32)
    for i in range(joined.size):
        root = _root(parent, joined[i])

        # a new object gets its number with its first voxel
        if root >= num_known:
            if number[root - num_known] == 0:
                number[root - num_known] = num_known + num_objects
                num_objects += 1
            root = number[root - num_known]
        instance[i] = root
    return instance, num_objects


@njit(cache=True)
def _merge_members(
    merges: NDArray[np.int32],
    instance: NDArray[np.int32],
    next_member: NDArray[np.int32],
    first_member: NDArray[np.int32],
    last_member: NDArray[np.int32],
) -> NDArray[np.int32]:
    """Relabel the voxels of merged objects and hand them over; return which they are."""
    changed = []
    for row in range(merges.shape[0]):
        old, new = merges[row, 0], merges[row, 1]

        # relabel every member
        voxel = first_member[old]
        while voxel != _NONE:
            instance[voxel] = new
            changed.append(voxel)
            voxel = next_member[voxel]

        # join the two lists
        next_member[last_member[new]] = first_member[old]
        last_member[new] = last_member[old]
        first_member[old] = last_member[old] = _NONE
    return np.array(changed, np.int32) if len(changed) > 0 else np.empty(0, np.int32)


@njit(cache=True)
def _append_members(
    start: int,
    instance: NDArray[np.int32],
    next_member: NDArray[np.int32],
    first_member: NDArray[np.int32],
    last_member: NDArray[np.int32],
) -> None:
    """Add the voxels from ``start`` on to their objects' lists."""
    for voxel in range(start, instance.size):
        owner = instance[voxel]
        if last_member[owner] == _NONE:
            first_member[owner] = voxel
        else:
            next_member[last_member[owner]] = voxel
        last_member[owner] = voxel
