"""Walk along a hall without end with --keep-near: resident memory and cost per scan, map growing.

    python -m tests.benchmarks.endless [--voxels 20000000] [--keep-near 30]

The whole of ``mcpseg segment`` but for the network: what it would say is told at once, by surface,
so that only the map is measured. Scans are written just before they are read, and deleted.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from time import process_time

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.config import EMBEDDING, SegmentSettings
from mcpseg_cli.formats import Cloud, write_cloud
from mcpseg_cli.formats.recording import ScanFile
from mcpseg_cli.incremental.column import IN_MEMORY
from mcpseg_cli.incremental.evidence import Look
from mcpseg_cli.incremental.room_network import RoomNetwork
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.networks.description import find_weights
from mcpseg_cli.networks.weights import load_weights
from mcpseg_cli.segment.paging import PagedMemory
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions
from tests.benchmarks.scale import resident_mb

STEP = 3.0  # metres between scans
RANGE = 3.4
LANE = 12.0  # metres between two lanes of the hall
LANE_SCANS = 500
TOLD_EVERY = 1_000_000  # voxels


class ToldBySurface(RoomNetwork):
    """Says what stands in the colour of a voxel: its class; those of one class belong together."""

    def look(
        self,
        voxels: VoxelMap,
        ids: NDArray[np.int32],
        looks: NDArray[np.uint16],
        position: NDArray[np.float64],
        floor: float,
        number: int,
        rng: np.random.Generator,
    ) -> tuple[Look, NDArray[np.int16]]:
        """Judge voxels; see ``RoomNetwork``."""
        owner = voxels.rgb[ids, 0].astype(np.int64)
        probability = np.full((len(ids), len(S3DIS_CLASSES)), 0.01, np.float32)
        probability[np.arange(len(ids)), owner % len(S3DIS_CLASSES)] = 0.88
        other = voxels.neighbours(ids)[:, 13:]
        is_same = voxels.rgb[other, 0] == owner[:, None]
        affinity = np.where(other < 0, np.nan, np.where(is_same, 0.95, 0.05)).astype(np.float32)
        weight = np.full(len(ids), 0.5, np.float32)
        return Look(ids, probability, weight, affinity), np.zeros((len(ids), EMBEDDING), np.int16)


def write_scan(folder: Path, number: int) -> ScanFile:
    """Write a scan: floor, ceiling, walls in panels of six metres, a point a voxel."""
    rng = np.random.default_rng(number)
    lane, place = divmod(number, LANE_SCANS)
    along = np.arange(round(place * STEP * 10) - 34, round(place * STEP * 10) + 35)
    across, height = np.arange(-30, 31), np.arange(1, 28)
    flat = np.stack(np.meshgrid(along, across, [0, 28], indexing="ij"), axis=-1).reshape(-1, 3)
    wall = np.stack(np.meshgrid(along, [-30, 30], height, indexing="ij"), axis=-1).reshape(-1, 3)
    voxel = np.concatenate([flat, wall])

    # which surface, as a colour
    panel = (np.floor_divide(voxel[:, 0], 60) % 4) * 4
    surface = np.concatenate([flat[:, 2] // 28, 2 + wall[:, 1] // 31 % 2])
    rgb = np.stack([surface + panel, 40 * surface, 10 * panel], axis=1).astype(np.uint8)
    xyz = voxel * 0.1 + rng.uniform(-0.03, 0.03, voxel.shape) + (0, lane * LANE, 0)
    columns = {axis: xyz[:, i].astype(np.float32) for i, axis in enumerate("xyz")}
    columns |= {name: rgb[:, i] for i, name in enumerate(("red", "green", "blue"))}
    source = scan_file(folder, number)
    write_cloud(source.path, Cloud(columns))
    return source


def scan_file(folder: Path, number: int) -> ScanFile:
    """Say where a scan will be, and its pose."""
    lane, place = divmod(number, LANE_SCANS)
    pose = np.eye(4)
    pose[:3, 3] = place * STEP, lane * LANE, 1.0
    return ScanFile(folder / f"{number:06d}.ply", pose)


def walk(folder: Path, voxels: int, keep_near: float | None) -> dict[str, object]:
    """Walk until the map is as large as asked for."""
    weights, scans = load_weights(find_weights("unet")), folder / "in"
    scans.mkdir(parents=True)
    memory = IN_MEMORY if keep_near is None else PagedMemory(folder, keep_near)
    settings = SegmentSettings(local_range=RANGE, floor=0.0)
    segmenter = IncrementalSegmenter(weights, settings, memory=memory)
    segmenter._labels._looker = ToldBySurface(weights, segmenter.settings)  # type: ignore[attr-defined]

    write_scan(scans, 0)
    recording = [scan_file(scans, number) for number in range(voxels // 3000)]
    ms, resident, told = [], [], 0
    with SegmentRun(recording, folder / "out", segmenter, RunOptions()) as run:
        before = process_time()
        for number, report in enumerate(run.run()):
            ms.append((report.ms, 1e3 * (process_time() - before)))
            resident.append(resident_mb())
            (scans / report.name).unlink()
            (folder / "out" / "scans" / report.name).unlink()
            write_scan(scans, number + 1)
            if len(segmenter.map) // TOLD_EVERY > told:
                told = len(segmenter.map) // TOLD_EVERY
                print(json.dumps(figures(segmenter, ms, resident)), flush=True)
            if len(segmenter.map) >= voxels:
                break
            before = process_time()
        run.write_objects()
        at_end = resident_mb()
    return figures(segmenter, ms, resident) | {"resident_mb_with_objects": at_end}


def figures(
    segmenter: IncrementalSegmenter, ms: list[tuple[float, float]], resident: list[float]
) -> dict[str, object]:
    """Compare the first hundred scans, warm, with the last."""
    early, late = np.median(ms[20:120], axis=0), np.median(ms[-100:], axis=0)
    return {
        "voxels": len(segmenter.map),
        "scans": len(ms),
        "objects": segmenter.clusters.num_objects,
        "ms_early_late": [round(float(early[0]), 1), round(float(late[0]), 1)],
        "processor_ms_early_late": [round(float(early[1]), 1), round(float(late[1]), 1)],
        "resident_mb_early_late_max": [
            round(float(np.median(resident[20:120]))),
            round(float(np.median(resident[-100:]))),
            round(max(resident)),
        ],
    }


def main() -> None:
    """Print the figures, on the way and at the end."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--voxels", type=int, default=20_000_000)
    parser.add_argument("--keep-near", type=float, default=30.0)
    parser.add_argument("--same", type=int, default=300_000)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part, keep_near in (("all", None), ("near", arguments.keep_near)):
            walk(folder / part, arguments.same, keep_near)
        maps = [(folder / part / "out" / "map.ply").read_bytes() for part in ("all", "near")]
        print(json.dumps({"same_map": maps[0] == maps[1], "voxels": arguments.same}), flush=True)
        print(json.dumps(walk(folder / "long", arguments.voxels, arguments.keep_near)))


if __name__ == "__main__":
    main()
