"""The context pooling of training against torch's own gradients."""

import pytest
import torch
from torch.nn import functional

from mcpseg_cli.networks.mcpnet import MCPNet
from mcpseg_cli.networks.pooling import PoolContext


def plain_pooling(context, weight_1, bias_1, weight_2, bias_2):
    """The slow twin: every layer in full, gradients by torch."""
    points = functional.linear(
        functional.linear(context, weight_1, bias_1).relu(), weight_2, bias_2
    )
    return points.amax(dim=1).relu()


def random_layers(num_centres=5, num_context=7, width=6, dtype=torch.float64):
    torch.manual_seed(3)
    shapes = ((num_centres, num_context, 6), (width, 6), (width,), (width, width), (width,))
    values = [torch.randn(shape, dtype=dtype) for shape in shapes]
    return [value.requires_grad_(index > 0) for index, value in enumerate(values)]


def test_gradients_equal_finite_differences():
    assert torch.autograd.gradcheck(PoolContext.apply, random_layers())


@pytest.mark.parametrize("num_centres", [1, 31, 32, 33, 70])
def test_output_and_gradients_equal_those_of_the_plain_layers(num_centres):
    layers = random_layers(num_centres, width=20)
    slope = torch.randn(num_centres, 20, dtype=torch.float64)
    results = []
    for pooling in (plain_pooling, PoolContext.apply):
        output = pooling(*layers)
        results.append([output, *torch.autograd.grad((output * slope).sum(), layers[1:])])
    for plain, ours in zip(*results, strict=True):
        torch.testing.assert_close(ours, plain)


def test_context_points_that_repeat_get_the_gradient_of_one():
    layers = random_layers()
    layers[0] = layers[0][:, [0, 0, 0, 1, 1, 2, 2]]
    poolings = (plain_pooling, PoolContext.apply)
    results = [torch.autograd.grad(pooling(*layers).sum(), layers[1:]) for pooling in poolings]
    for plain, ours in zip(*results, strict=True):
        torch.testing.assert_close(ours, plain)


def test_mcpnet_gives_the_same_with_and_without_gradients():
    torch.manual_seed(0)
    network, context = MCPNet(13), torch.randn(64, 50, 6)
    with torch.no_grad():
        expected = network.pool_context(context)
    torch.testing.assert_close(network.pool_context(context), expected, rtol=1e-5, atol=1e-6)


def test_autocast_stays_near_float32():
    torch.manual_seed(0)
    network, context = MCPNet(13), torch.randn(64, 50, 6)
    exact = network.pool_context(context)
    with torch.autocast("cpu", torch.bfloat16):
        rough = network.pool_context(context)
    assert rough.dtype == torch.float32
    assert (rough - exact).detach().abs().max() < 0.03 * exact.detach().abs().max()
