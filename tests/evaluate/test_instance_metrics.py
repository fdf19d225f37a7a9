"""Metrics of objects against slow twins over sets of points, and cases counted by hand."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.evaluate.average_precision import (
    THRESHOLDS,
    average_precision,
    precision_over_recall,
)
from mcpseg_cli.evaluate.coverage import coverage
from mcpseg_cli.evaluate.object_scores import object_accuracy, precision_50
from mcpseg_cli.evaluate.overlaps import PointLabels, find_overlaps, join_overlaps
from mcpseg_cli.evaluate.panoptic import panoptic_quality

NUM_CLASSES = 3
MIN_POINTS = 3


@st.composite
def scenes(draw):
    """Labels of a few dozen points, true and predicted, some unknown or none; unit, confidence."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    size = int(rng.integers(1, 90))
    classes = np.array([0, 1, 2, 1, 0, 2, UNKNOWN, 1])

    # objects, in predictions joined and strewn with others
    instance_true = np.sort(rng.integers(0, 8, size))
    is_noise = rng.random(size) < rng.choice([0.0, 0.2, 0.6])
    noise = rng.integers(0, 12, size)
    instance_pred = np.where(is_noise, noise, instance_true // rng.integers(1, 3) + 3)

    # their classes, a fifth of the predicted ones at random
    true = PointLabels(np.where(rng.random(size) < 0.05, 0, classes[instance_true]), instance_true)
    is_noise = rng.random(size) < 0.2
    noise = rng.choice([0, 1, 2, UNKNOWN], size)
    semantic_pred = np.where(is_noise, noise, classes[instance_pred % 8])

    unit = np.sort(rng.integers(0, 2, size)) * 7
    return true, PointLabels(semantic_pred, instance_pred), unit, rng.choice([0.25, 0.5, 1.0], size)


def vote(points, semantic):
    counts = Counter(int(label) for label in semantic[sorted(points)] if label < NUM_CLASSES)
    return min(counts, key=lambda label: (-counts[label], label)) if counts else UNKNOWN


def objects_of(labels, unit):
    keys = sorted(
        {(u, i) for u, i in zip(unit.tolist(), labels.instance.tolist(), strict=True) if i > 0}
    )
    sets = [set(np.flatnonzero((unit == u) & (labels.instance == i)).tolist()) for u, i in keys]
    return [
        (points, vote(points, labels.semantic), u)
        for points, (u, _) in zip(sets, keys, strict=True)
    ]


def known_objects(true, pred, unit):
    trues = [obj for obj in objects_of(true, unit) if obj[1] != UNKNOWN]
    return trues, objects_of(pred, unit), set().union(*[points for points, _, _ in trues])


def iou_of(a, b):
    return len(a & b) / len(a | b)


def mean(values):
    return sum(values) / len(values) if values else 0.0


def slow_quality(trues, preds, valid):
    scores = []
    for label in range(NUM_CLASSES):
        own = [points for points, semantic, _ in trues if semantic == label]
        theirs = [points for points, semantic, _ in preds if semantic == label]
        ious = [iou_of(a, b & valid) for a in own for b in theirs if iou_of(a, b & valid) > 0.5]
        loose = [b for b in theirs if not any(iou_of(a, b & valid) > 0.5 for a in own)]
        wrong = sum(len(b - valid) <= len(b) / 2 for b in loose)
        denominator = len(ious) + 0.5 * wrong + 0.5 * (len(own) - len(ious))
        if denominator:
            scores.append((sum(ious) / denominator, mean(ious), len(ious) / denominator))
    return [mean([score[part] for score in scores]) for part in range(3)]


def slow_precision(trues, preds, confidence, valid, threshold):
    areas = []
    for label in range(NUM_CLASSES):
        own = [points for points, semantic, _ in trues if semantic == label]
        large = [points for points in own if len(points) >= MIN_POINTS]
        theirs = [
            (b, c)
            for (b, s, _), c in zip(preds, confidence, strict=True)
            if s == label and len(b) >= MIN_POINTS
        ]
        if not large:
            continue

        # true objects take their predictions in the order of ids
        scores, missed, taken = [], 0, []
        for a in large:
            current = None
            for number, (b, score) in enumerate(theirs):
                if number in taken or iou_of(a, b) <= threshold:
                    continue
                if current is None:
                    current = score
                    taken.append(number)
                else:
                    scores.append((min(current, score), False))
                    current = max(current, score)
            if current is None:
                missed += 1
            else:
                scores.append((current, True))

        # predictions that meet nothing, unless most of them is void
        for b, score in theirs:
            if not any(iou_of(a, b) > threshold for a in own):
                ignored = len(b - valid) + sum(len(a & b) for a in own if len(a) < MIN_POINTS)
                if ignored / len(b) <= threshold:
                    scores.append((score, False))
        areas.append(slow_area(scores, missed))
    return mean(areas)


def slow_area(scores, missed):
    """The evaluator's sum: precision at thresholds, times half the recall between neighbours."""
    curve = []
    for least in sorted({score for score, _ in scores}):
        kept = [right for score, right in scores if score >= least]
        total = sum(right for _, right in scores) + missed
        curve.append((sum(kept) / len(kept), sum(kept) / total))
    curve.append((1.0, 0.0))
    recall = [curve[0][1], *[point[1] for point in curve], 0.0]
    return sum(point[0] * (recall[k] - recall[k + 2]) / 2 for k, point in enumerate(curve))


def slow_coverage(trues, preds, valid):
    preds = [(b & valid, semantic, unit) for b, semantic, unit in preds if b & valid]
    best = [
        max([iou_of(a, b) for b, t, v in preds if (t, v) == (s, u)], default=0.0)
        for a, s, u in trues
    ]

    covered, weighted, right, found = [], [], [], []
    for label in range(NUM_CLASSES):
        # coverage, room by room
        rooms = []
        for room in {u for _, s, u in trues if s == label}:
            own = [
                (len(a), iou)
                for (a, s, u), iou in zip(trues, best, strict=True)
                if (s, u) == (label, room)
            ]
            weight = sum(size * iou for size, iou in own) / sum(size for size, _ in own)
            rooms.append((mean([iou for _, iou in own]), weight))

        # precision and recall, all rooms together
        same = [a for a, s, _ in trues if s == label]
        hits = [
            max([iou_of(a, b) for a in same], default=0) >= 0.5 for b, t, _ in preds if t == label
        ]
        right += [mean(hits)] if hits or rooms else []
        if rooms:
            covered.append(mean([room[0] for room in rooms]))
            weighted.append(mean([room[1] for room in rooms]))
            found.append(
                mean([iou >= 0.5 for (_, s, _), iou in zip(trues, best, strict=True) if s == label])
            )
    return mean(covered), mean(weighted), mean(right), mean(found)


@settings(max_examples=200, deadline=None)
@given(scenes())
def test_panoptic_quality_equals_a_slow_twins(scene):
    true, pred, unit, _ = scene
    quality = panoptic_quality(find_overlaps(true, pred, NUM_CLASSES, unit=unit))
    assert [quality.pq, quality.sq, quality.rq] == pytest.approx(
        slow_quality(*known_objects(true, pred, unit))
    )


@settings(max_examples=200, deadline=None)
@given(scenes())
def test_coverage_equals_a_slow_twins(scene):
    true, pred, unit, _ = scene
    scores = coverage(find_overlaps(true, pred, NUM_CLASSES, unit=unit))
    assert (scores.mcov, scores.mwcov, scores.mprec, scores.mrec) == pytest.approx(
        slow_coverage(*known_objects(true, pred, unit))
    )


@settings(max_examples=200, deadline=None)
@given(scenes())
def test_average_precision_equals_a_slow_twins(scene):
    true, pred, unit, confidence = scene
    overlaps = find_overlaps(true, pred, NUM_CLASSES, unit=unit, confidence=confidence)
    trues, preds, valid = known_objects(true, pred, unit)
    voters = [[i for i in sorted(b) if pred.semantic[i] == label] for b, label, _ in preds]
    means = [float(np.mean(confidence[of])) if of else 0.0 for of in voters]
    scores = average_precision(overlaps, min_points=MIN_POINTS)
    slow = {at: slow_precision(trues, preds, means, valid, at) for at in (0.25, *THRESHOLDS)}
    assert (scores.ap25, scores.ap50) == pytest.approx((slow[0.25], slow[0.5]))
    assert scores.ap == pytest.approx(mean([slow[at] for at in THRESHOLDS]))


def scene_of(*groups):
    """Labels of groups of (points, true class, true object, predicted class, predicted object)."""
    table = np.concatenate([np.tile(group[1:], (group[0], 1)) for group in groups])
    return PointLabels(table[:, 0], table[:, 1]), PointLabels(table[:, 2], table[:, 3])


def test_object_accuracy_counts_true_objects_met_by_a_larger_prediction_of_their_class():
    true, pred = scene_of(
        (60, 0, 1, 0, 1), (40, 0, 1, 0, 2), (60, 1, 2, 2, 3), (50, 2, 3, 2, 4), (51, 2, 4, 2, 5)
    )
    overlaps = find_overlaps(true, pred, 3)
    # object 2 has another class, object 3 only 50 points
    assert object_accuracy(overlaps) == 2 / 4
    assert precision_50(overlaps) == 3 / 5


def test_points_without_true_object_do_not_count_against_a_prediction():
    true, pred = scene_of((60, 0, 1, 0, 1), (100, 0, 0, 0, 1), (70, UNKNOWN, 5, 0, 1))
    overlaps = find_overlaps(true, pred, 3)
    assert (
        object_accuracy(overlaps) == precision_50(overlaps) == panoptic_quality(overlaps).pq == 1.0
    )


def test_an_iou_of_one_half_is_no_match_but_covers():
    overlaps = find_overlaps(*scene_of((60, 0, 1, 0, 1), (60, 0, 1, 0, 2)), 3)
    assert object_accuracy(overlaps) == panoptic_quality(overlaps).pq == 0.0
    assert coverage(overlaps).mrec == coverage(overlaps).mprec == 1.0


def test_panoptic_quality_by_hand():
    overlaps = find_overlaps(*scene_of((80, 0, 1, 0, 1), (20, 0, 1, 0, 2), (10, 0, 2, 0, 3)), 2)
    quality = panoptic_quality(overlaps)
    assert (quality.pq, quality.sq, quality.rq) == pytest.approx((1.8 / 2.5, 0.9, 2 / 2.5))
    assert np.isnan(quality.by_class[1])


def test_pieces_of_stuff_count_as_one():
    true, pred = scene_of((50, 0, 1, 0, 1), (50, 0, 1, 0, 2), (40, 0, 2, 0, 2), (60, 0, 2, 1, 3))
    overlaps = find_overlaps(true, pred, 2)
    assert panoptic_quality(overlaps).pq == 0.0
    stuff = panoptic_quality(overlaps, stuff=(0,))
    assert stuff.by_class == pytest.approx([0.7, 0.0])
    assert stuff.pq_dagger == pytest.approx(0.35)


def test_stuff_that_meets_less_than_half_counts_in_pq_dagger_only():
    overlaps = find_overlaps(*scene_of((40, 0, 1, 0, 1), (60, 0, 1, 1, 2)), 2)
    stuff = panoptic_quality(overlaps, stuff=(0,))
    assert (stuff.pq, stuff.pq_dagger) == pytest.approx((0.0, 0.2))


def test_average_precision_by_hand():
    # Right at 0.9, wrong at 0.8, right at 0.7, one of three missed: points (1/3, 1), (1/3, 1/2),
    # (2/3, 2/3).
    area = precision_over_recall(np.array([0.7, 0.9, 0.8]), np.array([True, True, False]), 1)
    assert area == pytest.approx(1 / 3 + (1 / 2 + 2 / 3) / 2 / 3)


def test_equal_confidences_rank_together():
    for wrong in range(3):
        area = precision_over_recall(np.array([0.5, 0.5, 0.5]), np.arange(3) != wrong, 0)
        assert area == pytest.approx((1 + 2 / 3) / 2)


def test_small_objects_have_no_average_precision():
    overlaps = find_overlaps(*scene_of((99, 0, 1, 0, 1), (100, 1, 2, 1, 2)), 2)
    assert average_precision(overlaps).ap == 1.0
    assert average_precision(find_overlaps(*scene_of((99, 0, 1, 0, 1)), 2)).ap == 0.0


def ap25_of(confidence, *groups):
    """AP25 of groups as for ``scene_of``, with the confidence of each."""
    true, pred = scene_of(*groups)
    points = np.repeat(confidence, [group[0] for group in groups])
    return average_precision(find_overlaps(true, pred, 2, confidence=points)).ap25


def test_the_less_confident_of_two_predictions_of_an_object_is_wrong():
    assert ap25_of([0.4, 0.8], (100, 0, 1, 0, 1), (100, 0, 1, 0, 2)) == 1.0
    halves = (100, 0, 1, 0, 1), (100, 0, 1, 0, 2), (100, 0, 2, 0, 3)
    assert ap25_of([0.4, 0.8, 0.2], *halves) == pytest.approx(1 / 2 + (1 / 2 + 2 / 3) / 2 / 2)


def test_a_prediction_that_spans_two_objects_finds_one():
    assert ap25_of([0.9, 0.9], (100, 0, 1, 0, 1), (100, 0, 2, 0, 1)) == 0.5


def test_a_prediction_partly_in_a_small_object_of_its_class_is_left_out():
    right, small = (100, 0, 1, 0, 1), (64, 0, 2, 0, 0)
    assert ap25_of([0.5, 0.9, 0.9, 0.9], right, small, (35, 0, 2, 0, 2), (65, 1, 3, 0, 2)) == 1.0
    wrong = ap25_of([0.5, 0.9, 0.9, 0.9], right, small, (20, 0, 2, 0, 2), (80, 1, 3, 0, 2))
    assert wrong == pytest.approx((0 + 1 / 2) / 2)


def test_maps_without_objects_score_zero():
    overlaps = find_overlaps(*scene_of((5, 0, 0, 0, 0)), 2)
    assert (
        panoptic_quality(overlaps, stuff=(0,)).pq
        == object_accuracy(overlaps)
        == precision_50(overlaps)
        == 0.0
    )
    assert average_precision(overlaps).ap50 == coverage(overlaps).mcov == 0.0


@settings(max_examples=50, deadline=None)
@given(scenes())
def test_renumbering_the_objects_and_shuffling_the_points_changes_nothing(scene):
    true, pred, unit, confidence = scene
    first = find_overlaps(true, pred, NUM_CLASSES, unit=unit, confidence=confidence)

    # the same points in another order, the objects with other ids
    order = np.random.default_rng(0).permutation(len(unit))
    ids = np.where(pred.instance[order] > 0, 1000 - pred.instance[order], 0)
    true = PointLabels(true.semantic[order], true.instance[order])
    pred = PointLabels(pred.semantic[order], ids)
    second = find_overlaps(true, pred, NUM_CLASSES, unit=unit[order], confidence=confidence[order])

    qualities = [panoptic_quality(overlaps, stuff=(1,)).pq for overlaps in (first, second)]
    precisions = [average_precision(overlaps, min_points=1).ap for overlaps in (first, second)]
    assert qualities[0] == pytest.approx(qualities[1])
    assert precisions[0] == pytest.approx(precisions[1])
    assert coverage(first).mwcov == pytest.approx(coverage(second).mwcov)


def pixels(text, void="2"):
    """Labels from words of category and number: 0 and 1 are things, 6 and 7 stuff, void unknown."""
    words = text.split()
    classes = {"0": 0, "1": 1, "6": 2, "7": 3, void: UNKNOWN}
    return PointLabels(
        np.array([classes[word[0]] for word in words]),
        np.array([10 * int(word[0]) + int(word[1]) + 1 for word in words]),
    )


def test_the_panoptic_example_of_torchmetrics_has_the_published_qualities():
    pred = pixels("60 00 60 60  00 00 60 01  00 00 60 01  00 70 60 10  00 70 70 70")
    true = pixels("60 01 60 01  01 01 60 01  01 01 60 10  01 70 10 10  01 70 70 70")
    quality = panoptic_quality(find_overlaps(true, pred, 4), stuff=(2, 3))
    assert (quality.pq, quality.sq, quality.rq) == pytest.approx((0.5463, 0.6111, 0.6667), abs=5e-5)
    assert quality.by_class == pytest.approx([0.5185, 0.0, 0.6667, 1.0], abs=5e-5)


def test_the_modified_panoptic_example_of_torchmetrics_has_the_published_quality():
    overlaps = find_overlaps(pixels("01 00 60 70 60 20"), pixels("00 01 60 70 02 10"), 4)
    assert panoptic_quality(overlaps, stuff=(2, 3)).pq_dagger == pytest.approx(0.7667, abs=5e-5)


def test_without_classes_a_prediction_of_another_class_is_right():
    overlaps = find_overlaps(*scene_of((100, 0, 1, 1, 1), (100, 1, 2, UNKNOWN, 2)), 2)
    assert average_precision(overlaps).ap == 0.0
    assert average_precision(overlaps.without_classes()).ap == 1.0


@settings(max_examples=60, deadline=None)
@given(scenes())
def test_joined_places_equal_units_of_one(scene):
    # the whole with units, and each unit by itself
    true, pred, unit, confidence = scene
    parts = [unit == number for number in np.unique(unit)]
    whole = find_overlaps(true, pred, NUM_CLASSES, unit=unit, confidence=confidence)
    apart = [
        find_overlaps(
            PointLabels(true.semantic[part], true.instance[part]),
            PointLabels(pred.semantic[part], pred.instance[part]),
            NUM_CLASSES,
            confidence=confidence[part],
        )
        for part in parts
    ]

    joined = join_overlaps(apart)
    assert panoptic_quality(joined).pq == pytest.approx(panoptic_quality(whole).pq)
    assert average_precision(joined, min_points=1).ap == pytest.approx(
        average_precision(whole, min_points=1).ap
    )
    assert (joined.rows.tolist(), joined.columns.tolist()) == (
        whole.rows.tolist(),
        whole.columns.tolist(),
    )
