"""Sparse grids: tables and convolution against their slow twins."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.networks import sparse
from mcpseg_cli.networks.sparse import (
    DepthwiseConv,
    Level,
    _coarsen,
    find_neighbours,
    gather_neighbours,
    make_levels,
    number_voxels,
    sum_neighbours,
)

FAR = np.array([1 << 13, 0, 0], np.int32)  # voxels between two windows
OFFSETS = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)]


def make_window(seed: int, count: int = 200, width: int = 8, centre: int = 0) -> np.ndarray:
    """(V, 3) int32 distinct voxels in random order, on both sides of ``centre``."""
    rng = np.random.default_rng(seed)
    voxel = np.unique(rng.integers(-width // 2, width // 2, (count, 3)), axis=0) + centre
    return rng.permutation(voxel).astype(np.int32)


def slow_neighbours(voxel: np.ndarray) -> list[list[int]]:
    row_of = {tuple(each): row for row, each in enumerate(voxel.tolist())}
    return [
        [row_of.get((x + dx, y + dy, z + dz), -1) for dx, dy, dz in OFFSETS]
        for x, y, z in voxel.tolist()
    ]


def slow_coarsening(voxel: np.ndarray) -> tuple[list, list, list, list]:
    """Coarse voxels in the order they first come, and who is part of which."""
    coarse, parent, corner, children = [], [], [], []
    for row, each in enumerate(voxel.tolist()):
        whole = [index // 2 for index in each]
        if whole not in coarse:
            coarse.append(whole)
            children.append([len(voxel)] * 8)
        parent.append(coarse.index(whole))
        x, y, z = (index % 2 for index in each)
        corner.append(4 * x + 2 * y + z)
        children[parent[-1]][corner[-1]] = row
    return coarse, parent, corner, children


def tables_of(level: Level) -> list[torch.Tensor]:
    tables = (level.neighbours, level.parent, level.corner, level.children)
    return [table for table in tables if table is not None]


windows = st.builds(
    make_window,
    seed=st.integers(0, 10**6),
    count=st.integers(1, 300),
    width=st.sampled_from([2, 8, 40]),
    centre=st.integers(-90_000, 90_000),
)


@settings(max_examples=40, deadline=None)
@given(voxel=windows)
def test_neighbours_are_those_a_dictionary_finds(voxel):
    assert find_neighbours(voxel).tolist() == slow_neighbours(voxel)


@settings(max_examples=20, deadline=None)
@given(voxel=windows)
def test_a_voxels_neighbour_has_it_as_its_opposite_neighbour(voxel):
    table = find_neighbours(voxel)
    np.testing.assert_array_equal(table[:, 13], np.arange(len(voxel)))
    for k in range(27):
        row = np.flatnonzero(table[:, k] >= 0)
        np.testing.assert_array_equal(table[table[row, k], 26 - k], row)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(0, 300))
def test_voxels_are_numbered_in_the_order_they_first_come(seed, count):
    voxel = np.random.default_rng(seed).integers(-4, 4, (count, 3)).astype(np.int32)
    number_of: dict[tuple[int, ...], int] = {}
    number = [number_of.setdefault(tuple(each), len(number_of)) for each in voxel.tolist()]
    first = [number.index(each) for each in range(len(number_of))]
    found = number_voxels(voxel)
    assert (found[0].tolist(), found[1].tolist()) == (first, number)


@settings(max_examples=40, deadline=None)
@given(voxel=windows)
def test_coarser_grids_join_two_by_two_by_two(voxel):
    tables = tuple(table.tolist() for table in _coarsen(voxel))
    assert tables == slow_coarsening(voxel)


def test_windows_that_are_far_apart_have_the_tables_they_have_alone():
    one, other = make_window(1), make_window(2, width=30)
    joined = make_levels(np.concatenate([one, other + FAR]), 5)
    alone = make_levels(one, 5), make_levels(other, 5)
    for both, first, second in zip(joined, *alone, strict=True):
        assert len(both) == len(first) + len(second)
        np.testing.assert_array_equal(both.neighbours[: len(first)], first.neighbours)
        rest = both.neighbours[len(first) :]
        np.testing.assert_array_equal(
            torch.where(rest < 0, rest, rest - len(first)), second.neighbours
        )

    # who is part of whom, one window's numbers after the other's
    for level, (both, first, second) in enumerate(zip(joined, *alone, strict=True)):
        if both.parent is None:
            assert level == 4
            continue
        shift = len(alone[0][level + 1])
        assert both.parent.tolist() == first.parent.tolist() + (second.parent + shift).tolist()
        assert both.corner.tolist() == first.corner.tolist() + second.corner.tolist()
        for part, own, before in (
            (slice(shift), first, 0),
            (slice(shift, None), second, len(first)),
        ):
            children = both.children[part]
            there = children < len(both)
            assert torch.equal(there, own.children < len(own))
            assert torch.equal(children[there] - before, own.children[there])


def test_the_coarsest_level_has_no_parents():
    levels = make_levels(make_window(3), 3)
    assert [len(tables_of(level)) for level in levels] == [4, 4, 1]


def test_a_single_voxel_is_a_window():
    levels = make_levels(np.zeros((1, 3), np.int32), 5)
    assert [len(level) for level in levels] == [1] * 5
    assert [int((level.neighbours >= 0).sum()) for level in levels] == [1] * 5


def convolve(voxel, *, plain: bool = False, by=None, width: int = 12, threads: int = 1):
    """Convolve random features; give the answer and the gradients of features and weights."""
    torch.set_num_threads(threads)
    generator = torch.Generator().manual_seed(0)
    features = torch.randn(len(voxel), width, generator=generator, requires_grad=True)
    layer = DepthwiseConv(width)
    with torch.no_grad():
        layer.weight.copy_(torch.randn(27, width, generator=generator))
    slope = torch.randn(len(voxel), width, generator=generator)
    level = make_levels(voxel, 1)[0]

    if by is not None or plain:
        answer = (by or sum_neighbours)(features, level.neighbours, layer.weight)
    else:
        answer = layer(features, level)
    answer.backward(slope)
    return answer.detach(), features.grad, layer.weight.grad


@pytest.mark.parametrize("count", [1, 60, 900])
def test_the_convolution_and_its_gradients_equal_those_of_plain_torch(count):
    voxel = make_window(4, count, width=10)
    fast, slow = convolve(voxel, plain=False), convolve(voxel, plain=True)
    for ours, theirs in zip(fast, slow, strict=True):
        torch.testing.assert_close(ours, theirs, atol=2e-5, rtol=1e-4)


@pytest.mark.parametrize("at_once", [1, 12 * 27 * 7, 1 << 27])
def test_gathering_all_neighbours_gives_the_same_however_many_at_once(at_once, monkeypatch):
    monkeypatch.setattr(sparse, "_GATHERED", at_once)
    voxel = make_window(4, 60, width=10)
    fast, slow = convolve(voxel, by=gather_neighbours), convolve(voxel, plain=True)
    for ours, theirs in zip(fast, slow, strict=True):
        torch.testing.assert_close(ours, theirs, atol=2e-5, rtol=1e-4)


def test_one_voxel_is_weighed_by_the_middle_of_the_cube():
    answer, _, _ = convolve(np.zeros((1, 3), np.int32), plain=False)
    generator = torch.Generator().manual_seed(0)
    features = torch.randn(1, 12, generator=generator)
    assert torch.equal(answer, features * torch.randn(27, 12, generator=generator)[13])


def test_the_convolution_is_the_same_for_one_and_two_threads():
    voxel = make_window(5, 3000, width=16)
    assert len(voxel) > 1024  # enough to be shared
    one, two = (convolve(voxel, plain=False, threads=threads) for threads in (1, 2))
    assert torch.equal(one[0], two[0])
    assert torch.equal(one[1], two[1])
    torch.testing.assert_close(one[2], two[2], atol=1e-3, rtol=1e-4)  # summed part by part


def test_gradients_equal_finite_differences():
    voxel = make_window(6, 25, width=4)
    neighbours = make_levels(voxel, 1)[0].neighbours
    features = torch.randn(len(voxel), 2, dtype=torch.float64, requires_grad=True)
    weight = torch.randn(27, 2, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(
        lambda *inputs: sum_neighbours(inputs[0], neighbours, inputs[1]), (features, weight)
    )
