"""Offline runs: the complete cloud in blocks, one clustering, one transaction."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.formats import read_cloud
from mcpseg_cli.incremental.offline import split_blocks
from mcpseg_cli.segment.run import SegmentRun
from tests.commands import outputs_of, segment
from tests.recordings import write_weights


@pytest.fixture(scope="module")
def pointnet(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("weights") / "pointnet.safetensors"
    return write_weights(path, "pointnet", seed=3)


def offline(recording, output, weights, *options: object):
    return segment(recording, output, "-w", weights, "--offline", "--precision", "fp32", *options)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000), count=st.integers(0, 200), edge=st.floats(0.2, 3.0))
def test_blocks_hold_every_point_once_and_none_farther_than_half_an_edge(seed, count, edge):
    xyz = np.random.default_rng(seed).uniform(-4, 4, (count, 3)).astype(np.float32)
    blocks = list(split_blocks(xyz, edge))
    ids = np.concatenate([np.empty(0, np.int32), *(ids for _, ids in blocks)])
    assert sorted(ids.tolist()) == list(range(count))
    for middle, members in blocks:
        assert np.abs(xyz[members, :2] - middle).max() <= edge / 2 + 1e-5
    assert len({tuple(middle) for middle, _ in blocks}) == len(blocks)


def test_an_offline_run_labels_the_points_of_an_online_run_and_writes_every_output(
    recording, tmp_path, pointnet
):
    result = offline(recording, tmp_path / "offline", pointnet, "--json")
    assert result.exit_code == 0, result.stderr
    document = json.loads(result.stdout)

    segment(recording, tmp_path / "online", "-w", pointnet)
    clouds = [read_cloud(tmp_path / name / "map.ply") for name in ("offline", "online")]
    np.testing.assert_array_equal(clouds[0].xyz, clouds[1].xyz)
    assert (document["scans"], document["voxels"]) == (4, len(clouds[0]))
    assert document["objects"] == len(np.unique(clouds[0].label("instance")))
    assert clouds[0].label("semantic").max() < 13

    names = [
        sorted(path.name for path in (tmp_path / name).iterdir()) for name in ("offline", "online")
    ]
    assert names[0] == names[1]


def test_labelled_scans_carry_the_final_labels(recording, tmp_path, pointnet):
    offline(recording, tmp_path / "out", pointnet)
    cloud = read_cloud(tmp_path / "out/map.ply")
    final = dict(zip(map(tuple, cloud.xyz.tolist()), cloud.label("instance").tolist(), strict=True))

    # points of the scan that founded a voxel
    scan = read_cloud(tmp_path / "out/scans/000000.ply")
    labels = zip(map(tuple, scan.xyz.tolist()), scan.label("instance").tolist(), strict=True)
    found = [(final[place], label) for place, label in labels if place in final]
    assert len(found) > 100
    assert all(expected == label for expected, label in found)


def test_the_same_command_again_says_that_all_is_labelled(recording, tmp_path, pointnet):
    offline(recording, tmp_path / "out", pointnet)
    before = outputs_of(tmp_path / "out")
    result = offline(recording, tmp_path / "out", pointnet)
    assert (result.exit_code, "nothing new: all 4 scans are labelled" in result.stderr) == (0, True)
    assert outputs_of(tmp_path / "out") == before


def test_lost_outputs_are_rebuilt(recording, tmp_path, pointnet):
    offline(recording, tmp_path / "out", pointnet)
    before = outputs_of(tmp_path / "out")
    (tmp_path / "out/map.ply").unlink()
    (tmp_path / "out/scans/000002.ply").unlink()
    offline(recording, tmp_path / "out", pointnet)
    assert outputs_of(tmp_path / "out") == before


def test_a_run_that_dies_before_its_commit_starts_afresh(
    recording, tmp_path, pointnet, monkeypatch
):
    offline(recording, tmp_path / "whole", pointnet)
    with monkeypatch.context() as patch:
        patch.setattr(SegmentRun, "commit_all", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        offline(recording, tmp_path / "out", pointnet)
    assert not list((tmp_path / "out/scans").iterdir())
    assert not (tmp_path / "out/objects.json").exists()
    assert offline(recording, tmp_path / "out", pointnet).exit_code == 0
    assert outputs_of(tmp_path / "out") == outputs_of(tmp_path / "whole")


def test_scans_cannot_be_added_to_an_offline_run(recording, tmp_path, pointnet):
    scans, poses = recording
    shutil.move(scans / "000003.ply", tmp_path / "last.ply")
    lines = poses.read_text().splitlines()
    poses.write_text("\n".join(lines[:-1]) + "\n")
    offline(recording, tmp_path / "out", pointnet)
    shutil.move(tmp_path / "last.ply", scans / "000003.ply")
    poses.write_text("\n".join(lines) + "\n")
    result = offline(recording, tmp_path / "out", pointnet)
    assert result.exit_code == 1
    assert "3 scans labelled offline, 1 more given" in result.stderr
    assert offline(recording, tmp_path / "out", pointnet, "--overwrite").exit_code == 0


def test_an_online_run_is_not_continued_offline(recording, tmp_path, pointnet):
    segment(recording, tmp_path / "out", "-w", pointnet, "--precision", "fp32")
    result = offline(recording, tmp_path / "out", pointnet)
    assert result.exit_code == 1
    assert "--offline" in result.stderr


def test_a_scan_that_cannot_be_read_is_skipped_if_asked(recording, tmp_path, pointnet):
    (recording[0] / "000001.ply").write_text("nothing")
    assert offline(recording, tmp_path / "stop", pointnet).exit_code == 1
    document = json.loads(
        offline(recording, tmp_path / "out", pointnet, "--on-error", "skip", "--json").stdout
    )
    assert (document["scans"], document["skipped"]) == (4, ["000001.ply"])


def test_a_recording_without_a_point_in_range_has_no_objects(recording, tmp_path, pointnet):
    result = offline(recording, tmp_path / "out", pointnet, "--range", "0.001", "--json")
    assert json.loads(result.stdout)["voxels"] == 0
    assert json.loads((tmp_path / "out/objects.json").read_text()) == []
    assert len(list((tmp_path / "out/scans").iterdir())) == 4


def test_every_method_runs_offline(recording, tmp_path, weights_path):
    assert offline(recording, tmp_path / "mcpnet", weights_path).exit_code == 0
    growing = ("--method", "region-growing", "--offline")
    assert segment(recording, tmp_path / "growing", *growing).exit_code == 0
