"""All scores as people and spreadsheets read them: a table on a terminal, else text, or CSV."""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from mcpseg_cli.cli.display import plain
from mcpseg_cli.evaluate.dotted_names import Metric, flatten
from mcpseg_cli.evaluate.run import Scores
from mcpseg_cli.resumable import guarded_cell

Column = tuple[str, Mapping[str, Metric]]
"""A title and metrics by dotted name."""

_COUNTS = (
    "points", "covered", "uncovered", "labelled", "unlabelled", "unpredicted", "in_objects",
    "truth_points", "truth_uncovered", "without_room",
)  # fmt: skip
_CLUSTERS = (
    "objects_true", "objects_pred", "cluster_ratio", "nmi", "ami", "ari",
    "homogeneity", "completeness", "v_measure",
)  # fmt: skip
_OBJECTS = ("object_accuracy", "precision_50", "mcov", "mwcov", "mprec", "mrec")
_PANOPTIC = (
    "pq", "sq", "rq", "pq_with_stuff", "sq_with_stuff", "rq_with_stuff",
    "pq_things", "pq_stuff", "pq_dagger",
)  # fmt: skip
_PRECISION = ("ap", "ap50", "ap25", "ap_agnostic", "ap50_agnostic", "ap25_agnostic")
_BY_ROOM = (
    "rooms", "point_accuracy", "miou_present", *_CLUSTERS, *_OBJECTS, *_PANOPTIC, *_PRECISION,
)  # fmt: skip

_SECTIONS: tuple[tuple[str, tuple[str, ...]], ...] = (
    (
        "points (unit: {unit}, {over}; pairing: {pairing}; class table from: {classes_from})",
        _COUNTS,
    ),
    (
        "classes (unit: {unit}, {over}; "
        "absent classes count 0 in miou, are left out of miou_present; of ece, less is better)",
        ("point_accuracy", "mean_class_accuracy", "miou", "miou_present", "ece", "iou."),
    ),
    ("clusters ({over}; {unit}s of true objects, classes ignored)", _CLUSTERS),
    ("objects ({over}; IoU over 0.5 and same class)", _OBJECTS),
    (
        "panoptic quality ({over}; every class a thing; "
        "with_stuff: ceiling, floor and wall are stuff)",
        _PANOPTIC,
    ),
    (
        "average precision ({over}; as ScanNet: IoU 0.50 to 0.90, {min_points} {unit}s and more; "
        "ranked by {ranked_by})",
        _PRECISION,
    ),
    (
        "by room: points and clusters are means over rooms, objects match within rooms",
        tuple(f"rooms.{name}" for name in _BY_ROOM),
    ),
    ("scans", ("scans", "skipped")),
    (
        "milliseconds per scan, reading and writing included (events.jsonl); warm_up: the slowest "
        "first scan of a start, which is left out of the others",
        ("ms_per_scan.",),
    ),
    (
        "stability of labels (unit: {unit} in a scan, against the scan that saw it before)",
        ("stability.",),
    ),
    (
        "map so far, mean over all scans",
        ("over_scans.mean_miou_present", "over_scans.mean_point_accuracy"),
    ),
)
"""Headings, and the metrics under each: dotted names, or all below a name that ends in a dot."""

_ROOM_COLUMNS = ("points", "point_accuracy", "miou_present", "nmi", "ami", "ari", "cluster_ratio")


@dataclass(frozen=True)
class Block:
    """Lines of a table under one heading.

    Attributes:
        title: The heading; may be empty.
        columns: Titles of the columns behind the name, those that have a value; a single one is not
            printed.
        rows: The name and the value in each column.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def score_blocks(runs: Sequence[Scores], document: Mapping[str, object]) -> list[Block]:
    """Lay out all scores of one or several runs.

    Args:
        runs: The runs.
        document: That of the run, or ``runs``, ``pooled`` and ``mean`` of several.

    Returns:
        Headings say the unit and the protocol; lines without any value are left out.
    """
    # what headings say of the protocol
    protocol = {
        "unit": _distinct(run.unit for run in runs),
        "pairing": _distinct(run.pairing for run in runs),
        "classes_from": _distinct(run.classes_from for run in runs),
        "over": "whole map and by room" if len(runs) == 1 and runs[0].rooms else "whole map",
        "ranked_by": _distinct(run.ranked_by for run in runs),
        "min_points": str(runs[0].objects.ap_min_points),
    }

    # the sections that have anything to say
    columns = columns_of(runs, document)
    blocks = [_block(title.format(**protocol), names, columns) for title, names in _SECTIONS]
    return [block for block in blocks if block.rows] + _map_blocks(runs)


def room_blocks(runs: Sequence[Scores]) -> list[Block]:
    """Lay out a line for every room of every run whose truth names rooms."""
    return [_room_block(run, len(runs) > 1) for run in runs if run.rooms]


def print_blocks(blocks: Sequence[Block]) -> None:
    """Print blocks on stdout.

    Tables on a terminal, otherwise plain aligned text with ``#`` before headings.
    """
    console = Console(soft_wrap=True)
    width = max(len(row[0]) for block in blocks for row in block.rows)
    for block in blocks:
        if console.is_terminal:
            _print_rich(console, block)
        else:
            _print_plain(block, width)


def print_csv(runs: Sequence[Scores], document: Mapping[str, object]) -> None:
    """Print CSV on stdout.

    A line for every run, every room and their mean, and for several runs pooled and mean.
    """
    lines = [line for run in runs for line in _csv_lines(run)]
    for part in ("pooled", "mean"):
        metrics = document.get(part)
        if isinstance(metrics, dict):
            lines.append({"out": f"({part})", **flatten(metrics)})

    names = ["out", "gt", "scored_over", "room", *(name for line in lines for name in line)]
    writer = csv.DictWriter(sys.stdout, list(dict.fromkeys(names)), restval="", lineterminator="\n")
    writer.writeheader()
    for line in lines:
        texts = {name: guarded_cell(text) for name, text in line.items() if isinstance(text, str)}
        writer.writerow({**line, **texts})


def columns_of(runs: Sequence[Scores], document: Mapping[str, object]) -> list[Column]:
    """Choose the columns: map and rooms of one run; every run, pooled and mean of several."""
    if len(runs) == 1:
        flat = flatten(document)
        whole = {name: value for name, value in flat.items() if not name.startswith("rooms.")}
        if not runs[0].rooms:
            return [("whole map", whole)]
        title = f"by room ({len(runs[0].rooms.rooms)})"
        return [("whole map", whole), (title, _without("rooms.", flat))]

    parts = [("pooled", document["pooled"]), ("mean", document["mean"])]
    columns: list[Column] = [
        (name, flatten(run.document())) for name, run in zip(_names(runs), runs, strict=True)
    ]
    return columns + [(title, flatten(part)) for title, part in parts if isinstance(part, Mapping)]


def _without(prefix: str, flat: Mapping[str, Metric]) -> dict[str, Metric]:
    """Take the metrics whose names have the prefix, without it."""
    return {
        name.removeprefix(prefix): value for name, value in flat.items() if name.startswith(prefix)
    }


def _names(runs: Sequence[Scores]) -> list[str]:
    """Name the runs: by their last part if that tells them apart."""
    paths = [Path(run.output) for run in runs]
    short = [path.name for path in paths]
    return short if len(set(short)) == len(short) else [str(path) for path in paths]


def _block(title: str, names: Sequence[str], columns: Sequence[Column]) -> Block:
    """Lay out some metrics in the columns that have a value for any of them."""
    used = [
        column
        for column in columns
        if any(row[1] != "-" for name in names for row in _rows(name, [column]))
    ]
    rows = [row for name in names for row in _rows(name, used)]
    return Block(title, tuple(title for title, _ in used), tuple(rows))


def _room_block(run: Scores, is_named: bool) -> Block:
    """Lay out a line for every room of a run."""
    assert run.rooms is not None
    flat = [(room.name, flatten(room.document())) for room in run.rooms.rooms]
    rows = [(name, *(_text(metrics[column]) for column in _ROOM_COLUMNS)) for name, metrics in flat]
    title = f"rooms of {run.output}" if is_named else "rooms"
    return Block(f"{title}, each by itself", _ROOM_COLUMNS, tuple(rows))


def _map_blocks(runs: Sequence[Scores]) -> list[Block]:
    """List which classes of either side a class map gave each class of the scores, and none."""
    mapped = [run.mapped for run in runs if run.mapped]
    if not mapped:
        return []
    out = {label: name for each in mapped for label, name in each.out.items()}
    gt = {label: name for each in mapped for label, name in each.gt.items()}
    rows = [
        (name or "none", _text(_labels_of(name, out)), _text(_labels_of(name, gt)))
        for name in (*runs[0].classes, None)
    ]
    return [Block(f"class map {mapped[0].source}", ("out", "gt"), tuple(rows))]


def _labels_of(name: str | None, side: Mapping[str, str | None]) -> str | None:
    """List the labels of one side that stand for a class, or for none."""
    return ", ".join(label for label, given in side.items() if given == name) or None


def _rows(name: str, columns: Sequence[Column]) -> list[tuple[str, ...]]:
    """Give the line of a metric, or of all metrics below ``name.``; none where it is not known."""
    if name.endswith("."):
        below = dict.fromkeys(key for _, flat in columns for key in flat if key.startswith(name))
        return [row for key in below for row in _rows(key, columns)]
    if not any(name in flat for _, flat in columns):
        return []
    return [(name.replace(".", " "), *(_text(flat.get(name)) for _, flat in columns))]


def _text(value: Metric) -> str:
    """Write a metric for reading."""
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.3f}"
    return f"{value:,}" if isinstance(value, int) else value


def _distinct(texts: Iterable[str]) -> str:
    """Join different texts."""
    return " or ".join(dict.fromkeys(texts))


def _print_plain(block: Block, width: int) -> None:
    """Print one block as aligned text, names in so many letters."""
    if block.title:
        typer.echo(f"# {plain(block.title)}")
    lines = [("", *map(plain, block.columns))] if len(block.columns) > 1 else []
    lines += [tuple(map(plain, row)) for row in block.rows]
    columns = range(1, len(block.columns) + 1)
    widths = [max(9, *(len(line[column]) for line in lines)) for column in columns]
    for name, *values in lines:
        cells = (f"{value:>{size}}" for value, size in zip(values, widths, strict=True))
        typer.echo(f"{name:<{width}}  {'  '.join(cells)}")


def _print_rich(console: Console, block: Block) -> None:
    """Print one block as a table."""
    if block.title:
        console.print(Text(plain(block.title), style="bold cyan"))
    table = Table(
        box=None, pad_edge=False, show_header=len(block.columns) > 1, padding=(0, 2, 0, 2)
    )
    table.add_column("")
    for title in block.columns:
        table.add_column(Text(plain(title), style="bold"), justify="right")
    for row in block.rows:
        table.add_row(*(Text(plain(value)) for value in row))
    console.print(table, markup=False, highlight=False, emoji=False)


def _csv_lines(run: Scores) -> list[dict[str, Metric]]:
    """Give the lines of a run: the whole map, every room by itself and the mean of the rooms."""
    named: dict[str, Metric] = {"out": str(run.output), "gt": str(run.truth), "unit": run.unit}
    whole = run.document()
    rooms = whole.pop("rooms")
    lines = [{**named, **flatten(whole)}]
    if isinstance(rooms, dict):
        for name, metrics in rooms.pop("by_room").items():
            lines.append({**named, "scored_over": "room", "room": name, **flatten(metrics)})
        lines.append({**named, "room": "(mean)", **flatten(rooms)})
    return lines
