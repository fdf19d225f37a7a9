"""Score a labelled map against ground truth: pair the points, then count."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from mcpseg_cli.classes import UNKNOWN, remap_table
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import Cloud, read_cloud
from mcpseg_cli.metrics import class_accuracy, confusion_matrix, intersection_over_union
from mcpseg_cli.object_scores import ClusterScores, ObjectScores, score_clusters, score_objects
from mcpseg_cli.overlaps import PointLabels, find_overlaps
from mcpseg_cli.recording import list_clouds

_DEFAULT_VOXEL = 0.1  # metres; points pair within half a voxel when the map does not say its size


@dataclass(frozen=True)
class Scores:
    """How well a map agrees with ground truth; every figure is over points of the map (one a voxel).

    Attributes:
        points: Points of the map.
        covered: Points with ground truth within half a voxel; only these are scored.
        labelled: Covered points whose true class is known; classes are scored on these.
        in_objects: Covered points of a true object (id above 0); clusters are scored on these.
        classes: Class table.
        confusion: (C, C + 1) int64, see ``metrics.confusion_matrix``.
        clusters: How well the objects agree, whatever their class.
        objects: How well objects with a class agree.
    """

    points: int
    covered: int
    labelled: int
    in_objects: int
    classes: tuple[str, ...]
    confusion: NDArray[np.int64]
    clusters: ClusterScores
    objects: ObjectScores

    def document(self) -> dict[str, object]:
        """Give every figure under the name the field uses; classes without a point count IoU 0 in ``miou``."""
        iou = intersection_over_union(self.confusion)
        present = self.confusion.sum(axis=1) > 0
        return {
            "unit": "voxel",
            "scored_over": "whole map",
            "points": self.points,
            "covered": self.covered,
            "labelled": self.labelled,
            "in_objects": self.in_objects,
            "point_accuracy": float(np.trace(self.confusion) / max(self.confusion.sum(), 1)),
            "mean_class_accuracy": float(np.nanmean(class_accuracy(self.confusion))) if present.any() else 0.0,
            "miou": float(np.nan_to_num(iou).mean()),
            "miou_present": float(np.nan_to_num(iou)[present].mean()) if present.any() else 0.0,
            "iou": {
                name: None if np.isnan(value) else float(value) for name, value in zip(self.classes, iou, strict=True)
            },
            **asdict(self.clusters),
            **asdict(self.objects),
        }

    def table(self) -> list[tuple[str, str]]:
        """Give the same for reading."""
        rows = []
        for name, value in self.document().items():
            if isinstance(value, dict):
                rows += [(f"iou {label}", "-" if part is None else f"{part:.3f}") for label, part in value.items()]
            else:
                rows.append(
                    (
                        name,
                        f"{value:.3f}"
                        if isinstance(value, float)
                        else f"{value:,}"
                        if isinstance(value, int)
                        else str(value),
                    )
                )
        return rows


def evaluate_run(output: Path, truth: Path) -> Scores:
    """Score a run of ``mcpseg segment``, or one labelled cloud.

    Args:
        output: The run's folder (its map.ply is scored), or a labelled cloud.
        truth: Folder of labelled clouds, or one labelled cloud, with ``semantic`` and ``instance``.

    Returns:
        The scores. Each map point is compared with the nearest true point within half a voxel.

    Raises:
        InputError: A cloud has no labels, or no point of the map has ground truth nearby.
    """
    for path in (output, truth):
        if not path.exists():
            raise InputError(path, "no such file or folder", "labelled clouds", "check the path")
    if output.is_dir() and not (output / "map.ply").is_file():
        raise InputError(output, "no map.ply", "a folder that 'mcpseg segment' wrote, or one cloud", "check the path")
    predicted = read_cloud(output / "map.ply" if output.is_dir() else output)
    clouds = [(path, read_cloud(path)) for path in (list_clouds(truth) if truth.is_dir() else [truth])]
    classes = predicted.classes or _class_table([(output, predicted), *clouds])
    tables = [remap_table(cloud.classes or classes, classes) for _, cloud in clouds]
    labels = [table[_label(cloud, "semantic", path)] for table, (path, cloud) in zip(tables, clouds, strict=True)]
    true_semantic = np.concatenate(labels)
    true_instance = np.concatenate([_label(cloud, "instance", path) for path, cloud in clouds])
    true_xyz = np.concatenate([cloud.xyz for _, cloud in clouds])
    distance, nearest = KDTree(true_xyz).query(predicted.xyz, distance_upper_bound=_voxel_size(output) / 2 + 1e-6)
    covered = np.isfinite(distance)
    if not covered.any():
        raise InputError(
            output, f"no point near those of {truth}", "the same place in the same frame", "check the two paths"
        )
    pairs = nearest[covered]
    semantic = true_semantic[pairs]
    known = semantic != UNKNOWN
    true = PointLabels(semantic, true_instance[pairs])
    pred = PointLabels(_label(predicted, "semantic", output)[covered], _label(predicted, "instance", output)[covered])
    in_object = true.instance > 0
    overlaps = find_overlaps(true, pred, len(classes), confidence=_confidence(predicted, covered, output))
    return Scores(
        points=len(predicted),
        covered=int(covered.sum()),
        labelled=int(known.sum()),
        in_objects=int(in_object.sum()),
        classes=classes,
        confusion=confusion_matrix(semantic[known], pred.semantic[known], len(classes)),
        clusters=score_clusters(true.instance[in_object], pred.instance[in_object]),
        objects=score_objects(overlaps, classes),
    )


def _label(cloud: Cloud, name: str, source: Path) -> NDArray[np.int64]:
    """Take a label column as integers; ``semantic`` must fit a byte."""
    column = cloud.label(name)
    if column is None:
        raise InputError(
            source, f"points without {name}", "labelled clouds with semantic and instance", "check the path"
        )
    if column.ndim != 1 or column.dtype.kind not in "iufb":
        raise InputError(
            source, f"{name} is {column.dtype} {column.shape}", "a number for each point", "mend the labels"
        )
    values = column.astype(np.float64)
    low, high = (0, UNKNOWN) if name == "semantic" else (-(2**31), 2**31 - 1)
    if not ((values >= low) & (values <= high)).all():
        found = f"{name} from {values.min():g} to {values.max():g}"
        raise InputError(source, found, f"whole numbers from {low} to {high}", "mend the labels")
    return column.astype(np.int64)


def _confidence(cloud: Cloud, covered: NDArray[np.bool_], source: Path) -> NDArray[np.float64] | None:
    """Take the confidence of the covered points, if there is one: objects are ranked by it."""
    column = cloud.label("confidence")
    if column is None:
        return None
    values = column.astype(np.float64)
    if values.ndim != 1 or not np.isfinite(values).all():
        raise InputError(source, "confidence that is no number", "a number for each point", "mend the labels")
    return values[covered]


def _class_table(clouds: list[tuple[Path, Cloud]]) -> tuple[str, ...]:
    """Take the first class table among clouds; number the classes where none has one."""
    for _, cloud in clouds:
        if cloud.classes:
            return cloud.classes
    labels = np.concatenate([_label(cloud, "semantic", path) for path, cloud in clouds])
    return tuple(f"class_{index}" for index in range(int(labels[labels < UNKNOWN].max(initial=0)) + 1))


def _voxel_size(output: Path) -> float:
    """Read the voxel size of a run."""
    path = output / "run.json"
    if not path.is_file():
        return _DEFAULT_VOXEL
    try:
        size = float(json.loads(path.read_text())["configuration"]["voxel_size"])
        if not 0.0 < size < np.inf:
            raise ValueError(size)
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(path, "no voxel size", "a run.json that mcpseg wrote", "run mcpseg segment again") from error
    return size
