"""Grow a map to millions of voxels along a corridor: cost per scan, memory, disk, reopening.

    python -m tests.benchmarks.scale [--voxels 5000000] [--weights mcpnet] [--range 4]

Scans come from files and go through the whole of ``mcpseg segment``: read, label, commit, write.
The corridor winds through the plane, so that no part of it is seen twice. Beside the time that
passed stands that of the processor, which a busy machine changes less.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
import torch

from mcpseg_cli.config import SegmentSettings
from mcpseg_cli.formats import Cloud, write_cloud
from mcpseg_cli.formats.recording import ScanFile
from mcpseg_cli.incremental.objects import list_objects
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.description import find_weights
from mcpseg_cli.networks.weights import Weights, load_weights
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions

STEP = 1.0  # metres between scans
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


def open_run(
    recording: list[ScanFile], output: Path, weights: Weights, local_range: float
) -> SegmentRun:
    """Open the run, with a new segmenter."""
    segmenter = IncrementalSegmenter(weights, SegmentSettings(local_range=local_range))
    return SegmentRun(recording, output, segmenter, RunOptions())


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--voxels", type=int, default=5_000_000)
    parser.add_argument("--weights", default="mcpnet")
    parser.add_argument("--range", type=float, default=4.0)
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    weights = load_weights(find_weights(arguments.weights))

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "in").mkdir()

        # how many scans it takes, from the last of sixty
        recording = [write_scan(folder / "in", number) for number in range(60)]
        with open_run(recording, folder / "warm", weights, arguments.range) as run:
            per_scan = [report.update.num_new for report in run.run()][-1]
        needed = arguments.voxels // per_scan + 20
        recording += [write_scan(folder / "in", number) for number in range(60, needed)]
        figures = grow(recording, folder / "out", weights, arguments.range, arguments.voxels)
    figures["threads"], figures["load"] = arguments.threads, os.getloadavg()
    print(json.dumps(figures, indent=1))


def grow(
    recording: list[ScanFile], output: Path, weights: Weights, local_range: float, voxels: int
) -> dict[str, object]:
    """Segment the corridor, then open the run again."""
    # until the map is large enough
    ms, cpu_ms, stages, sizes, resident = [], [], [], [], []
    with open_run(recording, output, weights, local_range) as run:
        base, before = resident_mb(), process_time()
        for report in run.run():
            ms.append(report.ms)
            cpu_ms.append(1e3 * (process_time() - before))
            before = process_time()
            stages.append(report.update.ms)
            sizes.append(len(run.segmenter.map))
            resident.append(resident_mb())
            if sizes[-1] >= voxels:
                break
        started = perf_counter()
        num_objects = len(list_objects(run.segmenter.rows(), weights.info.classes))
        objects_s = perf_counter() - started

    # cost early and late
    at_100k = int(np.searchsorted(sizes, 100_000))
    early, late = slice(max(0, at_100k - 50), at_100k + 50), slice(-200, None)

    # once more
    started = perf_counter()
    with open_run(recording, output, weights, local_range) as run:
        reopen_s = perf_counter() - started
        again = len(run.segmenter.map)
    assert again == sizes[-1]
    on_disk = sum(path.stat().st_size for path in output.glob("state.sqlite*"))
    return {
        "voxels": sizes[-1],
        "scans": len(ms),
        "objects": num_objects,
        "ms": compare(ms, early, late),
        "cpu_ms": compare(cpu_ms, early, late),
        "stages_ms": {
            name: compare([each[name] for each in stages], early, late) for name in stages[0]
        },
        "p95_ms": float(np.percentile(ms[5:], 95)),
        "max_ms": max(ms[5:]),
        "resident_bytes_per_voxel": (resident[-1] - base) * 1e6 / sizes[-1],
        "peak_bytes_per_voxel": (max(resident) - base) * 1e6 / sizes[-1],
        "state_bytes_per_voxel": on_disk / sizes[-1],
        "reopen_s": reopen_s,
        "objects_s": objects_s,
    }


def compare(ms: list[float], early: slice, late: slice) -> dict[str, float]:
    """Give medians at 100,000 voxels and at the end, and how much larger the later one is."""
    first, last = float(np.median(ms[early])), float(np.median(ms[late]))
    ratio = last / max(first, 1e-9)
    return {"at_100k": round(first, 2), "at_end": round(last, 2), "ratio": round(ratio, 2)}


if __name__ == "__main__":
    main()
