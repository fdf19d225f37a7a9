"""What a run keeps in memory of its consumed scans: next to nothing, for it may go on for weeks."""

from __future__ import annotations

from collections.abc import Iterable

from mcpseg_cli.segment.scan_record import ScanRecord


class ScanLog:
    """The consumed scans, counted; all that is known of each is in the checkpoint.

    Args:
        records: Those consumed before, in order.

    Attributes:
        num_voxels: Voxels in the map after the last one.
        floor: Height of the floor after it, metres, map frame; None: not known.
        skipped: Name of each skipped scan, by number.
        errors: Why they were skipped, in order.
    """

    def __init__(self, records: Iterable[ScanRecord] = ()) -> None:
        self._count = 0
        self.num_voxels = 0
        self.floor: float | None = None
        self.skipped: dict[int, str] = {}
        self.errors: list[str] = []
        for record in records:
            self.append(record)

    def append(self, record: ScanRecord) -> None:
        """Count the next scan."""
        if record.error is not None:
            self.skipped[len(self)] = record.name
            self.errors.append(record.error)
        self._count += 1
        self.num_voxels, self.floor = record.num_voxels, record.floor

    def __len__(self) -> int:
        return self._count

    @property
    def num_used(self) -> int:
        """How many were not skipped."""
        return len(self) - len(self.errors)
