"""Curves for TensorBoard, which is an extra: ``pip install 'mcpseg[tensorboard]'``."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

from mcpseg_cli.errors import InputError
from mcpseg_cli.train.progress import EpochReport


class TensorBoardLog:
    """Writes the scores of every epoch; a context manager.

    Args:
        folder: Where.
        first_epoch: What an earlier training logged from there on is dropped.

    Raises:
        InputError: TensorBoard is not installed.
    """

    def __init__(self, folder: Path, first_epoch: int) -> None:
        try:
            from torch.utils.tensorboard import SummaryWriter
        except ImportError as error:
            remedy = "pip install 'mcpseg[tensorboard]'"
            raise InputError(
                "--tensorboard", "TensorBoard is not installed", "it", remedy
            ) from error
        self._writer = SummaryWriter(str(folder), purge_step=first_epoch)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._writer.close()

    def add(self, report: EpochReport) -> None:
        """Log one epoch."""
        self._writer.add_scalar("learning_rate", report.learning_rate, report.epoch)
        for name, scores in (("training", report.train), ("held out", report.validation)):
            figures = (
                {} if scores is None else scores.model_dump(exclude_none=True, exclude={"iou"})
            )
            for key, value in figures.items():
                self._writer.add_scalar(f"{key}/{name}", value, report.epoch)
        self._writer.flush()
