"""The objects of a building, whose graph of voxels is linked column by column, then as a whole."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.incremental.evidence import class_shares
from mcpseg_cli.incremental.linkage import link, link_inside
from mcpseg_cli.incremental.object_graph import are_objects
from mcpseg_cli.incremental.succession import find_successors
from mcpseg_cli.incremental.uniting import (
    PartVoxels,
    UnitedVoxels,
    column_of,
    keys_of,
    list_edges,
    voxels_of,
)
from mcpseg_cli.merge.spool import Column

Clusters = Callable[[Column], tuple[NDArray[np.int64], NDArray[np.int32]]]
"""Gives keys and clusters of the voxels of a column."""

_Edges = tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]


@dataclass(frozen=True)
class Objects:
    """What the clusters of the columns are of.

    Attributes:
        owner: (N,) int32 object of each cluster, 0 none.
        shares: (O, C) float32 shares of the classes in each object; those of 0 are 0.
    """

    owner: NDArray[np.int32]
    shares: NDArray[np.float32]

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.shares) - 1


class BuildingGraph:
    """Clusters of columns, and what lies between them.

    Args:
        num_classes: C.
        threshold: Mean affinity along a boundary above which two clusters are one object.
        least: Voxels of the smallest object whose class is in doubt.
        certain: Share of the class evidence above which a class is not in doubt.
    """

    def __init__(
        self, num_classes: int, *, threshold: float, least: int, certain: float = 0.8
    ) -> None:
        self._num_classes = num_classes
        self._threshold, self._least, self._certain = threshold, least, certain
        self._first: dict[Column, int] = {}
        self._count = 0
        self._sizes: list[NDArray[np.int64]] = []
        self._evidence: list[NDArray[np.int64]] = []
        self._edges: list[_Edges] = []
        self._crossing: dict[tuple[Column, Column], list[_Crossing]] = defaultdict(list)

    def first(self, column: Column) -> int:
        """Return how many clusters the columns before one have."""
        return self._first[column]

    def add(self, column: Column, rows: PartVoxels, united: UnitedVoxels) -> NDArray[np.int32]:
        """Cluster the voxels of the next column as far as others cannot change it.

        Args:
            column: Which.
            rows: What was united.
            united: From ``unite``.

        Returns:
            (V,) int32 number of the cluster of each, in order of their first voxels.
        """
        ends, together, total = list_edges(rows, united, column)
        inside = united.num_inside
        within, pairs, joint, both = link_inside(
            ends, together, total, self._threshold, len(united.key), inside
        )
        roots, numbers = np.unique(within, return_inverse=True)
        cluster: NDArray[np.int32] = numbers.astype(np.int32)

        # clusters of this column, and their boundaries
        self._first[column] = self._count
        self._sizes.append(np.bincount(cluster).astype(np.int64))
        sums = np.zeros((len(roots), self._num_classes), np.int64)
        np.add.at(sums, cluster, united.evidence[:inside, : self._num_classes].astype(np.int64))
        self._evidence.append(sums)
        numbered = np.searchsorted(roots, pairs) + self._count
        self._edges.append((numbered.astype(np.int32), joint, both))
        self._count += len(roots)

        # edges to other columns, kept by the column that has the evidence
        crosses = np.flatnonzero((ends[:, 0] < inside) & (ends[:, 1] >= inside))
        self._keep(column, united, cluster[ends[crosses, 0]], ends[crosses, 1],
                   together[crosses], total[crosses])  # fmt: skip
        return cluster

    def _keep(
        self,
        column: Column,
        united: UnitedVoxels,
        cluster: NDArray[np.int32],
        other: NDArray[np.int32],
        together: NDArray[np.int64],
        total: NDArray[np.int64],
    ) -> None:
        """Keep edges that cross a border until the column on the other side is there."""
        voxel = voxels_of(united.key[other], column)
        columns = column_of(voxel.astype(np.int32))
        for x, y in np.unique(columns, axis=0).tolist():
            rows = np.flatnonzero((columns == (x, y)).all(axis=1))
            keys = keys_of(voxel[rows], (x, y))
            edge = _Crossing(
                cluster[rows] + np.int32(self._first[column]), keys, together[rows], total[rows]
            )
            self._crossing[column, (x, y)].append(edge)

    def objects(self, clusters: Clusters) -> Objects:
        """Link the clusters of all columns.

        Args:
            clusters: Gives those of a column again.
        """
        edges = [*self._edges, *self._crossed(clusters)]
        size, evidence = np.concatenate(self._sizes), np.concatenate(self._evidence)
        ends, together, total = (np.concatenate(each) for each in zip(*edges, strict=True))
        self._edges, self._crossing = [], defaultdict(list)
        cluster = link(size, ends, together, total, self._threshold, self._least)

        # nobody was an object before
        is_object = are_objects(cluster, size, evidence, self._least, self._certain)
        owner = find_successors(np.zeros_like(cluster), size, cluster, is_object, 1).owner
        sums = np.zeros((int(owner.max(initial=0)) + 1, self._num_classes), np.int64)
        np.add.at(sums, owner, evidence)
        sums[0] = 0
        return Objects(owner, class_shares(sums))

    def _crossed(self, clusters: Clusters) -> list[_Edges]:
        """Find the clusters on the other side of borders."""
        found = []
        by_target: dict[Column, list[_Crossing]] = defaultdict(list)
        for (_, target), edges in sorted(self._crossing.items()):
            by_target[target] += edges
        for target, edges in sorted(by_target.items()):
            key, cluster = clusters(target)
            for edge in edges:
                other = cluster[np.searchsorted(key, edge.key)] + np.int32(self._first[target])
                ends = np.stack([edge.cluster, other], axis=1).astype(np.int32)
                found.append((ends, edge.together, edge.total))
        return found


@dataclass(frozen=True)
class _Crossing:
    """Edges from clusters, (E,) int32, to voxels of another column by their keys, (E,) int64."""

    cluster: NDArray[np.int32]
    key: NDArray[np.int64]
    together: NDArray[np.int64]
    total: NDArray[np.int64]
