"""Objects from accumulated evidence: average linkage on the graph of neighbouring voxels.

After a scan the voxels in range are taken out of their objects and put together anew; of an object
that reaches farther, what lies outside is one node of the graph. So objects grow, unite and come
apart as evidence says, and the cost of a scan depends on what is in range, never on the map.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.config import EMBEDDING
from mcpseg_cli.incremental.column import IN_MEMORY, Column, Memory
from mcpseg_cli.incremental.edges import Edges
from mcpseg_cli.incremental.evidence import class_shares
from mcpseg_cli.incremental.growing_map import ROOM_HEIGHT, Observation
from mcpseg_cli.incremental.linkage import link
from mcpseg_cli.incremental.map_labels import FirstLooks
from mcpseg_cli.incremental.membership import Membership
from mcpseg_cli.incremental.regrouping import History, Regrouping
from mcpseg_cli.incremental.succession import Succession, find_successors
from mcpseg_cli.incremental.voxel_map import VoxelMap

_NONE = -1
INERTIA = 20  # percent of the evidence that says that what was one object is one, and two two
_PART = 1 << 16  # voxels restored at a time


class ObjectGraph:
    """The objects of a map.

    Args:
        labels: Class evidence of its voxels.
        edges: What tells how much neighbours belong together.
        num_classes: C.
        threshold: Mean affinity along a boundary above which two clusters are one object.
        least: Voxels of the smallest object whose class is in doubt.
        certain: Share of the class evidence above which a class is not in doubt.
        reach: Metres around the robot within which voxels are put together anew; None: all those
            that are judged, and no others.
        memory: Where the rows of voxels are.
    """

    def __init__(
        self,
        labels: FirstLooks,
        edges: Edges,
        num_classes: int,
        *,
        threshold: float,
        least: int,
        certain: float = 0.8,
        reach: float | None = None,
        memory: Memory = IN_MEMORY,
    ) -> None:
        self._labels, self._edges = labels, edges
        self._threshold, self._least, self._certain = threshold, least, certain
        self._reach = reach
        self._memory = memory
        self._members = Membership(num_classes, memory)
        self._embedding = Column(np.int16, EMBEDDING, memory=memory)
        self._apart = _Apart.nothing()

    @property
    def instance(self) -> NDArray[np.int32]:
        """(V,) int32 object id of every voxel as known now, 0 none: a view, until the next scan."""
        return self._members.instance

    @property
    def embedding(self) -> NDArray[np.int16]:
        """(V, E) int16 unit embeddings, as fractions of 32767: a view, until the next scan."""
        return self._embedding.rows

    @property
    def num_objects(self) -> int:
        """How many objects there are now."""
        return self._members.num_objects

    def class_shares(self, ids: NDArray[np.int32]) -> NDArray[np.float32]:
        """Give (M, C) float32 shares of the class evidence of the objects of (M,) int32 voxels.

        Rows sum to 1; to 0 for a voxel of no object.
        """
        owners, number = np.unique(self.instance[ids], return_inverse=True)
        shares: NDArray[np.float32] = class_shares(self._members.evidence[owners])[number]
        return shares

    def take_apart(
        self,
        voxels: VoxelMap,
        ids: NDArray[np.int32],
        observed: Observation,
        position: NDArray[np.float64],
    ) -> None:
        """Take the voxels in range out of their objects, before evidence about them changes.

        Args: See ``MapObjects``.
        """
        if self._reach is not None:
            around = voxels.near(position, self._reach, ROOM_HEIGHT)
            ids = np.union1d(around, np.concatenate([observed.seen_again, observed.new]))
        self._take_apart(voxels, ids)

    def _take_apart(self, voxels: VoxelMap, ids: NDArray[np.int32]) -> None:
        known = len(self.instance)
        neighbours = voxels.neighbours(ids)
        num_known = int(np.searchsorted(ids, known))
        before, near = ids[:num_known], neighbours[:num_known]
        edges = self._edges.of(before, near, self.embedding)

        instance = self.instance[before].copy()
        self._members.count_edges(-1, before, near, edges)
        self._members.leave(before, self._labels.class_evidence(before))
        self._apart = _Apart(ids, neighbours, instance)

    def put_all_together(self, voxels: VoxelMap, embedding: NDArray[np.int16]) -> None:
        """Find the objects of a complete map, of which nothing is known yet; see ``put_together``.

        Args:
            voxels: The map.
            embedding: (V, E) int16 of all voxels.
        """
        self._take_apart(voxels, np.arange(len(voxels), dtype=np.int32))
        self.put_together(voxels, embedding)

    def put_together(self, voxels: VoxelMap, embedding: NDArray[np.int16]) -> Regrouping:
        """Find the objects of the voxels taken apart and of the new ones.

        Args:
            voxels: The map.
            embedding: (N, E) int16 of the new voxels, the map's last.

        Returns:
            What changed of the objects known before.
        """
        members, apart = self._members, self._apart
        ids, neighbours = apart.ids, apart.neighbours
        members.add_voxels(len(embedding))
        self._embedding.append(embedding)

        # nodes: the voxels, and what lies outside of objects that touch them
        edges = self._edges.of(ids, neighbours, self.embedding)
        old = np.concatenate([apart.instance, np.zeros(len(ids) - len(apart.instance), np.int32)])
        outside, ends, together, total = self._graph(ids, neighbours, edges, old)
        size = np.concatenate([np.ones(len(ids), np.int64), members.size[outside]])

        # clusters, and which objects they are
        cluster = link(size, ends, together, total, self._threshold, self._least)
        evidence = self._labels.class_evidence(ids)
        node_evidence = np.concatenate([evidence, members.evidence[outside]])
        is_object = are_objects(cluster, size, node_evidence, self._least, self._certain)
        before = np.concatenate([old, outside])
        heirs = find_successors(before, size, cluster, is_object, members.num_ids)
        members.add_objects(heirs.num_new)

        # what lies outside goes along; then the voxels
        moved_outside = self._move_outside(voxels, outside, heirs.owner[len(ids) :])
        owner = heirs.owner[: len(ids)]
        members.join(ids, owner, evidence)
        members.count_edges(1, ids, neighbours, edges)
        known = len(apart.instance)
        inside = _Moved(ids[:known], apart.instance, owner[:known])
        return _report(heirs, inside.and_also(moved_outside))

    def _graph(
        self,
        ids: NDArray[np.int32],
        neighbours: NDArray[np.int32],
        edges: tuple[NDArray[np.int32], NDArray[np.int32]],
        old: NDArray[np.int32],
    ) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
        """Make the graph; return the objects that are nodes after the voxels, and the edges."""
        members = self._members
        straddling = np.unique(old)
        straddling = straddling[(members.size[straddling] > 0) & (straddling > 0)]
        around = _owners_around(neighbours, edges[1], self.instance)
        outside = np.union1d(straddling, around).astype(np.int32)

        ends, together, total = members.list_edges(ids, neighbours, edges, outside)
        pairs, joint, both = members.boundaries(outside)
        ends = np.concatenate([ends, pairs + np.int32(len(ids))])
        together, total = np.concatenate([together, joint]), np.concatenate([total, both])

        # what was one object is rather one again, and what was two rather two
        _hold(np.concatenate([old, outside]), ends, together, total)
        return outside, ends, together, total

    def restore(self, embedding: NDArray[np.int16], instance: NDArray[np.int32]) -> None:
        """Append voxels kept of an earlier run; ``finish_restore`` must follow the last of them.

        Args:
            embedding: (V, E) int16.
            instance: (V,) int32 object ids as they were at first.
        """
        start, members = len(self.instance), self._members
        self._embedding.append(embedding)
        members.add_voxels(len(instance))
        self.instance[start:] = instance

    def finish_restore(self, voxels: VoxelMap, history: History, *, goes_on: bool) -> None:
        """Find sizes, evidence and boundaries of the objects of the restored voxels.

        Args:
            voxels: The map.
            history: What became of the objects.
            goes_on: Whether more scans may follow; else there need be no evidence.
        """
        members = self._members
        owner, num_ids = history.apply(self.instance)
        members.add_objects(num_ids - members.num_ids)
        if not goes_on:
            self.instance[:] = owner
            members.num_objects = len(np.unique(owner[owner > 0]))
            return
        for start in range(0, len(owner), _PART):
            ids = np.arange(start, min(start + _PART, len(owner)), dtype=np.int32)
            members.join(ids, owner[ids], self._labels.class_evidence(ids))
            self._memory.leave_all()

        # every edge once: forward ones only
        for start in range(0, len(owner), _PART):
            ids = np.arange(start, min(start + _PART, len(owner)), dtype=np.int32)
            neighbours = voxels.neighbours(ids)
            edges = self._edges.of(ids, neighbours, self.embedding)
            members.count_edges(1, ids, neighbours, edges, only_forward=True)
            self._memory.leave_all()

    def _move_outside(
        self, voxels: VoxelMap, outside: NDArray[np.int32], owner: NDArray[np.int32]
    ) -> _Moved:
        """Hand over what lies outside of objects that went over into others."""
        members = self._members
        moving = np.flatnonzero(owner != outside)
        if len(moving) == 0:
            return _Moved.nothing()
        lists = [members.members(int(outside[node])) for node in moving]
        ids = np.concatenate(lists)
        to = np.repeat(owner[moving], [len(each) for each in lists])
        order = np.argsort(ids)
        ids, to = ids[order], to[order]

        old = self.instance[ids].copy()
        neighbours = voxels.neighbours(ids)
        edges = self._edges.of(ids, neighbours, self.embedding)
        evidence = self._labels.class_evidence(ids)
        members.count_edges(-1, ids, neighbours, edges)
        members.leave(ids, evidence)
        members.join(ids, to, evidence)
        members.count_edges(1, ids, neighbours, edges)
        return _Moved(ids, old, to)


@dataclass(frozen=True)
class _Apart:
    """The voxels taken apart.

    Attributes:
        ids: (M,) int32, ascending; new ones are the last.
        neighbours: (M, 26) int32 voxel ids, -1 for none.
        instance: (K,) int32 objects that those known before were of.
    """

    ids: NDArray[np.int32]
    neighbours: NDArray[np.int32]
    instance: NDArray[np.int32]

    @classmethod
    def nothing(cls) -> _Apart:
        nobody = np.empty(0, np.int32)
        return cls(nobody, np.empty((0, 26), np.int32), nobody)


@dataclass(frozen=True)
class _Moved:
    """Voxels (M,) int32, ascending, the objects they were of, and those they are of now."""

    ids: NDArray[np.int32]
    old: NDArray[np.int32]
    new: NDArray[np.int32]

    def and_also(self, other: _Moved) -> _Moved:
        """Return both."""
        return _Moved(
            np.concatenate([self.ids, other.ids]),
            np.concatenate([self.old, other.old]),
            np.concatenate([self.new, other.new]),
        )

    @classmethod
    def nothing(cls) -> _Moved:
        nobody = np.empty(0, np.int32)
        return cls(nobody, nobody, nobody)


def _report(heirs: Succession, moved: _Moved) -> Regrouping:
    """Tell which voxels changed object, and which of them otherwise than by merges."""
    is_changed = moved.old != moved.new
    ids, old, new = moved.ids[is_changed], moved.old[is_changed], moved.new[is_changed]
    order = np.argsort(ids)
    ids, old, new = ids[order], old[order], new[order]

    gone, survivor = heirs.merges.T
    place = np.minimum(np.searchsorted(gone, old), max(len(gone) - 1, 0))
    is_merged = np.zeros(len(ids), bool)
    if len(gone):
        is_merged = (gone[place] == old) & (survivor[place] == new)
    return Regrouping(heirs.merges, heirs.splits, ids[~is_merged], ids)


@njit(cache=True)
def _owners_around(
    neighbours: NDArray[np.int32], total: NDArray[np.int32], instance: NDArray[np.int32]
) -> NDArray[np.int32]:
    """List the objects of neighbours about which something is known."""
    found = np.empty(neighbours.size, np.int32)
    count = 0
    last = 0
    for i in range(neighbours.shape[0]):
        for k in range(neighbours.shape[1]):
            if total[i, k] > 0:
                owner = instance[neighbours[i, k]]
                if owner > 0 and owner != last:
                    found[count] = last = owner
                    count += 1
    return found[:count]


@njit(cache=True)
def _hold(
    old: NDArray[np.int32],
    ends: NDArray[np.int32],
    together: NDArray[np.int64],
    total: NDArray[np.int64],
) -> None:
    """Add evidence for what was: edges within an object or between two weigh more; in place."""
    for e in range(ends.shape[0]):
        one, other = old[ends[e, 0]], old[ends[e, 1]]
        weight = INERTIA if one > 0 and other > 0 else 0
        together[e] = 100 * together[e] + (weight * total[e] if one == other else 0)
        total[e] *= 100 + weight


@njit(cache=True)
def are_objects(
    cluster: NDArray[np.int32],
    size: NDArray[np.int64],
    evidence: NDArray[np.int64],
    least: int,
    certain: float,
) -> NDArray[np.bool_]:
    """Tell of each node whether its cluster is an object: large, or certain of its class."""
    voxels = np.zeros(size.size, np.int64)
    sums = np.zeros(evidence.shape, np.int64)
    for node in range(size.size):
        root = cluster[node]
        voxels[root] += size[node]
        for c in range(evidence.shape[1]):
            sums[root, c] += evidence[node, c]

    is_object = np.empty(size.size, np.bool_)
    for node in range(size.size):
        root = cluster[node]
        is_object[node] = voxels[root] >= least
        if not is_object[node] and evidence.shape[1] > 0:
            is_object[node] = sums[root].max() > certain * max(sums[root].sum(), 1)
    return is_object
