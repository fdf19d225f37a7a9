"""What training draws from: batches of points, or of windows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

from mcpseg_cli.train.batches import Batch
from mcpseg_cli.train.windows import WindowBatch

AnyBatch = Batch | WindowBatch


class Batches(Protocol):
    """Where batches come from: ``batches.BatchSource`` or ``windows.WindowSource``."""

    def __len__(self) -> int:
        """Count the batches of an epoch."""

    def batch(self, number: int, position: int) -> AnyBatch:
        """Draw the batch at a place in an epoch; nothing else decides what it is."""

    def epoch(
        self, number: int, *, rank: int = 0, world: int = 1, start: int = 0
    ) -> Iterator[AnyBatch]:
        """Yield every ``world``-th batch of an epoch.

        From number ``rank`` on, without the first ``start`` of these.
        """
