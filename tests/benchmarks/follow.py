"""How long after a scan is complete its labels are there, while a writer goes on.

    python -m tests.benchmarks.follow [--scans 200] [--rate 5] [--method mcpnet] [--kill]

The scans of the example walk are written again and again, in pieces, at so many a second, by
another process. ``--kill`` kills the labelling process in the middle and starts it again. Then the
recording is labelled in one go, and the two maps are compared byte for byte.
"""

from __future__ import annotations

import argparse
import json
import resource
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from tests.commands import command, num_events, outputs_of, start, wait_until

WALK = Path(__file__).parents[2] / "examples/office_walk"


def write_walk(folder: Path, num_scans: int) -> None:
    """Write the example walk as often as it takes, forth and back."""
    header, *rows = (WALK / "poses.csv").read_text().splitlines()
    places = [*range(len(rows)), *range(len(rows) - 2, 0, -1)]
    (folder / "scans").mkdir(parents=True)
    lines = [header]
    for number in range(num_scans):
        name, rest = rows[places[number % len(places)]].split(",", 1)
        shutil.copyfile(WALK / "scans" / f"{name}.ply", folder / "scans" / f"{number:06d}.ply")
        lines.append(f"{number:06d},{rest}")
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")


def follow(folder: Path, rate: float, options: list[str], *, is_killed: bool) -> dict[str, float]:
    """Label a recording while it is written; return the seconds from complete to labelled."""
    growing, out = folder / "growing", folder / "out"
    (growing / "scans").mkdir(parents=True)
    words = ("segment", growing / "scans", growing / "poses.csv", "-o", out, *options)
    labelling = start(*words, "--follow", "--idle", "5", stderr=subprocess.PIPE)
    assert labelling.stderr is not None
    while "waiting" not in labelling.stderr.readline():  # it is ready, as one that drives off is
        assert labelling.poll() is None, "it failed"
    writing = [sys.executable, "-m", "tests.growing", folder / "whole", growing, str(rate)]
    with subprocess.Popen([*writing, folder / "complete.json"]) as writer:
        if is_killed:
            half = len(list((folder / "whole/scans").iterdir())) // 2
            wait_until(lambda: num_events(out) >= half, labelling)
            labelling.kill()
            labelling.wait()
            labelling = start(*words, "--follow", "--idle", "5", "-q")
        assert writer.wait() == 0
    assert labelling.wait() == 0, "it failed"
    complete = json.loads((folder / "complete.json").read_text())
    return {name: (out / "scans" / name).stat().st_mtime - at for name, at in complete.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--scans", type=int, default=200)
    parser.add_argument("--rate", type=float, default=5.0)
    parser.add_argument("--method", default="mcpnet")
    parser.add_argument("--kill", action="store_true")
    args = parser.parse_args()

    options = ["--method", args.method, "--range", "2"]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_walk(folder / "whole", args.scans)
        delays = np.array(list(follow(folder, args.rate, options, is_killed=args.kill).values()))
        print(f"seconds from complete to labelled, {len(delays)} scans at {args.rate:g} Hz:")
        print("  mean {:.3f}  median {:.3f}  p95 {:.3f}  max {:.3f}".format(
            delays.mean(), *np.percentile(delays, (50, 95, 100))))  # fmt: skip
        print(f"  without the first 25: mean {delays[25:].mean():.3f}")
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        share = (used.ru_utime + used.ru_stime) / len(delays)
        print(f"  processor time of writer and labelling: {1e3 * share:.0f} ms a scan")

        whole = folder / "whole"
        words = ("segment", whole / "scans", whole / "poses.csv", "-o", folder / "after", *options)
        subprocess.run(command(*words), check=True, capture_output=True)
        same = outputs_of(folder / "out") == outputs_of(folder / "after")
        print(f"  labelled once: {num_events(folder / 'out') == args.scans}; same outputs: {same}")


if __name__ == "__main__":
    main()
