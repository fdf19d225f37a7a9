"""Evidence of several maps added voxel by voxel, against a slow twin."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcpseg_cli.incremental.evidence import FULL
from mcpseg_cli.incremental.object_graph import INERTIA
from mcpseg_cli.incremental.uniting import (
    FORWARD,
    PartVoxels,
    is_rim,
    keys_of,
    list_edges,
    move_evidence,
    unite,
    voxels_of,
)
from mcpseg_cli.incremental.voxel_map import VoxelMap

CLASSES = 3
COLUMN = (-1, 0)  # x from -128 to -1, y from 0 to 127


def make_part(rng, number, count=60, most=400):
    """Distinct voxels at a corner of the column, some of its rim."""
    cells = rng.choice(6**3, count, replace=False)
    voxel = np.stack(np.unravel_index(cells, (6, 6, 6)), axis=1) + np.array([-5, 124, -2])
    return PartVoxels(
        voxel.astype(np.int32),
        np.full(count, number, np.int32),
        (voxel * 0.1 + rng.uniform(-0.04, 0.04, (count, 3))).astype(np.float32),
        rng.integers(0, 256, (count, 3)).astype(np.uint8),
        rng.integers(-9, 9, (count, 4)).astype(np.int16),
        rng.integers(0, most, (count, CLASSES + 27)).astype(np.uint16),
        rng.integers(0, 9, count).astype(np.int32),
    )


def joined(parts):
    columns = zip(*(vars(part).values() for part in parts), strict=True)
    return PartVoxels(*(np.concatenate(each) for each in columns))


def outcome(parts):
    """All that is known of every voxel of the column."""
    rows = joined(parts)
    united = unite(rows, COLUMN)
    chosen = united.chosen
    columns = (rows.xyz[chosen], rows.rgb[chosen], united.evidence)
    return united.key.tolist(), [column.tolist() for column in columns]


@given(st.integers(0, 10_000))
def test_the_order_of_the_parts_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    parts = [make_part(rng, number) for number in range(3)]
    assert outcome(parts) == outcome([parts[order] for order in rng.permutation(3)])


@given(st.integers(0, 10_000))
def test_an_empty_part_changes_nothing(seed):
    part = make_part(np.random.default_rng(seed), 0)
    assert outcome([part]) == outcome([part, part.select(slice(0, 0))])


@given(st.integers(0, 10_000))
def test_evidence_is_the_sum_over_the_parts(seed):
    rng = np.random.default_rng(seed)
    parts = [make_part(rng, number) for number in range(3)]
    united = unite(joined(parts), COLUMN)
    expected: dict[tuple[int, ...], np.ndarray] = {}
    for part in parts:
        for voxel, row in zip(part.voxel.tolist(), part.evidence.astype(int), strict=True):
            expected[tuple(voxel)] = expected.get(tuple(voxel), 0) + row
    voxels = [tuple(each) for each in voxels_of(united.key, COLUMN).tolist()]
    assert sorted(voxels) == sorted(expected)
    for voxel, row in zip(voxels, united.evidence, strict=True):
        assert row.tolist() == expected[voxel].tolist()


def test_sums_that_are_too_large_are_halved_and_keep_their_shares():
    rng = np.random.default_rng(0)
    part = make_part(rng, 0, count=1)
    part.evidence[:] = 60_000
    part.evidence[0, 1] = 30_000
    other = PartVoxels(**{**vars(part), "part": np.ones(1, np.int32)})
    row = unite(joined([part, other]), COLUMN).evidence[0]
    assert row.max() <= max(FULL, 65535)
    assert row[:CLASSES].tolist() == [60_000, 30_000, 60_000]
    assert row[CLASSES:-1].tolist() == [60_000] * 26
    assert row[-1] == 65535


def test_the_part_that_knows_most_gives_the_point():
    rng = np.random.default_rng(1)
    part = make_part(rng, 0, count=1)
    other = PartVoxels(
        part.voxel, part.part + 1, part.xyz + np.float32(0.01), part.rgb, part.embedding,
        part.evidence * 2, part.instance,
    )  # fmt: skip
    assert unite(joined([part, other]), COLUMN).chosen.tolist() == [1]


def test_looks_at_two_voxels_of_a_part_that_became_one_count_once():
    part = make_part(np.random.default_rng(2), 0, count=2)
    part.voxel[1] = part.voxel[0]
    part.evidence[:, -1] = (3, 5)
    assert unite(part, COLUMN).evidence[:, -1].tolist() == [5]


def test_keys_are_of_voxels_and_order_them():
    voxel = np.array([[-128, 0, -9], [-128, 0, 4], [-127, 0, -9], [-1, 127, 0], [0, 128, 1]])
    keys = keys_of(voxel, COLUMN)
    assert (np.diff(keys) > 0).all()
    assert voxels_of(keys, COLUMN).tolist() == voxel.tolist()
    assert is_rim(keys).tolist() == [False, False, False, False, True]


@given(st.integers(0, 10_000), st.integers(1, 3))
def test_edges_are_those_of_the_voxels_that_keep_evidence_held_by_the_maps_objects(seed, count):
    rng = np.random.default_rng(seed)
    rows = joined([make_part(rng, number) for number in range(count)])
    rows.instance[:] = np.minimum(rows.instance, 3)
    united = unite(rows, COLUMN)
    found = edges_of(rows, united)
    voxels = [tuple(each) for each in voxels_of(united.key, COLUMN).tolist()]
    row = {voxel: number for number, voxel in enumerate(voxels)}
    expected = {}
    for one, voxel in enumerate(voxels):
        for k, step in enumerate(FORWARD.tolist()):
            other = row.get(tuple(np.add(voxel, step).tolist()))
            joint = int(united.evidence[one, CLASSES + k])
            both = joint + int(united.evidence[one, CLASSES + 13 + k])
            if other is None or both == 0 or min(one, other) >= united.num_inside:
                continue
            same, apart, known = said_of(rows, voxel, voxels[other], k)
            joint = 100 * joint + INERTIA * both * same // max(known, 1)
            expected[one, other] = (
                joint,
                100 * both + INERTIA * both * (same + apart) // max(known, 1),
            )
    assert found == expected


def edges_of(rows, united):
    """Edges as a table of evidence for, and for or against, by their ends."""
    ends, together, total = list_edges(rows, united, COLUMN)
    return {
        (int(one), int(other)): (int(a), int(b))
        for (one, other), a, b in zip(ends, together, total, strict=True)
    }


def said_of(rows, voxel, other, k):
    """Evidence of maps about a pair: where both were of one object, of two, and in all."""
    same = apart = known = 0
    for part in np.unique(rows.part):
        here = {
            tuple(each): row
            for row, each in enumerate(rows.voxel.tolist())
            if rows.part[row] == part
        }
        if voxel not in here:
            continue
        row = here[voxel]
        said = int(rows.evidence[row, CLASSES + k]) + int(rows.evidence[row, CLASSES + 13 + k])
        objects = rows.instance[row], rows.instance[here[other]] if other in here else 0
        known += said
        same += said * (min(objects) > 0 and objects[0] == objects[1])
        apart += said * (min(objects) > 0 and objects[0] != objects[1])
    return same, apart, known


@given(st.integers(0, 10_000))
def test_the_order_of_the_parts_changes_no_edge(seed):
    rng = np.random.default_rng(seed)
    parts = [make_part(rng, number) for number in range(3)]
    one, other = joined(parts), joined([parts[order] for order in rng.permutation(3)])
    assert edges_of(one, unite(one, COLUMN)) == edges_of(other, unite(other, COLUMN))


@pytest.mark.parametrize("steps", [(3, -2, 1), (0, 0, 0), (-40, 7, 0)])
def test_a_map_moved_by_whole_voxels_keeps_all_evidence_about_neighbours(steps):
    part = make_part(np.random.default_rng(5), 0, count=100)
    voxels = VoxelMap(0.1)
    voxels.restore(part.xyz, part.rgb)
    neighbours = voxels.neighbours(np.arange(100, dtype=np.int32))
    moved = move_evidence(part.voxel + np.array(steps, np.int32), neighbours, part.evidence)
    is_there = np.tile(neighbours[:, 13:] >= 0, 2)
    assert np.array_equal(moved[:, CLASSES:-1], part.evidence[:, CLASSES:-1] * is_there)
    assert np.array_equal(moved[:, :CLASSES], part.evidence[:, :CLASSES])


def test_a_map_turned_by_a_right_angle_keeps_what_is_known_of_every_pair():
    part = make_part(np.random.default_rng(6), 0, count=100)
    voxels = VoxelMap(0.1)
    voxels.restore(part.xyz, part.rgb)
    neighbours = voxels.neighbours(np.arange(100, dtype=np.int32))
    turned = np.stack([-part.voxel[:, 1], part.voxel[:, 0], part.voxel[:, 2]], axis=1)
    evidence = move_evidence(turned, neighbours, part.evidence)
    assert pairs_of(turned, evidence) == pairs_of(part.voxel, part.evidence)


def pairs_of(voxel, evidence):
    """What is known of pairs of voxels, by their numbers."""
    number = {tuple(each): row for row, each in enumerate(voxel.tolist())}
    found = {}
    for row, each in enumerate(voxel.tolist()):
        for k, step in enumerate(FORWARD.tolist()):
            other = number.get(tuple(np.add(each, step).tolist()))
            if other is not None:
                known = evidence[row, [CLASSES + k, CLASSES + 13 + k]].tolist()
                found[frozenset((row, other))] = known
    return found
