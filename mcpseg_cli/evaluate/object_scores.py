"""Agreement of objects with a class: object accuracy (IV-A, table I), and what the field counts.

Panoptic quality, average precision and coverage have modules of their own; here they come together
under the names that ``mcpseg eval`` prints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mcpseg_cli.evaluate.average_precision import MIN_POINTS, average_precision
from mcpseg_cli.evaluate.coverage import coverage
from mcpseg_cli.evaluate.overlaps import Overlaps
from mcpseg_cli.evaluate.panoptic import panoptic_quality

STUFF = ("ceiling", "floor", "wall")
"""Classes that are no things where panoptic quality is said to be with stuff."""

_LARGE = 50  # points; the MCPNet authors match only predicted objects of more


@dataclass(frozen=True)
class ObjectScores:
    """Agreement of objects with a class.

    Attributes:
        object_accuracy: Share of true objects found, as the MCPNet authors count (IV-A).
        precision_50: Share of predicted objects that are right.
        pq: Panoptic quality, every class one of things.
        sq: Segmentation quality, the same.
        rq: Recognition quality, the same.
        pq_with_stuff: Panoptic quality with ceiling, floor and wall as stuff.
        sq_with_stuff: Segmentation quality, the same.
        rq_with_stuff: Recognition quality, the same.
        pq_things: Mean over the classes of things of ``pq_with_stuff``.
        pq_stuff: Mean over the classes of stuff of ``pq_with_stuff``.
        pq_dagger: ``pq_with_stuff`` without a threshold for stuff.
        ap: Average precision over IoU 0.50 to 0.90.
        ap50: At IoU 0.5.
        ap25: At IoU 0.25.
        ap_agnostic: AP with classes ignored, truth's and prediction's.
        ap50_agnostic: The same at IoU 0.5.
        ap25_agnostic: The same at IoU 0.25.
        ap_min_points: Smallest object these six count.
        mcov: Mean coverage.
        mwcov: Mean coverage, objects weighted by size.
        mprec: Mean class precision at IoU 0.5.
        mrec: Mean class recall at IoU 0.5.
    """

    object_accuracy: float
    precision_50: float
    pq: float
    sq: float
    rq: float
    pq_with_stuff: float
    sq_with_stuff: float
    rq_with_stuff: float
    pq_things: float
    pq_stuff: float
    pq_dagger: float
    ap: float
    ap50: float
    ap25: float
    ap_agnostic: float
    ap50_agnostic: float
    ap25_agnostic: float
    ap_min_points: int
    mcov: float
    mwcov: float
    mprec: float
    mrec: float


def score_objects(overlaps: Overlaps, classes: tuple[str, ...]) -> ObjectScores:
    """Compare objects with a class.

    Args:
        overlaps: From ``find_overlaps``.
        classes: Class names; those of ``STUFF`` are found by name.

    Returns:
        The scores; all 0 without true objects.
    """
    # panoptic quality: every class one of things, and ceiling, floor and wall as stuff
    stuff = tuple(index for index, name in enumerate(classes) if name in STUFF)
    is_stuff = np.isin(np.arange(len(classes)), stuff)
    things = panoptic_quality(overlaps)
    both = panoptic_quality(overlaps, stuff=stuff)

    # ranked and unranked metrics of instance segmentation
    precision, covered = average_precision(overlaps), coverage(overlaps)
    agnostic = average_precision(overlaps.without_classes())

    return ObjectScores(
        object_accuracy=object_accuracy(overlaps),
        precision_50=precision_50(overlaps),
        pq=things.pq,
        sq=things.sq,
        rq=things.rq,
        pq_with_stuff=both.pq,
        sq_with_stuff=both.sq,
        rq_with_stuff=both.rq,
        pq_things=both.mean_of(~is_stuff),
        pq_stuff=both.mean_of(is_stuff),
        pq_dagger=both.pq_dagger,
        ap=precision.ap,
        ap50=precision.ap50,
        ap25=precision.ap25,
        ap_agnostic=agnostic.ap,
        ap50_agnostic=agnostic.ap50,
        ap25_agnostic=agnostic.ap25,
        ap_min_points=MIN_POINTS,
        mcov=covered.mcov,
        mwcov=covered.mwcov,
        mprec=covered.mprec,
        mrec=covered.mrec,
    )


def object_accuracy(overlaps: Overlaps) -> float:
    """Share of true objects that a predicted one of their class meets with IoU > 0.5 (IV-A).

    The predicted object must have more than 50 points, as the authors count.
    """
    is_large = overlaps.valid[overlaps.columns] > _LARGE
    hits = (overlaps.iou() > 0.5) & overlaps.same_class() & is_large
    return float(hits.sum() / max(len(overlaps.true), 1))


def precision_50(overlaps: Overlaps) -> float:
    """Share of predicted objects, of any size, that meet a true one of their class with IoU > 0.5.

    Predicted objects all of whose points are void do not count.
    """
    hits = (overlaps.iou() > 0.5) & overlaps.same_class()
    return float(hits.sum() / max(np.count_nonzero(overlaps.valid), 1))
