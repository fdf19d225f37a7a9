"""The commands of the README, top to bottom, in one folder, as somebody who reads it types them."""

import shlex
import shutil
from pathlib import Path

import pytest

from tests.commands import invoke
from tests.test_docs import README, ROOT, simple_commands

INSTALLS = {"git", "cd", "make", ".", "pip", "docker"}  # other programs, which this run stands for
SERVERS = {"view"}  # see tests/export/test_view.py
ELSEWHERE = {"walk.mcap", "site.e57", "scene0000_00/"}  # see tests/cli/test_segment_recordings.py
SMALLER = {  # what makes minutes and hours seconds; otherwise commands are as printed
    "synth": ["--rooms", "2", "--spacing", "0.1", "--jobs", "1"],
    "raytrace": ["--step", "2", "--h-res", "6", "--v-res", "6", "--jobs", "1"],
    "train": ["--epochs", "1", "--batch-size", "64", "--context", "4"],
}
SCANS = 3  # of the example


@pytest.fixture
def folder(labelled_run, tmp_path, monkeypatch) -> Path:
    """A clone's examples, cut short, and somebody's own recording with its truth."""
    walk = tmp_path / "examples" / "office_walk"
    for part in ("scans", "gt"):
        (walk / part).mkdir(parents=True)
        for path in sorted((ROOT / "examples/office_walk" / part).iterdir())[:SCANS]:
            shutil.copy(path, walk / part)
    lines = (ROOT / "examples/office_walk/poses.csv").read_text().splitlines(keepends=True)
    (walk / "poses.csv").write_text("".join(lines[: SCANS + 1]))

    shutil.copytree(labelled_run.scans, tmp_path / "scans")
    shutil.copy(labelled_run.scans.parent / "poses.csv", tmp_path)
    shutil.copytree(labelled_run.out / "scans", tmp_path / "gt")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_all_commands_work_in_order_in_one_folder(folder):
    pytest.importorskip("matplotlib")
    ran = []
    for words in simple_commands(README):
        if words[0] in INSTALLS or words[1] in SERVERS or ELSEWHERE & set(words):
            continue
        assert words[0] == "mcpseg", f"{shlex.join(words)}: a command that this test does not run"
        result = invoke(*words[1:], *SMALLER.get(words[1], []))
        assert result.exit_code == 0, f"{shlex.join(words)}: {result.stderr or result.exception}"
        ran.append(words[1])
    assert set(ran) == {"segment", "export", "eval", "synth", "raytrace", "train"}
    for made in ("office.html", "office.png", "map.html", "map.png", "trained"):
        assert (folder / made).exists()


def test_package_indexes_get_whole_addresses():
    pytest.importorskip("hatchling")
    from hatch_build import FILES, PAGES, whole_addresses

    text = whole_addresses("![a](examples/a.png) [b](docs/b.md#c) [d](https://d) [e](#e)")
    expected = f"![a]({FILES}examples/a.png) [b]({PAGES}docs/b.md#c) [d](https://d) [e](#e)"
    assert text == expected
