"""What events.jsonl says about the scans of a run: their names and how long each took."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.recording import ScanFile
from mcpseg_cli.incremental.segmenter import ScanUpdate


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
            raise InputError(
                path, found, "lines that mcpseg segment wrote", "run it again to mend the file"
            ) from error
    return events


def describe_scan(
    number: int, source: ScanFile, num_points: int, update: ScanUpdate, num_objects: int
) -> str:
    """Describe a scan in one line of JSON: its event."""
    return json.dumps(
        {
            "scan": number,
            "name": source.path.name,
            "points": num_points,
            "points_in_range": int((update.point_ids >= 0).sum()),
            "voxels_new": update.num_new,
            "voxels_seen": update.num_seen,
            "voxels": update.first_new + update.num_new,
            "objects": num_objects,
            "merges": update.merges.tolist(),
            "label_changes": len(update.changed),
            "floor": update.floor,
        }
    )


def is_json(line: str) -> bool:
    """Tell whether a line is a complete JSON document."""
    try:
        json.loads(line)
    except ValueError:
        return False
    return True
