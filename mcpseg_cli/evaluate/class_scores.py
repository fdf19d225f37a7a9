"""Agreement of classes (IV-A, table I): confusion, IoU, accuracy, calibration; truth first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.reliability import Reliability, measure_reliability

_ROUNDING = 1e-3  # of probabilities, which float16 may round up


@dataclass(frozen=True)
class ClassScores:
    """Agreement of classes.

    Attributes:
        point_accuracy: Share of right points.
        mean_class_accuracy: Mean recall of the classes that have a true point.
        miou: Mean IoU of all classes of the table; one that is nowhere counts 0.
        miou_present: Mean IoU of the classes that have a true point.
        iou: IoU by class name; None for a class that is nowhere, true or predicted.
    """

    point_accuracy: float
    mean_class_accuracy: float
    miou: float
    miou_present: float
    iou: dict[str, float | None]


def score_classes(confusion: NDArray[np.int64], classes: tuple[str, ...]) -> ClassScores:
    """Compute the class metrics.

    Args:
        confusion: (C, C + 1) from ``confusion_matrix``.
        classes: C names.

    Returns:
        The scores; all 0 without points.
    """
    # class by class
    iou, accuracy = intersection_over_union(confusion), class_accuracy(confusion)
    named = zip(classes, iou.tolist(), strict=True)
    counted = np.nan_to_num(iou)

    # means over the classes that have a true point
    present = confusion.sum(axis=1) > 0
    any_present = bool(present.any())
    return ClassScores(
        point_accuracy=float(np.trace(confusion) / max(confusion.sum(), 1)),
        mean_class_accuracy=float(accuracy[present].mean()) if any_present else 0.0,
        miou=float(counted.mean()),
        miou_present=float(counted[present].mean()) if any_present else 0.0,
        iou={name: None if np.isnan(value) else value for name, value in named},
    )


def confusion_matrix(
    labels_true: NDArray[np.integer], labels_pred: NDArray[np.integer], num_classes: int
) -> NDArray[np.int64]:
    """Count pairs of true and predicted class.

    Args:
        labels_true: (N,) class index below ``num_classes``.
        labels_pred: (N,) class index; values from ``num_classes`` on count in the last column.
        num_classes: C.

    Returns:
        (C, C + 1) int64: rows are true classes, columns predicted ones, the last column none of
        them.
    """
    predicted = np.minimum(labels_pred.astype(np.int64), num_classes)
    flat = labels_true.astype(np.int64) * (num_classes + 1) + predicted
    return np.bincount(flat, minlength=num_classes * (num_classes + 1)).reshape(
        num_classes, num_classes + 1
    )


def score_confidence(
    labels_true: NDArray[np.integer],
    labels_pred: NDArray[np.integer],
    confidence: NDArray[np.float64] | None,
    num_classes: int,
) -> Reliability | None:
    """Compare confidence with the share of right classes, where both sides have a class.

    Args:
        labels_true: (N,) class index, 255 unknown.
        labels_pred: (N,) class index; values from ``num_classes`` on are none.
        confidence: (N,), if known.
        num_classes: C.

    Returns:
        The bins; None without such a point, or without confidence that can be probabilities.
    """
    known = (labels_true != UNKNOWN) & (labels_pred < num_classes)
    if confidence is None or not known.any() or not is_probability(confidence):
        return None
    return measure_reliability(confidence[known], (labels_true == labels_pred)[known])


def is_probability(confidence: NDArray[np.float64]) -> bool:
    """Tell whether all values can be probabilities; other programs write percent, or logits."""
    return bool(((confidence >= 0) & (confidence <= 1 + _ROUNDING)).all())


def intersection_over_union(confusion: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return (C,) TP / (TP + FP + FN) by class; NaN for classes that neither side has."""
    hits = np.diagonal(confusion).astype(np.float64)
    union = confusion.sum(axis=1) + confusion[:, : len(hits)].sum(axis=0) - hits
    iou: NDArray[np.float64] = np.divide(
        hits, union, out=np.full(len(hits), np.nan), where=union > 0
    )
    return iou


def class_accuracy(confusion: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return (C,) recall by class; NaN for classes with no true point."""
    total = confusion.sum(axis=1)
    hits = np.diagonal(confusion).astype(np.float64)
    recall: NDArray[np.float64] = np.divide(
        hits, total, out=np.full(len(hits), np.nan), where=total > 0
    )
    return recall
