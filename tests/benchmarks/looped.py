"""Loop a small recording through moving transforms that return: memory and time per scan, flat?

    python -m tests.benchmarks.looped [--scans 200000] [--weights mcpnet]

The whole of ``mcpseg segment``, its checkpoint and its files. Six small scans of a corridor are
moved by whole voxels to twenty places in turn, so that the map stops growing after the first loop;
scans are written just before they are read, and deleted, as are their labelled copies.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from time import process_time

import numpy as np
import torch

from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from mcpseg_cli.formats.recording import ScanFile
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.weights import find_weights, load_weights
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions
from tests.benchmarks.scale import resident_mb
from tests.recordings import STEP, write_recording

SHORT = 6  # scans of the recording
PLACES = 20
MOVED = 2.4  # metres from place to place
POINTS = 150
WINDOW = 1000  # scans of which medians are taken
TOLD_EVERY = 5000


def main() -> None:
    """Print the figures on the way and at the end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=200_000)
    parser.add_argument("--weights", default="mcpnet")
    options = parser.parse_args()
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scans, _ = write_recording(folder / "short", SHORT)
        clouds = [read_cloud(scans / f"{number:06d}.ply") for number in range(SHORT)]
        run_looped(folder, clouds, options.scans, options.weights)


def run_looped(folder: Path, clouds: list[Cloud], num_scans: int, weights: str) -> None:
    """Label scan after scan."""
    (folder / "in").mkdir()
    sources = [ScanFile(folder / f"in/{number:06d}.ply", pose_of(number))
               for number in range(num_scans)]  # fmt: skip
    segmenter = IncrementalSegmenter(load_weights(find_weights(weights)))
    ms, sizes, resident = [], [], []
    write_moved(sources[0], clouds, 0)
    with SegmentRun(sources, folder / "out", segmenter, RunOptions()) as run:
        before = process_time()
        for number, report in enumerate(run.run()):
            ms.append(1e3 * (process_time() - before))
            sizes.append(len(segmenter.map))
            resident.append(resident_mb())
            sources[number].path.unlink()
            (folder / "out/scans" / report.name).unlink()
            if number + 1 < num_scans:
                write_moved(sources[number + 1], clouds, number + 1)
            if (number + 1) % TOLD_EVERY == 0:
                print(json.dumps(figures(ms, sizes, resident)), flush=True)
            before = process_time()
        run.write_objects()
        events = (folder / "out/events.jsonl").stat().st_size
        state = sum(path.stat().st_size for path in (folder / "out").glob("state.sqlite*"))
        more = {"events_mb": round(events / 1e6, 1), "state_mb": round(state / 1e6, 1)}
        print(json.dumps(figures(ms, sizes, resident) | more))


def pose_of(number: int) -> np.ndarray:
    """Where the sensor is at a scan: (4, 4)."""
    pose = np.eye(4)
    pose[:3, 3] = STEP * (number % SHORT) + MOVED * (number // SHORT % PLACES), 0.0, 0.5
    return pose


def write_moved(source: ScanFile, clouds: list[Cloud], number: int) -> None:
    """Write a scan of the short recording, moved to where it is its turn."""
    columns = {
        name: values[:: len(values) // POINTS]
        for name, values in clouds[number % SHORT].columns.items()
    }
    moved = columns["x"].astype(np.float64) + MOVED * (number // SHORT % PLACES)
    write_cloud(source.path, Cloud(columns | {"x": moved.astype(np.float32)}))


def figures(ms: list[float], sizes: list[int], resident: list[float]) -> dict[str, object]:
    """Compare scans after the map stopped growing, from the second thousand on, with the last."""
    early, late = slice(WINDOW, 2 * WINDOW), slice(-WINDOW, None)
    first, last = float(np.median(ms[early])), float(np.median(ms[late]))
    return {
        "scans": len(ms),
        "voxels": [sizes[min(WINDOW, len(sizes)) - 1], sizes[-1]],
        "processor_ms_early_late": [round(first, 2), round(last, 2)],
        "ratio": round(last / first, 3),
        "resident_mb_early_late": [
            round(float(np.median(resident[early])), 1), round(float(np.median(resident[late])), 1)
        ],
    }  # fmt: skip


if __name__ == "__main__":
    main()
