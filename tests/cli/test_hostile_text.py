"""Names, notices and class tables that are meant for the terminal, the spreadsheet or the disk."""

import csv
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest

from mcpseg_cli.cli.display import notice, plain, print_table
from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.evaluate.truth import open_truth
from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from mcpseg_cli.resumable import guarded_cell, is_file_name
from mcpseg_cli.segment.events import read_events
from mcpseg_cli.segment.run_record import RunRecord
from tests.areas import write_area
from tests.commands import MOST_S, command, invoke, segment

ESCAPE = "\x1b]0;owned\x07\x1b[2J"


def one_line(result) -> str:
    """Check that a command ended in one line that a terminal can show; return it."""
    assert result.exit_code == 1, result.output
    assert result.exception is None or isinstance(result.exception, SystemExit)
    (line,) = result.stderr.splitlines()
    assert line.isprintable()
    assert len(line) <= 1100
    return line


# --- the terminal ---


@pytest.mark.parametrize(
    ("text", "shown"),
    [("wall ü 3", "wall ü 3"), ("a\x1b[2Jb", r"a\x1b[2Jb"), ("a\nb\tc", r"a\nb\tc"),
     ("a\x9bb\x7f", r"a\x9bb\x7f"), ("exe\u202etxt", r"exe\u202etxt"), ("a\udcffb", r"a\xffb")],
)  # fmt: skip
def test_letters_that_a_terminal_obeys_are_written_out(text, shown):
    assert plain(text) == shown


def test_long_lines_keep_their_beginning_and_their_remedy():
    line = plain("file: " + "x" * 9000 + "; expected less; shorten it")
    assert len(line) < 1010
    assert line.startswith("file: xxx")
    assert line.endswith("; expected less; shorten it")


def test_notices_and_tables_obey_no_name(capsys):
    notice(f"mcpseg: {ESCAPE}")
    print_table([(ESCAPE, f"a\n{ESCAPE}")])
    captured = capsys.readouterr()
    assert "\x1b" not in captured.out + captured.err
    assert len(captured.out.splitlines()) == 1


def test_a_scan_s_name_does_not_reach_the_terminal_as_it_is(recording, tmp_path, weights_path):
    scans, poses = recording
    bad = scans / f"000002{ESCAPE.replace('/', '')}.ply"
    (scans / "000002.ply").rename(bad)
    bad.write_bytes(b"ply\nbroken")
    poses.write_text(poses.read_text().replace("\n000002,", f"\n{bad.stem},"))
    line = one_line(segment(recording, tmp_path / "out", "-w", weights_path))
    assert r"\x1b]0;owned" in line
    skipped = segment(recording, tmp_path / "out", "-w", weights_path, "--on-error", "skip")
    assert "\x1b" not in skipped.stdout + skipped.stderr


def test_a_long_header_of_poses_is_shortened(recording, tmp_path, weights_path):
    recording[1].write_text(f"x,y,z,{'q' * 9000}\n0,0,0,0\n")
    one_line(segment(recording, tmp_path / "out", "-w", weights_path))


# --- the spreadsheet ---


@pytest.mark.parametrize("text", ["=cmd|' /C calc'!A0", "+1", "-1", "@SUM(1)", "\t=1", "\r=1"])
def test_text_that_a_spreadsheet_would_compute_is_guarded(text):
    assert guarded_cell(text) == f"'{text}"


def test_other_text_is_left_as_it_is():
    assert [guarded_cell(text) for text in ("wall", "a=b", "")] == ["wall", "a=b", ""]


def test_class_names_in_a_csv_of_objects_are_guarded(labelled_run, tmp_path):
    out = shutil.copytree(labelled_run.out, tmp_path / "out")
    record = json.loads((out / "run.json").read_text())
    record["classes"] = [f"=cmd|{number}" for number in range(len(record["classes"]))]
    (out / "run.json").write_text(json.dumps(record))
    assert invoke("export", out, "-o", tmp_path / "objects.csv", "-q").exit_code == 0
    rows = list(csv.DictReader(io.StringIO((tmp_path / "objects.csv").read_text())))
    assert all(row["class_name"].startswith("'=cmd|") for row in rows)
    assert all(float(row["centroid_x"]) is not None for row in rows)


# --- files of a run ---


@pytest.mark.parametrize("name", ["../x", "/etc/passwd", "a/../b", "a//b", "..", ".", "", "a\0b"])
def test_names_that_lead_elsewhere_are_no_file_names(name):
    assert not is_file_name(name)
    assert is_file_name("000001.ply")
    assert is_file_name("run1/000001.ply")


BAD_LINES = [
    '{"name": "../../x.ply", "ms": {}}', '{"name": "/etc/passwd"}', '{"name": 3}', "[" * 9999,
    '{"name": "a.ply", "ms": {"read": 1e400}}', '{"name": "a.ply", "ms": {"read": "1e9999"}}',
    '{"name": "a.ply", "ms": [1]}', '{"name": "a\\ud800.ply"}', '{"name": "a\\u0000.ply"}',
    '{"name": "a.ply", "ms": {"read": -1}}', "null", '{"name": "a.ply", "skipped": 1}',
]  # fmt: skip


@pytest.mark.parametrize("line", BAD_LINES)
def test_events_that_lie_are_refused(tmp_path, line):
    (tmp_path / "events.jsonl").write_text(line + "\n")
    with pytest.raises(InputError, match="line 1 that is no event"):
        read_events(tmp_path / "events.jsonl")


BAD_RECORDS = [
    "[" * 9999, '{"a":' * 9999, "1" * 5000, '"\\ud800"', "null", '{"classes": ["a\\nb"]}',
    '{"configuration": {"format": "../x"}, "classes": []}',
    '{"configuration": {}, "classes": ["a\\nelement vertex 9"]}',
    '{"configuration": {"voxel_size": 1e400}, "classes": []}',
    '{"configuration": {"voxel_size": "big"}, "classes": []}',
    '{"configuration": {}, "classes": ["a", 3]}', '{"configuration": {}, "classes": ["a,b"]}',
]  # fmt: skip


@pytest.mark.parametrize("text", BAD_RECORDS)
def test_records_of_runs_that_lie_are_refused_in_one_line(labelled_run, tmp_path, text):
    out = shutil.copytree(labelled_run.out, tmp_path / "out")
    (out / "run.json").write_text(text)
    with pytest.raises(InputError, match=r"run\.json"):
        RunRecord.read(out)
    for words in (("eval", out, out / "map.ply"), ("export", out, "-o", tmp_path / "a.ply")):
        one_line(invoke(*words))


@pytest.mark.parametrize(
    "text",
    ["[" * 9999, '{"objects": [{"id": 400000000, "name": "a/b"}]}',
     '{"objects": [{"id": 100000000000000000000, "name": "a/b"}]}',
     '{"objects": [{"id": 1e400, "name": "a/b"}]}', '{"objects": [{"id": 1, "name": "\\ud800"}]}'],
)  # fmt: skip
def test_records_of_truths_that_lie_are_refused(labelled_run, tmp_path, text):
    truth = tmp_path / "truth"
    shutil.copytree(labelled_run.out / "scans", truth / "gt")
    (truth / "raytrace.json").write_text(text)
    with pytest.raises(InputError, match=r"raytrace\.json"):
        open_truth(truth / "gt")


def test_class_names_that_break_headers_are_refused_where_they_come_in(tmp_path):
    path, names = tmp_path / "cloud.las", ("wall\nelement vertex 9",)
    columns = {name: np.zeros(3, np.float32) for name in "xyz"}
    write_cloud(path, Cloud(columns | {"semantic": np.zeros(3, np.uint8)}, names))
    with pytest.raises(InputError, match="a class named"):
        read_cloud(path)


# --- what ends a command ---


def test_sigterm_ends_any_command_as_ctrl_c_does(tmp_path):
    script = (
        "import os, signal, sys, time\n"
        "from mcpseg_cli.cli import app, main\n"
        "@app.command()\n"
        "def wait():\n"
        "    os.kill(os.getpid(), signal.SIGTERM)\n"
        "    time.sleep(9)\n"
        "sys.argv = ['mcpseg', 'wait']\n"
        "main()\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=MOST_S, check=False
    )
    assert (result.returncode, len(result.stderr.splitlines())) == (130, 1)
    assert "interrupted" in result.stderr


def test_sigterm_is_as_before_when_a_command_has_ended(tmp_path):
    invoke("eval", tmp_path / "x", tmp_path / "y")
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def test_an_output_that_is_no_utf8_is_written_or_refused_in_one_line(
    labelled_run, weights_path, tmp_path
):
    out = os.fsencode(tmp_path) + b"/out\xff"
    words = [os.fsencode(word) for word in command("segment", *labelled_run.recording, "-o")]
    options = [os.fsencode(word) for word in ("-w", str(weights_path), "-q")]
    result = subprocess.run(
        [*words, out, *options], capture_output=True, text=True, timeout=MOST_S, check=False
    )
    assert (result.returncode, result.stderr) == (0, "")
    assert os.path.exists(out + b"/map.ply")  # noqa: PTH110


# --- what is left, and what is advised ---


def test_what_a_killed_export_left_goes_with_the_next_one_to_the_place(labelled_run, tmp_path):
    ended = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"],
                           capture_output=True, text=True, check=True)  # fmt: skip
    folder = tmp_path / "to"
    folder.mkdir()
    for suffix in ("ply", "laz", "npz", "pcd", "csv"):
        (folder / f".other.{ended.stdout.strip()}-7.part.{suffix}").write_text("half")
    assert invoke("export", labelled_run.out, "-o", folder / "map.ply", "-q").exit_code == 0
    assert [path.name for path in folder.iterdir()] == ["map.ply"]


def test_eval_of_a_map_without_a_voxel_advises_to_wait_not_to_record_again(labelled_run, tmp_path):
    out = shutil.copytree(labelled_run.out, tmp_path / "out")
    header = (out / "map.ply").read_bytes().partition(b"end_header\n")[0] + b"end_header\n"
    (out / "map.ply").write_bytes(re.sub(rb"element vertex \d+", b"element vertex 0", header))
    line = one_line(invoke("eval", out, labelled_run.out / "map.ply"))
    assert "no labelled voxel yet" in line
    assert "wait for a scan" in line


def test_data_that_cannot_be_written_beside_asks_for_a_cache(tmp_path, monkeypatch):
    from mcpseg_cli.config import AugmentSettings, SampleSettings
    from mcpseg_cli.train import fold_data
    from mcpseg_cli.train.folds import find_areas

    def refuse(*args):
        raise PermissionError(13, "Permission denied", "samples.h5")

    write_area(tmp_path / "area")
    monkeypatch.setattr(fold_data, "prepare_samples", refuse)
    settings = fold_data.DataSettings(SampleSettings(), AugmentSettings())
    with pytest.raises(OutputError, match="name a folder for them with --cache"):
        fold_data.prepare(find_areas(tmp_path), settings, lambda *_: None)


def test_links_in_the_folder_of_virtual_scans_are_refused(tmp_path):
    from mcpseg_cli.raytrace.run import _check_folder

    (tmp_path / "users").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "out/scans").symlink_to(tmp_path / "users")
    with pytest.raises(OutputError, match="a link to"):
        _check_folder(tmp_path / "out", None, None)
