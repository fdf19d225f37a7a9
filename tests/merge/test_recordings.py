"""``mcpseg segment --recordings``: every recording by itself, then the merge, wherever it runs."""

import socket
import subprocess
import sys
from contextlib import ExitStack

import pytest

from mcpseg_cli.cli.recordings import _is_only_merged
from mcpseg_cli.errors import InputError
from mcpseg_cli.merge.engines import run_command
from mcpseg_cli.merge.recordings import read_recordings
from tests.commands import MOST_S, invoke, num_events, start, wait_until
from tests.recordings import write_recording

NAMES = ("one", "two")
FILES = ("map.ply", "objects.json", "events.jsonl", "state.sqlite")


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    """Two recordings; not to be changed."""
    folder = tmp_path_factory.mktemp("table")
    for seed, name in enumerate(NAMES):
        write_recording(folder / name, num_scans=5, seed=seed)
    lines = [f"{name}/scans,{name}/poses.csv" for name in NAMES]
    (folder / "table.csv").write_text("scans,poses\n" + "\n".join(lines) + "\n")
    return folder / "table.csv"


@pytest.fixture(scope="module")
def by_hand(table, unet_path, tmp_path_factory):
    """The merge of maps that were segmented one after another in this process."""
    folder = tmp_path_factory.mktemp("by_hand")
    for name in NAMES:
        recording = (table.parent / name / "scans", table.parent / name / "poses.csv")
        words = ("segment", *recording, "-o", folder / name, "-w", unet_path, "-q")
        assert invoke(*words).exit_code == 0
    words = ("merge", *(folder / name for name in NAMES), "-o", folder / "building", "-q")
    assert invoke(*words).exit_code == 0
    return folder / "building"


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def begin(entered: ExitStack, *words: object) -> subprocess.Popen:
    """Start a process that ends with the test."""
    quiet = subprocess.DEVNULL
    command = [sys.executable, "-m", *map(str, words)]
    process = subprocess.Popen(command, stdout=quiet, stderr=quiet)
    entered.callback(process.wait)
    entered.callback(process.kill)
    return process


def differences(one, other) -> list[str]:
    return [name for name in FILES if (one / name).read_bytes() != (other / name).read_bytes()]


def test_processes_make_what_one_after_another_makes(table, by_hand, unet_path, tmp_path):
    words = ("segment", "--recordings", table, "-o", tmp_path / "b", "-w", unet_path, "-j", 2)
    result = invoke(*words)
    assert result.exit_code == 0, result.output
    assert differences(by_hand, tmp_path / "b") == []
    assert _is_only_merged(tmp_path / "b")

    # the same again, for those who want to hear nothing
    assert invoke(*words, "-q").output == ""


def test_a_dask_cluster_of_which_a_worker_is_killed_makes_the_same(
    table, by_hand, unet_path, tmp_path
):
    pytest.importorskip("distributed")
    address, output = f"tcp://127.0.0.1:{free_port()}", tmp_path / "b"
    with ExitStack() as entered:
        port = address.rpartition(":")[2]
        begin(entered, "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port,
              "--no-dashboard")  # fmt: skip
        workers = [
            begin(entered, "distributed.cli.dask_worker", address, "--no-nanny", "--nthreads", 1,
                  "--no-dashboard", "--local-directory", tmp_path / f"w{number}")
            for number in range(3)
        ]  # fmt: skip
        wait_for_workers(address, 3)
        words = ("segment", "--recordings", table, "-o", output, "-w", unet_path)
        run = start(*words, "--engine", "dask", "--scheduler", address, stderr=subprocess.PIPE)
        folders = [output / "recordings" / name for name in NAMES]
        wait_until(lambda: any(num_events(folder) for folder in folders), run)
        workers[0].kill()
        _, told = run.communicate(timeout=MOST_S)
        assert run.returncode == 0, told
        assert "dask: 3 workers" in told
    assert differences(by_hand, output) == []


def wait_for_workers(address: str, count: int) -> None:
    from distributed import Client

    with Client(address, timeout=MOST_S) as client:
        client.wait_for_workers(count, timeout=MOST_S)


def test_a_recording_that_fails_is_told_and_the_others_are_kept(table, unet_path, tmp_path):
    text = "scans,poses\none/scans,one/poses.csv\nnowhere,poses.csv\n"
    (table.parent / "more.csv").write_text(text)
    words = ("segment", "--recordings", table.parent / "more.csv", "-o", tmp_path / "b")
    result = invoke(*words, "-w", unet_path, "-j", 2)
    assert result.exit_code == 1
    assert "1 of 2 failed" in result.output
    assert "nowhere: no such folder" in result.output
    assert (tmp_path / "b" / "recordings" / "one" / "map.ply").is_file()
    assert not (tmp_path / "b" / "map.ply").exists()


def test_a_command_ends_with_the_process_that_started_it(table, unet_path, tmp_path):
    recording = (table.parent / "one" / "scans", table.parent / "one" / "poses.csv")
    words = ["segment", *map(str, recording), "-o", str(tmp_path / "o"), "-w", str(unet_path)]
    script = f"from mcpseg_cli.merge.engines import run_command; run_command({words!r}, 1)"
    starter = subprocess.Popen([sys.executable, "-c", script])
    wait_until((tmp_path / "o" / "state.sqlite").exists, starter)
    starter.kill()
    starter.wait()
    outcome = run_command(tuple(words), 1)  # in use until the other has ended
    assert outcome.status == 0, outcome.stderr
    assert num_events(tmp_path / "o") == 5


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("poses\na\n", "no column 'scans'"),
        ("scans,colour\na,b\n", "column 'colour'"),
        ("scans,poses\n", "no recording"),
        ("scans,poses\n,a\n", "line 2: no scans"),
        ("scans,poses\na\n", "too many or too few"),
        ("scans,name\na,x\nb,x\n", "two recordings 'x'"),
        ("scans,name\na,../x\n", "name '../x'"),
        ("scans,settings\na,'\n", "settings"),
        ("scans,poses\na,b\0c\n", "line 2: a byte of 0"),
        ("scans\na\0\n", "line 2: a byte of 0"),
    ],
)
def test_a_table_that_is_none_is_refused(tmp_path, text, found):
    (tmp_path / "table.csv").write_text(text)
    with pytest.raises(InputError, match=found):
        read_recordings(tmp_path / "table.csv")


def test_a_table_gives_names_paths_and_settings(tmp_path):
    rows = ("scans,poses,transform,settings,name", "a/scans,a/p.csv,,,")
    row = "b/scans,b/p.csv,T.txt,--range 5,r2"
    (tmp_path / "table.csv").write_text("\n".join([*rows, row, ""]))
    one, two = read_recordings(tmp_path / "table.csv")
    assert (one.name, two.name) == ("a", "r2")
    assert one.inputs == (tmp_path / "a" / "scans", tmp_path / "a" / "p.csv")
    assert (one.transform, two.transform) == (None, tmp_path / "T.txt")
    assert two.settings == ("--range", "5")


def test_an_engine_needs_its_scheduler_and_a_table_no_scans(table, tmp_path):
    words = ("segment", "--recordings", table, "-o", tmp_path / "b")
    assert "go together" in invoke(*words, "--engine", "dask").output
    assert "leave out RECORDING" in invoke(*words, table.parent).output
    assert "Missing argument RECORDING" in invoke("segment", "-o", tmp_path / "b").output


def test_without_a_scheduler_the_error_says_how_to_start_one(table, tmp_path):
    pytest.importorskip("distributed")
    words = ("segment", "--recordings", table, "-o", tmp_path / "b", "--engine", "dask")
    result = invoke(*words, "--scheduler", f"tcp://127.0.0.1:{free_port()}")
    assert result.exit_code == 1
    assert "dask scheduler" in result.output
