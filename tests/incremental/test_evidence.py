"""Evidence of many looks: whole numbers that never overflow, whatever the order."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.incremental.evidence import Evidence, Look

CLASSES = 5
MOST = 65535


def make_look(
    seed: int, num_voxels: int = 20, count: int = 12, affinity: bool = True, weight=None
) -> Look:
    """A random look at some of the voxels."""
    rng = np.random.default_rng(seed)
    ids = rng.permutation(num_voxels)[:count].astype(np.int32)
    probability = rng.dirichlet(np.full(CLASSES, 0.3), len(ids)).astype(np.float32)
    worth = rng.random(len(ids)).astype(np.float32)
    pairs = rng.random((len(ids), 13)).astype(np.float32)
    pairs[rng.random(pairs.shape) < 0.4] = np.nan
    return Look(
        ids,
        probability,
        worth if weight is None else np.full(len(ids), weight, np.float32),
        pairs if affinity else None,
    )


def made_of(looks, num_voxels: int = 20) -> Evidence:
    evidence = Evidence(CLASSES)
    evidence.extend(num_voxels)
    for look in looks:
        evidence.add(look)
    return evidence


def halved(values: list[int]) -> list[int]:
    return [value // 2 for value in values] if max(values) > MOST - 255 else values


def slow_sums(looks, num_voxels: int = 20) -> tuple[list, list, list]:
    """Sums number by number: of classes, of pairs together, of pairs apart."""
    of_class = [[0] * CLASSES for _ in range(num_voxels)]
    pairs = [[[0, 0] for _ in range(13)] for _ in range(num_voxels)]
    one, unit = np.float32(0.5), np.float32(255)
    for look in looks:
        for row, i in enumerate(look.ids.tolist()):
            weight = look.weight[row]
            said = [int(weight * each * unit + one) for each in look.probability[row]]
            of_class[i] = [a + b for a, b in zip(halved(of_class[i]), said, strict=True)]
            for k, share in enumerate([] if look.affinity is None else look.affinity[row]):
                if np.isnan(share):
                    continue
                together, apart = halved(pairs[i][k])
                counted = weight * share * unit + one
                rest = weight * unit + np.float32(1) - counted
                pairs[i][k] = [together + int(counted), apart + int(rest)]
    together, apart = ([[p[side] for p in row] for row in pairs] for side in (0, 1))
    return of_class, together, apart


def sums_of(evidence: Evidence) -> list[np.ndarray]:
    return [evidence.of_class, evidence.together, evidence.apart]


def assert_nearly(evidence: Evidence, slow, looks: int) -> None:
    """Compare; a sum that is a half exactly may be rounded otherwise in another precision."""
    for ours, theirs in zip(sums_of(evidence), slow, strict=True):
        assert np.abs(ours.astype(int) - np.array(theirs)).max() <= looks // 50 + 1
        assert (ours == np.array(theirs)).mean() > 0.95


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(0, 6))
def test_sums_are_those_counted_one_by_one(seed, count):
    looks = [make_look(seed + each, affinity=bool(each % 3)) for each in range(count)]
    assert_nearly(made_of(looks), slow_sums(looks), count)


def test_sums_that_grow_too_large_are_halved_as_when_counted_one_by_one():
    looks = [make_look(each % 7, 3, 3, weight=1.0) for each in range(800)]
    evidence = made_of(looks, 3)
    for ours, theirs in zip(sums_of(evidence), slow_sums(looks, 3), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0.02, atol=60)


@settings(max_examples=25, deadline=None)
@given(order=st.permutations(range(8)), seed=st.integers(0, 10**6))
def test_the_order_of_looks_does_not_matter_before_anything_is_halved(order, seed):
    looks = [make_look(seed + each) for each in range(8)]
    one, other = made_of(looks), made_of([looks[each] for each in order])
    for left, right in zip(sums_of(one), sums_of(other), strict=True):
        np.testing.assert_array_equal(left, right)


@settings(max_examples=20, deadline=None)
@given(
    probability=st.lists(st.floats(0, 1), min_size=CLASSES, max_size=CLASSES).filter(any),
    affinity=st.floats(0, 1),
    repeats=st.integers(1, 3000),
)
def test_no_number_of_looks_overflows(probability, affinity, repeats):
    share = (np.array([probability]) / sum(probability)).astype(np.float32)
    look = Look(
        np.zeros(1, np.int32),
        np.clip(share, 0, 1),
        np.ones(1, np.float32),
        np.full((1, 13), affinity, np.float32),
    )
    evidence, before = made_of([], 1), None
    for _ in range(repeats):
        before = [each.astype(int).max() for each in sums_of(evidence)]
        evidence.add(look)
        for was, now in zip(before, sums_of(evidence), strict=True):
            assert now.max() >= was // 2  # a sum that wrapped around would be small
    favourite = evidence.of_class[0].argmax()
    assert share[0, favourite] >= share.max() - 1 / 255


def test_halving_keeps_what_is_decided():
    looks = [make_look(each % 5, weight=1.0) for each in range(1, 1500)]
    evidence = made_of(looks)
    before = evidence.of_class.copy()
    seen = np.flatnonzero(before.any(axis=1)).astype(np.int32)
    halves = Evidence(CLASSES)
    rows = evidence.rows(0, 20)
    rows[:, :CLASSES] >>= 1
    halves.restore(rows)
    for one, other in zip(evidence.labels(seen), halves.labels(seen), strict=True):
        np.testing.assert_allclose(one, other, atol=0.0101)  # confidence is in hundredths


def test_the_class_with_the_most_evidence_wins_and_the_lowest_of_equals():
    evidence = made_of([], 3)
    evidence.of_class[:] = [[0, 7, 0, 7, 0], [1, 0, 0, 0, 3], [0, 0, 5, 0, 0]]
    semantic, confidence = evidence.labels(np.array([2, 0, 1], np.int32))
    assert semantic.tolist() == [2, 1, 4]
    np.testing.assert_allclose(confidence, [1, 0.5, 0.75])
    assert (semantic.dtype, confidence.dtype) == (np.uint8, np.float32)


def test_a_look_worth_more_counts_more():
    surely, hardly = np.float32([[0.9, 0.1, 0, 0, 0]]), np.float32([[0, 1, 0, 0, 0]])
    looks = [
        Look(np.zeros(1, np.int32), surely, np.ones(1, np.float32)),
        Look(np.zeros(1, np.int32), hardly, np.full(1, 0.2, np.float32)),
    ]
    assert made_of(looks, 1).labels(np.zeros(1, np.int32))[0].tolist() == [0]


def test_all_that_is_known_reads_back():
    evidence = made_of([make_look(each) for each in range(9)])
    evidence.count_looks(np.arange(0, 20, 3, dtype=np.int32))
    again = Evidence(CLASSES)
    for start, stop in ((0, 7), (7, 7), (7, 20)):
        again.restore(evidence.rows(start, stop))
    assert len(again) == len(evidence) == 20
    for left, right in zip(sums_of(evidence), sums_of(again), strict=True):
        np.testing.assert_array_equal(left, right)
    np.testing.assert_array_equal(again.looks, evidence.looks)


def test_evidence_about_other_classes_is_refused():
    with pytest.raises(ValueError, match="other classes"):
        Evidence(CLASSES + 1).restore(made_of([]).rows(0, 20))


def test_looks_are_counted_up_to_what_fits():
    evidence = made_of([], 2)
    evidence.count_looks(np.array([1], np.int32))
    evidence.looks[0] = MOST
    evidence.count_looks(np.array([0, 1], np.int32))
    assert evidence.looks.tolist() == [MOST, 2]


def test_what_a_look_says_about_some_voxels():
    look = make_look(3)
    rows = look.ids % 2 == 0
    part = look.of(rows)
    np.testing.assert_array_equal(part.ids, look.ids[rows])
    np.testing.assert_array_equal(part.affinity, look.affinity[rows])
    assert make_look(3, affinity=False).of(rows).affinity is None


def test_a_look_at_nothing_changes_nothing():
    evidence = made_of([make_look(1)])
    before = evidence.rows(0, 20)
    evidence.add(make_look(2, count=0))
    np.testing.assert_array_equal(evidence.rows(0, 20), before)
