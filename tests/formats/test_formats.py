"""Point-cloud files: what goes in comes out, others read the same, damage is an InputError."""

import io
import struct
import warnings
from collections.abc import Callable
from pathlib import Path

import laspy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats import CLOUD_SUFFIXES, Cloud, Labels, las, read_cloud, write_cloud

CLASSES = ("floor", "wall", "Straße")
FUZZ = settings(
    max_examples=150,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
FEW = settings(FUZZ, max_examples=60)
PLY_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8",
}  # fmt: skip
VERTICES = np.array([[1, 2, 3], [4, 5, 6], [7, 8, 9]], float)


def make_cloud(num_points: int = 40, seed: int = 0) -> Cloud:
    rng = np.random.default_rng(seed)
    columns = {axis: rng.uniform(-50, 50, num_points).astype(np.float32) for axis in "xyz"}
    columns |= {
        name: rng.integers(0, 256, num_points).astype(np.uint8) for name in ("red", "green", "blue")
    }
    columns |= {"ring": rng.integers(0, 65536, num_points).astype(np.uint16)}
    columns |= {"reflectance": rng.normal(size=num_points).astype(np.float32)}
    columns |= {
        "time_s": rng.normal(size=num_points),
        "return_id": rng.integers(-9, 9, num_points).astype(np.int32),
    }
    return Cloud(columns)


def make_labels(num_points: int = 40) -> Labels:
    semantic = np.arange(num_points, dtype=np.uint8) % len(CLASSES)
    semantic[0] = 255
    instance = np.arange(num_points, dtype=np.int32) * 70_000  # more than 16 bits
    return Labels(semantic, instance, np.linspace(0, 1, num_points, dtype=np.float32), CLASSES)


def write_ascii_ply(
    path: Path, properties: list[tuple[str, str]], rows: list[list[object]], newline: str = "\n"
) -> None:
    lines = ["ply", "format ascii 1.0", f"element vertex {len(rows)}"]
    lines += [*(f"property {kind} {name}" for kind, name in properties), "end_header"]
    lines += [" ".join(map(str, row)) for row in rows]
    path.write_bytes((newline.join(lines) + newline).encode())


def ply_bytes(encoding: str, before: bytes = b"", after: bytes = b"", data: bytes = b"") -> bytes:
    header = b"ply\nformat %s 1.0\n" % encoding.encode() + before
    header += (
        b"element vertex 3\nproperty float x\nproperty double y\nproperty short z\n"
        + after
        + b"end_header\n"
    )
    return header + data


def vertex_bytes(order: str) -> bytes:
    return b"".join(struct.pack(f"{order}fdh", x, y, int(z)) for x, y, z in VERTICES)


# --- round trips ---


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
def test_coordinates_survive_a_round_trip(tmp_path: Path, suffix: str) -> None:
    cloud = make_cloud()
    write_cloud(tmp_path / f"a{suffix}", cloud)
    again = read_cloud(tmp_path / f"a{suffix}")
    if suffix in (".las", ".laz"):  # integers of 0.1 mm
        np.testing.assert_allclose(again.xyz, cloud.xyz, atol=0.51e-4)
    else:
        np.testing.assert_array_equal(again.xyz, cloud.xyz)
        assert again.xyz.dtype == np.float32


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
def test_colours_survive_a_round_trip(tmp_path: Path, suffix: str) -> None:
    write_cloud(tmp_path / f"a{suffix}", make_cloud())
    np.testing.assert_array_equal(read_cloud(tmp_path / f"a{suffix}").rgb, make_cloud().rgb)


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
def test_labels_and_classes_survive_a_round_trip(tmp_path: Path, suffix: str) -> None:
    labels = make_labels()
    write_cloud(tmp_path / f"a{suffix}", make_cloud().with_labels(labels))
    again = read_cloud(tmp_path / f"a{suffix}")
    for name in ("semantic", "instance", "confidence"):
        np.testing.assert_array_equal(again.label(name), getattr(labels, name))
        assert again.label(name).dtype == getattr(labels, name).dtype
    assert again.classes == CLASSES


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
@pytest.mark.parametrize("name", ["ring", "reflectance", "time_s", "return_id"])
def test_an_unknown_attribute_survives_read_label_write_read_with_its_type(
    tmp_path: Path, suffix: str, name: str
) -> None:
    path = tmp_path / f"a{suffix}"
    write_cloud(path, make_cloud())
    write_cloud(path, read_cloud(path).with_labels(make_labels()))
    again = read_cloud(path).columns[name]
    np.testing.assert_array_equal(again, make_cloud().columns[name])
    assert again.dtype == make_cloud().columns[name].dtype


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
@pytest.mark.parametrize("dtype", ["i8", "u8", "i1", "?", "f2"])
def test_values_of_a_rare_type_survive_a_round_trip(
    tmp_path: Path, suffix: str, dtype: str
) -> None:
    values = np.array(
        [0, 1, 1], dtype
    )  # PLY has no 64-bit integers; only NPZ has booleans and half floats
    columns = dict(zip("xyz", VERTICES.T, strict=True)) | {"value": values}
    write_cloud(tmp_path / f"a{suffix}", Cloud(columns))
    np.testing.assert_array_equal(
        read_cloud(tmp_path / f"a{suffix}").columns["value"].astype(float), [0, 1, 1]
    )


@pytest.mark.parametrize("source", CLOUD_SUFFIXES)
@pytest.mark.parametrize("target", CLOUD_SUFFIXES)
def test_any_format_converts_into_any_other(tmp_path: Path, source: str, target: str) -> None:
    write_cloud(tmp_path / f"a{source}", make_cloud().with_labels(make_labels()))
    write_cloud(tmp_path / f"b{target}", read_cloud(tmp_path / f"a{source}"))
    again = read_cloud(tmp_path / f"b{target}")
    np.testing.assert_allclose(again.xyz, make_cloud().xyz, atol=1.1e-4)
    np.testing.assert_array_equal(again.rgb, make_cloud().rgb)
    np.testing.assert_array_equal(again.label("instance"), make_labels().instance)


@pytest.mark.parametrize("suffix", [".ply", ".las", ".laz"])
def test_an_attribute_of_several_numbers_a_point_is_split_where_the_format_has_only_scalars(
    tmp_path: Path, suffix: str
) -> None:
    columns = dict(zip("xyz", VERTICES.T, strict=True)) | {"normal": VERTICES / 10}
    write_cloud(tmp_path / f"a{suffix}", Cloud(columns))
    again = read_cloud(tmp_path / f"a{suffix}").columns
    np.testing.assert_array_equal([again[f"normal_{axis}"] for axis in range(3)], VERTICES.T / 10)


@pytest.mark.parametrize("suffix", [".npz", ".pcd"])
def test_an_attribute_of_several_numbers_a_point_stays_whole_where_the_format_can(
    tmp_path: Path, suffix: str
) -> None:
    write_cloud(
        tmp_path / f"a{suffix}",
        Cloud(dict(zip("xyz", VERTICES.T, strict=True)) | {"normal": VERTICES / 10}),
    )
    np.testing.assert_array_equal(
        read_cloud(tmp_path / f"a{suffix}").columns["normal"], VERTICES / 10
    )


@pytest.mark.parametrize("suffix", [".ply", ".las", ".laz", ".pcd"])
def test_text_is_refused_with_the_attributes_name_where_the_format_has_only_numbers(
    tmp_path: Path, suffix: str
) -> None:
    columns = dict(zip("xyz", VERTICES.T, strict=True)) | {"author": np.array(["a", "b", "c"])}
    with pytest.raises(OutputError, match="author"):
        write_cloud(tmp_path / f"a{suffix}", Cloud(columns))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
def test_a_space_in_a_name_becomes_an_underscore(tmp_path: Path, suffix: str) -> None:
    write_cloud(
        tmp_path / f"a{suffix}",
        Cloud(dict(zip("xyz", VERTICES.T, strict=True)) | {"gps time": VERTICES[:, 0]}),
    )
    np.testing.assert_array_equal(
        read_cloud(tmp_path / f"a{suffix}").columns["gps_time"], VERTICES[:, 0]
    )


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
def test_new_labels_replace_those_a_file_had_even_of_a_smaller_type(
    tmp_path: Path, suffix: str
) -> None:
    path = tmp_path / f"a{suffix}"
    old = {
        "semantic": np.zeros(40, np.uint8),
        "instance": np.ones(40, np.uint8),
        "confidence": np.ones(40, np.float64),
    }
    write_cloud(path, Cloud(make_cloud().columns | old))
    write_cloud(path, read_cloud(path).with_labels(make_labels()))
    np.testing.assert_array_equal(read_cloud(path).label("instance"), make_labels().instance)


# --- PLY ---


@pytest.mark.parametrize(
    ("encoding", "order"), [("binary_little_endian", "<"), ("binary_big_endian", ">")]
)
def test_a_binary_ply_of_either_byte_order_is_read(
    tmp_path: Path, encoding: str, order: str
) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(ply_bytes(encoding, data=vertex_bytes(order)))
    cloud = read_cloud(path)
    np.testing.assert_array_equal(cloud.xyz, VERTICES)
    assert [cloud.columns[axis].dtype.str[1:] for axis in "xyz"] == ["f4", "f8", "i2"]


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_an_ascii_ply_with_either_line_ending_is_read(tmp_path: Path, newline: str) -> None:
    write_ascii_ply(tmp_path / "a.ply", [("float", a) for a in "xyz"], VERTICES.tolist(), newline)
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.ply").xyz, VERTICES)


def test_a_binary_ply_with_a_crlf_header_is_read(tmp_path: Path) -> None:
    header = ply_bytes("binary_little_endian").replace(b"\n", b"\r\n")
    (tmp_path / "a.ply").write_bytes(header + vertex_bytes("<"))
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.ply").xyz, VERTICES)


@pytest.mark.parametrize("order", ["xyz", "zyx", "yxz"])
def test_properties_may_come_in_any_order(tmp_path: Path, order: str) -> None:
    rows = VERTICES[:, ["xyz".index(axis) for axis in order]].tolist()
    write_ascii_ply(tmp_path / "a.ply", [("float", axis) for axis in order], rows)
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.ply").xyz, VERTICES)


@pytest.mark.parametrize("kind", PLY_TYPES)
def test_an_ascii_property_keeps_its_type(tmp_path: Path, kind: str) -> None:
    properties = [*(("float", axis) for axis in "xyz"), (kind, "value")]
    write_ascii_ply(tmp_path / "a.ply", properties, [[1, 2, 3, 7]])
    value = read_cloud(tmp_path / "a.ply").columns["value"]
    assert value.dtype.str[1:] == PLY_TYPES[kind]
    assert value.tolist() == [7]


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_faces_after_the_vertices_are_passed_over(tmp_path: Path, encoding: str) -> None:
    face = b"element face 1\nproperty list uchar int vertex_indices\n"
    if encoding == "ascii":
        data = b"".join(b"%g %g %g\n" % tuple(row) for row in VERTICES) + b"3 0 1 2\n"
    else:
        data = vertex_bytes("<") + struct.pack("<Biii", 3, 0, 1, 2)
    (tmp_path / "a.ply").write_bytes(ply_bytes(encoding, after=face, data=data))
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.ply").xyz, VERTICES)


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_elements_before_the_vertices_are_passed_over(tmp_path: Path, encoding: str) -> None:
    camera = b"element camera 2\nproperty float f\nproperty uchar k\n"
    if encoding == "ascii":
        data = b"1.5 1\n2.5 2\n" + b"".join(b"%g %g %g\n" % tuple(row) for row in VERTICES)
    else:
        data = struct.pack("<fBfB", 1.5, 1, 2.5, 2) + vertex_bytes("<")
    (tmp_path / "a.ply").write_bytes(ply_bytes(encoding, before=camera, data=data))
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.ply").xyz, VERTICES)


def test_the_words_end_header_in_a_comment_do_not_end_the_header(tmp_path: Path) -> None:
    data = ply_bytes(
        "binary_little_endian", before=b"comment no end_header yet\n", data=vertex_bytes("<")
    )
    (tmp_path / "a.ply").write_bytes(data)
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.ply").xyz, VERTICES)


def test_labels_under_cloudcompares_names_are_found(tmp_path: Path) -> None:
    properties = [
        *(("float", axis) for axis in "xyz"),
        ("float", "scalar_semantic"),
        ("float", "scalar_instance"),
    ]
    write_ascii_ply(tmp_path / "a.ply", properties, [[1, 2, 3, 4, 5]])
    cloud = read_cloud(tmp_path / "a.ply")
    assert [cloud.label("semantic").tolist(), cloud.label("instance").tolist()] == [[4.0], [5.0]]


def test_own_label_names_come_before_cloudcompares() -> None:
    columns = dict(zip("xyz", VERTICES.T, strict=True)) | {
        "scalar_semantic": np.zeros(3),
        "semantic": np.ones(3),
    }
    np.testing.assert_array_equal(Cloud(columns).label("semantic"), np.ones(3))


@pytest.mark.parametrize(
    "names",
    [("red", "green", "blue"), ("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue")],
)
def test_colours_are_found_under_each_usual_name(
    tmp_path: Path, names: tuple[str, str, str]
) -> None:
    properties = [*(("float", axis) for axis in "xyz"), *(("uchar", name) for name in names)]
    write_ascii_ply(tmp_path / "a.ply", properties, [[1, 2, 3, 10, 20, 30]])
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.ply").rgb, [[10, 20, 30]])


def test_float_colours_up_to_one_are_fractions(tmp_path: Path) -> None:
    properties = [
        *(("float", axis) for axis in "xyz"),
        *(("float", name) for name in ("red", "green", "blue")),
    ]
    write_ascii_ply(tmp_path / "a.ply", properties, [[1, 2, 3, 0.0, 0.5, 1.0]])
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.ply").rgb, [[0, 128, 255]])


def test_a_cloud_without_colour_says_so(tmp_path: Path) -> None:
    write_ascii_ply(tmp_path / "a.ply", [("float", axis) for axis in "xyz"], [[1, 2, 3]])
    assert read_cloud(tmp_path / "a.ply").rgb is None


def test_a_cut_ply_names_promised_and_found_vertices(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(ply_bytes("binary_little_endian", data=vertex_bytes("<")[:-5]))
    with pytest.raises(InputError, match=r"a\.ply: 3 vertices promised, 2 found"):
        read_cloud(path)


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
def test_more_vertices_than_promised_are_refused(tmp_path: Path, encoding: str) -> None:
    rows = (
        b"".join(b"%g %g %g\n" % tuple(row) for row in VERTICES)
        if encoding == "ascii"
        else vertex_bytes("<")
    )
    (tmp_path / "a.ply").write_bytes(ply_bytes(encoding, data=rows + rows))
    with pytest.raises(InputError, match="3 vertices promised, 6 found"):
        read_cloud(tmp_path / "a.ply")


def test_no_vertices_behind_a_missing_element_are_zero_points(tmp_path: Path) -> None:
    (tmp_path / "a.ply").write_bytes(
        b"ply\nformat binary_little_endian 1.0\nelement camera 9\nproperty float f\n"
        b"element vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    )
    with pytest.raises(InputError, match="zero points"):
        read_cloud(tmp_path / "a.ply")


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
def test_a_coordinate_that_is_no_number_is_counted_and_placed(tmp_path: Path, value: str) -> None:
    write_ascii_ply(
        tmp_path / "a.ply",
        [("float", axis) for axis in "xyz"],
        [[1, 2, 3], [1, value, 3], [1, 2, value]],
    )
    with pytest.raises(
        InputError, match=r"2 of 3 points have NaN or infinite coordinates \(first: point 1\)"
    ):
        read_cloud(tmp_path / "a.ply")


@settings(FUZZ, max_examples=60)
@given(data=st.data())
def test_random_columns_survive_a_ply_round_trip(tmp_path: Path, data: st.DataObject) -> None:
    num_points = data.draw(st.integers(1, 30))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    name = st.text("abcdefghijklmnopqrstuvwABC_0123456789äß", min_size=1, max_size=12)
    names = data.draw(st.lists(name, unique=True, max_size=6)) + list("xyz")
    columns = {}
    for name in data.draw(st.permutations(list(dict.fromkeys(names)))):
        dtype = np.dtype(data.draw(st.sampled_from(list(PLY_TYPES.values()))))
        values = (
            rng.normal(size=num_points)
            if dtype.kind == "f"
            else rng.integers(-100, 100, num_points)
        )
        columns[name] = values.astype(dtype)
    write_cloud(tmp_path / "a.ply", Cloud(columns, CLASSES))
    again = read_cloud(tmp_path / "a.ply")
    assert list(again.columns) == list(columns)
    for name, column in columns.items():
        assert again.columns[name].dtype == column.dtype
        np.testing.assert_array_equal(again.columns[name], column)


# --- LAS and LAZ ---


def write_rich_las(path: Path) -> laspy.LasData:
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales, header.offsets = np.array([0.001, 0.002, 0.01]), np.array([100.0, -200.0, 5.0])
    header.vlrs.append(laspy.VLR("survey", 42, "note", b"kept"))
    header.add_extra_dim(laspy.ExtraBytesParams("echo", np.int16))
    header.add_extra_dim(laspy.ExtraBytesParams("normal", "3f4"))
    file = laspy.LasData(header)
    file.x, file.y, file.z = VERTICES.T + np.array([[100.0], [-200.0], [5.0]])
    file.red, file.green, file.blue = np.array([[0, 257, 65535]] * 3, np.uint16)
    file.echo, file.intensity, file.gps_time = (
        np.array([-5, 0, 5]),
        np.array([1, 2, 60000]),
        np.array([0.5, 1e9, 3]),
    )
    file.normal = VERTICES
    file.write(str(path))
    return file


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_keeps_scales_offsets_records_and_extra_bytes(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    before = write_rich_las(path)
    labels = make_labels(3)
    write_cloud(path, read_cloud(path).with_labels(labels))
    after = laspy.read(path)
    np.testing.assert_array_equal(after.header.scales, before.header.scales)
    np.testing.assert_array_equal(after.header.offsets, before.header.offsets)
    assert [vlr.record_data_bytes() for vlr in after.header.vlrs if vlr.user_id == "survey"] == [
        b"kept"
    ]
    assert after.header.point_format.id == 3
    for name in before.point_format.dimension_names:
        np.testing.assert_array_equal(
            np.asarray(after[name]), np.asarray(before[name]), err_msg=name
        )


def test_las_keeps_extended_records(tmp_path: Path) -> None:
    path = tmp_path / "a.las"
    file = laspy.LasData(laspy.LasHeader(point_format=6, version="1.4"))
    file.x, file.y, file.z = VERTICES.T
    file.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("survey", 43, "long note", b"x" * 70_000)])
    file.write(str(path))
    write_cloud(path, read_cloud(path).with_labels(make_labels(3)))
    assert [record.record_data_bytes() for record in laspy.read(path).evlrs] == [b"x" * 70_000]


def test_16_bit_las_colours_become_8_bit(tmp_path: Path) -> None:
    write_rich_las(tmp_path / "a.las")
    np.testing.assert_array_equal(
        read_cloud(tmp_path / "a.las").rgb, [[0, 0, 0], [1, 1, 1], [255, 255, 255]]
    )


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_las_of_several_chunks_is_read_and_written_whole(
    tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_cloud(tmp_path / f"whole{suffix}", make_cloud().with_labels(make_labels()))
    monkeypatch.setattr(las, "_CHUNK", 7)
    write_cloud(tmp_path / f"chunks{suffix}", make_cloud().with_labels(make_labels()))
    whole, chunks = (
        laspy.read(tmp_path / f"whole{suffix}"),
        laspy.read(tmp_path / f"chunks{suffix}"),
    )
    np.testing.assert_array_equal(chunks.points.array, whole.points.array)
    np.testing.assert_array_equal(read_cloud(tmp_path / f"whole{suffix}").xyz, whole.xyz)


@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_plain_laspy_reads_our_labels(tmp_path: Path, suffix: str) -> None:
    labels = make_labels()
    write_cloud(tmp_path / f"a{suffix}", make_cloud().with_labels(labels))
    file = laspy.read(tmp_path / f"a{suffix}")
    for name in ("semantic", "instance", "confidence"):
        np.testing.assert_array_equal(np.asarray(file[name]), getattr(labels, name))
    expected = np.where(
        labels.semantic == 255, 1, labels.semantic.astype(int) + 64
    )  # 1: unclassified
    np.testing.assert_array_equal(np.asarray(file.classification), expected)


def test_plain_laspy_reads_our_coordinates_and_colours(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.las", make_cloud())
    file = laspy.read(tmp_path / "a.las")
    np.testing.assert_allclose(file.xyz, make_cloud().xyz, atol=0.51e-4)
    np.testing.assert_array_equal(
        np.stack([file.red, file.green, file.blue], 1) // 257, make_cloud().rgb
    )


def test_an_intensity_that_las_would_round_goes_to_extra_bytes(tmp_path: Path) -> None:
    columns = dict(zip("xyz", VERTICES.T, strict=True)) | {
        "intensity": np.array([0.1, 0.5, 1.0], np.float32)
    }
    write_cloud(tmp_path / "a.las", Cloud(columns))
    np.testing.assert_array_equal(
        read_cloud(tmp_path / "a.las").columns["scalar_intensity"], columns["intensity"]
    )


def test_two_attributes_that_las_would_give_one_name_are_refused(tmp_path: Path) -> None:
    columns = dict(zip("xyz", VERTICES.T, strict=True)) | {
        "n" * 32 + end: VERTICES[:, 0] for end in "ab"
    }
    with pytest.raises(OutputError, match=r"n{32}b"):
        write_cloud(tmp_path / "a.las", Cloud(columns))


def test_a_cut_las_names_promised_and_found_points(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.las"
    write_cloud(path, make_cloud())
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(InputError, match=r"a\.las: 40 points promised, 39 found"):
        read_cloud(path)
    assert capfd.readouterr().err == ""  # laspy would log a line of its own


@pytest.mark.parametrize(("offset", "name"), [(100, "records"), (243, "extended records")])
def test_a_las_that_promises_billions_of_records_is_refused_at_once(
    tmp_path: Path, offset: int, name: str
) -> None:
    path = tmp_path / "a.las"
    write_cloud(path, make_cloud())
    data = bytearray(path.read_bytes())
    struct.pack_into("<I", data, offset, 0xFFFFFFFF)
    path.write_bytes(data)
    with pytest.raises(InputError, match=f"4,294,967,295 {name}"):
        read_cloud(path)


def test_a_laz_that_promises_billions_of_chunks_is_refused_before_they_are_allocated(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.laz"
    write_cloud(path, make_cloud())
    data = bytearray(path.read_bytes())
    (start,) = struct.unpack_from("<I", data, 96)
    (table,) = struct.unpack_from("<q", data, start)
    struct.pack_into("<I", data, table + 4, 0xFFFFFFFF)
    path.write_bytes(data)
    with pytest.raises(InputError, match="4,294,967,295 chunks promised"):
        read_cloud(path)


# --- NPZ ---


def test_an_npz_keeps_an_attribute_with_any_name(tmp_path: Path) -> None:
    columns = dict(zip("xyz", VERTICES.T, strict=True)) | {
        "file": np.arange(3),
        "allow_pickle": np.arange(3),
    }
    write_cloud(tmp_path / "a.npz", Cloud(columns))
    assert {"file", "allow_pickle"} <= read_cloud(tmp_path / "a.npz").columns.keys()


def test_plain_numpy_reads_our_npz(tmp_path: Path) -> None:
    write_cloud(tmp_path / "a.npz", make_cloud().with_labels(make_labels()))
    with np.load(tmp_path / "a.npz", allow_pickle=False) as archive:
        np.testing.assert_array_equal(archive["xyz"], make_cloud().xyz)
        np.testing.assert_array_equal(archive["rgb"], make_cloud().rgb)
        np.testing.assert_array_equal(archive["semantic"], make_labels().semantic)
        assert archive["xyz"].dtype == np.float32


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_an_npz_saved_by_numpy_is_read(tmp_path: Path, save: Callable[..., None]) -> None:
    save(tmp_path / "a.npz", xyz=VERTICES, rgb=np.full((3, 3), 9, np.uint8))
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.npz").xyz, VERTICES)
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.npz").rgb, np.full((3, 3), 9))


def test_an_npz_with_coordinates_twice_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", xyz=VERTICES, x=np.array(["a", "b", "c"]))
    with pytest.raises(InputError, match="x beside xyz"):
        read_cloud(tmp_path / "a.npz")


def test_an_encrypted_npz_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", xyz=VERTICES)
    data = bytearray((tmp_path / "a.npz").read_bytes())
    data[6] |= 1  # the flag in the local header
    data[data.rindex(b"PK\x01\x02") + 8] |= 1  # and in the directory
    (tmp_path / "a.npz").write_bytes(data)
    with pytest.raises(InputError, match="does not load"):
        read_cloud(tmp_path / "a.npz")


# --- PCD ---


def write_pcd_text(
    path: Path, fields: str, sizes: str, kinds: str, counts: str, rows: list[str]
) -> None:
    path.write_text(
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS {fields}\nSIZE {sizes}\nTYPE {kinds}\n"
        f"COUNT {counts}\nWIDTH {len(rows)}\n"
        f"HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(rows)}\nDATA ascii\n"
        + "".join(f"{row}\n" for row in rows)
    )


@pytest.mark.parametrize(
    "options",
    [{"write_ascii": True}, {}, {"compressed": True}],
    ids=["ascii", "binary", "compressed"],
)
def test_every_encoding_of_a_pcd_that_open3d_writes_is_read(
    tmp_path: Path, options: dict[str, bool]
) -> None:
    o3d = pytest.importorskip("open3d")
    rng = np.random.default_rng(0)
    xyz = rng.integers(-99, 99, (300, 3)).astype(
        np.float32
    )  # repeats, so that there is something to compress
    rgb, ring = (
        rng.integers(0, 256, (300, 3)).astype(np.uint8),
        np.repeat(np.arange(3, dtype=np.uint16), 100),
    )
    cloud = o3d.t.geometry.PointCloud(o3d.core.Tensor(xyz))
    cloud.point["colors"], cloud.point["ring"] = (
        o3d.core.Tensor(rgb),
        o3d.core.Tensor(ring[:, None]),
    )
    assert o3d.t.io.write_point_cloud(str(tmp_path / "a.pcd"), cloud, **options)
    again = read_cloud(tmp_path / "a.pcd")
    np.testing.assert_array_equal(again.xyz, xyz)
    np.testing.assert_array_equal(again.columns["ring"], ring)
    np.testing.assert_array_equal(again.rgb, rgb)


def test_a_pcd_field_of_several_numbers_keeps_all_of_them(tmp_path: Path) -> None:
    rows = ["1 2 3 4 5 6", "1 2 3 7 8 9"]
    write_pcd_text(tmp_path / "a.pcd", "x y z n", "4 4 4 4", "F F F F", "1 1 1 3", rows)
    np.testing.assert_array_equal(
        read_cloud(tmp_path / "a.pcd").columns["n"], [[4, 5, 6], [7, 8, 9]]
    )


def test_padding_in_a_pcd_is_left_out(tmp_path: Path) -> None:
    fields = ("x y z _ i _", "4 4 4 1 4 1", "F F F U F U", "1 1 1 4 1 1")
    write_pcd_text(tmp_path / "a.pcd", *fields, ["1 2 3 0 0 0 0 9 0"])
    cloud = read_cloud(tmp_path / "a.pcd")
    assert {name: column.tolist() for name, column in cloud.columns.items()} == {
        "x": [1],
        "y": [2],
        "z": [3],
        "i": [9],
    }


@pytest.mark.parametrize("kind", ["U", "F"])
def test_packed_pcd_colours_are_unpacked(tmp_path: Path, kind: str) -> None:
    packed = np.array([10 << 16 | 20 << 8 | 30], np.uint32)
    word = str(packed[0]) if kind == "U" else repr(float(packed.view(np.float32)[0]))
    write_pcd_text(
        tmp_path / "a.pcd", "x y z rgb", "4 4 4 4", f"F F F {kind}", "1 1 1 1", [f"1 2 3 {word}"]
    )
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.pcd").rgb, [[10, 20, 30]])


@pytest.mark.parametrize("row", ["1 2", "1 2 3 4", "1 2 abc"])
def test_a_pcd_line_of_other_than_its_fields_is_refused(tmp_path: Path, row: str) -> None:
    write_pcd_text(tmp_path / "a.pcd", "x y z", "4 4 4", "F F F", "1 1 1", ["1 2 3", row])
    with pytest.raises(InputError, match="do not parse"):
        read_cloud(tmp_path / "a.pcd")


def test_compressed_pcd_data_that_do_not_unpack_are_refused(tmp_path: Path) -> None:
    write_pcd_text(tmp_path / "a.pcd", "x y z", "4 4 4", "F F F", "1 1 1", ["1 2 3"])
    header = (
        (tmp_path / "a.pcd")
        .read_bytes()
        .replace(b"DATA ascii\n1 2 3\n", b"DATA binary_compressed\n")
    )
    (tmp_path / "a.pcd").write_bytes(
        header + struct.pack("<II", 3, 12) + bytes([32, 200, 0])
    )  # copies from before the start
    with pytest.raises(InputError, match="do not unpack"):
        read_cloud(tmp_path / "a.pcd")


# --- foreign readers ---


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
def test_open3d_reads_the_same_points_colours_and_attributes(tmp_path: Path, suffix: str) -> None:
    o3d = pytest.importorskip("open3d")
    cloud = make_cloud()
    write_cloud(tmp_path / f"a{suffix}", cloud.with_labels(make_labels()))
    theirs = o3d.t.io.read_point_cloud(str(tmp_path / f"a{suffix}")).point
    np.testing.assert_array_equal(theirs["positions"].numpy(), cloud.xyz)
    np.testing.assert_array_equal(theirs["colors"].numpy(), cloud.rgb)
    np.testing.assert_array_equal(theirs["instance"].numpy()[:, 0], make_labels().instance)


# --- failing writes ---


class FailingFile(io.FileIO):
    """A file on a disk that is full after 100 bytes, or whose writer is interrupted there."""

    error: BaseException

    def write(self, data: bytes) -> int:
        if self.tell() + len(bytes(data)) > 100:
            super().write(bytes(data)[:50])
            raise self.error
        return super().write(data)


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
@pytest.mark.parametrize(
    "error",
    [OSError(28, "No space left on device"), KeyboardInterrupt()],
    ids=["full", "interrupt"],
)
def test_a_write_that_fails_halfway_leaves_the_old_file_and_no_other(
    tmp_path: Path, suffix: str, error: BaseException, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / f"a{suffix}"
    write_cloud(path, make_cloud())
    before = path.read_bytes()
    real = Path.open

    def open_failing(self: Path, mode: str = "r") -> object:
        if mode != "wb":
            return real(self, mode)
        file = FailingFile(self, "w+b")
        file.error = error
        return file

    monkeypatch.setattr(Path, "open", open_failing)
    with pytest.raises(type(error)):
        write_cloud(path, make_cloud(seed=1))
    monkeypatch.undo()
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_an_unwritable_ending_is_refused_with_those_that_are(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"cannot write '\.xyz'; expected \.ply"):
        write_cloud(tmp_path / "a.xyz", make_cloud())


# --- fuzzing: only InputError may come out ---


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """A sound file of every format, by ending."""
    folder = tmp_path_factory.mktemp("valid")
    files = {}
    for suffix in CLOUD_SUFFIXES:
        write_cloud(folder / f"a{suffix}", make_cloud(12).with_labels(make_labels(12)))
        files[suffix] = (folder / f"a{suffix}").read_bytes()
    return files


def read_or_refuse(path: Path, data: bytes) -> None:
    """Read ``data``, which must give a sound cloud or an InputError, and no warning."""
    path.write_bytes(data)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            cloud = read_cloud(path)
        except InputError:
            return
    assert np.isfinite(cloud.xyz).all()
    assert {len(column) for column in cloud.columns.values()} == {len(cloud)}
    assert cloud.rgb is None or cloud.rgb.dtype == np.uint8


@st.composite
def damage(draw: st.DrawFn) -> Callable[[bytes], bytes]:
    """Draw a way to damage a file: flipped bits, a cut, or other bytes, mostly in its header."""
    kind = draw(st.sampled_from(["flip", "cut", "splice"]))
    places = draw(st.lists(st.floats(0, 1, exclude_max=True), min_size=1, max_size=4))
    reach = draw(st.sampled_from([0.2, 1.0]))
    bit, junk, width = draw(st.integers(0, 7)), draw(st.binary(max_size=8)), draw(st.integers(0, 8))

    def apply(data: bytes) -> bytes:
        for place in places:
            at = int(place * reach * len(data))
            if kind == "flip":
                data = data[:at] + bytes([data[at] ^ 1 << bit]) + data[at + 1 :]
            elif kind == "splice":
                data = data[:at] + junk + data[at + width :]
        return data[: int(places[0] * len(data))] if kind == "cut" else data

    return apply


@pytest.mark.parametrize("suffix", CLOUD_SUFFIXES)
@FEW
@given(data=st.binary(max_size=300))
def test_random_bytes_are_refused(tmp_path: Path, suffix: str, data: bytes) -> None:
    read_or_refuse(tmp_path / f"a{suffix}", data)


@pytest.mark.parametrize("suffix", [".ply", ".pcd"])
@FUZZ
@given(change=damage())
def test_a_damaged_file_gives_a_sound_cloud_or_an_input_error(
    tmp_path: Path, valid: dict[str, bytes], suffix: str, change: Callable[[bytes], bytes]
) -> None:
    read_or_refuse(tmp_path / f"a{suffix}", change(valid[suffix]))


@pytest.mark.parametrize("suffix", [".npz", ".las", ".laz"])
@FEW
@given(change=damage())
def test_a_damaged_archive_gives_a_sound_cloud_or_an_input_error(
    tmp_path: Path, valid: dict[str, bytes], suffix: str, change: Callable[[bytes], bytes]
) -> None:
    read_or_refuse(tmp_path / f"a{suffix}", change(valid[suffix]))


WORDS = st.sampled_from([
    "ply", "format", "ascii", "binary_little_endian", "binary_big_endian", "1.0", "element",
    "vertex", "face", "property", "list", "float", "uchar", "quad", "x", "y", "z", "end_header",
    "comment", "obj_info", "-1", "0", "2", "99999999999999999999", "nan", "é", "", "\r",
])  # fmt: skip


@FUZZ
@given(
    lines=st.lists(st.lists(WORDS, max_size=4).map(" ".join), max_size=10),
    body=st.binary(max_size=60),
)
def test_a_ply_header_of_random_words_gives_a_sound_cloud_or_an_input_error(
    tmp_path: Path, lines: list[str], body: bytes
) -> None:
    read_or_refuse(tmp_path / "a.ply", "\n".join(["ply", *lines, "end_header", ""]).encode() + body)


@FUZZ
@given(data=st.data())
def test_a_ply_header_with_lines_moved_lost_or_changed_gives_a_sound_cloud_or_an_input_error(
    tmp_path: Path, valid: dict[str, bytes], data: st.DataObject
) -> None:
    header, _, body = valid[".ply"].partition(b"end_header\n")
    lines = header.decode().splitlines()
    for _ in range(data.draw(st.integers(1, 3))):
        at = data.draw(st.integers(0, len(lines) - 1))
        other = data.draw(
            st.one_of(st.sampled_from(lines), st.lists(WORDS, max_size=4).map(" ".join))
        )
        lines[at : at + data.draw(st.integers(0, 1))] = [other]
    read_or_refuse(tmp_path / "a.ply", "\n".join([*lines, "end_header", ""]).encode() + body)


@FUZZ
@given(
    rows=st.lists(st.text("0123456789.eE+-naif \t\r\x0b\x85\u0661#\"'", max_size=12), max_size=4)
)
def test_ascii_vertices_of_random_text_give_a_sound_cloud_or_an_input_error(
    tmp_path: Path, rows: list[str]
) -> None:
    header = f"ply\nformat ascii 1.0\nelement vertex {len(rows)}\n"
    header += "property float x\nproperty uchar y\nproperty int z\nend_header\n"
    read_or_refuse(tmp_path / "a.ply", (header + "\n".join(rows) + "\n").encode())


@pytest.mark.parametrize("suffix", [".ply", ".las", ".pcd"])
def test_attributes_whose_names_come_to_be_alike_are_all_kept(tmp_path: Path, suffix: str) -> None:
    columns = {axis: np.zeros(3, np.float32) for axis in "xyz"}
    columns |= {"a": np.array([[1, 2]] * 3, np.int32), "a_0": np.full(3, 3, np.int32)}
    columns |= {"b c": np.full(3, 4, np.int32), "b_c": np.full(3, 5, np.int32)}
    write_cloud(tmp_path / f"cloud{suffix}", Cloud(columns))
    read = read_cloud(tmp_path / f"cloud{suffix}").columns
    assert {1, 2, 3, 4, 5} <= {
        int(value) for column in read.values() for value in np.unique(column)
    }
