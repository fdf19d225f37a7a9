"""Scores of an area as large as the authors' Area 5: 753,048 points, 73,038 predicted objects.

    python -m tests.benchmarks.evaluation [--against-scikit-learn]

Prints the seconds on one core, after a warm-up on a small area that compiles the kernels. There are
2,227 true objects.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.evaluate.cluster_scores import adjusted_mutual_information, contingency
from mcpseg_cli.evaluate.run import evaluate_run
from mcpseg_cli.formats import Cloud, write_cloud

POINTS, TRUE_OBJECTS, PRED_OBJECTS, ROOMS = 753_048, 2_227, 73_038, 68


def write_area(folder: Path, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Write map.ply and gt/, with rooms; objects are stretches of a line through a building.

    Returns:
        (N,) true and (N,) predicted object of every point of the map.
    """
    rng = np.random.default_rng(5)
    num_points = int(POINTS * scale)
    true = _stretches(num_points, round(TRUE_OBJECTS * scale), rng)
    pred = _stretches(num_points, round(PRED_OBJECTS * scale), rng)

    # some points go astray, but every object keeps its first
    stray = (rng.random(num_points) < 0.02) & (np.diff(pred, prepend=0) == 0)
    pred = np.where(stray, rng.permutation(pred), pred)

    # where they are
    row, column = np.divmod(np.arange(num_points), 1000)
    floor, row = np.divmod(row, 100)
    xyz = (np.stack([column, row, 30 * floor], axis=1) * 0.1).astype(np.float32)

    # classes of true objects; a predicted one has that of its first point, or is wrong
    semantic = (np.arange(true.max() + 1) * 7 % 13).astype(np.uint8)
    is_wrong = rng.random(pred.max() + 1) < 0.3
    guess = np.full(len(is_wrong), 255, np.uint8)
    ids, firsts = np.unique(pred, return_index=True)
    guess[ids] = np.where(is_wrong[ids], rng.integers(0, 13, len(ids)), semantic[true[firsts]])
    confidence = rng.random(num_points).astype(np.float32)

    # the truth in parts, with rooms
    columns = {axis: xyz[:, number] for number, axis in enumerate("xyz")}
    (folder / "gt").mkdir(parents=True)
    rooms = [
        {"id": i, "name": f"room_{i * ROOMS // (true.max() + 1)}/object_{i}"}
        for i in range(1, true.max() + 1)
    ]
    (folder / "raytrace.json").write_text(json.dumps({"objects": rooms}))
    own = columns | {"semantic": semantic[true], "instance": true.astype(np.int32)}
    for number, part in enumerate(np.array_split(rng.permutation(num_points), 8)):
        cloud = Cloud({name: column[part] for name, column in own.items()}, S3DIS_CLASSES)
        write_cloud(folder / f"gt/{number}.ply", cloud)

    labels = {"semantic": guess[pred], "instance": pred.astype(np.int32), "confidence": confidence}
    write_cloud(folder / "map.ply", Cloud(columns | labels, S3DIS_CLASSES))
    return true, pred


def _stretches(num_points: int, count: int, rng: np.random.Generator) -> np.ndarray:
    """Cut a line of points into ``count`` stretches of very different length; (N,) ids from 1."""
    weights = rng.pareto(1.2, count) + 1e-3
    cuts = (np.cumsum(weights[:-1]) / weights.sum() * num_points).astype(int)
    starts = np.unique(np.append(0, cuts))

    # as many more as have fallen together
    others = np.setdiff1d(np.arange(num_points), starts)
    starts = np.union1d(starts, rng.choice(others, count - len(starts), replace=False))
    return np.searchsorted(starts, np.arange(num_points), side="right")


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--against-scikit-learn", action="store_true", help="Also compare AMI; takes a minute."
    )
    arguments = parser.parse_args()

    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    with tempfile.TemporaryDirectory() as name:
        # a small area first, to compile the kernels
        small, area = Path(name) / "small", Path(name) / "area"
        write_area(small, 0.01)
        evaluate_run(small / "map.ply", small / "gt")

        labels_true, labels_pred = write_area(area, 1.0)
        started, cpu = perf_counter(), os.times()
        scores = evaluate_run(area / "map.ply", area / "gt")
        seconds, used = perf_counter() - started, os.times()

        figures: dict[str, object] = {
            "points": scores.counts.points,
            "objects_true": scores.clusters.objects_true,
            "objects_pred": scores.clusters.objects_pred,
            "rooms": len(scores.rooms.rooms) if scores.rooms else 0,
            "seconds": round(seconds, 2),
            "cpu_seconds": round(used.user + used.system - cpu.user - cpu.system, 2),
            "load": os.getloadavg()[0],
            "ami": scores.clusters.ami,
        }
        if arguments.against_scikit_learn:
            figures |= compare(labels_true, labels_pred)
    print(json.dumps(figures, indent=1))


def compare(labels_true: np.ndarray, labels_pred: np.ndarray) -> dict[str, float]:
    """Compute AMI with scikit-learn, too."""
    from sklearn.metrics import adjusted_mutual_info_score

    started = perf_counter()
    own = adjusted_mutual_information(contingency(labels_true, labels_pred))
    between = perf_counter()
    theirs = adjusted_mutual_info_score(labels_true, labels_pred)
    return {
        "ami_seconds": round(between - started, 2),
        "scikit_learn_seconds": round(perf_counter() - between, 1),
        "difference": abs(own - theirs),
    }


if __name__ == "__main__":
    main()
