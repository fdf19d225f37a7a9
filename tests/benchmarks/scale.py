"""Grow a map to millions of voxels along a corridor: cost per scan, memory, disk, reopening.

    python -m tests.benchmarks.scale [--voxels 5000000] [--weights mcpnet]

Scans come from files and go through the whole of ``mcpseg segment``: read, label, commit, write.
The corridor winds through the plane, so that no part of it is seen twice.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

from mcpseg_cli.config import SegmentSettings
from mcpseg_cli.formats import Cloud, write_cloud
from mcpseg_cli.formats.recording import ScanFile
from mcpseg_cli.incremental.objects import list_objects
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.weights import Weights, find_weights, load_weights
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions

STEP = 1.0  # metres between scans
RANGE = 4.0
LANE = 20.0  # metres between two lanes of the corridor
LANE_SCANS = 1000


def resident_mb() -> float:
    """Resident memory of this process."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


def write_scan(folder: Path, number: int) -> ScanFile:
    """Write a scan: floor, ceiling and two walls from one step ahead of the robot to one behind."""
    rng = np.random.default_rng(number)
    lane, place = divmod(number, LANE_SCANS)
    robot = np.array([place * STEP, lane * LANE, 1.0])

    # points on the four surfaces in turn
    along = rng.uniform(-STEP, STEP, 6000)
    across = rng.uniform(-2.0, 2.0, 6000)
    height = rng.uniform(0.0, 2.5, 6000)
    surface = np.arange(6000) % 4
    y = np.choose(surface, [across, across, np.full(6000, -2.0), np.full(6000, 2.0)])
    z = np.choose(surface, [np.zeros(6000), np.full(6000, 2.5), height, height])
    noise = rng.normal(0, 0.004, (6000, 3))
    xyz = (np.column_stack([along + robot[0], y + robot[1], z]) + noise).astype(np.float32)

    # each surface in its colour
    colour = np.choose(surface, [90, 220, 160, 170])[:, None] + rng.integers(-10, 10, (6000, 3))
    rgb = colour.astype(np.uint8)
    columns = {axis: xyz[:, i] for i, axis in enumerate("xyz")}
    columns |= {name: rgb[:, i] for i, name in enumerate(("red", "green", "blue"))}

    path = folder / f"{number:06d}.ply"
    write_cloud(path, Cloud(columns))
    pose = np.eye(4)
    pose[:3, 3] = robot
    return ScanFile(path, pose)


def open_run(recording: list[ScanFile], output: Path, weights: Weights) -> SegmentRun:
    """Open the run, with a new segmenter."""
    segmenter = IncrementalSegmenter(weights, SegmentSettings(local_range=RANGE))
    return SegmentRun(recording, output, segmenter, RunOptions())


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--voxels", type=int, default=5_000_000)
    parser.add_argument("--weights", default="mcpnet")
    arguments = parser.parse_args()
    weights = load_weights(find_weights(arguments.weights))

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "in").mkdir()

        # how many scans it takes, from the last of sixty
        recording = [write_scan(folder / "in", number) for number in range(60)]
        with open_run(recording, folder / "warm", weights) as run:
            per_scan = [report.update.num_new for report in run.run()][-1]
        needed = arguments.voxels // per_scan + 20
        recording += [write_scan(folder / "in", number) for number in range(60, needed)]
        figures = grow(recording, folder / "out", weights, arguments.voxels)
    print(json.dumps(figures, indent=1))


def grow(
    recording: list[ScanFile], output: Path, weights: Weights, voxels: int
) -> dict[str, float]:
    """Segment the corridor, then open the run again."""
    # until the map is large enough
    ms, sizes, resident = [], [], []
    with open_run(recording, output, weights) as run:
        base = resident_mb()
        for report in run.run():
            ms.append(report.ms)
            sizes.append(len(run.segmenter.map))
            resident.append(resident_mb())
            if sizes[-1] >= voxels:
                break
        started = perf_counter()
        num_objects = len(list_objects(run.segmenter.rows(), weights.info.classes))
        objects_s = perf_counter() - started

    # cost early and late
    at_100k = int(np.searchsorted(sizes, 100_000))
    early = float(np.median(ms[max(0, at_100k - 50) : at_100k + 50]))
    late = float(np.median(ms[-200:]))

    # once more
    started = perf_counter()
    with open_run(recording, output, weights) as run:
        reopen_s = perf_counter() - started
        again = len(run.segmenter.map)
    assert again == sizes[-1]
    on_disk = sum(path.stat().st_size for path in output.glob("state.sqlite*"))
    return {
        "voxels": sizes[-1],
        "scans": len(ms),
        "objects": num_objects,
        "median_ms_at_100k": early,
        "median_ms_at_end": late,
        "ratio": late / early,
        "p95_ms": float(np.percentile(ms[5:], 95)),
        "max_ms": max(ms[5:]),
        "resident_bytes_per_voxel": (resident[-1] - base) * 1e6 / sizes[-1],
        "peak_bytes_per_voxel": (max(resident) - base) * 1e6 / sizes[-1],
        "state_bytes_per_voxel": on_disk / sizes[-1],
        "reopen_s": reopen_s,
        "objects_s": objects_s,
    }


if __name__ == "__main__":
    main()
