"""Agreement of objects as clusters (IV-B, table II): NMI, AMI and ARI; truth first.

They are those of Vinh et al. (2010), taken from a sparse table of the points that true and
predicted clusters share; labels are compared by equality only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import sparse

# of the likeliest count's weight; what is left out stays far below rounding, even when n is large
_NEGLIGIBLE = 1e-25


@dataclass(frozen=True)
class ClusterScores:
    """Agreement of objects as clusters, classes ignored, on the points of true objects.

    Attributes:
        objects_true: True objects that have scored points.
        objects_pred: Predicted objects that have scored points.
        cluster_ratio: Predicted objects for each true one.
        nmi: Normalised mutual information, arithmetic mean.
        ami: Adjusted mutual information, arithmetic mean.
        ari: Adjusted Rand index.
        homogeneity: 1 if no predicted object spans true ones.
        completeness: 1 if no true object is in pieces.
        v_measure: Harmonic mean of the two.
    """

    objects_true: int
    objects_pred: int
    cluster_ratio: float
    nmi: float
    ami: float
    ari: float
    homogeneity: float
    completeness: float
    v_measure: float


def score_clusters(
    labels_true: NDArray[np.integer], labels_pred: NDArray[np.integer]
) -> ClusterScores:
    """Compare clusterings of the same points; every score is 0 without points.

    Args:
        labels_true: (N,) true object ids, all above 0.
        labels_pred: (N,) predicted object ids; points of 0, no object, are one cluster that is not
            counted.

    Returns:
        The scores.
    """
    if len(labels_true) == 0:
        return ClusterScores(0, 0, *[0.0] * 7)

    table = contingency(labels_true, labels_pred)
    objects_true, objects_pred = table.shape[0], table.shape[1] - int(labels_pred.min() <= 0)
    nmi, homogeneity, completeness = information_scores(table)
    return ClusterScores(
        objects_true=objects_true,
        objects_pred=objects_pred,
        cluster_ratio=objects_pred / objects_true,
        nmi=nmi,
        ami=adjusted_mutual_information(table),
        ari=adjusted_rand_index(table),
        homogeneity=homogeneity,
        completeness=completeness,
        v_measure=v_measure(homogeneity, completeness),
    )


def contingency(
    labels_true: NDArray[np.integer], labels_pred: NDArray[np.integer]
) -> sparse.csr_matrix:
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
        NMI, homogeneity, completeness, each in 0-1; 1 where an entropy is zero, as scikit-learn has
        it.
    """
    mutual, entropy_true, entropy_pred = _entropies(table)
    homogeneity = mutual / entropy_true if entropy_true > 0 else 1.0
    completeness = mutual / entropy_pred if entropy_pred > 0 else 1.0
    mean = (entropy_true + entropy_pred) / 2
    return (mutual / mean if mean > 0 else 1.0), homogeneity, completeness


def v_measure(homogeneity: float, completeness: float) -> float:
    """Harmonic mean of homogeneity and completeness, 0 when both are.

    It equals the NMI with arithmetic mean.
    """
    total = homogeneity + completeness
    return 2 * homogeneity * completeness / total if total > 0 else 0.0


def adjusted_rand_index(table: sparse.csr_matrix) -> float:
    """Rand index corrected for chance (Hubert and Arabie 1985).

    Args:
        table: From ``contingency``; not empty.

    Returns:
        ARI, at most 1; 1 when both sides are one trivial clustering.
    """
    # pairs of points in one cluster: of the truth, of the prediction, of both (exact integers)
    total = int(table.sum())
    same_true = int(np.sum(np.asarray(table.sum(axis=1)).astype(object) ** 2))
    same_pred = int(np.sum(np.asarray(table.sum(axis=0)).astype(object) ** 2))
    same_both = int(np.sum(table.data.astype(object) ** 2))
    pairs_true, pairs_pred = (same_true - total) / 2, (same_pred - total) / 2
    pairs_both = (same_both - total) / 2

    # against those expected by chance
    expected = pairs_true * pairs_pred / max(total * (total - 1) / 2, 1)
    largest = (pairs_true + pairs_pred) / 2
    return 1.0 if largest == expected else (pairs_both - expected) / (largest - expected)


def adjusted_mutual_information(table: sparse.csr_matrix) -> float:
    """Mutual information corrected for chance, over the mean entropy (Vinh 2010), as scikit-learn.

    Args:
        table: From ``contingency``; not empty.

    Returns:
        AMI, at most 1; 1 when both sides are the same clustering, 0 when one side only is a single
        cluster.
    """
    if table.nnz == table.shape[0] == table.shape[1]:
        return 1.0
    if 1 in table.shape:
        return 0.0
    mutual, entropy_true, entropy_pred = _entropies(table)
    expected = expected_mutual_information(table)
    return (mutual - expected) / ((entropy_true + entropy_pred) / 2 - expected)


def expected_mutual_information(table: sparse.csr_matrix) -> float:
    """Mean mutual information of all clusterings of these sizes, nats (Vinh 2010, equation 24a)."""
    rows, row_times = np.unique(np.asarray(table.sum(axis=1)).ravel(), return_counts=True)
    columns, column_times = np.unique(np.asarray(table.sum(axis=0)).ravel(), return_counts=True)
    largest = int(min(rows[-1], columns[-1]))
    logs = np.log(np.maximum(np.arange(largest + 1), 1))
    return float(_expected_sum(rows, row_times, columns, column_times, logs))


def _entropies(table: sparse.csr_matrix) -> tuple[float, float, float]:
    """Mutual information, entropy of the true and of the predicted clusters, in nats."""
    total = table.sum()
    joint = table.data / total
    p_true = np.asarray(table.sum(axis=1)).ravel() / total
    p_pred = np.asarray(table.sum(axis=0)).ravel() / total
    rows, columns = table.nonzero()
    mutual = float(np.sum(joint * (np.log(joint) - np.log(p_true[rows]) - np.log(p_pred[columns]))))
    entropy_true, entropy_pred = -float(p_true @ np.log(p_true)), -float(p_pred @ np.log(p_pred))
    return mutual, entropy_true, entropy_pred


@njit(cache=True)
def _expected_sum(
    rows: NDArray[np.int64],
    row_times: NDArray[np.int64],
    columns: NDArray[np.int64],
    column_times: NDArray[np.int64],
    logs: NDArray[np.float64],
) -> float:
    """Sum the expected terms over pairs of distinct cluster sizes, each as often as it occurs."""
    total = np.sum(rows * row_times)
    expected = 0.0
    for i in range(len(rows)):
        for j in range(len(columns)):
            term = _expected_term(rows[i], columns[j], total, logs)
            expected += row_times[i] * column_times[j] * term
    return expected


@njit(cache=True)
def _expected_term(a: int, b: int, total: int, logs: NDArray[np.float64]) -> float:
    """Mean of n / N log(N n / (a b)) for n points shared by clusters of a and b: hypergeometric.

    The weights go from the mode outwards by the ratio of neighbours until they vanish, then are
    divided by their sum: no factorials, so nothing is lost to rounding.
    """
    # the likeliest number of shared points
    low, high = max(0, a + b - total), min(a, b)
    mode = min(max((a + 1) * (b + 1) // (total + 2), low), high)
    offset = np.log(total / a) - np.log(float(b))
    weights = 1.0
    value = mode * (logs[mode] + offset)

    # more than that
    weight = 1.0
    for n in range(mode + 1, high + 1):
        weight *= (a - n + 1.0) * (b - n + 1.0) / (float(n) * (total - a - b + n))
        if weight < _NEGLIGIBLE:
            break
        weights += weight
        value += weight * n * (logs[n] + offset)

    # fewer
    weight = 1.0
    for n in range(mode - 1, low - 1, -1):
        weight *= (n + 1.0) * (total - a - b + n + 1.0) / ((a - n) * float(b - n))
        if weight < _NEGLIGIBLE:
            break
        weights += weight
        value += weight * n * (logs[n] + offset)
    return float(value / weights / total)
