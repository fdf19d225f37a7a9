"""The long campaign, for two seconds: it works, and tells what it finds."""

import json

import pytest

from tests import soak, soak_files, soak_parts


@pytest.fixture
def no_kills(monkeypatch):
    monkeypatch.setattr(soak.Kills, "play", lambda *_: None)
    monkeypatch.setattr(soak.soak_parts, "play", lambda *_: None)


def test_a_campaign_of_two_seconds_kills_damages_and_finds_nothing(tmp_path, capsys):
    words = ["--seconds", "2", "--seed", "3", "-o", str(tmp_path / "report.json")]
    assert soak.main(words) == 0
    report = json.loads((tmp_path / "report.json").read_text())
    assert (report["first_seed"], report["failures"]) == (3, [])
    assert report["rounds"] >= 1
    assert sum(report["kills"].values()) >= 1
    assert report["others"]["bit flips"] >= soak_parts.FLIPS_A_ROUND
    assert {"cloud.laz", "poses.json", "walk.mcap", "area.h5"} <= set(report["refused"])
    assert capsys.readouterr().out.splitlines()[-1] == "nothing found"


def test_an_exception_of_another_kind_is_found_and_its_seed_told(no_kills, monkeypatch, capsys):
    def read_badly(path):
        raise IndexError("out of range")

    files = [soak_files.Sound("a.tum", b"1 2", read_badly)]
    monkeypatch.setattr(soak_files, "sound_files", lambda folder: folder.mkdir() or files)
    assert soak.main(["--seconds", "0", "--seed", "41"]) == 1
    found = capsys.readouterr().out.splitlines()[1:]
    assert found
    assert all(line.startswith("seed 41: damaged file ") for line in found)
    assert all(line.endswith(", a.tum: IndexError: out of range") for line in found)


def test_outputs_that_differ_are_found(monkeypatch, capsys):
    monkeypatch.setattr(soak.soak_parts, "play", lambda *_: None)
    outputs = iter([{"map.ply": b"a"}, {"map.ply": b"b"}])
    monkeypatch.setattr(soak, "outputs_of", lambda output: next(outputs))
    monkeypatch.setattr(soak, "num_events", lambda output: soak.NUM_SCANS)
    monkeypatch.setattr(soak, "start", lambda words: None)
    monkeypatch.setattr(soak, "kill_at_random", lambda process, output, rng: False)
    monkeypatch.setattr(soak, "run_to_its_end", lambda *words: None)
    assert soak.main(["--seconds", "0", "--seed", "4"]) == 1
    assert "seed 4: unet differs after kills" in capsys.readouterr().out
