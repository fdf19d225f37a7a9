"""Network input (III-B) and the height of the floor."""

import numpy as np
import pytest

from mcpseg_cli.incremental.context import context_input, network_input
from mcpseg_cli.incremental.floor import floor_height
from mcpseg_cli.incremental.voxel_map import VoxelMap

SENSOR = np.array([0.0, 0.0, 1.5])


def plane(z: float, half: float = 1.5, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    count = int(800 * half**2)
    return np.column_stack(
        [rng.uniform(-half, half, (count, 2)), rng.normal(z, 0.005, count)]
    ).astype(np.float32)


def wall(low: float, high: float) -> np.ndarray:
    rng = np.random.default_rng(1)
    side = np.where(rng.random(4000) < 0.5, -1.5, 1.5) + rng.normal(0, 0.03, 4000)
    return np.column_stack(
        [side, rng.uniform(-1.5, 1.5, 4000), rng.uniform(low, high, 4000)]
    ).astype(np.float32)


def floor_of(*parts: np.ndarray, sensor: np.ndarray = SENSOR) -> float | None:
    voxel_map = VoxelMap(0.1)
    for part in parts:
        voxel_map.insert(part, np.zeros((len(part), 3), np.uint8))
    return floor_height(voxel_map, sensor)


def test_the_floor_is_found_to_a_centimetre():
    assert floor_of(plane(0.0), wall(0.0, 2.5)) == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("height", [-0.75, 0.05, 0.149, 12.34])
def test_the_floor_may_lie_at_any_height_between_voxels(height):
    sensor = np.array([0.0, 0.0, height + 1.5])
    assert floor_of(plane(height), sensor=sensor) == pytest.approx(height, abs=0.01)


def test_stray_points_below_the_floor_are_no_floor():
    rng = np.random.default_rng(2)
    stray = np.column_stack([rng.uniform(-1, 1, (30, 2)), rng.uniform(-1.4, -0.2, 30)]).astype(
        np.float32
    )
    assert floor_of(plane(0.0), stray) == pytest.approx(0.0, abs=0.01)


def test_a_small_landing_below_is_not_the_floor():
    assert floor_of(plane(0.0), plane(-1.0, half=0.3)) == pytest.approx(0.0, abs=0.01)


def test_a_table_above_the_floor_is_not_the_floor():
    assert floor_of(plane(0.0), plane(0.75, half=0.8)) == pytest.approx(0.0, abs=0.01)


def test_a_ceiling_far_larger_than_the_floor_seen_does_not_hide_it():
    assert floor_of(plane(0.0, half=0.6), plane(1.9, half=2.0)) == pytest.approx(0.0, abs=0.01)


def test_walls_alone_show_no_floor():
    assert floor_of(wall(0.8, 2.5)) is None


def test_a_floor_seen_only_by_an_earlier_scan_still_counts():
    assert floor_of(plane(0.0), wall(0.9, 2.0)) == pytest.approx(0.0, abs=0.01)


def test_an_empty_map_has_no_floor():
    assert floor_height(VoxelMap(0.1), SENSOR) is None


def test_centre_points_are_around_the_robot_and_above_the_floor():
    xyz = np.array([[3.0, 4.0, 1.0]], np.float32)
    centre = network_input(
        xyz, np.array([[0, 255, 128]], np.uint8), np.array([2.0, 6.0, 1.3]), 0.25
    )
    assert centre.dtype == np.float32
    np.testing.assert_allclose(centre, [[1.0, -2.0, 0.75, -0.5, 0.5, 128 / 255 - 0.5]], atol=1e-6)


def test_context_is_relative_to_its_centre_in_place_and_colour():
    xyz = np.array([[1, 1, 1], [1.1, 0.8, 1.0], [5, 5, 5]], np.float32)
    rgb = np.array([[10, 20, 30], [255, 0, 30], [0, 0, 0]], np.uint8)
    context = context_input(np.array([0], np.int32), np.array([[0, 1]], np.int32), xyz, rgb)
    expected = [[[0] * 6, [0.1, -0.2, 0.0, 245 / 255, -20 / 255, 0.0]]]
    np.testing.assert_allclose(context, expected, atol=1e-6)
