"""MCPNet (figure 3): shapes, the pooling identity, tiles, precision, batching."""

import numpy as np
import pytest
import torch
from torch.nn import functional

from mcpseg_cli.networks.mcpnet import MCPNet, MCPNetNoContext


@pytest.fixture
def network() -> MCPNet:
    torch.manual_seed(0)
    return MCPNet(13).eval()


def test_embeddings_have_unit_length_and_logits_a_column_per_class(network):
    with torch.inference_mode():
        embedding, logits = network(torch.randn(40, 6), torch.randn(40, 50, 6))
    assert embedding.shape == (40, 50)
    assert logits.shape == (40, 13)
    torch.testing.assert_close(embedding.norm(dim=1), torch.ones(40))


def test_pooling_equals_the_layers_as_the_paper_draws_them(network):
    context = torch.randn(70, 50, 6)
    with torch.inference_mode():
        points = functional.relu(network.context_1(context))
        drawn = functional.relu(network.context_2(points)).amax(dim=1)
        torch.testing.assert_close(network.pool_context(context), drawn, atol=1e-5, rtol=1e-5)


def test_context_order_does_not_matter(network):
    context = torch.randn(8, 50, 6)
    with torch.inference_mode():
        shuffled = network.pool_context(context[:, torch.randperm(50)])
        torch.testing.assert_close(network.pool_context(context), shuffled)


def test_the_class_branch_sees_the_maximum_over_the_batch(network):
    centre, context = torch.randn(20, 6), torch.randn(20, 50, 6)
    with torch.inference_mode():
        embedding, logits = network(centre, context)
        half_embedding, half_logits = network(centre[:10], context[:10])
    torch.testing.assert_close(embedding[:10], half_embedding)
    assert not torch.allclose(logits[:10], half_logits)


def test_repeating_points_of_a_batch_changes_nothing(network):
    centre, context = torch.randn(20, 6), torch.randn(20, 50, 6)
    rows = torch.cat([torch.arange(20), torch.randint(20, (12,))])
    with torch.inference_mode():
        _, logits = network(centre, context)
        _, padded = network(centre[rows], context[rows])
    torch.testing.assert_close(padded[:20], logits)


def test_bf16_pooling_stays_close_to_fp32(network):
    context = torch.randn(64, 50, 6)
    with torch.inference_mode():
        exact = network.pool_context(context)
        network.pool_in("bf16")
        rough = network.pool_context(context)
    assert rough.dtype == torch.float32
    assert float((rough - exact).abs().max() / exact.abs().max()) < 0.02


def test_pooling_prepared_for_fp32_inference_equals_the_layers(network):
    context = torch.randn(64, 50, 6)
    with torch.inference_mode():
        exact = network.pool_context(context)
        network.pool_in("fp32")
        torch.testing.assert_close(network.pool_context(context), exact, atol=1e-5, rtol=1e-5)


def test_without_context_the_network_needs_points_only():
    network = MCPNetNoContext(5)
    embedding, logits = network(torch.randn(7, 6))
    assert (embedding.shape, logits.shape) == ((7, 50), (7, 5))
    weights_and_biases = (6 + 1) * 200 + (200 + 1) * 50 + (250 + 1) * 200 + (200 + 1) * 5
    assert sum(parameter.numel() for parameter in network.parameters()) == weights_and_biases


def test_training_reaches_every_parameter(network):
    embedding, logits = network(torch.randn(30, 6), torch.randn(30, 10, 6))
    (embedding[:, 0].sum() + logits.square().sum()).backward()
    assert all(np.abs(parameter.grad.numpy()).sum() > 0 for parameter in network.parameters())
