"""What training and the segmenter ask of every network."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from torch import Tensor, nn

from mcpseg_cli.config import BASELINE_BATCH, SIMILARITY


@dataclass(frozen=True)
class NetworkOutput:
    """All that losses are taken of.

    Attributes:
        embedding: (N, E) or (B, N, E) of unit length; None for a network without.
        logits: (N, C) or (B, N, C) class logits.
        features: What was normalised to the embedding, where the losses ask for it (SGPN).
        confidence: (N,) or (B, N) overlap expected of a point's group with its object (SGPN).
    """

    embedding: Tensor | None
    logits: Tensor
    features: Tensor | None = None
    confidence: Tensor | None = None


class Network(nn.Module):
    """A network that labels the points around a robot (tables I to III).

    The attributes are facts of the class: they can be asked without building a network.

    Attributes:
        needs_context: Whether it pools context points; then ``forward`` must be given them.
        has_embedding: Whether it embeds points for clustering; if not, objects are neighbours of
            one class (IV-B).
        batch_size: N, points per batch in the paper's experiments. What a network says about a
            point depends on the other points of its batch.
        similarity: beta, the cosine similarity above which neighbours are one object (IV-B).
    """

    needs_context: bool = False
    has_embedding: bool = False
    batch_size: int = BASELINE_BATCH
    similarity: float = SIMILARITY

    def forward(
        self, centre: Tensor, context: Tensor | None = None
    ) -> tuple[Tensor | None, Tensor]:
        """Embed and classify one batch, or several batches that do not see each other.

        Args:
            centre: (N, 6) or (B, N, 6) points around the robot, from ``context.network_input``.
            context: (N, K, 6) or (B, N, K, 6) context points relative to them; None for a network
                without context.

        Returns:
            (N, E) or (B, N, E) unit embedding, None for a network without; (N, C) or (B, N, C)
            class logits.
        """
        return self.label(centre, None if context is None else self.pool_context(context))

    def outputs(self, centre: Tensor, context: Tensor | None = None) -> NetworkOutput:
        """Do as ``forward`` does, and give everything that the losses of this network need."""
        return NetworkOutput(*self(centre, context))

    def pool_context(self, context: Tensor) -> Tensor:
        """Pool context points; only for networks that need them.

        Args:
            context: (N, K, 6) or (B, N, K, 6).

        Returns:
            (N, F) or (B, N, F) for ``label``.
        """
        raise TypeError(f"{type(self).__name__} takes no context")

    def label(self, centre: Tensor, pooled: Tensor | None = None) -> tuple[Tensor | None, Tensor]:
        """Do as ``forward`` does, with context that is pooled already.

        Args:
            centre: (N, 6) or (B, N, 6).
            pooled: From ``pool_context``; None for a network without context.
        """
        raise NotImplementedError

    def pool_in(self, precision: str) -> None:
        """Make context pooling fast for inference; nothing to do for a network without.

        Args:
            precision: ``bf16`` or ``fp32``.
        """


def initialise(layer: nn.Module) -> None:
    """Draw weights after He et al. (2015), biases 0; for ``Module.apply``. Torch's own let deep stacks fade."""
    if isinstance(layer, nn.Linear | nn.Conv3d):
        nn.init.kaiming_uniform_(layer.weight, nonlinearity="relu")
        assert layer.bias is not None
        nn.init.zeros_(layer.bias)


def perceptron(*widths: int) -> nn.Sequential:
    """Stack linear layers of these widths, a ReLU after each; every point goes through on its own."""
    return nn.Sequential(
        *[layer for pair in pairwise(widths) for layer in (nn.Linear(*pair), nn.ReLU())]
    )
