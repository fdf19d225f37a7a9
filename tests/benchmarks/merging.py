"""Merge maps of millions of voxels: seconds, memory, disk.

    python -m tests.benchmarks.merging [--maps 4] [--voxels 2500000] [--overlap 0.2]

The maps are written, not labelled: rooms with floor, ceiling, walls and boxes, evidence as the
U-Net's, noise included. So only merging is measured, in a process of its own.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.config import EMBEDDING
from mcpseg_cli.incremental.evidence import BLOCK
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.incremental.uniting import FORWARD
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.events import SkippedEvent
from mcpseg_cli.segment.run_record import RunConfiguration, RunRecord
from mcpseg_cli.segment.scan_record import Fingerprint, ScanRecord

ROOM = 50  # voxels along a room
HEIGHT = 26
NUM_EMBEDDING = 8
LOOKS = 12  # of full weight, at every voxel
ROOMS_AT_ONCE = 16


def room_voxels(rng: np.random.Generator) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Give (V, 3) voxels of a furnished room, and the object each is of."""
    grid = np.zeros((ROOM, ROOM, HEIGHT), np.int32)
    grid[:, :, 0], grid[:, :, -1] = 1, 2
    for number, wall in enumerate((grid[0], grid[-1], grid[:, 0], grid[:, -1])):
        wall[:, 1:-1] = 3 + number
    for number in range(14):
        low = rng.integers(3, ROOM - 14, 2)
        size = rng.integers(4, 12, 3)
        box = grid[low[0] : low[0] + size[0], low[1] : low[1] + size[1], 1 : 1 + size[2]]
        box[[0, -1]] = box[:, [0, -1]] = box[:, :, -1:] = 7 + number
        box[1:-1, 1:-1, :-1] = 0
    voxel = np.argwhere(grid).astype(np.int32)
    return voxel, grid[tuple(voxel.T)]


def room_evidence(
    rng: np.random.Generator, voxel: NDArray[np.int32], owner: NDArray[np.int32]
) -> NDArray[np.uint16]:
    """Give (V, C + 27) evidence of some looks at a room."""
    num_classes = len(S3DIS_CLASSES)
    evidence = np.zeros((len(voxel), num_classes + 27), np.uint16)
    share = rng.beta(6, 1, len(voxel))
    rows, looks = np.arange(len(voxel)), LOOKS * 255
    evidence[rows, owner % num_classes] = looks * share
    evidence[rows, (owner + 5) % num_classes] += (looks * (1 - share)).astype(np.uint16)

    # who belongs together, told wrongly now and then
    grid = np.full((ROOM + 2, ROOM + 2, HEIGHT + 2), -1, np.int32)
    grid[tuple(voxel.T + 1)] = rows
    for k, step in enumerate(FORWARD):
        other = grid[tuple((voxel + step + 1).T)]
        is_there = np.flatnonzero(other >= 0)
        is_same = owner[is_there] == owner[other[is_there]]
        affinity = np.where(is_same, rng.beta(9, 1, len(is_there)), rng.beta(1, 5, len(is_there)))
        evidence[is_there, num_classes + k] = looks * affinity
        evidence[is_there, num_classes + 13 + k] = looks * (1 - affinity)
    evidence[:, -1] = LOOKS
    return evidence


def write_map(folder: Path, rooms: range, seed: int) -> int:
    """Write the run of a robot that saw some rooms of a long row of them; return its voxels."""
    folder.mkdir(parents=True)
    rng, count = np.random.default_rng(seed), 0
    kinds = [room_voxels(np.random.default_rng(kind)) for kind in range(8)]
    evidence = [room_evidence(rng, *kind) for kind in kinds]
    pieces = [kinds[room % 8][0] + place_of(room) for room in rooms]
    total = sum(map(len, pieces))
    with State(folder / "state.sqlite") as state:
        configuration = configure()
        state.set_configuration(configuration.as_json())
        state.add_scans([a_scan(seed, total)])
        rest = np.empty((0, evidence[0].shape[1]), np.uint16)
        for start in range(0, len(rooms), ROOMS_AT_ONCE):
            some = rooms[start : start + ROOMS_AT_ONCE]
            voxel = np.concatenate(pieces[start : start + ROOMS_AT_ONCE])
            owner = np.concatenate([kinds[room % 8][1] + 32 * room for room in some])
            known = np.concatenate([rest, *[evidence[room % 8] for room in some]])
            is_last = start + ROOMS_AT_ONCE >= len(rooms)
            blocks = -(-len(known) // BLOCK) if is_last else len(known) // BLOCK
            first = (count - len(rest)) // BLOCK
            rest, cut = known[blocks * BLOCK :], known[: blocks * BLOCK]
            state.add_voxels(
                count, rows_of(rng, voxel, owner),
                {first + at: cut[at * BLOCK : (at + 1) * BLOCK] for at in range(blocks)}, {},
            )  # fmt: skip
            count += len(voxel)
    record = RunRecord(method="unet", configuration=configuration, classes=S3DIS_CLASSES)
    record.write(folder)
    return count


def place_of(room: int) -> NDArray[np.int32]:
    """Give the first voxel of a room: twenty in a row, then the next row."""
    return np.array([room % 20, room // 20, 0], np.int32) * np.array([ROOM, ROOM, 0], np.int32)


def rows_of(
    rng: np.random.Generator, voxel: NDArray[np.int32], owner: NDArray[np.int32]
) -> MapRows:
    """Give voxels the rest of what a map knows of them."""
    count = len(voxel)
    embedding = np.zeros((count, EMBEDDING), np.int16)
    embedding[:, :NUM_EMBEDDING] = rng.integers(-9000, 9000, (count, NUM_EMBEDDING))
    xyz = (voxel * 0.1 + rng.uniform(-0.04, 0.04, (count, 3))).astype(np.float32)
    rgb = rng.integers(0, 256, (count, 3)).astype(np.uint8)
    confidence = np.full(count, 0.9, np.float32)
    return MapRows(xyz, rgb, (owner % 13).astype(np.uint8), confidence, owner, embedding)


def configure() -> RunConfiguration:
    """Return what such a map would be made with."""
    return RunConfiguration(
        voxel_size=0.1, labelling="fused", clustering="graph", affinity=0.7, object_voxels=10,
        weights="0" * 64, frame="map",
    )  # fmt: skip


def a_scan(seed: int, num_voxels: int) -> ScanRecord:
    """Return a scan that stands for all of a robot's."""
    file = Fingerprint(1, 1, f"{seed:064x}")
    event = SkippedEvent(0, "written.ply", "")
    return ScanRecord("written.ply", file, np.eye(4), 1, num_voxels, 0.0, None, event, 0)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--maps", type=int, default=4)
    parser.add_argument("--voxels", type=int, default=2_500_000)
    parser.add_argument("--overlap", type=float, default=0.2)
    arguments = parser.parse_args()

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        num_rooms = -(-arguments.voxels // len(room_voxels(np.random.default_rng(0))[0]))
        step = round(num_rooms * (1 - arguments.overlap))
        runs = [folder / f"robot_{number}" for number in range(arguments.maps)]
        sizes = [
            write_map(run, range(number * step, number * step + num_rooms), number)
            for number, run in enumerate(runs)
        ]
        command = [sys.executable, "-m", "mcpseg_cli", "merge", *map(str, runs), "--json", "-q"]
        started = perf_counter()
        done = subprocess.run(
            [*command, "-o", str(folder / "building")], check=True, capture_output=True, text=True
        )
        wall_s = perf_counter() - started
        used = os.times()
        figures = json.loads(done.stdout)
        figures |= {"parts": sizes, "wall_s": wall_s, "processor_s": used[2] + used[3]}
        figures["load"] = os.getloadavg()
        on_disk = sum(path.stat().st_size for path in (folder / "building").glob("*"))
        figures["bytes_per_voxel"] = on_disk / figures["voxels"]
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
