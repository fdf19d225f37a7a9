"""``mcpseg segment`` and ``mcpseg eval`` as people type them."""

import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from tests.commands import MOST_S, invoke, num_events, segment, start, wait_until

REPOSITORY = Path(__file__).parents[2]
WALK = REPOSITORY / "examples/office_walk"


def test_json_is_one_document_on_stdout_with_the_promised_keys(recording, tmp_path, weights_path):
    result = segment(recording, tmp_path / "out", "-w", weights_path, "--json")
    document = json.loads(result.stdout)
    assert {"scans", "voxels", "objects", "ms_per_scan", "peak_memory_mb", "resumed_from"} <= set(
        document
    )
    assert document["scans"] == 4
    assert document["voxels"] == len(read_cloud(tmp_path / "out/map.ply"))
    assert set(document["ms_per_scan"]) == {"p50", "p95", "max", "warm_up"}
    assert (result.exit_code, result.stderr) == (0, "")


def test_the_table_goes_to_stdout_as_plain_text_when_it_is_no_terminal(
    recording, tmp_path, weights_path
):
    result = segment(recording, tmp_path / "out", "-w", weights_path)
    assert re.search(r"^scans +4$", result.stdout, re.MULTILINE)
    assert "\x1b" not in result.stdout


def test_running_again_with_nothing_new_says_so_and_exits_0(recording, tmp_path, weights_path):
    segment(recording, tmp_path / "out", "-w", weights_path)
    before = (tmp_path / "out/map.ply").stat().st_mtime_ns
    result = segment(recording, tmp_path / "out", "-w", weights_path)
    assert result.exit_code == 0
    assert "nothing new: all 4 scans are labelled" in result.stderr
    assert (tmp_path / "out/map.ply").stat().st_mtime_ns == before


def test_overwrite_starts_again_with_other_settings(recording, tmp_path, weights_path):
    segment(recording, tmp_path / "out", "-w", weights_path)
    refused = segment(recording, tmp_path / "out", "-w", weights_path, "--voxel-size", 0.2)
    assert refused.exit_code == 1
    assert "--voxel-size 0.1, now 0.2" in refused.stderr
    assert (
        segment(
            recording, tmp_path / "out", "-w", weights_path, "--voxel-size", 0.2, "--overwrite"
        ).exit_code
        == 0
    )


def test_sensor_frame_and_map_frame_give_the_same_map(make_recording, tmp_path, weights_path):
    scans, poses = make_recording(tmp_path / "map_frame")
    sensor = tmp_path / "sensor_frame"
    sensor.mkdir()
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])

    # the same scans as the sensor saw them, with poses as KITTI has them
    lines = []
    for number, path in enumerate(sorted(scans.iterdir())):
        cloud, robot = read_cloud(path), np.array([0.4 * number, 0.0, 0.5])
        local = (cloud.xyz.astype(np.float64) - robot) @ turn
        columns = cloud.columns | {axis: local[:, i] for i, axis in enumerate("xyz")}
        write_cloud(sensor / path.name, Cloud(columns))
        matrix = np.column_stack([turn, robot])
        lines.append(" ".join(f"{value:.9f}" for value in matrix.ravel()))
    (tmp_path / "kitti.txt").write_text("\n".join(lines) + "\n")

    segment((scans, poses), tmp_path / "a", "-w", weights_path)
    result = segment(
        (sensor, tmp_path / "kitti.txt"), tmp_path / "b", "-w", weights_path, "--frame", "sensor"
    )
    assert result.exit_code == 0
    first, second = (read_cloud(tmp_path / name / "map.ply").xyz for name in "ab")
    np.testing.assert_allclose(second, first, rtol=0, atol=1e-5)

    # labelled scans stay in the frame of their input
    kept = read_cloud(tmp_path / "b/scans/000001.ply")
    np.testing.assert_array_equal(kept.xyz, read_cloud(sensor / "000001.ply").xyz)


def test_a_scan_without_colour_is_labelled_as_grey(make_recording, tmp_path, weights_path):
    result = segment(
        make_recording(tmp_path / "input", colour=False), tmp_path / "out", "-w", weights_path
    )
    assert result.exit_code == 0
    assert np.unique(read_cloud(tmp_path / "out/map.ply").rgb).tolist() == [128]


@pytest.mark.parametrize("floor", ["scan-min", "0.25", "-1"])
def test_the_floor_can_be_chosen(recording, tmp_path, weights_path, floor):
    segment(recording, tmp_path / "out", "-w", weights_path, "--floor", floor)
    events = [json.loads(line) for line in (tmp_path / "out/events.jsonl").read_text().splitlines()]
    lowest = read_cloud(sorted(recording[0].iterdir())[0]).xyz[:, 2].min()
    assert events[0]["floor"] == pytest.approx(
        lowest if floor == "scan-min" else float(floor), abs=1e-6
    )


@pytest.mark.parametrize(
    "options",
    [
        ["--voxel-size", "0"],
        ["--floor", "cellar"],
        ["--floor", "nan"],
        ["--range", "inf"],
        ["--range", "-1"],
        ["--frame", "moon"],
        ["--seed", "-1"],
    ],
)
def test_wrong_usage_exits_2(recording, tmp_path, weights_path, options):
    assert segment(recording, tmp_path / "out", "-w", weights_path, *options).exit_code == 2
    assert not (tmp_path / "out").exists()


def test_an_unknown_device_is_one_line(recording, tmp_path, weights_path):
    result = segment(recording, tmp_path / "out", "-w", weights_path, "--device", "abacus")
    assert result.exit_code == 1
    assert len(result.stderr.splitlines()) == 1


def test_a_folder_that_cannot_be_written_is_one_line(recording, tmp_path, weights_path):
    (tmp_path / "file").write_text("")
    result = segment(recording, tmp_path / "file/out", "-w", weights_path)
    assert result.exit_code == 1
    assert len(result.stderr.splitlines()) == 1
    assert "file/out" in result.stderr


def test_the_bundled_example_runs_resumes_and_scores(tmp_path):
    result = invoke("segment", WALK / "scans", WALK / "poses.csv", "-o", tmp_path / "out")
    assert result.exit_code == 0
    scores = json.loads(invoke("eval", tmp_path / "out", WALK / "gt", "--json").stdout)
    assert scores["covered"] == scores["points"] > 5000
    assert scores["point_accuracy"] > 0.8
    assert set(scores["iou"]) == set(read_cloud(tmp_path / "out/map.ply").classes)


def test_truth_scored_against_itself_is_perfect():
    scores = json.loads(
        invoke("eval", WALK / "gt/000000.ply", WALK / "gt/000000.ply", "--json").stdout
    )
    assert scores["unit"] == "point"  # a cloud; a run has voxels
    names = ("point_accuracy", "miou_present", "mean_class_accuracy")
    for name in (*names, "nmi", "ari", "homogeneity", "completeness"):
        assert scores[name] == pytest.approx(1.0)


def test_class_tables_of_different_order_are_matched_by_name(tmp_path):
    truth = read_cloud(WALK / "gt/000000.ply")
    reversed_classes = tuple(reversed(truth.classes))
    semantic = (len(truth.classes) - 1 - truth.label("semantic")).astype(np.uint8)
    write_cloud(
        tmp_path / "other.ply", Cloud(truth.columns | {"semantic": semantic}, reversed_classes)
    )
    scores = json.loads(
        invoke("eval", tmp_path / "other.ply", WALK / "gt/000000.ply", "--json").stdout
    )
    assert scores["point_accuracy"] == 1.0


def test_points_without_truth_nearby_are_counted_and_not_scored(tmp_path):
    truth = read_cloud(WALK / "gt/000000.ply")
    columns = {name: column[::2].copy() for name, column in truth.columns.items()}
    columns["x"][:100] += 50
    write_cloud(tmp_path / "half.ply", Cloud(columns, truth.classes))
    scores = json.loads(
        invoke("eval", tmp_path / "half.ply", WALK / "gt/000000.ply", "--json").stdout
    )
    assert scores["points"] - scores["covered"] == 100
    assert scores["point_accuracy"] == 1.0


def test_eval_without_labels_is_one_line(tmp_path):
    result = invoke("eval", WALK / "scans/000000.ply", WALK / "gt")
    assert result.exit_code == 1
    assert "points without semantic" in result.stderr


def test_eval_prints_a_table():
    result = invoke("eval", WALK / "gt/000000.ply", WALK / "gt", "--full", "--allow-partial")
    assert re.search(r"^point_accuracy +1\.000 +1\.000$", result.stdout, re.MULTILINE)


def test_import_weights_does_not_overwrite(tmp_path):
    (tmp_path / "w.safetensors").write_text("mine")
    result = invoke("import-weights", tmp_path / "model.ckpt", "-o", tmp_path / "w.safetensors")
    assert result.exit_code == 1
    assert (tmp_path / "w.safetensors").read_text() == "mine"


def test_version_and_help_answer():
    assert re.match(r"mcpseg \d+\.\d+\.\d+", invoke("--version").stdout)
    for command in ("segment", "eval", "import-weights"):
        assert "Example" in invoke(command, "--help").stdout


def test_real_recordings_are_labelled_alike_from_csv_and_tum_poses(shared_folder, tmp_path):
    walk = shared_folder / "real/hololens_walk"
    for kind in ("csv", "tum"):
        result = invoke(
            "segment", walk / "scans", walk / f"poses.{kind}", "-o", tmp_path / kind, "-q", "--json"
        )
        assert json.loads(result.stdout)["scans"] == 94
    assert (tmp_path / "csv/map.ply").read_bytes() == (tmp_path / "tum/map.ply").read_bytes()


def test_laser_scans_in_the_sensor_frame_land_on_top_of_each_other(shared_folder, tmp_path):
    from scipy.spatial import KDTree

    from mcpseg_cli.formats.recording import open_recording, read_scan

    laser = shared_folder / "real/laser_sensor_frame"
    recording = open_recording(laser / "scans", laser / "poses_kitti.txt")

    # with the poses applied, and as they lie in the files
    shares = []
    for frame in ("sensor", "map"):
        first, second = (read_scan(source, frame, 0.1)[0].xyz for source in recording[:2])
        distance, _ = KDTree(first).query(second[::20])
        shares.append((distance < 0.1).mean())
    assert shares[0] > 0.8
    assert shares[1] < 0.6

    options = ["--frame", "sensor", "-q", "--json"]
    result = invoke(
        "segment", laser / "scans", laser / "poses_kitti.txt", "-o", tmp_path / "out", *options
    )
    assert json.loads(result.stdout)["scans"] == 3


def test_the_robot_loop_of_the_examples_runs(tmp_path):
    arguments = [str(REPOSITORY / "examples" / part) for part in ("robot_loop.py", "office_walk")]
    result = subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, cwd=tmp_path, check=False
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout


def test_overwrite_never_touches_the_input(make_recording, tmp_path, weights_path):
    recording = make_recording(tmp_path / "own")
    for output in (tmp_path / "own", recording[0]):
        result = segment(recording, output, "-w", weights_path, "--overwrite")
        assert result.exit_code == 1
        assert "lies where results go" in result.stderr
        assert len(list(recording[0].iterdir())) == 4


def test_poses_far_from_their_points_are_pointed_out(recording, tmp_path, weights_path):
    lines = recording[1].read_text().splitlines()
    far = [re.sub(r"^(\d+),([\d.]+),", r"\1,\2,1", line) for line in lines[1:]]
    recording[1].write_text("\n".join([lines[0], *far]) + "\n")
    result = segment(recording, tmp_path / "out", "-w", weights_path)
    assert result.exit_code == 1
    assert "only 0 of 3,200 points lie within --range 2 of their pose" in result.stderr
    assert "nothing was labelled" in result.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("name", "labels", "found"),
    [
        ("semantic", np.full(9, 300), "class 300 (point 0)"),
        ("semantic", np.full(9, np.nan), "semantic nan (point 0)"),
        ("semantic", np.full(9, "wall"), "semantic <U4 (9,)"),
        ("instance", np.zeros((9, 2), int), "instance int64 (9, 2)"),
    ],
)
def test_eval_names_labels_that_make_no_sense(tmp_path, name, labels, found):
    arrays = {
        "xyz": np.random.default_rng(0).random((9, 3)),
        "semantic": np.zeros(9, int),
        "instance": np.ones(9, int),
    }
    np.savez(tmp_path / "truth.npz", **(arrays | {name: labels}))
    result = invoke("eval", tmp_path / "truth.npz", tmp_path / "truth.npz")
    assert result.exit_code == 1
    assert f"truth.npz: {found}" in result.stderr


def test_eval_without_true_objects_scores_the_classes(tmp_path):
    truth = read_cloud(WALK / "gt/000000.ply")
    none = np.zeros(len(truth), np.int32)
    write_cloud(tmp_path / "truth.ply", Cloud(truth.columns | {"instance": none}, truth.classes))
    scores = json.loads(
        invoke("eval", WALK / "gt/000000.ply", tmp_path / "truth.ply", "--json").stdout
    )
    assert (scores["point_accuracy"], scores["in_objects"], scores["nmi"]) == (1.0, 0, 0.0)


def test_every_file_of_the_truth_may_have_its_own_class_order(tmp_path):
    (tmp_path / "gt").mkdir()
    for number in (0, 1):
        truth = read_cloud(WALK / f"gt/00000{number}.ply")
        classes, semantic = truth.classes, truth.label("semantic")
        # the table of the second file is turned round
        if number:
            classes = tuple(reversed(classes))
            semantic = (len(classes) - 1 - semantic).astype(np.uint8)
        labelled = Cloud(truth.columns | {"semantic": semantic}, classes)
        write_cloud(tmp_path / f"gt/{number}.ply", labelled)

    for number in (0, 1):
        scores = json.loads(
            invoke("eval", WALK / f"gt/00000{number}.ply", tmp_path / "gt", "--json").stdout
        )
        assert scores["point_accuracy"] > 0.99


def test_eval_of_the_truth_itself_finds_every_object():
    scores = json.loads(
        invoke("eval", WALK / "gt/000000.ply", WALK / "gt/000000.ply", "--json").stdout
    )
    assert scores["scored_over"] == "whole map"
    clusters = ("ami", "v_measure", "cluster_ratio")
    objects = ("precision_50", "pq", "sq", "rq", "pq_with_stuff", "ap", "ap50", "ap25")
    for name in (*clusters, *objects, "mcov", "mwcov", "mprec", "mrec"):
        assert scores[name] == pytest.approx(1.0), name
    assert 0.0 < scores["object_accuracy"] <= 1.0  # objects of 50 points or fewer are never found


def test_eval_names_a_confidence_that_is_no_number(tmp_path):
    cloud = read_cloud(WALK / "gt/000000.ply")
    columns = cloud.columns | {"confidence": np.full(len(cloud), np.nan, np.float32)}
    write_cloud(tmp_path / "map.ply", Cloud(columns, cloud.classes))
    result = invoke("eval", tmp_path / "map.ply", WALK / "gt/000000.ply")
    assert result.exit_code == 1
    assert result.stderr.count("\n") == 1
    assert "confidence that is no number" in result.stderr


def test_eval_of_a_missing_path_says_so(tmp_path):
    assert (
        "nowhere: no such file or folder"
        in invoke("eval", tmp_path / "nowhere", WALK / "gt").stderr
    )


def test_sigterm_ends_a_run_like_ctrl_c(make_recording, tmp_path, weights_path):
    recording = make_recording(tmp_path / "input", num_scans=300)
    words = ["segment", *recording, "-o", tmp_path / "out", "-w", weights_path, "-q", "--overwrite"]
    process = start(*words, stderr=subprocess.PIPE)

    # in the midst of it
    wait_until(lambda: num_events(tmp_path / "out") > 0, process)
    process.send_signal(signal.SIGTERM)

    stderr = process.communicate(timeout=MOST_S)[1]
    assert "continue with: mcpseg segment" in stderr
    assert "--overwrite" not in stderr  # following the advice must not start again
    assert process.returncode == 130


def test_results_survive_a_closed_stdout(recording, tmp_path, weights_path):
    scans, poses = recording
    arguments = f"segment {scans} {poses} -o {tmp_path}/out -w {weights_path} -q"
    result = subprocess.run(
        f"{sys.executable} -m mcpseg_cli {arguments} >&-",
        shell=True,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    assert "Traceback" not in result.stderr
    assert (tmp_path / "out/objects.json").exists()
