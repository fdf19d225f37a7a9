"""Time of the object stage: scan by scan on a building, and a large map put together from nothing.

    python -m tests.benchmarks.objects SHARED [--weights unet] [--voxels 500000]

SHARED is the folder with ``reference/``. The map of the building is repeated side by side until it
is large enough, with its evidence, and all of its objects are found at once. Beside the time that
passed stands that of the processor, which a busy machine changes less.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
import torch

from mcpseg_cli.config import SegmentSettings
from mcpseg_cli.formats.recording import open_recording, read_scan
from mcpseg_cli.incremental.map_objects import make_objects
from mcpseg_cli.incremental.methods import make_labels
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.networks.description import find_weights
from mcpseg_cli.networks.weights import Weights, load_weights


def walk(building: Path, weights: Weights) -> tuple[IncrementalSegmenter, list[float]]:
    """Label the building; give the segmenter and milliseconds of the object stage."""
    segmenter, ms = IncrementalSegmenter(weights, SegmentSettings(floor="scan-min")), []
    for source in open_recording(building / "scans", building / "poses.csv"):
        scan, _ = read_scan(source, "map", segmenter.settings.voxel_size)
        ms.append(segmenter.register_scan(scan).ms["cluster"])
    return segmenter, ms


def put_together(segmenter: IncrementalSegmenter, voxels: int) -> dict[str, float]:
    """Repeat the map and its evidence; find all objects."""
    rows, labels = segmenter.rows(), make_labels(segmenter.method)
    evidence = segmenter._labels.evidence.rows(0, len(rows))
    width = np.ceil(np.ptp(rows.xyz[:, 0]) + 1)
    repeats = -(-voxels // len(rows))
    large = VoxelMap(segmenter.settings.voxel_size)
    for number in range(repeats):
        offset = np.array([number * width, 0, 0], np.float32)
        known = len(large)
        large.insert(rows.xyz + offset, rows.rgb)
        labels.evidence.restore(evidence[: len(large) - known])

    objects = make_objects(segmenter.method, labels)
    embedding = np.zeros((len(large), rows.embedding.shape[1]), np.int16)
    started, cpu_started = perf_counter(), process_time()
    objects.put_all_together(large, embedding)
    return {
        "voxels": len(large),
        "s": round(perf_counter() - started, 2),
        "cpu_s": round(process_time() - cpu_started, 2),
        "objects": objects.num_objects,
    }


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("shared", type=Path)
    parser.add_argument("--weights", default="unet")
    parser.add_argument("--voxels", type=int, default=500_000)
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    weights = load_weights(find_weights(arguments.weights))
    segmenter, ms = walk(arguments.shared / "reference/building", weights)
    segmenter, ms = walk(arguments.shared / "reference/building", weights)
    third = len(ms) // 3
    figures = {
        "p50_ms": round(float(np.percentile(ms, 50)), 2),
        "p95_ms": round(float(np.percentile(ms, 95)), 2),
        "p50_ms_by_third_of_the_scans": [
            round(float(np.median(ms[start : start + third])), 2)
            for start in (0, third, len(ms) - third)
        ],
        "from_nothing": put_together(segmenter, arguments.voxels),
        "load": os.getloadavg(),
    }
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
