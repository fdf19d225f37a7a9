"""Score a labelled map against ground truth: pair the points, then count."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.errors import InputError
from mcpseg_cli.evaluate.class_scores import (
    confusion_matrix,
    is_probability,
    score_classes,
    score_confidence,
)
from mcpseg_cli.evaluate.cluster_scores import ClusterScores, score_clusters
from mcpseg_cli.evaluate.object_scores import ObjectScores, score_objects
from mcpseg_cli.evaluate.overlaps import Overlaps, PointLabels, find_overlaps
from mcpseg_cli.evaluate.pairing import PairedTruth, pair_with_truth
from mcpseg_cli.evaluate.prediction import Prediction, read_prediction
from mcpseg_cli.evaluate.room_scores import RoomScores, score_rooms
from mcpseg_cli.evaluate.scan_by_scan import ScanByScan, follow_scans
from mcpseg_cli.evaluate.truth import Truth, open_truth
from mcpseg_cli.formats.labels import check_classes
from mcpseg_cli.reliability import Reliability

Progress = Callable[[str, int, int], None]
"""Called with what is being read, how much of it has been, and how much there is (files or MB)."""


@dataclass(frozen=True)
class PointCounts:
    """How many points there are and how many are scored.

    Attributes:
        points: Points of the map.
        covered: Points with a true point within reach; only these are scored.
        uncovered: The others.
        labelled: Covered points whose true class is known; classes are scored on these.
        unlabelled: The other covered points.
        unpredicted: Labelled points without a predicted class; they count as wrong.
        in_objects: Covered points of a true object (id above 0); clusters are scored on these.
        truth_points: True points; of several scans, every look counts.
        truth_uncovered: True points without a point of the map within reach; not scored.
    """

    points: int
    covered: int
    uncovered: int
    labelled: int
    unlabelled: int
    unpredicted: int
    in_objects: int
    truth_points: int
    truth_uncovered: int


@dataclass(frozen=True)
class Scores:
    """How well a map agrees with ground truth.

    Attributes:
        output: What was scored.
        truth: What it was compared with.
        unit: What its points are, ``voxel`` or ``point``.
        pairing: How true points were found.
        classes_from: Whose class table it is.
        ranked_by: What ranks predicted objects for average precision.
        counts: How many points are scored.
        classes: Class table.
        confusion: (C, C + 1) int64, see ``class_scores.confusion_matrix``.
        reliability: Whether confidence is the share of right classes; None where there is no
            confidence of 0 to 1, or no point with a true and a predicted class.
        clusters: How well the objects agree, whatever their class, over the whole map.
        overlaps: Objects over the whole map.
        objects: How well they agree with their class.
        rooms: The same with a room as the unit; None where the truth names none.
        scan_by_scan: What the scans of the run tell; None for one cloud.
        notices: Lines the user should know.
    """

    output: Path
    truth: Path
    unit: str
    pairing: str
    classes_from: str
    ranked_by: str
    counts: PointCounts
    classes: tuple[str, ...]
    confusion: NDArray[np.int64]
    reliability: Reliability | None
    clusters: ClusterScores
    overlaps: Overlaps
    objects: ObjectScores
    rooms: RoomScores | None
    scan_by_scan: ScanByScan | None
    notices: tuple[str, ...]

    def document(self) -> dict[str, object]:
        """Give every metric under the name the field uses."""
        return {
            "out": str(self.output),
            "gt": str(self.truth),
            "unit": self.unit,
            "scored_over": "whole map",
            "pairing": self.pairing,
            "classes_from": self.classes_from,
            **asdict(self.counts),
            **asdict(score_classes(self.confusion, self.classes)),
            "confusion": self.confusion.tolist(),
            "ece": self.reliability and self.reliability.expected_error,
            **asdict(self.clusters),
            **asdict(self.objects),
            "ap_ranked_by": self.ranked_by,
            "rooms": self.rooms.document() if self.rooms else None,
            **(self.scan_by_scan.document() if self.scan_by_scan else {}),
        }


def evaluate_run(
    output: Path, truth: Path, *, classes: tuple[str, ...] = (), told: Progress = lambda *_: None
) -> Scores:
    """Score a run of ``mcpseg segment``, or one labelled cloud.

    Args:
        output: The run's folder (its map.ply is scored), or a labelled cloud.
        truth: Folder of labelled clouds, one labelled cloud, an HDF5 building, or an S3DIS area.
        classes: Class table of the scores; by default that of the output, else of the truth.
        told: How far reading has come.

    Returns:
        The scores. A point is compared with the true point at its place in an identical cloud, else
        with the nearest one within half a voxel.

    Raises:
        InputError: A file is damaged or has no labels, no point has truth nearby, or no class is
            common to both.
        OSError: A file cannot be read.
    """
    # what is scored, and what it is compared with
    prediction = read_prediction(output, classes)
    source = open_truth(truth, lambda _, done, size: told("ground truth", done >> 20, size >> 20))

    # the truth about every point, in the class table of the scores
    paired = pair_with_truth(
        prediction.xyz,
        source,
        prediction.classes,
        prediction.voxel_size / 2,
        lambda done: told("ground truth", done, len(source)),
    )
    table = _choose_table(prediction, source, paired)
    check_classes(prediction.semantic, table.classes, prediction.source)
    _check_truth(prediction, source, paired)

    # what happened on the way to the map
    scans = follow_scans(
        prediction,
        paired.semantic,
        len(table.classes),
        lambda done, size: told("labelled scans", done, size),
    )
    return _score(prediction, source, paired, table, scans)


@dataclass(frozen=True)
class _ClassTable:
    """The class table of the scores: where it is from, and what had to be assumed, if anything."""

    classes: tuple[str, ...]
    taken_from: str
    assumption: str = ""


def _choose_table(prediction: Prediction, truth: Truth, paired: PairedTruth) -> _ClassTable:
    """Take the table that the truth was paired in; number the classes where no file names any."""
    seen = prediction.semantic[prediction.semantic < UNKNOWN]
    highest = max(int(seen.max(initial=0)), paired.highest_class)
    table = paired.classes or tuple(f"class_{index}" for index in range(highest + 1))
    if prediction.is_named and paired.is_named:
        return _ClassTable(table, "out and gt, by name")

    span = f"{table[0]} 0 … {table[-1]} {len(table) - 1}"
    taken = "names no classes; they are taken to be those of"
    if prediction.is_named:
        return _ClassTable(table, "out", f"{truth.source} {taken} {prediction.source}: {span}")
    if paired.is_named:
        return _ClassTable(table, "gt", f"{prediction.source} {taken} {truth.source}: {span}")
    assumption = "neither file names classes; equal numbers are taken for equal classes"
    return _ClassTable(table, "neither", assumption)


def _check_truth(prediction: Prediction, truth: Truth, paired: PairedTruth) -> None:
    """Refuse truth of another place, and truth that says nothing at all."""
    if not paired.covered.any():
        found = f"no point near those of {truth.source}"
        expected = "the same place in the same frame"
        raise InputError(prediction.output, found, expected, "check the two paths")
    if not (paired.semantic != UNKNOWN).any() and not (paired.instance > 0).any():
        found, expected = "neither class nor object for any covered point", "labelled ground truth"
        raise InputError(truth.source, found, expected, "label it, or check the path")


def _score(
    prediction: Prediction,
    truth: Truth,
    paired: PairedTruth,
    table: _ClassTable,
    scans: ScanByScan | None,
) -> Scores:
    """Count what is covered."""
    # the points that are compared
    ids = np.flatnonzero(paired.covered)
    true = PointLabels(paired.semantic[ids], paired.instance[ids])
    pred = PointLabels(prediction.semantic[ids], prediction.instance[ids])
    confidence = None if prediction.confidence is None else prediction.confidence[ids]

    # their classes, clusters and objects (IV-A, IV-B), over the whole map and by room
    classes = table.classes
    known, in_object = true.semantic != UNKNOWN, true.instance > 0
    confusion = confusion_matrix(true.semantic[known], pred.semantic[known], len(classes))
    clusters = score_clusters(true.instance[in_object], pred.instance[in_object])
    overlaps = find_overlaps(true, pred, len(classes), confidence=confidence)
    room = paired.room[ids]
    rooms = score_rooms(true, pred, room, rooms=truth.rooms, classes=classes, confidence=confidence)

    return Scores(
        output=prediction.output,
        truth=truth.source,
        unit=prediction.unit,
        pairing="by point" if paired.by_point else f"nearest within {paired.reach:g} m",
        classes_from=table.taken_from,
        ranked_by="nothing" if confidence is None else "mean confidence",
        counts=_count_points(paired, num_unpredicted=int(confusion[:, -1].sum())),
        classes=classes,
        confusion=confusion,
        reliability=score_confidence(true.semantic, pred.semantic, confidence, len(classes)),
        clusters=clusters,
        overlaps=overlaps,
        objects=score_objects(overlaps, classes),
        rooms=rooms,
        scan_by_scan=scans,
        notices=tuple(_notices(prediction, truth, paired, table, scans)),
    )


def _count_points(paired: PairedTruth, num_unpredicted: int) -> PointCounts:
    """Count the points that are scored, and those that are not."""
    points, covered = len(paired.covered), int(paired.covered.sum())
    labelled = int((paired.semantic != UNKNOWN).sum())  # what is not covered is unknown, too
    return PointCounts(
        points=points,
        covered=covered,
        uncovered=points - covered,
        labelled=labelled,
        unlabelled=covered - labelled,
        unpredicted=num_unpredicted,
        in_objects=int((paired.instance > 0).sum()),
        truth_points=paired.truth_points,
        truth_uncovered=paired.truth_uncovered,
    )


def _notices(
    prediction: Prediction,
    truth: Truth,
    paired: PairedTruth,
    table: _ClassTable,
    scans: ScanByScan | None,
) -> Iterator[str]:
    """Say what was assumed, and what is not scored."""
    yield from truth.notices
    if table.assumption:
        yield table.assumption

    # true classes and labels that are lacking
    others = {name: points for name, points in paired.other_classes.items() if points}
    if others:
        listed = ", ".join(f"{name} ({points:,} points)" for name, points in others.items())
        yield f"true classes that the run does not have count as unlabelled: {listed}"
    if not (paired.semantic != UNKNOWN).any():
        yield f"{truth.source}: no covered point has a class; class and object figures are 0"
    elif not (paired.instance > 0).any():
        yield f"{truth.source}: no covered point is in an object; cluster and object figures are 0"

    if not (prediction.semantic != UNKNOWN).any():
        nothing = "no point has a class, as of region growing"
        yield f"{prediction.source}: {nothing}; class figures are 0, objects count by shape alone"

    # confidence that says something else
    if prediction.confidence is not None and not is_probability(prediction.confidence):
        yield f"{prediction.source}: confidence beyond 0 to 1; its calibration is not measured"

    # scans that are lacking
    if prediction.folder and scans is None:
        missing = "times, stability and the curve over scans are not measured"
        yield f"{prediction.folder.events_path} is not there; {missing}"
    elif scans and scans.missing:
        yield scans.missing
