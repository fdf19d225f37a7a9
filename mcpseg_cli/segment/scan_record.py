"""A consumed scan, as the checkpoint keeps it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.recording import ScanFile


@dataclass(frozen=True)
class ScanRecord:
    """A consumed scan.

    Attributes:
        name: File name.
        size: Bytes of the file.
        mtime_ns: When the file was last changed.
        sha256: Hash of its content, hex.
        pose: (4, 4) float64, sensor to map.
        num_points: Points in the file; 0 for a skipped scan.
        num_voxels: Voxels in the map after it.
        floor: Floor height after it, metres, map frame.
        error: Why it was skipped, or None.
        event: Its line of events.jsonl.
        output_size: Bytes of its labelled copy.
    """

    name: str
    size: int
    mtime_ns: int
    sha256: str
    pose: NDArray[np.float64]
    num_points: int
    num_voxels: int
    floor: float | None
    error: str | None
    event: str
    output_size: int


def is_unchanged(source: ScanFile, record: ScanRecord) -> bool:
    """Compare pose and content; the content is read again only if size or time of change differ."""
    status = source.path.stat()
    if status.st_size != record.size or not np.array_equal(source.pose, record.pose):
        return False
    return status.st_mtime_ns == record.mtime_ns or fingerprint(source).sha256 == record.sha256


def fingerprint(source: ScanFile) -> ScanRecord:
    """Start the record of a scan with its size, time and hash."""
    status = source.path.stat()
    with source.path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return ScanRecord(
        source.path.name,
        status.st_size,
        status.st_mtime_ns,
        digest,
        source.pose,
        0,
        0,
        None,
        None,
        "",
        0,
    )


def skipped_scan(
    number: int, source: ScanFile, error: InputError | OSError, num_voxels: int, floor: float | None
) -> ScanRecord:
    """Make the record of a scan that cannot be read."""
    event = json.dumps({"scan": number, "name": source.path.name, "skipped": str(error)})
    return ScanRecord(
        source.path.name, 0, 0, "", source.pose, 0, num_voxels, floor, str(error), event, 0
    )
