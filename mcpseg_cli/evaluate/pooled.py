"""Scores of several runs: pooled (confusion matrices summed, objects together) and averaged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, fields

from mcpseg_cli.evaluate.class_scores import score_classes
from mcpseg_cli.evaluate.cluster_scores import ClusterScores
from mcpseg_cli.evaluate.object_scores import score_objects
from mcpseg_cli.evaluate.overlaps import join_overlaps
from mcpseg_cli.evaluate.room_scores import RoomScores
from mcpseg_cli.evaluate.run import PointCounts, Scores
from mcpseg_cli.reliability import Reliability


def pool(runs: Sequence[Scores]) -> dict[str, object]:
    """Score several runs as one.

    Args:
        runs: At least one, all in the same class table.

    Returns:
        Counts as sums, class metrics of the sum of the confusion matrices, calibration of all
        points (where all runs have confidence), and object metrics over
        the objects of all runs, which match within their run (under ``rooms``, where all runs have
        rooms, within their room). Agreement as clusters is not pooled: that between runs is given
        by how they are put together.
    """
    # sums over the points, objects side by side
    classes = runs[0].classes
    names = [field.name for field in fields(PointCounts)]
    counts = {name: sum(getattr(run.counts, name) for run in runs) for name in names}
    confusion = sum((run.confusion for run in runs[1:]), runs[0].confusion)
    overlaps = join_overlaps([run.overlaps for run in runs])
    together = pool_reliability(runs)

    rooms = [run.rooms for run in runs if run.rooms]
    return {
        "unit": " or ".join(dict.fromkeys(run.unit for run in runs)),
        "scored_over": "all runs together",
        **counts,
        **asdict(score_classes(confusion, classes)),
        "confusion": confusion.tolist(),
        "ece": together.expected_error if together else None,
        **_count_objects([run.clusters for run in runs]),
        **asdict(score_objects(overlaps, classes)),
        "rooms": _pool_rooms(rooms, classes) if len(rooms) == len(runs) else None,
    }


def pool_reliability(runs: Sequence[Scores]) -> Reliability | None:
    """Put the points of several runs into the same bins; None where a run has no confidence."""
    measured = [run.reliability for run in runs if run.reliability is not None]
    return sum(measured[1:], measured[0]) if len(measured) == len(runs) else None


def average(documents: Sequence[dict[str, object]]) -> dict[str, object]:
    """Average every fraction over the runs that have it; counts and lists are left out.

    Args:
        documents: From ``Scores.document``.

    Returns:
        The means under the same names, nested in the same way.
    """
    means: dict[str, object] = {}
    names = dict.fromkeys(name for document in documents for name in document)
    for name in (name for name in names if name != "by_room"):
        values = [document.get(name) for document in documents]
        parts = [value for value in values if isinstance(value, dict)]
        numbers = [value for value in values if isinstance(value, float)]
        if parts:
            means[name] = average(parts)
        elif numbers:
            means[name] = sum(numbers) / len(numbers)
    return {name: value for name, value in means.items() if value != {}}


def _pool_rooms(rooms: Sequence[RoomScores], classes: tuple[str, ...]) -> dict[str, object]:
    """Score the rooms of all runs as those of one."""
    clusters = [room.clusters for part in rooms for room in part.rooms]
    overlaps = join_overlaps([part.overlaps for part in rooms])
    return {
        "rooms": len(clusters),
        **_count_objects(clusters),
        **asdict(score_objects(overlaps, classes)),
    }


def _count_objects(clusters: Sequence[ClusterScores]) -> dict[str, float]:
    """Count the objects of all."""
    num_true = sum(part.objects_true for part in clusters)
    num_pred = sum(part.objects_pred for part in clusters)
    return {
        "objects_true": num_true,
        "objects_pred": num_pred,
        "cluster_ratio": num_pred / max(num_true, 1),
    }
