"""The look-up table of III-B against its slow twin."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.grid import voxel_of
from mcpseg_cli.incremental import voxel_map
from mcpseg_cli.incremental.voxel_map import VoxelMap, context_window
from tests import reference


def random_points(seed: int, num_points: int, spread: float = 1.5) -> np.ndarray:
    return (np.random.default_rng(seed).normal(size=(num_points, 3)) * spread).astype(np.float32)


def uniform_numbers(seed: int, *shape: int) -> np.ndarray:
    return np.random.default_rng(seed).random(shape, np.float32)


def filled(
    points: np.ndarray, num_scans: int = 3
) -> tuple[VoxelMap, reference.DictVoxelMap, list[int], list[int]]:
    fast, slow = VoxelMap(0.1), reference.DictVoxelMap(0.1)
    fast_ids, slow_ids = [], []
    for scan in np.array_split(points, num_scans):
        fast_ids += fast.insert(scan, np.zeros((len(scan), 3), np.uint8)).tolist()
        slow_ids += slow.insert(scan)
    return fast, slow, fast_ids, slow_ids


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), num_points=st.integers(0, 400), spread=st.floats(0.01, 50))
def test_every_point_finds_the_voxel_its_slow_twin_finds(seed, num_points, spread):
    fast, slow, fast_ids, slow_ids = filled(random_points(seed, num_points, spread))
    assert fast_ids == slow_ids
    assert len(fast) == len(slow.ids)


def test_the_first_point_of_a_voxel_stays_its_point():
    small = VoxelMap(0.1)
    points = np.array([[0.01, 0, 0], [0.02, 0, 0], [0.31, 0, 0]], np.float32)
    colours = np.array([[1, 1, 1], [2, 2, 2], [3, 3, 3]], np.uint8)
    assert small.insert(points, colours).tolist() == [0, 0, 1]
    np.testing.assert_array_equal(small.xyz, points[[0, 2]])
    np.testing.assert_array_equal(small.rgb, colours[[0, 2]])


def test_growing_past_the_first_blocks_keeps_every_voxel(monkeypatch):
    monkeypatch.setattr(voxel_map, "_RESERVED_BLOCKS", 1000)
    points = random_points(1, 60_000, 20.0)
    fast, _, fast_ids, slow_ids = filled(points)
    assert len(fast._block_ids) > 10_000
    assert len(fast._keys) > 2 * fast._num_blocks
    assert fast_ids == slow_ids
    assert fast.find(points).tolist() == slow_ids


def test_find_says_minus_one_where_the_map_is_empty():
    small = VoxelMap(0.1)
    small.insert(np.zeros((1, 3), np.float32), np.zeros((1, 3), np.uint8))
    assert small.find(np.array([[0, 0, 0], [0, 0, 9]], np.float32)).tolist() == [0, -1]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("far", [5e5, -5e5, 3e38, np.inf, np.nan])
def test_find_says_minus_one_where_no_map_goes(far):
    small = VoxelMap(0.1)
    small.insert(np.zeros((1, 3), np.float32), np.zeros((1, 3), np.uint8))
    assert small.find(np.array([[0, far, 0], [0, 0, 0]], np.float32)).tolist() == [-1, 0]


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_neighbours_are_those_of_the_slow_twin(seed):
    fast, slow, _, _ = filled(random_points(seed, 300, 0.4))
    ids = np.arange(len(fast), dtype=np.int32)
    assert fast.neighbours(ids).tolist() == [slow.neighbours(i) for i in range(len(fast))]


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_a_box_of_the_map_is_that_of_the_slow_twin(seed):
    fast, slow, _, _ = filled(random_points(seed, 300, 0.4))
    low, shape = (-5, -3, -7), (9, 4, 11)
    assert fast.occupancy(np.array(low, np.int32), shape).ravel().tolist() == slow.box(low, shape)


@pytest.mark.parametrize("window", ["cells", "coarse"])
@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_context_comes_from_the_candidates_of_the_slow_twin(window, seed):
    fast, slow, _, _ = filled(random_points(seed, 400, 0.5))
    ids = np.arange(len(fast), dtype=np.int32)
    sample = fast.sample_context(ids, window, uniform_numbers(seed, len(ids), 500))
    candidates = slow.cells_context if window == "cells" else slow.coarse_context
    for voxel_id in range(0, len(fast), 29):
        assert set(sample[voxel_id].tolist()) <= candidates(voxel_id)
    few = fast.sample_context(ids, window, uniform_numbers(seed, len(ids), 1))
    assert few.shape == (len(fast), 1)


@pytest.mark.parametrize("window", ["cells", "coarse"])
def test_context_is_drawn_as_the_slow_twin_draws_it(window):
    fast, slow, _, _ = filled(random_points(3, 600, 0.4))
    ids = np.arange(len(fast), dtype=np.int32)
    uniform = uniform_numbers(7, len(ids), 50)
    drawn = fast.sample_context(ids, window, uniform)
    low, width = context_window(voxel_of(fast.xyz, 0.1), window)
    enough = 0
    for voxel_id in range(0, len(fast), 7):
        candidates = slow.by_blocks(tuple(low[voxel_id].tolist()), width)
        enough += len(candidates) >= 50
        assert drawn[voxel_id].tolist() == reference.sample(candidates, uniform[voxel_id].tolist())
    assert 0 < enough < len(range(0, len(fast), 7))  # both ways of drawing were met


def test_context_without_replacement_repeats_no_point():
    fast, _, _, _ = filled(random_points(5, 3000, 0.3))
    sample = fast.sample_context(np.arange(5, dtype=np.int32), "coarse", uniform_numbers(0, 5, 50))
    assert all(len(set(row.tolist())) == 50 for row in sample)


def test_a_restored_map_answers_as_the_one_it_was_saved_from():
    points = random_points(2, 2000)
    fast, _, fast_ids, _ = filled(points)
    again = VoxelMap(0.1)
    again.restore(fast.xyz.copy(), fast.rgb.copy())
    assert again.find(points).tolist() == fast_ids


def test_restoring_two_points_of_one_voxel_is_refused():
    with pytest.raises(ValueError, match="one voxel"):
        VoxelMap(0.1).restore(np.zeros((2, 3), np.float32), np.zeros((2, 3), np.uint8))


def test_halves_round_upwards_on_both_sides_of_zero():
    assert voxel_of(np.array([[0.5, -0.5, 1.5]], np.float32), 1.0).tolist() == [[1, 0, 2]]


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    num_points=st.integers(0, 400),
    radius=st.floats(0.01, 4),
    height=st.floats(0.05, 3),
)
def test_the_voxels_near_a_place_are_those_a_search_one_by_one_finds(
    seed, num_points, radius, height
):
    table = filled(random_points(seed, num_points))[0]
    position = random_points(seed + 1, 1)[0].astype(np.float64)
    found = table.near(position, radius, height)
    assert found.dtype == np.int32
    assert (np.diff(found) > 0).all()

    # all that are in range, and none that is farther: blocks of four voxels reach over the height
    away = np.hypot(*(table.xyz[:, :2] - position[:2]).T)
    above = np.abs(table.xyz[:, 2] - position[2])
    surely = np.flatnonzero((away < radius - 1e-5) & (above < height - 1e-5))
    perhaps = np.flatnonzero((away < radius + 1e-5) & (above < height + 0.6))
    assert set(surely) <= set(found) <= set(perhaps)


def test_nothing_is_near_in_an_empty_map():
    assert VoxelMap(0.1).near(np.zeros(3), 5.0, 8.0).tolist() == []
