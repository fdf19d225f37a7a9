"""What a training reports about batches: losses, accuracy, mIoU."""

from __future__ import annotations

import torch
from pydantic import BaseModel, ConfigDict
from torch import Tensor

from mcpseg_cli.train.losses import UNKNOWN_CLASS
from mcpseg_cli.train.objective import Outcome, TensorBatch

_LOSSES = 3  # class, instance, confidence


class Scores(BaseModel):
    """Means over some batches.

    Attributes:
        loss: The weighted sum that training makes small.
        class_loss: Cross-entropy.
        instance_loss: Triplet loss, or SGPN's double hinge; 0 for a network without embedding.
        accuracy: Share of points of known class that are classified right.
        miou: Mean intersection over union of the classes that occur; None where no class is known.
        embedding_accuracy: Share of points whose nearest neighbour in embedding space, in their
            batch, is of their object; None for a network without embedding.
        iou: Of each class; None for one that does not occur.
    """

    model_config = ConfigDict(frozen=True)

    loss: float
    class_loss: float
    instance_loss: float
    accuracy: float
    miou: float | None
    embedding_accuracy: float | None
    iou: tuple[float | None, ...]


class Tally:
    """Sums over batches that scores are made of, in one float64 tensor on the network's device.

    Args:
        num_classes: C.
        device: Where the network runs.
    """

    def __init__(self, num_classes: int, device: torch.device) -> None:
        self.num_classes = num_classes
        # total loss, losses, batches, points near their object, points that have one; then the
        # confusion matrix
        size = 1 + _LOSSES + 3 + num_classes * (num_classes + 1)
        self.sums = torch.zeros(size, dtype=torch.float64, device=device)

    @torch.no_grad()
    def add(self, outcome: Outcome, total: Tensor, batch: TensorBatch) -> None:
        """Count one batch."""
        sums, classes = self.sums, self.num_classes
        sums[0] += total.detach()
        sums[1 : 1 + _LOSSES] += outcome.losses.detach()
        sums[1 + _LOSSES] += 1

        # points whose neighbour in embedding space is of their object
        if outcome.embedding is not None:
            has_object = batch.instance > 0
            right = nearest_is_of_same_object(
                outcome.embedding.detach()[has_object], batch.instance[has_object]
            )
            sums[2 + _LOSSES] += right.sum()
            sums[3 + _LOSSES] += len(right)

        # true and predicted class; the last row is of unknown ones
        row = batch.semantic.masked_fill(batch.semantic == UNKNOWN_CLASS, classes)
        cell = row * classes + outcome.logits.detach().argmax(dim=-1)
        sums[4 + _LOSSES :].scatter_add_(0, cell, torch.ones_like(cell, dtype=sums.dtype))

    def scores(self) -> Scores:
        """Compute the means; all batches must have been counted that they are to be of."""
        sums = self.sums.cpu()
        batches, near, objects = sums[1 + _LOSSES : 4 + _LOSSES].tolist()
        losses = (sums[: 1 + _LOSSES] / max(batches, 1)).tolist()

        # IoU of the classes that occur
        confusion = sums[4 + _LOSSES :].view(-1, self.num_classes)[:-1]  # true, predicted
        right, true, predicted = confusion.diagonal(), confusion.sum(dim=1), confusion.sum(dim=0)
        iou = (right / (true + predicted - right)).tolist()
        present = [index for index, count in enumerate(true.tolist()) if count]

        return Scores(
            loss=losses[0],
            class_loss=losses[1],
            instance_loss=losses[2],
            accuracy=float(right.sum() / true.sum().clamp(min=1)),
            miou=sum(iou[index] for index in present) / len(present) if present else None,
            embedding_accuracy=near / objects if objects else None,
            iou=tuple(iou[index] if index in present else None for index in range(len(iou))),
        )


def nearest_is_of_same_object(embedding: Tensor, instance: Tensor) -> Tensor:
    """Tell which points' nearest neighbour in embedding space is of their object.

    Args:
        embedding: (N, E) float of unit length.
        instance: (N,) object id.

    Returns:
        (N,) bool; empty for fewer than two points.
    """
    if len(embedding) < 2:
        return torch.zeros(0, dtype=torch.bool, device=instance.device)
    cosine = (embedding @ embedding.T).fill_diagonal_(-torch.inf)  # (N, N)
    return instance[cosine.argmax(dim=1)] == instance
