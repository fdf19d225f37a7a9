"""Time per scan on the reference building, all inclusive, and of the network stage alone.

    python -m tests.benchmarks.segment SHARED [--threads 2] [--repeat 3] [--weights unet]

SHARED is the folder with ``reference/``. Every scan is read, labelled, committed and written;
nothing is left out. Without ``--weights``, the authors' are taken, and the network stage is timed
at 256 new points in fp32 and bf16, beside the two matrix products that bound it.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np
import torch

from mcpseg_cli.config import SegmentSettings
from mcpseg_cli.formats.poses import read_poses
from mcpseg_cli.formats.recording import open_recording, read_scan
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.description import find_weights
from mcpseg_cli.networks.device import one_thread_per_operation
from mcpseg_cli.networks.tensor_bundle import import_checkpoint
from mcpseg_cli.networks.weights import Weights, load_weights, save_weights
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions


def run_building(
    building: Path, weights: Weights, precision: str, num_scans: int | None = None
) -> dict[str, list[float]]:
    """Segment the building once; milliseconds of every scan, in all and by stage."""
    recording = open_recording(building / "scans", building / "poses.csv")[:num_scans]
    settings = SegmentSettings(floor="scan-min")
    segmenter = IncrementalSegmenter(weights, settings, precision=precision)

    ms: dict[str, list[float]] = {"total": []}
    with (
        tempfile.TemporaryDirectory() as folder,
        SegmentRun(recording, Path(folder) / "out", segmenter, RunOptions()) as run,
    ):
        for report in run.run():
            ms["total"].append(report.ms)
            for stage, value in report.update.ms.items():
                ms.setdefault(stage, []).append(value)
    return ms


def median_ms(function, repeat: int = 200) -> float:
    times = []
    for _ in range(repeat):
        started = perf_counter()
        function()
        times.append(1e3 * (perf_counter() - started))
    return float(np.median(times))


@torch.inference_mode()
def network_stage(weights: Weights, building: Path) -> dict[str, float]:
    """Milliseconds of the network stage at 256 new voxels, and of its two large products alone."""
    figures = {}
    rng = np.random.default_rng(0)
    for name, dtype in (("fp32", torch.float32), ("bf16", torch.bfloat16)):
        segmenter = IncrementalSegmenter(weights, SegmentSettings(floor="scan-min"), precision=name)
        for source in open_recording(building / "scans", building / "poses.csv")[:40]:
            segmenter.register_scan(read_scan(source, "map", 0.1)[0])

        # the products alone
        points, layer = torch.randn(12800, 6, dtype=dtype), torch.randn(6, 200, dtype=dtype)
        hidden, square = torch.randn(12800, 200, dtype=dtype), torch.randn(200, 200, dtype=dtype)
        figures[f"{name} products alone"] = median_ms(
            lambda a=points, b=layer, c=hidden, d=square: (a @ b, c @ d)
        )

        # the whole stage
        last = np.arange(len(segmenter.map) - 256, len(segmenter.map), dtype=np.int32)
        inputs = (segmenter.map, rng.permutation(last), source.pose[:3, 3], 0.0, rng)
        with one_thread_per_operation():
            figures[f"{name} stage"] = median_ms(
                lambda run=segmenter.method._run_batches, inputs=inputs: run(*inputs)
            )
    return figures


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("shared", type=Path)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--weights", help="a file, or the name of bundled weights")
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    reference = arguments.shared / "reference"
    building = reference / "building"

    # the authors' weights, or others
    if arguments.weights:
        weights = load_weights(find_weights(arguments.weights))
    else:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "area5.safetensors"
            checkpoint = reference / "checkpoints/mcpnet_model_s3dis_5.ckpt"
            save_weights(path, *import_checkpoint(checkpoint))
            weights = load_weights(path)

    # compile the kernels first
    run_building(building, weights, "fp32", 5)
    poses = len(read_poses(building / "poses.csv"))
    figures: dict[str, object] = {"scans": poses, "threads": arguments.threads}
    if not arguments.weights:
        figures["network_ms_at_256"] = network_stage(weights, building)

    # the fastest of some runs
    for precision in ("fp32", "bf16"):
        runs = [run_building(building, weights, precision) for _ in range(arguments.repeat)]
        best = min(runs, key=lambda run: np.median(run["total"]))
        figures[precision] = {
            "median_ms": [round(float(np.median(run["total"])), 2) for run in runs],
            "p95_ms": [round(float(np.percentile(run["total"], 95)), 2) for run in runs],
            "stages_ms": {name: round(float(np.median(ms)), 2) for name, ms in best.items()},
        }
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
