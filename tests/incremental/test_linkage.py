"""Average linkage against a slow twin, and what it is for."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.incremental.linkage import link


def linked(num_nodes, edges, threshold=0.5, least=1, size=None):
    """Clusters, each as its lowest node, of edges (one, other, together, total)."""
    table = np.array(edges, np.int64).reshape(-1, 4)
    sizes = np.ones(num_nodes, np.int64) if size is None else np.array(size, np.int64)
    return link(
        sizes, table[:, :2].astype(np.int32), table[:, 2].copy(), table[:, 3].copy(),
        threshold, least,
    ).tolist()  # fmt: skip


def slow_link(num_nodes, edges, threshold, least, size):
    """Merge the best pair of all, again and again."""
    members = {node: {node} for node in range(num_nodes)}
    voxels = dict(enumerate(size))
    between: dict[frozenset, list[int]] = {}
    for one, other, together, total in edges:
        if one != other:
            sums = between.setdefault(frozenset((one, other)), [0, 0])
            sums[0] += together
            sums[1] += total
    while True:
        may = [
            (sums[0] / sums[1], pair)
            for pair, sums in between.items()
            if sums[0] / sums[1] > threshold or min(voxels[node] for node in pair) < least
        ]
        if not may:
            break
        one, other = sorted(max(may, key=lambda each: each[0])[1])
        members[one] |= members.pop(other)
        voxels[one] += voxels.pop(other)
        renamed: dict[frozenset, list[int]] = {}
        for pair, (together, total) in between.items():
            now = frozenset(one if node == other else node for node in pair)
            if len(now) == 2:
                sums = renamed.setdefault(now, [0, 0])
                sums[0] += together
                sums[1] += total
        between = renamed
    lowest = [0] * num_nodes
    for group in members.values():
        for node in group:
            lowest[node] = min(group)
    return lowest


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.integers(2, 40), st.integers(1, 6))
def test_clusters_equal_those_of_merging_the_best_pair_again_and_again(seed, num_nodes, least):
    rng = np.random.default_rng(seed)
    num_edges = int(rng.integers(1, 4 * num_nodes))
    ends = rng.integers(0, num_nodes, (num_edges, 2))
    total = rng.integers(1, 10**6, num_edges)  # means hardly ever equal
    together = (rng.random(num_edges) * total).astype(np.int64)
    edges = [
        (*map(int, pair), int(a), int(b)) for pair, a, b in zip(ends, together, total, strict=True)
    ]
    size = rng.integers(1, 5, num_nodes).tolist()
    assert linked(num_nodes, edges, 0.5, least, size) == slow_link(
        num_nodes, edges, 0.5, least, size
    )


def test_one_edge_that_leaks_does_not_unite_two_objects():
    # two objects of two voxels each, with one strong edge and three weak ones between them
    leak = [(0, 2, 95, 100), (0, 3, 5, 100), (1, 2, 5, 100), (1, 3, 5, 100)]
    assert linked(4, [(0, 1, 99, 100), (2, 3, 99, 100), *leak]) == [0, 0, 2, 2]


def test_one_weak_edge_does_not_cut_an_object():
    edges = [(0, 1, 90, 100), (1, 2, 80, 100), (0, 2, 10, 100)]
    assert linked(3, edges, threshold=0.4) == [0, 0, 0]


def test_edges_that_join_the_same_two_are_one():
    assert linked(2, [(0, 1, 40, 100), (1, 0, 80, 100)]) == [0, 0]
    assert linked(2, [(0, 1, 10, 100), (1, 0, 80, 100)]) == [0, 1]


def test_a_cluster_that_is_too_small_joins_the_one_it_is_most_like():
    edges = [(0, 1, 10, 100), (1, 2, 20, 100)]
    assert linked(3, edges, least=5, size=[9, 1, 9]) == [0, 1, 1]


def test_a_small_cluster_without_neighbours_stays_alone():
    assert linked(2, [], least=5) == [0, 1]


@pytest.mark.parametrize("num_nodes", [0, 1])
def test_nothing_and_one_node_are_clusters_of_themselves(num_nodes):
    assert linked(num_nodes, []) == list(range(num_nodes))


def test_the_order_of_edges_does_not_matter():
    rng = np.random.default_rng(3)
    edges = [
        (*map(int, rng.integers(0, 30, 2)), int(rng.integers(0, 10**5)), 10**5) for _ in range(90)
    ]
    shuffled = [edges[i] for i in rng.permutation(len(edges))]
    assert linked(30, edges, least=3) == linked(30, shuffled, least=3)
