"""Confidence that means something: a temperature fitted on held-out windows (Guo et al. 2017)."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict
from scipy.optimize import minimize_scalar
from scipy.special import log_softmax

from mcpseg_cli.config import TrainSettings
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.unet import UNet
from mcpseg_cli.reliability import measure_reliability
from mcpseg_cli.train.losses import UNKNOWN_CLASS
from mcpseg_cli.train.sources import Batches
from mcpseg_cli.train.window_objective import WindowObjective

MOST_BATCHES = 100
"""Held-out batches that a temperature is fitted on: some hundred thousand voxels."""

_NUM_BINS = 10  # of the table in the card
_LARGEST = 10.0  # temperatures are sought from its inverse to this


class Bin(BaseModel):
    """The voxels of one bin over confidence.

    Attributes:
        up_to: Its upper border.
        voxels: How many.
        confidence: Their mean confidence; None in an empty bin.
        accuracy: Share of them that are right; None in an empty bin.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    up_to: float
    voxels: int
    confidence: float | None
    accuracy: float | None


class Calibration(BaseModel):
    """How well confidence tells the share that is right, on held-out windows.

    Attributes:
        temperature: What logits are divided by.
        voxels: Of known class, that it is fitted on.
        error_before: Expected calibration error at temperature 1.
        error: That at this temperature, on the same voxels.
        bins: Ten, of equal width, at this temperature.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    temperature: float
    voxels: int
    error_before: float
    error: float
    bins: tuple[Bin, ...]


def calibrate(
    network: Network, held_out: Batches, device: torch.device, most_batches: int = MOST_BATCHES
) -> Calibration | None:
    """Fit the temperature of a network that sees windows; nothing in it is random.

    Args:
        network: In evaluation mode, on ``device``.
        held_out: Windows that it has not learned from.
        device: Where the network runs.
        most_batches: How many of them at most.

    Returns:
        The temperature, and what it does; None for a network that does not see windows, whose
        confidence stays as the paper has it, and where no voxel has a class.
    """
    if not isinstance(network, UNet):
        return None
    parts = list(islice(_judge(network, held_out, device), most_batches))
    logits = np.concatenate([logits for logits, _ in parts])
    labels = np.concatenate([labels for _, labels in parts])
    return calibration_of(logits, labels) if len(labels) else None


def calibration_of(logits: NDArray[np.float32], labels: NDArray[np.int64]) -> Calibration:
    """Fit a temperature and measure what it does.

    Args:
        logits: (N, C) float32.
        labels: (N,) int64 true classes; N is at least 1.
    """
    temperature = fit_temperature(logits, labels)
    is_right = logits.argmax(axis=1) == labels
    before = measure_reliability(_confidence(logits, 1.0), is_right, _NUM_BINS)
    after = measure_reliability(_confidence(logits, temperature), is_right, _NUM_BINS)
    means = zip(after.count, after.mean_confidence, after.accuracy, strict=True)
    return Calibration(
        temperature=temperature,
        voxels=len(labels),
        error_before=before.expected_error or 0.0,
        error=after.expected_error or 0.0,
        bins=tuple(
            Bin(
                up_to=(number + 1) / _NUM_BINS,
                voxels=int(count),
                confidence=float(confidence) if count else None,
                accuracy=float(accuracy) if count else None,
            )
            for number, (count, confidence, accuracy) in enumerate(means)
        ),
    )


def fit_temperature(logits: NDArray[np.float32], labels: NDArray[np.int64]) -> float:
    """Find what logits are best divided by: the mean log-likelihood of the labels is highest.

    Args:
        logits: (N, C) float32.
        labels: (N,) int64 true classes; N is at least 1.

    Returns:
        A temperature of 0.1 to 10, to four digits.
    """
    rows = np.arange(len(labels))

    def loss(log_temperature: float) -> float:
        scaled = logits / np.float32(np.exp(log_temperature))
        return -float(log_softmax(scaled, axis=1)[rows, labels].mean(dtype=np.float64))

    farthest = float(np.log(_LARGEST))
    found = minimize_scalar(loss, bounds=(-farthest, farthest), method="bounded")
    return float(f"{np.exp(found.x):.4g}")


@torch.inference_mode()
def _judge(
    network: UNet, held_out: Batches, device: torch.device
) -> Iterator[tuple[NDArray[np.float32], NDArray[np.int64]]]:
    """Yield logits and true classes of the voxels of known class, batch by batch."""
    objective = WindowObjective(TrainSettings(), None, device)
    for batch in held_out.epoch(0):
        windows = objective.move(objective.to_tensors(batch))
        logits = network(windows.inputs, windows.levels).logits.float()
        known = windows.semantic != UNKNOWN_CLASS
        yield logits[known].cpu().numpy(), windows.semantic[known].cpu().numpy()


def _confidence(logits: NDArray[np.float32], temperature: float) -> NDArray[np.float32]:
    """Give (N,) float32 the probability of the likeliest class."""
    scaled = logits / np.float32(temperature)
    confidence: NDArray[np.float32] = np.exp(log_softmax(scaled, axis=1).max(axis=1))
    return confidence
