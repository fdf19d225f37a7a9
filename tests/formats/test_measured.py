"""Clouds as sensors and other programs leave them: pixels without points, noise, COPC, PCD."""

from pathlib import Path

import laspy
import numpy as np
import pytest

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats import Cloud, Labels, read_cloud, read_measured, write_cloud
from mcpseg_cli.formats.pcd import pcd_pose
from mcpseg_cli.formats.recording import open_recording, read_scan

XYZ = np.array([[1.0, 2, 3], [4, 5, 6], [7, 8, 9], [1, 1, 1]])


def las(path: Path, point_format: int = 7, version: str = "1.4", copc: bool = False, **columns):
    header = laspy.LasHeader(point_format=point_format, version=version)
    header.scales = [1e-3] * 3
    if copc:
        header.vlrs.append(laspy.VLR("copc", 1, "COPC info VLR", bytes(160)))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = XYZ.T
    for name, values in columns.items():
        setattr(cloud, name, values)
    cloud.write(path)
    return path


def labels(num_points: int) -> Labels:
    instance = np.ones(num_points, np.int32)
    return Labels(np.full(num_points, 2, np.uint8), instance, np.ones(num_points, np.float32))


def test_pixels_without_a_point_are_read_and_marked(tmp_path):
    xyz = XYZ.astype(np.float32)
    xyz[1, 0], xyz[3] = np.nan, np.inf
    columns = {axis: xyz[:, place] for place, axis in enumerate("xyz")}
    write_cloud(tmp_path / "a.ply", Cloud(columns))
    cloud = read_measured(tmp_path / "a.ply")
    assert cloud.valid.tolist() == [True, False, True, False]
    np.testing.assert_array_equal(cloud.measured().xyz, xyz[[0, 2]])
    with pytest.raises(InputError, match=r"2 of 4 points have NaN or infinite"):
        read_cloud(tmp_path / "a.ply")


def test_points_withheld_and_noise_are_marked(tmp_path):
    path = las(tmp_path / "a.las", withheld=[1, 0, 0, 0], classification=[1, 7, 2, 18])
    assert read_measured(path).valid.tolist() == [False, False, True, False]
    assert len(read_cloud(path)) == 4


def test_nothing_but_noise_is_refused_with_the_counts(tmp_path):
    path = las(tmp_path / "a.las", classification=[7, 7, 7, 18])
    with pytest.raises(
        InputError, match=r"none of 4 points is measured.*4 are flagged as withheld"
    ):
        read_measured(path)


def test_las_refuses_what_it_cannot_hold(tmp_path):
    xyz = np.where(XYZ == 5, np.nan, XYZ)
    cloud = Cloud(dict(zip("xyz", xyz.T, strict=True)))
    with pytest.raises(OutputError, match="no place for points without coordinates"):
        write_cloud(tmp_path / "a.las", cloud)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_copc_is_read_and_written_as_plain_1_4(tmp_path, suffix):
    cloud = read_cloud(las(tmp_path / "a.copc.laz", copc=True))
    write_cloud(tmp_path / f"b{suffix}", cloud.with_labels(labels(4)))
    written = laspy.read(tmp_path / f"b{suffix}")
    assert str(written.header.version) == "1.4"
    assert [vlr.user_id for vlr in written.header.vlrs if vlr.user_id == "copc"] == []
    np.testing.assert_allclose(written.xyz, XYZ, atol=1e-3)
    assert list(written["semantic"]) == [2] * 4


@pytest.mark.parametrize("minor", [0, 1])
def test_las_1_0_and_1_1_are_read_and_written_as_1_4(tmp_path, minor):
    path = las(tmp_path / "a.las", 1, "1.2", gps_time=[1.0, 2, 3, 4])
    data = bytearray(path.read_bytes())
    data[25] = minor
    path.write_bytes(data)
    write_cloud(tmp_path / "b.laz", read_cloud(path).with_labels(labels(4)))
    written = laspy.read(tmp_path / "b.laz")
    assert str(written.header.version) == "1.4"
    np.testing.assert_allclose(written.xyz, XYZ, atol=1e-3)
    assert list(written.gps_time) == [1, 2, 3, 4]


def test_georeferenced_maps_fit_into_las(tmp_path):
    far = XYZ + np.array([500_000.0, 5_400_000.0, 300.0])
    write_cloud(tmp_path / "a.laz", Cloud(dict(zip("xyz", far.T, strict=True))))
    np.testing.assert_allclose(read_cloud(tmp_path / "a.laz").xyz, far, atol=1e-3)


def pcd(path: Path, viewpoint: str = "1 2 3 0.7071068 0 0 0.7071068", width: int = 2) -> Path:
    head = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
    head += f"WIDTH {width}\nHEIGHT {4 // width}\nVIEWPOINT {viewpoint}\nPOINTS 4\nDATA binary\n"
    path.write_bytes(head.encode() + XYZ.astype("<f4").tobytes())
    return path


def test_rows_and_viewpoint_of_pcd_are_kept(tmp_path):
    write_cloud(tmp_path / "b.pcd", read_cloud(pcd(tmp_path / "a.pcd")).with_labels(labels(4)))
    text = (tmp_path / "b.pcd").read_bytes()
    assert b"WIDTH 2\nHEIGHT 2\nVIEWPOINT 1 2 3 0.7071068 0 0 0.7071068\nPOINTS 4\n" in text


def test_the_viewpoint_of_pcd_is_a_pose(tmp_path):
    pose = pcd_pose(pcd(tmp_path / "a.pcd"))
    np.testing.assert_allclose(pose[:3, :3], [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-6)
    assert pose[:3, 3].tolist() == [1, 2, 3]
    assert pcd_pose(pcd(tmp_path / "a.pcd", "0 0 0 1 0 0 0")) is None


def viewpoints(folder: Path, *said: str) -> Path:
    """Write a PCD for each viewpoint: at the origin where it is empty."""
    folder.mkdir()
    for number, viewpoint in enumerate(said):
        pcd(folder / f"{number}.pcd", viewpoint or "0 0 0 1 0 0 0")
    return folder


def test_viewpoints_are_the_poses_where_none_are_given(tmp_path):
    folder = viewpoints(tmp_path / "scans", "1 2 3 0.7071068 0 0 0.7071068", "2 2 3 1 0 0 0")
    recording = open_recording(folder, None, "sensor")
    assert recording.columns == "VIEWPOINT of each scan"
    assert [source.pose[0, 3] for source in recording] == [1, 2]
    scan, _ = read_scan(recording[0], "sensor", 0.1)
    turned = np.stack([-XYZ[:, 1], XYZ[:, 0], XYZ[:, 2]], axis=1)
    np.testing.assert_allclose(scan.xyz, turned + np.array([1, 2, 3]), atol=1e-5)


def test_a_pose_file_counts_more_than_viewpoints(tmp_path):
    folder = viewpoints(tmp_path / "scans", "1 2 3 1 0 0 0", "2 2 3 1 0 0 0")
    (tmp_path / "poses.csv").write_text("scan,x,y,z\n0,7,0,0\n1,8,0,0\n")
    recording = open_recording(folder, tmp_path / "poses.csv")
    assert [source.pose[0, 3] for source in recording] == [7, 8]


def test_the_first_viewpoints_may_be_the_origin_later_ones_say_none(tmp_path):
    folder = viewpoints(tmp_path / "scans", "", "", "1 0 0 1 0 0 0", "", "2 0 0 1 0 0 0")
    with pytest.raises(InputError, match=r"no pose for 1 of 5 scans, as 3\.pcd"):
        open_recording(folder)
    recording = open_recording(folder, on_error="skip")
    assert [source.pose is None for source in recording] == [False] * 3 + [True, False]
    np.testing.assert_array_equal(recording[1].pose, np.eye(4))
    assert recording[3].lost == "its VIEWPOINT says none"


def test_viewpoints_that_all_say_none_are_no_poses(tmp_path):
    folder = viewpoints(tmp_path / "scans", "", "")
    with pytest.raises(InputError, match="without poses"):
        open_recording(folder)


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.ply", b"LASF" + bytes(300), "it is LAS or LAZ"),
        ("a.las", b"ply\nformat", "it is PLY"),
        ("a.pcd", b"ASTM-E57" + bytes(40), "it is E57"),
        ("a.npz", b"\x89HDF\r\n\x1a\n" + bytes(40), "it is HDF5"),
        ("a.ply", b"version https://git-lfs.github.com/spec/v1\n", "a pointer of Git LFS"),
    ],
)
def test_files_that_are_something_else_are_recognised(tmp_path, name, content, says):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=says):
        read_cloud(tmp_path / name)


def test_refusals_list_the_columns_and_the_nearest_name(tmp_path):
    text = "ply\nformat ascii 1.0\nelement vertex 1\n"
    text += "".join(f"property float {name}\n" for name in ("x", "y", "z_coord", "red"))
    (tmp_path / "a.ply").write_text(text + "end_header\n1 2 3 4\n")
    says = r"no property z among x, y, z_coord, red; nearest is z_coord"
    with pytest.raises(InputError, match=says):
        read_cloud(tmp_path / "a.ply")
