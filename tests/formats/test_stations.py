"""E57 and PTX: each station is a scan, with its own pose."""

from pathlib import Path

import numpy as np
import pytest
from pye57 import E57

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import Cloud, write_cloud
from mcpseg_cli.formats.recording import open_recording, read_scan
from tests import containers
from tests.containers import WALK, Sweep

WRITERS = {".e57": containers.write_e57, ".ptx": containers.write_ptx}
every_format = pytest.mark.parametrize("suffix", WRITERS)


@pytest.fixture(scope="module")
def walk() -> list[Sweep]:
    return containers.sweeps_of(WALK / "scans", WALK / "poses.csv", 2)


@every_format
def test_stations_give_the_scans_of_the_folder_to_the_last_bit(suffix, walk, tmp_path):
    file = WRITERS[suffix](tmp_path / f"site{suffix}", walk)
    folder = open_recording(*containers.write_folder(tmp_path / "folder", walk), "sensor")
    recording = open_recording(file)
    assert recording.frame == "sensor"
    for source, expected in zip(recording, folder, strict=True):
        scan, _ = read_scan(source, "map", 0.1)
        true, _ = read_scan(expected, "sensor", 0.1)
        np.testing.assert_array_equal(scan.xyz, true.xyz)
        np.testing.assert_array_equal(scan.rgb, true.rgb)
        np.testing.assert_array_equal(scan.pose, true.pose)


@every_format
def test_stations_are_known_by_their_content(suffix, walk, tmp_path):
    small = [one._replace(xyz=one.xyz[:9], rgb=one.rgb[:9]) for one in walk]
    file = WRITERS[suffix](tmp_path / f"site{suffix}", small)
    kept = [source.fingerprint() for source in open_recording(file)]
    small[1] = small[1]._replace(xyz=small[1].xyz + 1)
    again = open_recording(WRITERS[suffix](file, small))
    still = [source.is_still(one) for source, one in zip(again, kept, strict=True)]
    assert still == [True, False]


def test_stations_are_named_after_the_file_and_themselves(walk, tmp_path):
    (tmp_path / "folder").mkdir()
    containers.write_e57(tmp_path / "folder/site.e57", walk)
    containers.write_e57(tmp_path / "folder/yard.e57", walk[:1])
    recording = open_recording(tmp_path / "folder")
    names = [source.name for source in recording]
    assert names == ["site_Scan_0.ply", "site_Scan_1.ply", "yard.ply"]


def test_invalid_points_of_an_e57_are_dropped(tmp_path):
    data = {f"cartesian{axis}": np.arange(4.0) for axis in "XYZ"}
    data["cartesianInvalidState"] = np.array([0, 2, 0, 1], np.int8)
    with E57(str(tmp_path / "a.e57"), mode="w") as file:
        file.write_scan_raw(data, rotation=np.array([1, 0, 0, 0]), translation=np.zeros(3))
    (source,) = open_recording(tmp_path / "a.e57")
    np.testing.assert_array_equal(source.read().columns["x"], [0, 2])


def test_points_of_a_ptx_without_return_are_dropped(walk, tmp_path):
    (source, *_) = open_recording(containers.write_ptx(tmp_path / "a.ptx", walk))
    assert len(source.read()) == len(walk[0].xyz)


@every_format
def test_a_file_that_is_cut_short_is_refused(suffix, walk, tmp_path):
    file = WRITERS[suffix](tmp_path / f"site{suffix}", walk)
    file.write_bytes(file.read_bytes()[:1500])
    with pytest.raises(InputError, match=r"a whole (E57|PTX) file"):
        open_recording(file)


def test_an_e57_by_name_only_is_refused(tmp_path):
    (tmp_path / "a.e57").write_bytes(b"no such thing")
    with pytest.raises(InputError, match="no E57 by its first bytes"):
        open_recording(tmp_path / "a.e57")


def test_clouds_and_stations_side_by_side_need_one_frame(walk, tmp_path):
    scans, poses = containers.write_folder(tmp_path / "folder", walk)
    containers.write_e57(scans / "more.e57", walk[:1])
    lines = poses.read_text().splitlines()
    poses.write_text("\n".join([*lines, lines[1].replace("000000", "more")]) + "\n")
    with pytest.raises(InputError, match="stations among clouds"):
        open_recording(scans, poses)
    assert len(open_recording(scans, poses, "sensor")) == 3


def test_stations_without_a_pose_need_a_pose_file(tmp_path):
    lines = ["1", "1", "0 0 0", "1 0 0", "0 1 0", "0 0 1", "2 0 0 0", "0 2 0 0", "0 0 2 0"]
    (tmp_path / "a.ptx").write_text("\n".join([*lines, "0 0 0 1", "1 2 3 0.5"]) + "\n")
    with pytest.raises(InputError, match="a station's matrix is no rotation"):
        open_recording(tmp_path / "a.ptx")


def test_a_single_cloud_is_told_from_a_recording(tmp_path: Path):
    write_cloud(tmp_path / "a.ply", Cloud({axis: np.zeros(1) for axis in "xyz"}))
    with pytest.raises(InputError, match="a file; it is PLY; expected a folder of scans"):
        open_recording(tmp_path / "a.ply")
