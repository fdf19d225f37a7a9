"""Reading and writing the S3DIS layout: text, dirty lines, folders, the cache."""

import math
import os
import re
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats import s3dis_files
from mcpseg_cli.formats.s3dis import read_area, write_room
from mcpseg_cli.formats.s3dis_text import format_lines, read_lines

LINE = "1.5 -2.25 0.125 10 20 30"
_COMPILED = settings(deadline=None)  # the first call compiles
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


def write(area: Path, files: dict[str, str | bytes]) -> Path:
    """Write files named ``room/class_k`` into an area."""
    for name, text in files.items():
        room, stem = name.split("/")
        path = area / room / "Annotations" / (stem if "." in stem else f"{stem}.txt")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(text.encode() if isinstance(text, str) else text)
    return area


def points_as_python_reads_them(text: bytes) -> tuple[list[list[float]], list[int]]:
    """Slow twin of the parser: the points and the numbers of bad lines; nothing is mended."""
    points, bad = [], []
    lines = text.decode("latin-1").split("\n")
    for number, line in enumerate(lines[:-1] if lines[-1] == "" else lines, 1):
        fields = [field for field in re.split("[ \t\r]+", line) if field]
        values = [float(field) if NUMBER.fullmatch(field) else math.nan for field in fields]
        with np.errstate(over="ignore"):
            fits = len(values) == 6 and np.isfinite(np.array(values, np.float32)).all()
        if fits and all(0 <= value <= 255 for value in np.array(values[3:], np.float32)):
            points.append([*values[:3], *(math.floor(value + 0.5) for value in values[3:])])
        elif fields:
            bad.append(number)
    return points, bad


def within_one_step(read: np.ndarray, true: np.ndarray) -> bool:
    """Whether float32 values differ from correctly rounded ones by one step at most."""
    true = true.astype(np.float32)
    with np.errstate(over="ignore"):
        return bool(
            ((np.nextafter(true, -np.inf) <= read) & (read <= np.nextafter(true, np.inf))).all()
        )


# --- lines ----------------------------------------------------------------------------------------
# -----------------


@_COMPILED
@given(
    st.lists(
        st.from_regex(
            r"[+-]?([0-9]{1,25}(\.[0-9]{0,25})?|\.[0-9]{1,25})([eE][+-]?[0-9]{1,3})?",
            fullmatch=True,
        ),
        max_size=16,
    )
)
@example(["1e38", "3.4028235677973366e38", "3.4028234e38", "1e-45", "7e-46", "0.3"])
@example(["16777217", "16777217.000001"])
@example(
    [
        "0" * 400 + "1e0",
        "0." + "0" * 400 + "1e401",
        "1" + "0" * 400 + "e-400",
        "1e99999999999999999999",
    ]
)
@example(["9007199254740993", "999999999999999999.9", "9223372036854775808"])
@example(["18446744073709551616", "1e22", "1e23"])
def test_coordinates_are_within_one_float32_step_of_what_python_reads(numbers):
    text = "".join(f"{number} 0 0 0 0 0\n" for number in numbers).encode()
    points, bad = points_as_python_reads_them(text)
    lines = read_lines(text)
    assert [line.line for line in lines.bad] == bad
    assert within_one_step(lines.xyz[:, 0], np.array([point[0] for point in points]))


@_COMPILED
@given(st.lists(st.floats(-1000, 1000, width=32), min_size=3, max_size=3))
def test_coordinates_of_usual_size_are_rounded_correctly(numbers):
    text = " ".join([*map(repr, numbers), "1 2 3\n"]).encode()
    np.testing.assert_array_equal(read_lines(text).xyz, np.array([numbers]).astype(np.float32))


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.lists(
            st.one_of(
                st.integers(-5, 300).map(str),
                st.floats(-300, 300).map(repr),
                st.text("0123456789+-.eE\r\tnaif_x", max_size=8),
            ),
            min_size=5,
            max_size=7,
        ).map(" ".join),
        max_size=12,
    )
)
def test_any_text_gives_the_points_and_bad_lines_of_the_slow_twin(rows):
    text = "\n".join(rows).encode()
    points, bad = points_as_python_reads_them(text)
    lines = read_lines(text)
    assert [line.line for line in lines.bad] == bad
    assert within_one_step(lines.xyz, np.array([point[:3] for point in points]).reshape(-1, 3))
    assert lines.rgb.tolist() == [point[3:] for point in points]


@_COMPILED
@given(st.binary(max_size=300))
def test_random_bytes_never_crash_the_parser(text):
    lines = read_lines(text)
    assert len(lines.xyz) == len(lines.rgb) <= lines.num_lines
    assert np.isfinite(lines.xyz).all()


@pytest.mark.parametrize(
    "line",
    [
        "1.5 -2.25 0.125 10 20 30",
        "1.5\t-2.25\t0.125\t10\t20\t30",
        "  1.5   -2.25 0.125 10 20 30  ",
        "1.5 -2.25 0.125 10 20 30\r",
        "+1.5e0 -225E-2 .125 10.0 20.000000 3e1",
    ],
)
def test_separators_line_ends_and_ways_to_write_numbers_do_not_matter(line):
    lines = read_lines(f"{line}\n{line}".encode())
    np.testing.assert_array_equal(lines.xyz, np.array([[1.5, -2.25, 0.125]] * 2, np.float32))
    assert lines.rgb.tolist() == [[10, 20, 30]] * 2
    assert lines.bad == ()


def test_blank_lines_are_counted_but_neither_points_nor_bad():
    lines = read_lines(f"\n{LINE}\r\n  \r\n\n{LINE}".encode())
    assert (len(lines.xyz), lines.num_lines, lines.bad) == (2, 5, ())


@pytest.mark.parametrize(
    ("line", "colour"),
    [
        (b"1 2 3 98 185\x10187", [98, 185, 187]),
        (b"1 2 3 103.0\x100000 9 8", [103, 9, 8]),
        (b"\xef\xbb\xbf1 2 3 7 8 9", [7, 8, 9]),
        (b"1 2 3 7 8 9\x00", [7, 8, 9]),
    ],
)
def test_a_stray_byte_is_taken_for_a_separator_or_left_out(line, colour):
    lines = read_lines(LINE.encode() + b"\n" + line + b"\n" + LINE.encode())
    assert lines.rgb.tolist() == [[10, 20, 30], colour, [10, 20, 30]]
    assert lines.xyz[1].tolist() == [1, 2, 3]
    assert [(bad.line, bad.mended) for bad in lines.bad] == [(2, True)]


@pytest.mark.parametrize(
    "line",
    [
        "1 2 3 4 5", "1 2 3 4 5 6 7", "nan 2 3 4 5 6", "1 inf 3 4 5 6", "1 2 3 256 5 6",
        "1 2 3 4 -1 6", "1 2 1e39 4 5 6", "1,2,3,4,5,6", "x y z r g b", "1 2 3 4 5 6e",
        "1_0 2 3 4 5 6", "- 2 3 4 5 6", "1..2 2 3 4 5 6",
    ],
)  # fmt: skip
def test_a_line_that_is_not_six_numbers_in_range_is_dropped(line):
    lines = read_lines(f"{LINE}\n{line}\n{LINE}\n".encode())
    assert len(lines.xyz) == 2
    assert [(bad.line, bad.text, bad.mended) for bad in lines.bad] == [(2, line, False)]


@_COMPILED
@given(st.lists(st.floats(-1e9, 1e9, width=32), min_size=1, max_size=20), st.integers(0, 255))
@example([0.0005, 0.0015, -0.0005, -0.0004, 0.0625, 1e9, -1e9], 255)
def test_points_are_written_as_python_writes_them(numbers, colour):
    xyz = np.repeat(np.array(numbers, np.float32)[:, None], 3, axis=1)
    rgb = np.full((len(numbers), 3), colour, np.uint8)
    expected = ""
    for x in xyz[:, 0].astype(float):
        coordinate = f"{x:.3f}" if abs(x) > 0.0005 else "0.000"
        expected += f"{coordinate} {coordinate} {coordinate} {colour} {colour} {colour}\n"
    assert b"".join(map(bytes, format_lines(xyz, rgb))).decode() == expected


# --- folders --------------------------------------------------------------------------------------
# -----------------


def test_rooms_and_files_come_in_natural_order_and_objects_are_numbered_through(tmp_path):
    names = ["hallway_2/wall_10", "hallway_10/chair_1", "hallway_2/wall_2", "hallway_2/ceiling_1"]
    building, report = read_area(
        write(tmp_path / "Area_1", dict.fromkeys(names, f"{LINE}\n{LINE}\n"))
    )
    assert building.object_names == (
        "hallway_2/ceiling_1",
        "hallway_2/wall_2",
        "hallway_2/wall_10",
        "hallway_10/chair_1",
    )
    assert building.rooms == ("hallway_2", "hallway_10")
    assert building.room_starts.tolist() == [0, 6, 8]
    assert building.instance.tolist() == [1, 1, 2, 2, 3, 3, 4, 4]
    assert [S3DIS_CLASSES[label] for label in building.semantic[::2]] == [
        "ceiling",
        "wall",
        "wall",
        "chair",
    ]
    assert (report.num_files, report.notices()) == (4, ())


def test_hidden_and_other_files_are_passed_over(tmp_path):
    files = {
        "office_1/.DS_Store": b"\0\0",
        "office_1/._wall_1.txt": b"\0",
        "office_1/notes.md": "x",
        "office_1/wall_1": LINE,
    }
    area = write(tmp_path / "Area_1", files)
    (area / "office_1" / "office_1.txt").write_text(LINE)
    (area / "Area_1_alignmentAngle.txt").write_text("## angle")
    (area / ".DS_Store").write_bytes(b"\0")
    building, report = read_area(area)
    assert (len(building), report.notices()) == (1, ())


def test_classes_outside_the_thirteen_become_clutter_and_are_named(tmp_path):
    files = dict.fromkeys(
        ["office_1/stairs_1", "office_1/stairs_2", "office_1/clutter_12", "office_1/Sofa"], LINE
    )
    building, report = read_area(write(tmp_path / "Area_1", files))
    assert [S3DIS_CLASSES[label] for label in building.semantic] == [
        "sofa",
        "clutter",
        "clutter",
        "clutter",
    ]
    assert report.other_classes == (("stairs", 2),)
    assert report.notices() == ("1 x class counted as clutter: stairs (2)",)


def test_a_class_table_names_the_classes_of_an_area_and_of_each_of_its_rooms(tmp_path):
    area = write(tmp_path / "Area_1", dict.fromkeys(["a_1/bed_1", "a_1/stool_1"], LINE))
    (area / "classes.txt").write_text("# ours\nfloor\n\nclutter\n Bed \n")
    for path in (area, area / "a_1", area / "a_1/Annotations"):
        building, report = read_area(path, use_cache=False)
        assert building.classes == ("floor", "clutter", "bed")
        assert building.semantic.tolist() == [2, 1]
        assert report.notices() == ("1 x class counted as clutter: stool (1)",)


def test_without_clutter_in_the_table_other_classes_are_unknown(tmp_path):
    area = write(tmp_path / "Area_1", dict.fromkeys(["a_1/bed_1", "a_1/stool_1"], LINE))
    (area / "classes.txt").write_text("floor\nbed\n")
    building, report = read_area(area, use_cache=False)
    assert building.semantic.tolist() == [1, 255]
    assert report.notices() == ("1 x class counted as unknown: stool (1)",)


def test_another_class_table_makes_the_cache_anew(tmp_path):
    area = write(tmp_path / "Area_1", {"a_1/bed_1": LINE})
    assert read_area(area)[0].classes == S3DIS_CLASSES
    (area / "classes.txt").write_text("bed\nwall\n")
    assert read_area(area)[0].classes == ("bed", "wall")
    assert read_area(area)[1].from_cache


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (b"# nothing\n", "no class; expected up to 254 names"),
        (b"bed\nbed\n", "class 'bed' twice; expected every class once"),
        (b"bed,wall\n", "a class named 'bed,wall'; expected"),
        (b"\xff\xfe", "no text in UTF-8; expected class names"),
    ],
)
def test_a_class_table_that_cannot_be_used_is_refused_in_one_line(tmp_path, text, says):
    area = write(tmp_path / "Area_1", {"a_1/bed_1": LINE})
    (area / "classes.txt").write_bytes(text)
    with pytest.raises(InputError, match=rf"classes\.txt: {says}") as caught:
        read_area(area)
    assert len(str(caught.value).splitlines()) == 1


def test_empty_files_and_folders_without_annotations_are_passed_over_and_named(tmp_path):
    area = write(tmp_path / "Area_1", {"a_1/wall_1": LINE, "a_1/wall_2": "", "b_1/wall_1": "\n \n"})
    (area / "c_1").mkdir()
    building, report = read_area(area)
    assert building.rooms == ("a_1",)
    assert building.instance.tolist() == [1]
    assert report.empty == ("a_1/Annotations/wall_2.txt", "b_1/Annotations/wall_1.txt")
    assert report.without_annotations == ("c_1", "b_1")


@pytest.mark.parametrize("inner", ["office_1", "office_1/Annotations"])
def test_a_single_room_is_an_area_of_one_room(tmp_path, inner):
    area = write(tmp_path / "Area_1", {"office_1/wall_1": LINE, "office_2/wall_1": LINE})
    building, _ = read_area(area / inner)
    assert (building.rooms, building.object_names) == (("office_1",), ("office_1/wall_1",))


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda folder: None, "no such folder"),
        (lambda folder: folder.write_text(LINE), "a file"),
        (lambda folder: folder.mkdir(), "no object files"),
        (
            lambda folder: write(folder / "Area_3", {"office_1/wall_1": LINE}),
            "name one area, such as .*Area_3",
        ),
        (lambda folder: write(folder, {"office_1/wall_1": ""}), "1 object files without a point"),
        (
            lambda folder: write(folder, {"office_1/wall_1": b"\0" * 70_000}),
            "wall_1.txt: 1 bad lines, first line 1",
        ),
        (
            lambda folder: write(folder, {"office_1/wall_1": (LINE + " 9\n") * 9}),
            r"9 bad .*first line 1: '1.5 .* 30 9'",
        ),
    ],
)
def test_what_is_no_area_is_refused_in_one_line(tmp_path, make, says):
    make(tmp_path / "area")
    with pytest.raises(InputError, match=says) as caught:
        read_area(tmp_path / "area")
    assert "\n" not in str(caught.value)


def test_bad_lines_are_reported_with_file_and_number(tmp_path):
    text = [LINE] * 500
    text[99], text[299] = "1 2 3 4 5\x106", "rubbish"
    building, report = read_area(
        write(tmp_path / "Area_5", {"hallway_6/ceiling_1": "\n".join(text)})
    )
    assert len(building) == 499
    assert report.mended == ("hallway_6/Annotations/ceiling_1.txt:100",)
    assert report.dropped == ("hallway_6/Annotations/ceiling_1.txt:300",)
    assert report.notices()[0] == "1 x bad line mended: hallway_6/Annotations/ceiling_1.txt:100"


@pytest.mark.parametrize(("num_bad", "refused"), [(10, False), (11, True)])
def test_a_file_with_more_than_ten_bad_lines_and_a_thousandth_is_refused(
    tmp_path, num_bad, refused
):
    area = write(tmp_path / "Area_1", {"a_1/wall_1": f"{LINE}\n" * 5000 + "bad\n" * num_bad})
    if refused:
        with pytest.raises(InputError, match=r"11 bad lines, first line 5,001: 'bad'"):
            read_area(area)
    else:
        assert len(read_area(area)[1].dropped) == num_bad


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("part", [1, 7, 24, 25, 26, 64, 1000])
def test_files_read_in_parts_give_the_same_points_and_line_numbers(
    tmp_path, monkeypatch, part, threads
):
    rows = [f"{number} 0 0 1 2 3" + "\r" * (number % 2) for number in range(30)]
    rows[20] = "bad"
    area = write(
        tmp_path / "Area_1",
        {"a_1/wall_1": "\n".join(rows), "a_1/wall_2": "\n".join(rows[:7]) + "\n"},
    )
    monkeypatch.setattr(s3dis_files, "_PART", part)
    building, report = read_area(area, threads=threads, use_cache=False)
    assert building.xyz[:, 0].tolist() == [*range(20), *range(21, 30), *range(7)]
    assert np.bincount(building.instance).tolist() == [0, 29, 7]
    assert report.dropped == ("a_1/Annotations/wall_1.txt:21",)


def test_progress_ends_at_all_bytes(tmp_path):
    area = write(tmp_path / "Area_1", {"a_1/wall_1": LINE, "b_1/wall_1": f"{LINE}\n"})
    calls = []
    read_area(area, progress=lambda *call: calls.append(call))
    assert calls == [("a_1", 24, 49), ("b_1", 49, 49)]


def test_the_real_room_has_the_points_objects_and_classes_known(shared_folder, tmp_path):
    area = tmp_path / "Area_1"
    room = shared_folder / "real" / "s3dis_room" / "Area_1"
    without_cache = shutil.ignore_patterns(".*")
    shutil.copytree(room, area, copy_function=shutil.copyfile, ignore=without_cache)
    for folder in (area, area / "conferenceRoom_1", area / "conferenceRoom_1" / "Annotations"):
        folder.chmod(0o755)
    building, report = read_area(area)
    again, cached = read_area(area)
    slow = np.loadtxt(area / "conferenceRoom_1" / "Annotations" / "bookcase_10.txt")
    mine = building.object_names.index("conferenceRoom_1/bookcase_10") + 1
    assert (len(building), len(building.object_names), report.notices()) == (480_470, 90, ())
    assert sum(count > 0 for count in building.class_counts().values()) == 12
    np.testing.assert_array_equal(
        building.xyz[building.instance == mine], slow[:, :3].astype(np.float32)
    )
    assert cached.from_cache
    np.testing.assert_array_equal(again.xyz, building.xyz)


# --- the cache ------------------------------------------------------------------------------------
# -----------------


@pytest.fixture
def area(tmp_path) -> Path:
    files = {"a_1/wall_1": f"{LINE}\nbad\n{LINE}\n", "b_1/stairs_1": LINE, "b_1/door_1": ""}
    return write(tmp_path / "Area_1", files)


def test_the_second_time_comes_from_the_cache_with_the_same_report(area):
    first, report = read_area(area)
    second, cached = read_area(area)
    assert not report.from_cache
    assert cached.from_cache
    assert cached.notices() == report.notices()
    for name in ("xyz", "rgb", "semantic", "instance", "room_starts"):
        np.testing.assert_array_equal(getattr(second, name), getattr(first, name))
    assert (second.rooms, second.object_names, second.classes) == (
        first.rooms,
        first.object_names,
        first.classes,
    )


def test_without_cache_nothing_is_written(area):
    before = sorted(area.rglob("*"))
    read_area(area, use_cache=False)
    assert sorted(area.rglob("*")) == before


def test_the_cache_lies_in_the_folder_given(area, tmp_path):
    read_area(area, tmp_path / "new" / "cache")
    (cache,) = (tmp_path / "new" / "cache").iterdir()
    assert cache.name.startswith(f"{area.name}-")
    assert not (area / ".mcpseg.h5").exists()


def test_two_areas_of_one_name_do_not_share_a_cache(area, tmp_path):
    other = tmp_path / "other" / area.name
    shutil.copytree(area, other)
    for folder in (area, other):
        read_area(folder, tmp_path / "cache")
    assert all(read_area(folder, tmp_path / "cache")[1].from_cache for folder in (area, other))


def test_a_change_that_leaves_size_and_time_alone_is_noticed(area):
    path = area / "a_1/Annotations/wall_1.txt"
    read_area(area)
    before = path.stat()
    path.write_bytes(path.read_bytes().replace(b"1", b"2"))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert path.stat().st_size == before.st_size
    assert not read_area(area)[1].from_cache


def touch(path: Path) -> None:
    os.utime(path, ns=(1, path.stat().st_mtime_ns + 1))


@pytest.mark.parametrize(
    "change",
    [
        lambda area: write(area, {"a_1/wall_2": LINE}),
        lambda area: write(area, {"b_1/door_1": LINE}),
        lambda area: (area / "b_1/Annotations/door_1.txt").unlink(),
        lambda area: (area / "b_1").rename(area / "c_1"),
        lambda area: touch(area / "a_1/Annotations/wall_1.txt"),
    ],
    ids=["added", "grown", "removed", "renamed", "touched"],
)
def test_any_change_of_the_files_makes_the_cache_anew(area, change):
    read_area(area)
    change(area)
    fresh, _ = read_area(area, use_cache=False)
    building, report = read_area(area)
    assert not report.from_cache
    assert "made from other files" in report.cache_notice
    assert building.object_names == fresh.object_names
    assert read_area(area)[1].from_cache


def test_a_damaged_cache_is_never_trusted(area):
    building, _ = read_area(area)
    cache = area / ".mcpseg.h5"
    whole = cache.read_bytes()
    at = whole.index(building.xyz.tobytes())
    flipped = whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :]
    for damaged in (b"", b"text", whole[:100], whole[: len(whole) // 2], whole[:-1], flipped):
        cache.write_bytes(damaged)
        again, report = read_area(area)
        assert not report.from_cache
        assert "not usable" in report.cache_notice
        np.testing.assert_array_equal(again.xyz, building.xyz)
        assert cache.read_bytes() == whole


def test_a_cache_that_cannot_be_written_is_a_notice(area, tmp_path):
    (tmp_path / "file").write_text("no folder")
    building, report = read_area(area, tmp_path / "file")
    assert len(building) == 3
    assert "no cache was written" in report.cache_notice
    assert "\n" not in report.cache_notice


def test_a_room_whose_name_is_no_utf8_is_read_but_not_cached(tmp_path):
    building, report = read_area(
        write(tmp_path / "Area_1", {os.fsdecode(b"caf\xe9_1/wall_1"): LINE})
    )
    assert len(building) == 1
    assert "not printable" in report.cache_notice


def test_a_full_disk_leaves_no_half_cache(tmp_path):
    area = write(tmp_path / "Area_1", {"a_1/wall_1": f"{LINE}\n" * 8000})
    script = (
        "import sys, resource; from pathlib import Path\n"
        "from mcpseg_cli.formats.s3dis import read_area\n"
        "area = Path(sys.argv[1]); read_area(area, use_cache=False)\n"
        "for limit in (10, 3000, 40_000, 100_000, 163_000):\n"
        "    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, -1))\n"
        "    building, report = read_area(area); print(len(building), report.cache_notice)"
    )
    result = subprocess.run(
        [sys.executable, "-c", script, str(area)], capture_output=True, text=True, check=True
    )
    lines = result.stdout.splitlines()
    assert [line.split(";")[0].split(": ")[0] for line in lines] == [
        "8000 no cache was written ([Errno 27] File too large"
    ] * 5
    assert [path.name for path in area.iterdir()] == ["a_1"]


def test_memory_stays_near_the_size_of_the_points(tmp_path):
    text = f"{LINE}\n" * 400_000
    area = write(tmp_path / "Area_1", {f"a_1/wall_{number}": text for number in range(6)})
    script = (
        "import sys, resource; from pathlib import Path\n"
        "from mcpseg_cli.formats.s3dis import read_area\n"
        "peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "from mcpseg_cli.formats.s3dis_text import read_lines; read_lines(b'1 2 3 4 5 6')\n"
        "before = peak(); building, _ = read_area(Path(sys.argv[1]), use_cache=False)\n"
        "print(peak() - before)"
    )
    result = subprocess.run(
        [sys.executable, "-c", script, str(area)], capture_output=True, text=True, check=True
    )
    assert (
        int(result.stdout) < 2_400_000 * 20 / 1024 + 3 * 16_384 + 40_000
    )  # KB: points, texts, parts under way


# --- writing --------------------------------------------------------------------------------------
# -----------------


def random_objects(rng: np.random.Generator) -> list[tuple[str, np.ndarray, np.ndarray]]:
    sizes = [("wall", 70_000), ("chair", 5), ("wall", 1), ("floor", 0), ("wall", 300)]
    return [
        (
            name,
            rng.uniform(-60, 60, (size, 3)).astype(np.float32),
            rng.integers(0, 256, (size, 3)).astype(np.uint8),
        )
        for name, size in sizes
    ]


def test_a_room_written_reads_back_to_half_a_millimetre(tmp_path):
    objects = random_objects(np.random.default_rng(0))
    names = write_room(tmp_path / "Area_1", "office_1", objects)
    building, report = read_area(tmp_path / "Area_1")
    assert names == ("wall_1", "chair_1", "wall_2", "", "wall_3")
    assert report.notices() == ()
    for name, (label, xyz, rgb) in zip(names, objects, strict=True):
        if name:
            mine = building.instance == building.object_names.index(f"office_1/{name}") + 1
            assert np.abs(building.xyz[mine] - xyz).max() <= 0.0005 + 4e-6
            np.testing.assert_array_equal(building.rgb[mine], rgb)
            assert set(building.semantic[mine]) == {S3DIS_CLASSES.index(label)}


def test_an_interrupted_room_leaves_nothing(tmp_path):
    def objects():
        yield from random_objects(np.random.default_rng(0))[:2]
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_room(tmp_path, "office_1", objects())
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_writer_left_is_passed_over_and_replaced(tmp_path):
    objects = random_objects(np.random.default_rng(0))
    write_room(tmp_path, "office_1", objects)
    write(tmp_path, {".office_2.part/wall_1": "half a li"})
    assert read_area(tmp_path, use_cache=False)[0].rooms == ("office_1",)
    write_room(tmp_path, "office_2", objects[1:2])
    assert read_area(tmp_path, use_cache=False)[0].rooms == ("office_1", "office_2")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["office_1", "office_2"]


@pytest.mark.parametrize("name", ["", "..", ".hidden", "a/b", "a\0b", "a b"])
def test_names_that_are_no_plain_file_names_are_refused(tmp_path, name):
    with pytest.raises(OutputError, match="the name"):
        write_room(tmp_path, name, [])
    points = (np.zeros((1, 3), np.float32), np.zeros((1, 3), np.uint8))
    with pytest.raises(OutputError, match="the name"):
        write_room(tmp_path, "office_1", [(name, *points)])


def test_a_room_is_never_written_over(tmp_path):
    objects = random_objects(np.random.default_rng(0))[1:2]
    write_room(tmp_path, "office_1", objects)
    with pytest.raises(OutputError, match="already there"):
        write_room(tmp_path, "office_1", objects)


@pytest.mark.parametrize("value", [np.nan, np.inf, 2e9])
def test_coordinates_that_text_cannot_hold_are_refused(tmp_path, value):
    with pytest.raises(OutputError, match="wall_1: coordinates must be finite"):
        write_room(
            tmp_path,
            "a_1",
            [("wall", np.full((1, 3), value, np.float32), np.zeros((1, 3), np.uint8))],
        )
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_an_error_that_names_the_file(tmp_path, monkeypatch):
    objects = random_objects(np.random.default_rng(0))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, hard))
    try:
        with pytest.raises(OSError, match=r"wall_1\.txt"):
            write_room(tmp_path, "office_1", objects)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert list(tmp_path.iterdir()) == []
