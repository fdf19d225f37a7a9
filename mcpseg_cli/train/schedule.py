"""How fast to learn, and what an error costs."""

from __future__ import annotations

import math
from itertools import islice

import numpy as np
import torch
from torch import Tensor

from mcpseg_cli.config import TrainSettings
from mcpseg_cli.train.sources import Batches


def learning_rate(step: int, steps_per_epoch: int, settings: TrainSettings) -> float:
    """Compute the learning rate of a step, counted from 0 over the whole run.

    Args:
        step: Steps before it.
        steps_per_epoch: Steps of an epoch.
        settings: Peak, warm-up and schedule.

    Returns:
        The peak; less during the warm-up, which is linear; a half cosine down to 0 after it, if
        that is the schedule.
    """
    warm_up = settings.warm_up * steps_per_epoch
    if step < warm_up:
        return settings.learning_rate * (step + 1) / (warm_up + 1)
    if settings.schedule == "constant":
        return settings.learning_rate
    share = (step - warm_up) / max(settings.epochs * steps_per_epoch - warm_up, 1)
    return settings.learning_rate * (1 + math.cos(math.pi * share)) / 2


def balance(
    batches: Batches, num_classes: int, max_batches: int = 200, enough: int = 3_000_000
) -> Tensor:
    """Weight classes by the inverse root of how often they occur.

    The mean of the weights, by how often classes occur, is 1.

    Args:
        batches: To count in: the first of epoch 0.
        num_classes: C.
        max_batches: How many at most.
        enough: Points after which the frequencies are known well, and no more are counted.

    Returns:
        (C,) float32; classes that do not occur weigh 1.
    """
    counts = np.zeros(num_classes)
    for batch in islice(batches.epoch(0), max_batches):
        counts += np.bincount(batch.semantic[batch.semantic < num_classes], minlength=num_classes)
        if counts.sum() >= enough:
            break
    weights = np.where(counts > 0, 1 / np.sqrt(np.maximum(counts, 1)), 0.0)
    total = (weights * counts).sum()
    weights = np.where(counts > 0, weights * counts.sum() / max(total, 1e-12), 1.0)
    return torch.from_numpy(weights.astype(np.float32))
