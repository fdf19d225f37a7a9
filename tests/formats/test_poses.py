"""Pose tables: every kind gives the same poses, every malformed one says where it is wrong."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.poses import Poses, read_poses

FUZZ = settings(
    max_examples=250,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
COLUMNS = ("scan", "timestamp", "x", "y", "z", "qx", "qy", "qz", "qw")


def make_poses(num_poses: int = 5, seed: int = 0) -> NDArray[np.float64]:
    """Draw (P, 4, 4) poses."""
    rng = np.random.default_rng(seed)
    poses = np.tile(np.eye(4), (num_poses, 1, 1))
    poses[:, :3, :3] = Rotation.random(num_poses, rng).as_matrix()
    poses[:, :3, 3] = rng.uniform(-20, 20, (num_poses, 3))
    return poses


def values(poses: NDArray[np.float64]) -> list[dict[str, str]]:
    """Spell poses as words by column name."""
    rows = []
    for number, pose in enumerate(poses):
        quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat()
        numbers = [0.1 * number, *pose[:3, 3], *quaternion]
        rows.append(
            dict(
                zip(
                    COLUMNS,
                    [f"{number:06d}", *(repr(float(word)) for word in numbers)],
                    strict=True,
                )
            )
        )
    return rows


def write_csv(
    path: Path, columns: tuple[str, ...], poses: NDArray[np.float64], separator: str = ","
) -> Path:
    lines = [separator.join(columns)]
    lines += [separator.join(row[name] for name in columns) for row in values(poses)]
    path.write_text("\n".join(lines) + "\n")
    return path


def write_text(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


CSV_LAYOUTS = {
    "all columns": COLUMNS,
    "without scan": COLUMNS[1:],
    "without timestamp": (COLUMNS[0], *COLUMNS[2:]),
    "poses only": COLUMNS[2:],
    "reversed": COLUMNS[::-1],
    "mixed": ("qw", "z", "scan", "x", "qx", "y", "qz", "qy"),
}


@pytest.mark.parametrize("columns", CSV_LAYOUTS.values(), ids=CSV_LAYOUTS)
def test_a_csv_in_any_layout_gives_the_poses(tmp_path: Path, columns: tuple[str, ...]) -> None:
    table = read_poses(write_csv(tmp_path / "poses.csv", columns, make_poses()))
    np.testing.assert_allclose(table.poses, make_poses(), atol=1e-12)
    assert table.has_rotation


def test_a_tum_file_gives_the_poses(tmp_path: Path) -> None:
    lines = [" ".join(row[name] for name in COLUMNS[1:]) for row in values(make_poses())]
    table = read_poses(
        write_text(tmp_path / "poses.tum", "# timestamp tx ty tz qx qy qz qw\n" + "\n".join(lines))
    )
    np.testing.assert_allclose(table.poses, make_poses(), atol=1e-12)
    assert table.scans is None


def test_a_kitti_file_gives_the_poses(tmp_path: Path) -> None:
    lines = [" ".join(repr(float(word)) for word in pose[:3].ravel()) for pose in make_poses()]
    table = read_poses(write_text(tmp_path / "poses.txt", "\n".join(lines) + "\n"))
    np.testing.assert_allclose(table.poses, make_poses(), atol=1e-12)
    assert table.scans is None


def test_a_scan_column_names_the_scans_and_nothing_else_does(tmp_path: Path) -> None:
    assert read_poses(write_csv(tmp_path / "a.csv", COLUMNS, make_poses(2))).scans == (
        "000000",
        "000001",
    )
    assert read_poses(write_csv(tmp_path / "b.csv", COLUMNS[1:], make_poses(2))).scans is None


def test_positions_alone_give_poses_that_look_along_the_maps_axes(tmp_path: Path) -> None:
    table = read_poses(write_csv(tmp_path / "poses.csv", ("x", "y", "z"), make_poses()))
    np.testing.assert_allclose(table.poses[:, :3, 3], make_poses()[:, :3, 3])
    np.testing.assert_array_equal(table.poses[:, :3, :3], np.tile(np.eye(3), (5, 1, 1)))
    assert not table.has_rotation


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_a_table_from_any_editor_is_read(tmp_path: Path, newline: str, mark: str) -> None:
    text = newline.join([mark + "X, Y, Z", "", "# the start", " 1, 2, 3 "])
    (tmp_path / "poses.csv").write_bytes(text.encode())
    np.testing.assert_array_equal(read_poses(tmp_path / "poses.csv").poses[:, :3, 3], [[1, 2, 3]])


def test_a_csv_may_be_separated_by_spaces(tmp_path: Path) -> None:
    table = read_poses(write_csv(tmp_path / "poses.txt", COLUMNS, make_poses(), separator=" "))
    np.testing.assert_allclose(table.poses, make_poses(), atol=1e-12)


def test_quaternions_that_are_a_little_off_unit_length_give_rotations(tmp_path: Path) -> None:
    table = read_poses(write_text(tmp_path / "poses.tum", "0 1 2 3 0 0 0.01 1.01\n"))
    np.testing.assert_allclose(np.linalg.det(table.poses[0, :3, :3]), 1.0)


MALFORMED = {
    "empty": ("", "no poses"),
    "only comments": ("# scan x y z\n\n# end\n", "no poses"),
    "header only": ("x,y,z\n", "a header and no poses"),
    "three columns without a header": ("1 2 3\n", "3 columns"),
    "eleven columns": ("1 0 0 0 0 1 0 0 0 0 1\n", "11 columns"),
    "no position": ("scan,speed\na,4\n", "columns scan, speed"),
    "no z": ("x,y\n1,2\n", "columns x, y;"),
    "half a quaternion": ("x,y,z,qx,qy\n1,2,3,0,0\n", "columns x, y, z, qx, qy"),
    "column twice": ("x,y,z,x\n1,2,3,4\n", "columns x, y, z, x"),
    "short csv line": ("x,y,z\n1,2,3\n1,2\n", "line 3 has 2 columns"),
    "long csv line": ("x,y,z\n\n1,2,3,4\n", "line 3 has 4 columns"),
    "short tum line": ("0 1 2 3 0 0 0 1\n0 1 2 3 0 0 0\n", "line 2 has 7 columns"),
    "text in csv": ("scan,x,y,z\na,1,2,3\nb,1,north,3\n", "'north' in line 3, column"),
    "text in tum": ("0 1 2 3 0 0 0 1\n1 1 2 3 0 zero 0 1\n", "'zero' in line 2, column 6"),
    "text in kitti": (
        "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 O\n",
        "'O' in line 2, column 12",
    ),
    "empty word": ("x,y,z\n1,,3\n", "'' in line 2, column 2"),
    "only nan": ("x,y,z\n1,2,nan\n", "1 rows without a pose (nan in line 2)"),
    "overflow": ("x,y,z\n1,2,1e999\n", "'1e999' in line 2, column 3"),
    "only zero quaternions": ("0 1 2 3 0 0 0 0\n", "a quaternion of zeros in line 1"),
    "long quaternion": ("x,y,z,qx,qy,qz,qw\n0,0,0,1,1,1,1\n", "quaternion of length 2 in line 2"),
    "huge quaternion": ("0 1 2 3 1e300 0 0 1\n", "quaternion of length inf in line 1"),
    "reflected matrix": (
        "1 0 0 0 0 1 0 0 0 0 1 0\n-1 0 0 0 0 1 0 0 0 0 1 0\n",
        "line 2 is no rotation",
    ),
    "scaled matrix": ("2 0 0 0 0 2 0 0 0 0 2 0\n", "line 1 is no rotation"),
    "huge matrix": ("1e300 0 0 0 0 1e300 0 0 0 0 1e300 0\n", "line 1 is no rotation"),
    "scan twice": ("scan,x,y,z\na,1,2,3\nb,1,2,3\na,1,2,4\n", "scan a appears 2 times"),
    "binary": ("\0\1\2", "binary data"),
}


@pytest.mark.parametrize(("text", "found"), MALFORMED.values(), ids=MALFORMED)
def test_a_malformed_table_is_refused_with_the_place(tmp_path: Path, text: str, found: str) -> None:
    path = write_text(tmp_path / "poses.csv", text)
    with pytest.raises(InputError) as caught:
        read_poses(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert found in str(caught.value)


def test_a_column_is_counted_as_in_the_file_also_behind_the_scan_names(tmp_path: Path) -> None:
    path = write_text(tmp_path / "poses.csv", "scan,x,y,z\na,1,north,3\n")
    with pytest.raises(InputError, match="line 2, column 3"):
        read_poses(path)


def test_a_missing_file_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_poses(tmp_path / "poses.csv")


# --- fuzzing: only InputError may come out ---


def read_or_refuse(path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # a warning would be a second line on stderr
        try:
            table = read_poses(path)
        except InputError:
            return
    assert_sound(table)


def assert_sound(table: Poses) -> None:
    assert table.poses.shape == (len(table), 4, 4)
    assert len(table) > 0
    known = [row for row in range(len(table)) if row not in table.lost]
    assert len(known) > 0
    assert np.isfinite(table.poses[known]).all()
    assert np.isnan(table.poses[list(table.lost)]).all()
    assert np.abs(np.linalg.det(table.poses[known, :3, :3]) - 1).max() < 0.1
    assert table.scans is None or len(table.scans) == len(table)


@FUZZ
@given(data=st.binary(max_size=200))
def test_random_bytes_give_sound_poses_or_an_input_error(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "poses").write_bytes(data)
    read_or_refuse(tmp_path / "poses")


ODD = ["", "#", "0", "1", "-1", "0.5", "1e200", "nan", "inf", "1_0"]
ODD += ["\u0661", "\u2028", "\x85", "é"]
WORDS = st.one_of(st.sampled_from([*COLUMNS, *ODD]), st.floats().map(repr))


@FUZZ
@given(
    rows=st.lists(st.lists(WORDS, max_size=13), max_size=6),
    header=st.sampled_from(["", "x,y,z", "scan x y z", ",".join(COLUMNS)]),
    separator=st.sampled_from([",", " ", "\t", ", "]),
)
def test_tables_of_random_words_give_sound_poses_or_an_input_error(
    tmp_path: Path, rows: list[list[str]], header: str, separator: str
) -> None:
    text = "\n".join([header, *(separator.join(row) for row in rows)])
    (tmp_path / "poses").write_bytes(text.encode())
    read_or_refuse(tmp_path / "poses")


@FUZZ
@given(
    rows=st.lists(
        st.lists(
            st.sampled_from(["0", "1", "-1", "0.7071", "1e300", "1e-300"]), min_size=8, max_size=8
        ),
        min_size=1,
    ),
    wide=st.booleans(),
)
def test_tables_of_numbers_give_sound_poses_or_an_input_error(
    tmp_path: Path, rows: list[list[str]], wide: bool
) -> None:
    rows = [row + row[:4] for row in rows] if wide else rows
    (tmp_path / "poses").write_text("\n".join(" ".join(row) for row in rows))
    read_or_refuse(tmp_path / "poses")
