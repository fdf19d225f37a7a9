"""The checkpoint against SIGKILL, a full disk and Ctrl-C, with real processes."""

import json
import random
import resource
import signal
import subprocess
from pathlib import Path

import pytest

from tests.commands import (
    MOST_S,
    command,
    kill_at_random,
    num_events,
    outputs_of,
    run_to_its_end,
    start,
    wait_until,
)
from tests.recordings import write_recording

_NUM_SCANS = 500
_FEW_SCANS = 40
_KILLS = 20
_FEW_KILLS = 6


@pytest.fixture(scope="module")
def long_recording(tmp_path_factory) -> tuple[Path, Path]:
    return write_recording(tmp_path_factory.mktemp("long"), num_scans=_NUM_SCANS)


@pytest.fixture(scope="module")
def short_recording(tmp_path_factory) -> tuple[Path, Path]:
    return write_recording(tmp_path_factory.mktemp("short"), num_scans=_FEW_SCANS)


@pytest.fixture(scope="module")
def short_outputs(short_recording, weights_path, tmp_path_factory) -> dict[str, bytes]:
    """The outputs of a run of the short recording that nothing stopped."""
    out = tmp_path_factory.mktemp("whole") / "out"
    run_to_its_end(*words_of(short_recording, out, weights_path))
    return outputs_of(out)


def words_of(recording, output: Path, weights: Path, *options: str) -> tuple[object, ...]:
    return ("segment", *recording, "-o", output, "-w", weights, "-q", *options)


def test_a_run_killed_twenty_times_ends_byte_for_byte_like_one_never_killed(
    long_recording, tmp_path, weights_path
):
    run_to_its_end(*words_of(long_recording, tmp_path / "whole", weights_path))

    # killed again and again, each time further on
    rng, advanced = random.Random(0), 0
    for kills in range(_KILLS):
        before = num_events(tmp_path / "out")
        process = start(*words_of(long_recording, tmp_path / "out", weights_path))
        is_killed = kill_at_random(process, tmp_path / "out", rng)
        assert is_killed, f"finished after {kills} kills: too few scans"
        advanced += num_events(tmp_path / "out") > before
    assert advanced >= _KILLS // 2

    # then left to finish
    run_to_its_end(*words_of(long_recording, tmp_path / "out", weights_path))
    assert len(json.loads((tmp_path / "out/objects.json").read_text())) > 0
    assert outputs_of(tmp_path / "out") == outputs_of(tmp_path / "whole")
    assert num_events(tmp_path / "out") == _NUM_SCANS


@pytest.mark.parametrize("weights", ["unet_path", "weights_path"])
def test_labels_that_improve_survive_kills_too(short_recording, tmp_path, request, weights):
    path = request.getfixturevalue(weights)
    run_to_its_end(*words_of(short_recording, tmp_path / "whole", path, "--labelling", "fused"))

    rng = random.Random(1)
    words = words_of(short_recording, tmp_path / "out", path, "--labelling", "fused")
    for _ in range(_FEW_KILLS):
        if not kill_at_random(start(*words), tmp_path / "out", rng):
            break

    run_to_its_end(*words)
    assert outputs_of(tmp_path / "out") == outputs_of(tmp_path / "whole")
    assert num_events(tmp_path / "out") == _FEW_SCANS


@pytest.mark.parametrize("limit_kb", [60, 300, 700])
def test_a_full_disk_ends_with_one_line_and_resumes_after_space_is_made(
    short_recording, short_outputs, tmp_path, weights_path, limit_kb
):
    def limit_file_size() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit_kb * 1024, limit_kb * 1024))

    # no file can grow any more
    full = subprocess.run(
        command(*words_of(short_recording, tmp_path / "out", weights_path)),
        preexec_fn=limit_file_size,
        capture_output=True,
        text=True,
    )
    assert full.returncode == 1
    assert len(full.stderr.splitlines()) == 1
    assert "Traceback" not in full.stderr
    assert str(tmp_path / "out") in full.stderr
    assert num_events(tmp_path / "out") < _FEW_SCANS

    # there is room again
    run_to_its_end(*words_of(short_recording, tmp_path / "out", weights_path))
    assert outputs_of(tmp_path / "out") == short_outputs


def test_ctrl_c_finishes_the_scan_commits_exits_130_and_says_how_to_go_on(
    long_recording, tmp_path, weights_path
):
    words = words_of(long_recording, tmp_path / "out", weights_path)
    process = start(*words, stderr=subprocess.PIPE)
    wait_until(lambda: num_events(tmp_path / "out") >= 5, process)

    # the scan at hand is finished first
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=MOST_S)
    done = num_events(tmp_path / "out")

    assert process.returncode == 130
    assert 5 <= done < _NUM_SCANS
    assert (
        f"interrupted after {done} of {_NUM_SCANS} scans; continue with: mcpseg segment" in stderr
    )
    assert len(list((tmp_path / "out/scans").iterdir())) == done
    assert (tmp_path / "out/objects.json").exists()
