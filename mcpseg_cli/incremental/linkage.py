"""Average linkage on a graph: who belongs together, by all edges between two clusters, not one.

Clusters are merged pair by pair, those with the highest mean affinity along their common boundary
first, as long as it is above a threshold (average linkage of Bailoni et al., "GASP", 2019). One
edge that leaks does not unite two objects, and one weak edge does not cut one. Clusters that stay
too small to be anything join the neighbour they are most like.
"""

from __future__ import annotations

import heapq

import numpy as np
from numba import njit
from numpy.typing import NDArray

_NONE = -1
_FEW = 0.02  # share of nodes: when fewer merge in a round, one pair after another is faster
_TAIL = 0.001  # share of nodes: when fewer merge in a round, the rest waits for the whole graph


@njit(cache=True, nogil=True)
def link(
    size: NDArray[np.int64],
    ends: NDArray[np.int32],
    together: NDArray[np.int64],
    total: NDArray[np.int64],
    threshold: float,
    least: int,
) -> NDArray[np.int32]:
    """Cluster the nodes of a graph.

    Args:
        size: (N,) int64 voxels of each node.
        ends: (E, 2) int32 nodes that each edge joins; several may join the same two.
        together: (E,) int64 evidence that both are of one object.
        total: (E,) int64 evidence about that, for or against; above 0.
        threshold: Mean affinity, ``together / total``, above which clusters merge.
        least: Clusters of fewer voxels join the neighbour with the highest, whatever it is.

    Returns:
        (N,) int32: the lowest node of the cluster of each.
    """
    count = size.size
    root = np.arange(count).astype(np.int32)
    size = size.copy()

    # pairs that are each other's best merge in any order with the same end: all at once
    u, v = ends[:, 0].copy(), ends[:, 1].copy()
    u, v, together, total = _contract(root, u, v, together, total)
    num_merged = count
    while num_merged > _FEW * count:
        num_merged = _merge_mutual(root, size, u, v, together, total, threshold, count)
        if num_merged > 0:
            u, v, together, total = _contract(root, u, v, together, total)

    # the rest one by one
    _merge_in_order(root, size, u, v, together, total, threshold, least)
    lowest = np.full(count, _NONE, np.int32)
    for i in range(count):
        cluster = _find(root, i)
        if lowest[cluster] == _NONE:
            lowest[cluster] = i
        root[i], root[cluster] = cluster, cluster
    return lowest[root]


@njit(cache=True, nogil=True)
def link_inside(
    ends: NDArray[np.int32],
    together: NDArray[np.int64],
    total: NDArray[np.int64],
    threshold: float,
    count: int,
    num_inside: int,
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
    """Merge, in a part of a graph, what ``link`` of the whole would merge, whatever lies outside.

    A union is never more like a third cluster than the better of its two parts. So two clusters
    that are each other's best neighbour, nodes outside included one by one, merge in the end; what
    else merges is found out when the clusters of all parts are linked.

    Args:
        ends: (E, 2) int32 nodes that each edge joins; all edges of the nodes inside.
        together: (E,) int64 evidence that both are of one object.
        total: (E,) int64 evidence about that, for or against; above 0.
        threshold: As for ``link``.
        count: Nodes.
        num_inside: Those that are of the part, the first ones.

    Returns:
        (num_inside,) int32 the lowest node of the cluster of each; (F, 2) int32 lowest nodes of
        clusters inside that have a boundary; (F,) int64 together and (F,) int64 total along it.
    """
    root = np.arange(count).astype(np.int32)
    size = np.ones(count, np.int64)
    u, v = ends[:, 0].copy(), ends[:, 1].copy()
    u, v, together, total = _contract(root, u, v, together, total)
    num_merged = count
    while num_merged > _TAIL * count:
        num_merged = _merge_mutual(root, size, u, v, together, total, threshold, num_inside)
        if num_merged > 0:
            u, v, together, total = _contract(root, u, v, together, total)

    cluster = np.empty(num_inside, np.int32)
    for i in range(num_inside):
        cluster[i] = _find(root, i)
    inside = np.flatnonzero(v < num_inside)
    pairs = np.empty((inside.size, 2), np.int32)
    pairs[:, 0], pairs[:, 1] = u[inside], v[inside]
    return cluster, pairs, together[inside], total[inside]


@njit(cache=True, nogil=True)
def _find(root: NDArray[np.int32], node: int) -> int:
    while root[node] != node:
        root[node] = root[root[node]]
        node = root[node]
    return node


@njit(cache=True, nogil=True)
def _contract(
    root: NDArray[np.int32],
    u: NDArray[np.int32],
    v: NDArray[np.int32],
    together: NDArray[np.int64],
    total: NDArray[np.int64],
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
    """Put edges between clusters in the place of edges between nodes, one for each pair."""
    # edges by their lower cluster: counting sort
    count = root.size
    starts = np.zeros(count + 1, np.int64)
    low, high = np.empty_like(u), np.empty_like(v)
    for e in range(u.size):
        a, b = _find(root, u[e]), _find(root, v[e])
        low[e], high[e] = min(a, b), max(a, b)
        if a != b:
            starts[low[e] + 1] += 1
    for i in range(count):
        starts[i + 1] += starts[i]
    order = np.empty(starts[count], np.int64)
    place = starts.copy()
    for e in range(u.size):
        if low[e] != high[e]:
            order[place[low[e]]] = e
            place[low[e]] += 1

    # those that join the same two as one
    edge_of = np.full(count, _NONE, np.int64)
    size = 0
    new_u, new_v = np.empty(order.size, np.int32), np.empty(order.size, np.int32)
    new_together, new_total = np.empty(order.size, np.int64), np.empty(order.size, np.int64)
    for a in range(count):
        first = size
        for at in range(starts[a], starts[a + 1]):
            e = order[at]
            b = high[e]
            if edge_of[b] < first:
                edge_of[b] = size
                new_u[size], new_v[size] = a, b
                new_together[size], new_total[size] = 0, 0
                size += 1
            new_together[edge_of[b]] += together[e]
            new_total[edge_of[b]] += total[e]
    return (
        new_u[:size].copy(),
        new_v[:size].copy(),
        new_together[:size].copy(),
        new_total[:size].copy(),
    )


@njit(cache=True, nogil=True)
def _merge_mutual(
    root: NDArray[np.int32],
    size: NDArray[np.int64],
    u: NDArray[np.int32],
    v: NDArray[np.int32],
    together: NDArray[np.int64],
    total: NDArray[np.int64],
    threshold: float,
    num_inside: int,
) -> int:
    """Merge the first clusters that are each other's best neighbour; return how many merged."""
    best = np.full(root.size, _NONE, np.int32)
    highest = np.full(root.size, threshold)
    for e in range(u.size):
        mean = together[e] / total[e]
        if mean > highest[u[e]]:
            best[u[e]], highest[u[e]] = e, mean
        if mean > highest[v[e]]:
            best[v[e]], highest[v[e]] = e, mean

    num_merged = 0
    for node in range(root.size):
        e = best[node]
        if e != _NONE and u[e] == node and best[v[e]] == e and v[e] < num_inside:
            root[v[e]] = node  # the lower
            size[node] += size[v[e]]
            num_merged += 1
    return num_merged


@njit(cache=True, nogil=True)
def _merge_in_order(
    root: NDArray[np.int32],
    size: NDArray[np.int64],
    u: NDArray[np.int32],
    v: NDArray[np.int32],
    together: NDArray[np.int64],
    total: NDArray[np.int64],
    threshold: float,
    least: int,
) -> None:
    """Merge the best pair, again and again, while it is above the threshold or one is too small."""
    first, following, degree = _list_edges(root.size, u, v)
    is_gone = np.zeros(u.size, np.bool_)
    edge_to = np.full(root.size, _NONE, np.int32)

    # pairs that may merge: the sum of two edges is never above both, so the others need not wait
    heap = [(0.0, np.int32(0)) for _ in range(0)]
    for e in range(u.size):
        mean = together[e] / total[e]
        if mean > threshold or min(size[u[e]], size[v[e]]) < least:
            heap.append((-mean, np.int32(e)))
    heapq.heapify(heap)

    while len(heap) > 0:
        distance, best = heapq.heappop(heap)
        if is_gone[best]:
            continue
        mean = together[best] / total[best]
        if mean <= threshold and min(size[u[best]], size[v[best]]) >= least:
            continue
        if mean < -distance:
            heapq.heappush(heap, (-mean, best))  # it fell since
            continue
        is_gone[best] = True

        # the one with more edges takes over those of the other
        keep, gone = u[best], v[best]
        if degree[keep] < degree[gone]:
            keep, gone = gone, keep
        root[gone] = keep
        size[keep] += size[gone]
        degree[keep] = _mark(keep, first, following, u, v, is_gone, edge_to)

        edge = first[gone]
        while edge != _NONE:
            side = 0 if u[edge] == gone else 1
            after = following[edge, side]
            if not is_gone[edge]:
                same = edge_to[v[edge] if side == 0 else u[edge]]
                if same != _NONE:
                    # both had an edge to this one: their sum
                    is_gone[edge] = True
                    was = together[same] / total[same]
                    together[same] += together[edge]
                    total[same] += total[edge]
                    mean = together[same] / total[same]
                    if mean > was and (
                        mean > threshold or min(size[u[same]], size[v[same]]) < least
                    ):
                        heapq.heappush(heap, (-mean, same))
                else:
                    following[edge, side], first[keep] = first[keep], np.int32(edge)
                    degree[keep] += 1
                    if side == 0:
                        u[edge] = keep
                    else:
                        v[edge] = keep
            edge = after
        _unmark(keep, first, following, u, v, edge_to)


@njit(cache=True, nogil=True)
def _mark(
    node: int,
    first: NDArray[np.int32],
    following: NDArray[np.int32],
    u: NDArray[np.int32],
    v: NDArray[np.int32],
    is_gone: NDArray[np.bool_],
    edge_to: NDArray[np.int32],
) -> int:
    """Note the edge to each neighbour of a cluster, drop edges that are gone, count the others."""
    count = 0
    last, last_side = _NONE, 0
    edge = first[node]
    while edge != _NONE:
        side = 0 if u[edge] == node else 1
        after = following[edge, side]
        if is_gone[edge]:
            if last == _NONE:
                first[node] = after
            else:
                following[last, last_side] = after
        else:
            edge_to[v[edge] if side == 0 else u[edge]] = edge
            last, last_side = edge, side
            count += 1
        edge = after
    return count


@njit(cache=True, nogil=True)
def _unmark(
    node: int,
    first: NDArray[np.int32],
    following: NDArray[np.int32],
    u: NDArray[np.int32],
    v: NDArray[np.int32],
    edge_to: NDArray[np.int32],
) -> None:
    """Forget what was noted."""
    edge = first[node]
    while edge != _NONE:
        side = 0 if u[edge] == node else 1
        edge_to[v[edge] if side == 0 else u[edge]] = _NONE
        edge = following[edge, side]


@njit(cache=True, nogil=True)
def _list_edges(
    count: int, u: NDArray[np.int32], v: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int64]]:
    """Give each cluster's edges as a linked list: the first, the next after each, how many."""
    first = np.full(count, _NONE, np.int32)
    following = np.full((u.size, 2), _NONE, np.int32)
    degree = np.zeros(count, np.int64)
    for e in range(u.size):
        following[e, 0], first[u[e]] = first[u[e]], e
        following[e, 1], first[v[e]] = first[v[e]], e
        degree[u[e]] += 1
        degree[v[e]] += 1
    return first, following, degree
