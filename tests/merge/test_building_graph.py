"""Objects of a building linked column by column against those of the whole graph at once."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.grid import voxel_of
from mcpseg_cli.incremental.edges import EvidenceEdges
from mcpseg_cli.incremental.evidence import Evidence
from mcpseg_cli.incremental.object_graph import ObjectGraph
from mcpseg_cli.incremental.uniting import PartVoxels, unite
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.merge.building_graph import BuildingGraph
from mcpseg_cli.merge.spool import Spool

CLASSES = 3
THRESHOLD, LEAST = 0.5, 5


def make_voxels(rng, count):
    """Voxels around the corner of four columns, evidence without ties."""
    cells = rng.choice(16 * 16 * 4, count, replace=False)
    voxel = np.stack(np.unravel_index(cells, (16, 16, 4)), axis=1) + np.array([120, -8, 0])
    evidence = rng.integers(1, 60_000, (count, CLASSES + 27)).astype(np.uint16)
    xyz = (voxel * 0.1 + rng.uniform(-0.04, 0.04, (count, 3))).astype(np.float32)
    nothing = np.zeros(count, np.int32)
    return PartVoxels(
        voxel.astype(np.int32), nothing, xyz, np.zeros((count, 3), np.uint8),
        np.zeros((count, 0), np.int16), evidence, nothing.copy(),
    )  # fmt: skip


class Labels:
    """Class evidence of voxels, as the graph asks for it."""

    def __init__(self, evidence):
        self.evidence = evidence

    def class_evidence(self, ids):
        return self.evidence.of_class[ids]


def objects_at_once(rows):
    """Objects as ``segment`` puts a complete map together."""
    voxels, evidence = VoxelMap(0.1), Evidence(CLASSES)
    voxels.restore(rows.xyz, rows.rgb)
    evidence.restore(rows.evidence)
    graph = ObjectGraph(
        Labels(evidence), EvidenceEdges(evidence), CLASSES, threshold=THRESHOLD, least=LEAST
    )
    graph.put_all_together(voxels, np.zeros((len(rows), 50), np.int16))
    return graph.instance


def objects_by_columns(rows, folder):
    """Objects by columns, in the order of ``rows``."""
    folder.mkdir()
    spool, graph, known = (
        Spool(folder),
        BuildingGraph(CLASSES, threshold=THRESHOLD, least=LEAST),
        {},
    )
    spool.add(rows)
    for column in spool.columns:
        there = spool.read(column)
        united = unite(there, column)
        known[column] = (united.key[: united.num_inside], graph.add(column, there, united), united)
    found = graph.objects(lambda column: known[column][:2])

    owner = {}
    for column in spool.columns:
        _, cluster, united = known[column]
        xyz = spool.read(column).xyz[united.chosen[: united.num_inside]]
        instance = found.owner[cluster + graph.first(column)]
        voxels = map(tuple, voxel_of(xyz, 0.1).tolist())
        owner |= dict(zip(voxels, instance.tolist(), strict=True))
    assert len(spool.columns) == 4
    return np.array([owner[tuple(voxel)] for voxel in rows.voxel.tolist()])


def same_partition(one, other):
    pairs = set(zip(one.tolist(), other.tolist(), strict=True))
    return len(pairs) == len({a for a, _ in pairs}) == len({b for _, b in pairs})


def test_what_a_map_had_as_one_object_is_rather_one_and_what_it_had_as_two_rather_two(
    tmp_path,
):
    rows = make_voxels(np.random.default_rng(3), 2)
    rows.voxel[:] = [[10, 10, 0], [10, 10, 1]]
    rows.xyz[:] = rows.voxel * 0.1 + 0.05
    rows.evidence[:] = 0
    rows.evidence[:, 0] = 100
    partitions = {}
    for joint in (45, 55):
        for instance in ((0, 0), (1, 1), (1, 2)):
            rows.evidence[0, [CLASSES, CLASSES + 13]] = joint, 100 - joint
            rows.instance[:] = instance
            graph = BuildingGraph(CLASSES, threshold=THRESHOLD, least=1)
            united = unite(rows, (0, 0))
            cluster = graph.add((0, 0), rows, united)
            known = (united.key, cluster)
            owner = graph.objects(lambda _, known=known: known).owner[cluster]
            partitions[joint, instance] = owner[0] == owner[1]
    assert partitions == {
        (45, (0, 0)): False, (45, (1, 1)): True, (45, (1, 2)): False,
        (55, (0, 0)): True, (55, (1, 1)): True, (55, (1, 2)): False,
    }  # fmt: skip


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.integers(100, 700))
def test_objects_are_those_of_the_whole_graph(tmp_path_factory, seed, count):
    rows = make_voxels(np.random.default_rng(seed), count)
    folder = tmp_path_factory.mktemp("columns") / "spool"
    one, other = objects_at_once(rows), objects_by_columns(rows, folder)
    assert len(set(one.tolist())) > 1
    assert same_partition(one, other)
