"""Time of one virtual scan, against the same rays marched in plain Python.

    python -m tests.benchmarks.raytrace [AREA] [--scans 40] [--jobs 2]

AREA is a building that 'mcpseg raytrace' reads; without it, a room of bare boxes stands in. Three
figures: the milliseconds of one scan of 64,800 rays with its rays shared among the threads (what a
robot in a loop waits for), milliseconds a scan of the whole command with scans shared among the
threads and files written, and how many times faster the kernel is than its slow twin on the same
rays.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import perf_counter

import numpy as np

from mcpseg_cli.building import Building
from mcpseg_cli.config import RaytraceSettings
from mcpseg_cli.raytrace.drive import Waypoints
from mcpseg_cli.raytrace.rays import cast_rays, visible_voxels
from mcpseg_cli.raytrace.record import RouteRecord
from mcpseg_cli.raytrace.run import RaytraceRequest, RaytraceRun
from mcpseg_cli.raytrace.scanner import VirtualScanner
from tests import reference

NUM_TWIN_RAYS = 6480  # every tenth ray of one scan is marched in Python


def bare_room(seed: int = 0) -> Building:
    """Make a hall of 20 x 12 x 3 m with boxes of furniture in it, points 2 cm apart."""
    rng = np.random.default_rng(seed)
    boxes = [np.array([[0.0, 0.0, 0.0], [20.0, 12.0, 3.0]])]
    corners = rng.uniform((0.5, 0.5, 0.0), (18.5, 10.5, 0.0), (30, 3))
    boxes += [np.stack([corner, corner + rng.uniform(0.3, 1.2, 3)]) for corner in corners]
    xyz = np.concatenate([_faces(low, high, rng) for low, high in boxes]).astype(np.float32)
    grey = np.full((len(xyz), 3), 128, np.uint8)
    return Building(xyz, grey, np.zeros(len(xyz), np.uint8), np.ones(len(xyz), np.int32))


def _faces(low: np.ndarray, high: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    faces = []
    for axis in range(3):
        for side in (low, high):
            sizes = np.delete(high - low, axis)
            points = rng.uniform(low, high, (int(sizes.prod() / 0.02**2), 3))
            points[:, axis] = side[axis]
            faces.append(points)
    return np.concatenate(faces)


def positions_in(scanner: VirtualScanner, num: int) -> np.ndarray:
    """Spread scan positions over the middle of the building, 1 m over its lowest points."""
    low, high = scanner.building.xyz.min(axis=0), scanner.building.xyz.max(axis=0)
    rng = np.random.default_rng(1)
    position = rng.uniform(low + 0.2 * (high - low), high - 0.2 * (high - low), (num, 3))
    position[:, 2] = low[2] + 1.0
    return position


def scan_ms(
    scanner: VirtualScanner, positions: np.ndarray, jobs: int
) -> tuple[float, float, float]:
    """Median milliseconds of a scan, its rays shared among threads and in one, and voxels seen."""
    directions = scanner.pattern.directions()
    shared, alone, seen = [], [], []
    with ThreadPoolExecutor(jobs) as pool:
        for position in np.concatenate([positions[:2], positions]):  # the first two do not count
            started = perf_counter()
            voxels = visible_voxels(scanner.grid, position, directions, 5.0, pool, jobs)
            shared.append(perf_counter() - started)

            started = perf_counter()
            visible_voxels(scanner.grid, position, directions, 5.0)
            alone.append(perf_counter() - started)
            seen.append(len(voxels))

    medians = (float(np.median(figures[2:])) for figures in (shared, alone, seen))
    shared_s, alone_s, num_seen = medians
    return 1e3 * shared_s, 1e3 * alone_s, num_seen


def twin_ratio(scanner: VirtualScanner, position: np.ndarray) -> tuple[float, float]:
    """How many times longer than the kernel plain Python takes, and its seconds for a scan."""
    # the occupied voxels as Python's set
    grid = scanner.grid
    x, y, z = np.nonzero(grid.masks)
    occupied = set()
    for block in zip(x.tolist(), y.tolist(), z.tolist(), strict=True):
        mask = int(grid.masks[block])
        occupied.update(
            (4 * block[0] + (bit >> 4), 4 * block[1] + (bit >> 2 & 3), 4 * block[2] + (bit & 3))
            for bit in range(64)
            if mask >> bit & 1
        )

    # some rays of a scan, marched in Python
    directions = scanner.pattern.directions()
    some = directions[:: len(directions) // NUM_TWIN_RAYS]
    start = (position / grid.voxel_size + 0.5 - grid.low).tolist()
    started = perf_counter()
    found = [
        reference.first_occupied(occupied, start, ray, 5.0 / grid.voxel_size)
        for ray in some.tolist()
    ]
    twin_s = perf_counter() - started

    # the same rays in the kernel
    times = []
    for _ in range(50):
        started = perf_counter()
        hits = cast_rays(grid, position, some, 5.0)
        times.append(perf_counter() - started)
    assert [voxel is not None for voxel in found] == (hits >= 0).tolist()
    return twin_s / float(np.median(times)), twin_s * len(directions) / len(some)


def command_ms(building: Building, positions: np.ndarray, jobs: int) -> float:
    """Milliseconds a scan of the whole run: rays, points, two files a scan."""
    poses = np.tile(np.eye(4), (len(positions), 1, 1))
    poses[:, :3, 3] = positions
    with tempfile.TemporaryDirectory() as folder:
        request = RaytraceRequest("benchmark", RaytraceSettings(), ".ply", Waypoints())
        run = RaytraceRun(Path(folder) / "out", building, request)
        run.start(poses, RouteRecord(waypoints=len(poses), length_m=0.0, free_area_m2=0.0))
        started = perf_counter()
        count = sum(1 for _ in run.run(jobs))
        return 1e3 * (perf_counter() - started) / count


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("area", type=Path, nargs="?")
    parser.add_argument("--scans", type=int, default=40)
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()

    # what to scan, and from where
    building = bare_room()
    if arguments.area is not None:
        from mcpseg_cli.formats.buildings import read_building

        building = read_building(arguments.area)[0]
    scanner = VirtualScanner(building, RaytraceSettings())
    positions = positions_in(scanner, arguments.scans)

    command_ms(building, positions[:2], 1)  # compile the kernels
    shared, alone, seen = scan_ms(scanner, positions, arguments.jobs)
    ratio, twin_s = twin_ratio(scanner, positions[0])
    figures = {
        "points": len(building),
        "voxels": len(scanner.grid),
        "rays": len(scanner.pattern.directions()),
        "voxels_seen_median": seen,
        f"scan_ms_{arguments.jobs}_threads": round(shared, 2),
        "scan_ms_1_thread": round(alone, 2),
        "plain_python_s": round(twin_s, 2),
        "times_faster_1_thread": round(ratio),
        "times_faster_all_threads": round(1e3 * twin_s / shared),
        "command_ms_per_scan": round(command_ms(building, positions, arguments.jobs), 2),
    }
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
