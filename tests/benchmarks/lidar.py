"""One hundred synthetic lidar sweeps of 130,000 points: sweeps per second, all inclusive.

    python -m tests.benchmarks.lidar [--range 5] [--weights mcpnet] [--threads 2]

Beside the time that passed stands that of the processor, which a busy machine changes less. A
64-beam spinning lidar drives through a long hall with pillars; sweeps are binary PLY with
intensity and ring.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from pathlib import Path
from time import process_time

import numpy as np
import torch

from mcpseg_cli.config import SegmentSettings
from mcpseg_cli.formats import Cloud, write_cloud
from mcpseg_cli.formats.recording import ScanFile
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.description import find_weights
from mcpseg_cli.networks.weights import load_weights
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions

NUM_SWEEPS = 100
BEAMS, COLUMNS = 64, 2032  # 130,048 points a sweep
HALL = np.array([[-500.0, -6.0, 0.0], [500.0, 6.0, 5.0]])
STEP = 0.5  # metres between sweeps: 5 m/s at 10 Hz


def sweep(number: int) -> tuple[Cloud, np.ndarray]:
    """Cast the rays of one sweep from inside the hall onto its walls and pillars."""
    rng = np.random.default_rng(number)

    # one ray for every beam and column
    robot = np.array([number * STEP - 25.0, 0.3, 1.6])
    elevation = np.deg2rad(np.linspace(-30, 14.9, BEAMS))[:, None]
    azimuth = np.linspace(0, 2 * np.pi, COLUMNS, endpoint=False)[None, :] + 1e-3
    level = np.cos(elevation)
    up = np.sin(elevation) + 0 * azimuth
    rays = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), up], axis=2).reshape(-1, 3)

    # the hall, then pillars of 0.4 m in it
    with np.errstate(divide="ignore"):
        reach = np.where(rays > 0, (HALL[1] - robot) / rays, (HALL[0] - robot) / rays).min(axis=1)
    flat = rays[:, :2]
    length = np.linalg.norm(flat, axis=1)
    for x in np.arange(-40, 60, 5.0):
        for y in (-3.0, 3.0):
            offset = np.array([x, y]) - robot[:2]
            along = (flat @ offset) / np.maximum((flat**2).sum(axis=1), 1e-12)
            apart = np.abs(flat[:, 0] * offset[1] - flat[:, 1] * offset[0]) / length
            hit = (apart < 0.4) & (along > 0)
            reach[hit] = np.minimum(reach[hit], along[hit])

    # a cloud with what a lidar tells besides
    xyz = (robot + rays * (reach + rng.normal(0, 0.01, len(reach)))[:, None]).astype(np.float32)
    columns = {axis: xyz[:, i] for i, axis in enumerate("xyz")}
    columns |= {
        "intensity": rng.random(len(xyz), np.float32),
        "ring": np.repeat(np.arange(BEAMS), COLUMNS).astype(np.uint16),
    }
    pose = np.eye(4)
    pose[:3, 3] = robot
    return Cloud(columns), pose


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--range", type=float, default=5.0)
    parser.add_argument("--weights", default="mcpnet")
    parser.add_argument("--threads", type=int, default=2)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    weights = load_weights(find_weights(arguments.weights))

    with tempfile.TemporaryDirectory() as name:
        recording = []
        for number in range(NUM_SWEEPS):
            cloud, pose = sweep(number)
            path = Path(name) / f"{number:04d}.ply"
            write_cloud(path, cloud)
            recording.append(ScanFile(path, pose))

        # once to warm up
        for output, sources in (("warm", recording[:3]), ("out", recording)):
            segmenter = IncrementalSegmenter(weights, SegmentSettings(local_range=arguments.range))
            with SegmentRun(sources, Path(name) / output, segmenter, RunOptions()) as run:
                started = process_time()
                reports = list(run.run())
                cpu_s = process_time() - started

    ms = np.array([report.ms for report in reports])
    updates = [report.update for report in reports]
    in_range = [(update.point_ids >= 0).sum() for update in updates]
    stages = {
        stage: round(float(np.median([update.ms[stage] for update in updates])), 2)
        for stage in updates[0].ms
    }
    figures = {
        "sweeps_per_second": 1e3 * len(ms) / ms.sum(),
        "median_ms": float(np.median(ms)),
        "p95_ms": float(np.percentile(ms, 95)),
        "cpu_ms": 1e3 * cpu_s / len(ms),
        "points_per_sweep": BEAMS * COLUMNS,
        "points_in_range": float(np.mean(in_range)),
        "new_voxels_per_sweep": float(np.mean([update.num_new for update in updates])),
        "voxels_judged_per_sweep": float(np.mean([len(update.judged) for update in updates])),
        "stages_ms": stages,
        "threads": arguments.threads,
        "load": os.getloadavg(),
    }
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
