"""Objects from accumulated evidence: what a scan does to them, told and kept."""

import numpy as np
import pytest
import torch

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.config import RegionGrowingSettings, SegmentSettings
from mcpseg_cli.errors import McpsegError
from mcpseg_cli.incremental.clustering import quantise
from mcpseg_cli.incremental.edges import EmbeddingEdges, EvidenceEdges
from mcpseg_cli.incremental.evidence import Evidence, Look
from mcpseg_cli.incremental.object_graph import ObjectGraph
from mcpseg_cli.incremental.regrouping import History, Moves
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.description import WeightsInfo
from mcpseg_cli.networks.weights import Weights, build_network
from mcpseg_cli.scan import Scan

METHODS = [("unet", "fused"), ("unet", "first"), ("mcpnet", "first"), ("mcpnet", "fused")]


@pytest.fixture(scope="module")
def weights() -> dict[str, Weights]:
    """Networks with seeded random parameters: their objects come and go."""
    made = {}
    for architecture in ("unet", "mcpnet"):
        info = WeightsInfo(architecture=architecture, classes=S3DIS_CLASSES)
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(7)
            made[architecture] = Weights(build_network(info).eval(), info, "", architecture)
    return made


def make_segmenter(weights: Weights, **settings: object) -> IncrementalSegmenter:
    chosen = SegmentSettings(**{"clustering": "graph", "affinity": 0.5, **settings})
    return IncrementalSegmenter(weights, chosen, precision="fp32")


def make_scan(number: int, num_points: int = 900) -> Scan:
    """What a robot sees around it on its way along x and back."""
    rng = np.random.default_rng(number)
    pose = np.eye(4)
    pose[0, 3] = 3 - abs(3 - 0.7 * number)
    xyz = rng.uniform([-1.9, -1.4, 0], [1.9, 1.4, 0.6], (num_points, 3)) + pose[:3, 3]
    return Scan(
        xyz.astype(np.float32), rng.integers(0, 256, (num_points, 3)).astype(np.uint8), pose
    )


@pytest.mark.parametrize(("architecture", "labelling"), METHODS)
def test_what_is_told_of_each_scan_makes_the_objects_there_are(weights, architecture, labelling):
    segmenter = make_segmenter(weights[architecture], labelling=labelling)
    first, merges, moves = [], [], []
    num_moved = 0
    for number in range(8):
        update = segmenter.register_scan(make_scan(number))
        instance = segmenter.clusters.instance
        first.append(instance[update.first_new :].copy())
        merges.append(update.merges)
        moves.append(Moves(update.moved, instance[update.moved].copy()))
        num_moved += len(update.moved) + len(update.merges)

        history = History(np.concatenate(merges), moves)
        np.testing.assert_array_equal(history.apply(np.concatenate(first))[0], instance)
    assert num_moved > 0  # else this tells nothing


@pytest.mark.parametrize(("architecture", "labelling"), METHODS)
def test_the_voxels_that_changed_object_are_those_told(weights, architecture, labelling):
    segmenter = make_segmenter(weights[architecture], labelling=labelling)
    for number in range(6):
        before = segmenter.clusters.instance.copy()
        update = segmenter.register_scan(make_scan(number))
        now = segmenter.clusters.instance[: len(before)]
        assert set(np.flatnonzero(before != now)) <= set(update.changed.tolist())
        gone = set(before.tolist()) - set(segmenter.clusters.instance.tolist())
        assert {old for old, _ in update.merges.tolist()} <= gone | {0}
        known = set(before.tolist())
        for parent, new in update.splits.tolist():
            assert parent in known
            assert new not in known
            assert (segmenter.clusters.instance == new).any()


@pytest.mark.parametrize(("architecture", "labelling"), METHODS)
def test_a_restored_graph_goes_on_as_if_it_had_never_stopped(weights, architecture, labelling):
    segmenter = make_segmenter(weights[architecture], labelling=labelling)
    rows, merges, moves = [], [], []
    for number in range(5):
        update = segmenter.register_scan(make_scan(number))
        rows.append(segmenter.rows(update.first_new).part(slice(None)))
        rows[-1] = type(rows[-1])(*(column.copy() for column in vars(rows[-1]).values()))
        merges.append(update.merges)
        moves.append(Moves(update.moved, segmenter.clusters.instance[update.moved].copy()))

    # labels as they are now, objects as at first
    other, start = make_segmenter(weights[architecture], labelling=labelling), 0
    parts = []
    for part in rows:
        end = start + len(part)
        now = segmenter.rows().part(slice(start, end))
        parts.append(
            type(part)(
                part.xyz, part.rgb, now.semantic.copy(), now.confidence.copy(), part.instance,
                part.embedding,
            )
        )  # fmt: skip
        start = end
    known = segmenter._labels.evidence
    evidence = [] if known is None else [known.rows(0, len(known))]
    history = History(np.concatenate(merges), moves)
    other.restore(parts, history, 5, update.floor, evidence)

    assert other.clusters.num_objects == segmenter.clusters.num_objects
    for number in range(5, 8):
        one, two = (each.register_scan(make_scan(number)) for each in (segmenter, other))
        np.testing.assert_array_equal(segmenter.clusters.instance, other.clusters.instance)
        np.testing.assert_array_equal(segmenter.semantic, other.semantic)
        np.testing.assert_array_equal(one.merges, two.merges)
        np.testing.assert_array_equal(one.splits, two.splits)
        np.testing.assert_array_equal(one.moved, two.moved)


def test_sizes_and_boundaries_are_those_of_the_voxels(weights):
    segmenter = make_segmenter(weights["unet"])
    for number in range(6):
        segmenter.register_scan(make_scan(number))
    graph = segmenter.clusters
    assert isinstance(graph, ObjectGraph)
    members, instance = graph._members, graph.instance
    np.testing.assert_array_equal(
        np.bincount(instance[instance > 0], minlength=members.num_ids)[1:], members.size[1:]
    )

    # class evidence and boundaries, counted anew
    evidence = segmenter._labels.evidence
    expected = np.zeros_like(members.evidence)
    np.add.at(expected, instance, evidence.of_class)
    np.testing.assert_array_equal(members.evidence[1:], expected[1:])
    boundary: dict[tuple[int, int], list[int]] = {}
    neighbours = segmenter.map.neighbours(np.arange(len(instance), dtype=np.int32))
    for voxel, k in zip(*np.nonzero(neighbours[:, 13:] >= 0), strict=True):
        pair = sorted((int(instance[voxel]), int(instance[neighbours[voxel, 13 + k]])))
        together, apart = int(evidence.together[voxel, k]), int(evidence.apart[voxel, k])
        if pair[0] > 0 and pair[0] != pair[1] and together + apart:
            sums = boundary.setdefault((pair[0], pair[1]), [0, 0])
            sums[0] += together
            sums[1] += together + apart
    kept = {(key >> 32, key & 0xFFFFFFFF): list(sums) for key, sums in members._boundary.items()}
    assert kept == boundary


def test_evidence_about_two_voxels_is_found_from_both_sides():
    evidence = Evidence(2)
    evidence.extend(2)
    affinity = np.full((2, 13), np.nan, np.float32)
    affinity[0, 4] = 0.8
    ids = np.arange(2, dtype=np.int32)
    evidence.add(Look(ids, np.full((2, 2), 0.5, np.float32), np.ones(2, np.float32), affinity))
    neighbours = np.full((2, 26), -1, np.int32)
    neighbours[0, 13 + 4], neighbours[1, 12 - 4] = 1, 0

    together, total = EvidenceEdges(evidence).of(ids, neighbours, np.empty((2, 0), np.int16))
    assert together[0, 17] == together[1, 8] == 204
    assert total[0, 17] == total[1, 8] == 255
    assert (np.count_nonzero(together), np.count_nonzero(total)) == (2, 2)


def test_neighbours_with_one_embedding_belong_together_and_those_with_another_do_not():
    unit = np.zeros((3, 50), np.float32)
    unit[0, 0] = unit[1, 0] = unit[2, 1] = 1
    neighbours = np.full((3, 26), -1, np.int32)
    neighbours[0, 13], neighbours[0, 14] = 1, 2
    together, total = EmbeddingEdges(0.9).of(
        np.arange(3, dtype=np.int32), neighbours, quantise(unit)
    )
    assert together[0, 13] > 0.9 * total[0, 13] > 0
    assert together[0, 14] < 0.1 * total[0, 14]
    assert total[1].sum() == 0


def test_region_growing_has_nothing_a_graph_could_be_made_of():
    with pytest.raises(McpsegError, match=r"--clustering graph: region-growing has no classes"):
        IncrementalSegmenter(RegionGrowingSettings(), SegmentSettings(clustering="graph"))
