"""Recordings: scans in natural order, each with its pose, in the map frame."""

import shutil
from pathlib import Path, PurePosixPath

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import Cloud, write_cloud
from mcpseg_cli.formats.natural_order import split_ending
from mcpseg_cli.formats.recording import ScanFile, list_clouds, open_recording, read_scan


def make_scans(folder: Path, names: list[str]) -> Path:
    folder.mkdir()
    for name in names:
        write_cloud(folder / name, Cloud({axis: np.arange(3, dtype=np.float32) for axis in "xyz"}))
    return folder


def write_poses(path: Path, scans: list[str], header: bool = True) -> Path:
    """Write poses whose x is the row's number; with a scan column if ``header``."""
    if header:
        lines = ["scan,x,y,z", *(f"{name},{row},0,0" for row, name in enumerate(scans))]
    else:
        lines = ["x,y,z", *(f"{row},0,0" for row in range(len(scans)))]
    path.write_text("\n".join(lines) + "\n")
    return path


def rows_by_name(recording: list[ScanFile]) -> dict[str, float]:
    return {source.path.name: float(source.pose[0, 3]) for source in recording}


# --- which scans, in which order ---


def test_scans_come_in_natural_order(tmp_path: Path) -> None:
    scans = make_scans(tmp_path / "scans", ["scan_10.ply", "scan_2.ply", "scan_1.ply", "a_3.ply"])
    assert [path.name for path in list_clouds(scans)] == [
        "a_3.ply",
        "scan_1.ply",
        "scan_2.ply",
        "scan_10.ply",
    ]


def test_numbers_of_any_width_come_in_order_of_value(tmp_path: Path) -> None:
    scans = make_scans(
        tmp_path / "scans", ["010.ply", "9.ply", "1700000000123456789.ply", "0011.ply"]
    )
    names = [path.name for path in list_clouds(scans)]
    assert names == ["9.ply", "010.ply", "0011.ply", "1700000000123456789.ply"]


def test_formats_may_be_mixed_and_other_files_are_passed_over(tmp_path: Path) -> None:
    scans = make_scans(tmp_path / "scans", ["3.ply", "1.las", "2.npz", "0.pcd", "4.laz"])
    for name in ("notes.txt", ".DS_Store", ".5.ply", "Thumbs.db"):
        (scans / name).write_bytes(b"x")
    names = [path.name for path in list_clouds(scans)]
    assert names == ["0.pcd", "1.las", "2.npz", "3.ply", "4.laz"]


def test_an_ending_in_capitals_counts(tmp_path: Path) -> None:
    scans = make_scans(tmp_path / "scans", ["0.ply"])
    (scans / "0.ply").rename(scans / "0.PLY")
    assert [path.name for path in list_clouds(scans)] == ["0.PLY"]


def test_two_scans_of_one_name_are_refused_with_both_files(tmp_path: Path) -> None:
    scans = make_scans(tmp_path / "scans", ["0.ply", "1.las", "1.ply"])
    with pytest.raises(InputError, match=r"1\.las and 1\.ply have the same scan name"):
        list_clouds(scans)


def test_a_folder_without_scans_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no scans"):
        list_clouds(tmp_path)


def test_a_missing_folder_is_told_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="no such folder"):
        list_clouds(tmp_path / "scans")
    with pytest.raises(InputError, match="a file; expected a folder"):
        list_clouds(tmp_path / "file")


# --- pairing ---


@pytest.mark.parametrize("ending", ["", ".ply"], ids=["without ending", "with ending"])
def test_poses_pair_by_name_in_any_order(tmp_path: Path, ending: str) -> None:
    scans = make_scans(tmp_path / "scans", ["a.ply", "b.ply", "c.ply"])
    poses = write_poses(tmp_path / "poses.csv", [f"{name}{ending}" for name in "cab"])
    assert rows_by_name(open_recording(scans, poses)) == {"a.ply": 1, "b.ply": 2, "c.ply": 0}


def test_poses_without_names_pair_by_order(tmp_path: Path) -> None:
    scans = make_scans(tmp_path / "scans", ["s10.ply", "s9.ply"])
    poses = write_poses(tmp_path / "poses.csv", ["", ""], header=False)
    assert rows_by_name(open_recording(scans, poses)) == {"s9.ply": 0, "s10.ply": 1}


@pytest.mark.parametrize("num_poses", [1, 3])
def test_poses_without_names_must_be_as_many_as_scans(tmp_path: Path, num_poses: int) -> None:
    scans = make_scans(tmp_path / "scans", ["0.ply", "1.ply"])
    poses = write_poses(tmp_path / "poses.csv", [""] * num_poses, header=False)
    with pytest.raises(InputError, match=rf"poses\.csv: {num_poses} poses for 2 scans"):
        open_recording(scans, poses)


def test_a_scan_without_a_pose_is_named(tmp_path: Path) -> None:
    scans = make_scans(tmp_path / "scans", ["a.ply", "b.ply"])
    with pytest.raises(InputError, match=r"no pose for scan b\.ply"):
        open_recording(scans, write_poses(tmp_path / "poses.csv", ["a"]))


@pytest.mark.parametrize("extra", ["c", "a.ply"], ids=["other scan", "same scan twice"])
def test_a_pose_without_a_scan_is_named(tmp_path: Path, extra: str) -> None:
    scans = make_scans(tmp_path / "scans", ["a.ply", "b.ply"])
    with pytest.raises(
        InputError, match=f"a pose for {extra.removesuffix('.ply')}, which is not among the scans"
    ):
        open_recording(scans, write_poses(tmp_path / "poses.csv", ["a", "b", extra]))


@pytest.mark.parametrize("far", ["70000", "-70000", "1e300"])
def test_a_position_too_far_for_the_map_is_refused(tmp_path: Path, far: str) -> None:
    scans = make_scans(tmp_path / "scans", ["a.ply"])
    (tmp_path / "poses.csv").write_text(f"x,y,z\n0,{far},0\n")
    with pytest.raises(InputError, match=r"poses\.csv: positions up to .*subtract a common offset"):
        open_recording(scans, tmp_path / "poses.csv")


# --- reading ---


def read_one(path: Path, xyz: np.ndarray, frame: str, pose: np.ndarray, voxel_size: float = 0.1):
    write_cloud(path, Cloud({axis: xyz[:, column] for column, axis in enumerate("xyz")}))
    return read_scan(ScanFile(path, pose), frame, voxel_size)


def test_scans_in_the_sensors_frame_are_rotated_and_then_moved(tmp_path: Path) -> None:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    pose[:3, 3] = [10, 20, 30]
    scan, _ = read_one(
        tmp_path / "a.ply", np.array([[1, 0, 0], [0, 1, 0]], np.float32), "sensor", pose
    )
    np.testing.assert_allclose(scan.xyz, [[10, 21, 30], [9, 20, 30]], atol=1e-5)
    np.testing.assert_array_equal(scan.position, [10, 20, 30])


def test_scans_in_the_maps_frame_stay_where_they_are(tmp_path: Path) -> None:
    pose = np.eye(4)
    pose[:3, 3] = [10, 20, 30]
    xyz = np.random.default_rng(0).normal(size=(50, 3)).astype(np.float32)
    scan, _ = read_one(tmp_path / "a.ply", xyz, "map", pose)
    np.testing.assert_array_equal(scan.xyz, xyz)


def test_the_file_keeps_its_own_coordinates_whatever_the_frame(tmp_path: Path) -> None:
    pose = np.eye(4)
    pose[:3, 3] = [10, 20, 30]
    xyz = np.ones((2, 3))
    _, cloud = read_one(tmp_path / "a.ply", xyz, "sensor", pose)
    np.testing.assert_array_equal(cloud.xyz, xyz)


@pytest.mark.parametrize(
    ("far", "voxel_size"), [(70_000.0, 0.1), (-70_000.0, 0.1), (1e300, 0.1), (45_000.0, 0.01)]
)
def test_coordinates_too_large_for_the_map_are_refused(
    tmp_path: Path, far: float, voxel_size: float
) -> None:
    xyz = np.zeros((3, 3))
    xyz[1, 1] = far
    with pytest.raises(InputError, match=r"a\.ply: coordinates up to .*subtract a common offset"):
        read_one(tmp_path / "a.ply", xyz, "map", np.eye(4), voxel_size)


def test_a_pose_that_carries_a_scan_too_far_is_refused(tmp_path: Path) -> None:
    pose = np.eye(4)
    pose[0, 3] = 1e300
    with pytest.raises(InputError, match="coordinates up to"):
        read_one(tmp_path / "a.ply", np.ones((3, 3)), "sensor", pose)


def test_positions_alone_are_refused_for_scans_in_the_sensors_frame(tmp_path: Path) -> None:
    scans = tmp_path / "scans"
    scans.mkdir()
    write_cloud(scans / "a.ply", Cloud({axis: np.zeros(1, np.float32) for axis in "xyz"}))
    poses = write_poses(tmp_path / "poses.csv", ["a"])
    with pytest.raises(InputError, match="positions only"):
        open_recording(scans, poses, "sensor")
    assert open_recording(scans, poses, "map")


def test_a_recording_in_the_sensors_frame_is_the_same_as_in_the_maps(
    tmp_path: Path, make_recording
) -> None:
    scans, poses_path = make_recording(tmp_path / "map", num_scans=2)
    moved = shutil.copytree(tmp_path / "map", tmp_path / "sensor")
    for source in open_recording(scans, poses_path):
        scan, cloud = read_scan(source, "map", 0.1)
        xyz = (scan.xyz - source.pose[:3, 3]) @ source.pose[:3, :3]
        columns = cloud.columns | {axis: xyz[:, column] for column, axis in enumerate("xyz")}
        write_cloud(moved / "scans" / source.path.name, Cloud(columns))
    for ours, theirs in zip(
        open_recording(scans, poses_path),
        open_recording(moved / "scans", moved / "poses.csv"),
        strict=True,
    ):
        expected, _ = read_scan(ours, "map", 0.1)
        actual, _ = read_scan(theirs, "sensor", 0.1)
        np.testing.assert_allclose(actual.xyz, expected.xyz, atol=1e-5)


@given(st.from_regex(r"[a.é_]{0,4}(/[a.é_]{1,5}){0,2}", fullmatch=True))
def test_names_are_split_before_their_ending_as_pathlib_does(name):
    path = PurePosixPath(name)
    if path.as_posix() == name and path.name and path.name[-1] != "." and path.name.strip("."):
        stem, ending = split_ending(name)
        assert (stem, ending) == (path.with_suffix("").as_posix(), path.suffix)


def test_a_scan_is_named_below_its_folder_however_that_is_spelled(tmp_path):
    for folder, path in (("scans", "scans/run1/7.ply"), (".", "run1/7.ply"), ("/", "/run1/7.ply")):
        assert ScanFile(Path(path), None, Path(folder)).name == "run1/7.ply"
    assert ScanFile(Path("scans/7.ply"), None).name == "7.ply"
    source = ScanFile(tmp_path / "a" / "7.ply", None, tmp_path)
    assert source.with_pose(np.eye(4)).name == source.name == "a/7.ply"
