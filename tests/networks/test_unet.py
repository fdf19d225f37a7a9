"""The sparse U-Net: what it says about windows, on every device, and what it can learn."""

import copy

import numpy as np
import pytest
import torch

from mcpseg_cli.networks import sparse
from mcpseg_cli.networks.sparse import find_neighbours, make_levels
from mcpseg_cli.networks.unet import (
    EMBEDDING,
    NUM_INPUTS,
    NUM_LEVELS,
    UNet,
    forward_pairs,
)
from mcpseg_cli.networks.weights import NETWORKS
from tests.networks.test_sparse import FAR, make_window


def inputs_of(voxel: np.ndarray, seed: int = 0) -> torch.Tensor:
    return torch.randn(len(voxel), NUM_INPUTS, generator=torch.Generator().manual_seed(seed))


@torch.inference_mode()
def judge(network: UNet, voxel: np.ndarray, inputs: torch.Tensor):
    return network(inputs, make_levels(voxel, NUM_LEVELS))


def assert_alike(one, other, tolerance: float = 1e-4) -> None:
    for ours, theirs in zip(one, other, strict=True):
        torch.testing.assert_close(ours, theirs, atol=tolerance, rtol=tolerance)


def test_it_gives_what_it_claims(unet):
    voxel = make_window(1)
    logits, embedding = judge(unet, voxel, inputs_of(voxel))
    assert NETWORKS["unet"].traits.sees_windows
    assert NETWORKS["unet"].traits.has_embedding
    assert logits.shape == (len(voxel), 13)
    assert embedding.shape == (len(voxel), EMBEDDING)
    torch.testing.assert_close(embedding.norm(dim=1), torch.ones(len(voxel)))


def test_windows_that_are_far_apart_do_not_see_each_other(unet):
    one, other = make_window(1), make_window(2, 400, width=12)
    inputs = inputs_of(one, 1), inputs_of(other, 2)
    both = judge(unet, np.concatenate([one, other + FAR]), torch.cat(inputs))
    for part, voxel, own in ((slice(len(one)), one, 0), (slice(len(one), None), other, 1)):
        assert_alike([each[part] for each in both], judge(unet, voxel, inputs[own]))


def test_the_order_of_voxels_does_not_matter(unet):
    voxel = make_window(3)
    inputs, order = inputs_of(voxel), np.random.default_rng(0).permutation(len(voxel))
    whole = judge(unet, voxel, inputs)
    shuffled = judge(unet, voxel[order], inputs[order])
    assert_alike(shuffled, [each[order] for each in whole])


def test_a_move_by_voxels_of_the_coarsest_level_changes_nothing(unet):
    voxel = make_window(4)
    inputs = inputs_of(voxel)
    moved = judge(unet, voxel + np.array([16, -32, 160], np.int32), inputs)
    assert_alike(moved, judge(unet, voxel, inputs), 0.0)


def test_what_a_voxel_is_called_depends_on_what_is_metres_away(unet):
    line = np.stack([np.arange(40), np.zeros(40), np.zeros(40)], axis=1).astype(np.int32)
    inputs = inputs_of(line)
    changed = inputs.clone()
    changed[-1] += 3
    before, after = judge(unet, line, inputs), judge(unet, line, changed)
    assert not torch.equal(before.logits[5], after.logits[5])


@pytest.mark.parametrize("count", [1, 2, 17])
def test_small_windows_are_labelled(unet, count):
    voxel = make_window(6, count, width=20)
    assert torch.isfinite(judge(unet, voxel, inputs_of(voxel)).logits).all()


def test_in_plain_torch_it_says_the_same_as_in_numba(unet, monkeypatch):
    voxel = make_window(8, 500)
    ours = judge(unet, voxel, inputs_of(voxel))

    def forward(layer, features, level):
        return sparse.sum_neighbours(features, level.neighbours, layer.weight)

    monkeypatch.setattr(sparse.DepthwiseConv, "forward", forward)  # as on other devices
    assert_alike(judge(unet, voxel, inputs_of(voxel)), ours)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU here")
def test_a_gpu_says_the_same(unet):
    voxel, device = make_window(8, 500), torch.device("cuda")
    levels = [level.to(device) for level in make_levels(voxel, NUM_LEVELS)]
    with torch.inference_mode():
        there = copy.deepcopy(unet).to(device)(inputs_of(voxel).to(device), levels)
    whole = judge(unet, voxel, inputs_of(voxel))
    assert_alike([each.cpu() for each in there], whole, 1e-3)


def test_training_reaches_every_parameter(unet):
    fresh, voxel = copy.deepcopy(unet).train(), make_window(10, 600)
    levels = make_levels(voxel, NUM_LEVELS)
    output = fresh(inputs_of(voxel), levels)
    one, other = forward_pairs(levels[0].neighbours)
    affinity = fresh.affinity(output.embedding[one], output.embedding[other])
    (output.logits.square().mean() + affinity.square().mean()).backward()
    for name, parameter in fresh.named_parameters():
        assert parameter.grad is not None, name
        if not name.endswith("narrow.bias"):
            assert parameter.grad.abs().sum() > 0, name


def test_a_few_steps_of_adam_learn_a_window_by_heart(unet):
    fresh, voxel = copy.deepcopy(unet).train(), make_window(11, 300)
    levels, inputs = make_levels(voxel, NUM_LEVELS), inputs_of(voxel)
    semantic = torch.from_numpy((voxel[:, 0] > 0) + 2 * (voxel[:, 1] > 0)).long()
    optimiser = torch.optim.Adam(fresh.parameters(), lr=3e-3)
    for _ in range(25):
        optimiser.zero_grad()
        logits = fresh(inputs, levels).logits
        torch.nn.functional.cross_entropy(logits, semantic).backward()
        optimiser.step()
    assert (logits.argmax(dim=1) == semantic).float().mean() > 0.9


def test_affinity_falls_with_the_distance_of_embeddings_as_steeply_as_was_learned(unet):
    changed = copy.deepcopy(unet)
    for even, steepness in ((3.0, 4.0), (0.5, 1.0)):
        changed.affine.data = torch.tensor([even, steepness])
        one, other = torch.tensor([[1.0, 0.0]]), torch.tensor([[0.6, 0.8]])
        assert changed.affinity(one, one).item() == pytest.approx(even)
        fall = torch.nn.functional.softplus(torch.tensor(steepness)).item() * 0.8
        assert changed.affinity(one, other).item() == pytest.approx(even - fall, abs=1e-5)


def test_every_pair_of_neighbours_is_listed_once():
    table = find_neighbours(make_window(12))
    one, other = forward_pairs(torch.from_numpy(table))
    listed = [frozenset(pair) for pair in zip(one.tolist(), other.tolist(), strict=True)]
    there = {frozenset((i, j)) for i, row in enumerate(table.tolist()) for j in row if j >= 0}
    there = {pair for pair in there if len(pair) == 2}
    assert len(listed) == len(set(listed))
    assert set(listed) == there
