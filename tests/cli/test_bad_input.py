"""Malformed input at the command line: exit code 1 and one line: what, where and what to do."""

import json
import pickle
import struct
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from tests.commands import MOST_S, command, invoke

BAD = "000001"  # the second of four scans is the bad one


@dataclass
class Case:
    """A recording about to be spoilt, and how it is to be segmented."""

    folder: Path
    scans: Path
    poses: Path
    weights: Path
    options: list[str] = field(default_factory=list)

    @property
    def output(self) -> Path:
        return self.folder / "out"

    def arguments(self) -> list[str]:
        paths = [str(self.scans), str(self.poses), "-o", str(self.output), "-w", str(self.weights)]
        return ["segment", *paths, "--quiet", *self.options]

    def scan(self, suffix: str, data: bytes | None = None) -> Path:
        """Replace the bad scan's file by one of another ending, sound or with the bytes given."""
        sound = read_cloud(self.scans / f"{BAD}.ply")
        (self.scans / f"{BAD}.ply").unlink()
        path = self.scans / f"{BAD}{suffix}"
        if data is None:
            write_cloud(path, sound)
        else:
            path.write_bytes(data)
        return path

    def cut(self, suffix: str, keep: float) -> None:
        path = self.scan(suffix)
        path.write_bytes(path.read_bytes()[: int(keep * path.stat().st_size)])

    def columns(self, suffix: str = ".ply", **columns: np.ndarray) -> None:
        """Replace columns of the bad scan."""
        sound = read_cloud(self.scans / f"{BAD}.ply")
        write_cloud(self.scan(suffix), Cloud(sound.columns | columns))

    def npz(self, **arrays: np.ndarray) -> None:
        np.savez(self.scan(".npz"), **arrays)

    def ply(self, *header: str, data: bytes = b"") -> None:
        self.scan(".ply", "\n".join(["ply", *header, "end_header", ""]).encode() + data)

    def pcd(self, old: bytes, new: bytes) -> None:
        path = self.scan(".pcd")
        data = path.read_bytes()
        assert old in data
        path.write_bytes(data.replace(old, new, 1))

    def poses_text(self, *lines: str) -> None:
        self.poses.write_text("\n".join(lines) + "\n")


@pytest.fixture
def case(
    tmp_path: Path, make_recording: Callable[..., tuple[Path, Path]], weights_path: Path
) -> Case:
    scans, poses = make_recording(tmp_path / "recording", num_scans=4)
    return Case(tmp_path, scans, poses, weights_path)


def run(case: Case, *options: str) -> tuple[int, str, str]:
    """Run the command in this process; return exit code, stdout and stderr."""
    result = invoke(*case.arguments(), *options)
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception  # a traceback is never right
    return result.exit_code, result.stdout, result.stderr


def assert_one_line(stderr: str, named: str, *expected: str) -> None:
    """Check the form of a message: one line, ``mcpseg: FILE: found; expected …; remedy``."""
    lines = stderr.splitlines()
    assert len(lines) == 1, stderr
    assert lines[0].startswith("mcpseg: ")
    assert named in lines[0].split(": ")[1], lines[0]
    _, separator, rest = lines[0].partition("; expected ")
    wanted, _, remedy = rest.partition("; ")
    assert separator, lines[0]
    assert wanted, lines[0]
    assert len(remedy.split()) >= 2, lines[0]
    for text in expected:
        assert text in lines[0]


def nan_at(num_points: int, value: float) -> np.ndarray:
    column = np.zeros(num_points, np.float32)
    column[7] = value
    return column


XYZ = ("property float x", "property float y", "property float z")
BINARY, ASCII = "format binary_little_endian 1.0", "format ascii 1.0"

BAD_SCANS: dict[str, tuple[Callable[[Case], object], str]] = {
    "cut PLY": (lambda c: c.cut(".ply", 0.9), "800 vertices promised, 7"),
    "PLY cut in its header": (lambda c: c.cut(".ply", 0.005), "no end_header"),
    "empty PLY": (lambda c: c.scan(".ply", b""), "starts with b''"),
    "PLY with more vertices than promised": (
        lambda c: c.ply(BINARY, "element vertex 1", *XYZ, data=bytes(24)),
        "1 vertices promised, 2 found",
    ),
    "PLY with a negative count": (
        lambda c: c.ply(BINARY, "element vertex -1", *XYZ),
        "header line 3",
    ),
    "PLY with an endless count": (
        lambda c: c.ply(BINARY, "element vertex 99999999999999999999", *XYZ),
        "0 found",
    ),
    "PLY of NaN": (
        lambda c: c.columns(x=np.full(800, np.nan, np.float32)),
        "none of 800 points is measured: 800 have NaN or infinite",
    ),
    "PLY with zero points": (lambda c: c.ply(BINARY, "element vertex 0", *XYZ), "zero points"),
    "PLY without vertices": (
        lambda c: c.ply(BINARY, "element face 1", "property int i", data=bytes(4)),
        "no vertex element",
    ),
    "PLY without z": (
        lambda c: c.ply(BINARY, "element vertex 1", *XYZ[:2], data=bytes(8)),
        "no property z",
    ),
    "PLY with huge coordinates": (
        lambda c: c.columns(y=nan_at(800, 5e6)),
        "coordinates up to 5e+06 m",
    ),
    "PLY in millimetres": (
        lambda c: c.columns(y=nan_at(800, 91234.5)),
        "coordinates up to 91234.5 m",
    ),
    "PLY with text for a number": (
        lambda c: c.ply(ASCII, "element vertex 1", *XYZ, data=b"1 2 three\n"),
        "do not parse",
    ),
    "PLY with a short line": (
        lambda c: c.ply(ASCII, "element vertex 2", *XYZ, data=b"1 2 3\n4 5\n"),
        "do not parse",
    ),
    "binary data in an ascii PLY": (
        lambda c: c.ply(ASCII, "element vertex 2", *XYZ, data=b"\x00\xff\n\x01\xfe\n"),
        "do not parse",
    ),
    "text in a binary PLY": (
        lambda c: c.ply(BINARY, "element vertex 2", *XYZ, data=b"1 2 3\n4 5 6\n"),
        "2 vertices promised, 1 found",
    ),
    "PLY of an unknown format": (
        lambda c: c.ply("format binary_middle_endian 1.0", "element vertex 0", *XYZ),
        "binary_middle_endian",
    ),
    "PLY with an unknown type": (
        lambda c: c.ply(BINARY, "element vertex 1", *XYZ, "property quad w"),
        "'property quad w'",
    ),
    "PLY with a list in its vertices": (
        lambda c: c.ply(BINARY, "element vertex 1", *XYZ, "property list uchar int k"),
        "a list property",
    ),
    "PLY with a property twice": (
        lambda c: c.ply(BINARY, "element vertex 1", *XYZ, XYZ[0], data=bytes(16)),
        "repeat a name",
    ),
    "PLY with a property of no element": (
        lambda c: c.ply(BINARY, XYZ[0], "element vertex 1", *XYZ),
        "header line 3",
    ),
    "a picture called PLY": (
        lambda c: c.scan(".ply", b"\x89PNG\r\n\x1a\n" + bytes(99)),
        "starts with",
    ),
    "NPZ that is no zip": (lambda c: c.scan(".npz", b"hello"), "does not load"),
    "empty NPZ": (lambda c: c.scan(".npz", b""), "does not load"),
    "pickled NPZ": (lambda c: c.scan(".npz", pickle.dumps({"xyz": [1]})), "does not load"),
    "NPZ with pickled objects": (
        lambda c: c.npz(xyz=np.array([{}, None, "a"], object)),
        "does not load",
    ),
    "NPZ without xyz": (lambda c: c.npz(stuff=np.zeros((9, 3))), "arrays stuff (9, 3)"),
    "NPZ with xyz of a wrong shape": (
        lambda c: c.npz(xyz=np.zeros((3, 9))),
        "xyz is float64 (3, 9)",
    ),
    "NPZ with xyz of text": (lambda c: c.npz(xyz=np.full((9, 3), "a")), "xyz is <U1 (9, 3)"),
    "NPZ with rgb of other length": (
        lambda c: c.npz(xyz=np.zeros((9, 3)), rgb=np.zeros((8, 3), np.uint8)),
        "rgb has shape (8, 3)",
    ),
    "NPZ with zero points": (lambda c: c.npz(xyz=np.zeros((0, 3))), "zero points"),
    "NPZ with NaN": (lambda c: c.npz(xyz=np.full((9, 3), np.nan)), "9 have NaN"),
    "cut NPZ": (lambda c: c.cut(".npz", 0.6), "does not load"),
    "NPY called NPZ": (
        lambda c: np.save(c.scan(".npz").open("wb"), np.zeros((9, 3))),
        "a single array",
    ),
    "cut LAS": (lambda c: c.cut(".las", 0.7), "800 points promised, 5"),
    "LAS cut in its header": (lambda c: c.scan(".las", b"LASF" + bytes(50)), "starts with"),
    "LAS with records past its end": (
        lambda c: spoil(c.scan(".las"), 100, b"\xff\xff\xff\xff"),
        "does not decode",
    ),
    "LAS of an unknown point format": (
        lambda c: spoil(c.scan(".las"), 104, b"\x2a"),
        "does not decode",
    ),
    "LAS with scales of NaN": (
        lambda c: spoil(c.scan(".las"), 131, struct.pack("<d", np.nan)),
        "800 have NaN",
    ),
    "LAS with scales of infinity": (
        lambda c: spoil(c.scan(".las"), 131, struct.pack("<d", 1e308)),
        "NaN or infinite",
    ),
    "text called LAS": (lambda c: c.scan(".las", b"x y z\n1 2 3\n" * 99), "starts with b'x y z"),
    "cut LAZ": (lambda c: c.cut(".laz", 0.7), "does not decode"),
    "LAZ with a broken chunk": (
        lambda c: spoil(c.scan(".laz"), -9, b"\xff" * 9),
        "does not decode",
    ),
    "LAZ cut in its first chunk": (lambda c: c.cut(".laz", 0.3), "does not decode"),
    "PCD without DATA": (lambda c: c.pcd(b"DATA binary\n", b""), "no DATA line"),
    "cut PCD": (lambda c: c.cut(".pcd", 0.8), "800 points promised, 6"),
    "PCD without x": (lambda c: c.pcd(b"FIELDS x", b"FIELDS q"), "no field x"),
    "PCD of an unknown encoding": (lambda c: c.pcd(b"DATA binary", b"DATA base64"), "DATA base64"),
    "PCD with a field too few": (
        lambda c: c.pcd(b"FIELDS x y z", b"FIELDS x y z w"),
        "does not add up",
    ),
    "PCD with an unknown size": (lambda c: c.pcd(b"SIZE 4", b"SIZE 3"), "does not add up"),
    "PCD without POINTS": (lambda c: c.pcd(b"POINTS 800", b"POINTS many"), "does not add up"),
    "PCD of zero points": (lambda c: c.pcd(b"POINTS 800", b"POINTS 0"), "zero points"),
    "PCD with a compressed part cut": (
        lambda c: c.pcd(b"DATA binary", b"DATA binary_compressed"),
        "promised",
    ),
}


def spoil(path: Path, offset: int, data: bytes) -> None:
    content = bytearray(path.read_bytes())
    content[offset : offset + len(data) if offset >= 0 else None] = data
    path.write_bytes(content)


@pytest.mark.parametrize("name", BAD_SCANS)
def test_a_bad_second_scan_ends_in_one_line_and_keeps_the_first(case: Case, name: str) -> None:
    spoil_scan, found = BAD_SCANS[name]
    spoil_scan(case)
    code, stdout, stderr = run(case)
    assert code == 1
    assert stdout == ""
    assert_one_line(stderr, str(case.scans / BAD), found)
    assert [path.stem for path in sorted((case.output / "scans").iterdir())] == ["000000"]
    assert len(read_cloud(case.output / "map.ply")) > 100


def remove_scans(case: Case) -> None:
    for path in case.scans.iterdir():
        path.rename(path.with_suffix(".obj"))


def double_scan(case: Case) -> None:
    write_cloud(case.scans / f"{BAD}.pcd", read_cloud(case.scans / f"{BAD}.ply"))


def weights_file(case: Case, data: bytes) -> None:
    case.weights = case.folder / "bad.safetensors"
    case.weights.write_bytes(data)


def foreign_weights(case: Case) -> None:
    case.weights = case.folder / "bad.safetensors"
    save_file({"layer": np.zeros(3, np.float32)}, case.weights)


def other_tensors(case: Case) -> None:
    """Copy the description of sound weights over tensors that are not MCPNet's."""
    data = case.weights.read_bytes()
    header = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])
    case.weights = case.folder / "bad.safetensors"
    save_file({"layer": np.zeros(3, np.float32)}, case.weights, header["__metadata__"])


def sensor_frame_without_rotations(case: Case) -> None:
    case.poses_text("x,y,z", *["0,0,0"] * 4)
    case.options = ["--frame", "sensor"]


TUM, KITTI = "0 1 2 3 0 0 0 1", "1 0 0 0 0 1 0 0 0 0 1 0"

BAD_RUNS: dict[str, tuple[Callable[[Case], object], str, str]] = {
    "unsupported endings": (remove_scans, "scans", "no scans"),
    "missing folder": (
        lambda c: setattr(c, "scans", c.folder / "nowhere"),
        "nowhere",
        "no such folder",
    ),
    "a file for the folder": (lambda c: setattr(c, "scans", c.poses), "poses.csv", "a file"),
    "empty pose file": (lambda c: c.poses.write_bytes(b""), "poses.csv", "no poses"),
    "pose file with a header only": (
        lambda c: c.poses_text("x,y,z"),
        "poses.csv",
        "a header and no poses",
    ),
    "binary pose file": (
        lambda c: c.poses.write_bytes(bytes(range(256))),
        "poses.csv",
        "binary data",
    ),
    "KITTI with 11 columns": (lambda c: c.poses_text(*[KITTI[:-2]] * 4), "poses.csv", "11 columns"),
    "reflected KITTI matrix": (
        lambda c: c.poses_text(*[KITTI] * 3, "-" + KITTI),
        "poses.csv",
        "line 4",
    ),
    "TUM with text": (
        lambda c: c.poses_text(TUM, TUM.replace("2", "two"), TUM, TUM),
        "poses.csv",
        "'two' in line 2, column 3",
    ),
    "NaN pose": (
        lambda c: c.poses_text(TUM, TUM, TUM.replace("2", "nan"), TUM),
        "poses.csv",
        "no pose for scan 000002.ply: nan in line 3",
    ),
    "zero quaternion": (
        lambda c: c.poses_text(TUM, TUM[:-1] + "0", TUM, TUM),
        "poses.csv",
        "line 2",
    ),
    "unknown CSV column": (
        lambda c: c.poses_text("x,y,z,yaw", *["0,0,0,0"] * 4),
        "poses.csv",
        "columns x, y, z, yaw",
    ),
    "duplicate scan rows": (
        lambda c: c.poses_text("scan,x,y,z", "000000,0,0,0", "000000,0,0,1"),
        "poses.csv",
        "scan 000000 appears 2 times",
    ),
    "count mismatch": (lambda c: c.poses_text(TUM, TUM, TUM), "poses.csv", "3 poses for 4 scans"),
    "missing pose": (
        lambda c: c.poses_text("scan,x,y,z", *[f"00000{i},0,0,0" for i in range(3)]),
        "poses.csv",
        "no pose for scan 000003.ply",
    ),
    "pose of no scan": (
        lambda c: c.poses_text("scan,x,y,z", *[f"00000{i},0,0,0" for i in range(5)]),
        "poses.csv",
        "a pose for 000004",
    ),
    "duplicate scan names": (double_scan, "scans", "000001.pcd and 000001.ply"),
    "positions only in the sensor's frame": (
        sensor_frame_without_rotations,
        "poses.csv",
        "positions only",
    ),
    "weights that are no safetensors": (
        lambda c: weights_file(c, b"not weights" * 9),
        "bad.safetensors",
        "not readable",
    ),
    "empty weights": (lambda c: weights_file(c, b""), "bad.safetensors", "not readable"),
    "truncated weights": (
        lambda c: weights_file(c, c.weights.read_bytes()[:-100]),
        "bad.safetensors",
        "not readable",
    ),
    "foreign weights": (foreign_weights, "bad.safetensors", "no mcpseg description"),
    "weights with other tensors": (other_tensors, "bad.safetensors", "the tensors of mcpnet"),
    "weights of an unknown name": (
        lambda c: setattr(c, "weights", Path("no-such")),
        "no-such",
        "no such weights",
    ),
}


@pytest.mark.parametrize("name", BAD_RUNS)
def test_a_bad_recording_or_weights_end_in_one_line_and_no_output(case: Case, name: str) -> None:
    spoil_run, named, found = BAD_RUNS[name]
    spoil_run(case)
    code, stdout, stderr = run(case)
    assert code == 1
    assert stdout == ""
    assert_one_line(stderr, named, found)
    assert not case.output.exists()


@pytest.mark.parametrize("which", ["poses", "weights"])
def test_a_missing_file_ends_in_one_line_that_names_it(case: Case, which: str) -> None:
    setattr(case, which, case.folder / "missing.safetensors")
    code, _, stderr = run(case)
    assert code == 1
    assert len(stderr.splitlines()) == 1
    assert str(case.folder / "missing.safetensors") in stderr
    assert "No such file" in stderr
    assert not case.output.exists()


@pytest.mark.parametrize(
    "spoil_case", [lambda c: c.cut(".ply", 0.9), lambda c: c.cut(".las", 0.7)], ids=["ply", "las"]
)
def test_the_installed_command_prints_one_line_and_no_traceback(
    case: Case, spoil_case: Callable[[Case], None]
) -> None:
    spoil_case(case)
    words = command(*case.arguments())
    result = subprocess.run(words, capture_output=True, text=True, timeout=MOST_S, check=False)
    assert result.returncode == 1
    assert result.stdout == ""
    assert_one_line(result.stderr, str(case.scans / BAD), "800")


# --- one bad scan among good ones ---


def outputs(folder: Path) -> dict[str, bytes]:
    """Everything a run writes that does not hold times or its command line."""
    names = [
        "map.ply",
        "objects.json",
        *(f"scans/{path.name}" for path in sorted((folder / "scans").iterdir())),
    ]
    return {name: (folder / name).read_bytes() for name in names}


def test_a_stopped_run_continues_once_the_bad_scan_is_mended(case: Case) -> None:
    path = case.scans / f"{BAD}.ply"
    sound = path.read_bytes()
    path.write_bytes(sound[:-20])
    assert run(case)[0] == 1
    path.write_bytes(sound)
    code, stdout, _ = run(case, "--json")
    assert (code, json.loads(stdout)["resumed_from"], json.loads(stdout)["scans"]) == (0, 1, 4)
    mended = outputs(case.output)
    case.folder = case.folder / "straight"
    assert run(case)[0] == 0
    assert mended == outputs(case.output)


def test_a_skipped_scan_is_reported_in_json(case: Case) -> None:
    case.cut(".ply", 0.9)
    code, stdout, _ = run(case, "--on-error", "skip", "--json")
    assert code == 0
    assert json.loads(stdout)["skipped"] == [f"{BAD}.ply"]


def test_a_skipped_scan_is_reported_in_the_table(case: Case) -> None:
    case.cut(".ply", 0.9)
    code, stdout, _ = run(case, "--on-error", "skip")
    assert code == 0
    assert ["skipped", f"{BAD}.ply"] in [line.split() for line in stdout.splitlines()]


def test_a_skipped_scan_is_recorded_in_the_events_with_its_cause(case: Case) -> None:
    case.cut(".ply", 0.9)
    run(case, "--on-error", "skip")
    events = [json.loads(line) for line in (case.output / "events.jsonl").read_text().splitlines()]
    assert [event["name"] for event in events] == [f"00000{number}.ply" for number in range(4)]
    assert ["skipped" in event for event in events] == [False, True, False, False]
    assert "800 vertices promised" in events[1]["skipped"]


def test_the_scans_around_a_skipped_one_are_labelled(case: Case) -> None:
    case.cut(".ply", 0.9)
    run(case, "--on-error", "skip")
    assert [path.stem for path in sorted((case.output / "scans").iterdir())] == [
        "000000",
        "000002",
        "000003",
    ]


def test_a_skipped_scan_stays_skipped_when_the_command_is_repeated(case: Case) -> None:
    case.cut(".ply", 0.9)
    run(case, "--on-error", "skip")
    before = outputs(case.output)
    code, stdout, _ = run(case, "--on-error", "skip", "--json")
    assert code == 0
    assert json.loads(stdout)["skipped"] == [f"{BAD}.ply"]
    assert outputs(case.output) == before


def test_a_recording_of_bad_scans_only_gives_an_empty_map_and_fails(case: Case) -> None:
    for path in case.scans.iterdir():
        path.write_bytes(b"ply")
    code, stdout, stderr = run(case, "--on-error", "skip", "--json")
    document = json.loads(stdout)
    assert "all 4 scans were skipped, the first for:" in stderr.splitlines()[-1]
    assert (code, len(document["skipped"]), document["voxels"]) == (1, 4, 0)


def test_kernels_that_cannot_be_kept_are_one_line_and_no_other_failure_is_hidden(
    tmp_path, monkeypatch
):
    said = "cannot cache function 'f': no locator available for file 'f.py'"

    def refuse(*_, **__):
        raise RuntimeError(said)

    monkeypatch.setattr("mcpseg_cli.formats.recording.open_recording", refuse)
    words = ["segment", str(tmp_path), str(tmp_path / "poses.csv"), "-o", str(tmp_path / "out")]
    result = invoke(*words)
    assert result.exit_code == 1
    assert "set NUMBA_CACHE_DIR" in result.stderr
    assert len(result.stderr.splitlines()) == 1

    # a bug stays a traceback
    said = "something else"
    assert isinstance(invoke(*words).exception, RuntimeError)
