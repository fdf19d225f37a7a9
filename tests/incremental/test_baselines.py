"""The networks that MCPNet is compared with, run scan by scan."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.config import SegmentSettings
from mcpseg_cli.formats import read_cloud
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.description import WeightsInfo
from mcpseg_cli.networks.weights import Weights, build_network, save_weights
from mcpseg_cli.scan import Scan
from tests.commands import segment

CLASS_ONLY = ["pointnet", "pointnet2", "voxnet"]


def make_weights(architecture: str) -> Weights:
    info = WeightsInfo(architecture=architecture, classes=S3DIS_CLASSES)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(3)
        return Weights(build_network(info).eval(), info, "", architecture)


def walk(segmenter: IncrementalSegmenter, num_scans: int = 3, num_points: int = 900) -> None:
    rng = np.random.default_rng(0)
    for number in range(num_scans):
        pose = np.eye(4)
        pose[0, 3] = 0.4 * number
        xyz = rng.uniform([-2, -2, 0], [2, 2, 0.6], (num_points, 3)) + pose[:3, 3]
        colour = rng.integers(0, 255, (num_points, 3)).astype(np.uint8)
        segmenter.register_scan(Scan(xyz.astype(np.float32), colour, pose))


def same_partition(a: np.ndarray, b: np.ndarray) -> bool:
    return len(np.unique(np.stack([a, b]), axis=1).T) == len(np.unique(a)) == len(np.unique(b))


@pytest.mark.parametrize("architecture", CLASS_ONLY)
def test_objects_of_a_network_without_embedding_are_connected_voxels_of_one_class(architecture):
    segmenter = IncrementalSegmenter(
        make_weights(architecture), SegmentSettings(similarity=0.1), precision="fp32"
    )
    walk(segmenter)

    # the slow way: neighbours of one class
    ids = np.arange(len(segmenter.map), dtype=np.int32)
    rows, columns = np.nonzero((neighbours := segmenter.map.neighbours(ids)) >= 0)
    pairs = np.stack([rows, neighbours[rows, columns]])
    pairs = pairs[:, segmenter.semantic[pairs[0]] == segmenter.semantic[pairs[1]]]
    _, component = connected_components(
        coo_array((np.ones(pairs.shape[1]), pairs), shape=(len(ids), len(ids)))
    )

    assert len(np.unique(segmenter.semantic)) > 1
    assert same_partition(segmenter.clusters.instance, component)


@pytest.mark.parametrize("architecture", ["mcpnet", "sgpn", "voxnet"])
def test_settings_not_given_are_the_networks_own(architecture):
    weights = make_weights(architecture)
    segmenter = IncrementalSegmenter(weights)
    own = {"mcpnet": (256, 0.9), "sgpn": (1024, 0.98), "voxnet": (1024, 0.9)}[architecture]
    assert (segmenter.settings.batch_size, segmenter.settings.similarity) == own
    given = IncrementalSegmenter(
        weights, SegmentSettings(batch_size=256, similarity=0.9, seed=4)
    ).settings
    assert (given.batch_size, given.similarity, given.seed) == (256, 0.9, 4)


def test_settings_for_mcpnet_are_written_down_as_ever():
    segmenter = IncrementalSegmenter(make_weights("mcpnet"), SegmentSettings(local_range=3.0))
    expected = SegmentSettings(local_range=3.0, labelling="first", clustering="paper")
    assert segmenter.settings.model_dump() == expected.model_dump()


@pytest.mark.parametrize("architecture", [*CLASS_ONLY, "sgpn"])
def test_the_same_walk_gives_the_same_labels(architecture):
    labels = []
    for _ in range(2):
        segmenter = IncrementalSegmenter(
            make_weights(architecture), SegmentSettings(seed=5), precision="fp32"
        )
        walk(segmenter, num_scans=2)
        labels.append((segmenter.semantic.tolist(), segmenter.clusters.instance.tolist()))
    assert labels[0] == labels[1]


def report_of(folder: Path, scans: Path, poses: Path) -> dict[str, object]:
    options = ("-w", folder / "w.safetensors", "--json", "-q")
    result = segment((scans, poses), folder / "out", *options)
    assert result.exit_code == 0, result.stderr
    return json.loads(result.stdout)


def test_the_command_takes_a_baseline_and_continues_its_run(tmp_path, make_recording):
    scans, poses = make_recording(tmp_path)
    weights = make_weights("sgpn")
    save_weights(tmp_path / "w.safetensors", weights.network, weights.info)

    # all scans but the last
    last = scans / "000003.ply"
    last.rename(tmp_path / last.name)
    lines = poses.read_text()
    poses.write_text("\n".join(lines.splitlines()[:-1]))
    assert report_of(tmp_path, scans, poses)["scans"] == 3

    # and the last
    (tmp_path / last.name).rename(last)
    poses.write_text(lines)
    assert report_of(tmp_path, scans, poses)["resumed_from"] == 3

    configuration = json.loads((tmp_path / "out/run.json").read_text())["configuration"]
    assert (configuration["batch_size"], configuration["similarity"]) == (1024, 0.98)
    assert len(read_cloud(tmp_path / "out/map.ply")) > 100
