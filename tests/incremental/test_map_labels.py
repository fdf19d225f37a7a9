"""Labels that improve with every look, of the network that sees the room and of MCPNet."""

import numpy as np
import pytest
import torch

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.config import RegionGrowingSettings, SegmentSettings
from mcpseg_cli.errors import McpsegError
from mcpseg_cli.formats import read_cloud
from mcpseg_cli.incremental.evidence import Evidence, Look
from mcpseg_cli.incremental.map_labels import AllLooks, FirstLooks
from mcpseg_cli.incremental.offline import label_cloud
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter, ScanUpdate
from mcpseg_cli.networks.description import WeightsInfo
from mcpseg_cli.networks.weights import Weights, build_network, save_weights
from mcpseg_cli.scan import Scan
from tests.commands import segment


@pytest.fixture(scope="module")
def weights() -> dict[str, Weights]:
    """Networks with seeded random parameters, by name."""
    made = {}
    for architecture in ("unet", "mcpnet"):
        info = WeightsInfo(architecture=architecture, classes=S3DIS_CLASSES)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(7)
            network = build_network(info).eval()
            if architecture == "unet":
                network.classify.weight.data *= 20  # undecided, it would see no class but one
        made[architecture] = Weights(network, info, "", architecture)
    return made


def make_segmenter(weights: Weights, **settings: object) -> IncrementalSegmenter:
    return IncrementalSegmenter(weights, SegmentSettings(**settings), precision="fp32")


def make_scan(number: int, num_points: int = 900, step: float = 0.4) -> Scan:
    """What a robot sees around it on its way along x."""
    rng = np.random.default_rng(number)
    pose = np.eye(4)
    pose[0, 3] = step * number
    xyz = rng.uniform([-1.9, -1.4, 0], [1.9, 1.4, 0.6], (num_points, 3)) + pose[:3, 3]
    return Scan(
        xyz.astype(np.float32), rng.integers(0, 256, (num_points, 3)).astype(np.uint8), pose
    )


def walk(segmenter: IncrementalSegmenter, num_scans: int = 3) -> list[ScanUpdate]:
    return [segmenter.register_scan(make_scan(number)) for number in range(num_scans)]


def labels_of(segmenter: IncrementalSegmenter) -> tuple[np.ndarray, np.ndarray]:
    return segmenter.semantic.copy(), segmenter.confidence.copy()


@pytest.mark.parametrize(
    ("architecture", "labelling", "all_looks"),
    [
        ("unet", None, True),
        ("unet", "fused", True),
        ("unet", "first", True),
        ("mcpnet", None, False),
        ("mcpnet", "first", False),
        ("mcpnet", "fused", True),
    ],
)
def test_every_voxel_gets_a_label_whoever_labels(weights, architecture, labelling, all_looks):
    segmenter = make_segmenter(weights[architecture], labelling=labelling)
    for number in range(3):
        update = segmenter.register_scan(make_scan(number))
        assert len(segmenter.semantic) == len(segmenter.confidence) == len(segmenter.map)
        assert update.num_new > 0
    assert (segmenter.semantic < 13).all()
    assert ((segmenter.confidence > 0) & (segmenter.confidence <= 1)).all()
    assert isinstance(segmenter._labels, AllLooks if all_looks else FirstLooks)


@pytest.mark.parametrize("architecture", ["unet", "mcpnet"])
def test_another_look_changes_labels_and_the_update_says_which(weights, architecture):
    segmenter = make_segmenter(weights[architecture], labelling="fused")
    segmenter.register_scan(make_scan(0))
    semantic, confidence = labels_of(segmenter)
    update = segmenter.register_scan(make_scan(1))

    known = slice(len(semantic))
    is_changed = segmenter.semantic[known] != semantic
    assert is_changed.any()
    is_changed |= segmenter.confidence[known] != confidence
    assert set(np.flatnonzero(is_changed)) <= set(update.changed.tolist())
    assert (update.changed < update.first_new).all()
    assert (np.diff(update.changed) > 0).all()


@pytest.mark.parametrize("architecture", ["unet", "mcpnet"])
def test_where_only_first_looks_count_labels_never_change(weights, architecture):
    segmenter = make_segmenter(weights[architecture], labelling="first")
    segmenter.register_scan(make_scan(0))
    before = labels_of(segmenter)
    for number in (1, 2, 0):
        segmenter.register_scan(make_scan(number))
    for was, now in zip(before, labels_of(segmenter), strict=True):
        np.testing.assert_array_equal(now[: len(was)], was)


def test_first_labels_are_the_same_whether_more_looks_count_or_not(weights):
    one, other = (
        make_segmenter(weights["unet"], labelling=each, clustering="paper")
        for each in ("first", "fused")
    )
    for segmenter in (one, other):
        segmenter.register_scan(make_scan(0))
    for left, right in zip(labels_of(one), labels_of(other), strict=True):
        np.testing.assert_array_equal(left, right)


@pytest.mark.parametrize("labelling", ["first", "fused"])
def test_the_same_walk_gives_the_same_labels(weights, labelling):
    runs = []
    for _ in range(2):
        segmenter = make_segmenter(weights["unet"], labelling=labelling)
        walk(segmenter)
        runs.append((*labels_of(segmenter), segmenter.clusters.instance.copy()))
    for left, right in zip(*runs, strict=True):
        np.testing.assert_array_equal(left, right)


def test_labels_are_what_the_evidence_says(weights):
    segmenter = make_segmenter(weights["unet"], clustering="paper")
    walk(segmenter)
    evidence = segmenter._labels.evidence
    assert len(evidence) == len(segmenter.map)
    everything = np.arange(len(evidence), dtype=np.int32)
    for said, kept in zip(evidence.labels(everything), labels_of(segmenter), strict=True):
        np.testing.assert_array_equal(said, kept)


def test_labels_are_what_voxels_and_their_objects_are(weights):
    segmenter = make_segmenter(weights["unet"], affinity=0.5)
    update = walk(segmenter)[-1]
    ids, evidence = update.judged, segmenter._labels.evidence
    shares = segmenter.clusters.class_shares(ids)
    semantic, confidence = evidence.labels(ids, shares)
    np.testing.assert_array_equal(segmenter.semantic[ids], semantic)
    np.testing.assert_array_equal(segmenter.confidence[ids], confidence)
    assert (semantic != evidence.labels(ids)[0]).any()


def test_a_voxel_of_no_object_is_what_it_is_itself():
    evidence = Evidence(2)
    evidence.extend(1)
    everything, one = np.zeros(1, np.int32), np.ones(1, np.float32)
    evidence.add(Look(everything, np.array([[0.75, 0.25]], np.float32), one))
    nothing = np.zeros((1, 2), np.float32)
    for said, alone in zip(
        evidence.labels(everything, nothing), evidence.labels(everything), strict=True
    ):
        np.testing.assert_array_equal(said, alone)


def test_the_object_counts_as_much_as_the_voxel():
    evidence = Evidence(2)
    evidence.extend(1)
    everything, one = np.zeros(1, np.int32), np.ones(1, np.float32)
    evidence.add(Look(everything, np.array([[0.6, 0.4]], np.float32), one))
    prior = np.array([[0.1, 0.9]], np.float32)
    semantic, confidence = evidence.labels(everything, prior)
    assert (semantic.tolist(), confidence.tolist()) == ([1], pytest.approx([0.65], abs=1e-6))


def test_looks_are_the_scans_that_saw_a_voxel(weights):
    segmenter = make_segmenter(weights["unet"])
    updates = walk(segmenter)
    looks = np.zeros(len(segmenter.map), int)
    for update in updates:
        looks[np.unique(update.point_ids[update.point_ids >= 0])] += 1
    np.testing.assert_array_equal(segmenter._labels.evidence.looks, looks)


def test_affinities_are_of_neighbours_that_are_there(weights):
    segmenter = make_segmenter(weights["unet"])
    walk(segmenter)
    evidence = segmenter._labels.evidence
    pairs = evidence.together.astype(int) + evidence.apart
    ids = np.arange(len(evidence), dtype=np.int32)
    there = segmenter.map.neighbours(ids)[:, -13:] >= 0
    assert (pairs[~there] == 0).all()
    assert (pairs[there] > 0).mean() > 0.99  # pairs judged at least once
    assert pairs.any()


def test_a_scan_without_a_point_in_range_changes_nothing_near_nothing(weights):
    segmenter = make_segmenter(weights["unet"])
    segmenter.register_scan(make_scan(0))
    before = labels_of(segmenter)
    far = np.eye(4)
    far[0, 3] = 500.0
    nothing = Scan(np.full((5, 3), 400.0, np.float32), None, far)
    update = segmenter.register_scan(nothing)
    assert (update.num_new, update.num_seen, len(update.changed)) == (0, 0, 0)
    assert (update.point_ids == -1).all()
    for was, now in zip(before, labels_of(segmenter), strict=True):
        np.testing.assert_array_equal(now, was)


@pytest.mark.parametrize("architecture", ["unet", "mcpnet"])
def test_a_map_may_begin_with_scans_that_show_nothing(weights, architecture):
    segmenter = make_segmenter(weights[architecture], labelling="fused")
    update = segmenter.register_scan(Scan(np.empty((0, 3), np.float32), None, np.eye(4)))
    assert (len(segmenter.map), update.num_new, update.floor) == (0, 0, None)
    assert segmenter.register_scan(make_scan(0)).num_new > 100


@pytest.mark.parametrize("architecture", ["unet", "mcpnet"])
def test_a_window_of_one_voxel_is_labelled(weights, architecture):
    segmenter = make_segmenter(weights[architecture], labelling="fused")
    one = Scan(np.array([[0.31, 0.2, 0.1]], np.float32), None, np.eye(4))
    for num_new in (1, 0):
        assert segmenter.register_scan(one).num_new == num_new
    assert (len(segmenter.semantic), len(segmenter.clusters.instance)) == (1, 1)


def test_all_voxels_in_range_are_looked_at_again_also_those_out_of_sight(weights):
    segmenter = make_segmenter(weights["unet"])
    segmenter.register_scan(make_scan(0))
    before = segmenter._labels.evidence.of_class.sum(axis=1)
    pose = make_scan(0).pose
    segmenter.register_scan(Scan(np.array([[0.3, 0, 0.1]], np.float32), None, pose))
    after = segmenter._labels.evidence.of_class.sum(axis=1)[: len(before)]
    assert (after > before).all()


def test_region_growing_has_no_looks_to_fuse():
    with pytest.raises(McpsegError, match=r"--labelling fused: region-growing tells no classes"):
        IncrementalSegmenter(RegionGrowingSettings(), SegmentSettings(labelling="fused"))


def test_a_complete_cloud_is_judged_at_once(weights):
    segmenter = make_segmenter(weights["unet"])
    walk(segmenter)
    rows, floor = label_cloud(segmenter.map, np.zeros((1, 3)), segmenter.method)
    assert len(rows.semantic) == len(rows.instance) == len(segmenter.map)
    assert (rows.confidence > 0).all()
    assert floor == pytest.approx(0, abs=0.2)
    again, _ = label_cloud(segmenter.map, np.zeros((1, 3)), segmenter.method)
    np.testing.assert_array_equal(again.semantic, rows.semantic)


def test_confidence_is_cooled_by_the_temperature_of_the_weights(weights):
    made = weights["unet"]
    warm = Weights(made.network, made.info.model_copy(update={"temperature": 5.0}), "", "warm")
    cold, cool = make_segmenter(made), make_segmenter(warm)
    for segmenter in (cold, cool):
        segmenter.register_scan(make_scan(0))
    np.testing.assert_array_equal(cold._labels.evidence.looks, cool._labels.evidence.looks)
    assert cool.confidence.mean() < cold.confidence.mean()


@pytest.mark.parametrize("options", [(), ("--offline",)])
def test_the_command_labels_with_the_network_that_sees_the_room(
    weights, options, recording, tmp_path
):
    made, options = weights["unet"], (*options, "-q")
    save_weights(tmp_path / "w.safetensors", made.network, made.info)
    result = segment(recording, tmp_path / "out", "-w", tmp_path / "w.safetensors", *options)
    assert result.exit_code == 0, result.stderr
    cloud = read_cloud(tmp_path / "out" / "map.ply")
    assert len(cloud.xyz) > 100
    assert (cloud.label("semantic") < 13).all()


@pytest.mark.parametrize("architecture", ["mcpnet", "unet"])
def test_two_threads_label_as_one_does(weights, architecture):
    labels = []
    for threads in (1, 2):
        torch.set_num_threads(threads)
        segmenter = make_segmenter(weights[architecture])
        walk(segmenter)
        labels.append((segmenter.semantic, segmenter.clusters.instance, segmenter.confidence))
    for one, two in zip(*labels, strict=True):
        np.testing.assert_array_equal(one, two)
