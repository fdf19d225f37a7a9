"""What else the long campaign does to runs: flipped bits, power cuts, full disks, races."""

from __future__ import annotations

import random
import shutil
from functools import partial
from pathlib import Path

from mcpseg_cli.errors import McpsegError
from mcpseg_cli.formats.recording import open_recording
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.weights import load_weights
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions
from tests.bit_flips import flipped, flips_that_pass
from tests.commands import MOST_S, num_events, outputs_of
from tests.forks import Asked, Ended, Fork, run_command, run_to_end
from tests.power_loss import Recorder, folder_after, some
from tests.recordings import write_recording, write_weights
from tests.soak_report import Report

NUM_SCANS = 6
FLIPS_A_ROUND = 80
RESUMED_FLIPS_A_ROUND = 5
CUTS_A_ROUND = 4


class Runs:
    """A small recording, its weights, and the outputs of a run that nothing happened to."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder / "parts"
        self.recording = write_recording(self.folder / "input", num_scans=NUM_SCANS)
        self.weights = write_weights(self.folder / "mcpnet.safetensors", "mcpnet")
        self.recorder = Recorder(self.folder / "whole")
        with self.recorder.recording():
            self.label(self.folder / "whole", recorder=self.recorder)
        self.whole = outputs_of(self.folder / "whole")
        self.label(self.folder / "half", NUM_SCANS // 2)

    def label(self, out: Path, num_scans: int = NUM_SCANS, recorder: Recorder | None = None) -> int:
        """Label so many scans in this process; return how many were there."""
        segmenter = IncrementalSegmenter(load_weights(self.weights))
        sources = open_recording(*self.recording)
        with SegmentRun(sources, out, segmenter, RunOptions(durable=True)) as run:
            for _ in run.run(lambda: len(run.records) >= num_scans):
                if recorder:
                    recorder.told()
            run.write_objects()
        return run.resumed_from

    def words(self, out: Path, *options: str) -> list[object]:
        """Spell the command for another process."""
        return ["segment", *self.recording, "-o", out, "-w", self.weights, "-q", *options]

    def check(self, out: Path, name: str, report: Report) -> None:
        """Run the same command to its end, compare, and clear away."""
        ended = run_to_end(self.words(out), self.folder)
        if ended.status or ended.fault:
            report.found(f"{name}: cannot go on: {ended.status}: {ended.said[-400:]!r}")
        elif outputs_of(out) != self.whole or num_events(out) != NUM_SCANS:
            report.found(f"{name}: differs")
        shutil.rmtree(out)


def play(seed: int, runs: Runs, report: Report, share: float = 1.0) -> None:
    """Flip bits, and do each of the other things."""
    flip_bits(seed, runs, report, max(1, int(FLIPS_A_ROUND * share)))
    resume_flipped(seed, runs, report, max(1, int(RESUMED_FLIPS_A_ROUND * share)))
    for part in (race, fill_disk, cut_power):
        part(seed, runs, report)


def flip_bits(seed: int, runs: Runs, report: Report, count: int) -> None:
    """Flip bits of a checkpoint: it is refused, or says what it said."""
    rng, path = random.Random(seed), runs.folder / "whole/state.sqlite"
    bits = [rng.randrange(8 * path.stat().st_size) for _ in range(count)]
    copy = runs.folder / "flipped.sqlite"
    ended = Asked(lambda: flips_that_pass(path, copy, bits), runs.folder).ended(MOST_S)
    if not isinstance(ended.answer, list):
        report.found(f"seed {seed}: flipped bits: status {ended.status}: {ended.said[-400:]!r}")
        return
    report.bit_flips["read"] += len(bits)
    report.failures += [f"seed {seed}: bit {bit} flipped, nothing said" for bit in ended.answer]


def resume_flipped(seed: int, runs: Runs, report: Report, count: int) -> None:
    """Flip a bit of any file of a half-done run: it is refused in one line, or ends as it would."""
    rng, out = random.Random(seed), runs.folder / "resumed"
    for _ in range(count):
        shutil.copytree(runs.folder / "half", out)
        names = ["state.sqlite"] * 4 + ["map.ply", "objects.json", "events.jsonl", "run.json"]
        path = out / rng.choice(names)
        bit = rng.randrange(8 * path.stat().st_size)
        path.write_bytes(flipped(path.read_bytes(), bit))

        ended = run_to_end(runs.words(out), runs.folder)
        place = f"seed {seed}: bit {bit} of {path.name} flipped"
        if ended.fault:
            report.found(f"{place}: {ended.fault}")
        elif ended.status == 0 and outputs_of(out) != runs.whole:
            report.found(f"{place}: differs")
        report.bit_flips[f"{path.name} of a run that goes on"] += 1
        shutil.rmtree(out)


def cut_power(seed: int, runs: Runs, report: Report) -> None:
    """Go on from what power cuts leave, with all or some of what nobody waited for."""
    rng, steps = random.Random(seed), runs.recorder.steps
    for number in range(CUTS_A_ROUND):
        end = rng.randrange(30, len(steps))
        out = runs.folder / f"cut{seed}-{number}"
        folder_after(steps[:end], out, some(rng) if number % 2 else lambda: True)
        told = sum(step.kind == "told" for step in steps[:end])
        ended = Asked(partial(_go_on, runs, out), runs.folder).ended(MOST_S)
        name = f"seed {seed}: power cut {number}, step {end}"
        if not isinstance(ended.answer, int):
            report.found(f"{name}: {ended.answer or ended.said[-400:]!r}")
        elif ended.answer < told:
            report.found(f"{name}: scans are lost")
        elif outputs_of(out) != runs.whole:
            report.found(f"{name}: differs")
        report.others["power cuts"] += 1
        shutil.rmtree(out)


def _go_on(runs: Runs, out: Path) -> int | str:
    try:
        return runs.label(out)
    except McpsegError as error:
        return str(error)


def fill_disk(seed: int, runs: Runs, report: Report) -> None:
    """Let no file grow beyond some size: one line, and it goes on when there is room."""
    rng, out = random.Random(seed), runs.folder / f"full{seed}"
    limit = rng.randrange(1 << 10, 1 << 19)
    ended = run_to_end(runs.words(out), runs.folder, most_bytes=limit)
    name = f"seed {seed}: full disk at {limit:,} bytes"
    if ended.fault:
        report.found(f"{name}: {ended.fault}")
    runs.check(out, name, report)
    report.others["full disks"] += 1


def race(seed: int, runs: Runs, report: Report) -> None:
    """Start two at once, one of them perhaps with --overwrite: nothing is lost."""
    rng, out = random.Random(seed), runs.folder / f"race{seed}"
    if rng.random() < 0.5:
        shutil.copytree(runs.folder / rng.choice(["half", "whole"]), out)
    options = [[], ["--overwrite"] if rng.random() < 0.7 else []]
    pair = [
        Fork(partial(run_command, *runs.words(out, *each)), runs.folder / f"said{number}")
        for number, each in enumerate(options)
    ]
    for process in pair:
        process.wait(MOST_S)
        if fault := Ended(process.returncode or 0, process.said).fault:
            report.found(f"seed {seed}: race: {fault}")
    runs.check(out, f"seed {seed}: race", report)
    report.others["races"] += 1
