"""What is gathered for a tile of rows: every kernel against its slow twin."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.networks.gathering import (
    gather_children,
    gather_parents,
    look_around,
    pair_up,
    scale_to_unit_length,
)
from mcpseg_cli.networks.sparse import find_neighbours, make_levels
from tests.networks.test_sparse import make_window, windows

WIDTH = 3
NOT_WRITTEN = -77.0


def draw(shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=shape).astype(np.float32)


def slow_look(table: np.ndarray, features: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Every neighbour there is times the weight of its place, summed."""
    seen = np.zeros(features.shape)
    for row, neighbours in enumerate(table):
        for place, other in enumerate(neighbours):
            if other >= 0:
                seen[row] += weight[place].astype(np.float64) * features[other]
    return seen


def look(table: np.ndarray, features: np.ndarray, weight: np.ndarray, rows: slice) -> np.ndarray:
    """Look around a tile, in memory with room for one row more."""
    seen = np.full((rows.stop - rows.start + 1, WIDTH), NOT_WRITTEN, np.float32)
    padded = np.concatenate([weight, np.zeros((1, WIDTH), np.float32)])
    look_around(features, *pair_up(table), padded, seen, rows.start, rows.stop)
    return seen


@settings(deadline=None, max_examples=20)
@given(voxel=windows)
def test_pairs_are_the_neighbours_that_there_are_filled_up_to_fours(voxel):
    table = find_neighbours(voxel)
    pairs = pair_up(table)
    assert pairs.starts[0] == 0
    for row, neighbours in enumerate(table):
        part = slice(pairs.starts[row], pairs.starts[row + 1])
        there = [(place, other) for place, other in enumerate(neighbours) if other >= 0]
        filling = [(27, row)] * (-len(there) % 4)
        listed = zip(pairs.places[part].tolist(), pairs.rows[part].tolist(), strict=True)
        assert list(listed) == there + filling


def test_no_voxels_have_no_pairs():
    pairs = pair_up(np.empty((0, 27), np.int32))
    assert pairs.starts.tolist() == [0]


@settings(deadline=None, max_examples=20)
@given(voxel=windows, seed=st.integers(0, 99))
def test_looking_around_sums_what_neighbours_weigh(voxel, seed):
    table = find_neighbours(voxel)
    features, weight = draw((len(voxel), WIDTH), seed), draw((27, WIDTH), seed + 1)
    seen = look(table, features, weight, slice(0, len(voxel)))
    np.testing.assert_allclose(seen[:-1], slow_look(table, features, weight), atol=1e-5)


def test_a_tile_looks_for_its_own_rows_and_writes_no_others():
    table = find_neighbours(make_window(3))
    features, weight = draw((len(table), WIDTH)), draw((27, WIDTH), 1)
    seen = look(table, features, weight, slice(20, 50))
    np.testing.assert_allclose(seen[:-1], slow_look(table, features, weight)[20:50], atol=1e-5)
    assert (seen[-1] == NOT_WRITTEN).all()


def test_the_same_rows_look_alike_to_the_bit_in_any_tile():
    table = find_neighbours(make_window(4))
    features, weight = draw((len(table), WIDTH)), draw((27, WIDTH), 1)
    whole = look(table, features, weight, slice(0, len(table)))
    np.testing.assert_array_equal(look(table, features, weight, slice(7, 90))[:-1], whole[7:90])


@settings(deadline=None, max_examples=20)
@given(voxel=windows)
def test_children_lie_side_by_side_and_zeros_where_there_is_none(voxel):
    level = make_levels(voxel, 2)[0]
    features, children = draw((len(voxel), WIDTH)), level.children.numpy()
    parts = np.full((len(children) + 1, 8 * WIDTH), NOT_WRITTEN, np.float32)
    gather_children(features, children, parts, 0, len(children))

    padded = np.concatenate([features, np.zeros((1, WIDTH), np.float32)])
    expected = [np.concatenate([padded[child] for child in each]) for each in children]
    np.testing.assert_array_equal(parts[:-1], expected)
    assert (parts[-1] == NOT_WRITTEN).all()


@settings(deadline=None, max_examples=20)
@given(voxel=windows)
def test_parents_answer_for_the_corner_a_voxel_is_in(voxel):
    level = make_levels(voxel, 2)[0]
    parent, corner = level.parent.numpy(), level.corner.numpy()
    answers, features = draw((parent.max() + 1, 8 * WIDTH), 1), draw((len(voxel), WIDTH))
    first, last = len(voxel) // 3, len(voxel)
    both = np.full((last - first + 1, 2 * WIDTH), NOT_WRITTEN, np.float32)
    gather_parents(answers, features, parent, corner, both, first, last)

    for row in range(first, last):
        answer = answers.reshape(-1, 8, WIDTH)[parent[row], corner[row]]
        expected = np.concatenate([np.maximum(answer, 0), features[row]])
        np.testing.assert_array_equal(both[row - first], expected)
    assert (both[-1] == NOT_WRITTEN).all()


@settings(deadline=None, max_examples=20)
@given(count=st.integers(0, 40), width=st.integers(1, 20), seed=st.integers(0, 99))
def test_vectors_get_unit_length_and_keep_their_direction(count, width, seed):
    vectors = draw((count, width), seed)
    lengths = np.linalg.norm(vectors.astype(np.float64), axis=1, keepdims=True)
    scaled = vectors.copy()
    scale_to_unit_length(scaled)
    np.testing.assert_allclose(scaled, vectors / lengths, atol=1e-6)


def test_a_vector_of_no_length_stays():
    vectors = np.zeros((2, 4), np.float32)
    scale_to_unit_length(vectors)
    assert not vectors.any()
