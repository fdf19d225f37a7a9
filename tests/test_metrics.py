"""Metrics against scikit-learn and cases counted by hand."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn import metrics as sklearn_metrics

from mcpseg_cli.metrics import (
    adjusted_rand_index,
    class_accuracy,
    confusion_matrix,
    contingency,
    information_scores,
    intersection_over_union,
)

labellings = st.integers(1, 80).flatmap(
    lambda size: st.tuples(*[st.lists(st.integers(1, 6), min_size=size, max_size=size) for _ in range(2)])
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
    assert adjusted_rand_index(table) == pytest.approx(sklearn_metrics.adjusted_rand_score(*pair), abs=1e-9)


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
