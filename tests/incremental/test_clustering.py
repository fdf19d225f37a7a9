"""Agglomerative clustering (III-C) against connected components found the slow way."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.incremental.clustering import Clusters, embed_classes, quantise
from tests import reference

_NO_NEIGHBOUR = -1


def unit(vectors: np.ndarray) -> np.ndarray:
    return (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).astype(np.float32)


def embedding_of(kinds: list[int]) -> np.ndarray:
    """Embeddings that are equal for equal kinds and at right angles otherwise."""
    return quantise(np.eye(50, dtype=np.float32)[kinds])


def neighbours_of(rows: list[list[int]]) -> np.ndarray:
    table = [row + [_NO_NEIGHBOUR] * (26 - len(row)) for row in rows]
    return np.array(table, np.int32).reshape(-1, 26)


def same_partition(a, b) -> bool:
    return len(set(zip(a, b, strict=True))) == len(set(a)) == len(set(b))


def test_a_point_without_connections_seeds_an_object():
    clusters = Clusters(0.9)
    merges, changed = clusters.add(embedding_of([0, 1]), neighbours_of([[1], [0]]))
    assert clusters.instance.tolist() == [1, 2]
    assert len(merges) == len(changed) == 0
    assert clusters.num_objects == 2


def test_a_point_connected_to_one_object_joins_it():
    clusters = Clusters(0.9)
    clusters.add(embedding_of([0]), neighbours_of([[]]))
    clusters.add(embedding_of([0]), neighbours_of([[0]]))
    assert clusters.instance.tolist() == [1, 1]


def test_a_point_between_two_objects_merges_them_and_the_lowest_id_survives():
    clusters = Clusters(0.9)
    clusters.add(embedding_of([1, 0, 0, 0]), neighbours_of([[], [], [], [2]]))
    assert clusters.instance.tolist() == [1, 2, 3, 3]
    merges, changed = clusters.add(embedding_of([0]), neighbours_of([[3, 1]]))
    assert merges.tolist() == [[3, 2]]
    assert changed.tolist() == [2, 3]
    assert clusters.instance.tolist() == [1, 2, 2, 2, 2]
    assert clusters.num_objects == 2


def test_objects_that_form_and_merge_within_one_scan_leave_no_gap_and_no_report():
    clusters = Clusters(0.9)
    merges, _ = clusters.add(embedding_of([0, 0, 0, 1]), neighbours_of([[], [], [0, 1], []]))
    assert clusters.instance.tolist() == [1, 1, 1, 2]
    assert len(merges) == 0


def test_a_chain_of_merges_ends_at_the_lowest_id_for_every_member():
    clusters = Clusters(0.9)
    clusters.add(embedding_of([0, 0, 0, 0]), neighbours_of([[], [], [], []]))
    merges, changed = clusters.add(embedding_of([0, 0, 0]), neighbours_of([[3, 2], [2, 1], [1, 0]]))
    assert clusters.instance.tolist() == [1] * 7
    assert merges.tolist() == [[2, 1], [3, 1], [4, 1]]
    assert changed.tolist() == [1, 2, 3]


def test_similarity_at_the_threshold_does_not_connect():
    halves = quantise(unit(np.array([[1.0, 0.0] + [0] * 48, [0.9, np.sqrt(1 - 0.81)] + [0] * 48])))
    apart, joined = Clusters(0.9002), Clusters(0.8998)
    for clusters in (apart, joined):
        clusters.add(halves, neighbours_of([[1], [0]]))
    assert apart.num_objects == 2
    assert joined.num_objects == 1


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_objects_are_the_connected_components_of_all_similar_neighbours(data):
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    num_scans, kinds = data.draw(st.integers(1, 6)), data.draw(st.integers(1, 4))
    clusters, all_kinds, edges = Clusters(0.9), [], []
    for _ in range(num_scans):
        start, count = len(all_kinds), int(rng.integers(0, 25))
        all_kinds += rng.integers(0, kinds, count).tolist()

        # neighbours are mutual among new voxels, and reach back to old ones
        links = [set() for _ in range(count)]
        for i in range(count):
            for other in rng.integers(0, start + count, int(rng.integers(0, 4))).tolist():
                if other != start + i:
                    links[i].add(other)
                    if other >= start:
                        links[other - start].add(start + i)
        pairs = [(start + i, j) for i, link in enumerate(links) for j in link]
        edges += [(i, j) for i, j in pairs if all_kinds[i] == all_kinds[j]]

        # what the clusters say has changed has, and nothing else
        before = clusters.instance.copy()
        neighbours = neighbours_of([sorted(link) for link in links])
        merges, changed = clusters.add(embedding_of(all_kinds[start:]), neighbours)
        assert np.flatnonzero(before != clusters.instance[:start]).tolist() == changed.tolist()
        gone = set(before.tolist()) - set(clusters.instance.tolist())
        assert gone == {int(old) for old, _ in merges}
        assert all(new < old for old, new in merges)

    if all_kinds:
        components = reference.connected_components(len(all_kinds), edges)
        assert same_partition(clusters.instance.tolist(), components)
        assert clusters.num_objects == len(set(components))


def test_a_restored_clustering_goes_on_as_if_never_interrupted():
    rng = np.random.default_rng(0)
    steps, total = [], 0
    for _ in range(6):
        neighbours = rng.integers(-1, max(total, 1), (20, 26)).astype(np.int32)
        embedding = embedding_of(rng.integers(0, 3, 20).tolist())
        steps.append((embedding, np.where(neighbours >= total, -1, neighbours)))
        total += 20

    # four steps before the interruption
    whole, first = Clusters(0.9), Clusters(0.9)
    original, merges = [], []
    for number, (embedding, neighbours) in enumerate(steps):
        found, _ = whole.add(embedding, neighbours)
        if number < 4:
            first.add(embedding, neighbours)
            original.append(first.instance[-20:].copy())
            merges.append(found)

    again = Clusters(0.9)
    again.restore(first.embedding.copy(), np.concatenate(original))
    again.restore_merges(np.concatenate(merges))
    assert again.num_objects == first.num_objects

    # two after it
    for embedding, neighbours in steps[4:]:
        again.add(embedding, neighbours)
    assert sum(map(len, merges)) > 0
    assert again.instance.tolist() == whole.instance.tolist()
    assert again.num_objects == whole.num_objects


def test_quantised_embeddings_keep_cosines_to_four_digits():
    rng = np.random.default_rng(0)
    a, b = unit(rng.normal(size=(200, 50))), unit(rng.normal(size=(200, 50)))
    kept = (quantise(a).astype(np.float64) * quantise(b)).sum(axis=1) / 32767**2
    np.testing.assert_allclose(kept, (a.astype(np.float64) * b).sum(axis=1), atol=1e-4)


def test_stand_in_embeddings_are_alike_within_a_class_and_far_apart_between_classes():
    steps = quantise(embed_classes(np.arange(255, dtype=np.uint8))).astype(np.float64) / 32767
    similarity = steps @ steps.T
    assert np.diag(similarity).min() > 0.99
    assert (similarity - 2 * np.eye(255)).max() < 0.76


def test_neighbours_of_one_class_are_one_object_without_an_embedding():
    clusters = Clusters(0.9)
    rows = [[1], [0, 2], [1, 3], [2]]
    clusters.add(quantise(embed_classes(np.array([5, 5, 4, 5], np.uint8))), neighbours_of(rows))
    assert clusters.instance.tolist() == [1, 1, 2, 3]
