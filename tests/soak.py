"""A campaign of kills and damaged files that goes on until its time is up; not part of the suite.

``make soak SECONDS=600``, or ``python -m tests.soak --seconds 600 --seed 1 -o report.json``: a
round reads damaged files of every format, kills one run of ``mcpseg segment`` at random moments
until it is done, flips bits of a checkpoint, and in turn cuts the power, fills the disk or starts
two runs at once (``soak_parts``). Each round has the next seed. The last lines name those that
found something, and ``--seconds 0 --seed N`` is that round again (kills fall a little otherwise).
Exit 1 where outputs differ, or where something other than an error of one line comes out of a
reader.
"""

import argparse
import json
import random
import re
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from mcpseg_cli.choices import Architecture, Labelling
from mcpseg_cli.errors import McpsegError
from tests import soak_files, soak_parts
from tests.commands import command, kill_at_random, num_events, outputs_of, run_to_its_end
from tests.recordings import write_recording, write_weights

METHODS: dict[str, tuple[Architecture, Labelling]] = {
    "mcpnet": ("mcpnet", "first"),
    "unet": ("unet", "fused"),
    "fused": ("mcpnet", "fused"),
}
NUM_SCANS = 30
FILES_A_ROUND = 250
MOST_S = 10.0  # to read a small file, or to refuse it
MOST_MB = 2000.0  # of memory that one takes
LIES = (0, 1, 0x7FFF, 0xFFFF, 1 << 31, (1 << 32) - 1, 1 << 40, (1 << 63) - 1, (1 << 64) - 1)
WORDS = (b"-1", b"0", b"1e999", b"nan", b"9" * 20, b"9" * 400, b"9" * 5000, b"[[[[", b"\xff\xfe")


@dataclass
class Report:
    """What was done so far, and what was found."""

    first_seed: int
    rounds: int = 0
    kills: Counter[str] = field(default_factory=Counter)
    read: Counter[str] = field(default_factory=Counter)
    refused: Counter[str] = field(default_factory=Counter)
    others: Counter[str] = field(default_factory=Counter)
    slowest_s: float = 0.0
    slowest: str = ""
    most_mb: float = 0.0
    failures: list[str] = field(default_factory=list)


def main(words: list[str] | None = None) -> int:
    """Go on until the time is up; return 1 where something was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=600.0, help="how long; one round at least")
    parser.add_argument("--seed", type=int, default=0, help="seed of the first round")
    parser.add_argument("-o", "--output", type=Path, help="JSON file to write")
    options = parser.parse_args(words)

    report, deadline = Report(options.seed), time.monotonic() + options.seconds
    with tempfile.TemporaryDirectory() as folder:
        kills, damages = Kills(Path(folder)), Damages(Path(folder))
        runs = soak_parts.Runs(Path(folder))
        while report.rounds == 0 or time.monotonic() < deadline:
            seed = options.seed + report.rounds
            damages.play(seed, report)
            soak_parts.play(seed, runs, report)
            kills.play(seed, report, deadline)
            report.rounds += 1
            show(seed, report)
            if options.output:
                options.output.write_text(json.dumps(vars(report), indent=1) + "\n")

    print("\n".join(report.failures) or "nothing found")
    return int(bool(report.failures))


def show(seed: int, report: Report) -> None:
    """Print one line: what all rounds did so far."""
    kills = ", ".join(f"{method} {count}" for method, count in report.kills.items())
    files = f"{report.read.total():,} damaged files read, {report.refused.total():,} refused"
    others = ", ".join(f"{count:,} {name}" for name, count in report.others.items())
    slowest = f"slowest {report.slowest_s:.2f} s ({report.slowest})"
    print(
        f"seed {seed}: killed {kills}; {others}; {files}; {slowest}; {len(report.failures)} found",
        flush=True,
    )


class Kills:
    """Runs that are killed until they are done, and those that nobody killed."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder / "kills"
        self._recording = write_recording(self._folder / "input", num_scans=NUM_SCANS)
        self._whole: dict[str, dict[str, bytes]] = {}

    def play(self, seed: int, report: Report, deadline: float) -> None:
        """Kill one run, until it is done or the time is up; then let it finish and compare."""
        method, rng = list(METHODS)[seed % len(METHODS)], random.Random(seed)
        whole = self._uninterrupted(method)
        output = self._folder / f"seed{seed}"

        # killed once at least
        words = self._words(method, output)
        while kill_at_random(start(words), output, rng):
            report.kills[method] += 1
            if time.monotonic() > deadline:
                break

        try:
            run_to_its_end(*words)
        except subprocess.CalledProcessError as error:
            report.failures.append(f"seed {seed}: {method} cannot go on: {error.stderr[-300:]!r}")
            return
        if outputs_of(output) != whole or num_events(output) != NUM_SCANS:
            report.failures.append(f"seed {seed}: {method} differs after kills")

    def _uninterrupted(self, method: str) -> dict[str, bytes]:
        """The outputs of a run of this method that nothing stopped; made once."""
        if method not in self._whole:
            output = self._folder / method
            run_to_its_end(*self._words(method, output))
            self._whole[method] = outputs_of(output)
        return self._whole[method]

    def _words(self, method: str, output: Path) -> list[object]:
        network, labelling = METHODS[method]
        weights = self._folder / f"{network}.safetensors"
        if not weights.exists():
            write_weights(weights, network)
        options = ["-w", weights, "--labelling", labelling, "-q"]
        return ["segment", *self._recording, "-o", output, *options]


def start(words: list[object]) -> subprocess.Popen[str]:
    """Start a command that will not live to say much."""
    quiet = subprocess.DEVNULL
    return subprocess.Popen(command(*words), stdout=quiet, stderr=quiet, text=True)


class Damages:
    """Sound files for every reader, and what the readers say when they are damaged."""

    def __init__(self, folder: Path) -> None:
        self._sound = soak_files.sound_files(folder / "sound")
        self._folder = folder / "damaged"
        self._folder.mkdir()

    def play(self, seed: int, report: Report) -> None:
        """Damage files and read them; only errors of one line may come out."""
        rng = random.Random(seed)
        for number in range(FILES_A_ROUND):
            sound = rng.choice(self._sound)
            path = self._folder / sound.name
            path.write_bytes(damage(sound.data, rng))

            began, memory = time.monotonic(), peak_memory_mb()
            self._read(path, sound, f"seed {seed}: damaged file {number}, {sound.name}", report)
            seconds, memory = time.monotonic() - began, peak_memory_mb() - memory
            path.unlink()
            place = f"seed {seed}, file {number}, {sound.name}"
            if seconds > MOST_S or memory > MOST_MB:
                report.failures.append(f"{place}: {seconds:.0f} s, {memory:,.0f} MB more")
            if seconds > report.slowest_s:
                report.slowest_s, report.slowest = seconds, place
            report.most_mb = max(report.most_mb, memory)

    def _read(self, path: Path, sound: soak_files.Sound, name: str, report: Report) -> None:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # a warning would be a second line on stderr
            try:
                sound.read(path)
                report.read[sound.name] += 1
            except (McpsegError, OSError):
                report.refused[sound.name] += 1
            except KeyboardInterrupt:
                raise
            except BaseException as error:  # panics of Rust are no Exception
                report.failures.append(f"{name}: {type(error).__name__}: {error}")


def peak_memory_mb() -> float:
    """Most memory that this process ever had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def damage(data: bytes, rng: random.Random) -> bytes:
    """Flip bits, lie, cut out, insert and cut off, mostly in the first part: there are headers."""
    for _ in range(rng.choice([1, 1, 2, 3, 8])):
        at = rng.randrange(max(1, int(len(data) * rng.choice([0.2, 1.0]))))
        kind = rng.choice(["flip", "flip", "number", "word", "cut out", "insert", "cut off"])
        if kind == "flip" and data:
            data = data[:at] + bytes([data[at] ^ 1 << rng.randrange(8)]) + data[at + 1 :]
        elif kind == "number":  # a number that is a lie
            lie = rng.choice(LIES).to_bytes(8, "little")[: rng.choice([2, 4, 8])]
            data = data[:at] + lie + data[at + len(lie) :]
        elif kind == "word":
            numbers = list(re.finditer(rb"[-+]?\d[\d.]*", data[at : at + 200]))
            if numbers:
                word = rng.choice(numbers)
                data = data[: at + word.start()] + rng.choice(WORDS) + data[at + word.end() :]
        elif kind == "cut out":
            data = data[:at] + data[at + rng.randrange(1, 9) :]
        elif kind == "insert":
            data = data[:at] + rng.randbytes(rng.randrange(1, 9)) + data[at:]
        elif kind == "cut off":
            data = data[: len(data) - rng.randrange(len(data) // 4 + 1)]
    return data


if __name__ == "__main__":
    sys.exit(main())
