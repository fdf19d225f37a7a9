"""Who belongs to which object, and what lies between objects, kept current voxel by voxel.

The members of an object are a list linked both ways, so that a voxel leaves it at no cost. The
boundary of two objects is the sum of the evidence of all edges from one to the other. All numbers
are integers: whatever was added can be taken away again.
"""

from __future__ import annotations

import numpy as np
from numba import njit, types
from numba.typed import Dict
from numpy.typing import NDArray

from mcpseg_cli.incremental.column import IN_MEMORY, Column, Memory

_NONE = -1
_HALF = 13  # of the 26 neighbours; those from there on are forward ones


class Membership:
    """Objects of all voxels of a map, by id; object 0 is none.

    Args:
        num_classes: C.
        memory: Where the rows of voxels are.

    Attributes:
        num_objects: How many have a voxel.
    """

    def __init__(self, num_classes: int, memory: Memory = IN_MEMORY) -> None:
        self._instance = Column(np.int32, memory=memory)
        self._before = Column(np.int32, memory=memory)  # in the list of its object, as the next
        self._after = Column(np.int32, memory=memory)
        self._row = Column(np.int32, memory=memory)  # of a voxel in the window at hand
        self._first = Column(np.int32)  # by object id, as the next two
        self._size = Column(np.int64)
        self._evidence = Column(np.int64, num_classes)
        pair = types.UniTuple(types.int64, 2)  # type: ignore[no-untyped-call]
        self._boundary = Dict.empty(types.int64, pair)
        self.num_objects = 0
        self.add_objects(1)

    @property
    def instance(self) -> NDArray[np.int32]:
        """(V,) int32 object id of every voxel: a view, until the next ``add_voxels``."""
        return self._instance.rows

    @property
    def size(self) -> NDArray[np.int64]:
        """(O,) int64 voxels of every object: a view, until the next ``add_objects``."""
        return self._size.rows

    @property
    def evidence(self) -> NDArray[np.int64]:
        """(O, C) int64 class evidence of every object's voxels: a view, as ``size``."""
        return self._evidence.rows

    @property
    def num_ids(self) -> int:
        """How many ids were ever given out, 0 included."""
        return len(self._size.rows)

    def add_voxels(self, count: int) -> None:
        """Add so many voxels of no object."""
        self._instance.append_zeros(count)
        nobody = np.full(count, _NONE, np.int32)
        for column in (self._before, self._after, self._row):
            column.append(nobody)

    def add_objects(self, count: int) -> None:
        """Give out the next ids."""
        self._first.append(np.full(count, _NONE, np.int32))
        self._size.append_zeros(count)
        self._evidence.append_zeros(count)

    def join(
        self, ids: NDArray[np.int32], objects: NDArray[np.int32], evidence: NDArray[np.integer]
    ) -> None:
        """Put voxels of no object into objects.

        Args:
            ids: (M,) int32 voxels.
            objects: (M,) int32.
            evidence: (M, C) integers: their class evidence.
        """
        self.num_objects += _join(
            ids, objects, evidence, self.instance, self._before.rows, self._after.rows,
            self._first.rows, self.size, self.evidence,
        )  # fmt: skip

    def leave(self, ids: NDArray[np.int32], evidence: NDArray[np.integer]) -> None:
        """Take voxels out of their objects; see ``join``."""
        self.num_objects -= _leave(
            ids, evidence, self.instance, self._before.rows, self._after.rows,
            self._first.rows, self.size, self.evidence,
        )  # fmt: skip

    def members(self, owner: int) -> NDArray[np.int32]:
        """List the voxels of an object, ascending."""
        ids = np.empty(self.size[owner], np.int32)
        _list_members(self._first.rows[owner], self._after.rows, ids)
        return np.sort(ids)

    def count_edges(
        self,
        sign: int,
        ids: NDArray[np.int32],
        neighbours: NDArray[np.int32],
        edges: tuple[NDArray[np.int32], NDArray[np.int32]],
        *,
        only_forward: bool = False,
    ) -> None:
        """Add the edges of voxels to the boundaries of their objects, or take them away.

        Args:
            sign: 1 or -1.
            ids: (M,) int32 voxels, each once; edges between two of them count once.
            neighbours: (M, 26) int32.
            edges: (M, 26) int32 together and in all, as of ``Edges``.
            only_forward: Only those to forward neighbours.
        """
        first = _HALF if only_forward else 0
        _count_edges(
            sign, first, ids, neighbours, *edges, self.instance, self._row.rows, self._boundary
        )

    def list_edges(
        self,
        ids: NDArray[np.int32],
        neighbours: NDArray[np.int32],
        edges: tuple[NDArray[np.int32], NDArray[np.int32]],
        outside: NDArray[np.int32],
    ) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
        """List the edges of a graph of voxels, of no object now, and of objects around them.

        Args:
            ids: (M,) int32 voxels.
            neighbours: (M, 26) int32.
            edges: (M, 26) int32 together and in all, as of ``Edges``.
            outside: (N,) int32 objects, ascending.

        Returns:
            (E, 2) int32 nodes: the voxels' rows, then the objects'; (E,) int64 evidence that both
            are one, (E,) int64 evidence for or against.
        """
        listed: tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]
        listed = _list_edges(ids, neighbours, *edges, self.instance, self._row.rows, outside)
        return listed

    def boundaries(
        self, objects: NDArray[np.int32]
    ) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
        """Find the boundaries between some objects.

        Args:
            objects: (N,) int32 distinct ids.

        Returns:
            (E, 2) int32 rows of ``objects``, (E,) int64 evidence that both are one, (E,) int64
            evidence for or against.
        """
        found: tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]
        found = _find_boundaries(objects, self._boundary)
        return found


@njit(cache=True)
def _join(
    ids: NDArray[np.int32],
    objects: NDArray[np.int32],
    voxel_evidence: NDArray[np.integer],
    instance: NDArray[np.int32],
    before: NDArray[np.int32],
    after: NDArray[np.int32],
    first: NDArray[np.int32],
    size: NDArray[np.int64],
    evidence: NDArray[np.int64],
) -> int:
    """Return how many objects have their first voxel."""
    num_begun = 0
    for i in range(ids.size):
        voxel, owner = ids[i], objects[i]
        instance[voxel] = owner
        if owner == 0:
            continue

        # to the front of the list
        before[voxel], after[voxel] = _NONE, first[owner]
        if first[owner] != _NONE:
            before[first[owner]] = voxel
        first[owner] = voxel
        num_begun += size[owner] == 0
        size[owner] += 1
        for c in range(evidence.shape[1]):
            evidence[owner, c] += voxel_evidence[i, c]
    return num_begun


@njit(cache=True)
def _leave(
    ids: NDArray[np.int32],
    voxel_evidence: NDArray[np.integer],
    instance: NDArray[np.int32],
    before: NDArray[np.int32],
    after: NDArray[np.int32],
    first: NDArray[np.int32],
    size: NDArray[np.int64],
    evidence: NDArray[np.int64],
) -> int:
    """Return how many objects have no voxel any more."""
    num_ended = 0
    for i in range(ids.size):
        voxel = ids[i]
        owner = instance[voxel]
        instance[voxel] = 0
        if owner == 0:
            continue

        # out of the list
        if before[voxel] == _NONE:
            first[owner] = after[voxel]
        else:
            after[before[voxel]] = after[voxel]
        if after[voxel] != _NONE:
            before[after[voxel]] = before[voxel]
        size[owner] -= 1
        num_ended += size[owner] == 0
        for c in range(evidence.shape[1]):
            evidence[owner, c] -= voxel_evidence[i, c]
    return num_ended


@njit(cache=True)
def _list_members(voxel: int, after: NDArray[np.int32], ids: NDArray[np.int32]) -> None:
    for i in range(ids.size):
        ids[i] = voxel
        voxel = after[voxel]


@njit(cache=True)
def _pair(a: int, b: int) -> int:
    """Pack two objects, in any order."""
    return int((np.int64(min(a, b)) << 32) | np.int64(max(a, b)))


@njit(cache=True)
def _count_edges(
    sign: int,
    first: int,
    ids: NDArray[np.int32],
    neighbours: NDArray[np.int32],
    together: NDArray[np.int32],
    total: NDArray[np.int32],
    instance: NDArray[np.int32],
    row: NDArray[np.int32],
    boundary: Dict,
) -> None:
    for i in range(ids.size):
        row[ids[i]] = i
    for i in range(ids.size):
        owner = instance[ids[i]]
        if owner == 0:
            continue
        for k in range(first, neighbours.shape[1]):
            if total[i, k] == 0:
                continue
            other = neighbours[i, k]
            if instance[other] == owner or instance[other] == 0:
                continue
            if k < _HALF and row[other] != _NONE:
                continue  # its own row has it
            key = _pair(owner, instance[other])
            one, both = boundary.get(key, (np.int64(0), np.int64(0)))
            one += sign * np.int64(together[i, k])
            both += sign * np.int64(total[i, k])
            if both == 0:
                del boundary[key]
            else:
                boundary[key] = (one, both)
    for i in range(ids.size):
        row[ids[i]] = _NONE


@njit(cache=True)
def _list_edges(
    ids: NDArray[np.int32],
    neighbours: NDArray[np.int32],
    together: NDArray[np.int32],
    total: NDArray[np.int32],
    instance: NDArray[np.int32],
    row: NDArray[np.int32],
    outside: NDArray[np.int32],
) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
    for i in range(ids.size):
        row[ids[i]] = i
    ends = np.empty((neighbours.size, 2), np.int32)
    joint, both = np.empty(neighbours.size, np.int64), np.empty(neighbours.size, np.int64)
    count = 0
    for i in range(ids.size):
        for k in range(neighbours.shape[1]):
            if total[i, k] == 0:
                continue
            other = neighbours[i, k]
            if row[other] != _NONE:
                if k < _HALF:
                    continue  # its own row has it
                node = np.int64(row[other])
            elif instance[other] > 0:
                node = ids.size + np.searchsorted(outside, instance[other])
            else:
                continue
            ends[count, 0], ends[count, 1] = i, node
            joint[count], both[count] = together[i, k], total[i, k]
            count += 1
    for i in range(ids.size):
        row[ids[i]] = _NONE
    return ends[:count].copy(), joint[:count].copy(), both[:count].copy()


@njit(cache=True)
def _find_boundaries(
    objects: NDArray[np.int32], boundary: Dict
) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
    ends, together, total = [], [], []
    for i in range(objects.size):
        for j in range(i + 1, objects.size):
            key = _pair(objects[i], objects[j])
            if key in boundary:
                one, both = boundary[key]
                ends.append((np.int32(i), np.int32(j)))
                together.append(one)
                total.append(both)
    pairs = np.empty((len(ends), 2), np.int32)
    for e in range(len(ends)):
        pairs[e, 0], pairs[e, 1] = ends[e]
    return pairs, np.array(together, np.int64), np.array(total, np.int64)
