"""Region growing: normals, who joins whom, and objects that grow over scans."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.config import EMBEDDING, RegionGrowingSettings, SegmentSettings
from mcpseg_cli.incremental.clustering import quantise
from mcpseg_cli.incremental.region_growing import estimate_normals, keep_alike
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.scan import Scan

GROWING = RegionGrowingSettings()


def make_map(xyz: np.ndarray) -> VoxelMap:
    voxel_map = VoxelMap(0.1)
    voxel_map.insert(xyz.astype(np.float32), np.full((len(xyz), 3), 100, np.uint8))
    return voxel_map


def grid(*ranges) -> np.ndarray:
    return np.array(list(itertools.product(*ranges)), np.float64)


def everything(voxel_map: VoxelMap) -> np.ndarray:
    return np.arange(len(voxel_map), dtype=np.int32)


def normals_of(xyz: np.ndarray, position=(0.0, 0.0, 1.0)) -> np.ndarray:
    voxel_map = make_map(xyz)
    return estimate_normals(voxel_map, everything(voxel_map), np.array(position), GROWING)


def slow_normal(
    voxel_map: VoxelMap, voxel: int, position: np.ndarray, growing: RegionGrowingSettings
) -> np.ndarray:
    """The least axis of the points within reach, facing the sensor; 0 where they are no plane."""
    cells = np.floor(voxel_map.xyz.astype(np.float64) / 0.1 + 0.5)
    near = np.abs(cells - cells[voxel]).max(axis=1) <= growing.reach
    points = voxel_map.xyz[near].astype(np.float64)
    if len(points) < growing.min_points:
        return np.zeros(3)
    _, spread, axes = np.linalg.svd(points - points.mean(axis=0))
    share = spread**2 / (spread**2).sum()
    if share[2] > growing.max_curvature or share[1] <= 1e-9 * share[0]:
        return np.zeros(3)
    return axes[2] if axes[2] @ (position - voxel_map.xyz[voxel]) >= 0 else -axes[2]


def slow_alike(
    voxel: int, neighbours: list[int], normals, rgb, growing: RegionGrowingSettings
) -> set[int]:
    """Which neighbours a voxel joins, in words: as ``keep_alike`` says."""
    colours, facing = rgb.astype(int).tolist(), normals.astype(float) @ normals[voxel]
    distance = {other: math.dist(colours[voxel], colours[other]) for other in neighbours}

    # smooth
    if normals[voxel].any():
        least = math.cos(math.radians(growing.max_angle_deg)) * 32767**2
        return {o for o in neighbours if distance[o] <= growing.max_colour and facing[o] >= least}

    # rough
    near = [other for other in neighbours if distance[other] <= growing.max_colour]
    return {min(near, key=lambda other: distance[other])} if near else set()


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), thickness=st.floats(0.0, 0.5))
def test_normals_equal_the_slow_twin(seed, thickness):
    rng = np.random.default_rng(seed)
    voxel_map = make_map(rng.uniform([0, 0, 0], [0.8, 0.8, max(thickness, 1e-3)], (120, 3)))
    position = rng.uniform(-2, 2, 3)
    found = estimate_normals(voxel_map, everything(voxel_map), position, GROWING)
    expected = np.array(
        [slow_normal(voxel_map, voxel, position, GROWING) for voxel in range(len(voxel_map))]
    )
    np.testing.assert_allclose(found, expected, atol=1e-4)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), num_known=st.integers(0, 20), smooth=st.floats(0.0, 1.0))
def test_who_joins_whom_equals_the_slow_twin(seed, num_known, smooth):
    rng = np.random.default_rng(seed)
    total = 24

    # normals up to some degrees apart, of voxels of like colours
    turned = np.column_stack(
        [np.zeros(total), *(f(rng.normal(0, 0.25, total)) for f in (np.sin, np.cos))]
    )
    normals = quantise(np.where(rng.random(total)[:, None] < smooth, turned, 0).astype(np.float32))
    rgb = rng.integers(90, 130, (total, 3)).astype(np.uint8)
    neighbours = np.where(
        rng.random((total - num_known, 26)) < 0.3, rng.integers(0, total, 26), -1
    ).astype(np.int32)
    embedding = np.zeros((total, EMBEDDING), np.int16)
    embedding[:, :3] = normals

    kept = keep_alike(neighbours, embedding[num_known:], embedding[:num_known], rgb, GROWING)
    assert ((kept == neighbours) | (kept == -1)).all()
    for row in range(total - num_known):
        others = list(dict.fromkeys(neighbours[row][neighbours[row] >= 0].tolist()))
        expected = slow_alike(num_known + row, others, normals, rgb, GROWING)
        assert set(kept[row][kept[row] >= 0].tolist()) == expected


def test_normals_face_the_sensor():
    floor = grid(np.arange(0, 1, 0.1), np.arange(0, 1, 0.1), [0.0])
    np.testing.assert_allclose(
        normals_of(floor, (0.5, 0.5, 1.0)), np.tile([0, 0, 1], (len(floor), 1)), atol=1e-6
    )
    np.testing.assert_allclose(
        normals_of(floor, (0.5, 0.5, -1.0)), np.tile([0, 0, -1], (len(floor), 1)), atol=1e-6
    )


@pytest.mark.parametrize("points", [grid([0.0], [0.0], [0.0]), grid([0.0, 0.1], [0.0], [0.0])])
def test_too_few_points_have_no_normal(points):
    assert not normals_of(points).any()


def test_a_ball_of_points_is_rough():
    assert not normals_of(
        grid(np.arange(0, 0.3, 0.1), np.arange(0, 0.3, 0.1), np.arange(0, 0.3, 0.1))
    ).any()


def grow(scans: list[tuple[np.ndarray, np.ndarray, float]]) -> IncrementalSegmenter:
    segmenter = IncrementalSegmenter(GROWING, SegmentSettings(floor=0.0))
    for xyz, rgb, x in scans:
        pose = np.eye(4)
        pose[:3, 3] = x, 0.0, 1.0
        segmenter.register_scan(Scan(xyz.astype(np.float32), rgb, pose))
    return segmenter


def paint(xyz: np.ndarray, colour: int) -> np.ndarray:
    return np.full((len(xyz), 3), colour, np.uint8)


def test_floor_and_wall_of_one_colour_are_two_large_objects():
    floor = grid(np.arange(-1.5, 1.51, 0.1), np.arange(-1.0, 1.01, 0.1), [0.0])
    wall = grid(np.arange(-1.5, 1.51, 0.1), [1.0], np.arange(0.1, 2.01, 0.1))
    xyz = np.concatenate([floor, wall])
    segmenter = grow([(xyz, paint(xyz, 120), 0.0)])
    sizes = np.sort(np.bincount(segmenter.clusters.instance))[::-1]
    assert sizes[0] + sizes[1] > 0.85 * len(segmenter.map)
    middle = segmenter.clusters.instance[
        segmenter.map.find(np.array([[0, 0, 0], [0, 1, 1]], np.float32))
    ]
    assert middle[0] != middle[1]


def test_two_colours_on_one_plane_are_two_objects():
    board = grid([1.0], np.arange(-1, 1.01, 0.1), np.arange(0.5, 1.51, 0.1))
    rgb = np.where(board[:, 1:2] < 0.05, 40, 200).repeat(3, axis=1).astype(np.uint8)
    segmenter = grow([(board, rgb, 0.0)])
    assert segmenter.clusters.num_objects == 2


def test_an_object_grows_over_scans_and_two_merge_when_the_gap_is_seen():
    left, right = (
        grid(x, np.arange(-0.5, 0.51, 0.1), [0.0])
        for x in (np.arange(0, 1, 0.1), np.arange(1.5, 2.5, 0.1))
    )
    middle = grid(np.arange(0.9, 1.6, 0.1), np.arange(-0.5, 0.51, 0.1), [0.0])
    segmenter = grow([(part, paint(part, 90), 1.0) for part in (left, right)])
    assert segmenter.clusters.num_objects == 2

    # the gap
    pose = np.eye(4)
    pose[:3, 3] = 1.0, 0.0, 1.0
    update = segmenter.register_scan(Scan(middle.astype(np.float32), paint(middle, 90), pose))
    assert segmenter.clusters.num_objects == 1
    assert update.merges.tolist() == [[2, 1]]


def test_region_growing_gives_no_class():
    floor = grid(np.arange(0, 1, 0.1), np.arange(0, 1, 0.1), [0.0])
    segmenter = grow([(floor, paint(floor, 90), 0.0)])
    assert segmenter.classes == ()
    assert (segmenter.semantic == UNKNOWN).all()
    assert [item.class_name for item in segmenter.objects()] == ["unknown"]
