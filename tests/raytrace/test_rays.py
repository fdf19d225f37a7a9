"""Occupancy grid and rays against dictionaries and loops, and what a scanner must never do."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import distance_transform_cdt

from mcpseg_cli.errors import InputError
from mcpseg_cli.grid import voxel_of
from mcpseg_cli.raytrace.occupancy import build_grid
from mcpseg_cli.raytrace.rays import ScanPattern, cast_rays, visible_voxels
from tests import reference

VOXEL_SIZE = 0.1
PATTERN = ScanPattern(horizontal_deg=9.0, vertical_deg=9.0, reach=3.0)
SEEDS = st.integers(0, 2**32 - 1)


def centres(voxels) -> np.ndarray:
    return (np.array(voxels, np.float64) * VOXEL_SIZE).astype(np.float32)


def random_voxels(rng: np.random.Generator, num: int = 400, half: int = 12) -> np.ndarray:
    return rng.integers(-half, half, (num, 3))


def shell(low, high) -> list[tuple[int, int, int]]:
    """All voxels on the faces of a box."""
    ranges = [range(a, b + 1) for a, b in zip(low, high, strict=True)]
    return [
        (x, y, z)
        for x in ranges[0]
        for y in ranges[1]
        for z in ranges[2]
        if x in (low[0], high[0]) or y in (low[1], high[1]) or z in (low[2], high[2])
    ]


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_a_ray_ends_in_the_first_occupied_voxel_of_its_slow_twin(seed):
    rng = np.random.default_rng(seed)
    voxels = random_voxels(rng, num=int(rng.integers(1, 600)))
    grid = build_grid(centres(voxels), VOXEL_SIZE)
    origin = rng.uniform(-1.5, 1.5, 3)
    directions = rng.normal(size=(60, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions[:6] = np.concatenate([np.eye(3), -np.eye(3)])
    hits = cast_rays(grid, origin, directions, 2.5)
    occupied = {tuple(voxel) for voxel in voxels.tolist()}
    for direction, hit in zip(directions, hits, strict=True):
        first = reference.first_occupied(
            occupied, origin / VOXEL_SIZE + 0.5, direction, 2.5 / VOXEL_SIZE
        )
        assert hit == (-1 if first is None else grid.voxel_ids(np.array([first], np.int32))[0])


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_nothing_is_seen_through_the_walls_of_a_closed_box(seed):
    rng = np.random.default_rng(seed)
    low, high = (-rng.integers(3, 15, 3)).tolist(), rng.integers(3, 15, 3).tolist()
    walls = shell(low, high)
    outside = random_voxels(rng, num=500, half=30)
    outside = outside[((outside < np.array(low)) | (outside > np.array(high))).any(axis=1)]
    grid = build_grid(np.concatenate([centres(walls), centres(outside)]), VOXEL_SIZE)
    origin = rng.uniform(np.array(low) + 0.6, np.array(high) - 0.6) * VOXEL_SIZE
    seen = visible_voxels(grid, origin, PATTERN.directions(), 5.0)
    wall_ids = grid.voxel_ids(np.array(walls, np.int32))
    assert len(seen) > 0
    assert np.isin(seen, wall_ids).all()


def test_every_wall_of_an_empty_room_is_seen_from_its_middle():
    walls = shell((-10, -10, -10), (10, 10, 10))
    grid = build_grid(centres(walls), VOXEL_SIZE)
    seen = visible_voxels(grid, np.zeros(3), ScanPattern().directions(), 5.0)
    points = grid.points[seen]
    for axis in range(3):
        for side in (-10, 10):
            face = sum(1 for point in points if walls[point][axis] == side)
            assert face > 0.9 * 19 * 19


def test_reach_is_where_the_ray_enters_the_voxel():
    grid = build_grid(centres([(10, 0, 0)]), VOXEL_SIZE)  # its near face is at 0.95 m
    ray = np.array([[1.0, 0.0, 0.0]])
    assert cast_rays(grid, np.zeros(3), ray, 0.96)[0] == 0
    assert cast_rays(grid, np.zeros(3), ray, 0.94)[0] == -1


def test_the_voxel_the_scanner_stands_in_does_not_stop_its_rays():
    grid = build_grid(centres([(0, 0, 0), (5, 0, 0)]), VOXEL_SIZE)
    hit = cast_rays(grid, np.zeros(3), np.array([[1.0, 0.0, 0.0]]), 5.0)[0]
    assert grid.points[hit] == 1


def test_a_scanner_outside_the_building_sees_it():
    grid = build_grid(centres([(0, 0, 0)]), VOXEL_SIZE)
    for direction in (*np.eye(3), *-np.eye(3)):
        assert cast_rays(grid, -2.0 * direction, direction[None], 5.0)[0] == 0
        assert cast_rays(grid, -2.0 * direction, -direction[None], 5.0)[0] == -1


def test_threads_give_the_same_hits():
    grid = build_grid(centres(random_voxels(np.random.default_rng(3))), VOXEL_SIZE)
    directions = PATTERN.directions()
    with ThreadPoolExecutor(3) as pool:
        shared = cast_rays(grid, np.zeros(3), directions, 3.0, pool, 3)
    np.testing.assert_array_equal(shared, cast_rays(grid, np.zeros(3), directions, 3.0))


@given(SEEDS)
@settings(max_examples=30, deadline=None)
def test_every_occupied_voxel_is_numbered_once_and_stands_for_one_of_its_own_points(seed):
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-1, 1, (500, 3)).astype(np.float32)
    grid = build_grid(xyz, VOXEL_SIZE, seed=seed)
    voxel = voxel_of(xyz, VOXEL_SIZE)
    ids = grid.voxel_ids(voxel)
    assert len(grid) == len(np.unique(voxel, axis=0))
    np.testing.assert_array_equal(np.unique(ids), np.arange(len(grid)))
    np.testing.assert_array_equal(ids[grid.points], np.arange(len(grid)))


@given(SEEDS)
@settings(max_examples=20, deadline=None)
def test_gaps_are_the_chessboard_distance_to_the_nearest_occupied_voxel(seed):
    rng = np.random.default_rng(seed)
    grid = build_grid(centres(random_voxels(rng, num=int(rng.integers(1, 12)))), VOXEL_SIZE)
    occupied = grid.voxel_ids((np.argwhere(grid.gaps >= 0) + grid.low).astype(np.int32)) >= 0
    expected = distance_transform_cdt(~occupied.reshape(grid.gaps.shape), metric="chessboard")
    np.testing.assert_array_equal(grid.gaps, expected)


def test_empty_voxels_and_voxels_outside_have_no_number():
    grid = build_grid(centres([(0, 0, 0), (9, 9, 9)]), VOXEL_SIZE)
    elsewhere = np.array([[1, 0, 0], [-1, 0, 0], [0, 0, 400], [-400, 0, 0]], np.int32)
    np.testing.assert_array_equal(grid.voxel_ids(elsewhere), [-1, -1, -1, -1])


def test_which_point_stands_for_a_voxel_is_drawn_evenly_by_the_seed():
    xyz = np.zeros((4, 3), np.float32)
    drawn = [int(build_grid(xyz, VOXEL_SIZE, seed=seed).points[0]) for seed in range(400)]
    assert min(np.bincount(drawn, minlength=4)) > 60
    assert drawn == [int(build_grid(xyz, VOXEL_SIZE, seed=seed).points[0]) for seed in range(400)]


def test_a_building_too_large_for_its_voxels_is_refused():
    xyz = np.array([[0, 0, 0], [4000, 4000, 400]], np.float32)
    with pytest.raises(InputError, match="remove stray points, give larger voxels"):
        build_grid(xyz, 0.01)


def test_the_paper_scans_a_full_sphere_at_one_degree():
    directions = ScanPattern().directions()
    assert directions.shape == (64800, 3)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    assert directions[:, 2].min() == -1.0
    assert directions[:, 2].max() == pytest.approx(np.sin(np.radians(89)))
