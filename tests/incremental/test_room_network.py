"""Looks of the network that sees the room: each from a grid that begins elsewhere."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcpseg_cli.config import SegmentSettings
from mcpseg_cli.incremental.evidence import Look
from mcpseg_cli.incremental.room_network import RoomNetwork, begin_of_levels
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.networks.weights import load_weights

EDGE = 16  # voxels of the finest level along one of the coarsest
POSITION = np.array([0.3, 0.2, 1.0])
RNG = np.random.default_rng(0)


@pytest.fixture(scope="module")
def network(unet_path) -> RoomNetwork:
    return RoomNetwork(load_weights(unet_path), SegmentSettings(), precision="fp32")


def make_map(offset: tuple[float, float, float] = (0, 0, 0)) -> VoxelMap:
    """Some thousand voxels around the robot."""
    rng = np.random.default_rng(5)
    xyz = rng.uniform(-1.5, 1.5, (3000, 3)).round(1) + offset
    voxels = VoxelMap(0.1)
    voxels.insert(xyz.astype(np.float32), rng.integers(0, 256, xyz.shape).astype(np.uint8))
    return voxels


def look_at(network: RoomNetwork, voxels: VoxelMap, number: int) -> Look:
    """Give what a look at all voxels says, in their order."""
    ids, looks = np.arange(len(voxels), dtype=np.int32), np.ones(len(voxels), np.uint16)
    look, _ = network.look(voxels, ids, looks, POSITION, 0.0, number, RNG)
    order = np.argsort(look.ids)
    return Look(look.ids[order], look.probability[order], look.weight[order], look.affinity[order])


@given(st.integers(0, 10**9))
def test_any_32_looks_in_a_row_begin_in_each_half_of_every_level_along_each_axis(first):
    begins = np.array([begin_of_levels(number) for number in range(first, first + 32)])
    assert begins.min() >= 0
    assert begins.max() < EDGE
    for width in (2, 4, 8, 16):
        halves = begins % width >= width // 2
        assert (halves.sum(axis=0) >= 8).all()


def test_looks_of_one_number_say_the_same_and_of_another_number_something_else(network):
    voxels = make_map()
    first, again, other = (look_at(network, voxels, number) for number in (3, 3, 4))
    np.testing.assert_array_equal(first.probability, again.probability)
    np.testing.assert_array_equal(first.affinity, again.affinity)
    assert np.abs(first.probability - other.probability).max() > 1e-3


def test_a_map_moved_by_a_voxel_of_the_coarsest_level_is_judged_alike(network):
    here = look_at(network, make_map(), 2)
    there = look_at(network, make_map((EDGE * 0.1, 0, 0)), 2)
    np.testing.assert_allclose(here.probability, there.probability, atol=0.02)
