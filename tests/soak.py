"""A campaign of kills and damaged files that goes on until its time is up; not part of the suite.

``make soak SECONDS=600``, or ``python -m tests.soak --seconds 600 --seed 1 -o report.json``: a
round reads damaged files of every format (``soak_damage``), kills runs of ``mcpseg segment`` and of
the other commands at random moments until they are done (``soak_kills``), flips bits of
checkpoints, cuts the power, fills the disk and starts two runs at once (``soak_parts``). Each round
has the next seed. The last lines say what was done and name the seeds that found something, and
``--seconds 0 --seed N`` is that round again (kills fall a little otherwise). Exit 1 where outputs
differ, or where something other than an error of one line comes out.
"""

import argparse
import gc
import json
import os
import sys
import tempfile
import time
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["NUMBA_NUM_THREADS"] = "1"  # others do not survive forks

import torch

from tests import soak_damage, soak_parts
from tests.commands import invoke
from tests.soak_kills import Kills
from tests.soak_report import Report


def main(words: list[str] | None = None) -> int:
    """Go on until the time is up; return 1 where something was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0, help="how long; one round at least")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first round")
    parser.add_argument("--share", type=float, default=1.0, help="of what a round does")
    parser.add_argument("-o", "--output", type=Path, help="JSON file to write")
    options = parser.parse_args(words)

    report, deadline = Report(options.seed), time.monotonic() + options.seconds
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        with report.timed("before"):
            runs, kills = soak_parts.Runs(folder), Kills(folder / "kills")
            import_commands(runs)
        while report.rounds == 0 or time.monotonic() < deadline:
            seed = options.seed + report.rounds
            damages = soak_damage.Damages(seed, folder / "damaged", options.share)
            with report.timed("bits, races, disks, power"):
                soak_parts.play(seed, runs, report, options.share)
            with report.timed("kills"):
                kills.play(seed, report, deadline, options.share)
            with report.timed("damaged files"):  # all that time, beside the others
                damages.add_to(report)
            report.rounds += 1
            print(f"seed {seed}, {report.age():,.0f} s: {report.line()}", flush=True)
            if options.output:
                options.output.write_text(json.dumps(report.as_json(), indent=1) + "\n")

    print(report.last_lines())
    return int(bool(report.failures))


def import_commands(runs: soak_parts.Runs) -> None:
    """Import here what commands import, and load their kernels: forks have both then."""
    for words in (runs.words(runs.folder / "warm"), ["merge", "a", "-o", "b"],
                  ["raytrace", "a", "-o", "b"], ["train", "a"], ["synth", "b", "--jobs", "0"],
                  ["export", "a", "-o", "b.ply"]):  # fmt: skip
        invoke(*words)
    gc.collect()


if __name__ == "__main__":
    sys.exit(main())
