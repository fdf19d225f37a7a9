"""The long campaign, for one small round: it works, and tells what it finds."""

import json
import random
import subprocess
import sys

import numpy as np
import pytest

from tests import soak_damage, soak_kills
from tests.forks import Ended
from tests.soak_files import Sound, sound_files
from tests.soak_report import MOST_MB, MOST_S, Report


def test_a_small_campaign_kills_damages_and_finds_nothing(tmp_path):
    path = tmp_path / "report.json"
    words = ["--seconds", "0", "--seed", "29", "--share", "0.1", "-o", str(path)]
    ended = subprocess.run(
        [sys.executable, "-m", "tests.soak", *words], capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stdout + ended.stderr
    report = json.loads(path.read_text())
    assert (report["first_seed"], report["rounds"], report["failures"]) == (29, 1, [])
    assert sum(report["kills"].values()) >= 1
    assert report["bit_flips"]["read"] >= 1
    assert set(report["others"]) == {"races", "full disks", "power cuts"}
    readers = {"cloud.laz", "walk.mcap", "area.h5", "samples.h5", "TUM.rgb.txt", "merge-1.run.json"}
    assert readers <= set(report["read"]) | set(report["refused"])
    assert sum(report["refused"].values()) > 9
    assert 0 < report["slowest_s"] < MOST_S
    assert 0 < report["most_mb"] < MOST_MB
    assert ended.stdout.splitlines()[-1] == "nothing found"


def read_badly(path):
    raise IndexError("out of range")


def hold_memory(path):
    np.ones(64 << 20, np.uint8).sum()  # more than malloc keeps


@pytest.fixture
def report():
    return Report(41)


def test_files_that_nobody_damaged_are_read(tmp_path):
    (tmp_path / "read").mkdir()
    for sound in sound_files(tmp_path / "sound"):
        path = tmp_path / "read" / sound.name
        path.write_bytes(sound.data)
        sound.read(path)
        path.unlink()


def test_an_exception_of_another_kind_is_found_and_its_seed_told(tmp_path, report):
    soak_damage.read_damaged(41, [Sound("a.tum", b"1 2", read_badly)], tmp_path, report, 3)
    assert len(report.failures) == 3
    assert report.failures[2] == "seed 41, file 2, a.tum: IndexError: out of range"
    assert report.last_lines().splitlines()[-1] == report.failures[2]


def test_the_most_memory_that_a_file_takes_is_told_with_its_place(tmp_path):
    # in a process of its own: what others of a long run give back meanwhile is taken off
    script = (
        "import sys; from pathlib import Path; from tests import soak_damage, test_soak\n"
        "report, folder = test_soak.Report(41), Path(sys.argv[1])\n"
        "files = [test_soak.Sound('a.tum', b'1 2', test_soak.hold_memory)]\n"
        "soak_damage.read_damaged(41, files, folder, report, 1)\n"
        "print(report.most_mb, report.most, sep='; ')"
    )
    words = [sys.executable, "-c", script, str(tmp_path)]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    most_mb, _, place = said.strip().partition("; ")
    assert 50 < float(most_mb) < 80
    assert place == "seed 41, file 0, a.tum"


@pytest.mark.parametrize("status", [-6, -9, -14, 139])
def test_a_reader_that_ends_its_process_is_found(tmp_path, report, monkeypatch, status):
    class Asked:
        def __init__(self, function, folder):
            (folder / "at").write_text("seed 41, file 7, a.laz")

        def ended(self, seconds):
            return Ended(status, "terminate called")

    monkeypatch.setattr(soak_damage, "Asked", Asked)
    soak_damage.play(41, tmp_path / "damaged", report)
    assert report.failures == [
        f"seed 41, file 7, a.laz: the process ended: status {status}: 'terminate called'"
    ]


@pytest.mark.parametrize(
    ("found", "wrong"),
    [({"a": b"1", "b": b""}, None), ({"a": b"2", "b": b""}, "a"), ({"a": b"1"}, "b"),
     ({"a": b"1", "b": b"", ".a.7-8.part": b""}, ".a.7-8.part")],
)  # fmt: skip
def test_outputs_that_differ_are_missing_or_are_left_over_are_found(tmp_path, found, wrong):
    assert soak_kills.difference(found, {"a": b"1", "b": b""}, tmp_path, 0) == wrong


@pytest.mark.parametrize(
    ("ended", "is_fault"),
    [(Ended(0, ""), False), (Ended(1, "mcpseg: a\n"), False), (Ended(0, "a warning\n"), True),
     (Ended(1, "two\nlines\n"), True), (Ended(-11, ""), True), (Ended(70, "Traceback"), True)],
)  # fmt: skip
def test_a_command_may_end_well_in_silence_or_badly_in_one_line(ended, is_fault):
    assert (ended.fault is not None) == is_fault


def test_damage_follows_from_the_seed():
    made = [soak_damage.damage(bytes(range(256)), random.Random(5)) for _ in range(2)]
    assert made[0] == made[1] != bytes(range(256))
