"""``mcpseg eval`` in pipelines: several runs, CSV, demands, pictures, and a run scan by scan."""

import csv
import io
import json
import re
from pathlib import Path

import numpy as np
import pytest

from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from tests.commands import invoke
from tests.evaluate.test_run import write_pair

ALL_FIGURES = "mcpseg: all figures: --full; for programs: --json, --csv\n"


@pytest.fixture
def pair(tmp_path) -> tuple[Path, Path]:
    return write_pair(tmp_path / "a")


@pytest.fixture
def run(make_recording, tmp_path, weights_path) -> Path:
    """A run over four scans."""
    scans, poses = make_recording(tmp_path / "input")
    result = invoke("segment", scans, poses, "-o", tmp_path / "out", "-w", weights_path, "-q")
    assert result.exit_code == 0
    return tmp_path / "out"


def test_the_table_says_unit_and_protocol_and_has_a_column_for_rooms(pair):
    result = invoke("eval", *pair, "--full", "--rooms")
    assert re.search(
        r"^# points \(unit: point, whole map and by room; pairing: by point; .*\)$",
        result.stdout,
        re.M,
    )
    assert re.search(r"^nmi +0\.\d{3} +0\.\d{3}$", result.stdout, re.M)
    assert re.search(r"^room_1 +\d+ +0\.\d{3}", result.stdout, re.M)
    assert "\x1b" not in result.stdout


def test_several_runs_are_pooled_and_averaged(pair, tmp_path):
    document = json.loads(invoke("eval", *pair, *write_pair(tmp_path / "b", 5), "--json").stdout)
    assert [run["points"] for run in document["runs"]] == [400, 400]
    assert document["pooled"]["points"] == 800
    assert document["mean"]["nmi"] == pytest.approx(sum(run["nmi"] for run in document["runs"]) / 2)


def test_the_table_of_several_runs_has_a_column_for_each(pair, tmp_path):
    lines = invoke("eval", *pair, *write_pair(tmp_path / "b", 5), "--full").stdout.splitlines()
    heads = [line.split() for line in lines if "pooled" in line]
    assert heads[0] == [str(pair[0]), str(tmp_path / "b/map.ply"), "pooled"]  # counts have no mean
    assert heads[1][-2:] == ["pooled", "mean"]
    assert any(line.startswith("rooms ari") for line in lines)


def test_csv_has_a_line_for_every_run_and_room_and_for_what_they_come_to(pair, tmp_path):
    text = invoke("eval", *pair, *write_pair(tmp_path / "b", 5), "--csv").stdout
    lines = list(csv.DictReader(io.StringIO(text)))
    assert [line["room"] for line in lines] == 2 * ["", "room_0", "room_1", "(mean)"] + ["", ""]
    assert [line["out"] for line in lines[-2:]] == ["(pooled)", "(mean)"]
    assert 0 < float(lines[0]["iou.wall"]) < 1
    assert len({line["scored_over"] for line in lines[:8]}) == 2


def test_an_odd_path_is_wrong_usage(pair):
    result = invoke("eval", *pair, pair[0])
    assert (result.exit_code, result.stdout) == (2, "")
    assert "3 paths; expected pairs of OUT and GT" in result.stderr


def test_csv_and_json_at_once_are_wrong_usage(pair):
    assert invoke("eval", *pair, "--csv", "--json").exit_code == 2


def test_demands_that_are_met_exit_0(pair):
    result = invoke("eval", *pair, "--fail-under", "miou=0.35", "--fail-under", "rooms.nmi=0.1")
    assert (result.exit_code, result.stderr) == (0, ALL_FIGURES)


def test_demands_that_are_not_met_exit_1_and_are_named_after_the_scores(pair):
    demands = ("miou=0.999", "nmi=0", "iou.wall=0.9999")
    options = [word for demand in demands for word in ("--fail-under", demand)]
    result = invoke("eval", *pair, "--json", *options)
    assert result.exit_code == 1
    assert json.loads(result.stdout)["points"] == 400
    expected = r"mcpseg: miou is 0\.\d+, below 0\.999; iou\.wall is 0\.\d+, below 0\.9999\n"
    assert re.fullmatch(expected, result.stderr)


@pytest.mark.parametrize(
    ("demand", "said"),
    [
        ("mou=0.3", "there are point_accuracy, "),
        ("miou", "such as miou=0.35"),
        ("miou=nan", "such as"),
        ("=1", "such as"),
    ],
)
def test_demands_that_make_no_sense_are_wrong_usage(pair, demand, said):
    result = invoke("eval", *pair, "--json", "--fail-under", demand)
    assert (result.exit_code, result.stdout) == (2, "")
    assert said in result.stderr


def test_a_demand_on_a_class_that_is_nowhere_fails(tmp_path):
    columns = {axis: np.arange(3.0, dtype=np.float32) for axis in "xyz"}
    labels = {"semantic": np.zeros(3, np.uint8), "instance": np.ones(3, np.int32)}
    write_cloud(tmp_path / "c.ply", Cloud(columns | labels, ("wall", "door")))
    result = invoke("eval", tmp_path / "c.ply", tmp_path / "c.ply", "--fail-under", "iou.door=0.1")
    assert result.exit_code == 1
    assert "iou.door has no value" in result.stderr


def test_pictures_are_drawn(run, tmp_path):
    pytest.importorskip("matplotlib")
    options = ["--plot", tmp_path / "pictures", "-q"]
    assert invoke("eval", run, run / "map.ply", *options).exit_code == 0
    names = sorted(path.name for path in (tmp_path / "pictures").iterdir())
    assert names == [
        "class_iou.png",
        "confusion_matrix.png",
        "miou_over_scans.png",
        "reliability.png",
    ]


def test_calibration_is_printed_but_cannot_be_demanded(run, pair):
    scores = json.loads(invoke("eval", run, run / "map.ply", "--json").stdout)
    confidence = read_cloud(run / "map.ply").label("confidence")
    assert scores["ece"] == pytest.approx(1 - confidence.mean(), abs=1e-6)  # all of it is right
    assert re.search(
        r"^ece +0\.\d{3}$", invoke("eval", run, run / "map.ply", "--full").stdout, re.M
    )
    result = invoke("eval", run, run / "map.ply", "--fail-under", "ece=0.1")
    assert result.exit_code == 2
    assert "no figure 'ece'" in " ".join(result.stderr.split())
    assert json.loads(invoke("eval", *pair, "--json").stdout)["ece"] is None  # no confidence


@pytest.mark.parametrize("place", ["file", "file/pictures"])
def test_pictures_where_they_cannot_be_are_one_line_before_anything_is_read(pair, tmp_path, place):
    pytest.importorskip("matplotlib")
    (tmp_path / "file").write_text("mine")
    result = invoke("eval", *pair, "--plot", tmp_path / place)
    assert (result.exit_code, result.stdout, len(result.stderr.splitlines())) == (1, "", 1)
    assert (tmp_path / "file").read_text() == "mine"


def test_a_run_is_followed_scan_by_scan(run):
    scores = json.loads(invoke("eval", run, run / "map.ply", "--json").stdout)
    events = [json.loads(line) for line in (run / "events.jsonl").read_text().splitlines()]
    assert (scores["unit"], scores["scans"], scores["skipped"]) == ("voxel", 4, 0)
    first, *others = [sum(event["ms"].values()) for event in events]
    assert scores["ms_per_scan"]["max"] == pytest.approx(max(others))
    assert scores["ms_per_scan"]["warm_up"] == pytest.approx(first)
    stability = scores["stability"]
    assert stability["looks_again"] == sum(event["voxels_seen"] for event in events) > 0
    assert stability["ids_merged"] == sum(len(event["merges"]) for event in events)
    assert stability["flips"] == stability["flips_unseen"] == 0  # a voxel is labelled once
    assert scores["over_scans"]["point_accuracy"] == [1.0] * 10


def test_flips_are_found_in_the_labelled_scans(run):
    before = json.loads(invoke("eval", run, run / "map.ply", "--json").stdout)["stability"]
    path = sorted((run / "scans").iterdir())[-1]
    cloud = read_cloud(path)
    semantic = cloud.label("semantic")
    semantic = np.where(semantic == 255, 255, 1 - np.minimum(semantic, 1)).astype(np.uint8)
    write_cloud(path, Cloud(cloud.columns | {"semantic": semantic}, cloud.classes))
    after = json.loads(invoke("eval", run, run / "map.ply", "--json").stdout)["stability"]
    assert after["looks_again"] == before["looks_again"]
    assert after["flips"] == after["flips_to_wrong"] > 0
    assert after["flips_unseen"] > after["flips"]


@pytest.mark.parametrize(("kind", "frame"), [("laz", "map"), ("npz", "sensor")])
def test_labelled_scans_of_any_format_and_frame_are_followed(
    make_recording, tmp_path, weights_path, kind, frame
):
    scans, poses = make_recording(tmp_path / "input")
    options = ["--format", kind, "--frame", frame, "-q", "-w", weights_path]
    invoke("segment", scans, poses, "-o", tmp_path / "out", *options)
    scores = json.loads(invoke("eval", tmp_path / "out", tmp_path / "out/map.ply", "--json").stdout)
    events = [json.loads(line) for line in (tmp_path / "out/events.jsonl").read_text().splitlines()]
    seen = sum(event["voxels_seen"] for event in events)
    assert 0.95 * seen < scores["stability"]["looks_again"] <= seen
    assert scores["stability"]["flips"] == scores["stability"]["ids_split"] == 0


def test_missing_labelled_scans_are_said_and_the_map_is_scored(run):
    sorted((run / "scans").iterdir())[0].unlink()
    result = invoke("eval", run, run / "map.ply", "--json")
    scores = json.loads(result.stdout)
    assert "1 of 4 labelled scans are missing" in result.stderr
    assert scores["stability"] is scores["over_scans"] is None
    assert scores["point_accuracy"] == 1.0
    assert scores["ms_per_scan"]["p50"] > 0


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-40])


@pytest.mark.parametrize(
    ("break_it", "said"),
    [
        (lambda folder, run: cut(run / "map.ply"), "map.ply: "),
        (lambda folder, run: cut(sorted((run / "scans").iterdir())[1]), "000001.ply: "),
        (
            lambda folder, run: (run / "events.jsonl").write_text("{\n"),
            "events.jsonl: line 1 that is no event",
        ),
        (lambda folder, run: (run / "run.json").write_text("{"), "run.json: not JSON"),
        (lambda folder, run: cut(folder / "gt/0.ply"), "0.ply: "),
        (lambda folder, run: (folder / "gt/0.ply").unlink(), "gt: an empty folder"),
        (
            lambda folder, run: (folder / "gt/0.ply").rename(folder / "gt/0.txt"),
            "expected an S3DIS area",
        ),
    ],
)
def test_damaged_runs_and_truths_are_one_line(run, tmp_path, break_it, said):
    (tmp_path / "gt").mkdir()
    (tmp_path / "gt/0.ply").write_bytes((run / "map.ply").read_bytes())
    break_it(tmp_path, run)
    result = invoke("eval", run, tmp_path / "gt")
    assert (result.exit_code, result.stdout, len(result.stderr.splitlines())) == (1, "", 1)
    assert said in result.stderr


def test_a_terminal_gets_tables(pair, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    result = invoke("eval", *pair, "--full")
    assert "\x1b[1" in result.stdout
    assert "# " not in result.stdout


def test_a_run_whose_poses_are_in_use_is_scored_without_its_scans(
    make_recording, tmp_path, weights_path
):
    from mcpseg_cli.segment.checkpoint import State

    scans, poses = make_recording(tmp_path / "input")
    options = ["-o", tmp_path / "out", "-w", weights_path, "--frame", "sensor", "-q"]
    invoke("segment", scans, poses, *options)
    with State(tmp_path / "out/state.sqlite"):
        result = invoke("eval", tmp_path / "out", tmp_path / "out/map.ply", "--json")
    assert "in use by another mcpseg" in result.stderr
    assert json.loads(result.stdout)["stability"] is None


@pytest.mark.parametrize(
    ("columns", "classes", "said"),
    [
        ({"x": np.array([0.0, 1e12, 0.0])}, ("wall",), "points 1e+12 m apart"),
        ({}, tuple(f"class_{index}" for index in range(300)), "300 classes; expected at most 255"),
        ({"semantic": np.array([0.0, 0.5, 0.0])}, ("wall",), "semantic 0.5 (point 1); expected a "),
        ({"semantic": np.array([0, 3, 0])}, ("wall",), "class 3 (point 1); expected 0 to 0"),
    ],
)
def test_clouds_that_make_no_sense_are_one_line(tmp_path, columns, classes, said):
    plain = {axis: np.zeros(3) for axis in "xyz"}
    plain |= {"semantic": np.zeros(3, int), "instance": np.ones(3, int)}
    write_cloud(tmp_path / "c.npz", Cloud(plain | columns, classes))
    result = invoke("eval", tmp_path / "c.npz", tmp_path / "c.npz")
    assert (result.exit_code, result.stdout, len(result.stderr.splitlines())) == (1, "", 1)
    assert said in result.stderr
