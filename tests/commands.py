"""Commands of mcpseg in this process and in others, others killed at some moment, and outputs."""

import random
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from typer.testing import CliRunner, Result

from mcpseg_cli.cli import app

MOST_S = 300.0  # to wait for what takes seconds: other work may have the cores
Recording = tuple[Path, Path]  # scans/ and poses.csv


def invoke(*words: object) -> Result:
    """Run a command of mcpseg in this process, whose kernels are compiled by now."""
    return CliRunner().invoke(app, [str(word) for word in words])


def segment(recording: Recording, output: Path, *options: object) -> Result:
    """Run ``mcpseg segment`` in this process."""
    return invoke("segment", *recording, "-o", output, *options)


def command(*words: object) -> list[str]:
    """Spell a command of mcpseg for another process."""
    return [sys.executable, "-m", "mcpseg_cli", *map(str, words)]


def start(*words: object, stderr: int | None = None) -> subprocess.Popen[str]:
    """Start a command of mcpseg in another process, without its stdout."""
    return subprocess.Popen(command(*words), stdout=subprocess.DEVNULL, stderr=stderr, text=True)


def run_to_its_end(*words: object) -> None:
    """Run a command of mcpseg in another process, which must succeed."""
    subprocess.run(command(*words), check=True, capture_output=True)


def wait_until(is_time: Callable[[], bool], process: subprocess.Popen[str]) -> None:
    """Wait for what a process is about to do, or for its end."""
    deadline = time.monotonic() + MOST_S
    while not is_time() and process.poll() is None:
        assert time.monotonic() < deadline, "it never came to that"
        time.sleep(0.002)


def kill_at_random(process: subprocess.Popen[str], output: Path, rng: random.Random) -> bool:
    """Kill while starting, or some milliseconds after the first new scan; False if done before."""
    before = num_events(output)

    # the moment
    if rng.random() < 0.15:
        time.sleep(rng.uniform(0.0, 3.0))
    else:
        wait_until(lambda: num_events(output) > before, process)
        time.sleep(rng.uniform(0.0, 0.12))

    if process.poll() is not None:
        return False
    process.kill()
    process.wait()
    return True


def num_events(output: Path) -> int:
    """Count the scans that a run has told of."""
    path = output / "events.jsonl"
    return path.read_bytes().count(b"\n") if path.exists() else 0


def outputs_of(output: Path) -> dict[str, bytes]:
    """Read the outputs of a run that must not depend on interruptions."""
    files = [output / "map.ply", output / "objects.json", *sorted((output / "scans").iterdir())]
    return {file.name: file.read_bytes() for file in files}
