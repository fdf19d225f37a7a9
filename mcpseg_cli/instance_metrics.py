"""Metrics of objects with a class: object accuracy (IV), coverage (ASIS), panoptic quality (Kirillov 2019)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN

_LARGE = 50  # points; the MCPNet authors match only predicted objects of more


@dataclass(frozen=True)
class Objects:
    """True or predicted objects. An object that spans units (rooms) is one object in each.

    Attributes:
        semantic: (G,) int64 class by vote of its points, the lowest index on a tie; ``UNKNOWN`` if no point has one.
        unit: (G,) int64 number of the unit it is in, from 0.
        size: (G,) int64 its points.
    """

    semantic: NDArray[np.int64]
    unit: NDArray[np.int64]
    size: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.size)


@dataclass(frozen=True)
class Overlaps:
    """Which true objects share points with which predicted ones.

    Points of no true object, and of true objects of unknown class, are void: nothing is known about them.

    Attributes:
        true: G true objects of known class.
        pred: P predicted objects; ``size`` counts void points too.
        valid: (P,) int64 points of predicted objects that are not void.
        confidence: (P,) float64 of predicted objects.
        rows: (K,) int64 true object of each pair that shares points, ascending, by row then column.
        columns: (K,) int64 predicted object of the pair.
        shared: (K,) int64 points in both.
        num_classes: C.
    """

    true: Objects
    pred: Objects
    valid: NDArray[np.int64]
    confidence: NDArray[np.float64]
    rows: NDArray[np.int64]
    columns: NDArray[np.int64]
    shared: NDArray[np.int64]
    num_classes: int

    def iou(self) -> NDArray[np.float64]:
        """Return (K,) intersection over union of the pairs, void points left out."""
        return self.shared / (self.true.size[self.rows] + self.valid[self.columns] - self.shared)

    def same_class(self) -> NDArray[np.bool_]:
        """Return (K,) whether both of a pair have the same class."""
        same: NDArray[np.bool_] = self.true.semantic[self.rows] == self.pred.semantic[self.columns]
        return same


@dataclass(frozen=True)
class PointLabels:
    """Class and object of N points.

    Attributes:
        semantic: (N,) class index; values from the number of classes on are unknown.
        instance: (N,) object id; 0 or less is no object.
    """

    semantic: NDArray[np.integer]
    instance: NDArray[np.integer]


def find_overlaps(
    true: PointLabels,
    pred: PointLabels,
    num_classes: int,
    *,
    unit: NDArray[np.integer] | None = None,
    confidence: NDArray[np.floating] | None = None,
) -> Overlaps:
    """Count the points that true and predicted objects share.

    Args:
        true: Labels of N points.
        pred: Labels of the same points.
        num_classes: C.
        unit: (N,) room or other unit of each point; everything is one unit without.
        confidence: (N,) of each point; that of an object is the mean over the points of its class, 1 without.

    Returns:
        The overlaps; objects by unit, then id.
    """
    units = np.zeros(len(true.instance), np.int64) if unit is None else np.unique(unit, return_inverse=True)[1]
    rows, true_objects = _count_objects(true, units, num_classes)
    known = true_objects.semantic != UNKNOWN
    rows = np.append(np.where(known, np.cumsum(known) - 1, -1), -1)[rows]
    true_objects = Objects(true_objects.semantic[known], true_objects.unit[known], true_objects.size[known])
    columns, pred_objects = _count_objects(pred, units, num_classes)
    both = (rows >= 0) & (columns >= 0)
    num_pred = max(len(pred_objects), 1)
    pairs, shared = np.unique(rows[both] * num_pred + columns[both], return_counts=True)
    votes = (columns >= 0) & (pred.semantic == np.append(pred_objects.semantic, -1)[columns])
    weights = np.ones(len(columns)) if confidence is None else confidence.astype(np.float64)
    counts = np.bincount(columns[votes], minlength=len(pred_objects))
    return Overlaps(
        true_objects,
        pred_objects,
        valid=np.bincount(columns[both], minlength=len(pred_objects)),
        confidence=np.bincount(columns[votes], weights[votes], len(pred_objects)) / np.maximum(counts, 1),
        rows=pairs // num_pred,
        columns=pairs % num_pred,
        shared=shared,
        num_classes=num_classes,
    )


def object_accuracy(overlaps: Overlaps) -> float:
    """Share of true objects that a predicted one of their class and of more than 50 points meets with IoU > 0.5."""
    hits = (overlaps.iou() > 0.5) & overlaps.same_class() & (overlaps.valid[overlaps.columns] > _LARGE)
    return float(hits.sum() / max(len(overlaps.true), 1))


def precision_50(overlaps: Overlaps) -> float:
    """Share of predicted objects, of any size, that meet a true one of their class with IoU > 0.5.

    Predicted objects all of whose points are void do not count.
    """
    hits = (overlaps.iou() > 0.5) & overlaps.same_class()
    return float(hits.sum() / max(np.count_nonzero(overlaps.valid), 1))


@dataclass(frozen=True)
class Coverage:
    """How well objects are covered, as ASIS defines it; means over classes.

    Attributes:
        mcov: Best IoU of a true object, mean over objects of a class in a unit, then over units.
        mwcov: The same with objects weighted by their points.
        mprec: Share of predicted objects with IoU >= 0.5, all units together; 0 for a class never predicted.
        mrec: Share of true objects with IoU >= 0.5, all units together.
    """

    mcov: float
    mwcov: float
    mprec: float
    mrec: float


def coverage(overlaps: Overlaps) -> Coverage:
    """Measure coverage within units; classes without true object are left out, ``mprec`` those without any object."""
    num_classes, true, pred = overlaps.num_classes, overlaps.true, overlaps.pred
    same, iou = overlaps.same_class(), overlaps.iou()
    best_true, best_pred = np.zeros(len(true)), np.zeros(len(pred))
    np.maximum.at(best_true, overlaps.rows[same], iou[same])
    np.maximum.at(best_pred, overlaps.columns[same], iou[same])
    known = (pred.semantic < num_classes) & (overlaps.valid > 0)
    units = int(true.unit.max(initial=0)) + 1
    group = true.unit * num_classes + true.semantic
    by_size = _mean_by(group, best_true, units * num_classes, true.size)
    precision = _mean_by(pred.semantic[known], best_pred[known] >= 0.5, num_classes)
    precision[np.isnan(precision) & (np.bincount(true.semantic, minlength=num_classes) > 0)] = 0.0
    return Coverage(
        mcov=_mean(_columns_mean(_mean_by(group, best_true, units * num_classes).reshape(units, num_classes))),
        mwcov=_mean(_columns_mean(by_size.reshape(units, num_classes))),
        mprec=_mean(precision),
        mrec=_mean(_mean_by(true.semantic, best_true >= 0.5, num_classes)),
    )


@dataclass(frozen=True)
class Panoptic:
    """Panoptic quality.

    Attributes:
        pq: Mean over classes of SQ times RQ.
        sq: Segmentation quality: mean IoU of matched objects, mean over classes (0 for a class without match).
        rq: Recognition quality: F1 of objects, mean over classes.
        pq_dagger: PQ with mean IoU, matched or not, for classes of stuff (Porzi 2019).
        by_class: (C,) PQ; NaN for classes with neither true nor predicted object.
    """

    pq: float
    sq: float
    rq: float
    pq_dagger: float
    by_class: NDArray[np.float64]

    def mean_of(self, which: NDArray[np.bool_]) -> float:
        """Return the mean PQ of some classes, (C,) bool; 0 if none of them has an object."""
        return _mean(self.by_class[which])


def panoptic_quality(overlaps: Overlaps, *, stuff: Sequence[int] = ()) -> Panoptic:
    """Measure panoptic quality: pairs of a class with IoU > 0.5 match.

    Args:
        overlaps: From ``find_overlaps``.
        stuff: Classes whose objects in a unit count as one, true and predicted.

    Returns:
        The quality; classes with neither true nor predicted object are left out of the means. A predicted object
        that matches nothing and is more than half void counts neither way, nor does one of unknown class.
    """
    overlaps = _join_stuff(overlaps, stuff) if stuff else overlaps
    iou, same, num_classes = overlaps.iou(), overlaps.same_class(), overlaps.num_classes
    hit = same & (iou > 0.5)
    counted = (overlaps.pred.semantic < num_classes) & (2 * overlaps.valid >= overlaps.pred.size)
    counted[overlaps.columns[hit]] = True
    hit_class = overlaps.true.semantic[overlaps.rows[hit]]
    hits = np.bincount(hit_class, minlength=num_classes)
    quality = np.bincount(hit_class, iou[hit], num_classes)
    num_true = np.bincount(overlaps.true.semantic, minlength=num_classes)
    objects = num_true + np.bincount(overlaps.pred.semantic[counted], minlength=num_classes)
    present = objects > 0
    nothing = np.full(num_classes, np.nan)
    recognised = np.divide(2.0 * hits, objects, out=nothing.copy(), where=present)
    segmented = np.where(present, quality / np.maximum(hits, 1), np.nan)
    by_class = recognised * segmented
    overlapped = np.bincount(overlaps.true.semantic[overlaps.rows[same]], iou[same], num_classes)
    dagger = np.where(np.isin(np.arange(num_classes), stuff), overlapped / np.maximum(num_true, 1), by_class)
    dagger[~present] = np.nan
    return Panoptic(_mean(by_class), _mean(segmented), _mean(recognised), _mean(dagger), by_class)


def _join_stuff(overlaps: Overlaps, stuff: Sequence[int]) -> Overlaps:
    """Make one object of those of a class of stuff in a unit."""
    true, pred = overlaps.true, overlaps.pred
    rows, columns = _joined(true, stuff), _joined(pred, stuff)
    num_pred = int(columns.max(initial=0)) + 1
    pairs, members = np.unique(rows[overlaps.rows] * num_pred + columns[overlaps.columns], return_inverse=True)
    return Overlaps(
        _join(true, rows),
        _join(pred, columns),
        valid=np.bincount(columns, overlaps.valid).astype(np.int64),
        confidence=np.bincount(columns, overlaps.confidence) / np.maximum(np.bincount(columns), 1),
        rows=pairs // num_pred,
        columns=pairs % num_pred,
        shared=np.bincount(members, overlaps.shared, len(pairs)).astype(np.int64),
        num_classes=overlaps.num_classes,
    )


def _joined(objects: Objects, stuff: Sequence[int]) -> NDArray[np.int64]:
    """Number the objects anew: equal numbers for those that are one."""
    own = np.arange(len(objects))
    shared = len(objects) + objects.unit * (UNKNOWN + 1) + objects.semantic
    return np.unique(np.where(np.isin(objects.semantic, stuff), shared, own), return_inverse=True)[1]


def _join(objects: Objects, numbers: NDArray[np.int64]) -> Objects:
    """Make one object of those of equal number."""
    _, first = np.unique(numbers, return_index=True)
    sizes = np.bincount(numbers, objects.size).astype(np.int64)
    return Objects(objects.semantic[first], objects.unit[first], sizes)


def _count_objects(
    labels: PointLabels, units: NDArray[np.int64], num_classes: int
) -> tuple[NDArray[np.int64], Objects]:
    """Number the objects by unit, then id; give each point's number, -1 for none, and the objects."""
    inside = labels.instance > 0
    ids, number = np.unique(labels.instance[inside], return_inverse=True)
    keys, number = np.unique(units[inside] * len(ids) + number, return_inverse=True)
    numbers = np.full(len(inside), -1)
    numbers[inside] = number
    classed = inside & (labels.semantic < num_classes)
    flat = numbers[classed] * num_classes + labels.semantic[classed]
    votes = np.bincount(flat, minlength=len(keys) * num_classes).reshape(len(keys), num_classes)
    semantic = np.where(votes.any(axis=1), votes.argmax(axis=1), UNKNOWN)
    return numbers, Objects(semantic, keys // max(len(ids), 1), np.bincount(number, minlength=len(keys)))


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
    mean: NDArray[np.float64] = np.divide(sums, total, out=np.full(num_groups, np.nan), where=total > 0)
    return mean


def _columns_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mean of each column over what is not NaN; NaN where nothing is."""
    unit, column = np.nonzero(~np.isnan(values))
    return _mean_by(column, values[unit, column], values.shape[1])


def _mean(values: NDArray[np.float64]) -> float:
    """Mean of what is not NaN; 0 where nothing is."""
    finite = values[~np.isnan(values)]
    return float(finite.mean()) if len(finite) else 0.0
