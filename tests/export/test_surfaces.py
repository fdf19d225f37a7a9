"""Normals of voxels, heights above the floor, and where ceilings are cut off."""

import numpy as np
import pytest

from mcpseg_cli.export.floors import below_ceiling
from mcpseg_cli.export.normals import _add_neighbours, surface_normals
from mcpseg_cli.grid import voxel_of

SIZE = 0.1


def room(height, rng):
    """Voxels of floor, ceiling and a wall with the normals they should have, seen from inside."""
    grid = np.stack(np.meshgrid(np.arange(0, 4, SIZE), np.arange(0, 4, SIZE)), -1).reshape(-1, 2)
    flat = np.zeros((len(grid), 1))
    wall = grid[grid[:, 1] < height - SIZE]
    xyz = np.concatenate([
        np.hstack([grid, flat]),
        np.hstack([grid, flat + height]),
        np.column_stack([wall[:, 0], np.full(len(wall), 4.0), wall[:, 1]]),
    ])  # fmt: skip
    normal = np.repeat(
        [[0, 0, 1.0], [0, 0, -1.0], [0, -1.0, 0]], [len(grid), len(grid), len(wall)], axis=0
    )
    return (xyz + rng.normal(0, 0.004, xyz.shape)).astype(np.float32), normal


def test_floor_ceiling_and_wall_face_the_scanner():
    xyz, expected = room(2.5, np.random.default_rng(0))
    eyes = np.tile([2.0, 2.0, 1.2], (len(xyz), 1))
    found = surface_normals(xyz, eyes, SIZE)
    agreement = np.einsum("ij,ij->i", found, expected)
    assert (agreement > 0.95).mean() > 0.9  # edges of the room aside
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, atol=1e-5)


def test_points_by_themselves_look_up():
    xyz = np.array([[0, 0, 0], [5, 5, 5], [5.1, 5, 5]], np.float32)
    found = surface_normals(xyz, np.zeros((3, 3)), SIZE)
    np.testing.assert_array_equal(found, np.tile([0, 0, 1], (3, 1)))


def moments_slowly(voxel, xyz):
    """Sum over all pairs of voxels that touch."""
    moments = np.zeros((len(xyz), 10))
    for i in range(len(xyz)):
        for j in range(len(xyz)):
            if i != j and np.abs(voxel[i] - voxel[j]).max() <= 1:
                x, y, z = xyz[j] - xyz[i]
                moments[i] += (1, x, y, z, x * x, x * y, x * z, y * y, y * z, z * z)
    return moments


def test_neighbours_are_those_of_the_slow_way():
    rng = np.random.default_rng(2)
    xyz = rng.uniform(0, 0.6, (150, 3))
    voxel = voxel_of(xyz.astype(np.float32), SIZE).astype(np.int64) + 1
    voxel, first = np.unique(voxel, axis=0, return_index=True)
    xyz = xyz[first]

    # in the order of their keys, as np.unique has sorted them
    keys = (voxel[:, 0] * 64 + voxel[:, 1]) * 64 + voxel[:, 2]
    steps = [(x * 64 + y) * 64 + z for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)]
    moments = np.zeros((len(xyz), 10))
    _add_neighbours(keys, xyz, np.array([step for step in steps if step > 0]), moments)
    np.testing.assert_allclose(moments, moments_slowly(voxel, xyz), atol=1e-12)


@pytest.mark.parametrize("height", [2.4, 3.0, 6.0])
def test_the_ceiling_is_cut_off_and_furniture_stays(height):
    xyz, normal = room(height, np.random.default_rng(1))
    cut = below_ceiling(xyz[:, 2], normal)
    assert 1.6 <= cut < height - 0.2
    assert cut > 0.6 * height


def test_without_a_ceiling_nothing_is_cut():
    xyz, normal = room(2.5, np.random.default_rng(1))
    open_air = xyz[:, 2] < 2.3
    assert below_ceiling(xyz[open_air, 2], normal[open_air]) is None
