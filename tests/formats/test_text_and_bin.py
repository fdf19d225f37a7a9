"""Clouds that are only read: KITTI's sweeps and tables of text; folders in folders."""

from pathlib import Path

import numpy as np
import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import read_cloud
from mcpseg_cli.formats.recording import list_clouds, open_recording

XYZ = np.array([[1.5, -2.25, 0.5], [3.0, 4.0, 5.0], [-1.0, 0.125, 2.0]])
RGB = np.array([[255, 0, 7], [1, 2, 3], [9, 9, 9]])
NORMALS = np.array([[0.6, 0.8, 0], [0, 0, 1], [1, 0, 0]])


def text(path: Path, table: np.ndarray, *before: str, delimiter: str = " ") -> Path:
    rows = [delimiter.join(f"{value:g}" for value in row) for row in table]
    path.write_text("\n".join([*before, *rows]) + "\n")
    return path


TABLES = {
    "x y z": (XYZ, [], None),
    "intensity": (np.c_[XYZ, [0.1, 0.2, 0.3]], [], "intensity"),
    "colours": (np.c_[XYZ, RGB], [], "rgb"),
    "normals": (np.c_[XYZ, NORMALS], [], "nx"),
    "intensity and colours": (np.c_[XYZ, [-2000, 5, 9], RGB], [], "rgb"),
    "a count first": (np.c_[XYZ, [-2000, 5, 9], RGB], ["3"], "rgb"),
    "named columns": (np.c_[RGB, XYZ], ["//R G B X Y Z"], "rgb"),
}


@pytest.mark.parametrize("delimiter", [" ", ",", ";", "\t"])
@pytest.mark.parametrize("kind", TABLES)
def test_columns_of_text_are_told_by_names_or_values(kind, delimiter, tmp_path):
    table, before, extra = TABLES[kind]
    cloud = read_cloud(text(tmp_path / "a.xyz", table, *before, delimiter=delimiter))
    np.testing.assert_array_equal(cloud.xyz, XYZ)
    if extra == "rgb":
        np.testing.assert_array_equal(cloud.rgb, RGB)
    else:
        assert cloud.rgb is None
        assert extra is None or extra in cloud.columns


def test_fractions_are_colours_and_scaled(tmp_path):
    cloud = read_cloud(text(tmp_path / "a.txt", np.c_[XYZ, RGB / 255]))
    np.testing.assert_allclose(cloud.rgb, RGB, atol=1)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        ("1 2 3 4 5\n", "5 columns without names"),
        ("1 2 3 -4 500 9\n", "6 columns without names"),
        ("x y\n1 2\n", "columns x y over 2 numbers"),
        ("1 2 3\n1 2\n", "number of columns changed"),
        ("5\n1 2 3\n", "5 points promised, 1 found"),
        ("1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", "which is a pose"),
        ("", "no points"),
    ],
)
def test_tables_that_cannot_be_told_are_refused(content, complaint, tmp_path):
    (tmp_path / "a.txt").write_text(content)
    with pytest.raises(InputError, match=complaint):
        read_cloud(tmp_path / "a.txt")


def test_sweeps_of_kitti_are_x_y_z_intensity(tmp_path):
    np.c_[XYZ, [0, 0.5, 1]].astype("<f4").tofile(tmp_path / "0.bin")
    cloud = read_cloud(tmp_path / "0.bin")
    np.testing.assert_array_equal(cloud.xyz, XYZ)
    np.testing.assert_array_equal(cloud.columns["intensity"], [0, 0.5, 1])


@pytest.mark.parametrize("num_points", [4, 5, 20])
def test_sweeps_of_nuscenes_have_a_ring(num_points, tmp_path):
    rng = np.random.default_rng(num_points)
    xyz = rng.uniform(-50, 50, (num_points, 3)).astype("<f4")
    rest = np.c_[rng.uniform(0, 255, num_points), rng.integers(0, 32, num_points)]
    np.c_[xyz, rest].astype("<f4").tofile(tmp_path / "0.pcd.bin")
    cloud = read_cloud(tmp_path / "0.pcd.bin")
    np.testing.assert_array_equal(cloud.xyz, xyz)
    np.testing.assert_array_equal(cloud.columns["ring"], rest[:, 1])


@pytest.mark.parametrize("content", [b"x" * 160, np.full(40, -7, "<f4").tobytes(), b"abc"])
def test_other_binary_files_are_refused(content, tmp_path):
    (tmp_path / "0.bin").write_bytes(content)
    with pytest.raises(InputError, match="bytes that are no x y z intensity"):
        read_cloud(tmp_path / "0.bin")


# --- folders ---


def test_scans_in_sub_folders_are_named_by_their_path(tmp_path):
    for name in ("run2/0", "run1/10", "run1/9"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        text(tmp_path / f"{name}.xyz", XYZ)
    poses = tmp_path / "poses.csv"
    poses.write_text("scan,x,y,z\nrun1/9,0,0,0\nrun1/10.xyz,1,0,0\n0,2,0,0\n")
    recording = open_recording(tmp_path, poses)
    assert [source.name for source in recording] == ["run1/9.xyz", "run1/10.xyz", "run2/0.xyz"]
    assert [source.pose[0, 3] for source in recording] == [0, 1, 2]


def test_sub_folders_are_passed_over_where_there_are_scans_and_runs_always(tmp_path):
    (tmp_path / "out/scans").mkdir(parents=True)
    text(tmp_path / "out/scans/0.xyz", XYZ)
    (tmp_path / "a").mkdir()
    text(tmp_path / "a/1.xyz", XYZ)
    (tmp_path / "out/state.sqlite").touch()
    assert [path.name for path in list_clouds(tmp_path)] == ["1.xyz"]
    text(tmp_path / "2.xyz", XYZ)
    assert [path.name for path in list_clouds(tmp_path)] == ["2.xyz"]


def test_a_folder_of_other_files_is_refused_with_what_it_has(tmp_path):
    for name in ("a.obj", "b.obj", "c.ply.gz"):
        (tmp_path / name).touch()
    with pytest.raises(InputError, match=r"no scans, but 2 \.obj, 1 \.ply\.gz"):
        list_clouds(tmp_path)


@pytest.mark.parametrize(("name", "poses"), [("scans", "poses.csv"), ("velodyne", "poses.txt")])
def test_scans_with_their_poses_beside_are_a_recording(name, poses, tmp_path):
    (tmp_path / name).mkdir()
    text(tmp_path / name / "0.xyz", XYZ)
    lines = {"poses.csv": "x,y,z\n7,0,0\n", "poses.txt": "1 0 0 7 0 1 0 0 0 0 1 0\n"}
    (tmp_path / poses).write_text(lines[poses])
    (source,) = open_recording(tmp_path)
    assert (source.name, source.pose[0, 3]) == ("0.xyz", 7)
    assert source.frame == ("sensor" if name == "velodyne" else None)


def test_clouds_without_poses_need_a_pose_file(tmp_path):
    text(tmp_path / "0.xyz", XYZ)
    with pytest.raises(InputError, match="without poses; expected a pose file"):
        open_recording(tmp_path)


def test_a_folder_of_other_files_is_told_by_what_the_first_is(tmp_path):
    for name in ("a.dat", "b.dat", "c.txt~"):
        (tmp_path / name).write_bytes(b"ASTM-E57" + bytes(40))
    with pytest.raises(InputError, match=r"but 2 \.dat, 1 \.txt~; a\.dat: it is E57; expected"):
        list_clouds(tmp_path)


@pytest.mark.parametrize("name", ["a.e57", "a.ptx", "a.mcap", "a.bag", "a.db3", "a.las"])
def test_a_file_that_is_something_else_is_recognised(tmp_path, name):
    (tmp_path / name).write_bytes(b"ply\nformat ascii 1.0\n" + bytes(200))
    with pytest.raises(InputError, match="it is PLY"):
        open_recording(tmp_path / name)


def test_quoted_names_are_read_as_pdal_writes_them(tmp_path):
    head = '"X","Y","Z","Intensity","Red","Green","Blue"'
    (tmp_path / "a.txt").write_text(head + "\n1,2,3,0.5,255,128,0\n4,5,6,0.5,9,8,7\n")
    cloud = read_cloud(tmp_path / "a.txt")
    np.testing.assert_array_equal(cloud.xyz, [[1, 2, 3], [4, 5, 6]])
    np.testing.assert_array_equal(cloud.rgb, [[255, 128, 0], [9, 8, 7]])


@pytest.mark.parametrize(
    ("files", "scans"),
    [
        (("poses.txt", "calib.txt", "velodyne/0.bin", "velodyne/1.bin"), ["0.bin", "1.bin"]),
        (("poses.txt", "run1/0.ply", "run1/times.txt"), ["0.ply"]),
        (("times.txt", "0.bin", "1.bin"), ["0.bin", "1.bin"]),
        (("times.txt", "0.bin", "1.ply"), ["1.ply"]),
        (("0.txt", "1.txt", "notes/2.txt"), ["0.txt", "1.txt"]),
        (("0.bin", "old/1.ply"), ["0.bin"]),
    ],
)
def test_text_that_lies_beside_scans_is_none(tmp_path, files, scans):
    for name in files:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    assert [path.name for path in list_clouds(tmp_path)] == scans
