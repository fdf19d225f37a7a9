"""``segment --follow``: labelled while it is written, the same as labelled afterwards."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from tests.commands import MOST_S, invoke, num_events, outputs_of, segment, start, wait_until
from tests.growing import write_growing
from tests.walks import WAYS, write_walk

NUM_SCANS = 9
RATE_HZ = 20.0


@pytest.fixture
def growing(make_recording, tmp_path: Path) -> Path:
    """A folder that is being filled from a recording in ``whole``."""
    make_recording(tmp_path / "whole", num_scans=NUM_SCANS)
    (tmp_path / "growing/scans").mkdir(parents=True)
    return tmp_path / "growing"


def whole(growing: Path) -> Path:
    return growing.parent / "whole"


def recording(folder: Path) -> tuple[Path, Path]:
    return folder / "scans", folder / "poses.csv"


def is_same_as_afterwards(growing: Path, weights: Path, *options: str) -> bool:
    """Compare a followed run with one of the recording when it is complete."""
    after = growing.parent / "after"
    assert segment(recording(growing), after, "-w", weights, *options).exit_code == 0
    return outputs_of(growing.parent / "out") == outputs_of(after)


def test_scans_are_labelled_while_they_are_written(growing, weights_path):
    writer = threading.Thread(target=write_growing, args=(whole(growing), growing, RATE_HZ))
    writer.start()
    words = ("-w", weights_path, "--follow", "--idle", "1", "--json")
    result = segment(recording(growing), growing.parent / "out", *words)
    writer.join()
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    assert (document["scans"], document["skipped"]) == (NUM_SCANS, [])
    assert document["pairing"]["how"] == "by name"
    assert is_same_as_afterwards(growing, weights_path)


def test_a_followed_run_that_is_killed_goes_on(growing, weights_path):
    out = growing.parent / "out"
    words = [sys.executable, "-m", "tests.growing", whole(growing), growing, "8", out.parent / "l"]
    with subprocess.Popen(words) as writer:
        followed = ("segment", *recording(growing), "-o", out, "-w", weights_path, "--follow")
        with start(*followed) as process:
            wait_until(lambda: num_events(out) > 2, process)
            process.kill()
        result = invoke(*followed, "--idle", "2")
        assert writer.wait(MOST_S) == 0
    assert result.exit_code == 0
    assert re.search(r"continuing after \d scans", result.stderr)
    assert num_events(out) == NUM_SCANS
    assert is_same_as_afterwards(growing, weights_path)


def test_ctrl_c_ends_following(recording, tmp_path, weights_path):
    def interrupt() -> None:
        while num_events(tmp_path / "out") < 4:
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)

    waiting = threading.Thread(target=interrupt)
    waiting.start()
    result = segment(recording, tmp_path / "out", "-w", weights_path, "--follow")
    waiting.join()
    assert result.exit_code == 0  # nothing that is there was left out
    assert re.search(r"^scans +4$", result.stdout, re.MULTILINE)
    assert (tmp_path / "out/objects.json").exists()


def test_a_scan_that_stays_damaged_is_skipped_at_the_end(recording, tmp_path, weights_path):
    damaged = recording[0] / "000002.ply"
    damaged.write_bytes(damaged.read_bytes()[:500])
    words = ("-w", weights_path, "--follow", "--idle", "0.5", "--on-error", "skip", "--json")
    result = segment(recording, tmp_path / "out", *words)
    assert json.loads(result.stdout)["skipped"] == ["000002.ply"]
    assert num_events(tmp_path / "out") == 4


def test_nothing_that_comes_is_one_line(tmp_path, weights_path):
    words = ("-w", weights_path, "--follow", "--idle", "0.1", "-q")
    result = segment((tmp_path / "scans", tmp_path / "poses.csv"), tmp_path / "out", *words)
    assert result.exit_code == 1
    assert result.stderr.startswith(f"mcpseg: {tmp_path}/scans: no such folder")
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize("options", [["--idle", "5"], ["--follow", "--offline"]], ids=str)
def test_options_that_make_no_sense_together_are_wrong_usage(
    recording, tmp_path, weights_path, options
):
    result = segment(recording, tmp_path / "out", "-w", weights_path, *options)
    assert result.exit_code == 2


def test_a_followed_recording_is_taken_as_its_unit_and_place_say(tmp_path, weights_path):
    words = ("--scale", "0.001", "--offset", "auto")
    scans, poses = write_walk(
        tmp_path / "in", lambda xyz: 1000 * WAYS["georeferenced"](xyz), num_scans=4
    )
    (tmp_path / "growing/scans/run1").mkdir(parents=True)
    written = (tmp_path / "growing/scans", tmp_path / "growing/poses.csv")

    def write() -> None:
        for number, path in enumerate(sorted(scans.iterdir())):
            folder = written[0] / f"run{1 + number // 2}"
            folder.mkdir(exist_ok=True)
            shutil.copy(path, folder)
            time.sleep(0.1)

    shutil.copy(poses, written[1])
    writer = threading.Thread(target=write)
    writer.start()
    out = tmp_path / "out"
    result = segment(written, out, "-w", weights_path, "--follow", "--idle", "1", "--json", *words)
    writer.join()
    assert result.exit_code == 0, result.stderr
    assert json.loads(result.stdout)["scans"] == 4
    after = segment(written, tmp_path / "after", "-w", weights_path, *words)
    assert after.exit_code == 0, after.stderr
    names = ["map.ply", *(f"scans/run{1 + n // 2}/{n:06d}.ply" for n in range(4))]
    for name in names:
        assert (out / name).read_bytes() == (tmp_path / "after" / name).read_bytes()
