"""MCPNet (III-B, III-C, figure 3): class and instance branch over points with multi-view context pooling."""

from concurrent.futures import Executor

import torch
from torch import Tensor, nn
from torch.nn import functional

from mcpseg_cli.config import EMBEDDING, HIDDEN, NUM_FEATURES

_TILE_ROWS = 1600  # context points pooled at a time: their 200 features in fp32 fit a 2 MiB cache


class MCPNet(nn.Module):
    """Joint class and instance network, with or without multi-view context pooling.

    Args:
        num_classes: C, classes to tell apart.
        has_context: Whether it pools context points (table I, "Proposed + MCP" against "Proposed").
    """

    def __init__(self, num_classes: int, *, has_context: bool = True) -> None:
        super().__init__()
        self.has_context = has_context
        if has_context:
            self.context_1 = nn.Linear(NUM_FEATURES, HIDDEN)
            self.context_2 = nn.Linear(HIDDEN, HIDDEN)
        self.features = nn.Linear(NUM_FEATURES + HIDDEN * has_context, HIDDEN)
        self.embed = nn.Linear(HIDDEN, EMBEDDING)
        self.hidden = nn.Linear(HIDDEN + EMBEDDING, HIDDEN)
        self.classify = nn.Linear(HIDDEN, num_classes)

    def forward(self, centre: Tensor, context: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Embed and classify one batch.

        Args:
            centre: (N, 6) points around the robot.
            context: (N, K, 6) context points relative to them; None for a network without context.

        Returns:
            (N, E) unit embedding and (N, C) class logits.
        """
        return self.label(centre, None if context is None else self.pool_context(context))

    def pool_context(self, context: Tensor, workers: Executor | None = None) -> Tensor:
        """Multi-view context pooling: two layers on every context point, then the maximum over each centre's points.

        A maximum commutes with adding a bias and with ReLU, so both follow it, exactly. At inference on the
        processor the points pass through in tiles that stay in cache, the same tiles whatever the number of workers.

        Args:
            context: (N, K, 6).
            workers: Threads to share the tiles among; None for this one. Threads that meet once per call stand a busy
                machine far better than operations that each wait for all cores.

        Returns:
            (N, 200) float32.
        """
        if torch.is_grad_enabled() or context.device.type != "cpu":
            return self._pool(context)
        tiles = torch.split(context, max(1, _TILE_ROWS // context.shape[1]))
        return torch.cat(list(map(self._pool_tile, tiles) if workers is None else workers.map(self._pool_tile, tiles)))

    @torch.inference_mode()
    def _pool_tile(self, context: Tensor) -> Tensor:
        return self._pool(context)

    def _pool(self, context: Tensor) -> Tensor:
        weight = self.context_2.weight
        points = context.reshape(-1, NUM_FEATURES).to(weight.dtype)  # (N·K, 6)
        points = functional.relu_(self.context_1(points))  # (N·K, 200)
        points = points @ weight.T
        pooled = points.view(*context.shape[:2], -1).amax(dim=1)  # (N, 200)
        return functional.relu(pooled.float() + self.context_2.bias.float())

    def label(self, centre: Tensor, pooled: Tensor | None) -> tuple[Tensor, Tensor]:
        """Embed and classify one batch whose context is pooled already.

        Args:
            centre: (N, 6).
            pooled: (N, 200) from ``pool_context``; None for a network without context.

        Returns:
            (N, E) unit embedding and (N, C) class logits. The class branch sees how each point differs from the
            maximum over this batch, so the batch is part of the result.
        """
        joined = centre if pooled is None else torch.cat([centre, pooled], dim=1)  # (N, 206)
        features = functional.relu(self.features(joined))  # (N, 200)
        embedding = self.embed(features)  # (N, 50)
        difference = features - features.amax(dim=0)
        hidden = functional.relu(self.hidden(torch.cat([difference, embedding], dim=1)))
        return functional.normalize(embedding, dim=1, eps=1e-6), self.classify(hidden)

    def pool_in(self, dtype: torch.dtype) -> None:
        """Compute context pooling, nine tenths of the work and more, in ``dtype``; the rest stays in float32."""
        if self.has_context:
            self.context_1.to(dtype)
            self.context_2.to(dtype)
