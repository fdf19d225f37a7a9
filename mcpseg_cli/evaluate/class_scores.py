"""Class figures of a confusion matrix, under the names the field uses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.evaluate.cluster_scores import class_accuracy, intersection_over_union


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
    """Compute the class figures.

    Args:
        confusion: (C, C + 1) from ``metrics.confusion_matrix``.
        classes: C names.

    Returns:
        The figures; all 0 without points.
    """
    iou, present = intersection_over_union(confusion), confusion.sum(axis=1) > 0
    counted = np.nan_to_num(iou)
    return ClassScores(
        point_accuracy=float(np.trace(confusion) / max(confusion.sum(), 1)),
        mean_class_accuracy=float(class_accuracy(confusion)[present].mean()) if present.any() else 0.0,
        miou=float(counted.mean()),
        miou_present=float(counted[present].mean()) if present.any() else 0.0,
        iou={name: None if np.isnan(value) else float(value) for name, value in zip(classes, iou, strict=True)},
    )
