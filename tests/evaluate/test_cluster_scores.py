"""Metrics against scikit-learn and cases counted by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn import metrics as sklearn_metrics

from mcpseg_cli.evaluate.class_scores import (
    class_accuracy,
    confusion_matrix,
    intersection_over_union,
)
from mcpseg_cli.evaluate.cluster_scores import (
    adjusted_mutual_information,
    adjusted_rand_index,
    contingency,
    information_scores,
    v_measure,
)

labellings = st.integers(1, 80).flatmap(
    lambda size: st.tuples(
        *[st.lists(st.integers(1, 6), min_size=size, max_size=size) for _ in range(2)]
    )
)


@settings(max_examples=150, deadline=None)
@given(labellings)
def test_cluster_scores_equal_scikit_learns(pair):
    labels_true, labels_pred = map(np.array, pair)
    table = contingency(labels_true, labels_pred)
    nmi, homogeneity, completeness = information_scores(table)
    assert nmi == pytest.approx(sklearn_metrics.normalized_mutual_info_score(*pair), abs=1e-9)
    assert homogeneity == pytest.approx(sklearn_metrics.homogeneity_score(*pair), abs=1e-9)
    assert completeness == pytest.approx(sklearn_metrics.completeness_score(*pair), abs=1e-9)
    assert v_measure(homogeneity, completeness) == pytest.approx(
        sklearn_metrics.v_measure_score(*pair), abs=1e-9
    )
    assert adjusted_rand_index(table) == pytest.approx(
        sklearn_metrics.adjusted_rand_score(*pair), abs=1e-9
    )


def test_the_confusion_matrix_counts_true_rows_and_predicted_columns():
    confusion = confusion_matrix(np.array([0, 0, 1, 2]), np.array([0, 1, 1, 255]), 3)
    assert confusion.tolist() == [[1, 1, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]]


def test_iou_is_hits_over_union_and_nan_for_classes_nowhere_to_be_seen():
    confusion = confusion_matrix(np.array([0, 0, 1, 1]), np.array([0, 1, 1, 1]), 3)
    np.testing.assert_allclose(intersection_over_union(confusion), [1 / 2, 2 / 3, np.nan])
    np.testing.assert_allclose(class_accuracy(confusion), [1 / 2, 1, np.nan])


def test_a_point_without_predicted_class_counts_against_its_true_class():
    confusion = confusion_matrix(np.array([1, 1]), np.array([1, 255]), 2)
    np.testing.assert_allclose(intersection_over_union(confusion), [np.nan, 1 / 2])


@settings(max_examples=200, deadline=None)
@given(labellings)
def test_adjusted_mutual_information_equals_scikit_learns(pair):
    ami = adjusted_mutual_information(contingency(*map(np.array, pair)))
    assert ami == pytest.approx(sklearn_metrics.adjusted_mutual_info_score(*pair), abs=1e-9)


@pytest.mark.parametrize("clusters", [(2, 3), (40, 900), (1500, 1500), (3000, 5)])
def test_adjusted_mutual_information_equals_scikit_learns_on_thousands_of_points(clusters):
    rng = np.random.default_rng(clusters[0])
    labels_true = (clusters[0] * rng.random(3000) ** 3).astype(int)
    labels_pred = np.where(
        rng.random(3000) < 0.7, labels_true, clusters[0] + rng.integers(clusters[1], size=3000)
    )
    ami = adjusted_mutual_information(contingency(labels_true, labels_pred))
    assert ami == pytest.approx(
        sklearn_metrics.adjusted_mutual_info_score(labels_true, labels_pred), abs=1e-9
    )


@pytest.mark.parametrize(
    ("labels_true", "labels_pred", "expected"),
    [
        ([1, 1, 1], [2, 2, 2], 1.0),
        ([1], [9], 1.0),
        ([1, 2, 3], [3, 1, 2], 1.0),
        ([1, 1, 1], [1, 2, 3], 0.0),
        ([1, 2, 3], [1, 1, 1], 0.0),
        ([1, 1, 2, 2], [1, 2, 3, 4], 0.0),
    ],
)
def test_adjusted_mutual_information_of_trivial_clusterings(labels_true, labels_pred, expected):
    table = contingency(np.array(labels_true), np.array(labels_pred))
    assert adjusted_mutual_information(table) == pytest.approx(expected, abs=1e-12)
    assert sklearn_metrics.adjusted_mutual_info_score(labels_true, labels_pred) == pytest.approx(
        expected, abs=1e-9
    )
