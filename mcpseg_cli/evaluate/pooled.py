"""Figures of several runs: pooled (confusion matrices summed, objects together) and averaged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, fields

from mcpseg_cli.evaluate.class_scores import score_classes
from mcpseg_cli.evaluate.cluster_scores import ClusterScores
from mcpseg_cli.evaluate.object_scores import score_objects
from mcpseg_cli.evaluate.overlaps import join_overlaps
from mcpseg_cli.evaluate.run import PointCounts, Scores


def pool(runs: Sequence[Scores]) -> dict[str, object]:
    """Score several runs as one.

    Args:
        runs: At least one, all in the same class table.

    Returns:
        Counts as sums, class figures of the sum of the confusion matrices, and object figures over
        the objects of all runs, which match within their run (under ``rooms``, where all runs have
        rooms, within their room). Agreement
        as clusters is not pooled: that between runs is given by how they are put together.
    """
    classes = runs[0].classes
    counts = {
        field.name: sum(getattr(run.counts, field.name) for run in runs)
        for field in fields(PointCounts)
    }
    confusion = sum((run.confusion for run in runs[1:]), runs[0].confusion)
    rooms = [run.rooms for run in runs if run.rooms]
    clusters_in_rooms = [room.clusters for part in rooms for room in part.rooms]
    return {
        "unit": " or ".join(dict.fromkeys(run.unit for run in runs)),
        "scored_over": "all runs together",
        **counts,
        **asdict(score_classes(confusion, classes)),
        "confusion": confusion.tolist(),
        **_count([run.clusters for run in runs]),
        **asdict(score_objects(join_overlaps([run.overlaps for run in runs]), classes)),
        "rooms": {
            "rooms": len(clusters_in_rooms),
            **_count(clusters_in_rooms),
            **asdict(score_objects(join_overlaps([part.overlaps for part in rooms]), classes)),
        }
        if len(rooms) == len(runs)
        else None,
    }


def _count(clusters: Sequence[ClusterScores]) -> dict[str, float]:
    """Count the objects of all."""
    num_true, num_pred = (
        sum(part.objects_true for part in clusters),
        sum(part.objects_pred for part in clusters),
    )
    return {
        "objects_true": num_true,
        "objects_pred": num_pred,
        "cluster_ratio": num_pred / max(num_true, 1),
    }


def average(documents: Sequence[dict[str, object]]) -> dict[str, object]:
    """Average every fraction over the runs that have it; counts and lists are left out.

    Args:
        documents: From ``Scores.document``.

    Returns:
        The means under the same names, nested in the same way.
    """
    means: dict[str, object] = {}
    for name in dict.fromkeys(
        name for document in documents for name in document if name != "by_room"
    ):
        values = [document.get(name) for document in documents]
        parts = [value for value in values if isinstance(value, dict)]
        numbers = [value for value in values if isinstance(value, float)]
        if parts:
            means[name] = average(parts)
        elif numbers:
            means[name] = sum(numbers) / len(numbers)
    return {name: value for name, value in means.items() if value != {}}
