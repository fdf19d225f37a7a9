"""What events.jsonl says about the scans of a run: their names and how long each took."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mcpseg_cli.errors import InputError


@dataclass(frozen=True)
class ScanEvent:
    """One line of events.jsonl.

    Attributes:
        name: File name of the scan.
        skipped: Whether it could not be read.
        ms: Milliseconds from reading it to the last output; None where this was not kept.
    """

    name: str
    skipped: bool
    ms: float | None


@dataclass(frozen=True)
class Latency:
    """Milliseconds per scan, reading and writing included.

    Attributes:
        p50: Median.
        p95: 95th percentile.
        max: The slowest.
    """

    p50: float
    p95: float
    max: float


def read_events(path: Path) -> list[ScanEvent]:
    """Read events.jsonl; a last line that is still being written is left out.

    Args:
        path: The file.

    Raises:
        InputError: A line is not one that ``mcpseg segment`` wrote.
        OSError: It cannot be read.
    """
    events = []
    for number, line in enumerate(path.read_text(errors="replace").split("\n")[:-1], start=1):
        try:
            entry = json.loads(line)
            ms = entry.get("ms")
            total = None if ms is None else float(sum(ms.values()))
            events.append(ScanEvent(str(entry["name"]), "skipped" in entry, total))
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            found = f"line {number:,} that is no event"
            raise InputError(path, found, "lines that mcpseg segment wrote", "run it again to mend the file") from error
    return events


def measure_latency(events: list[ScanEvent]) -> Latency | None:
    """Summarise the milliseconds of the scans that have them; None if none has."""
    ms = [event.ms for event in events if event.ms is not None and not event.skipped]
    if not ms:
        return None
    p50, p95, highest = np.percentile(ms, [50, 95, 100])
    return Latency(float(p50), float(p95), float(highest))
