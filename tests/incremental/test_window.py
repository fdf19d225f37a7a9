"""What the sparse U-Net is told about voxels, against plain numpy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.incremental.window import NUM_INPUTS, window_input
from mcpseg_cli.networks import unet
from mcpseg_cli.networks.sparse import find_neighbours

SIZE = 0.125  # metres: exact in float32, so that moves are, too
SURFACE = slice(10, 14)  # linearity, planarity, scattering, |normal z|


def describe(voxel, place=None, rgb=None, looks=None, floor=0.0) -> np.ndarray:
    """Inputs of voxels whose points lie ``place`` voxels from their centres."""
    voxel = np.asarray(voxel, np.int32)
    place = np.zeros(voxel.shape) if place is None else place
    return window_input(
        ((voxel + place) * SIZE).astype(np.float32),
        np.full(voxel.shape, 128, np.uint8) if rgb is None else rgb,
        np.ones(len(voxel), np.int32) if looks is None else looks,
        voxel,
        find_neighbours(voxel),
        voxel_size=SIZE,
        floor=floor,
    )


def scatter(seed: int, count: int = 200, width: int = 7) -> tuple[np.ndarray, np.ndarray]:
    """Voxels, and where in each its point is."""
    rng = np.random.default_rng(seed)
    voxel = np.unique(rng.integers(0, width, (count, 3)), axis=0).astype(np.int32)
    return voxel, rng.integers(-31, 32, voxel.shape) / 64


def slow_surface(voxel: np.ndarray, place: np.ndarray, row: int) -> tuple[np.ndarray, np.ndarray]:
    """Shape of the points two steps away, each as often as there are ways; and the eigenvalues."""
    table, xyz = find_neighbours(voxel), voxel + place
    ways = [j for k in table[row] if k >= 0 for j in table[k] if j >= 0]
    values, vectors = np.linalg.eigh(np.cov(xyz[ways].T, bias=True).reshape(3, 3))
    least, middle, largest = values
    shape = [largest - middle, middle - least, least]
    return np.array([*np.array(shape) / max(largest, 1e-6), abs(vectors[2, 0])]), values


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(5, 250))
def test_surfaces_are_those_of_an_eigendecomposition(seed, count):
    voxel, place = scatter(seed, count)
    found = describe(voxel, place)[:, SURFACE]
    for row in range(len(voxel)):
        expected, values = slow_surface(voxel, place, row)
        if values[2] > 1e-6:
            np.testing.assert_allclose(found[row, :3], expected[:3], atol=1e-3)
        if values[1] - values[0] > 1e-3 and values[0] > 1e-9:
            assert found[row, 3] == pytest.approx(expected[3], abs=1e-3)


def plane(axis: int, width: int = 12) -> np.ndarray:
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(width), [0], indexing="ij"), axis=-1)
    return np.roll(grid.reshape(-1, 3), axis - 2, axis=1)


def test_a_flat_floor_is_planar_and_faces_up():
    voxel = plane(2)
    inner = (voxel[:, :2].min(axis=1) >= 2) & (voxel[:, :2].max(axis=1) < 10)
    linearity, planarity, scattering, upright = describe(voxel)[inner, SURFACE].T
    np.testing.assert_allclose(linearity, 0, atol=1e-3)
    np.testing.assert_allclose(planarity, 1, atol=1e-3)
    np.testing.assert_allclose(scattering, 0, atol=1e-3)
    np.testing.assert_allclose(upright, 1, atol=1e-3)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_wall_is_planar_and_faces_sideways(axis):
    _, planarity, _, upright = describe(plane(axis))[:, SURFACE].T
    assert planarity.max() > 0.99
    np.testing.assert_allclose(upright, 0, atol=1e-3)


def test_a_pole_is_linear():
    pole = np.stack([np.zeros(9), np.zeros(9), np.arange(9)], axis=1)
    np.testing.assert_allclose(describe(pole)[:, 10], 1, atol=1e-3)


def test_a_voxel_alone_has_no_shape():
    np.testing.assert_allclose(describe([[3, 4, 5]])[:, SURFACE], 0, atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_shapes_are_shares_of_the_largest_spread(seed):
    voxel, place = scatter(seed)
    shape = describe(voxel, place)[:, SURFACE]
    assert shape.min() >= -1e-6
    assert shape.max() <= 1 + 1e-6
    assert shape[:, :3].sum(axis=1).max() <= 1 + 1e-5


def test_inputs_do_not_depend_on_where_the_window_is():
    voxel, place = scatter(1)
    moved = voxel + np.array([400, -250, 0], np.int32)
    np.testing.assert_array_equal(describe(moved, place), describe(voxel, place))


def test_a_window_and_its_floor_may_be_raised_together():
    voxel, place = scatter(2)
    raised = describe(voxel + np.array([0, 0, 16], np.int32), place, floor=2.0)
    np.testing.assert_allclose(raised, describe(voxel, place), atol=1e-6)


def test_the_rest_is_colour_height_place_and_looks():
    voxel, place = scatter(3)
    rng = np.random.default_rng(0)
    rgb = rng.integers(0, 256, voxel.shape).astype(np.uint8)
    looks = rng.integers(1, 500, len(voxel)).astype(np.uint16)
    inputs = describe(voxel, place, rgb, looks, floor=0.5)
    height = (voxel + place)[:, 2] * SIZE - 0.5
    assert inputs.shape == (len(voxel), NUM_INPUTS)
    assert NUM_INPUTS == unet.NUM_INPUTS
    np.testing.assert_allclose(inputs[:, :3], rgb / 255 - 0.5, atol=1e-6)
    np.testing.assert_allclose(inputs[:, 3], height / 2 - 0.5, atol=1e-6)
    np.testing.assert_allclose(inputs[:, 4], np.clip(height, -0.3, 0.7), atol=1e-6)
    np.testing.assert_allclose(inputs[:, 5:8], place, atol=1e-6)
    np.testing.assert_array_equal(inputs[:, 8], 1)
    np.testing.assert_allclose(inputs[:, 9], np.log1p(looks) / 2 - 0.5, atol=1e-5)


def test_no_voxels_have_no_inputs():
    assert describe(np.empty((0, 3))).shape == (0, NUM_INPUTS)
