"""A consumed scan, as the checkpoint keeps it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError, StateError
from mcpseg_cli.formats.fingerprint import Fingerprint
from mcpseg_cli.formats.scan_source import ScanSource, pose_of
from mcpseg_cli.resumable import printable
from mcpseg_cli.segment.events import Event, MergedEvent, SkippedEvent

NOT_READ = Fingerprint(0, 0, "")
"""Stands for the fingerprint of a scan that could not be read."""


@dataclass(frozen=True)
class ScanRecord:
    """A consumed scan.

    Attributes:
        name: Name of the scan.
        file: What its content was.
        pose: (4, 4) float64, sensor to map; NaN for a scan skipped for want of one.
        num_points: Points measured in the file; 0 for a skipped scan.
        num_voxels: Voxels in the map after it.
        floor: Floor height after it, metres, map frame.
        error: Why it was skipped, or None.
        event: What events.jsonl says of it.
        output_size: Bytes of its labelled copy.
    """

    name: str
    file: Fingerprint
    pose: NDArray[np.float64]
    num_points: int
    num_voxels: int
    floor: float | None
    error: str | None
    event: Event
    output_size: int

    @property
    def is_merged(self) -> bool:
        """Whether it was consumed by a map that was merged into this one."""
        return isinstance(self.event, MergedEvent)

    def is_of(self, source: ScanSource) -> bool:
        """Tell whether a scan has still the pose and content that were consumed."""
        return np.array_equal(pose_of(source), self.pose) and source.is_still(self.file)


def skipped_scan(
    number: int,
    source: ScanSource,
    error: InputError | OSError,
    num_voxels: int,
    floor: float | None,
) -> ScanRecord:
    """Make the record of a scan that cannot be read.

    Args:
        number: Its number, from 0.
        source: The scan.
        error: Why.
        num_voxels: Voxels in the map, which it leaves as it is.
        floor: Height of the floor, which it leaves as it is.
    """
    name, reason = source.name, printable(str(error))
    event = SkippedEvent(number, name, reason)
    pose = np.full((4, 4), np.nan) if source.pose is None else source.pose
    return ScanRecord(name, NOT_READ, pose, 0, num_voxels, floor, reason, event, 0)


def check_consumed(
    recording: Sequence[ScanSource], records: list[ScanRecord], state_path: Path
) -> list[ScanSource]:
    """Compare a recording with what was consumed of it.

    Args:
        recording: All scans, in order.
        records: The consumed ones; those of merged maps are passed over.
        state_path: The checkpoint that has them.

    Returns:
        The scans that are still to be consumed.

    Raises:
        StateError: A consumed scan is missing, moved or changed.
    """
    records = [record for record in records if not record.is_merged]
    if len(recording) < len(records):
        raise StateError(
            f"{state_path}: {len(records):,} scans consumed, {len(recording):,} given; "
            "expected all of them; restore the missing scans"
        )

    # consumed scans stay what and where they were; new ones come after
    for source, record in zip(recording, records, strict=False):
        if source.name != record.name:
            raise StateError(
                f"{_place(source)}: stands where {record.name} was consumed; "
                "expected new scans after the consumed ones; rename it"
            )
        if record.error is None and not record.is_of(source):
            raise StateError(
                f"{_place(source)}: changed since it was consumed; "
                "expected the same file and pose; restore it or start again with --overwrite"
            )
    return list(recording[len(records) :])


def _place(source: ScanSource) -> str:
    """Name a scan in messages: its file, and the scan where that is one of several there."""
    is_file = source.path.name == source.name.rpartition("/")[2]
    return str(source.path) if is_file else f"{source.path}: scan {source.name}"
