"""What every network of batches promises to training and the segmenter; steps of some of them.

The one that sees windows has a module of its own: ``test_unet.py``.
"""

from typing import get_args

import numpy as np
import pytest
import torch

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.networks.description import WeightsInfo
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.pointnet import PointNet
from mcpseg_cli.networks.pointnet2 import ball, farthest_points, gather, interpolate
from mcpseg_cli.networks.voxnet import occupancy
from mcpseg_cli.networks.weights import NETWORKS, Architecture, build_network
from mcpseg_cli.train.losses import (
    classification_loss,
    sgpn_confidence_loss,
    sgpn_double_hinge_loss,
    triplet_semihard_loss,
)

ARCHITECTURES = [name for name in get_args(Architecture) if not NETWORKS[name].traits.sees_windows]
POINTS = 60


def build(architecture: Architecture) -> Network:
    torch.manual_seed(0)
    return build_network(WeightsInfo(architecture=architecture, classes=S3DIS_CLASSES)).eval()


def make_input(
    network: Network, *shape: int, seed: int = 1
) -> tuple[torch.Tensor, torch.Tensor | None]:
    """Points within two metres of the robot and up to three high, and context where needed."""
    generator = torch.Generator().manual_seed(seed)
    low, size = torch.tensor([-2.0, -2, 0, -0.5, -0.5, -0.5]), torch.tensor([4.0, 4, 3, 1, 1, 1])
    centre = torch.rand(*shape, 6, generator=generator) * size + low
    if not network.traits.needs_context:
        return centre, None
    return centre, 0.3 * torch.randn(*shape, 8, 6, generator=generator)


def total_loss(
    network: Network, centre: torch.Tensor, context: torch.Tensor | None
) -> torch.Tensor:
    """The losses of the paper: a class for each corner of the room, two objects in each."""
    semantic = (centre[:, 0] > 0) + 2 * (centre[:, 1] > 0)
    instance = 2 * semantic + (centre[:, 2] > 1.5)
    embedding, logits, similarity, confidence = network.branches(centre, context)
    loss = classification_loss(logits, semantic)
    if similarity is not None:
        loss = loss + sgpn_double_hinge_loss(similarity, semantic, instance)
        return loss + sgpn_confidence_loss(confidence, similarity, instance)
    return loss if embedding is None else loss + triplet_semihard_loss(embedding, instance)


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_networks_give_what_they_claim(architecture):
    network = build(architecture)
    with torch.inference_mode():
        embedding, logits = network(*make_input(network, POINTS))
    assert NETWORKS[architecture].traits.needs_context == (architecture == "mcpnet")
    assert NETWORKS[architecture].traits.batch_size == (256 if "mcpnet" in architecture else 1024)
    assert logits.shape == (POINTS, 13)

    has_embedding = architecture in {"mcpnet", "mcpnet-nocontext", "sgpn"}
    assert (embedding is not None) == NETWORKS[architecture].traits.has_embedding == has_embedding
    if embedding is not None:
        assert embedding.shape == (POINTS, 50)
        torch.testing.assert_close(embedding.norm(dim=1), torch.ones(POINTS))


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_batches_do_not_see_each_other(architecture):
    network = build(architecture)
    centre, context = make_input(network, 3, POINTS)
    with torch.inference_mode():
        embedding, logits = network(centre, context)
        for i in range(3):
            alone = network(centre[i], None if context is None else context[i])
            torch.testing.assert_close(logits[i], alone[1], atol=1e-5, rtol=1e-5)
            if embedding is not None:
                torch.testing.assert_close(embedding[i], alone[0], atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("architecture", ARCHITECTURES)
@pytest.mark.parametrize("num_points", [POINTS, 300])
def test_the_order_of_points_does_not_matter(architecture, num_points):
    network = build(architecture)
    centre, context = make_input(network, num_points)
    order = torch.randperm(num_points)
    with torch.inference_mode():
        _, logits = network(centre, context)
        _, shuffled = network(centre[order], None if context is None else context[order])
    torch.testing.assert_close(shuffled, logits[order], atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_what_a_point_is_called_depends_on_its_batch(architecture):
    network = build(architecture)
    centre, context = make_input(network, POINTS)
    with torch.inference_mode():
        _, logits = network(centre, context)
        _, half = network(centre[:30], None if context is None else context[:30])
    assert not torch.allclose(half, logits[:30])


@pytest.mark.parametrize("architecture", ARCHITECTURES)
@pytest.mark.parametrize("num_points", [1, 2, 17])
def test_small_batches_are_labelled(architecture, num_points):
    network = build(architecture)
    with torch.inference_mode():
        _, logits = network(*make_input(network, num_points))
    assert logits.shape == (num_points, 13)
    assert torch.isfinite(logits).all()


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_points_given_twice_are_labelled_alike(architecture):
    network = build(architecture)
    centre, context = make_input(network, POINTS)
    rows = torch.cat([torch.arange(POINTS), torch.arange(40)])
    with torch.inference_mode():
        _, logits = network(centre[rows], None if context is None else context[rows])
    torch.testing.assert_close(logits[POINTS:], logits[:40], atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_training_reaches_every_parameter(architecture):
    network = build(architecture).train()
    total_loss(network, *make_input(network, 200)).backward()
    for name, parameter in network.named_parameters():
        assert parameter.grad is not None, name
        assert parameter.grad.abs().sum() > 0, name


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_a_few_steps_of_adam_learn_a_small_batch_by_heart(architecture):
    network = build(architecture)
    centre, context = make_input(network, POINTS // 2)
    optimiser = torch.optim.Adam(network.parameters(), lr=3e-3)
    first = total_loss(network, centre, context).item()

    for _ in range(25):
        optimiser.zero_grad()
        loss = total_loss(network, centre, context)
        loss.backward()
        optimiser.step()

    semantic = (centre[:, 0] > 0) + 2 * (centre[:, 1] > 0)
    _, logits = network(centre, context)
    assert loss.item() < 0.6 * first
    assert (logits.argmax(dim=1) == semantic).float().mean() > 0.9


@pytest.mark.parametrize("architecture", sorted(set(ARCHITECTURES) - {"mcpnet"}))
def test_a_network_without_context_says_so(architecture):
    network = build(architecture)
    if architecture != "mcpnet-nocontext":
        with pytest.raises(TypeError, match="takes no context"):
            network(torch.zeros(5, 6), torch.zeros(5, 8, 6))
    assert not network.traits.needs_context


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_preparing_for_inference_keeps_the_answers(architecture):
    network = build(architecture)
    centre, context = make_input(network, POINTS)
    with torch.inference_mode():
        _, before = network(centre, context)
        network.pool_in("fp32")
        _, after = network(centre, context)
    torch.testing.assert_close(after, before, atol=1e-5, rtol=1e-5)


def test_pointnet_drops_features_in_training_only():
    network = PointNet(4)
    centre, _ = make_input(network, POINTS)
    assert not torch.equal(network(centre)[1], network(centre)[1])
    network.eval()
    assert torch.equal(network(centre)[1], network(centre)[1])


def slow_farthest_points(xyz: np.ndarray, count: int) -> list[int]:
    chosen = [int((xyz**2).sum(axis=1).argmax())]
    while len(chosen) < count:
        distance = ((xyz[:, None] - xyz[chosen][None]) ** 2).sum(axis=2).min(axis=1)
        chosen.append(int(distance.argmax()))
    return chosen


def test_farthest_points_equal_a_search_one_by_one():
    xyz = torch.rand(2, 80, 3)
    chosen = farthest_points(xyz, 20)
    for i in range(2):
        assert chosen[i].tolist() == slow_farthest_points(xyz[i].numpy(), 20)


def test_all_points_are_kept_in_order_where_there_are_few():
    assert farthest_points(torch.rand(1, 7, 3), 16).tolist() == [list(range(7))]


def test_groups_hold_the_points_within_the_radius():
    xyz = torch.rand(2, 40, 3)
    centres = xyz[:, ::5]
    group = ball(xyz, centres, 0.4)
    for i in range(2):
        for centre, members in zip(centres[i], group[i], strict=True):
            distance = (xyz[i] - centre).norm(dim=1)
            within = set(torch.nonzero(distance <= 0.4).flatten().tolist())
            nearest = set(distance.argsort()[:32].tolist())
            assert set(members.tolist()) == within & nearest


def test_interpolation_returns_what_coarse_points_carry_at_their_place():
    xyz, features = torch.rand(1, 20, 3), torch.randn(1, 20, 5)
    torch.testing.assert_close(interpolate(xyz, xyz, features), features, atol=1e-4, rtol=1e-4)


def test_interpolation_weighs_by_inverse_squared_distance():
    coarse = torch.tensor([[[0.0, 0, 0], [3, 0, 0], [0, 4, 0]]])
    value = interpolate(
        torch.tensor([[[1.0, 0, 0]]]), coarse, torch.tensor([[[1.0], [2.0], [4.0]]])
    )
    weights = torch.tensor([1.0, 1 / 4, 1 / 17])
    assert value.item() == pytest.approx(
        float((weights * torch.tensor([1.0, 2, 4])).sum() / weights.sum()), abs=1e-5
    )


def test_gathering_takes_rows_of_the_own_batch():
    features = torch.arange(12.0).view(2, 3, 2)
    index = torch.tensor([[[2, 0]], [[1, 1]]])
    assert gather(features, index).tolist() == [[[[4, 5], [0, 1]]], [[[8, 9], [8, 9]]]]


def test_voxnets_grid_truncates_and_clips():
    points = torch.tensor(
        [[[-2.0, -1.87, 0.19], [1.99, 5.0, 9.0], [-7.0, 0.0, -0.4], [-1.9, -1.9, 0.1]]]
    )
    centre = torch.cat([points, torch.zeros(1, 4, 3)], dim=2)
    grid = occupancy(centre)
    assert grid.shape == (1, 1, 32, 32, 32)
    assert torch.nonzero(grid[0, 0]).tolist() == [[0, 0, 0], [0, 1, 1], [0, 16, 0], [31, 31, 31]]
