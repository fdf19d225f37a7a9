"""``mcpseg segment --range``: found from the scans, told once, kept by a run that is continued."""

import json
from pathlib import Path

import numpy as np

from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from tests.commands import segment

LONG = "mcpseg: range 5 m: a long lidar, by its reach; --range changes it"
ROOMS = "mcpseg: range 2 m: a scanner that sees all around, in rooms; --range changes it"


def range_of(output: Path) -> float:
    return json.loads((output / "run.json").read_text())["configuration"]["local_range"]


def stretch(scan: Path) -> None:
    """Make of a scan one of a long lidar."""
    cloud = read_cloud(scan)
    far = np.linspace(-30, 30, len(cloud), dtype=np.float32)
    write_cloud(scan, Cloud(cloud.columns | {"x": far}))


def test_networks_that_see_rooms_find_it_and_say_so_once(recording, tmp_path, unet_path):
    result = segment(recording, tmp_path / "out", "-w", unet_path)
    assert (result.exit_code, result.stderr.splitlines()) == (0, [ROOMS])
    assert "2 m, a scanner that sees all around, in rooms" in result.stdout
    assert range_of(tmp_path / "out") == 2.0


def test_the_methods_of_the_paper_keep_its_range_unless_told(recording, tmp_path, weights_path):
    for path in recording[0].iterdir():
        stretch(path)
    result = segment(recording, tmp_path / "a", "-w", weights_path)
    assert (result.exit_code, range_of(tmp_path / "a")) == (0, 2.0)
    assert "2 m, the default" in result.stdout
    result = segment(recording, tmp_path / "b", "-w", weights_path, "--range", "auto")
    assert (result.stderr.splitlines()[0], range_of(tmp_path / "b")) == (LONG, 5.0)


def test_what_is_given_is_taken(recording, tmp_path, unet_path):
    result = segment(recording, tmp_path / "out", "-w", unet_path, "--range", "1.5", "--json")
    assert (result.stderr, range_of(tmp_path / "out")) == ("", 1.5)
    assert json.loads(result.stdout)["scans"] == 4


def test_what_is_neither_a_number_nor_auto_is_wrong_usage(recording, tmp_path, unet_path):
    result = segment(recording, tmp_path / "out", "-w", unet_path, "--range", "far")
    assert result.exit_code == 2
    assert "--range" in result.stderr


def test_a_run_continued_with_other_scans_keeps_the_range_it_was_begun_with(
    make_recording, tmp_path, weights_path
):
    # two scans of a room
    scans, poses = make_recording(tmp_path / "input", num_scans=6)
    later = [(path, path.read_bytes()) for path in sorted(scans.iterdir())[2:]]
    rows = poses.read_text().splitlines()
    poses.write_text("\n".join(rows[:3]) + "\n")
    for path, _ in later:
        path.unlink()
    options = ["--range", "auto"]
    result = segment((scans, poses), tmp_path / "out", "-w", weights_path, *options)
    assert result.stderr.splitlines() == [ROOMS]

    # more scans of a long lidar, which would be most of the first five
    poses.write_text("\n".join(rows) + "\n")
    for path, content in later:
        path.write_bytes(content)
        stretch(path)
    result = segment((scans, poses), tmp_path / "out", "-w", weights_path, *options)
    assert (result.exit_code, range_of(tmp_path / "out")) == (0, 2.0)
    assert result.stderr.splitlines() == ["mcpseg: continuing after 2 scans"]
    assert "2 m, as the run was begun" in result.stdout


def test_running_again_finds_nothing_new_and_guesses_nothing(recording, tmp_path, unet_path):
    for options in ([], ["--range", "auto"]):
        segment(recording, tmp_path / "out", "-w", unet_path, "--range", "1.5")
        result = segment(recording, tmp_path / "out", "-w", unet_path, *options)
        assert result.stderr.splitlines() == ["mcpseg: nothing new: all 4 scans are labelled"]
        assert "1.5 m, as the run was begun" in result.stdout

    # started again, it is found again
    result = segment(recording, tmp_path / "out", "-w", unet_path, "--overwrite")
    assert (result.stderr.splitlines(), range_of(tmp_path / "out")) == ([ROOMS], 2.0)


def test_a_broken_first_scan_is_told_by_the_run_and_not_by_the_guess(
    recording, tmp_path, unet_path
):
    sorted(recording[0].iterdir())[0].write_bytes(b"no cloud")
    options = ["--on-error", "skip"]
    result = segment(recording, tmp_path / "out", "-w", unet_path, *options)
    assert result.exit_code == 0
    assert result.stderr.splitlines()[0] == ROOMS
    assert result.stderr.count("skipped") == 1
