"""Coverage: the best IoU of every object, true and predicted, with one of the other side (ASIS)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.evaluate.overlaps import Overlaps
from mcpseg_cli.evaluate.panoptic import mean_of_known


@dataclass(frozen=True)
class Coverage:
    """How well objects are covered, as ASIS defines it; means over classes.

    Attributes:
        mcov: Best IoU of a true object, mean over objects of a class in a unit, then over units.
        mwcov: The same with objects weighted by their points.
        mprec: Share of predicted objects with IoU >= 0.5, all units together; 0 for a class never
            predicted.
        mrec: Share of true objects with IoU >= 0.5, all units together.
    """

    mcov: float
    mwcov: float
    mprec: float
    mrec: float


def coverage(overlaps: Overlaps) -> Coverage:
    """Measure coverage within units.

    Args:
        overlaps: From ``find_overlaps``.

    Returns:
        The means; classes without a true object are left out, ``mprec`` leaves out those without
        any object.
    """
    num_classes, true, pred = overlaps.num_classes, overlaps.true, overlaps.pred
    same, iou = overlaps.same_class(), overlaps.iou()

    # the best IoU of every object with one of its class
    best_true, best_pred = np.zeros(len(true)), np.zeros(len(pred))
    np.maximum.at(best_true, overlaps.rows[same], iou[same])
    np.maximum.at(best_pred, overlaps.columns[same], iou[same])

    # coverage by unit and class; a class is averaged over the units that have it
    units = int(true.unit.max(initial=0)) + 1
    group = true.unit * num_classes + true.semantic
    by_unit = _mean_by(group, best_true, units * num_classes).reshape(units, num_classes)
    by_size = _mean_by(group, best_true, units * num_classes, true.size)

    # precision and recall by class, all units together
    known = (pred.semantic < num_classes) & (overlaps.valid > 0)
    precision = _mean_by(pred.semantic[known], best_pred[known] >= 0.5, num_classes)
    precision[np.isnan(precision) & (np.bincount(true.semantic, minlength=num_classes) > 0)] = 0.0
    recall = _mean_by(true.semantic, best_true >= 0.5, num_classes)

    return Coverage(
        mcov=mean_of_known(_columns_mean(by_unit)),
        mwcov=mean_of_known(_columns_mean(by_size.reshape(units, num_classes))),
        mprec=mean_of_known(precision),
        mrec=mean_of_known(recall),
    )


def _mean_by(
    group: NDArray[np.int64],
    values: NDArray[np.floating] | NDArray[np.bool_],
    num_groups: int,
    weights: NDArray[np.int64] | None = None,
) -> NDArray[np.float64]:
    """Weighted mean by group; NaN for empty groups."""
    weights = np.ones(len(group), np.int64) if weights is None else weights
    total = np.bincount(group, weights, num_groups)
    sums = np.bincount(group, weights * values, num_groups)
    mean: NDArray[np.float64] = np.divide(
        sums, total, out=np.full(num_groups, np.nan), where=total > 0
    )
    return mean


def _columns_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of each column over what is not NaN; NaN where nothing is."""
    unit, column = np.nonzero(~np.isnan(values))
    return _mean_by(column, values[unit, column], values.shape[1])
