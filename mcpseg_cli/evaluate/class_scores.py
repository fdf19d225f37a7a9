"""Agreement of classes (IV-A, table I): confusion matrix, IoU and accuracy; truth first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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
