"""Scans with headers that other programs write: their labelled copies are written and read."""

import struct
from pathlib import Path

import laspy
import numpy as np
import pytest

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats import Cloud, Labels, read_cloud, write_cloud

SYSTEM, SOFTWARE, VERSION, NUM_POINTS, SCALES = 26, 58, 25, 107, 131  # bytes of a header of LAS


def write_las(path: Path, at: int, patch: bytes) -> Path:
    header = laspy.LasHeader(point_format=1, version="1.2")
    header.scales = [0.001] * 3
    file = laspy.LasData(header)
    file.x, file.y, file.z = np.arange(30.0).reshape(3, 10) / 8
    file.write(path)
    data = bytearray(path.read_bytes())
    data[at : at + len(patch)] = patch
    path.write_bytes(data)
    return path


def write_labelled(path: Path, output: Path) -> Cloud:
    cloud = read_cloud(path)
    count = len(cloud)
    confidence = np.linspace(0, 1, count, dtype=np.float32)
    labels = Labels(np.ones(count, np.uint8), np.arange(count, dtype=np.int32), confidence, ("a",))
    write_cloud(output, cloud.with_labels(labels))
    again = read_cloud(output)
    np.testing.assert_allclose(again.xyz, cloud.xyz, atol=1e-3)
    np.testing.assert_array_equal(again.label("instance"), labels.instance)
    return again


@pytest.mark.parametrize("encoding", ["latin-1", "utf-8"])
@pytest.mark.parametrize("at", [SYSTEM, SOFTWARE])
@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_a_las_header_text_that_is_no_ascii_stays_as_it_is(at, encoding, suffix, tmp_path) -> None:
    text = "Zoller+Fröhlich".encode(encoding).ljust(32, b"\0")
    path = write_las(tmp_path / "a.las", at, text)
    write_labelled(path, tmp_path / f"b{suffix}")
    assert (tmp_path / f"b{suffix}").read_bytes()[at : at + 32] == text


def test_a_las_record_of_an_owner_that_is_no_ascii_is_written(tmp_path) -> None:
    path = tmp_path / "a.las"
    file = laspy.LasData(laspy.LasHeader(point_format=1, version="1.2"))
    file.header.vlrs.append(laspy.VLR("surv??", 42, "note", b"kept"))
    file.x = file.y = file.z = np.arange(3.0)
    file.write(path)
    path.write_bytes(path.read_bytes().replace(b"surv??", "survé".encode()))
    write_labelled(path, tmp_path / "b.las")
    assert b"kept" in [vlr.record_data_bytes() for vlr in laspy.read(tmp_path / "b.las").vlrs]


NAMES = {"latin-1": "öhen".encode("latin-1"), "utf-8": "öhe".encode(), "ascii": b"ohen"}


@pytest.mark.parametrize("suffix", [".las", ".laz"])
@pytest.mark.parametrize("encoding", NAMES)
def test_names_and_owners_of_records_in_any_encoding_are_read_and_written(
    encoding, suffix, tmp_path
) -> None:
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.add_extra_dim(laspy.ExtraBytesParams("h????", "u2", "H????"))
    header.vlrs.append(laspy.VLR("own????", 42, "note", b"kept"))
    header.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("far????", 43, "note", b"kept too")])
    file = laspy.LasData(header)
    file.x = file.y = file.z = np.arange(3.0)
    file["h????"] = np.arange(3)
    path = tmp_path / f"a{suffix}"
    file.write(path)
    path.write_bytes(path.read_bytes().replace(b"????", NAMES[encoding]))
    again = write_labelled(path, tmp_path / f"b{suffix}")
    name = "h" + NAMES[encoding].decode(encoding)
    np.testing.assert_array_equal(again.columns[name], [0, 1, 2])
    written = laspy.read(tmp_path / f"b{suffix}")
    assert b"kept" in [vlr.record_data_bytes() for vlr in written.vlrs]


@pytest.mark.parametrize("scale", [-0.001, 0.0, 5e-324, 1e-300, 1e300])
def test_a_las_of_odd_scales_is_written_and_read_again(scale, tmp_path) -> None:
    path = write_las(tmp_path / "a.las", SCALES, struct.pack("<3d", *[scale] * 3))
    write_labelled(path, tmp_path / "b.las")


@pytest.mark.parametrize("minor", [0, 1])
@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_an_old_las_is_written_and_read_again(minor, suffix, tmp_path) -> None:
    path = write_las(tmp_path / "a.las", VERSION, bytes([minor]))
    assert len(write_labelled(path, tmp_path / f"b{suffix}")) == 10


@pytest.mark.parametrize("width", [1e6, 1e9, 1e30])
def test_coordinates_far_apart_are_written_as_las_in_wider_steps(width, tmp_path) -> None:
    columns = {axis: np.array([0, width / 3, width]) for axis in "xyz"}
    write_cloud(tmp_path / "a.las", Cloud(columns))
    again = read_cloud(tmp_path / "a.las")
    np.testing.assert_allclose(again.xyz, Cloud(columns).xyz, atol=max(0.01, width * 1e-8))


def test_coordinates_beyond_all_numbers_are_refused_as_las(tmp_path) -> None:
    columns = {axis: np.array([-1e308, 1e308]) for axis in "xyz"}
    with pytest.raises(OutputError, match="no place for coordinates this far apart"):
        write_cloud(tmp_path / "a.las", Cloud(columns))


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_more_features_than_las_has_room_for_are_refused_in_one_line(suffix, tmp_path) -> None:
    columns = {axis: np.arange(4.0) for axis in "xyz"} | {"feature": np.ones((4, 384), np.float32)}
    with pytest.raises(OutputError, match=r"room for 341 attributes .* 384; .* --format ply"):
        write_cloud(tmp_path / f"a{suffix}", Cloud(columns))
    columns["feature"] = columns["feature"][:, :341]
    write_cloud(tmp_path / f"a{suffix}", Cloud(columns))
    assert len(read_cloud(tmp_path / f"a{suffix}")) == 4


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npz"])
def test_thousands_of_attributes_are_written_and_read_again(suffix, tmp_path) -> None:
    columns = {axis: np.arange(4.0) for axis in "xyz"}
    columns |= {f"feature_{number}": np.full(4, number, np.float32) for number in range(5000)}
    write_cloud(tmp_path / f"a{suffix}", Cloud(columns))
    again = read_cloud(tmp_path / f"a{suffix}")
    assert list(again.columns) == list(columns)
    np.testing.assert_array_equal(again.columns["feature_4999"], [4999] * 4)


@pytest.mark.parametrize("suffix", [".pcd", ".npz"])
def test_a_feature_of_thousands_of_values_is_written_and_read_again(suffix, tmp_path) -> None:
    columns = {axis: np.arange(4.0) for axis in "xyz"}
    columns["feature"] = np.arange(80_000, dtype=np.float32).reshape(4, -1)
    write_cloud(tmp_path / f"a{suffix}", Cloud(columns))
    again = read_cloud(tmp_path / f"a{suffix}").columns["feature"]
    np.testing.assert_array_equal(again, columns["feature"])


@pytest.mark.parametrize("version", [(3, 4), (1, 9), (0, 0), (255, 255)])
def test_a_las_of_a_version_that_nobody_knows_is_refused_in_one_line(version, tmp_path) -> None:
    path = write_las(tmp_path / "a.las", VERSION - 1, bytes(version))
    with pytest.raises(InputError, match=rf"LAS {version[0]}\.{version[1]}; expected LAS 1\.0 to"):
        read_cloud(path)


@pytest.mark.parametrize("minor", range(5))
@pytest.mark.parametrize("point_format", [1, 3, 6, 7])
def test_any_points_in_any_known_version_of_las_are_read_and_written_labelled(
    point_format, minor, tmp_path
) -> None:
    file = laspy.LasData(laspy.LasHeader(point_format=point_format, version="1.4"))
    file.x, file.y, file.z = np.arange(30.0).reshape(3, 10) / 8
    file.write(tmp_path / "a.las")
    data = bytearray((tmp_path / "a.las").read_bytes())
    data[VERSION] = minor  # its header stays as long as that of 1.4
    struct.pack_into("<I", data, NUM_POINTS, 10)
    (tmp_path / "a.las").write_bytes(data)
    write_labelled(tmp_path / "a.las", tmp_path / "b.las")


def test_las_1_5_is_read_and_written_labelled(tmp_path) -> None:
    file = laspy.LasData(laspy.LasHeader(point_format=6, version="1.5"))
    file.x, file.y, file.z = np.arange(30.0).reshape(3, 10) / 8
    file.write(tmp_path / "a.las")
    write_labelled(tmp_path / "a.las", tmp_path / "b.las")


@pytest.mark.parametrize("scale", [np.nan, np.inf, 0.0])
@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_extra_bytes_with_a_scale_of_no_use_are_refused_in_one_line(
    scale, suffix, tmp_path
) -> None:
    file = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    scaled = laspy.ExtraBytesParams("height", "uint16", scales=np.array([0.5]),
                                    offsets=np.array([1.0]))  # fmt: skip
    file.header.add_extra_dim(scaled)
    file.points = laspy.ScaleAwarePointRecord.zeros(10, header=file.header)
    path = tmp_path / f"a{suffix}"
    file.write(path)
    data = path.read_bytes()
    at = data.index(b"height") + 32 + 4 + 24 + 24 + 24
    assert struct.unpack_from("<d", data, at) == (0.5,)
    path.write_bytes(data[:at] + struct.pack("<d", scale) + data[at + 8 :])
    with pytest.raises(InputError, match="height has a scale or an offset of no use"):
        read_cloud(path)


def test_an_extended_las_record_whose_text_is_no_ascii_is_written(tmp_path) -> None:
    file = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    file.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("survey", 42, "note ??", b"kept")])
    file.x = file.y = file.z = np.arange(3.0)
    path = tmp_path / "a.las"
    file.write(path)
    path.write_bytes(path.read_bytes().replace(b"note ??", b"note \xff\xfe"))
    write_labelled(path, tmp_path / "b.las")
    assert b"kept" in [vlr.record_data for vlr in laspy.read(tmp_path / "b.las").evlrs]
