"""The scores in eight lines: what most people look at; ``mcpseg eval --full`` has the rest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mcpseg_cli.cli.score_table import Block, Column, columns_of
from mcpseg_cli.evaluate.dotted_names import Metric
from mcpseg_cli.evaluate.run import Scores

_NO_CLASSES = "none: the map has no classes"
_UNKNOWN_CLASSES = "unknown: the truth has no classes here"
_UNKNOWN_OBJECTS = "unknown: the truth has no objects here"


def headline(run: Scores) -> list[tuple[str, str]]:
    """Sum the scores of one run up, as names and values.

    Args:
        run: The scores.

    Returns:
        At most eight lines. What is not known, or is not there, says so instead of being 0.
    """
    count = run.counts
    has_truth, has_classes = count.labelled > 0, count.unpredicted < count.labelled
    no_class = "" if has_classes else (_NO_CLASSES if has_truth else _UNKNOWN_CLASSES)
    no_object = "" if count.in_objects else _UNKNOWN_OBJECTS
    rows = [("compared", f"{count.covered:,} of {count.points:,} {run.unit}s, {run.pairing}")]

    # classes
    present = int((run.confusion.sum(axis=1) > 0).sum())
    classes = run.document()
    of = f"over {present} of {len(run.classes)} classes, those in the truth"
    rows.append(("accuracy", no_class or _text(classes["point_accuracy"])))
    rows.append(("mIoU", no_class or f"{_text(classes['miou_present'])} {of}"))

    # objects
    clusters, objects = run.clusters, run.objects
    found = f"{clusters.objects_true:,} true, {clusters.objects_pred:,} predicted"
    rows.append(("NMI", no_object or _text(clusters.nmi)))
    rows.append(("objects", no_object or found))
    rows.append(("object accuracy", no_object or no_class or _text(objects.object_accuracy)))
    agnostic = f"{_text(objects.ap50_agnostic)} whatever the class"
    precision = agnostic if no_class else _text(objects.ap50)
    rows.append(("AP50", no_object or precision))

    # time
    latency = run.scan_by_scan and run.scan_by_scan.latency
    if latency:
        rows.append(("ms per scan", latency.text()))
    return rows


def headline_of_several(runs: Sequence[Scores], document: Mapping[str, object]) -> Block:
    """Lay the same figures out with a column for each run, for all pooled, and for their mean.

    Args:
        runs: The runs.
        document: ``runs``, ``pooled`` and ``mean``.
    """
    columns = columns_of(runs, document)
    names = {
        "accuracy": "point_accuracy",
        "mIoU": "miou_present",
        "NMI": "nmi",
        "object accuracy": "object_accuracy",
        "AP50": "ap50",
        "ms per scan": "ms_per_scan.p50",
    }
    rows = [
        (title, *(_text(flat.get(name)) for _, flat in columns)) for title, name in names.items()
    ]
    rows.insert(3, ("objects", *(_objects(column) for column in columns)))
    return Block("", tuple(title for title, _ in columns), tuple(rows))


def _objects(column: Column) -> str:
    """Write how many objects there are and how many were found."""
    _, flat = column
    true, found = flat.get("objects_true"), flat.get("objects_pred")
    return "-" if true is None else f"{found} for {true}"


def _text(value: object | Metric) -> str:
    """Write a figure; a dash for none."""
    if not isinstance(value, float | int):
        return "-"
    return f"{value:.0f}" if value > 1 else f"{value:.3f}"
