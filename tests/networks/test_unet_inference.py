"""The sparse U-Net made ready for inference: it says what it said before, on any threads."""

import copy

import numpy as np
import pytest
import torch
from torch.nn import functional

from mcpseg_cli.incremental.evidence import compute_affinities
from mcpseg_cli.networks.sparse import find_neighbours
from mcpseg_cli.networks.unet import forward_pairs
from mcpseg_cli.networks.unet_inference import FastUNet
from tests.networks.test_sparse import make_window
from tests.networks.test_unet import assert_alike, inputs_of, judge

CPU = torch.device("cpu")


@pytest.mark.parametrize("count", [1, 60, 700])
def test_it_says_the_same_and_leaves_the_network_as_it_is(unet, count):
    voxel = make_window(7, count, width=10)
    before = copy.deepcopy(unet.state_dict())
    whole = judge(unet, voxel, inputs_of(voxel))
    quick = judge(FastUNet(unet, "fp32", CPU), voxel, inputs_of(voxel))
    assert_alike(quick, whole)
    assert torch.equal(quick.logits.argmax(dim=1), whole.logits.argmax(dim=1))
    assert all(torch.equal(before[name], each) for name, each in unet.state_dict().items())


def test_in_bf16_it_says_nearly_the_same(unet):
    voxel = make_window(7, 500)
    whole = judge(unet, voxel, inputs_of(voxel))
    quick = judge(FastUNet(unet, "bf16", CPU), voxel, inputs_of(voxel))
    assert quick.logits.dtype == quick.embedding.dtype == torch.float32
    spread = whole.logits.std()
    assert (quick.logits - whole.logits).abs().mean() < 0.05 * spread
    assert (quick.logits.argmax(dim=1) == whole.logits.argmax(dim=1)).float().mean() > 0.9
    assert (quick.embedding * whole.embedding).sum(dim=1).min() > 0.95


def test_one_and_two_threads_say_the_same_about_a_large_window(unet):
    voxel = make_window(9, 6000, width=20)
    assert len(voxel) > 4096  # enough to be shared
    inputs, answers = inputs_of(voxel), []
    for threads in (1, 2):
        torch.set_num_threads(threads)
        answers.append(judge(FastUNet(unet, "fp32", CPU), voxel, inputs))
    assert_alike(*answers, tolerance=0.0)


def test_affinities_are_those_of_the_network(unet):
    table = find_neighbours(make_window(8, 400, width=10))
    generator = torch.Generator().manual_seed(0)
    embedding = functional.normalize(torch.randn(len(table), 16, generator=generator), dim=1)
    even, steepness = FastUNet(unet, "fp32", CPU).affine
    found = compute_affinities(embedding.numpy(), table, even, steepness)

    one, other = forward_pairs(torch.from_numpy(table))
    expected = torch.sigmoid(unet.affinity(embedding[one], embedding[other])).detach()
    there = table[:, -13:] >= 0
    np.testing.assert_array_equal(np.isnan(found), ~there)
    np.testing.assert_allclose(found[there], expected.numpy(), atol=1e-5)
