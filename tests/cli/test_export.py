"""``mcpseg export`` as people type it."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mcpseg_cli.formats import read_cloud
from tests.commands import invoke, segment, start

REPOSITORY = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def grown_run(labelled_run, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("grown") / "out"
    result = segment(labelled_run.recording, out, "--method", "region-growing", "-q")
    assert result.exit_code == 0
    return out


def export(*arguments: object):
    return invoke("export", *arguments)


def test_one_call_writes_everything_asked_for_and_says_what(labelled_run, tmp_path):
    names = ["map.ply", "map.laz", "map.h5", "objects.csv", "objects.geojson", "map.png"]
    outputs = [word for name in names for word in ("-o", tmp_path / name)]
    result = export(labelled_run.out, *outputs)
    assert (result.exit_code, result.stderr) == (0, "")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    num_points = len(read_cloud(tmp_path / "map.ply"))
    assert f"{tmp_path / 'map.laz'}: {num_points:,} points\n" in result.stdout
    assert len(result.stdout.splitlines()) == len(names)


def test_the_run_is_left_as_it_was(labelled_run, tmp_path):
    before = {path: path.stat().st_mtime_ns for path in labelled_run.out.rglob("*")}
    result = export(labelled_run.out, "-o", tmp_path / "map.ply", "--color", "embedding")
    assert result.exit_code == 0
    assert {path: path.stat().st_mtime_ns for path in labelled_run.out.rglob("*")} == before


def test_options_choose_and_colour(labelled_run, tmp_path):
    objects = json.loads((labelled_run.out / "objects.json").read_text())
    largest = max(objects, key=lambda item: item["num_points"])
    options = ["--instance", largest["id"], "--color", "instance", "--min-confidence", 0]
    assert export(labelled_run.out, "-o", tmp_path / "one.npz", *options).exit_code == 0
    cloud = read_cloud(tmp_path / "one.npz")
    assert len(cloud) == largest["num_points"]
    assert (cloud.rgb == cloud.rgb[0]).all()

    options = ["--class", largest["class_name"], "--box=-9,-9,-9,9,9,9"]
    assert export(labelled_run.out, "-o", tmp_path / "some.json", *options).exit_code == 0
    chosen = json.loads((tmp_path / "some.json").read_text())
    assert chosen == [item for item in objects if item["class_name"] == largest["class_name"]]


@pytest.mark.parametrize(
    "ending", ["ply", "laz", "pcd", "npz", "h5", "e57", "json", "geojson", "png", "html", "rrd"]
)
def test_a_map_without_classes_is_exported_too(ending, grown_run, tmp_path):
    for name in {"e57": ("pye57",), "rrd": ("rerun",)}.get(ending, ()):
        pytest.importorskip(name)
    result = export(grown_run, "-o", tmp_path / f"map.{ending}")
    assert (result.exit_code, result.stderr) == (0, "")
    assert (tmp_path / f"map.{ending}").stat().st_size > 0


def test_a_map_without_classes_has_none_to_choose(grown_run, tmp_path):
    result = export(grown_run, "-o", tmp_path / "map.ply", "--class", "wall")
    said = f"{grown_run}: no class wall; expected a map with classes; check --class"
    assert (result.exit_code, result.stderr) == (1, f"mcpseg: {said}\n")


def test_folders_are_filled_with_scans_or_objects(labelled_run, tmp_path):
    result = export(labelled_run.out, "-o", tmp_path / "scans", "--scans", labelled_run.scans)
    assert result.stdout == f"{tmp_path / 'scans'}: 4 scans\n"

    options = ["-o", tmp_path / "objects", "--split", "las", "-o", tmp_path / "objects.csv"]
    assert export(labelled_run.out, *options).exit_code == 0
    clouds = list((tmp_path / "objects").glob("*.las"))
    assert len(clouds) == len((tmp_path / "objects.csv").read_text().split()) - 1


def test_weights_become_onnx(weights_path, tmp_path):
    pytest.importorskip("onnxscript")
    result = export(weights_path, "-o", tmp_path / "model.onnx")
    assert result.exit_code == 0
    assert "model.onnx: mcpnet, differs from PyTorch by " in result.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["model.onnx"]


def test_files_are_replaced_only_when_asked_to(labelled_run, tmp_path):
    (tmp_path / "map.ply").write_text("mine")
    refused = export(labelled_run.out, "-o", tmp_path / "map.ply", "-o", tmp_path / "map.las")
    assert refused.exit_code == 1
    assert "map.ply: exists; expected a new file" in refused.stderr
    assert (tmp_path / "map.ply").read_text() == "mine"
    assert not (tmp_path / "map.las").exists()
    assert export(labelled_run.out, "-o", tmp_path / "map.ply", "--overwrite").exit_code == 0
    assert len(read_cloud(tmp_path / "map.ply"))


@pytest.mark.parametrize(
    ("options", "found"),
    [
        (["-o", "OUT/map.laz"], "lies in the run"),
        (["-o", "OUT/scans/map.laz", "--overwrite"], "lies in the run"),
        (["-o", "TMP/map.obj"], "ends in '.obj'; expected .ply, .las"),
        (["-o", "TMP/map"], "expected an ending, or --scans or --split"),
        (["-o", "TMP/nowhere/map.ply"], "nowhere is no folder"),
        (["-o", "TMP/map.ply", "-o", "TMP/folder.ply/../map.ply"], "named twice"),
        (["-o", "TMP/map.ply", "-o", "TMP/model.onnx"], "expected .onnx by itself"),
        (
            ["-o", "TMP/map.ply", "--split", "ply"],
            "no folder: named by -o; expected one folder -o to fill",
        ),
        (["-o", "TMP", "--split", "ply"], "not empty; expected an empty folder"),
        (["-o", "TMP/file", "--split", "ply"], "a file; expected a folder"),
        (["-o", "TMP/folder.ply"], "a folder; expected a file"),
        (["-o", "TMP/map.ply", "--class", "cupboard"], "no class cupboard; expected ceiling"),
        (["-o", "TMP/map.ply", "--instance", "123456789"], "nothing in the map that was asked for"),
        (["-o", "TMP/new", "--scans", "TMP/nowhere"], "nowhere: no such folder"),
    ],
)
def test_what_cannot_be_done_is_one_line(labelled_run, tmp_path, options, found):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.ply").mkdir()
    before = sorted(tmp_path.iterdir())

    words = [word.replace("TMP", str(tmp_path)) for word in options]
    words = [word.replace("OUT", str(labelled_run.out)) for word in words]
    result = export(labelled_run.out, *words)
    assert result.exit_code == 1
    assert found in result.stderr
    assert len(result.stderr.splitlines()) == 1
    assert sorted(tmp_path.iterdir()) == before


def test_what_is_no_run_is_one_line(weights_path, tmp_path):
    for source, found in (
        (tmp_path, "no state.sqlite"),
        (weights_path, "a file"),
        (tmp_path / "x", "no such folder"),
    ):
        result = export(source, "-o", tmp_path.parent / "map.ply")
        assert (result.exit_code, len(result.stderr.splitlines())) == (1, 1)
        assert found in result.stderr


@pytest.mark.parametrize(
    "options",
    [
        ["--box", "1,2,3"],
        ["--box", "1,1,1,0,2,2"],
        ["--box", "nan,0,0,1,1,1"],
        ["--instance", "door"],
        ["--min-confidence", "2"],
        ["--color", "taste"],
        ["--split", "ply", "--scans", "."],
        ["--cut", "high"],
    ],
)
def test_wrong_usage_exits_2(labelled_run, tmp_path, options):
    assert export(labelled_run.out, "-o", tmp_path / "map.ply", *options).exit_code == 2
    assert not list(tmp_path.iterdir())


def test_a_run_in_progress_is_exported_again_and_again(make_recording, tmp_path, weights_path):
    recording = make_recording(tmp_path / "input", num_scans=200)
    process = start("segment", *recording, "-o", tmp_path / "out", "-w", weights_path, "-q")

    # as often as it goes, from the first scan on
    events, sizes = tmp_path / "out/events.jsonl", []
    while process.poll() is None:
        if not (events.exists() and events.stat().st_size):
            time.sleep(0.005)
            continue
        result = export(tmp_path / "out", "-o", tmp_path / "map.ply", "--overwrite")
        assert result.exit_code == 0, result.stderr
        sizes.append(len(read_cloud(tmp_path / "map.ply")))

    # nobody was in its way, and the map only grew
    assert process.returncode == 0
    assert len(sizes) >= 2
    assert sizes == sorted(sizes)

    final = read_cloud(tmp_path / "out/map.ply")
    export(tmp_path / "out", "-o", tmp_path / "map.ply", "--overwrite")
    assert len(read_cloud(tmp_path / "map.ply")) == len(final) >= sizes[-1]


def test_the_picture_sheet_of_the_examples_is_drawn(labelled_run, tmp_path):
    script = [REPOSITORY / "examples/render_map.py", labelled_run.out, "-o", tmp_path / "map.png"]
    result = subprocess.run([sys.executable, *script], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "map.png").stat().st_size > 50_000


def test_help_shows_examples():
    assert "Example" in export("--help").stdout


def test_small_objects_are_left_out_of_lists_and_clouds(labelled_run, tmp_path):
    objects = json.loads((labelled_run.out / "objects.json").read_text())
    most = max(item["num_points"] for item in objects)
    outputs = ["-o", tmp_path / "large.json", "-o", tmp_path / "large.npz"]
    assert export(labelled_run.out, *outputs, "--min-points", most).exit_code == 0

    chosen = json.loads((tmp_path / "large.json").read_text())
    assert chosen == [item for item in objects if item["num_points"] == most]
    assert len(read_cloud(tmp_path / "large.npz")) == most * len(chosen)


def test_no_object_as_large_as_asked_for_is_told_in_one_line(labelled_run, tmp_path):
    result = export(labelled_run.out, "-o", tmp_path / "none.json", "--min-points", 10**9)
    assert (result.exit_code, result.stdout) == (1, "")
    assert "widen --class, --instance, --min-points" in result.stderr
