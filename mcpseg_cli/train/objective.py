"""What training makes small, and the scores that say how far it got (III-D)."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from mcpseg_cli.config import TrainSettings
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.sgpn import SGPN
from mcpseg_cli.train.batches import Batch
from mcpseg_cli.train.losses import (
    classification_loss,
    sgpn_confidence_loss,
    sgpn_double_hinge_loss,
    triplet_semihard_loss,
)


@dataclass(frozen=True)
class TensorBatch:
    """One batch on the network's device.

    Attributes:
        centre: (N, 6) float32.
        context: (N, K, 6) float32; None for a network without context.
        semantic: (N,) int64 class index, 255 unknown.
        instance: (N,) int64 object id, 0 none.
    """

    centre: Tensor
    context: Tensor | None
    semantic: Tensor
    instance: Tensor


@dataclass(frozen=True)
class Outcome:
    """What the network made of one batch.

    Attributes:
        losses: (3,) float32 class, instance and confidence loss; 0 where the network has none.
        logits: (N, C) float32.
        embedding: (N, E) float32 of unit length; None for a network without.
    """

    losses: Tensor
    logits: Tensor
    embedding: Tensor | None


class Objective:
    """The weighted sum of a network's losses.

    Args:
        settings: Margin, weights, precision.
        class_weights: (C,) float32: what an error on a point of each class costs; None: all the
            same.
        device: Where the network runs.
    """

    def __init__(
        self, settings: TrainSettings, class_weights: Tensor | None, device: torch.device
    ) -> None:
        self._settings = settings
        self._class_weights = None if class_weights is None else class_weights.to(device)
        weights = (settings.class_weight, settings.instance_weight, settings.confidence_weight)
        self._weights = torch.tensor(weights, device=device)
        self._device = device

    def total(self, outcome: Outcome) -> Tensor:
        """Return the sum that gradients are taken of."""
        return (outcome.losses * self._weights).sum()

    def evaluate(self, network: Network, batch: TensorBatch) -> Outcome:
        """Run a network on one batch and compute its losses; points without an object count in the class loss only."""
        features = confidence = None
        with torch.autocast(
            self._device.type, torch.bfloat16, enabled=self._settings.precision == "bf16"
        ):
            if isinstance(network, SGPN):
                features, logits, confidence = network.branches(batch.centre)
                embedding = torch.nn.functional.normalize(features.float(), dim=-1, eps=1e-6)
            else:
                embedding, logits = network(batch.centre, batch.context)
        logits = logits.float()
        of_class = classification_loss(logits, batch.semantic, self._class_weights)
        of_instance = of_confidence = of_class.new_zeros(())
        has_object = batch.instance > 0
        instance = batch.instance[has_object]
        if embedding is not None and len(instance):
            if features is None or confidence is None:
                embedding = embedding.float()
                of_instance = triplet_semihard_loss(
                    embedding[has_object], instance, self._settings.margin
                )
            else:
                near = features.float()[has_object]
                of_instance = sgpn_double_hinge_loss(near, batch.semantic[has_object], instance)
                of_confidence = sgpn_confidence_loss(confidence.float()[has_object], near, instance)
        return Outcome(torch.stack([of_class, of_instance, of_confidence]), logits, embedding)


def to_tensors(batch: Batch) -> TensorBatch:
    """Copy a batch into torch's own memory, whose alignment does not change from run to run, on the processor."""
    context = None if batch.context is None else torch.tensor(batch.context)
    return TensorBatch(
        torch.tensor(batch.centre),
        context,
        torch.tensor(batch.semantic),
        torch.tensor(batch.instance),
    )


def move_batch(batch: TensorBatch, device: torch.device) -> TensorBatch:
    """Move a batch to the device that the network is on."""
    if device.type == "cpu":
        return batch
    context = None if batch.context is None else batch.context.to(device)
    return TensorBatch(
        batch.centre.to(device), context, batch.semantic.to(device), batch.instance.to(device)
    )
