"""A campaign of kills and damaged files that goes on until its time is up; not part of the suite.

``make soak SECONDS=600``, or ``python -m tests.soak --seconds 600 --seed 1 -o report.json``. Four
things go on side by side, in rounds: damaged files of every format are read (``soak_damage``); runs
of ``mcpseg segment``, and of the other commands, are killed at random moments until they are done
(``soak_kills``); bits of checkpoints are flipped, the power cut, disks filled, and two runs started
at once (``soak_parts``). Each round has the next seed. The last lines say what was done and name
the seeds that found something, and ``--seconds 0 --seed N`` is that round again (kills fall a
little otherwise). Exit 1 where outputs differ, or where something other than an error of one line
comes out.
"""

import argparse
import copy
import gc
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = os.environ["NUMBA_NUM_THREADS"] = "1"  # others do not survive forks

import torch

from mcpseg_cli.resumable import write_whole
from tests import soak_damage, soak_parts
from tests.commands import invoke
from tests.forks import Fork
from tests.soak_commands import killables
from tests.soak_kills import Kills
from tests.soak_report import Report

KILLS_A_ROUND = 20  # of a command that segments
KILLS_OF_OTHERS = 8
_NICE = {"damaged files": 0, "bits, races, disks, power": 6}  # what has a limit of time goes first
_NICE_KILLS = 3
_TELL_S = 60.0  # between two lines about what was done

Play = Callable[[int, Report, float, float], None]
"""Plays a round: seed, what it adds to, when to stop, share of what a round does."""


def main(words: list[str] | None = None) -> int:
    """Go on until the time is up; return 1 where something was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0, help="how long; one round at least")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first round")
    parser.add_argument("--share", type=float, default=1.0, help="of what a round does")
    parser.add_argument("-o", "--output", type=Path, help="JSON file to write")
    options = parser.parse_args(words)

    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as name:
        report, folder = Report(options.seed), Path(name)
        with report.timed("before"):
            plays = all_plays(folder)
        deadline = time.monotonic() + options.seconds
        workers = [
            Worker(part, play, folder, options.seed, deadline, options.share)
            for part, play in plays.items()
        ]
        while any(worker.is_busy() for worker in workers):
            told = time.monotonic()
            while time.monotonic() < told + _TELL_S and any(one.is_busy() for one in workers):
                time.sleep(0.5)
            tell(report, workers, options.output)
        print(tell(report, workers, options.output).last_lines())
    return int(any(worker.so_far().failures for worker in workers))


def all_plays(folder: Path) -> dict[str, Play]:
    """Make what every part needs; import here what commands import, and load their kernels."""
    runs = soak_parts.Runs(folder)
    for words in (runs.words(runs.folder / "warm"), ["merge", "a", "-o", "b"],
                  ["raytrace", "a", "-o", "b"], ["train", "a"], ["synth", "b", "--jobs", "0"],
                  ["export", "a", "-o", "b.ply"]):  # fmt: skip
        invoke(*words)
    gc.collect()
    segments, others = killables(folder / "made")
    for name in ("segments", "others"):
        (folder / name).mkdir()
    return {
        "damaged files": lambda seed, report, _, share: soak_damage.play(
            seed, folder / "damaged", report, share
        ),
        "bits, races, disks, power": lambda seed, report, _, share: soak_parts.play(
            seed, runs, report, share
        ),
        "kills of segment": Kills(folder / "segments", segments, KILLS_A_ROUND).play,
        "kills of others": Kills(folder / "others", others, KILLS_OF_OTHERS).play,
    }


class Worker:
    """A process that plays rounds of one part until the time is up."""

    def __init__(
        self, part: str, play: Play, folder: Path, seed: int, deadline: float, share: float
    ) -> None:
        self._part, self._seed = part, seed
        self._path = folder / f"{part}.json"
        self._fork = Fork(lambda: self._go(play, deadline, share), folder / f"{part}.said")

    def is_busy(self) -> bool:
        """Tell whether it goes on."""
        return self._fork.poll() is None

    def so_far(self) -> Report:
        """Return what it did, and that it ended badly if so."""
        report = Report(self._seed)
        if self._path.exists():
            report.add(Report(**json.loads(self._path.read_text())))
        if self._fork.poll():
            report.found(f"{self._part}: ended: {self._fork.returncode}: {self._fork.said[-900:]}")
        return report

    def _go(self, play: Play, deadline: float, share: float) -> int:
        os.nice(_NICE.get(self._part, _NICE_KILLS))
        report = Report(self._seed)
        while report.rounds == 0 or time.monotonic() < deadline:
            with report.timed(self._part):
                play(self._seed + report.rounds, report, deadline, share)
            report.rounds += 1
            write_whole(self._path, json.dumps(report.as_dict()))
        return 0


def tell(before: Report, workers: list[Worker], output: Path | None) -> Report:
    """Print and write what all did; return it."""
    report = copy.deepcopy(before)
    for worker in workers:
        report.add(worker.so_far())
    print(f"{report.age():,.0f} s: {report.line()}", flush=True)
    if output:
        write_whole(output, json.dumps(report.as_json(), indent=1) + "\n")
    return report


if __name__ == "__main__":
    sys.exit(main())
