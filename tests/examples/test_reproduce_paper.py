"""The script that makes the paper's tables: what it runs, takes for done, and writes."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.config import AugmentSettings
from mcpseg_cli.formats import read_cloud
from mcpseg_cli.grid import voxel_of
from mcpseg_cli.train.folds import find_areas
from mcpseg_cli.train.settings_file import read_settings
from tests.areas import write_area
from tests.commands import invoke

EXAMPLES = Path(__file__).parents[2] / "examples"
MODELS = EXAMPLES.parent / "models"
SMALLEST = ["--quick", "--areas", "1,6", "--rooms", "2", "--batches", "4", "--context-points", ""]


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import reproduce_paper

    return reproduce_paper


@pytest.fixture
def tables(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import paper_tables

    return paper_tables


def steps_of(script, *words: str) -> list:
    plan = script.read_plan(list(words))
    return [
        step
        for _, steps in [*script.table_steps(plan), *script.figure_steps(plan)]
        for step in steps
    ]


def write_result(folder: Path, name: str, miou: float, ms: float = 8.0) -> None:
    names = [
        "point_accuracy",
        "object_accuracy",
        "miou_present",
        "mean_class_accuracy",
        "nmi",
        "ami",
        "ari",
    ]
    scores = {"miou": miou, "cluster_ratio": 3.0, **dict.fromkeys(names, 0.5), "unit": "voxel"}
    scores["confusion"] = (
        np.hstack([np.diag([10 * miou] * 13), np.full((13, 1), 10 - 10 * miou)])
        .astype(int)
        .tolist()
    )
    scores["iou"] = {label: None if label == "sofa" else miou for label in S3DIS_CLASSES}
    times = {"p50": ms, "p95": 2 * ms, "max": 40.0}
    segment = {"ms_per_scan": times, "ms_by_stage": {"network": 5.0}, "peak_memory_mb": 400.0}
    folder.mkdir(exist_ok=True)
    (folder / f"{name}.eval.json").write_text(json.dumps(scores))
    (folder / f"{name}.segment.json").write_text(json.dumps(segment))


def test_from_an_area_not_there_yet_to_the_tables_and_nothing_is_done_twice(tmp_path):
    write_area(tmp_path / "paper/data/Area_1", classes=S3DIS_CLASSES)  # made elsewhere
    words = [sys.executable, EXAMPLES / "reproduce_paper.py", "-o", tmp_path / "paper", *SMALLEST]
    words += ["--methods", "region-growing,mcpnet-nocontext"]
    first, again = (
        subprocess.run(words, capture_output=True, text=True, check=False) for _ in range(2)
    )
    assert (first.returncode, again.returncode) == (0, 0), first.stderr
    assert [
        line.split()[1] for line in first.stdout.splitlines() if line.startswith("mcpseg ")
    ] == [
        "synth",
        "raytrace",
        "segment",
        "eval",
        "train",
        "segment",
        "eval",
    ]
    assert all(line.startswith("# done: mcpseg") for line in again.stdout.splitlines()[:-1])
    results = (tmp_path / "paper/results.md").read_text()
    assert "| Normal + color |" in results
    assert "| Proposed |" in results
    with (tmp_path / "paper/table_2.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["method"] for row in rows] == ["Normal + color", "Proposed"]
    assert 40 < float(rows[0]["NMI"]) < 100
    assert sorted(path.name for path in (tmp_path / "paper/maps").iterdir()) == [
        "mcpnet-nocontext-holdout6.ply", "region-growing-holdout6.ply",
    ]  # fmt: skip


def test_every_command_has_only_options_that_exist(script):
    helps = {}
    for step in steps_of(script, "--quick", "--folds", "all"):
        program, name, *rest = step.command
        if program == "python":
            continue
        if name not in helps:
            helps[name] = invoke(name, "--help").stdout
        for option in (word for word in rest if word.startswith("-")):
            assert option in helps[name], (name, option)


def test_full_training_has_the_settings_of_the_bundled_baselines(script, tmp_path):
    command = next(
        step.command for step in steps_of(script, "-o", "p") if step.command[1] == "train"
    )
    assert "--net pointnet --config p/training.toml --augment none -j 1" in " ".join(command)
    (tmp_path / "a.toml").write_text(script.training_settings(script.read_plan([])))
    ours, file = read_settings(tmp_path / "a.toml"), read_settings(MODELS / "pointnet.toml")
    changes = {"architecture": "pointnet", "batch_size": 1024}
    assert ours.train.model_copy(update=changes) == file.train
    assert ours.samples == file.samples
    assert AugmentSettings.off() == file.augment


def test_areas_and_weights_made_elsewhere_are_taken_as_done(script, tmp_path):
    for number in (1, 6):
        write_area(tmp_path / f"data/Area_{number}", num_scans=1)
    (tmp_path / "trained").mkdir()
    (tmp_path / "trained/pointnet-holdout6.safetensors").write_text("")
    words = ["-o", str(tmp_path), "--areas", "1,6", "--methods", "pointnet", "--context-points", ""]
    waiting = [step.command[1] for step in steps_of(script, *words) if not step.done()]
    assert waiting == ["segment", "eval"]


def test_offline_methods_learn_from_columns_of_the_complete_clouds(script, tmp_path):
    words = [
        "-o",
        str(tmp_path),
        "--areas",
        "1,6",
        "--methods",
        "pointnet-offline",
        "--context-points",
        "",
    ]
    commands = [" ".join(map(str, step.command)) for step in steps_of(script, *words)]
    assert sum("complete_clouds.py" in command for command in commands) == 2
    (training,) = [command for command in commands if command.startswith("mcpseg train")]
    assert f"mcpseg train {tmp_path}/offline --holdout 6 --net pointnet " in training
    assert "--name pointnet-offline-holdout6" in training
    assert (
        f"--method pointnet -w {tmp_path}/trained/pointnet-offline-holdout6.safetensors --offline"
        in commands[-2]
    )


def test_columns_hold_every_voxel_with_its_truth(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLES))
    from complete_clouds import write_columns

    area = write_area(tmp_path / "Area_1", num_scans=3)
    count = write_columns(area, tmp_path / "offline/Area_1")
    clouds = [read_cloud(path) for path in sorted((tmp_path / "offline/Area_1/gt").iterdir())]
    assert len(clouds) == count > 4
    (only,) = find_areas(tmp_path / "offline")
    assert only.number == 1
    for cloud in clouds:
        assert np.ptp(cloud.xyz[:, :2], axis=0).max() <= 1.0
        assert cloud.label("semantic").max() < len(cloud.classes)
    voxels = voxel_of(np.concatenate([cloud.xyz for cloud in clouds]), 0.1)
    assert len(np.unique(voxels, axis=0)) == len(voxels) > 500


def test_interrupted_training_is_continued(script, tmp_path):
    (tmp_path / "trained").mkdir()
    (tmp_path / "trained/sgpn-holdout6.safetensors").write_text("")
    (tmp_path / "trained/sgpn-holdout6.json").write_text('{"complete": false}')
    steps = steps_of(script, "-o", str(tmp_path), "--methods", "sgpn", "--context-points", "")
    (training,) = [step for step in steps if step.command[1] == "train"]
    assert not training.done()
    assert "--resume" in training.command


def test_s3dis_is_scanned_as_in_the_paper_and_never_written_to(script, tmp_path):
    steps = steps_of(
        script, "-o", str(tmp_path / "out"), "--s3dis", "s3dis", "--context-points", ""
    )
    traces = [" ".join(step.command) for step in steps if step.command[1] == "raytrace"]
    assert not [step for step in steps if step.command[1] == "synth"]
    assert len(traces) == 6
    assert all("--step 0.2 --noise 0 --cache" in trace for trace in traces)


def test_a_folder_made_with_other_settings_is_refused(script, tmp_path):
    script.check_settings(script.read_plan(["-o", str(tmp_path)]))
    script.check_settings(
        script.read_plan(["-o", str(tmp_path), "--folds", "1,6", "--methods", "pointnet"])
    )
    with pytest.raises(SystemExit, match="made with other settings"):
        script.check_settings(script.read_plan(["-o", str(tmp_path), "--epochs", "3"]))


@pytest.mark.parametrize(
    "words", [["--methods", "pointnet,resnet"], ["--folds", "7"], ["--areas", "6"]]
)
def test_plans_that_cannot_work_are_wrong_usage(script, words, capsys):
    with pytest.raises(SystemExit) as error:
        script.read_plan(words)
    assert error.value.code == 2
    assert words[0] in capsys.readouterr().err


def test_figures_are_means_over_the_folds_beside_the_papers(tables, tmp_path):
    for fold, miou in ((1, 0.2), (6, 0.4)):
        write_result(tmp_path / "results", f"mcpnet-holdout{fold}", miou)
    results = {
        "mcpnet": [
            tables.read_result(tmp_path / "results", f"mcpnet-holdout{fold}") for fold in (1, 6)
        ]
    }
    assert tables.table_1(results)[1][:3] == ["Proposed + MCP", "30.0", "50.0"]
    assert tables.table_1(results)[1][6] == "30.0"
    assert tables.table_1(results)[1][-3:] == ["39.2", "74.9", "33.5"]
    assert tables.table_2(results)[1][-3:] == ["85.6", "74.2", "39.7"]
    by_class = dict(zip(*tables.iou_by_class(results), strict=True))
    assert (by_class["wall"], by_class["sofa"]) == ("30.0", "0.0")


def test_region_growing_is_in_the_tables_that_need_no_class(tables, tmp_path):
    write_result(tmp_path / "results", "region-growing-holdout6", 0.0)
    results = {
        "region-growing": [tables.read_result(tmp_path / "results", "region-growing-holdout6")]
    }
    assert len(tables.table_1(results)) == len(tables.iou_by_class(results)) == 1
    assert (
        tables.table_2(results)[1][0]
        == tables.table_3(results, tmp_path, 6)[1][0]
        == "Normal + color"
    )


def test_offline_methods_have_no_time_per_scan(tables, tmp_path):
    write_result(tmp_path / "results", "sgpn-offline-holdout6", 0.4)
    results = {"sgpn-offline": [tables.read_result(tmp_path / "results", "sgpn-offline-holdout6")]}
    assert len(tables.table_1(results)) == 2
    assert len(tables.table_3(results, tmp_path, 6)) == 1


def test_the_figure_shows_accuracy_and_rate_by_context_points(tables, tmp_path):
    for count, ms in ((0, 4.0), (50, 10.0)):
        write_result(tmp_path / "results", f"context{count}-holdout6", 0.4, ms)
    results = {
        count: tables.read_result(tmp_path / "results", f"context{count}-holdout6")
        for count in (0, 50)
    }
    table = tables.figure_5(results)
    assert table[1:] == [["0", "50.0", "40.0", "250.0"], ["50", "50.0", "40.0", "100.0"]]
    tables.draw_figure_5(table, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
