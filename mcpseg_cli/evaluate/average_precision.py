"""Average precision of objects, ranked by confidence, as the ScanNet evaluator computes it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.evaluate.overlaps import Overlaps

MIN_POINTS = 100
"""Objects of fewer points are left out, as the ScanNet evaluator does."""

THRESHOLDS = tuple(percent / 100 for percent in range(50, 95, 5))
"""IoU of AP: 0.50 to 0.90; the evaluator's ``arange`` leaves out 0.95."""


@dataclass(frozen=True)
class AveragePrecision:
    """Average precision, mean over the classes that have a true object of enough points.

    Attributes:
        ap: Mean over the IoU thresholds 0.50, 0.55 … 0.90.
        ap50: At IoU 0.5.
        ap25: At IoU 0.25.
    """

    ap: float
    ap50: float
    ap25: float


def average_precision(overlaps: Overlaps, *, min_points: int = MIN_POINTS) -> AveragePrecision:
    """Rank the predicted objects of each class by confidence and average the precision over recall.

    A true object takes the predictions of its class with a larger IoU in the order of their ids:
    the most confident counts as right, the others as wrong. One prediction may meet several true
    objects at 0.25; the first by id takes it. Equal confidences enter the curve together, so their
    order does not matter. A prediction that meets nothing is left out if the share of it that is
    void or in small true objects of its class exceeds the threshold.

    Args:
        overlaps: From ``find_overlaps``; predicted sizes and unions count void points.
        min_points: Smallest object, true or predicted.

    Returns:
        The means; 0 if no class has a true object.
    """
    table = np.array(
        [_by_threshold(overlaps, label, min_points) for label in range(overlaps.num_classes)]
    )
    table = table[~np.isnan(table[:, 0])]
    if len(table) == 0:
        return AveragePrecision(0.0, 0.0, 0.0)
    ap25, *rest = (float(column) for column in table.mean(axis=0))
    return AveragePrecision(float(np.mean(rest)), rest[0], ap25)


def precision_over_recall(
    confidence: NDArray[np.float64], right: NDArray[np.bool_], num_missed: int
) -> float:
    """Area under the curve of precision over recall by trapezoids, from recall 0 at precision 1.

    Args:
        confidence: (P,) of predictions.
        right: (P,) whether each is right.
        num_missed: True objects that no prediction met.

    Returns:
        The area; equal confidences are one point of the curve, no prediction gives 0.
    """
    order = np.argsort(-confidence, kind="stable")
    last = np.flatnonzero(np.diff(confidence[order], append=-np.inf))  # of equal ones
    hits = np.cumsum(right[order])[last]
    recall = np.append(0.0, hits / max(int(right.sum()) + num_missed, 1))
    precision = np.append(1.0, hits / (last + 1))
    return float(np.sum(np.diff(recall) * (precision[1:] + precision[:-1]) / 2))


def _by_threshold(overlaps: Overlaps, label: int, min_points: int) -> list[float]:
    """Average precision of one class at IoU 0.25 and at ``THRESHOLDS``; NaN without true object."""
    # the objects that count, and predictions of their class that meet them
    true, pred = overlaps.true, overlaps.pred
    wanted = (true.semantic == label) & (true.size >= min_points)
    ranked = np.flatnonzero((pred.semantic == label) & (pred.size >= min_points))
    if not wanted.any():
        return [np.nan] * (1 + len(THRESHOLDS))
    pairs = np.flatnonzero(overlaps.same_class() & (pred.semantic[overlaps.columns] == label))
    pairs = pairs[pred.size[overlaps.columns[pairs]] >= min_points]
    rows, columns, shared = overlaps.rows[pairs], overlaps.columns[pairs], overlaps.shared[pairs]
    iou = shared / (true.size[rows] + pred.size[columns] - shared)

    # the share of a prediction that is void or in objects that do not count
    small = np.bincount(columns, shared * ~wanted[rows], len(pred))
    ignored = (pred.size - overlaps.valid + small)[ranked] / pred.size[ranked]

    areas = []
    for threshold in (0.25, *THRESHOLDS):
        met = iou > threshold
        hit = met & wanted[rows]
        best, wrong = _match(rows[hit], columns[hit], overlaps.confidence)
        stray = ranked[~np.isin(ranked, columns[met]) & (ignored <= threshold)]
        confidence = np.array([*best, *wrong, *overlaps.confidence[stray]])
        right = np.arange(len(confidence)) < len(best)
        areas.append(precision_over_recall(confidence, right, int(wanted.sum()) - len(best)))
    return areas


def _match(
    rows: NDArray[np.int64], columns: NDArray[np.int64], confidence: NDArray[np.float64]
) -> tuple[list[float], list[float]]:
    """Give each true object its predictions; confidences of those that are right, and too many."""
    best: dict[int, float] = {}
    wrong: list[float] = []
    taken: set[int] = set()

    # a prediction too many stays free for the next true object, as in the evaluator
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        score = float(confidence[column])
        if column in taken:
            continue
        if row in best:
            wrong.append(min(best[row], score))
            best[row] = max(best[row], score)
        else:
            best[row] = score
            taken.add(column)
    return list(best.values()), wrong
