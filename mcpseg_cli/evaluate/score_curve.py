"""Scores while scanning: the map so far, with the labels that its voxels had at that time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.evaluate.class_scores import intersection_over_union

_TENTHS = tuple(range(10, 101, 10))


@dataclass(frozen=True)
class ScoreCurve:
    """Scores after each of S scans, over the voxels seen so far.

    Attributes:
        voxels: (S,) int64 voxels of known class seen so far.
        miou_present: (S,) float64 mean IoU of the classes that have been seen so far.
        point_accuracy: (S,) float64.
    """

    voxels: NDArray[np.int64]
    miou_present: NDArray[np.float64]
    point_accuracy: NDArray[np.float64]

    def document(self) -> dict[str, object]:
        """Give the curve at 10, 20 … 100 % of the scans, and its mean over all scans."""
        rows = [max(-(-len(self.voxels) * percent // 100), 1) - 1 for percent in _TENTHS]
        return {
            "percent_of_scans": list(_TENTHS),
            "miou_present": [float(self.miou_present[row]) for row in rows],
            "point_accuracy": [float(self.point_accuracy[row]) for row in rows],
            "mean_miou_present": float(self.miou_present.mean()),
            "mean_point_accuracy": float(self.point_accuracy.mean()),
        }


class CurveRecorder:
    """Keeps the confusion matrix of the map so far.

    Args:
        true_semantic: (V,) uint8 true class of each voxel of the final map, 255 unknown.
        num_classes: C.
    """

    def __init__(self, true_semantic: NDArray[np.uint8], num_classes: int) -> None:
        self._true, self._num_classes = true_semantic, num_classes
        self._last = np.full(len(true_semantic), -1, np.int64)  # -1: not seen yet
        self._confusion = np.zeros((num_classes, num_classes + 1), np.int64)
        self._rows: list[tuple[int, float, float]] = []

    def look(self, ids: NDArray[np.integer], semantic: NDArray[np.uint8]) -> None:
        """Take in one labelled scan.

        Args:
            ids: (M,) voxels it shows, none twice.
            semantic: (M,) uint8 their classes as known then.
        """
        self._enter(ids, semantic)

        # the scores after this scan
        present, num_points = self._confusion.sum(axis=1) > 0, int(self._confusion.sum())
        iou = intersection_over_union(self._confusion)[present]
        accuracy = float(np.trace(self._confusion)) / max(num_points, 1)
        self._rows.append((num_points, float(iou.mean()) if len(iou) else 0.0, accuracy))

    def change(self, ids: NDArray[np.integer], semantic: NDArray[np.uint8]) -> None:
        """Take in what the next scan changes of voxels seen before, in its sight or not.

        Args:
            ids: (M,) voxels, none twice; those not seen before are left.
            semantic: (M,) uint8 their classes from then on.
        """
        seen = self._last[ids] >= 0
        self._enter(ids[seen], semantic[seen])

    def _enter(self, ids: NDArray[np.integer], semantic: NDArray[np.uint8]) -> None:
        """Let each voxel of known class leave the cell it was in and enter another."""
        known = self._true[ids] != UNKNOWN
        voxels, now = ids[known], np.minimum(semantic[known].astype(np.int64), self._num_classes)
        true, before = self._true[voxels], self._last[voxels]
        seen = before >= 0
        np.subtract.at(self._confusion, (true[seen], before[seen]), 1)
        np.add.at(self._confusion, (true, now), 1)
        self._last[voxels] = now

    def curve(self) -> ScoreCurve | None:
        """Return the curve; None without a scan."""
        if not self._rows:
            return None
        voxels, miou_present, point_accuracy = zip(*self._rows, strict=True)
        return ScoreCurve(np.array(voxels), np.array(miou_present), np.array(point_accuracy))
