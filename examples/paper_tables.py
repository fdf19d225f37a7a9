"""The paper's tables and figure 5, from what reproduce_paper.py collects: Markdown, CSV, PNG."""

from __future__ import annotations

import csv
import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean

import numpy as np

from mcpseg_cli import __version__
from mcpseg_cli.evaluate.class_scores import intersection_over_union


@dataclass(frozen=True)
class Row:
    """A method as the tables name it.

    Attributes:
        title: In the paper.
        paper: Avg IOU, point and object accuracy; NMI, AMI, ARI; seconds, MB and GB in the paper.
            None: not there.
        limit: What takes time when it labels new voxels.
    """

    title: str
    paper: tuple[float | None, ...]
    limit: str = ""


METHODS = {
    "pointnet-offline": Row("PointNet (offline)", (49.8, 79.9, *[None] * 7)),
    "sgpn-offline": Row("SGPN (offline)", (50.4, 80.8, *[None] * 7)),
    "region-growing": Row(
        "Normal + color",
        (None, None, None, 78.5, 63.4, 25.0, *[None] * 3),
        "Planes: the 124 cells around each new voxel are looked up and a 3 x 3 eigenproblem is "
        "solved.",
    ),
    "pointnet": Row(
        "PointNet",
        (25.0, 59.1, 16.7, 72.1, 59.2, 12.1, 0.017, 14.0, 0.94),
        "Eight layers of 64 to 256 features a point, and two of the maximum over the batch.",
    ),
    "pointnet2": Row(
        "PointNet++",
        (23.8, 60.2, 14.1, 76.1, 66.4, 17.1, 0.027, 11.5, 0.97),
        "Farthest points are chosen one after the other, and all pairs of points compared at every "
        "level.",
    ),
    "sgpn": Row(
        "SGPN",
        (24.9, 60.3, 14.1, 78.5, 60.5, 26.1, 0.019, 14.9, 2.49),
        "PointNet with two more branches; no similarity matrix of all pairs, only of neighbouring "
        "voxels.",
    ),
    "voxnet": Row(
        "VoxNet",
        (18.2, 45.5, 6.5, 70.5, 58.0, 11.3, 0.017, 0.5, 1.22),
        "Two convolutions over 32 x 32 x 32 cells, mostly empty, for every batch however few its "
        "points.",
    ),
    "mcpnet-nocontext": Row(
        "Proposed",
        (25.4, 57.7, 15.6, 75.9, 64.8, 18.3, 0.019, 0.9, 1.26),
        "Four layers of at most 200 features a point.",
    ),
    "mcpnet": Row(
        "Proposed + MCP",
        (39.2, 74.9, 33.5, 85.6, 74.2, 39.7, 0.034, 1.8, 1.26),
        "Context pooling: a 200 x 200 product for each of 50 context points of every new voxel.",
    ),
}
"""What tables I to III compare, in their order; the limits are those of this implementation."""


@dataclass(frozen=True)
class Result:
    """What ``mcpseg segment`` and ``mcpseg eval`` say about one run; shares are of 1.

    Attributes:
        scores: Figures of eval by name.
        iou: Intersection over union by class; None where a class is nowhere.
        confusion: Points by true and predicted class, see ``metrics.confusion_matrix``.
        p50_ms: Median time of a scan.
        p95_ms: Time that one scan in twenty exceeds.
        stages_ms: Median time of each stage; ``network`` is labelling new voxels, also without one.
        memory_mb: Peak.
    """

    scores: Mapping[str, float]
    iou: Mapping[str, float | None]
    confusion: Sequence[Sequence[int]]
    p50_ms: float
    p95_ms: float
    stages_ms: Mapping[str, float]
    memory_mb: float


def read_result(folder: Path, name: str) -> Result:
    """Read NAME.segment.json and NAME.eval.json."""
    segment, scores = (
        json.loads((folder / f"{name}.{kind}.json").read_text()) for kind in ("segment", "eval")
    )
    figures = {key: float(value) for key, value in scores.items() if isinstance(value, int | float)}
    return Result(
        scores=figures,
        iou=scores["iou"],
        confusion=scores["confusion"],
        p50_ms=segment["ms_per_scan"]["p50"],
        p95_ms=segment["ms_per_scan"]["p95"],
        stages_ms=segment["ms_by_stage"],
        memory_mb=segment["peak_memory_mb"],
    )


Results = Mapping[str, Sequence[Result]]
"""By method, one of each fold."""

_BLANK = "-"


def write_report(
    output: Path,
    methods: Sequence[str],
    folds: Sequence[int],
    context_points: Sequence[int],
    settings: Mapping[str, object],
    commands: Sequence[str],
) -> Path:
    """Write results.md, the tables as CSV, and the figure.

    Args:
        output: Folder with results/ and trained/; the files are written there.
        methods: Rows.
        folds: Areas held out; figures are means over them.
        context_points: Of figure 5; it is of the last fold.
        settings: What the results were made of.
        commands: What they were made with.

    Returns:
        results.md.
    """
    results = {
        method: [read_result(output / "results", f"{method}-holdout{fold}") for fold in folds]
        for method in METHODS
        if method in methods
    }
    tables = {
        "Table I: classification": ("table_1", table_1(results)),
        "IoU by class": ("iou_by_class", iou_by_class(results)),
        "Table II: clustering": ("table_2", table_2(results)),
        "Table III: efficiency": ("table_3", table_3(results, output / "trained", folds[0])),
    }

    # every table in Markdown and as CSV
    lines = ["# Tables and figure of the paper, reproduced", ""]
    lines += _introduction(folds, settings, commands)
    for title, (name, table) in tables.items():
        _write_csv(output / f"{name}.csv", table)
        lines += ["", f"## {title}", "", *_notes(title), *_markdown(table)]

    # context points, of the last fold
    if context_points:
        names = {count: f"context{count}-holdout{folds[-1]}" for count in context_points}
        figure = figure_5(
            {count: read_result(output / "results", name) for count, name in names.items()}
        )
        _write_csv(output / "figure_5.csv", figure)
        draw_figure_5(figure, output / "figure_5.png")
        lines += ["", "## Figure 5: context points", "", *_markdown(figure)]
        lines += ["", "![](figure_5.png)"]

    report = output / "results.md"
    report.write_text("\n".join(lines) + "\n")
    return report


def table_1(results: Results) -> list[list[str]]:
    """Classification: percent, means over the folds, mIoU pooled too; the paper's beside them."""
    header = ["method", "mIoU", "point accuracy", "object accuracy"]
    header += ["mIoU present", "mean class accuracy", "mIoU pooled"]
    table = [[*header, "paper: mIoU", "paper: point", "paper: object"]]
    for method, folds in results.items():
        if method == "region-growing":
            continue
        names = ("miou", "point_accuracy", "object_accuracy", "miou_present", "mean_class_accuracy")
        shares = [*[_percent(folds, name) for name in names], f"{100 * pooled_miou(folds):.1f}"]
        table.append([METHODS[method].title, *shares, *_paper(method, 0, 3)])
    return table


def pooled_miou(folds: Sequence[Result]) -> float:
    """Sum the folds' confusion matrices, then take the mean over all classes, as is usual now."""
    confusion = np.sum([np.array(fold.confusion, np.int64) for fold in folds], axis=0)
    return float(np.nan_to_num(intersection_over_union(confusion)).mean())


def iou_by_class(results: Results) -> list[list[str]]:
    """IoU of every class: percent, means over the folds; 0 where a class is nowhere."""
    classes = list(next(iter(results.values()))[0].iou)
    table = [["method", *classes]]
    for method, folds in results.items():
        if method != "region-growing":
            means = [mean(100 * (fold.iou[name] or 0.0) for fold in folds) for name in classes]
            table.append([METHODS[method].title, *[f"{value:.1f}" for value in means]])
    return table


def table_2(results: Results) -> list[list[str]]:
    """Clustering over the whole area: percent, means over the folds; the paper's beside them."""
    header = ["method", "NMI", "AMI", "ARI", "predicted / true objects"]
    table = [[*header, "paper: NMI", "paper: AMI", "paper: ARI"]]
    for method, folds in results.items():
        shares = [_percent(folds, name) for name in ("nmi", "ami", "ari")]
        ratio = mean(fold.scores["cluster_ratio"] for fold in folds)
        table.append([METHODS[method].title, *shares, f"{ratio:.1f}", *_paper(method, 3, 6)])
    return table


def table_3(results: Results, trained: Path, holdout: int) -> list[list[str]]:
    """Efficiency of the methods that label scan by scan.

    Times include reading, the commit and all outputs.
    """
    header = ["method", "ms per scan (median)", "p95", "network ms", "weights MB", "peak memory MB"]
    table = [[*header, "paper: ms", "paper: MB", "paper: GB", "longest stage", "what limits it"]]
    for method, folds in results.items():
        if method.endswith("-offline"):
            continue

        # times of a scan, and the stage that takes most of it
        ms = [mean(fold.p50_ms for fold in folds), mean(fold.p95_ms for fold in folds)]
        stages = {
            stage: mean(fold.stages_ms[stage] for fold in folds) for stage in folds[0].stages_ms
        }
        ms.append(stages["network"])
        longest = max(stages, key=lambda stage: stages[stage])
        share = f"{longest}, {100 * stages[longest] / sum(stages.values()):.0f} %"

        # memory, and the paper's figures
        weights = trained / f"{method}-holdout{holdout}.safetensors"
        size = f"{weights.stat().st_size / 1e6:.2f}" if weights.is_file() else _BLANK
        memory = max(fold.memory_mb for fold in folds)
        seconds, megabytes, gigabytes = METHODS[method].paper[6:]
        ms_of_paper = _cell(None if seconds is None else 1e3 * seconds, ".0f")
        paper = [ms_of_paper, _cell(megabytes), _cell(gigabytes, ".2f")]
        figures = [*[f"{value:.1f}" for value in ms], size, f"{memory:.0f}"]
        table.append([METHODS[method].title, *figures, *paper, share, METHODS[method].limit])
    return table


def figure_5(results: Mapping[int, Result]) -> list[list[str]]:
    """Accuracy and rate of MCPNet by context points."""
    table = [["context points", "point accuracy", "mIoU", "scans per second"]]
    for count, result in results.items():
        shares = [f"{100 * result.scores[name]:.1f}" for name in ("point_accuracy", "miou")]
        table.append([str(count), *shares, f"{1e3 / result.p50_ms:.1f}"])
    return table


def draw_figure_5(table: Sequence[Sequence[str]], picture: Path) -> None:
    """Draw accuracy and rate against context points."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    counts, accuracy, _, rate = ([float(row[column]) for row in table[1:]] for column in range(4))
    figure, left = plt.subplots(figsize=(6, 3.6), dpi=120, layout="constrained")
    right = left.twinx()
    curves = (
        (left, accuracy, "#1f5fa8", "point accuracy, %"),
        (right, rate, "#c0561a", "scans per second"),
    )
    for axis, values, colour, label in curves:
        axis.plot(counts, values, "o-", color=colour)
        axis.set_ylabel(label, color=colour)
        axis.tick_params(axis="y", colors=colour)
    left.set_xlabel("context points")
    left.grid(alpha=0.3)
    figure.savefig(picture)
    plt.close(figure)


def _percent(folds: Sequence[Result], name: str) -> str:
    return f"{100 * mean(fold.scores[name] for fold in folds):.1f}"


def _paper(method: str, start: int, end: int) -> list[str]:
    return [_cell(value) for value in METHODS[method].paper[start:end]]


def _cell(value: float | None, form: str = ".1f") -> str:
    return _BLANK if value is None else f"{value:{form}}"


def _introduction(
    folds: Sequence[int], settings: Mapping[str, object], commands: Sequence[str]
) -> list[str]:
    """Say what the figures were made with, of what."""
    held_out = ", ".join(map(str, folds))
    machine = f"{platform.machine()}, {platform.system()}"
    facts = [f"* {name}: {value}" for name, value in settings.items()]
    facts += [f"* areas held out, one at a time: {held_out}; figures are means over them"]
    facts += [f"* mcpseg {__version__}, Python {platform.python_version()}, {machine}"]

    made = "Made by `examples/reproduce_paper.py` with these commands, training with the settings "
    made += "of [training.toml](training.toml):"
    return [made, "", "```sh", *commands, "```", "", *facts]


def _notes(title: str) -> list[str]:
    """Say what a table's figures mean where its header does not."""
    if title.startswith("Table I:"):
        note = (
            "Percent, over the voxels of a whole area; a class that is nowhere counts 0. Offline "
            "methods learn from and label the complete clouds of the same scans in columns of 1 m; "
            "the paper gave them the original clouds, which have no occlusion, room by room."
        )
    elif title.startswith("Table II:"):
        note = (
            "Percent, over the voxels of true objects, the whole area as one unit. Region growing "
            "knows no classes."
        )
    elif title.startswith("Table III:"):
        note = (
            "Everything from reading a scan to its labelled copy, on this machine; the paper's had "
            "a GTX 1080."
        )
    else:
        note = "Percent."
    return [note, ""]


def _markdown(table: Sequence[Sequence[str]]) -> list[str]:
    lines = ["| " + " | ".join(row) + " |" for row in table]
    return [lines[0], "|---" * len(table[0]) + "|", *lines[1:]]


def _write_csv(path: Path, table: Sequence[Sequence[str]]) -> None:
    with path.open("w", newline="") as file:
        csv.writer(file).writerows(table)
