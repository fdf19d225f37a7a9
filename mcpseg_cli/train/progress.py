"""Where a training is: its epochs so far, and all that changes."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import BaseModel, ConfigDict
from torch import Tensor

from mcpseg_cli.train.scores import Scores


class EpochReport(BaseModel):
    """One epoch.

    Attributes:
        epoch: Its number, from 1.
        learning_rate: At its end.
        seconds: What this process spent on it, validation included.
        train: Means over its batches, as the parameters changed.
        validation: On the held-out data after it; None where none was due.
    """

    model_config = ConfigDict(frozen=True)

    epoch: int
    learning_rate: float
    seconds: float
    train: Scores
    validation: Scores | None


@dataclass(frozen=True)
class TrainState:
    """All that changes while training.

    Attributes:
        step: Steps done of the epoch after those in ``curves``.
        curves: Report of every epoch done.
        best: Epoch of the best weights, from 1; 0: none yet.
        network: Parameters.
        best_network: Parameters after the best epoch; empty where ``best`` is 0.
        optimiser: Moments and step count, by number of the parameter and name.
        sums: Tally of the epoch at hand.
    """

    step: int
    curves: tuple[EpochReport, ...]
    best: int
    network: dict[str, Tensor]
    best_network: dict[str, Tensor]
    optimiser: dict[str, Tensor]
    sums: Tensor


@dataclass(frozen=True)
class Progress:
    """Where training is.

    Attributes:
        epoch: Number of the epoch at hand, from 1.
        step: Steps done of it.
        num_steps: Steps it has.
        scores: Means over its batches so far, in this process.
        finished: The epoch's report, once it is over.
    """

    epoch: int
    step: int
    num_steps: int
    scores: Scores
    finished: EpochReport | None = None
