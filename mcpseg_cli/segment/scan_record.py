"""A consumed scan, as the checkpoint keeps it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError, StateError
from mcpseg_cli.formats.recording import ScanFile
from mcpseg_cli.segment.events import Event, MergedEvent, SkippedEvent


@dataclass(frozen=True)
class Fingerprint:
    """What a file was when it was read.

    Attributes:
        size: Bytes.
        mtime_ns: When it was last changed.
        sha256: Hash of its content, hex.
    """

    size: int
    mtime_ns: int
    sha256: str

    @classmethod
    def of(cls, path: Path) -> Fingerprint:
        """Take the fingerprint of a file."""
        status = path.stat()
        return cls(status.st_size, status.st_mtime_ns, _hash(path))

    def matches(self, path: Path) -> bool:
        """Compare with a file; its content is read only where size and time do not settle it."""
        status = path.stat()
        if status.st_size != self.size:
            return False
        return status.st_mtime_ns == self.mtime_ns or _hash(path) == self.sha256


NOT_READ = Fingerprint(0, 0, "")
"""Stands for the fingerprint of a scan that could not be read."""


def _hash(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True)
class ScanRecord:
    """A consumed scan.

    Attributes:
        name: File name.
        file: What the file was.
        pose: (4, 4) float64, sensor to map.
        num_points: Points in the file; 0 for a skipped scan.
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

    def is_of(self, source: ScanFile) -> bool:
        """Tell whether a scan has still the pose and content that were consumed."""
        return np.array_equal(source.pose, self.pose) and self.file.matches(source.path)


def skipped_scan(
    number: int, source: ScanFile, error: InputError | OSError, num_voxels: int, floor: float | None
) -> ScanRecord:
    """Make the record of a scan that cannot be read.

    Args:
        number: Its number, from 0.
        source: The scan.
        error: Why.
        num_voxels: Voxels in the map, which it leaves as it is.
        floor: Height of the floor, which it leaves as it is.
    """
    name, reason = source.path.name, str(error)
    event = SkippedEvent(number, name, reason)
    return ScanRecord(name, NOT_READ, source.pose, 0, num_voxels, floor, reason, event, 0)


def check_consumed(
    recording: list[ScanFile], records: list[ScanRecord], state_path: Path
) -> list[ScanFile]:
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
        if source.path.name != record.name:
            raise StateError(
                f"{source.path}: stands where {record.name} was consumed; "
                "expected new scans after the consumed ones; rename it"
            )
        if record.error is None and not record.is_of(source):
            raise StateError(
                f"{source.path}: changed since it was consumed; expected the same file and pose; "
                "restore it or start again with --overwrite"
            )
    return recording[len(records) :]
