"""What training and the segmenter ask of every network."""

from itertools import pairwise
from typing import NamedTuple

from torch import Tensor, nn

from mcpseg_cli.networks.description import Traits


class Branches(NamedTuple):
    """All that a network says about a batch, for its losses.

    Attributes:
        embedding: (..., N, E) of unit length; None for a network without.
        logits: (..., N, C) class logits.
        similarity: (..., N, E) features whose squared distances fill SGPN's similarity matrix, not
            normalised; None for all others.
        confidence: (..., N) overlap that SGPN expects of a point's group with its object, 0 to 1;
            None for all others.
    """

    embedding: Tensor | None
    logits: Tensor
    similarity: Tensor | None = None
    confidence: Tensor | None = None


class Network(nn.Module):
    """A network that labels the points around a robot: MCPNet, or one it is compared with.

    Attributes:
        traits: What it is like; every network has its own.
    """

    traits = Traits()

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

    def branches(self, centre: Tensor, context: Tensor | None = None) -> Branches:
        """Do as ``forward`` does, and give what else there is to train."""
        return Branches(*self(centre, context))

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
    """Draw weights after He et al. (2015), biases 0: torch's own let deep stacks fade.

    For ``Module.apply``.
    """
    if isinstance(layer, nn.Linear | nn.Conv3d):
        nn.init.kaiming_uniform_(layer.weight, nonlinearity="relu")
        assert layer.bias is not None
        nn.init.zeros_(layer.bias)


def perceptron(*widths: int) -> nn.Sequential:
    """Stack linear layers of these widths, a ReLU after each; every point goes through alone."""
    return nn.Sequential(
        *[layer for pair in pairwise(widths) for layer in (nn.Linear(*pair), nn.ReLU())]
    )
