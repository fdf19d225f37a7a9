"""Files that lie: what they claim is compared with what they are before room is made for it."""

import bz2
import io
import json
import struct
import zipfile
from contextlib import suppress
from pathlib import Path

import h5py
import laspy
import lz4.frame
import numpy as np
import pytest
import trimesh
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from pye57 import E57

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import claims, read_cloud
from mcpseg_cli.formats.claims import SPARE, check_claim
from mcpseg_cli.formats.hdf5 import read_building_h5
from mcpseg_cli.formats.meshes import read_mesh
from mcpseg_cli.formats.npy import parse_npy, read_npy
from mcpseg_cli.formats.poses import read_poses
from mcpseg_cli.formats.recordings import bag_chunks, e57_stations, ros_messages
from mcpseg_cli.formats.recordings.depth_frames import read_depth
from mcpseg_cli.formats.recordings.phone import open_record3d
from mcpseg_cli.formats.rigid import from_quaternion

XYZ = np.arange(120.0).reshape(40, 3)
HUGE = 10**12
FUZZ = settings(
    max_examples=150,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def write_laz(path: Path, point_format: int = 3, num_points: int = 40) -> bytearray:
    header = laspy.LasHeader(point_format=point_format, version="1.4")
    header.scales = [0.001] * 3
    header.add_extra_dim(laspy.ExtraBytesParams("echo", np.float32))
    file = laspy.LasData(header)
    file.x, file.y, file.z = np.random.default_rng(0).uniform(0, 9, (3, num_points))
    file.write(path)
    return bytearray(path.read_bytes())


def laz_record(data: bytes) -> int:
    """Find where the record of LAZ has what it says, bytes."""
    return data.index(b"laszip encoded") + 52


@pytest.mark.parametrize("chunk_size", [0, 1, 2, 39, 1 << 31, (1 << 32) - 2, (1 << 32) - 1])
@pytest.mark.parametrize("point_format", [3, 7])
def test_a_laz_with_another_chunk_size_is_refused(
    chunk_size: int, point_format: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.laz"
    data = write_laz(path, point_format)
    struct.pack_into("<I", data, laz_record(data) + 12, chunk_size)
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"point|whole buffer"):
        read_cloud(path)
    assert capfd.readouterr().err == ""  # where lazrs says that it panics


def test_a_laz_with_other_lengths_of_chunks_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.laz"
    data = write_laz(path)
    (start,) = struct.unpack_from("<I", data, 96)
    (table,) = struct.unpack_from("<q", data, start)
    struct.pack_into("<q", data, start, table - 9)
    data = data[: table - 9] + data[table:] + bytes(9)
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"a\.laz: a file that does not decode \(chunks of "):
        read_cloud(path)


def test_a_laz_whose_layers_are_longer_than_their_chunk_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.laz"
    data = write_laz(path, 7)
    (start,) = struct.unpack_from("<I", data, 96)
    struct.pack_into("<I", data, start + 8 + 40 + 4, 0xFFFFFF00)  # of x and y
    path.write_bytes(data)
    with pytest.raises(InputError, match="layers of 4,294,967,"):
        read_cloud(path)


def test_a_laz_of_more_points_than_its_bytes_can_hold_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.laz"
    data = write_laz(path, 7)
    struct.pack_into("<Q", data, 247, HUGE)
    path.write_bytes(data)
    with pytest.raises(InputError, match="1,000,000,000,000 points promises"):
        read_cloud(path)


@FUZZ
@given(edits=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=3))
@pytest.mark.parametrize("point_format", [3, 7])
def test_what_a_damaged_laz_says_of_its_chunks_is_one_line_or_true(
    edits: list[tuple[float, int]], point_format: int, tmp_path: Path
) -> None:
    path = tmp_path / "a.laz"
    data = write_laz(path, point_format)
    record, (start,) = laz_record(data), struct.unpack_from("<I", data, 96)
    places = [*range(96, 115), *range(record, record + 60), *range(start, start + 8)]
    for share, value in edits:
        data[places[int(share * (len(places) - 1))]] = value
    path.write_bytes(data)
    with suppress(InputError):
        assert len(read_cloud(path)) > 0


def npz_of(path: Path, **members: bytes) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name.replace("_npy", ".npy").replace("_txt", ".txt"), data)
    return path


def npy(array: np.ndarray) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


def npy_claiming(shape: tuple[int, ...], dtype: str = "<f8") -> bytes:
    file = io.BytesIO()
    header = {"descr": dtype, "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, header)
    return file.getvalue() + bytes(240)


def test_a_deflated_npz_bomb_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    bomb = npy(XYZ) + bytes(80_000_000)
    path = npz_of(tmp_path / "a.npz", xyz_npy=bomb)
    assert path.stat().st_size < 200_000
    with pytest.raises(InputError, match=r"the archive promises 80,\d+,\d+ bytes"):
        read_cloud(path)


def test_an_array_of_more_rows_than_its_member_has_is_refused(tmp_path: Path) -> None:
    path = npz_of(tmp_path / "a.npz", xyz_npy=npy_claiming((HUGE, 3)))
    with pytest.raises(InputError, match=r"\(1000000000000, 3\) of float64 promised in 240 bytes"):
        read_cloud(path)


def test_a_member_of_an_npz_that_is_no_array_is_passed_over(tmp_path: Path) -> None:
    path = npz_of(tmp_path / "a.npz", README_txt=b"made by us", xyz_npy=npy(XYZ))
    np.testing.assert_array_equal(read_cloud(path).xyz, XYZ)


def test_a_member_called_npy_that_is_no_array_is_refused(tmp_path: Path) -> None:
    path = npz_of(tmp_path / "a.npz", xyz_npy=b"none")
    with pytest.raises(InputError, match=r"xyz\.npy is no array"):
        read_cloud(path)


@pytest.mark.parametrize("letter", [0xD800, 0xDFFF, 0x110000, 0xFFFFFFFF])
def test_class_names_of_no_letters_are_refused(letter: int, tmp_path: Path) -> None:
    names = np.array([[0x61, letter]], "<u4").view("<U2").ravel()
    np.savez(tmp_path / "a.npz", xyz=XYZ, class_names=names)
    with pytest.raises(InputError, match="letters that are none"):
        read_cloud(tmp_path / "a.npz")


def test_class_names_in_bytes_are_texts(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", xyz=XYZ, class_names=np.array([b"floor", b"wall"]))
    assert read_cloud(tmp_path / "a.npz").classes == ("floor", "wall")


def test_an_array_is_read_as_numpy_reads_it() -> None:
    for array in (XYZ, np.asfortranarray(XYZ), XYZ[:0], np.array(3), np.array(["a", "ß"])):
        read = parse_npy(npy(array))
        np.testing.assert_array_equal(read, array)
        assert (read.dtype, read.shape) == (array.dtype, array.shape)
    named = np.zeros(3, [("größe", "<f4"), ("b", "<i2")])  # version 3.0
    assert parse_npy(npy(named)).dtype == named.dtype


@FUZZ
@given(edits=st.lists(st.tuples(st.integers(0, 127), st.integers(0, 255)), max_size=4))
def test_a_damaged_header_of_an_array_is_one_line_or_true(
    edits: list[tuple[int, int]], tmp_path: Path
) -> None:
    data = bytearray(npy(XYZ))
    for at, value in edits:
        data[at] = value
    (tmp_path / "a.npy").write_bytes(data)
    with suppress(InputError):
        assert read_npy(tmp_path / "a.npy", "an array").nbytes <= len(data)


@pytest.mark.parametrize("read", [read_poses, read_depth])
@pytest.mark.parametrize("data", [npy_claiming((HUGE, 12)), b"", b"\x93NUMPY"])
def test_an_npy_of_poses_or_depth_that_is_none_is_refused(read, data: bytes, tmp_path: Path):
    (tmp_path / "a.npy").write_bytes(data)
    with pytest.raises(InputError, match="no array of numbers"):
        read(tmp_path / "a.npy")


def test_an_hdf5_that_claims_far_more_rows_than_it_has_is_refused(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "a.h5", "w") as file:
        table = file.create_dataset("points", (HUGE, 8), "f4", chunks=(1024, 8))
        table[:5] = 1
    with pytest.raises(InputError, match="points promises 32,000,000,000,000 bytes in 32,768"):
        read_building_h5(tmp_path / "a.h5")


def test_an_e57_that_claims_far_more_points_than_it_has_is_refused(tmp_path: Path, monkeypatch):
    with E57(str(tmp_path / "a.e57"), mode="w") as file:
        file.write_scan_raw({f"cartesian{axis}": np.arange(4.0) for axis in "XYZ"})
    monkeypatch.setattr(e57_stations.ScanHeader, "point_count", HUGE)
    (station,) = e57_stations.list_e57(tmp_path / "a.e57")
    with pytest.raises(InputError, match="1,000,000,000,000 points promises"):
        station.read()


def test_a_picture_far_larger_than_its_file_is_refused(tmp_path: Path) -> None:
    Image.new("L", (9000, 9000)).save(tmp_path / "a.png")
    with pytest.raises(InputError, match="an image of 9,000 x 9,000 promises"):
        read_depth(tmp_path / "a.png")


def test_a_message_of_one_row_takes_no_more_room_than_its_data() -> None:
    class Message:
        height, data = 1, np.zeros(12, np.uint8)

    rows = ros_messages._rows(Path("a.bag"), Message(), (1 << 32) - 1, 12)
    assert rows.shape == (1, 12)


@pytest.mark.parametrize("claimed", [1 << 17, 1 << 31, (1 << 32) - 1])
def test_a_bounded_file_makes_no_room_for_more_than_it_has(tmp_path: Path, claimed: int) -> None:
    (tmp_path / "a.bag").write_bytes(bytes(100_000))
    asked = []

    class Raw(io.FileIO):
        def readinto(self, buffer):
            asked.append(len(buffer))
            return super().readinto(buffer)

    with claims.BoundedFile(Raw(tmp_path / "a.bag")) as file:
        assert (file.read(10), len(file.read(claimed)), file.read(claimed)) == (
            bytes(10),
            99_990,
            b"",
        )
    assert max(asked) <= 1 << 17

    with claims.BoundedPath(tmp_path / "a.bag").open("rb") as file:
        assert isinstance(file, claims.BoundedFile)


@pytest.mark.parametrize("size", [1000, 9_000_000])
@pytest.mark.parametrize(
    ("pack", "unpack"),
    [
        (bz2.compress, bag_chunks.unpack_bz2),
        (lz4.frame.compress, bag_chunks.unpack_lz4),
        (zstandard.compress, lambda data: bag_chunks.unpack_zstd(data, 1000)),
    ],
)
def test_chunks_of_bags_are_unpacked_up_to_a_bound(size: int, pack, unpack, monkeypatch) -> None:
    monkeypatch.setattr(bag_chunks, "SPARE", 1 << 20)
    monkeypatch.setattr(bag_chunks, "MOST_TIMES", 1)
    data = pack(bytes(size))
    if size == 1000:
        assert unpack(data) == bytes(size)
        with pytest.raises((ValueError, RuntimeError, zstandard.ZstdError)):
            unpack(data[:-5])
    else:
        with pytest.raises(ValueError, match="unpacks to more than"):
            unpack(data)


def test_a_compressed_pcd_that_claims_more_than_lzf_can_pack_is_refused(tmp_path: Path) -> None:
    count = 100_000_000
    lines = ["VERSION 0.7", "FIELDS x y z", "SIZE 4 4 4", "TYPE F F F", "COUNT 1 1 1"]
    lines += [f"WIDTH {count}", "HEIGHT 1", f"POINTS {count}", "DATA binary_compressed", ""]
    body = struct.pack("<II", 100, 12 * count) + bytes(100)
    (tmp_path / "a.pcd").write_bytes("\n".join(lines).encode() + body)
    with pytest.raises(InputError, match="1,200,000,000 bytes promised in 100"):
        read_cloud(tmp_path / "a.pcd")


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".pts"])
def test_a_header_with_a_count_of_hundreds_of_digits_is_refused(suffix: str, tmp_path: Path):
    count = "9" * 5000
    texts = {
        ".ply": f"ply\nformat ascii 1.0\nelement vertex {count}\nproperty float x\n"
        "property float y\nproperty float z\nend_header\n1 2 3\n",
        ".pcd": "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"POINTS {count}\nDATA ascii\n1 2 3\n",
        ".pts": f"{count}\n1 2 3\n",
    }
    (tmp_path / f"a{suffix}").write_text(texts[suffix])
    with pytest.raises(InputError):
        read_cloud(tmp_path / f"a{suffix}")


LARGE = 10**400


@pytest.mark.parametrize(
    "document",
    [
        {"poses": [[LARGE, 0, 0, 0, 0, 0, 0]]},
        {"frames": [{"transform_matrix": [[LARGE, 0, 0, 0], *np.eye(4)[1:].tolist()]}]},
    ],
)
def test_json_poses_of_numbers_beyond_all_bounds_are_refused(document, tmp_path: Path) -> None:
    (tmp_path / "poses.json").write_text(json.dumps(document))
    with pytest.raises(InputError):
        read_poses(tmp_path / "poses.json")


@pytest.mark.parametrize("width", [0, -1, LARGE, [], "x"])
def test_a_record3d_width_that_is_none_is_refused(width, tmp_path: Path) -> None:
    (tmp_path / "depth").mkdir()
    Image.fromarray(np.full((4, 4), 900, np.uint16)).save(tmp_path / "depth/0.png")
    camera = [9, 0, 0, 0, 9, 0, 2, 2, 1]
    facts = {"poses": [[0, 0, 0, 1, 0, 0, 0]], "K": camera, "w": width}
    (tmp_path / "metadata").write_text(json.dumps(facts))
    with pytest.raises(InputError, match="poses or K that are none"):
        open_record3d(tmp_path)


def test_metadata_nested_too_deep_are_none_of_record3d(tmp_path: Path) -> None:
    (tmp_path / "metadata").write_text("[" * 100_000)
    assert open_record3d(tmp_path) is None


def test_a_small_file_may_unpack_to_the_spare_room_and_no_more(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"1")
    check_claim(tmp_path / "a", "it", SPARE)
    with pytest.raises(InputError, match=r"it promises 67,\d+,\d+ bytes in 1; expected at most"):
        check_claim(tmp_path / "a", "it", SPARE + 65)


@pytest.mark.parametrize("corner", [8, -1, 1 << 30])
def test_a_mesh_whose_faces_have_corners_that_are_not_there_is_refused(corner, tmp_path) -> None:
    box = trimesh.creation.box()
    text = trimesh.exchange.ply.export_ply(box, encoding="ascii").decode()
    lines = text.splitlines()
    lines[-1] = " ".join([*lines[-1].split()[:3], str(corner)])
    (tmp_path / "a.ply").write_text("\n".join(lines) + "\n")
    with pytest.raises(InputError, match=r"a\.ply: no mesh: faces of corners "):
        read_mesh(tmp_path / "a.ply")


def test_colours_of_an_e57_that_are_no_numbers_are_refused(tmp_path: Path) -> None:
    known = {"cartesianX": np.arange(4.0), "cartesianY": np.ones(4), "cartesianZ": np.ones(4)}
    colours = dict.fromkeys(("colorRed", "colorGreen", "colorBlue"), np.full(4, np.nan))
    with pytest.raises(InputError, match="colorRed that is no number"):
        e57_stations._as_cloud(tmp_path / "a.e57", known | colours, None)


def test_a_quaternion_beyond_all_bounds_is_refused_without_a_warning() -> None:
    with pytest.raises(InputError, match="a quaternion of length inf"):
        from_quaternion(Path("a.bag"), [0, 0, 0], [1e300] * 4, "a pose")


def lying_las(path: Path) -> None:
    header = laspy.LasHeader(point_format=6, version="1.4")
    file = laspy.LasData(header)
    file.x = file.y = file.z = np.arange(40.0)
    file.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("a", 1, record_data=b"12345678")])
    file.write(path)
    data = bytearray(path.read_bytes())
    (first,) = struct.unpack_from("<Q", data, 235)
    struct.pack_into("<Q", data, first + 20, 1 << 40)
    path.write_bytes(data)


def lying_png(path: Path) -> None:
    Image.fromarray(np.full((6, 8), 900, np.uint16)).save(path)
    data = bytearray(path.read_bytes())
    at = data.index(b"IDAT")
    struct.pack_into(">I", data, at - 4, (1 << 32) - 20)
    path.write_bytes(data)


def lying_glb(path: Path) -> None:
    trimesh.creation.box().export(path)
    data = bytearray(path.read_bytes())
    struct.pack_into("<I", data, 12, (1 << 32) - 20)
    path.write_bytes(data)


@pytest.mark.parametrize(
    ("name", "write", "read"),
    [("a.las", lying_las, read_cloud), ("a.png", lying_png, read_depth),
     ("a.glb", lying_glb, read_mesh)],
)  # fmt: skip
def test_no_library_asks_for_more_than_a_file_has(tmp_path, monkeypatch, name, write, read):
    write(tmp_path / name)
    asked = []

    class Watched(claims.BoundedFile):
        def read(self, size=-1):
            data = super().read(size)
            asked.append((size or 0, len(data)))
            return data

    for module in ("las", "meshes", "recordings.depth_frames"):
        opened = f"mcpseg_cli.formats.{module}.open_bounded"
        monkeypatch.setattr(opened, lambda path: Watched(io.FileIO(str(path))))
    with suppress(InputError):  # a picture may be whole but for that
        read(tmp_path / name)
    assert max(size for size, _ in asked) > 1 << 30
    assert max(found for _, found in asked) < 1 << 20


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("bits", [0x7FF4000000000000, 0x7FF8000000000000, 0x7FF0000000000000])
def test_polar_coordinates_that_are_no_number_of_any_kind_are_no_points(tmp_path, bits):
    known = {name: np.full(3, 0.5) for name in e57_stations._SPHERICAL}
    for place, column in enumerate(known.values()):
        column.view(np.uint64)[place] = bits
    cloud = e57_stations._as_cloud(tmp_path / "a.e57", known, None)
    assert not np.isfinite([cloud[axis] for axis in "xyz"]).all(axis=0).any()
