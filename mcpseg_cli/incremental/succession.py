"""Which id a cluster gets: that of the object it has most voxels of, so that ids are stable."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

_NONE = -1


@dataclass(frozen=True)
class Succession:
    """What became of objects whose voxels were clustered anew.

    Attributes:
        owner: (N,) int32 the object that each node is of now, 0 none.
        merges: (P, 2) int32 objects that are no more: id, the object most of it went over into, in
            order of the first.
        splits: (S, 2) int32 new objects made of voxels of others: the one with most of them, the
            new id, in order of the second.
        num_new: How many ids were given out.
    """

    owner: NDArray[np.int32]
    merges: NDArray[np.int32]
    splits: NDArray[np.int32]
    num_new: int


def find_successors(
    old: NDArray[np.int32],
    size: NDArray[np.int64],
    cluster: NDArray[np.int32],
    is_object: NDArray[np.bool_],
    next_id: int,
) -> Succession:
    """Give ids to clusters.

    An object lives on in the cluster with most of its voxels; where several do in one, the one with
    most voxels there keeps its id, the lowest of equals, and the others merge into it. A cluster in
    which none lives on is a new object.

    Args:
        old: (N,) int32 object of each node before, 0 none.
        size: (N,) int64 its voxels.
        cluster: (N,) int32 the lowest node of its cluster.
        is_object: (N,) bool: whether the cluster is an object at all; other nodes are of none.
        next_id: The first id that was never given out.

    Returns:
        Who follows whom.
    """
    owner, merges, splits, num_new = _find_successors(old, size, cluster, is_object, next_id)
    return Succession(owner, merges, splits, num_new)


@njit(cache=True)
def _find_successors(
    old: NDArray[np.int32],
    size: NDArray[np.int64],
    cluster: NDArray[np.int32],
    is_object: NDArray[np.bool_],
    next_id: int,
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], int]:
    count = old.size
    heir = np.full(count, _NONE, np.int32)  # of a cluster: the object that lives on in it
    heir_size = np.zeros(count, np.int64)
    parent = np.zeros(count, np.int32)  # of a cluster: the object it has most voxels of
    parent_size = np.zeros(count, np.int64)

    # voxels that each object has in each cluster, objects ascending
    keys = (old.astype(np.int64) << 32) | cluster.astype(np.int64)
    order = np.argsort(keys)
    gone = []
    at = 0
    while at < count:
        owner = old[order[at]]
        home, home_size = np.int32(_NONE), np.int64(0)
        while at < count and old[order[at]] == owner:
            here, voxels = cluster[order[at]], np.int64(0)
            while at < count and old[order[at]] == owner and cluster[order[at]] == here:
                voxels += size[order[at]]
                at += 1
            if owner > 0 and voxels > parent_size[here]:
                parent[here], parent_size[here] = owner, voxels
            if voxels > home_size:
                home, home_size = here, voxels
        if owner == 0 or not is_object[home]:
            continue

        # one object lives on in a cluster, the others merge into it
        if home_size > heir_size[home]:
            if heir[home] != _NONE:
                gone.append((heir[home], home))
            heir[home], heir_size[home] = owner, home_size
        else:
            gone.append((owner, home))

    # clusters in which none does: new ids, in order of their lowest nodes
    splits = []
    num_new = 0
    for node in range(count):
        if cluster[node] == node and is_object[node] and heir[node] == _NONE:
            heir[node] = next_id + num_new
            num_new += 1
            if parent[node] > 0:
                splits.append((parent[node], heir[node]))
    owners = np.zeros(count, np.int32)
    for node in range(count):
        if is_object[node]:
            owners[node] = heir[cluster[node]]

    merges = np.empty((len(gone), 2), np.int32)
    for i, (one, home) in enumerate(sorted(gone)):
        merges[i, 0], merges[i, 1] = one, heir[home]
    parts = np.empty((len(splits), 2), np.int32)
    for i, (one, other) in enumerate(splits):
        parts[i, 0], parts[i, 1] = one, other
    return owners, merges, parts, num_new
