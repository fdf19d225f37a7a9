"""MCPNet (III-B, III-C, figure 3): class and instance branch, multi-view context pooling."""

import torch
from torch import Tensor, nn
from torch.nn import functional

from mcpseg_cli.config import EMBEDDING, HIDDEN, NUM_FEATURES
from mcpseg_cli.networks.description import TRAITS
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.pooling import PoolContext


class MCPNet(Network):
    """Joint class and instance network with multi-view context pooling (table I, "Proposed + MCP").

    Args:
        num_classes: C, classes to tell apart.
    """

    traits = TRAITS["mcpnet"]

    def __init__(self, num_classes: int) -> None:
        super().__init__()
        self._pools_in_onednn = False
        if self.traits.needs_context:
            self.context_1 = nn.Linear(NUM_FEATURES, HIDDEN)
            self.context_2 = nn.Linear(HIDDEN, HIDDEN)
        self.features = nn.Linear(NUM_FEATURES + HIDDEN * self.traits.needs_context, HIDDEN)
        self.embed = nn.Linear(HIDDEN, EMBEDDING)
        self.hidden = nn.Linear(HIDDEN + EMBEDDING, HIDDEN)
        self.classify = nn.Linear(HIDDEN, num_classes)

    def pool_context(self, context: Tensor) -> Tensor:
        """Multi-view context pooling: two layers, then the maximum over each centre's points.

        A maximum commutes with ReLU, which therefore follows it, exactly. Each of the N x K points
        has 200 features on the way: on a processor, give few enough centres at a time that these
        stay in its cache.

        Args:
            context: (N, K, 6) or (B, N, K, 6).

        Returns:
            (N, 200) or (B, N, 200) float32.
        """
        # training on a processor
        if torch.is_grad_enabled() and context.device.type == "cpu" and context.dim() == 3:
            first, second = self.context_1, self.context_2
            layers = (first.weight, first.bias, second.weight, second.bias)
            maxima: Tensor = PoolContext.apply(context, *layers)  # type: ignore[no-untyped-call]
            return maxima

        # two layers on every context point
        points = context.reshape(-1, NUM_FEATURES)  # (N·K, 6)
        in_onednn = self._pools_in_onednn
        points = points.to_mkldnn() if in_onednn else points.to(self.context_1.weight.dtype)
        points = self.context_2(self.context_1(points).relu_())  # (N·K, 200)
        points = points.to_dense() if in_onednn else points

        # maximum over each centre's points
        pooled: Tensor = points.view(*context.shape[:-1], -1).amax(dim=-2)
        return pooled.relu().float()  # (N, 200)

    def label(self, centre: Tensor, pooled: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Embed and classify one batch whose context is pooled already, or several.

        Args:
            centre: (N, 6) or (B, N, 6).
            pooled: (N, 200) or (B, N, 200) from ``pool_context``; None for a network without
                context.

        Returns:
            (..., N, E) unit embedding and (..., N, C) class logits. The class branch sees how each
            point differs from the maximum over this batch, so the batch is part of the result.
        """
        joined = centre if pooled is None else torch.cat([centre, pooled], dim=-1)  # (N, 206)
        features = functional.relu(self.features(joined))  # (N, 200)

        # instance branch, then class branch
        embedding = self.embed(features)  # (N, 50)
        difference = features - features.amax(dim=-2, keepdim=True)
        hidden = functional.relu(self.hidden(torch.cat([difference, embedding], dim=-1)))
        return functional.normalize(embedding, dim=-1, eps=1e-6), self.classify(hidden)

    def pool_in(self, precision: str) -> None:
        """Make context pooling, nine tenths of the work and more, fast for inference.

        Args:
            precision: ``bf16``, or ``fp32``: then, on a processor, through oneDNN, whose products
                of this shape took half the time of torch's default (MKL) on the AMD processor this
                was measured on.
        """
        if not self.traits.needs_context:
            return
        if precision == "bf16":
            self.context_1.to(torch.bfloat16)
            self.context_2.to(torch.bfloat16)
            return

        has_onednn = torch.backends.mkldnn.is_available()  # type: ignore[no-untyped-call]
        if has_onednn and self.context_1.weight.device.type == "cpu":
            for layer in (self.context_1, self.context_2):
                _to_onednn(layer)
            self._pools_in_onednn = True


def _to_onednn(layer: nn.Linear) -> None:
    """Lay the parameters of a layer out as oneDNN has them; it then takes tensors of that kind."""
    for name, values in list(layer.named_parameters()):
        delattr(layer, name)
        layer.register_buffer(name, values.detach().to_mkldnn())


class MCPNetNoContext(MCPNet):
    """MCPNet that sees each point without its context (table I, "Proposed")."""

    traits = TRAITS["mcpnet-nocontext"]
