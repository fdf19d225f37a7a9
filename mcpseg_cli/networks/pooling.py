"""Context pooling (III-B) for training on a processor: the backward pass follows only the maxima.

Each of a centre's 200 pooled features comes from one of its 50 context points, so at most 200 of
the 50 x 200 entries of the second layer have a gradient. Two of the three large products of a
training step shrink to a fiftieth.
"""

import numpy as np
import torch
from numba import njit
from numpy.typing import NDArray
from torch import Tensor
from torch.autograd.function import BackwardCFunction, FunctionCtx
from torch.nn import functional

_CENTRES = 32  # at a time: their features on the way stay in a core's cache


class PoolContext(torch.autograd.Function):
    """ReLU of the maximum over each centre's context points, after two linear layers.

    Between the layers is a ReLU, too.
    """

    @staticmethod
    def forward(
        ctx: FunctionCtx,
        context: Tensor,
        weight_1: Tensor,
        bias_1: Tensor,
        weight_2: Tensor,
        bias_2: Tensor,
    ) -> Tensor:
        """Pool (N, K, 6) context points on the CPU into (N, F); see ``MCPNet.pool_context``."""
        num_centres, num_context = context.shape[:2]
        hidden = context.new_empty(num_centres, num_context, len(bias_1))  # (N, K, F)
        pooled = context.new_empty(num_centres, len(bias_2))
        farthest = torch.empty(pooled.shape, dtype=torch.int32)

        # a few centres at a time
        for start in range(0, num_centres, _CENTRES):
            few = slice(start, start + _CENTRES)
            points = functional.linear(context[few].flatten(0, 1), weight_1, bias_1).relu_()
            hidden[few] = points.view_as(hidden[few])
            points = functional.linear(points, weight_2).to(context.dtype)
            _maxima(points.view_as(hidden[few]).numpy(), pooled[few].numpy(), farthest[few].numpy())

        pooled = (pooled + bias_2).relu_()
        ctx.save_for_backward(context, hidden, weight_2, pooled, farthest)
        return pooled

    @staticmethod
    def backward(
        ctx: BackwardCFunction, gradient: Tensor
    ) -> tuple[None, Tensor, Tensor, Tensor, Tensor]:
        """Return the gradients of the four parameters, from (N, F); context points get none."""
        saved: tuple[Tensor, ...] = ctx.saved_tensors
        context, hidden, weight_2, pooled, farthest = saved

        # through the second layer, only where the maxima are
        gradient = (gradient * (pooled > 0)).contiguous()  # (N, F)
        of_hidden = torch.zeros_like(hidden)  # (N, K, F)
        of_weight_2 = torch.zeros_like(weight_2)
        _spread(
            gradient.numpy(), farthest.numpy(), hidden.numpy(), weight_2.detach().numpy(),
            of_hidden.numpy(), of_weight_2.numpy(),
        )  # fmt: skip

        # through the first
        of_hidden = of_hidden.flatten(0, 1)  # (N·K, F)
        of_weight_1, of_bias_1 = of_hidden.T @ context.flatten(0, 1), of_hidden.sum(dim=0)
        return None, of_weight_1, of_bias_1, of_weight_2, gradient.sum(dim=0)


@njit(cache=True, nogil=True)
def _maxima(
    points: NDArray[np.float32], largest: NDArray[np.float32], farthest: NDArray[np.int32]
) -> None:
    """Take the maximum over K of (N, K, F) and which of the K it is, the first of equals."""
    for n in range(points.shape[0]):
        for f in range(points.shape[2]):
            largest[n, f] = points[n, 0, f]
            farthest[n, f] = 0
        for k in range(1, points.shape[1]):
            for f in range(points.shape[2]):
                is_larger = points[n, k, f] > largest[n, f]
                largest[n, f] = points[n, k, f] if is_larger else largest[n, f]
                farthest[n, f] = k if is_larger else farthest[n, f]


@njit(cache=True, nogil=True, fastmath={"contract"})
def _spread(
    gradient: NDArray[np.float32],
    farthest: NDArray[np.int32],
    hidden: NDArray[np.float32],
    weight: NDArray[np.float32],
    of_hidden: NDArray[np.float32],
    of_weight: NDArray[np.float32],
) -> None:
    """Add each entry's gradient to its row of the hidden features, where active, and weights."""
    for n in range(gradient.shape[0]):
        for f in range(gradient.shape[1]):
            g = gradient[n, f]
            if g == 0:
                continue
            k = farthest[n, f]
            for j in range(hidden.shape[2]):
                of_weight[f, j] += g * hidden[n, k, j]
                of_hidden[n, k, j] += g * weight[f, j] if hidden[n, k, j] > 0 else 0 * g
