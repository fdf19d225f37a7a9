"""Reading a synthetic S3DIS area: points per second from text, the cache and numpy.loadtxt.

    python -m tests.benchmarks.s3dis_reader [--points 5000000] [--rooms 8]

All inclusive: listing, reading, parsing, numbering objects. The text lies in the page cache; so
does the HDF5 file.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.formats import s3dis_text
from mcpseg_cli.formats.s3dis import read_area, write_room

OBJECTS = 60  # in a room; a real one has 35
LOADTXT_POINTS = 50_000


def room_objects(number: int, points: int) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Draw the objects of one room; sizes differ as those of walls and cups do."""
    rng = np.random.default_rng(number)
    sizes = np.maximum(rng.dirichlet(np.full(OBJECTS, 0.3)) * points, 1).astype(int)
    for index, size in enumerate(sizes):
        xyz = rng.uniform(-20, 20, (size, 3)).astype(np.float32)
        yield S3DIS_CLASSES[index % 13], xyz, rng.integers(0, 256, (size, 3)).astype(np.uint8)


def timed(name: str, points: int, call: Callable[[], object], repeats: int = 3) -> float:
    """Print the best of a few calls."""
    best = min(_seconds(call) for _ in range(repeats))
    print(f"{name:<34}{best:>9.3f} s{points / best / 1e6:>10.2f} million points/s", flush=True)
    return best


def _seconds(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=5_000_000)
    parser.add_argument("--rooms", type=int, default=8)
    arguments = parser.parse_args()

    with tempfile.TemporaryDirectory() as name:
        # an area of random points; the kernels are compiled by another
        area = Path(name) / "Area_1"
        write_room(Path(name) / "warm", "office_1", room_objects(0, 1000))
        read_area(Path(name) / "warm", use_cache=False)
        rooms = [
            (f"office_{number}", list(room_objects(number, arguments.points // arguments.rooms)))
            for number in range(arguments.rooms)
        ]
        start = time.perf_counter()
        for room, objects in rooms:
            write_room(area, room, objects)
        seconds = time.perf_counter() - start
        del rooms

        # reading it, and what of that is not reading
        files = sorted(area.rglob("*.txt"))
        num_bytes = sum(file.stat().st_size for file in files)
        points = len(read_area(area, use_cache=False)[0])
        print(f"{points:,} points, {len(files):,} files, {num_bytes / 1e6:,.0f} MB of text")
        print(f"{'write':<34}{seconds:>9.3f} s{points / seconds / 1e6:>10.2f} million points/s")
        for threads in (1, 2):
            timed(
                f"text, {threads} threads",
                points,
                lambda n=threads: read_area(area, threads=n, use_cache=False),
            )
        timed("  of it: bytes from files", points, lambda: [file.read_bytes() for file in files])
        texts = [file.read_bytes() for file in files]
        timed(
            "  of it: bytes to arrays, 1 thread",
            points,
            lambda: [s3dis_text.read_lines(text) for text in texts],
        )

        # the cache, and what everyone has
        timed("text and writing the cache", points, lambda: read_area(area), repeats=1)
        timed("cache", points, lambda: read_area(area))
        largest = max(files, key=lambda file: file.stat().st_size)
        count = LOADTXT_POINTS
        timed("numpy.loadtxt", count, lambda: np.loadtxt(largest, max_rows=count), repeats=1)
        peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
        print(f"peak memory of all this: {peak_mb:,.0f} MB")


if __name__ == "__main__":
    main()
