"""HDF5 buildings, the authors' files, and the reader of whatever holds a building."""

import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest

from mcpseg_cli.building import Building
from mcpseg_cli.classes import MCPNET_CLASSES, S3DIS_CLASSES
from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats import Cloud, write_cloud
from mcpseg_cli.formats.buildings import read_building
from mcpseg_cli.formats.hdf5 import read_building_h5, read_tags, write_building_h5

COUNT = 1000
COLUMNS = ("xyz", "rgb", "semantic", "instance")


def make_building(seed: int = 0, **changes: object) -> Building:
    rng = np.random.default_rng(seed)
    fields = {
        "xyz": rng.uniform(-30, 30, (COUNT, 3)).astype(np.float32),
        "rgb": rng.integers(0, 256, (COUNT, 3)).astype(np.uint8),
        "semantic": rng.choice([0, 5, 12, 255], COUNT).astype(np.uint8),
        "instance": rng.integers(0, 3, COUNT).astype(np.int32),
        "rooms": ("café_1", "hall_2"),
        "room_starts": np.array([0, 400, COUNT]),
        "object_names": ("café_1/wall_1", "hall_2/chair_1"),
    }
    return Building(**(fields | changes))


def assert_same(first: Building, second: Building) -> None:
    for name in COLUMNS:
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
        assert getattr(first, name).dtype == getattr(second, name).dtype
    assert (first.classes, first.rooms, first.object_names) == (
        second.classes,
        second.rooms,
        second.object_names,
    )
    np.testing.assert_equal(first.room_starts, second.room_starts)


@pytest.mark.parametrize(
    "changes",
    [{}, {"rooms": (), "room_starts": None, "object_names": ()}, {"classes": ("one",) * 13}],
)
def test_a_building_reads_back_as_written(tmp_path, changes):
    building = make_building(**changes)
    write_building_h5(tmp_path / "a.h5", building)
    assert_same(read_building_h5(tmp_path / "a.h5"), building)
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]


def test_the_same_building_gives_the_same_bytes(tmp_path):
    for name in ("a", "b"):
        write_building_h5(tmp_path / name, make_building(), {"made": "by a test"})
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_tags_read_back(tmp_path):
    write_building_h5(tmp_path / "a.h5", make_building(), {"seed": "7", "ä": "ö" * 100_000})
    assert read_tags(tmp_path / "a.h5") == {"seed": "7", "ä": "ö" * 100_000}


def test_no_dataset_holds_objects(tmp_path):
    write_building_h5(tmp_path / "a.h5", make_building(), {"seed": "7"})
    with h5py.File(tmp_path / "a.h5") as file:
        assert all(dataset.dtype.kind in "fiuS" for dataset in file.values())


@pytest.mark.parametrize("name", ["", "a\0"])
def test_names_that_would_not_read_back_are_refused(tmp_path, name):
    with pytest.raises(OutputError, match="rooms holds a name"):
        write_building_h5(tmp_path / "a.h5", make_building(rooms=("a", name)))
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_missing_is_an_error_that_names_the_file(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"a\.h5"):
        write_building_h5(tmp_path / "none" / "a.h5", make_building())


@pytest.mark.parametrize("content", [b"", b"ply\n", b"\x89HDF\r\n\x1a\n" + bytes(2000)])
def test_what_is_not_hdf5_is_refused_in_one_line(tmp_path, content):
    (tmp_path / "a.h5").write_bytes(content)
    for read in (read_building_h5, read_tags):
        with pytest.raises(InputError, match=r"a\.h5: not a readable HDF5 file") as caught:
            read(tmp_path / "a.h5")
        assert "\n" not in str(caught.value)


def test_a_cut_file_is_refused_in_one_line(tmp_path):
    write_building_h5(tmp_path / "a.h5", make_building())
    whole = (tmp_path / "a.h5").read_bytes()
    for size in range(1, len(whole), 997):
        (tmp_path / "a.h5").write_bytes(whole[:size])
        with pytest.raises(InputError) as caught:
            read_building_h5(tmp_path / "a.h5")
        assert "\n" not in str(caught.value)


def test_flipped_bytes_never_give_another_building(tmp_path):
    building = make_building()
    write_building_h5(tmp_path / "a.h5", building)
    whole, rng = (tmp_path / "a.h5").read_bytes(), np.random.default_rng(0)
    places = np.concatenate(
        [rng.integers(0, len(whole), 150), rng.integers(0, len(whole) - 20 * COUNT, 300)]
    )
    for place in places:
        damaged = bytearray(whole)
        damaged[place] ^= 1 << rng.integers(8)
        (tmp_path / "a.h5").write_bytes(damaged)
        try:
            read = read_building_h5(tmp_path / "a.h5")
        except InputError:
            continue
        assert_same(read, building)


def replace(name: str, values: object):
    def change(file: h5py.File) -> None:
        del file[name]
        if values is not None:
            file[name] = values

    return change


def link(file: h5py.File) -> None:
    del file["rgb"]
    file["rgb"] = h5py.ExternalLink("other.h5", "rgb")


def without_data(file: h5py.File) -> None:
    del file["xyz"]
    file.create_dataset("xyz", (10**12, 3), np.float32, chunks=(1000, 3))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (replace("xyz", None), "no dataset 'xyz'"),
        (
            replace("xyz", np.zeros((COUNT, 3))),
            r"xyz float64 \(1000, 3\); expected float32 \(N, 3\)",
        ),
        (replace("xyz", np.zeros((COUNT, 2), np.float32)), r"xyz float32 \(1000, 2\)"),
        (replace("xyz", np.full((COUNT, 3), np.nan, np.float32)), "NaN or infinite"),
        (replace("rgb", np.zeros((5, 3), np.uint8)), "shapes"),
        (
            replace("semantic", np.full(COUNT, 13, np.uint8)),
            r"class 13 \(point 0\); expected 0 to 12",
        ),
        (replace("instance", np.full(COUNT, 3, np.int32)), "objects 3 to 3; expected 0 to 2"),
        (replace("instance", np.full(COUNT, -1, np.int32)), "objects -1 to -1"),
        (replace("room_starts", np.array([0, 1200, COUNT])), "room_starts"),
        (replace("room_starts", np.array([0, COUNT])), "room_starts int64"),
        (replace("rooms", ["a", "b"]), "rooms object"),
        (replace("rgb", np.zeros((COUNT, 3), np.uint8)), "checksum"),
        (link, "no dataset 'rgb'"),
        (without_data, "'xyz' without data"),
        (lambda file: file.attrs.__delitem__("format"), "expected a file of the format"),
        (lambda file: file.attrs.__delitem__("crc32"), "not a readable"),
    ],
)
def test_datasets_that_do_not_fit_are_refused_in_one_line(tmp_path, change, says):
    write_building_h5(tmp_path / "a.h5", make_building())
    with h5py.File(tmp_path / "a.h5", "a") as file:
        change(file)
    with pytest.raises(InputError, match=says) as caught:
        read_building_h5(tmp_path / "a.h5")
    assert "\n" not in str(caught.value)


# --- the authors' files
# --------------------------------------------------------------------------------------------


def authors_table(rgb: object = (0, 128, 255)) -> np.ndarray:
    table = np.zeros((6, 8), np.float32)
    table[:, :3] = np.arange(18).reshape(6, 3) / 8
    table[:, 3:6] = rgb
    table[:, 6] = [0, 1, 7, 1, 1, 2]
    table[:, 7] = [0, 12, 4, 4, 11, 10]
    return table


def write_h5(path: Path, **datasets: object) -> Path:
    with h5py.File(path, "w") as file:
        for name, values in datasets.items():
            file[name] = values
    return path


def test_the_authors_table_is_a_building_in_their_order_of_classes(tmp_path):
    building = read_building_h5(write_h5(tmp_path / "a.h5", points=authors_table()))
    np.testing.assert_array_equal(building.xyz, authors_table()[:, :3])
    assert building.classes == MCPNET_CLASSES
    assert building.semantic.tolist() == [0, 12, 4, 4, 11, 10]
    assert building.instance.tolist() == [0, 1, 7, 1, 1, 2]
    assert building.room_starts is None


@pytest.mark.parametrize("rgb", [(0, 128, 255), (0, 128 / 255, 1), (-0.5, 128 / 255 - 0.5, 0.5)])
def test_the_authors_colours_may_be_bytes_fractions_or_centred_fractions(tmp_path, rgb):
    building = read_building_h5(write_h5(tmp_path / "a.h5", points=authors_table(rgb)))
    assert building.rgb.tolist() == [[0, 128, 255]] * 6


def test_object_ids_that_restart_in_every_room_are_numbered_through(tmp_path):
    building = read_building_h5(
        write_h5(tmp_path / "a.h5", points=authors_table(), count_room=[3, 0, 3])
    )
    assert building.instance.tolist() == [0, 1, 2, 3, 3, 4]
    assert building.room_starts.tolist() == [0, 3, 3, 6]
    assert len(building.rooms) == 3


def with_value(column: int, value: float) -> np.ndarray:
    table = authors_table()
    table[2, column] = value
    return table


@pytest.mark.parametrize(
    ("datasets", "says"),
    [
        ({"points": np.zeros((5, 7))}, r"points float64 \(5, 7\); expected points \(N, 8\)"),
        ({"points": np.zeros((0, 8))}, r"points float64 \(0, 8\)"),
        ({"points": with_value(7, 13)}, "classes out of range"),
        ({"points": with_value(7, -1)}, "classes out of range"),
        ({"points": with_value(0, np.nan)}, "NaN"),
        ({"points": authors_table(), "count_room": [3, 4]}, "does not add up"),
        ({"other": np.zeros(3)}, "datasets other; expected"),
    ],
)
def test_tables_that_are_not_the_authors_are_refused(tmp_path, datasets, says):
    with pytest.raises(InputError, match=says):
        read_building_h5(write_h5(tmp_path / "a.h5", **datasets))


@pytest.mark.parametrize("width", [4, 8])
def test_a_signalling_nan_is_refused_without_a_warning(tmp_path, width):
    table = authors_table().astype(f"<f{width}")
    table.view(f"<u{width}")[2, 0] = {4: 0x7F800001, 8: 0x7FF0000000000001}[width]
    with warnings.catch_warnings(action="error"), pytest.raises(InputError, match="NaN"):
        read_building_h5(write_h5(tmp_path / "a.h5", points=table))


# --- any building
# --------------------------------------------------------------------------------------------------


def cloud(**columns: object) -> Cloud:
    values = {axis: np.arange(4, dtype=np.float32) for axis in "xyz"}
    values |= {name: np.array([1, 2, 3, 4], np.uint8) for name in ("red", "green", "blue")}
    values |= {
        "semantic": np.array([0, 3, 12, 255], np.uint8),
        "instance": np.array([1, 2, 0, 2], np.int32),
    }
    return Cloud(
        {name: values for name, values in (values | columns).items() if values is not None}
    )


@pytest.mark.parametrize("suffix", [".ply", ".las", ".laz", ".npz", ".pcd"])
def test_a_labelled_cloud_of_any_format_is_a_building(tmp_path, suffix):
    write_cloud(tmp_path / f"a{suffix}", cloud())
    building, notices = read_building(tmp_path / f"a{suffix}")
    assert building.semantic.tolist() == [0, 3, 12, 255]
    assert building.instance.tolist() == [1, 2, 0, 2]
    assert building.rgb[:, 0].tolist() == [1, 2, 3, 4]
    np.testing.assert_allclose(building.xyz[:, 1], np.arange(4), atol=1e-3)
    assert (building.classes, notices) == (S3DIS_CLASSES, ())


def test_a_clouds_own_class_table_is_kept(tmp_path):
    write_cloud(
        tmp_path / "a.npz",
        Cloud(cloud(semantic=np.array([0, 1, 1, 255])).columns, ("floor", "tree")),
    )
    assert read_building(tmp_path / "a.npz")[0].classes == ("floor", "tree")


def test_a_cloud_without_objects_or_colour_is_a_grey_building_and_says_so(tmp_path):
    write_cloud(tmp_path / "a.npz", cloud(instance=None, red=None, green=None, blue=None))
    building, notices = read_building(tmp_path / "a.npz")
    assert building.instance.tolist() == [0] * 4
    assert (building.rgb == 128).all()
    assert ["instance" in notices[0], "grey" in notices[1], len(notices)] == [True, True, 2]


def test_minus_one_is_unknown_and_no_object(tmp_path):
    minus = np.array([-1, 0, 1, -1], np.float32)
    write_cloud(tmp_path / "a.npz", cloud(semantic=minus, instance=minus))
    building, _ = read_building(tmp_path / "a.npz")
    assert building.semantic.tolist() == [255, 0, 1, 255]
    assert building.instance.tolist() == [0, 0, 1, 0]


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"semantic": None}, "points without semantic"),
        ({"semantic": np.array([0, 13, 0, 0])}, r"class 13 \(point 1\); expected 0 to 12, or 255"),
        ({"semantic": np.array([0, 0, -2, 0])}, r"class -2 \(point 2\)"),
        ({"semantic": np.array([0, 0, 0.5, 0])}, r"semantic 0.5 \(point 2\)"),
        ({"semantic": np.array([0, 0, np.nan, 0])}, r"semantic nan \(point 2\)"),
        (
            {"semantic": np.array([0, 2**64 - 1, 0, 0], np.uint64)},
            r"semantic 18446744073709551615 \(point 1\)",
        ),
        ({"instance": np.array([0, 2**31, 0, 0])}, "object 2147483648"),
        ({"instance": np.zeros((4, 2))}, r"instance float64 \(4, 2\)"),
        ({"x": np.array([0, 0, 512_345.0, 0])}, "coordinates up to 512,345 m"),
    ],
)
def test_clouds_that_are_no_building_are_refused_in_one_line(tmp_path, columns, says):
    write_cloud(tmp_path / "a.npz", cloud(**columns))
    with pytest.raises(InputError, match=says) as caught:
        read_building(tmp_path / "a.npz")
    assert "\n" not in str(caught.value)


def test_folders_and_hdf5_files_are_dispatched(tmp_path):
    path = tmp_path / "Area_1" / "office_1" / "Annotations" / "stairs_1.txt"
    path.parent.mkdir(parents=True)
    path.write_text("1 2 3 4 5 6\n")
    building, notices = read_building(tmp_path / "Area_1", tmp_path / "cache")
    assert notices == ("1 x class counted as clutter: stairs (1)",)
    (cache,) = (tmp_path / "cache").glob("Area_1*.h5")
    assert_same(read_building(cache)[0], building)


@pytest.mark.parametrize(
    ("name", "says"), [("none.ply", "no such file"), ("a.obj", "a file ending in '.obj'")]
)
def test_what_is_not_there_or_of_another_format_is_refused(tmp_path, name, says):
    (tmp_path / "a.obj").write_text("v 0 0 0")
    with pytest.raises(InputError, match=says):
        read_building(tmp_path / name)
