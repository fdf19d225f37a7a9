"""A recording that is written while another program follows it: slowly, in pieces, as robots do."""

import json
import sys
import time
from pathlib import Path

PIECES = 3


def write_growing(
    source: Path, target: Path, rate_hz: float, *, pause_s: float = 0.01
) -> dict[str, float]:
    """Write a recording again, scan by scan, each in pieces with pauses, and its pose behind it.

    Args:
        source: Folder with ``scans/`` and ``poses.csv``.
        target: Folder for the same; ``scans/`` must be there.
        rate_hz: Scans a second.
        pause_s: Between two pieces of a scan.

    Returns:
        When each scan and its pose were complete, in seconds since the epoch, by file name.
    """
    header, *rows = (source / "poses.csv").read_text().splitlines()
    complete = {}
    begun = time.monotonic()
    with (target / "poses.csv").open("a") as poses:
        poses.write(header + "\n")
        for number, row in enumerate(rows):
            time.sleep(max(0.0, begun + number / rate_hz - time.monotonic()))
            name = f"{row.split(',')[0]}.ply"
            _write_in_pieces(source / "scans" / name, target / "scans" / name, pause_s)
            for part in (row[:20], row[20:] + "\n"):
                poses.write(part)
                poses.flush()
            complete[name] = time.time()
    return complete


def _write_in_pieces(source: Path, target: Path, pause_s: float) -> None:
    data = source.read_bytes()
    size = len(data) // PIECES + 1
    with target.open("wb") as file:
        for start in range(0, len(data), size):
            if start:
                time.sleep(pause_s)
            file.write(data[start : start + size])
            file.flush()


if __name__ == "__main__":
    source, target, rate_hz, log = sys.argv[1:]
    complete = write_growing(Path(source), Path(target), float(rate_hz))
    Path(log).write_text(json.dumps(complete))
