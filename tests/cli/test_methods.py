"""``mcpseg segment --method``: what labels, and which weights fit."""

import json
from pathlib import Path

import numpy as np

from mcpseg_cli.errors import WeightsError
from mcpseg_cli.formats import read_cloud
from tests.commands import invoke, segment


def test_region_growing_needs_no_weights_and_continues_its_run(recording, tmp_path):
    result = segment(recording, tmp_path / "out", "--method", "region-growing")
    assert (result.exit_code, result.stderr) == (0, "")
    cloud = read_cloud(tmp_path / "out/map.ply")
    assert cloud.classes == ()
    assert np.unique(cloud.label("semantic")).tolist() == [255]
    assert 1 < len(np.unique(cloud.label("instance"))) < len(cloud)
    again = segment(recording, tmp_path / "out", "--method", "region-growing")
    assert "nothing new" in again.stderr


def test_a_run_is_not_continued_with_another_method(recording, tmp_path, weights_path):
    segment(recording, tmp_path / "out", "-w", weights_path)
    result = segment(recording, tmp_path / "out", "--method", "region-growing")
    assert result.exit_code == 1
    assert "made with --method (none), now region-growing" in result.stderr


def test_region_growing_resumed_equals_region_growing_in_one_go(recording, tmp_path):
    scans, poses = recording
    segment(recording, tmp_path / "whole", "--method", "region-growing")
    (scans / "000003.ply").rename(tmp_path / "last.ply")
    lines = poses.read_text()
    poses.write_text("\n".join(lines.splitlines()[:-1]) + "\n")
    segment(recording, tmp_path / "parts", "--method", "region-growing")
    (tmp_path / "last.ply").rename(scans / "000003.ply")
    poses.write_text(lines)
    segment(recording, tmp_path / "parts", "--method", "region-growing")
    for name in ("map.ply", "objects.json", "scans/000003.ply"):
        assert (tmp_path / "parts" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_a_method_takes_weights_of_its_network_only(recording, tmp_path, weights_path):
    assert (
        segment(recording, tmp_path / "a", "--method", "mcpnet", "-w", weights_path).exit_code == 0
    )
    result = segment(recording, tmp_path / "b", "--method", "pointnet", "-w", weights_path)
    assert result.exit_code == 1
    assert "weights of mcpnet; expected weights of pointnet" in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_region_growing_takes_no_weights(recording, tmp_path, weights_path):
    result = segment(recording, tmp_path / "out", "--method", "region-growing", "-w", weights_path)
    assert result.exit_code == 1
    assert "leave -w out" in result.stderr


def test_a_network_without_bundled_weights_says_how_to_get_some(recording, tmp_path, monkeypatch):
    def find_nothing(name):
        raise WeightsError(name, "no such weights", "others", "check the name")

    monkeypatch.setattr("mcpseg_cli.incremental.methods.find_weights", find_nothing)
    result = segment(recording, tmp_path / "out", "--method", "voxnet")
    assert result.exit_code == 1
    assert "mcpseg train --net voxnet" in result.stderr


def test_the_default_sees_the_room_and_the_run_says_which_method_it_was(recording, tmp_path):
    segment(recording, tmp_path / "default", "-q")
    segment(recording, tmp_path / "growing", "--method", "region-growing")
    methods = [
        json.loads((tmp_path / name / "run.json").read_text())["method"]
        for name in ("default", "growing")
    ]
    assert methods == ["unet", "region-growing"]


def test_region_growing_is_scored_without_classes(tmp_path):
    walk = Path(__file__).parents[2] / "examples/office_walk"
    segment((walk / "scans", walk / "poses.csv"), tmp_path / "out", "--method", "region-growing")
    result = invoke("eval", tmp_path / "out", walk / "gt", "--json")
    scores = json.loads(result.stdout)
    assert scores["point_accuracy"] == 0.0
    assert scores["nmi"] > 0.7
    assert scores["object_accuracy"] == 0.0


def test_region_growing_refuses_an_unknown_device_too(recording, tmp_path):
    result = segment(
        recording, tmp_path / "out", "--method", "region-growing", "--device", "abacus"
    )
    assert result.exit_code == 1
    assert "--device abacus" in result.stderr
