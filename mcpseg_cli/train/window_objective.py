"""What the sparse U-Net is to make small: errors about classes, and about what is one object."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from mcpseg_cli.config import TrainSettings
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.unet import UNet, forward_pairs
from mcpseg_cli.train.losses import classification_loss
from mcpseg_cli.train.objective import Tensors, TensorWindows
from mcpseg_cli.train.packing import Packed
from mcpseg_cli.train.scores import Outcome
from mcpseg_cli.train.sources import AnyBatch
from mcpseg_cli.train.windows import WindowBatch

_RAREST = 0.05  # pairs of two objects are rare, but not rarer than this in their weight


class WindowObjective:
    """Cross-entropy of classes plus that of affinities: are two neighbours of one object?

    Args:
        settings: Weights, label smoothing, precision.
        class_weights: (C,) float32: what an error on a voxel of each class costs; None: all alike.
        device: Where the network runs.
    """

    def __init__(
        self, settings: TrainSettings, class_weights: Tensor | None, device: torch.device
    ) -> None:
        self._settings = settings
        self._class_weights = None if class_weights is None else class_weights.to(device)
        self._device = device

    @staticmethod
    def to_tensors(batch: AnyBatch) -> TensorWindows:
        """Copy a batch into torch's own memory, on the processor."""
        assert isinstance(batch, WindowBatch)
        return TensorWindows(
            torch.tensor(batch.inputs),
            batch.levels,
            torch.tensor(batch.semantic),
            torch.tensor(batch.instance),
        )

    def move(self, batch: Tensors | Packed) -> TensorWindows:
        """Move a batch to the device that the network is on."""
        if isinstance(batch, TensorWindows) and self._device.type == "cpu":
            return batch
        packed = batch if isinstance(batch, Packed) else batch.packed()
        return TensorWindows.unpacked(packed, self._device)

    def total(self, outcome: Outcome) -> Tensor:
        """Return the sum that gradients are taken of."""
        weights = (self._settings.class_weight, self._settings.instance_weight, 0.0)
        total: Tensor = (outcome.losses * outcome.losses.new_tensor(weights)).sum()
        return total

    def evaluate(self, network: Network, batch: Tensors) -> Outcome:
        """Run the network on a batch and compute its losses."""
        assert isinstance(network, UNet)
        assert isinstance(batch, TensorWindows)
        is_bf16 = self._settings.precision == "bf16"
        with torch.autocast(self._device.type, torch.bfloat16, enabled=is_bf16):
            output = network(batch.inputs, batch.levels)

        # classes
        of_class = classification_loss(
            output.logits, batch.semantic, self._class_weights, self._settings.label_smoothing
        )

        # affinities of neighbours that have an object each
        one, other = forward_pairs(batch.levels[0].neighbours)
        known = (batch.instance[one] > 0) & (batch.instance[other] > 0)
        one, other = one[known], other[known]
        affinity = network.affinity(output.embedding[one], output.embedding[other])
        same = batch.instance[one] == batch.instance[other]
        of_instance = affinity_loss(affinity, same)

        # right where rare: pairs of two objects
        right = ((affinity.detach() > 0) == same)[~same]
        losses = torch.stack([of_class, of_instance, of_class.new_zeros(())])
        return Outcome(losses, output.logits, right)


def affinity_loss(affinity: Tensor, same: Tensor) -> Tensor:
    """Compute the cross-entropy of affinities; pairs of two objects weigh more, for they are rare.

    Args:
        affinity: (P,) float32 logits.
        same: (P,) bool: of one object.

    Returns:
        The weighted mean; 0, with gradient 0, where there is no pair.
    """
    share = same.float().mean().nan_to_num(0.5).clamp(_RAREST, 1 - _RAREST)
    weight = torch.where(same, 1 / share, 1 / (1 - share)).sqrt()
    errors = functional.binary_cross_entropy_with_logits(affinity, same.float(), reduction="none")
    return (weight * errors).sum() / weight.sum().clamp(min=1e-9)
