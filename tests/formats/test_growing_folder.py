"""A recording that is being written: a scan is handed out once, whole, and with its pose."""

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.growing_folder import GrowingFolder, is_being_written

HEADER = "scan,x,y,z\n"
Clock = Callable[[float], None]


@pytest.fixture
def later(monkeypatch) -> Clock:
    """Let time pass: a clock of the test's own."""
    now = [1000.0]
    monkeypatch.setattr("mcpseg_cli.formats.growing_folder.monotonic", lambda: now[0])

    def pass_by(seconds: float) -> None:
        now[0] += seconds

    return pass_by


@pytest.fixture
def folder(tmp_path: Path) -> GrowingFolder:
    (tmp_path / "scans").mkdir()
    (tmp_path / "poses.csv").write_text(HEADER)
    return GrowingFolder(tmp_path / "scans", tmp_path / "poses.csv")


def add_scan(folder: GrowingFolder, name: str, size: int = 10) -> None:
    (folder.directory / name).write_bytes(b"x" * size)


def add_pose(folder: GrowingFolder, *rows: str, end: str = "\n") -> None:
    with folder.poses_path.open("a") as file:
        file.write("\n".join(rows) + end)


def names(folder: GrowingFolder, **options: bool) -> list[str]:
    return [source.path.name for source in folder.look(**options)]


def names_after(folder: GrowingFolder, later: Clock, seconds: float = 0.2) -> list[str]:
    """Look, wait and look again."""
    folder.look()
    later(seconds)
    return names(folder)


def test_a_scan_comes_when_it_is_the_same_at_two_looks(folder, later) -> None:
    add_scan(folder, "0.ply")
    add_pose(folder, "0,1,2,3")
    assert names(folder) == []
    later(0.1)
    assert names(folder) == []
    later(0.1)
    assert names(folder) == ["0.ply"]
    np.testing.assert_array_equal(folder.look()[0].pose[:3, 3], [1, 2, 3])


def test_a_scan_that_grows_waits(folder, later) -> None:
    add_pose(folder, "0,1,2,3")
    for size in range(10, 15):
        add_scan(folder, "0.ply", size)
        assert names(folder) == []
        later(0.14)
    folder.look()
    later(0.2)
    assert names(folder) == ["0.ply"]


def test_a_scan_that_a_program_has_open_for_writing_waits_however_long(folder, later) -> None:
    add_pose(folder, "0,1,2,3")
    with (folder.directory / "0.ply").open("wb") as file:
        file.write(b"half")
        file.flush()
        if not is_being_written(folder.directory / "0.ply"):
            pytest.skip("this file system does not tell")
        assert names_after(folder, later, 60.0) == []
        file.write(b"the rest")
    assert names_after(folder, later) == ["0.ply"]


def test_a_format_that_does_not_count_its_points_has_to_be_quiet_for_longer(
    folder, later, monkeypatch
) -> None:
    monkeypatch.setattr("mcpseg_cli.formats.growing_folder._COUNTED", ())
    add_scan(folder, "0.ply")
    add_pose(folder, "0,1,2,3")
    assert names_after(folder, later, 0.9) == []
    later(0.2)
    assert names(folder) == ["0.ply"]


def test_a_scan_waits_for_its_pose_and_for_the_end_of_its_line(folder, later) -> None:
    add_scan(folder, "0.ply")
    assert names_after(folder, later) == []
    add_pose(folder, "0,1,2,3", end="")
    assert names(folder) == []
    add_pose(folder, "4")
    later(1.0)
    assert names(folder) == ["0.ply"]
    np.testing.assert_array_equal(folder.look()[0].pose[:3, 3], [1, 2, 34])


def test_later_scans_wait_for_earlier_ones(folder, later) -> None:
    add_scan(folder, "0.ply")
    add_scan(folder, "1.ply")
    add_pose(folder, "0,1,2,3", "1,1,2,3")
    folder.look()
    later(0.2)
    add_scan(folder, "0.ply", 20)
    assert names(folder) == []
    later(1.0)
    assert names(folder) == ["0.ply", "1.ply"]


def test_what_was_taken_does_not_come_again(folder, later) -> None:
    add_scan(folder, "0.ply")
    add_scan(folder, "1.ply")
    add_pose(folder, "0,1,2,3", "1,1,2,3")
    names_after(folder, later)
    folder.take(folder.look()[0])
    assert names(folder) == ["1.ply"]


def test_scans_that_were_consumed_before_come_at_once(folder) -> None:
    add_scan(folder, "0.ply")
    add_scan(folder, "1.ply")
    add_pose(folder, "0,1,2,3", "1,1,2,3")
    again = GrowingFolder(folder.directory, folder.poses_path, consumed=["0.ply"])
    assert names(again) == ["0.ply"]


def test_a_pose_that_changes_after_its_scan_was_taken_is_refused(folder, later) -> None:
    add_scan(folder, "0.ply")
    add_pose(folder, "0,1,2,3")
    names_after(folder, later)
    folder.take(folder.look()[0])
    folder.poses_path.write_text(HEADER + "0,1,2,4\n")
    later(1.0)
    with pytest.raises(InputError, match=r"the pose of 0\.ply has changed"):
        folder.look()


def test_a_pose_file_that_is_written_anew_is_waited_for(folder, later) -> None:
    add_scan(folder, "0.ply")
    add_scan(folder, "1.ply")
    add_pose(folder, "0,1,2,3")
    names_after(folder, later)
    folder.take(folder.look()[0])
    folder.poses_path.write_text(HEADER + "1,1,2,3\n")
    later(1.0)
    assert names(folder) == []
    assert "no pose for 0.ply, which is labelled" in str(folder.problem)
    add_pose(folder, "0,1,2,3")
    later(1.0)
    assert names(folder) == ["1.ply"]


def test_a_scan_that_comes_before_taken_ones_is_refused(folder, later) -> None:
    add_scan(folder, "1.ply")
    add_pose(folder, "1,1,2,3", "0,1,2,3")
    names_after(folder, later)
    folder.take(folder.look()[0])
    add_scan(folder, "0.ply")
    later(1.0)
    with pytest.raises(InputError, match=r"1\.ply is gone, or others have come before it"):
        folder.look()


def test_a_lost_pose_comes_as_such_and_a_missing_one_when_later_ones_have_long_come(
    folder, later
) -> None:
    for number in range(3):
        add_scan(folder, f"{number}.ply")
    add_pose(folder, "0,nan,nan,nan", "2,1,2,3")
    assert names_after(folder, later) == ["0.ply"]
    assert folder.look()[0].lost == "nan in line 2"
    later(11.0)
    assert names(folder) == ["0.ply", "1.ply", "2.ply"]


def test_at_the_end_what_is_there_counts(folder) -> None:
    add_scan(folder, "0.ply")
    add_scan(folder, "1.ply")
    add_pose(folder, "0,1,2,3")
    add_pose(folder, "1,1,2,3", end="")
    assert names(folder, is_over=True) == ["0.ply", "1.ply"]


def test_what_keeps_scans_from_being_paired_is_told_and_raised_at_the_end(tmp_path) -> None:
    folder = GrowingFolder(tmp_path / "scans", tmp_path / "poses.csv")
    assert names(folder) == []
    assert "no such folder" in str(folder.problem)
    (tmp_path / "scans").mkdir()
    add_scan(folder, "0.ply")
    assert names(folder) == []
    assert "poses.csv" in str(folder.problem)
    with pytest.raises(InputError, match=r"poses\.csv: no such file"):
        folder.look(is_over=True)


def test_poses_in_a_folder_are_watched_too(tmp_path, later) -> None:
    (tmp_path / "scans").mkdir()
    (tmp_path / "poses").mkdir()
    folder = GrowingFolder(tmp_path / "scans", tmp_path / "poses")
    add_scan(folder, "0.ply")
    (tmp_path / "poses/0.txt").write_text("1 0 0 5\n0 1 0")
    assert names_after(folder, later) == []
    (tmp_path / "poses/0.txt").write_text("1 0 0 5\n0 1 0 6\n0 0 1 7\n0 0 0 1\n")
    later(1.0)
    assert names(folder) == ["0.ply"]


def test_a_scan_that_cannot_be_read_may_change_for_some_seconds(folder, later) -> None:
    add_scan(folder, "0.ply")
    add_pose(folder, "0,1,2,3")
    names_after(folder, later)
    (source,) = folder.look()
    assert folder.may_change(source)
    assert not folder.is_other_now(source)
    later(10.0)
    assert not folder.may_change(source)
    os.utime(source.path)
    assert folder.is_other_now(source)


def test_scans_that_come_into_sub_folders_later_are_found(folder, later) -> None:
    rows = iter(range(4))
    for name in ("run1/0.ply", "run1/1.ply", "run2/0.ply"):
        (folder.directory / name).parent.mkdir(exist_ok=True)
        os.utime(folder.directory, (1.0, 1.0))  # nothing new in it since long ago
        os.utime(folder.directory / "run1", (1.0 + next(rows), 1.0))
        add_scan(folder, name)
        add_pose(folder, f"{name},1,2,3")
        (ready,) = names_after(folder, later)
        assert ready == Path(name).name
        folder.take(folder.look()[0])
    assert [source.name for source in folder.given] == ["run1/0.ply", "run1/1.ply", "run2/0.ply"]
