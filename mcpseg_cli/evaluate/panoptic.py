"""Panoptic quality: objects of a class that match, and how well (Kirillov 2019, Porzi 2019)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.evaluate.overlaps import Objects, Overlaps


@dataclass(frozen=True)
class Panoptic:
    """Panoptic quality.

    Attributes:
        pq: Mean over classes of SQ times RQ.
        sq: Segmentation quality: mean IoU of matched objects, mean over classes (0 for a class
            without match).
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
        return mean_of_known(self.by_class[which])


def panoptic_quality(overlaps: Overlaps, *, stuff: Sequence[int] = ()) -> Panoptic:
    """Measure panoptic quality: pairs of a class with IoU > 0.5 match.

    Args:
        overlaps: From ``find_overlaps``.
        stuff: Classes whose objects in a unit count as one, true and predicted.

    Returns:
        The quality; classes with neither true nor predicted object are left out of the means. A
        predicted object that matches nothing and is more than half void counts neither way, nor
        does one of unknown class.
    """
    overlaps = _join_stuff(overlaps, stuff) if stuff else overlaps
    true, pred = overlaps.true, overlaps.pred
    iou, same, num_classes = overlaps.iou(), overlaps.same_class(), overlaps.num_classes

    # pairs that match, by class
    hit = same & (iou > 0.5)
    hit_class = true.semantic[overlaps.rows[hit]]
    hits = np.bincount(hit_class, minlength=num_classes)
    quality = np.bincount(hit_class, iou[hit], num_classes)

    # objects that count, by class
    counted = (pred.semantic < num_classes) & (2 * overlaps.valid >= pred.size)
    counted[overlaps.columns[hit]] = True
    num_true = np.bincount(true.semantic, minlength=num_classes)
    objects = num_true + np.bincount(pred.semantic[counted], minlength=num_classes)
    present = objects > 0

    # RQ, SQ and their product
    nothing = np.full(num_classes, np.nan)
    recognised = np.divide(2.0 * hits, objects, out=nothing, where=present)
    segmented = np.where(present, quality / np.maximum(hits, 1), np.nan)
    by_class = recognised * segmented

    # for stuff without the threshold
    overlapped = np.bincount(true.semantic[overlaps.rows[same]], iou[same], num_classes)
    is_stuff = np.isin(np.arange(num_classes), stuff)
    dagger = np.where(is_stuff, overlapped / np.maximum(num_true, 1), by_class)
    dagger[~present] = np.nan

    return Panoptic(
        pq=mean_of_known(by_class),
        sq=mean_of_known(segmented),
        rq=mean_of_known(recognised),
        pq_dagger=mean_of_known(dagger),
        by_class=by_class,
    )


def mean_of_known(values: NDArray[np.float64]) -> float:
    """Mean of what is not NaN; 0 where nothing is."""
    finite = values[~np.isnan(values)]
    return float(finite.mean()) if len(finite) else 0.0


def _join_stuff(overlaps: Overlaps, stuff: Sequence[int]) -> Overlaps:
    """Make one object of those of a class of stuff in a unit."""
    # the objects by their new numbers, and the pairs of these
    true, pred = overlaps.true, overlaps.pred
    rows, columns = _joined(true, stuff), _joined(pred, stuff)
    num_pred = int(columns.max(initial=0)) + 1
    keys = rows[overlaps.rows] * num_pred + columns[overlaps.columns]
    pairs, members = np.unique(keys, return_inverse=True)

    # sums over what has become one
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
    keys = np.where(np.isin(objects.semantic, stuff), shared, own)
    return np.unique(keys, return_inverse=True)[1]


def _join(objects: Objects, numbers: NDArray[np.int64]) -> Objects:
    """Make one object of those of equal number."""
    _, first = np.unique(numbers, return_index=True)
    sizes = np.bincount(numbers, objects.size).astype(np.int64)
    return Objects(objects.semantic[first], objects.unit[first], sizes)
