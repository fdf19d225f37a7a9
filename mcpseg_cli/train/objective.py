"""What training makes small (III-D): the weighted sum of a network's losses on a batch."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from mcpseg_cli.config import TrainSettings
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.sparse import Level
from mcpseg_cli.train.batches import Batch
from mcpseg_cli.train.losses import (
    classification_loss,
    sgpn_confidence_loss,
    sgpn_double_hinge_loss,
    triplet_semihard_loss,
)
from mcpseg_cli.train.packing import Packed, pack, unpack
from mcpseg_cli.train.scores import Outcome, nearest_is_of_same_object
from mcpseg_cli.train.sources import AnyBatch


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

    def packed(self) -> Packed:
        """Put it into one piece of memory."""
        return pack((self.centre, self.context, self.semantic, self.instance))

    @classmethod
    def unpacked(cls, packed: Packed, device: torch.device) -> TensorBatch:
        """Take it apart again, on a device."""
        centre, context, semantic, instance = unpack(packed, device)
        assert centre is not None
        assert semantic is not None
        assert instance is not None
        return cls(centre, context, semantic, instance)


@dataclass(frozen=True)
class TensorWindows:
    """One batch of windows on the network's device; see ``windows.WindowBatch``."""

    inputs: Tensor
    levels: list[Level]
    semantic: Tensor
    instance: Tensor

    def packed(self) -> Packed:
        """Put it into one piece of memory."""
        tables = [table for level in self.levels for table in level.tables()]
        return pack((self.inputs, self.semantic, self.instance, *tables))

    @classmethod
    def unpacked(cls, packed: Packed, device: torch.device) -> TensorWindows:
        """Take it apart again, on a device."""
        inputs, semantic, instance, *tables = unpack(packed, device)
        assert inputs is not None
        assert semantic is not None
        assert instance is not None
        levels = []
        for first in range(0, len(tables), _NUM_TABLES):
            neighbours, *others = tables[first : first + _NUM_TABLES]
            assert neighbours is not None
            levels.append(Level(neighbours, *others))
        return cls(inputs, levels, semantic, instance)


Tensors = TensorBatch | TensorWindows
_NUM_TABLES = 4  # of a level


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

    @staticmethod
    def to_tensors(batch: AnyBatch) -> TensorBatch:
        """Copy a batch into torch's own memory, whose alignment is always the same."""
        assert isinstance(batch, Batch)
        return TensorBatch(
            torch.tensor(batch.centre),
            None if batch.context is None else torch.tensor(batch.context),
            torch.tensor(batch.semantic),
            torch.tensor(batch.instance),
        )

    def move(self, batch: Tensors | Packed) -> TensorBatch:
        """Move a batch to the device that the network is on."""
        if isinstance(batch, TensorBatch) and self._device.type == "cpu":
            return batch
        packed = batch if isinstance(batch, Packed) else batch.packed()
        return TensorBatch.unpacked(packed, self._device)

    def total(self, outcome: Outcome) -> Tensor:
        """Return the sum that gradients are taken of."""
        return (outcome.losses * self._weights).sum()

    def evaluate(self, network: Network, batch: Tensors) -> Outcome:
        """Run a network on one batch and compute its losses.

        Points without an object count in the class loss only.
        """
        assert isinstance(batch, TensorBatch)
        is_bf16 = self._settings.precision == "bf16"
        with torch.autocast(self._device.type, torch.bfloat16, enabled=is_bf16):
            branches = network.branches(batch.centre, batch.context)
        logits = branches.logits.float()
        embedding = None if branches.embedding is None else branches.embedding.float()

        # class branch: cross-entropy (III-C)
        of_class = classification_loss(logits, batch.semantic, self._class_weights)
        of_instance = of_confidence = of_class.new_zeros(())

        # instance branch: triplets (III-C), or SGPN's pairs and their confidence
        has_object = batch.instance > 0
        instance = batch.instance[has_object]
        if branches.similarity is not None and branches.confidence is not None and len(instance):
            near = branches.similarity.float()[has_object]
            confidence = branches.confidence.float()[has_object]
            of_instance = sgpn_double_hinge_loss(near, batch.semantic[has_object], instance)
            of_confidence = sgpn_confidence_loss(confidence, near, instance)
        elif embedding is not None and len(instance):
            margin = self._settings.margin
            of_instance = triplet_semihard_loss(embedding[has_object], instance, margin)

        # points whose neighbour in embedding space is of their object
        is_near = None
        if embedding is not None:
            is_near = nearest_is_of_same_object(embedding.detach()[has_object], instance)
        return Outcome(torch.stack([of_class, of_instance, of_confidence]), logits, is_near)
