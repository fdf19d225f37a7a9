"""A building as a page in tiles: seconds, memory and bytes to write; the page in headless Chromium.

    python -m tests.benchmarks.tiles [--voxels 10000000] [--made-up] [--keep site/]

The building is made, not labelled: storeys of furnished rooms, a scan in the middle of each. With
--made-up it goes from memory into the tiles, room by room, without a checkpoint, which takes 126
bytes a voxel on the disk, twice while it is exported. The export runs in a process of its own,
whose peak memory is its own. The page is drawn in software: a graphics card is faster.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from statistics import median
from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.config import EMBEDDING
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.events import SkippedEvent
from mcpseg_cli.segment.labelled_run import MapPart
from mcpseg_cli.segment.run_record import RunRecord
from mcpseg_cli.segment.scan_record import Fingerprint, ScanRecord
from tests.benchmarks.merging import HEIGHT, ROOM, configure, room_voxels
from tests.benchmarks.page import turn
from tests.pages import CHROMIUM, SOFTWARE_GL
from tests.tiled import MadeUpRun, Scan

STOREYS = 6
KINDS = 8  # of rooms
OBJECTS = 24  # ids for each room
LOADED = 'body[data-loading="0"][data-rest="yes"]'


class Building:
    """Rooms one after another: along a row, row after row, storey after storey.

    Args:
        voxels: At least so many.
    """

    def __init__(self, voxels: int) -> None:
        self._kinds = [room_voxels(np.random.default_rng(kind)) for kind in range(KINDS)]
        mean = np.mean([len(voxel) for voxel, _ in self._kinds])
        self.rooms = max(1, round(voxels / mean))
        self._side = max(1, round(np.sqrt(self.rooms / STOREYS)))

    def place(self, room: int) -> NDArray[np.int64]:
        """Return the first voxel of a room."""
        storey, rest = divmod(room, self._side * self._side)
        return np.array([rest % self._side * ROOM, rest // self._side * ROOM, storey * HEIGHT])

    def scan(self, room: int) -> Scan:
        """Return the scan in the middle of a room."""
        x, y, z = 0.1 * (self.place(room) + np.array([ROOM / 2, ROOM / 2, 14]))
        return Scan(float(z) - 1.4, (float(x), float(y), float(z)))

    def part(self, room: int) -> MapPart:
        """Return the voxels of a room."""
        voxel, owner = self._kinds[room % KINDS]
        rng, count = np.random.default_rng(room), len(voxel)
        xyz = 0.1 * (voxel + self.place(room) + rng.normal(0, 0.08, (count, 3)).clip(-0.45, 0.45))
        semantic = np.choose(np.minimum(owner, 4), [0, 1, 0, 2, 2]).astype(np.uint8)
        semantic[owner >= 7] = 7 + owner[owner >= 7] % 6
        shade = np.array([[200, 190, 170], [90, 90, 100], [120, 160, 90], [170, 90, 60]])[owner % 4]
        return MapPart(
            np.arange(count), xyz.astype(np.float32),
            (shade + rng.integers(-15, 15, (count, 3))).astype(np.uint8), semantic,
            (OBJECTS * room + owner).astype(np.int32),
            rng.uniform(0.4, 1, count).astype(np.float32), np.zeros((count, EMBEDDING), np.int16),
            np.full(count, room, np.int32),
        )  # fmt: skip


def write_run(building: Building, folder: Path) -> None:
    """Write the building as the folder of a run."""
    folder.mkdir()
    configuration = configure()
    file, event = Fingerprint(1, 1, "0" * 64), SkippedEvent(0, "made.ply", "")
    with State(folder / "state.sqlite") as state:
        state.set_configuration(configuration.as_json())
        known, parts = 0, []
        for room in range(building.rooms):
            scan, part = building.scan(room), building.part(room)
            pose = np.eye(4)
            pose[:3, 3] = scan.place
            known += len(part)
            name = f"{room:06d}.ply"
            parts.append((
                ScanRecord(name, file, pose, 1, known, scan.floor, None, event, 0),
                MapRows(
                    part.xyz, part.rgb, part.semantic, part.confidence, part.instance,
                    part.quantised,
                ),
            ))  # fmt: skip
            if len(parts) == 50 or room == building.rooms - 1:
                state.commit_all(parts)
                parts = []
    RunRecord(method="unet", configuration=configuration, classes=S3DIS_CLASSES).write(folder)


def export(voxels: int, run: Path | None, site: Path) -> None:
    """Write the page, in this process; print the figures."""
    started = perf_counter()
    if run is not None:
        from mcpseg_cli.cli import app

        words = ["export", str(run), "-o", str(site), "--split", "html", "-q"]
        app(words, standalone_mode=False)
    else:
        from mcpseg_cli.export.selection import Selection
        from mcpseg_cli.export.tiled_page import write_tiled_page

        building = Building(voxels)
        pieces = [lambda room=room: building.part(room) for room in range(building.rooms)]
        scans = [building.scan(room) for room in range(building.rooms)]
        write_tiled_page(MadeUpRun(pieces, scans=scans), site, Selection())
    wall = perf_counter() - started
    tiles = [path.stat().st_size for path in (site / "tiles").rglob("*.bin")]
    facts = read_facts(site)
    figures = {
        "points": facts["num_points"], "tiles": len(tiles), "levels": facts["tiles"]["depth"] + 1,
        "wall_s": round(wall, 1), "processor_s": round(process_time(), 1),
        "peak_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
        "bytes_per_point": round(sum(tiles) / facts["num_points"], 2),
        "map_bin_mb": round((site / "map.bin").stat().st_size / 1e6, 2),
        "tile_kb_median_most": [round(median(tiles) / 1e3), round(max(tiles) / 1e3)],
        "load": [round(value, 1) for value in os.getloadavg()],
    }  # fmt: skip
    print(json.dumps(figures), flush=True)


def read_facts(site: Path) -> dict:
    """Return what a page knows of its map."""
    body = (site / "map.bin").read_bytes()
    return json.loads(body[4 : 4 + int.from_bytes(body[:4], "little")])


def browse(site: Path) -> dict[str, object]:
    """Open the page, fly into the map and back; return the figures."""
    from playwright.sync_api import sync_playwright

    from mcpseg_cli.export.tiled_page import PageFolder
    from mcpseg_cli.export.view_server import serving, url_of

    with sync_playwright() as driver, serving(PageFolder(site)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_GL)
        page = browser.new_page(viewport={"width": 1366, "height": 768})
        sizes: list[int] = []
        page.on("response", lambda answer: sizes.append(int(answer.headers["content-length"])))
        started = perf_counter()
        page.goto(url_of(server))
        page.wait_for_selector("body[data-begun]", state="attached", timeout=120_000)
        first = perf_counter() - started
        page.wait_for_selector(LOADED, state="attached", timeout=600_000)
        figures: dict[str, object] = {
            "first_picture_s": round(first, 2),
            "whole_picture_s": round(perf_counter() - started, 2),
            "loaded_mb": round(sum(sizes) / 1e6, 1),
            "drawn": page.inner_text("#drawn"),
        }

        # into the middle, then a turn there
        page.mouse.move(800, 400)
        started = perf_counter()
        for _ in range(12):
            page.mouse.wheel(0, -400)
        page.wait_for_selector(LOADED, state="attached", timeout=600_000)
        figures["near_s"] = round(perf_counter() - started, 2)
        figures["near_drawn"] = page.inner_text("#drawn")
        turns = [turn(page, pixels) for pixels in range(10, 110, 10)]
        figures["turn_ms_median_most"] = [round(median(turns)), round(max(turns))]
        figures["tiles_loaded"] = len(sizes) - 2
        browser.close()
        server.shutdown()
    return figures


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--voxels", type=int, default=10_000_000)
    parser.add_argument("--made-up", action="store_true", help="without a checkpoint")
    parser.add_argument("--keep", type=Path, help="leave the page there")
    parser.add_argument("--browse", type=Path, help="only look at a page that is there")
    parser.add_argument("--one", nargs=2, type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.browse:
        print(json.dumps(browse(arguments.browse)))
        return
    if arguments.one:
        run, site = arguments.one
        export(arguments.voxels, None if arguments.made_up else run, site)
        return

    with tempfile.TemporaryDirectory() as name:
        run, site = Path(name) / "out", arguments.keep or Path(name) / "site"
        if not arguments.made_up:
            write_run(Building(arguments.voxels), run)
        command = [sys.executable, "-m", "tests.benchmarks.tiles", "--voxels"]
        command += [str(arguments.voxels), *["--made-up"] * arguments.made_up, "--one"]
        subprocess.run([*command, str(run), str(site)], check=True)
        if CHROMIUM is not None:
            print(json.dumps(browse(site)), flush=True)


if __name__ == "__main__":
    main()
