"""Start ``mcpseg segment`` again with nothing new, after many tiny scans: processor time, memory.

    python -m tests.benchmarks.startup [--scans 20000] [--folder KEPT] [--repeat 3] [--against TREE]

A scan is six points that no other scan has, a metre and a half apart: each is a voxel and an
object, so that tables are as long as they get. ``--against`` names another checkout, whose turns
alternate with those of this one: on a busy machine only their ratio says something.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from mcpseg_cli.formats import Cloud, write_cloud
from tests.recordings import write_weights

POINTS = 6
APART = 1.5  # metres between two points
STEP = 10.0  # metres between two scans
LANE_SCANS = 200
TREE = Path(__file__).parents[2]


def write_recording(folder: Path, num_scans: int) -> tuple[Path, Path]:
    """Write tiny scans and their poses; return where."""
    scans = folder / "scans"
    scans.mkdir(parents=True)
    lines = ["scan,x,y,z,qx,qy,qz,qw"]
    for number in range(num_scans):
        lane, place = divmod(number, LANE_SCANS)
        x, y = place * STEP, lane * APART
        columns = {
            "x": np.float32(x + APART * np.arange(POINTS)),
            "y": np.full(POINTS, y, np.float32),
            "z": np.zeros(POINTS, np.float32),
        }
        columns |= {name: np.full(POINTS, 99, np.uint8) for name in ("red", "green", "blue")}
        write_cloud(scans / f"{number:06d}.ply", Cloud(columns))
        lines.append(f"{number:06d},{x + 3.75},{y},0.5,0,0,0,1")
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    return scans, folder / "poses.csv"


def run(tree: Path, *words: object) -> tuple[float, float]:
    """Run a command of a checkout; return its seconds of the processor and its peak of MB."""
    environment = os.environ | {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1"}
    process = subprocess.Popen([sys.executable, *map(str, words)], env=environment, cwd=tree)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scans", type=int, default=20_000)
    parser.add_argument("--folder", type=Path, help="keeps recording and run for the next time")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--against", type=Path, help="another checkout")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = options.folder or Path(name)
        recording = (folder / "scans", folder / "poses.csv")
        if not recording[1].exists():
            write_recording(folder, options.scans)
            write_weights(folder / "w.safetensors", "mcpnet")
        words = ["-m", "mcpseg_cli", "segment", *recording, "-o", folder / "out", "-q",
                 "-w", folder / "w.safetensors", "--range", 6]  # fmt: skip
        if not (folder / "out/objects.json").exists():
            run(TREE, *words)

        trees = {"this": TREE} | ({"against": options.against} if options.against else {})
        found: dict[str, list[tuple[float, float]]] = {name: [] for name in trees}
        for _ in range(options.repeat):
            for name, tree in trees.items():
                found[name].append(run(tree, *words))
    for name, figures in found.items():
        seconds, mb = (statistics.median(each) for each in zip(*figures, strict=True))
        print(json.dumps({name: {"processor_s": round(seconds, 2), "peak_mb": round(mb)}}))
    print(json.dumps({"load": os.getloadavg()}))


if __name__ == "__main__":
    main()
