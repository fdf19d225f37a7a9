"""The consumed scans of a run, in some hundred bytes each: a run may go on for weeks."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.segment.scan_record import ScanRecord


@dataclass(frozen=True)
class LoggedScan:
    """What is still known of a consumed scan; all else is in the checkpoint.

    Attributes:
        num_voxels: Voxels in the map after it.
        pose: (4, 4) float64, sensor to map; NaN for a scan skipped for want of one.
        error: Why it was skipped, or None.
    """

    num_voxels: int
    pose: NDArray[np.float64]
    error: str | None


class ScanLog:
    """Consumed scans, in order.

    Args:
        records: Those consumed before.

    Attributes:
        floor: Height of the floor after the last one, metres, map frame; None: not known.
        skipped: Name of each skipped scan, by number.
    """

    def __init__(self, records: Iterable[ScanRecord] = ()) -> None:
        self._num_voxels, self._poses = array("q"), array("d")
        self._errors: dict[int, str] = {}
        self.floor: float | None = None
        self.skipped: dict[int, str] = {}
        for record in records:
            self.append(record)

    def append(self, record: ScanRecord) -> None:
        """Add the next scan."""
        if record.error is not None:
            self._errors[len(self)], self.skipped[len(self)] = record.error, record.name
        self._poses.extend(record.pose[:3].ravel().tolist())
        self._num_voxels.append(record.num_voxels)
        self.floor = record.floor

    def __len__(self) -> int:
        return len(self._num_voxels)

    def __getitem__(self, number: int) -> LoggedScan:
        if not 0 <= number < len(self):
            raise IndexError(number)
        pose = np.eye(4)
        pose[:3] = np.reshape(self._poses[12 * number : 12 * number + 12], (3, 4))
        return LoggedScan(self._num_voxels[number], pose, self._errors.get(number))

    def __iter__(self) -> Iterator[LoggedScan]:
        return map(self.__getitem__, range(len(self)))

    @property
    def num_voxels(self) -> int:
        """Voxels in the map after the last scan."""
        return self._num_voxels[-1] if self._num_voxels else 0

    @property
    def num_used(self) -> int:
        """How many were not skipped."""
        return len(self) - len(self._errors)

    @property
    def errors(self) -> list[str]:
        """Why scans were skipped, in order."""
        return list(self._errors.values())
