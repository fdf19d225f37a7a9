"""Which true and predicted objects share points: what every metric of objects starts from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN


@dataclass(frozen=True)
class Objects:
    """True or predicted objects. An object that spans units (rooms) is one object in each.

    Attributes:
        semantic: (G,) int64 class by vote of its points, the lowest index on a tie; ``UNKNOWN`` if
            no point has one.
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

    Points of no true object, and of true objects of unknown class, are void: nothing is known about
    them.

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

    def without_classes(self) -> Overlaps:
        """Return the same objects, all of one class; predicted ones of unknown class, too."""
        true = replace(self.true, semantic=np.zeros_like(self.true.semantic))
        pred = replace(self.pred, semantic=np.zeros_like(self.pred.semantic))
        return replace(self, true=true, pred=pred, num_classes=1)


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
        confidence: (N,) of each point; that of an object is the mean over the points of its class,
            1 without.

    Returns:
        The overlaps; objects by unit, then id.
    """
    # true objects, without those of unknown class, and predicted ones
    nothing = np.zeros(len(true.instance), np.int64)
    units = nothing if unit is None else np.unique(unit, return_inverse=True)[1]
    rows, every = _count_objects(true, units, num_classes)
    known = every.semantic != UNKNOWN
    rows = np.append(np.where(known, np.cumsum(known) - 1, -1), -1)[rows]
    true_objects = Objects(every.semantic[known], every.unit[known], every.size[known])
    columns, pred_objects = _count_objects(pred, units, num_classes)

    # pairs of them that share points
    both = (rows >= 0) & (columns >= 0)
    num_pred = max(len(pred_objects), 1)
    pairs, shared = np.unique(rows[both] * num_pred + columns[both], return_counts=True)

    # mean confidence of the points that have their object's class
    votes = (columns >= 0) & (pred.semantic == np.append(pred_objects.semantic, -1)[columns])
    weights = np.ones(len(columns)) if confidence is None else confidence.astype(np.float64)
    sums = np.bincount(columns[votes], weights[votes], len(pred_objects))
    counts = np.bincount(columns[votes], minlength=len(pred_objects))

    return Overlaps(
        true_objects,
        pred_objects,
        valid=np.bincount(columns[both], minlength=len(pred_objects)),
        confidence=sums / np.maximum(counts, 1),
        rows=pairs // num_pred,
        columns=pairs % num_pred,
        shared=shared,
        num_classes=num_classes,
    )


def join_overlaps(parts: Sequence[Overlaps]) -> Overlaps:
    """Put the objects of several places side by side, as if each place had units of its own.

    Args:
        parts: At least one, all with the same class table.

    Returns:
        The objects of all.
    """
    # units and objects are counted on from place to place
    units = [
        int(max(part.true.unit.max(initial=-1), part.pred.unit.max(initial=-1))) + 1
        for part in parts
    ]
    firsts_unit = np.cumsum([0, *units[:-1]])
    firsts_true = np.cumsum([0, *[len(part.true) for part in parts[:-1]]])
    firsts_pred = np.cumsum([0, *[len(part.pred) for part in parts[:-1]]])
    rows = [part.rows + first for part, first in zip(parts, firsts_true, strict=True)]
    columns = [part.columns + first for part, first in zip(parts, firsts_pred, strict=True)]

    return Overlaps(
        _side_by_side([part.true for part in parts], firsts_unit),
        _side_by_side([part.pred for part in parts], firsts_unit),
        valid=np.concatenate([part.valid for part in parts]),
        confidence=np.concatenate([part.confidence for part in parts]),
        rows=np.concatenate(rows),
        columns=np.concatenate(columns),
        shared=np.concatenate([part.shared for part in parts]),
        num_classes=parts[0].num_classes,
    )


def _side_by_side(parts: Sequence[Objects], firsts_unit: NDArray[np.int64]) -> Objects:
    """List the objects of several places, with units counted on."""
    units = [part.unit + first for part, first in zip(parts, firsts_unit, strict=True)]
    return Objects(
        np.concatenate([part.semantic for part in parts]),
        np.concatenate(units),
        np.concatenate([part.size for part in parts]),
    )


def _count_objects(
    labels: PointLabels, units: NDArray[np.int64], num_classes: int
) -> tuple[NDArray[np.int64], Objects]:
    """Number the objects by unit, then id; give each point's number (-1: none), and the objects."""
    # an object is what has one id in one unit
    inside = labels.instance > 0
    ids, number = np.unique(labels.instance[inside], return_inverse=True)
    keys, number = np.unique(units[inside] * len(ids) + number, return_inverse=True)
    numbers = np.full(len(inside), -1)
    numbers[inside] = number

    # its class is that of most of its points
    classed = inside & (labels.semantic < num_classes)
    flat = numbers[classed] * num_classes + labels.semantic[classed]
    votes = np.bincount(flat, minlength=len(keys) * num_classes).reshape(len(keys), num_classes)
    semantic = np.where(votes.any(axis=1), votes.argmax(axis=1), UNKNOWN)

    unit, size = keys // max(len(ids), 1), np.bincount(number, minlength=len(keys))
    return numbers, Objects(semantic, unit, size)
