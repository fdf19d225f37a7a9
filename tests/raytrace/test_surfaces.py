"""Planes of voxels: rays end on them, not in the middle of voxels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mcpseg_cli.grid import voxel_of
from mcpseg_cli.raytrace.occupancy import build_grid
from mcpseg_cli.raytrace.rays import cast_rays
from mcpseg_cli.raytrace.surfaces import Surfaces, find_surfaces

SIZE = 0.1


def wall(turn: Rotation, rng: np.random.Generator) -> np.ndarray:
    """Points of a wall of 3 m x 3 m, 2 m from the origin along the turned x axis."""
    flat = np.column_stack([np.full(40_000, 2.0), rng.uniform(-1.5, 1.5, (40_000, 2))])
    return turn.apply(flat).astype(np.float32)


def slow_normal(xyz: np.ndarray, voxel: np.ndarray) -> np.ndarray:
    """Fit a plane to all points in the 27 voxels around one."""
    near = (np.abs(voxel_of(xyz, SIZE) - voxel) <= 1).all(axis=1)
    variance, direction = np.linalg.eigh(np.cov(xyz[near].astype(np.float64).T, bias=True))
    return direction[:, 0] if variance[0] < 0.1 * variance[1] and near.sum() >= 5 else np.zeros(3)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15, deadline=None)
def test_normals_are_those_of_a_slow_twin(seed):
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-0.5, 0.5, (600, 3)) * rng.uniform(0.05, 1.0, 3)
    xyz = xyz.astype(np.float32)
    grid = build_grid(xyz, SIZE, seed=seed)
    found = find_surfaces(grid, xyz).normal.astype(np.float64)
    voxels = voxel_of(xyz[grid.points], SIZE)
    expected = np.array([slow_normal(xyz, voxel) for voxel in voxels])
    np.testing.assert_array_equal(found.any(axis=1), expected.any(axis=1))
    is_plane = expected.any(axis=1)
    along = np.abs((found * expected).sum(axis=1))[is_plane]
    np.testing.assert_allclose(along, 1.0, atol=1e-5)


@pytest.mark.parametrize("seed", range(4))
def test_rays_end_on_the_plane_of_a_wall_however_it_stands(seed):
    rng = np.random.default_rng(seed)
    turn = Rotation.random(random_state=seed)
    xyz = wall(turn, rng)
    grid = build_grid(xyz, SIZE)
    rays = np.column_stack([np.ones(500), rng.uniform(-0.6, 0.6, (500, 2))])
    rays = turn.apply(rays / np.linalg.norm(rays, axis=1, keepdims=True))
    voxels = cast_rays(grid, np.zeros(3), rays, 5.0)
    distance, cosine = find_surfaces(grid, xyz).meet(voxels, np.zeros(3), rays)
    expected = rays @ turn.apply([1.0, 0.0, 0.0])
    assert (voxels >= 0).all()
    np.testing.assert_allclose(distance * expected, 2.0, atol=0.01)
    np.testing.assert_allclose(cosine, expected, atol=0.02)


def test_a_ray_along_a_surface_ends_abreast_of_the_voxels_point():
    point, normal = np.array([[2.0, 0.01, 0.0]], np.float32), np.array([[0, 1, 0]], np.float32)
    surfaces, ray = Surfaces(point, normal, SIZE), np.array([[1.0, 0.0, 0.0]])
    distance, cosine = surfaces.meet(np.zeros(1, np.int32), np.zeros(3), ray)
    assert (distance[0], cosine[0]) == (2.0, 0.0)


def test_a_ray_that_ends_nowhere_is_infinitely_long():
    surfaces = Surfaces(np.ones((1, 3), np.float32), np.zeros((1, 3), np.float32), SIZE)
    rays = np.array([[1.0, 0.0, 0.0]])
    assert surfaces.meet(np.array([-1], np.int32), np.zeros(3), rays)[0][0] == np.inf
