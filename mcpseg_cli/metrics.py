"""Segmentation and clustering metrics (IV), truth first. Labels are compared by equality only."""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse


def confusion_matrix(
    labels_true: NDArray[np.integer], labels_pred: NDArray[np.integer], num_classes: int
) -> NDArray[np.int64]:
    """Count pairs of true and predicted class.

    Args:
        labels_true: (N,) class index below ``num_classes``.
        labels_pred: (N,) class index; values from ``num_classes`` on count in the last column.
        num_classes: C.

    Returns:
        (C, C + 1) int64: rows are true classes, columns predicted ones, the last column none of them.
    """
    predicted = np.minimum(labels_pred.astype(np.int64), num_classes)
    flat = labels_true.astype(np.int64) * (num_classes + 1) + predicted
    return np.bincount(flat, minlength=num_classes * (num_classes + 1)).reshape(num_classes, num_classes + 1)


def intersection_over_union(confusion: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return (C,) TP / (TP + FP + FN) by class; NaN for classes neither true nor predicted anywhere."""
    hits = np.diagonal(confusion).astype(np.float64)
    union = confusion.sum(axis=1) + confusion[:, : len(hits)].sum(axis=0) - hits
    iou: NDArray[np.float64] = np.divide(hits, union, out=np.full(len(hits), np.nan), where=union > 0)
    return iou


def class_accuracy(confusion: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return (C,) recall by class; NaN for classes with no true point."""
    total = confusion.sum(axis=1)
    hits = np.diagonal(confusion).astype(np.float64)
    recall: NDArray[np.float64] = np.divide(hits, total, out=np.full(len(hits), np.nan), where=total > 0)
    return recall


def contingency(labels_true: NDArray[np.integer], labels_pred: NDArray[np.integer]) -> sparse.csr_matrix:
    """Count pairs of true and predicted cluster in a sparse table, clusters by rising label."""
    _, rows = np.unique(labels_true, return_inverse=True)
    _, columns = np.unique(labels_pred, return_inverse=True)
    counts = sparse.coo_matrix((np.ones(len(rows), np.int64), (rows, columns)))
    return counts.tocsr()


def information_scores(table: sparse.csr_matrix) -> tuple[float, float, float]:
    """Normalised mutual information (arithmetic mean), homogeneity and completeness.

    Args:
        table: From ``contingency``; not empty.

    Returns:
        NMI, homogeneity, completeness, each in 0-1; 1 where an entropy is zero, as scikit-learn has it.
    """
    total = table.sum()
    joint = table.data / total
    p_true = np.asarray(table.sum(axis=1)).ravel() / total
    p_pred = np.asarray(table.sum(axis=0)).ravel() / total
    rows, columns = table.nonzero()
    mutual = float(np.sum(joint * (np.log(joint) - np.log(p_true[rows]) - np.log(p_pred[columns]))))
    entropy_true, entropy_pred = -float(p_true @ np.log(p_true)), -float(p_pred @ np.log(p_pred))
    homogeneity = mutual / entropy_true if entropy_true > 0 else 1.0
    completeness = mutual / entropy_pred if entropy_pred > 0 else 1.0
    mean = (entropy_true + entropy_pred) / 2
    return (mutual / mean if mean > 0 else 1.0), homogeneity, completeness


def adjusted_rand_index(table: sparse.csr_matrix) -> float:
    """Rand index corrected for chance (Hubert and Arabie 1985); 1 when both sides are one trivial clustering."""
    total = int(table.sum())
    same_true = int(np.sum(np.asarray(table.sum(axis=1)).astype(object) ** 2))
    same_pred = int(np.sum(np.asarray(table.sum(axis=0)).astype(object) ** 2))
    same_both = int(np.sum(table.data.astype(object) ** 2))
    pairs_true, pairs_pred, pairs_both = (same_true - total) / 2, (same_pred - total) / 2, (same_both - total) / 2
    expected = pairs_true * pairs_pred / max(total * (total - 1) / 2, 1)
    largest = (pairs_true + pairs_pred) / 2
    return 1.0 if largest == expected else (pairs_both - expected) / (largest - expected)
