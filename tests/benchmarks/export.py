"""Export a map of millions of voxels: seconds and memory by format.

    python -m tests.benchmarks.export [--voxels 5000000] [--formats laz ply …]

The run is made up: a corridor that winds through the plane, noisy walls, floor and ceiling, a
thousand voxels a scan, written through the checkpoint. Each format is exported in a process of its
own, whose peak memory is its own.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.config import EMBEDDING, SegmentSettings
from mcpseg_cli.incremental.clustering import quantise
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.events import LabelledEvent
from mcpseg_cli.segment.map_changes import MapChanges
from mcpseg_cli.segment.scan_record import NOT_READ, ScanRecord

PER_SCAN = 1000
STEP = 0.6
LANE, LANE_SCANS = 20.0, 500


def make_run(folder: Path, voxels: int) -> None:
    """Write the checkpoint and run.json of a run with so many voxels."""
    folder.mkdir()
    rng = np.random.default_rng(0)
    unit = rng.normal(size=(PER_SCAN, EMBEDDING)).astype(np.float32)
    embedding = quantise(unit / np.linalg.norm(unit, axis=1, keepdims=True))
    (folder / "run.json").write_text(json.dumps({"configuration": {}, "classes": S3DIS_CLASSES}))
    with State(folder / "state.sqlite") as state:
        state.set_configuration({**SegmentSettings().model_dump(mode="json"), "frame": "map"})
        for number in range(-(-voxels // PER_SCAN)):
            lane, place = divmod(number, LANE_SCANS)
            pose = np.eye(4)
            pose[:3, 3] = (place * STEP, lane * LANE, 1.0)
            rows = corridor(pose[:3, 3], number, embedding, rng)
            known = (number + 1) * PER_SCAN
            name = f"{number:06d}.ply"
            merge = np.array([[number * 40 + 40, max(number * 40 - 1, 1)]], np.int32)
            event = LabelledEvent(
                number, name, 2 * PER_SCAN, PER_SCAN, PER_SCAN, 0, known, 40, merge.tolist(), [],
                0, 0, 0.0,
            )  # fmt: skip
            record = ScanRecord(
                name, NOT_READ, pose, 2 * PER_SCAN, known, 0.0, None, event, output_size=1
            )
            state.commit(record, rows, replace(MapChanges.none(), merges=merge))


def corridor(
    robot: np.ndarray, number: int, embedding: np.ndarray, rng: np.random.Generator
) -> MapRows:
    """Make the voxels that one scan adds: floor, ceiling and two walls along one step."""
    # surfaces in turn: floor, ceiling, left wall, right wall
    surface = np.arange(PER_SCAN) % 4
    along, across = rng.uniform(0, STEP, PER_SCAN), rng.uniform(-2.0, 2.0, PER_SCAN)
    height = rng.uniform(0.0, 2.5, PER_SCAN)
    y = np.choose(surface, [across, across, np.full(PER_SCAN, -2.0), np.full(PER_SCAN, 2.0)])
    z = np.choose(surface, [np.zeros(PER_SCAN), np.full(PER_SCAN, 2.5), height, height])
    xyz = np.column_stack([along + robot[0], y + robot[1], z]) + rng.normal(0, 0.004, (PER_SCAN, 3))

    # colours and labels
    grey = np.choose(surface, [90, 220, 160, 170])[:, None] + rng.integers(-10, 10, (PER_SCAN, 3))
    semantic = np.choose(surface, [1, 0, 2, 2]).astype(np.uint8)
    instance = (number * 40 + 1 + rng.integers(0, 40, PER_SCAN)).astype(np.int32)
    confidence = rng.uniform(0.3, 1.0, PER_SCAN).astype(np.float32)
    return MapRows(
        xyz.astype(np.float32), grey.astype(np.uint8), semantic, confidence, instance, embedding
    )


def measure(run: Path, output: Path, color: str) -> None:
    """Export once, in this process; print the figures."""
    from mcpseg_cli.cli import app

    started = perf_counter()
    app(["export", str(run), "-o", str(output), "--color", color, "-q"], standalone_mode=False)
    figures = {
        "seconds": round(perf_counter() - started, 1),
        "peak_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
        "file_mb": round(output.stat().st_size / 1e6, 1),
    }
    print(f"{output.suffix} {color}: {json.dumps(figures)}", flush=True)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--voxels", type=int, default=5_000_000)
    parser.add_argument(
        "--formats", nargs="+", default=["laz", "las", "ply", "pcd", "npz", "h5", "csv", "png"]
    )
    parser.add_argument("--color", default="rgb")
    parser.add_argument("--one", nargs=2, type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        measure(*arguments.one, arguments.color)
        return

    # each format in a process of its own
    with tempfile.TemporaryDirectory() as name:
        run = Path(name) / "out"
        make_run(run, arguments.voxels)
        for suffix in arguments.formats:
            command = [sys.executable, "-m", "tests.benchmarks.export", "--color", arguments.color]
            subprocess.run([*command, "--one", str(run), f"{name}/map.{suffix}"], check=True)


if __name__ == "__main__":
    main()
