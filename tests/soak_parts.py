"""What else the long campaign does to runs: flipped bits, power cuts, full disks, races."""

from __future__ import annotations

import random
import resource
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING

from mcpseg_cli.errors import McpsegError
from mcpseg_cli.formats.recording import open_recording
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.weights import load_weights
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions
from tests.bit_flips import flips_that_pass
from tests.commands import command, outputs_of, run_to_its_end
from tests.power_loss import Recorder, folder_after, some
from tests.recordings import write_recording, write_weights

if TYPE_CHECKING:
    from tests.soak import Report

NUM_SCANS = 6
FLIPS_A_ROUND = 40
CUTS_A_ROUND = 4
MOST_S = 600.0  # for a command that takes seconds


class Runs:
    """A small recording, its weights, and the outputs of a run that nothing happened to."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "parts"
        self.recording = write_recording(self.folder / "input", num_scans=NUM_SCANS)
        self.weights = write_weights(self.folder / "mcpnet.safetensors", "mcpnet")
        self.recorder = Recorder(self.folder / "whole")
        with self.recorder.recording():
            self.label(self.folder / "whole", self.recorder)
        self.whole = outputs_of(self.folder / "whole")

    def label(self, out: Path, recorder: Recorder | None = None) -> int:
        """Label all scans in this process; return how many were there."""
        segmenter = IncrementalSegmenter(load_weights(self.weights))
        sources = open_recording(*self.recording)
        with SegmentRun(sources, out, segmenter, RunOptions(durable=True)) as run:
            for _ in run.run():
                if recorder:
                    recorder.told()
            run.write_objects()
        return run.resumed_from

    def words(self, out: Path, *options: str) -> list[object]:
        """Spell the command for another process."""
        return ["segment", *self.recording, "-o", out, "-w", self.weights, "-q", *options]

    def check(self, out: Path, name: str, report: Report) -> None:
        """Run the same command to its end and compare."""
        try:
            run_to_its_end(*self.words(out))
        except subprocess.CalledProcessError as error:
            report.failures.append(f"{name}: cannot go on: {error.stderr[-300:]!r}")
            return
        if outputs_of(out) != self.whole:
            report.failures.append(f"{name}: differs")


def play(seed: int, runs: Runs, report: Report) -> None:
    """Flip bits in every round, and do one of the other things."""
    flip_bits(seed, runs, report)
    others = (race, fill_disk, cut_power)
    if seed % 4 < len(others):
        others[seed % 4](seed, runs, report)


def flip_bits(seed: int, runs: Runs, report: Report) -> None:
    """Flip bits of a checkpoint: it is refused, or says what it said."""
    rng, path = random.Random(seed), runs.folder / "whole/state.sqlite"
    bits = [rng.randrange(8 * path.stat().st_size) for _ in range(FLIPS_A_ROUND)]
    copy = runs.folder / "flipped.sqlite"
    try:
        wrong = flips_that_pass(path, copy, bits)
    except Exception as error:
        report.failures.append(f"seed {seed}: flipped bit: {type(error).__name__}: {error}")
        return
    report.others["bit flips"] += len(bits)
    report.failures += [f"seed {seed}: bit {bit} flipped, nothing said" for bit in wrong]


def cut_power(seed: int, runs: Runs, report: Report) -> None:
    """Go on from what power cuts leave, with all or some of what nobody waited for."""
    rng, steps = random.Random(seed), runs.recorder.steps
    for number in range(CUTS_A_ROUND):
        end = rng.randrange(30, len(steps))
        out = runs.folder / f"cut{seed}-{number}"
        folder_after(steps[:end], out, some(rng) if number % 2 else lambda: True)
        name = f"seed {seed}: power cut {number}, step {end}"
        told = sum(step.kind == "told" for step in steps[:end])
        try:
            if runs.label(out) < told:
                report.failures.append(f"{name}: scans are lost")
        except McpsegError as error:
            report.failures.append(f"{name}: {error}")
            continue
        if outputs_of(out) != runs.whole:
            report.failures.append(f"{name}: differs")
        report.others["power cuts"] += 1


def fill_disk(seed: int, runs: Runs, report: Report) -> None:
    """Let no file grow beyond some size: one line, and it goes on when there is room."""
    rng, out = random.Random(seed), runs.folder / f"full{seed}"
    limit = rng.randrange(1 << 10, 1 << 19)
    ended = subprocess.run(
        command(*runs.words(out)),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
        capture_output=True, text=True, timeout=MOST_S, check=False,
    )  # fmt: skip
    name = f"seed {seed}: full disk at {limit:,} bytes"
    if ended.returncode not in (0, 1) or len(ended.stderr.splitlines()) > 1:
        report.failures.append(f"{name}: {ended.returncode}: {ended.stderr[-300:]!r}")
    runs.check(out, name, report)
    report.others["full disks"] += 1


def race(seed: int, runs: Runs, report: Report) -> None:
    """Start two at once, one of them perhaps with --overwrite: nothing is lost."""
    rng, out = random.Random(seed), runs.folder / f"race{seed}"
    if rng.random() < 0.5:
        runs.label(out)
    options = [[], ["--overwrite"] if rng.random() < 0.7 else []]
    pair = [
        subprocess.Popen(
            command(*runs.words(out, *each)), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            text=True,
        )
        for each in options
    ]  # fmt: skip
    name = f"seed {seed}: race"
    for process in pair:
        _, stderr = process.communicate(timeout=MOST_S)
        if process.returncode not in (0, 1) or len(stderr.splitlines()) > 1:
            report.failures.append(f"{name}: {process.returncode}: {stderr[-300:]!r}")
    runs.check(out, name, report)
    report.others["races"] += 1
