"""Score a labelled map against ground truth: pair the points, then count."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN, remap_table
from mcpseg_cli.errors import InputError
from mcpseg_cli.evaluate.class_scores import confusion_matrix, score_classes
from mcpseg_cli.evaluate.cluster_scores import ClusterScores, score_clusters
from mcpseg_cli.evaluate.object_scores import ObjectScores, score_objects
from mcpseg_cli.evaluate.overlaps import Overlaps, PointLabels, find_overlaps
from mcpseg_cli.evaluate.pairing import PairedTruth, pair_with_truth
from mcpseg_cli.evaluate.prediction import Answer, read_answer
from mcpseg_cli.evaluate.room_scores import RoomScores, score_rooms
from mcpseg_cli.evaluate.scan_by_scan import FollowedRun, RunMap, follow_run
from mcpseg_cli.evaluate.truth import Truth, open_truth

Progress = Callable[[str, int, int], None]
"""Called with what is being read, how much of it has been and how much there is (files, or megabytes)."""


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
        confusion: (C, C + 1) int64, see ``metrics.confusion_matrix``.
        clusters: How well the objects agree, whatever their class, over the whole map.
        overlaps: Objects over the whole map.
        objects: How well they agree with their class.
        rooms: The same with a room as the unit; None where the truth names none.
        followed: What the scans of the run tell; None for one cloud.
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
    clusters: ClusterScores
    overlaps: Overlaps
    objects: ObjectScores
    rooms: RoomScores | None
    followed: FollowedRun | None
    notices: tuple[str, ...]

    def document(self) -> dict[str, object]:
        """Give every figure under the name the field uses."""
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
            **asdict(self.clusters),
            **asdict(self.objects),
            "ap_ranked_by": self.ranked_by,
            "rooms": self.rooms.document() if self.rooms else None,
            **(self.followed.document() if self.followed else {}),
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
    answer = read_answer(output)
    source = open_truth(truth, lambda _, done, size: told("ground truth", done >> 20, size >> 20))
    table = classes or answer.classes or _table_of_truth(answer, source)
    semantic = answer.classes_in(table)
    paired = pair_with_truth(
        answer.xyz,
        source,
        table,
        answer.voxel_size / 2,
        lambda done: told("ground truth", done, len(source)),
    )
    if not paired.covered.any():
        raise InputError(
            output,
            f"no point near those of {truth}",
            "the same place in the same frame",
            "check the two paths",
        )
    unscored = _unscored(truth, paired)
    followed, missing = None, ""
    if output.is_dir():
        followed, missing = _follow(
            output, answer, remap_table(table, answer.classes or table)[paired.semantic], told
        )
    classes_from, assumed = _whose_table(answer, source, paired, table)
    notices = (
        *source.notices,
        *assumed,
        *_unmatched(paired),
        *unscored,
        *([missing] if missing else []),
    )
    return _score(
        answer, semantic, source, paired, followed=followed, facts=(table, classes_from, notices)
    )


def _follow(
    output: Path, answer: Answer, true_semantic: NDArray[np.uint8], told: Progress
) -> tuple[FollowedRun | None, str]:
    """Follow a run scan by scan, in its own class table."""
    xyz = answer.xyz.astype(np.float32, copy=False)
    final = RunMap(xyz, answer.semantic, answer.instance, answer.voxel_size)
    count = len(answer.classes) or int(true_semantic[true_semantic < UNKNOWN].max(initial=0)) + 1
    return follow_run(
        output,
        final,
        true_semantic,
        count,
        lambda done, all_scans: told("labelled scans", done, all_scans),
    )


def _score(
    answer: Answer,
    semantic: NDArray[np.uint8],
    truth: Truth,
    paired: PairedTruth,
    *,
    followed: FollowedRun | None,
    facts: tuple[tuple[str, ...], str, tuple[str, ...]],
) -> Scores:
    """Count what is covered."""
    classes, classes_from, notices = facts
    ids = np.flatnonzero(paired.covered)
    true = PointLabels(paired.semantic[ids], paired.instance[ids])
    pred = PointLabels(semantic[ids], answer.instance[ids])
    confidence = None if answer.confidence is None else answer.confidence[ids]
    known, in_object = true.semantic != UNKNOWN, true.instance > 0
    confusion = confusion_matrix(true.semantic[known], pred.semantic[known], len(classes))
    overlaps = find_overlaps(true, pred, len(classes), confidence=confidence)
    return Scores(
        output=answer.source.parent if answer.unit == "voxel" else answer.source,
        truth=truth.source,
        unit=answer.unit,
        pairing="by point" if paired.by_point else f"nearest within {paired.reach:g} m",
        classes_from=classes_from,
        ranked_by="nothing" if confidence is None else "mean confidence",
        counts=PointCounts(
            points=len(semantic),
            covered=len(ids),
            uncovered=len(semantic) - len(ids),
            labelled=int(known.sum()),
            unlabelled=len(ids) - int(known.sum()),
            unpredicted=int(confusion[:, -1].sum()),
            in_objects=int(in_object.sum()),
            truth_points=paired.truth_points,
            truth_uncovered=paired.truth_uncovered,
        ),
        classes=classes,
        confusion=confusion,
        clusters=score_clusters(true.instance[in_object], pred.instance[in_object]),
        overlaps=overlaps,
        objects=score_objects(overlaps, classes),
        rooms=score_rooms(
            true, pred, paired.room[ids], rooms=truth.rooms, classes=classes, confidence=confidence
        ),
        followed=followed,
        notices=notices,
    )


def _table_of_truth(answer: Answer, truth: Truth) -> tuple[str, ...]:
    """Take the first class table of the truth; number the classes where no file names any."""
    highest = int(answer.semantic[answer.semantic < UNKNOWN].max(initial=0))
    for part in truth.parts():
        if part.classes:
            return part.classes
        highest = max(highest, int(part.semantic[part.semantic < UNKNOWN].max(initial=0)))
    return tuple(f"class_{index}" for index in range(highest + 1))


def _whose_table(
    answer: Answer, truth: Truth, paired: PairedTruth, table: tuple[str, ...]
) -> tuple[str, tuple[str, ...]]:
    """Say whose class table it is, and what had to be assumed."""
    span = f"{table[0]} 0 … {table[-1]} {len(table) - 1}"
    if answer.classes and paired.is_named:
        return "out and gt, by name", ()
    if answer.classes:
        return "out", (
            f"{truth.source} names no classes; they are taken to be those of {answer.source}: {span}",
        )
    if paired.is_named:
        return "gt", (
            f"{answer.source} names no classes; they are taken to be those of {truth.source}: {span}",
        )
    return "neither", ("neither file names classes; equal numbers are taken for equal classes",)


def _unmatched(paired: PairedTruth) -> tuple[str, ...]:
    """Say which true classes are not scored."""
    others = {name: points for name, points in paired.other_classes.items() if points}
    if not others:
        return ()
    listed = ", ".join(f"{name} ({points:,} points)" for name, points in others.items())
    return (f"true classes that the run does not have count as unlabelled: {listed}",)


def _unscored(truth: Path, paired: PairedTruth) -> tuple[str, ...]:
    """Say which scores have nothing to go by; refuse truth that says nothing at all."""
    has_classes = bool((paired.semantic != UNKNOWN).any())
    has_objects = bool((paired.instance > 0).any())
    if not has_classes and not has_objects:
        found = "neither class nor object for any covered point"
        raise InputError(truth, found, "labelled ground truth", "label it, or check the path")
    if not has_classes:
        return (f"{truth}: no covered point has a class; class and object figures are 0",)
    return (
        ()
        if has_objects
        else (f"{truth}: no covered point is in an object; cluster and object figures are 0",)
    )
