"""The same metrics with a room as the unit, where ground truth names rooms (ASIS, SGPN)."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.evaluate.class_scores import confusion_matrix, score_classes
from mcpseg_cli.evaluate.cluster_scores import ClusterScores, score_clusters
from mcpseg_cli.evaluate.object_scores import ObjectScores, score_objects
from mcpseg_cli.evaluate.overlaps import Overlaps, PointLabels, find_overlaps

_COUNTS = ("objects_true", "objects_pred")


@dataclass(frozen=True)
class Room:
    """Scores of one room.

    Attributes:
        name: What it is called.
        points: Scored points in it.
        point_accuracy: Share of right points among those of known class.
        miou_present: Mean IoU of the classes that have a true point in it.
        clusters: Agreement of objects as clusters.
    """

    name: str
    points: int
    point_accuracy: float
    miou_present: float
    clusters: ClusterScores

    def document(self) -> dict[str, object]:
        """Give every metric by name."""
        return {
            "points": self.points,
            "point_accuracy": self.point_accuracy,
            "miou_present": self.miou_present,
            **asdict(self.clusters),
        }


@dataclass(frozen=True)
class RoomScores:
    """Scores with a room as the unit.

    Attributes:
        rooms: Every room that has scored points.
        without_room: Covered points that are in no room; not scored here.
        overlaps: Objects, each room by itself.
        objects: Their agreement: objects match within their room, all rooms count together.
    """

    rooms: tuple[Room, ...]
    without_room: int
    overlaps: Overlaps
    objects: ObjectScores

    def document(self) -> dict[str, object]:
        """Give every metric by name: those of classes and clusters as means, counts as sums."""
        # clusters: only rooms that have objects
        names = [field.name for field in fields(ClusterScores)]
        with_objects = [room for room in self.rooms if room.clusters.objects_true] or self.rooms
        values = {name: [getattr(room.clusters, name) for room in with_objects] for name in names}
        clusters = {
            name: sum(values[name]) if name in _COUNTS else float(np.mean(values[name]))
            for name in names
        }

        return {
            "scored_over": "room",
            "rooms": len(self.rooms),
            "without_room": self.without_room,
            "point_accuracy": float(np.mean([room.point_accuracy for room in self.rooms])),
            "miou_present": float(np.mean([room.miou_present for room in self.rooms])),
            **clusters,
            **asdict(self.objects),
            "by_room": {room.name: room.document() for room in self.rooms},
        }


def score_rooms(
    true: PointLabels,
    pred: PointLabels,
    room: NDArray[np.int32],
    *,
    rooms: tuple[str, ...],
    classes: tuple[str, ...],
    confidence: NDArray[np.float64] | None = None,
) -> RoomScores | None:
    """Score every room by itself.

    Args:
        true: Labels of N points.
        pred: Labels of the same points.
        room: (N,) int32 index into ``rooms``, negative for none.
        rooms: Names.
        classes: Class table.
        confidence: (N,) of each point, if known.

    Returns:
        The scores; None if no point is in a room.
    """
    # the points in rooms, room by room
    inside = np.flatnonzero(room >= 0)
    if len(inside) == 0:
        return None
    order = inside[np.argsort(room[inside], kind="stable")]
    numbers, starts = np.unique(room[order], return_index=True)
    groups = zip(numbers.tolist(), np.split(order, starts[1:]), strict=True)

    # classes and clusters by room; objects in all rooms together, which match in their own
    scored = tuple(
        _score_room(rooms[number], _some(true, ids), _some(pred, ids), classes)
        for number, ids in groups
    )
    chosen = None if confidence is None else confidence[order]
    overlaps = find_overlaps(
        _some(true, order), _some(pred, order), len(classes), unit=room[order], confidence=chosen
    )

    return RoomScores(
        rooms=scored,
        without_room=len(room) - len(inside),
        overlaps=overlaps,
        objects=score_objects(overlaps, classes),
    )


def _some(labels: PointLabels, ids: NDArray[np.int64]) -> PointLabels:
    """Take the labels of some points."""
    return PointLabels(labels.semantic[ids], labels.instance[ids])


def _score_room(name: str, true: PointLabels, pred: PointLabels, classes: tuple[str, ...]) -> Room:
    """Score the points of one room."""
    known, in_object = true.semantic != UNKNOWN, true.instance > 0
    scores = score_classes(
        confusion_matrix(true.semantic[known], pred.semantic[known], len(classes)), classes
    )
    clusters = score_clusters(true.instance[in_object], pred.instance[in_object])
    return Room(name, len(true.semantic), scores.point_accuracy, scores.miou_present, clusters)
