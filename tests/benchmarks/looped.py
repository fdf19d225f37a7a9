"""Loop a small recording through moving transforms that return: memory and time per scan, flat?

    python -m tests.benchmarks.looped [--scans 200000] [--weights mcpnet]

The whole of ``mcpseg segment``, its checkpoint and its files. Six small scans of a corridor are
moved by whole voxels to twenty places in turn, so that the map stops growing after the first loop;
scans are written just before they are read, and deleted, as are their labelled copies. The last
thousand scans take turns with the second thousand of another such run: whatever else the machine
does meanwhile, it does to both.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from array import array
from pathlib import Path
from time import process_time

import numpy as np
import torch

from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from mcpseg_cli.formats.recording import ScanFile
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.description import find_weights
from mcpseg_cli.networks.weights import load_weights
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
    old, young = [
        Loop(folder / name, clouds, count, weights)
        for name, count in (("old", num_scans), ("young", 2 * WINDOW))
    ]
    with old.run, young.run:
        for number in range(num_scans - WINDOW):
            old.step()
            if (number + 1) % TOLD_EVERY == 0:
                print(json.dumps(old.figures()), flush=True)
        for _ in range(WINDOW):
            young.step()

        # side by side
        for _ in range(WINDOW):
            old.step()
            young.step()
        last, first = (float(np.median(loop.ms[-WINDOW:])) for loop in (old, young))
        both = {"ms_young_old": [round(first, 2), round(last, 2)], "ratio": round(last / first, 3)}
        old.run.write_objects()
        print(json.dumps(old.figures() | {"side_by_side": both} | old.files()))


class Loop:
    """A run over scans that return.

    Args:
        folder: For scans and results.
        clouds: The short recording.
        num_scans: How many there will be.
        weights: Name of bundled weights.

    Attributes:
        ms: Milliseconds of the processor of each scan so far.
        resident: Memory after each, MB.
    """

    def __init__(self, folder: Path, clouds: list[Cloud], num_scans: int, weights: str) -> None:
        (folder / "in").mkdir(parents=True)
        self._clouds, self._out = clouds, folder / "out"
        self._sources = [source_of(folder, number) for number in range(num_scans)]
        self._segmenter = IncrementalSegmenter(load_weights(find_weights(weights)))
        self.run = SegmentRun(self._sources, self._out, self._segmenter, RunOptions())
        self._reports = self.run.run()
        self.ms, self.resident, self._sizes = array("d"), array("d"), array("q")

    def step(self) -> None:
        """Label the next scan."""
        number = len(self.ms)
        write_moved(self._sources[number], self._clouds, number)
        before = process_time()
        report = next(self._reports)
        self.ms.append(1e3 * (process_time() - before))
        self.resident.append(resident_mb())
        self._sizes.append(len(self._segmenter.map))
        self._sources[number].path.unlink()
        (self._out / "scans" / report.name).unlink()

    def figures(self) -> dict[str, object]:
        """Compare scans after the map stopped growing, from the second thousand on, with the last.

        Memory is that of the process, before another run began in it.
        """
        early, late = slice(WINDOW, 2 * WINDOW), slice(-WINDOW, None)
        before_another = slice(-2 * WINDOW, -WINDOW)
        return {
            "scans": len(self.ms),
            "voxels": [self._sizes[WINDOW - 1], self._sizes[-1]],
            "processor_ms_early_late": [
                round(float(np.median(self.ms[part])), 2) for part in (early, late)
            ],
            "resident_mb_early_late": [
                round(float(np.median(self.resident[part])), 1) for part in (early, before_another)
            ],
        }

    def files(self) -> dict[str, float]:
        """Say how large what grows on the disk is."""
        events = (self._out / "events.jsonl").stat().st_size
        state = sum(path.stat().st_size for path in self._out.glob("state.sqlite*"))
        return {"events_mb": round(events / 1e6, 1), "state_mb": round(state / 1e6, 1)}


def source_of(folder: Path, number: int) -> ScanFile:
    """Say where a scan will be, its name and path ready as in a recording that was listed."""
    source = ScanFile(folder / f"in/{number:06d}.ply", pose_of(number))
    assert str(source.path).endswith(source.name)
    return source


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


if __name__ == "__main__":
    main()
