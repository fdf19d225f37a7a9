"""Which ray-traced areas to train on and which to hold out, and class tables for them."""

from __future__ import annotations

import csv
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mcpseg_cli.classes import TABLE_EXPECTED, table_problem
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.whole import printable

RECORD = "raytrace.json"
_IGNORED = ("", "unknown", "-")  # names in a class table for labels that no class is trained for


@dataclass(frozen=True)
class Area:
    """One ray-traced area.

    Attributes:
        folder: It has scans/, gt/ and poses.csv.
        name: Its path in the data.
        number: At the end of the folder's name; None where there is none.
    """

    folder: Path
    name: str
    number: int | None


@dataclass(frozen=True)
class Fold:
    """What to train on and what to validate on.

    Attributes:
        holdout: Number of the areas held out; None: none.
        training: At least one area.
        validation: Empty where none is held out.
    """

    holdout: int | None
    training: tuple[Area, ...]
    validation: tuple[Area, ...]

    @property
    def label(self) -> str:
        """How files are named after it."""
        return "all" if self.holdout is None else f"holdout{self.holdout}"


def find_areas(data: Path) -> list[Area]:
    """Find the ray-traced areas in a folder and in the folders in it, or the one that it is.

    Args:
        data: What ``mcpseg raytrace`` wrote, or a folder of that.

    Returns:
        Areas in the order of their paths, at least one.

    Raises:
        InputError: There is none, or one has no truth or is not complete.
        OSError: A folder cannot be read.
    """
    if not data.is_dir():
        raise InputError(data, "no such folder", "ray-traced areas", "make them with 'mcpseg raytrace', or give DATA")
    next(data.iterdir(), None)  # a folder that may not be read is an error, not empty
    records = sorted(_records(data))
    if not records:
        raise InputError(data, f"no {RECORD} in it", "ray-traced areas", "make them with 'mcpseg raytrace'")
    for record in records:
        _check_area(record)
    folders = [record.parent for record in records]
    return [Area(folder, _name(folder, data), _number(folder)) for folder in folders]


def _records(folder: Path) -> Iterator[Path]:
    """Yield the records in a folder and in the folders in it; links are followed, into no folder twice."""
    seen = set()
    for path, names, files in os.walk(folder, followlinks=True):
        if (real := os.path.realpath(path)) in seen:
            names.clear()
            continue
        seen.add(real)
        if RECORD in files:
            yield Path(path, RECORD)


def _check_area(record: Path) -> None:
    """Refuse an area that training cannot use, before hours are spent on the others."""
    try:
        document = json.loads(record.read_text())
    except ValueError as error:
        raise InputError(record, "not JSON", "the record of 'mcpseg raytrace'", "trace the area again") from error
    if not isinstance(document, dict) or not document.get("complete"):
        raise InputError(record.parent, "not traced to the end", "all scans", "run its 'mcpseg raytrace' command again")
    for name in ("scans", "gt", "poses.csv"):
        if not (record.parent / name).exists():
            raise InputError(record.parent, f"no {name}", "scans/, gt/ and poses.csv", "trace the area again")


def _name(folder: Path, data: Path) -> str:
    return printable(folder.absolute().name if folder == data else folder.relative_to(data).as_posix())


def _number(folder: Path) -> int | None:
    found = re.search(r"(\d+)$", folder.absolute().name)
    return int(found[1]) if found else None


def make_folds(areas: Sequence[Area], holdout: str, data: Path) -> list[Fold]:
    """Split areas into what is trained on and what is held out.

    Args:
        areas: From ``find_areas``.
        holdout: ``6``: all areas of that number; ``1,2,6``: one fold each; ``all``: one for every number there is;
            ``none``: train on everything.
        data: Named in messages.

    Returns:
        At least one fold.

    Raises:
        InputError: A number that no area has, or nothing is left to train on.
    """
    if holdout == "none":
        return [Fold(None, tuple(areas), ())]
    present = sorted({area.number for area in areas if area.number is not None})
    known = f"one of {', '.join(map(str, present))}" if present else "areas whose names end in a number"
    try:
        numbers = present if holdout == "all" else [int(word) for word in holdout.split(",")]
    except ValueError as error:
        raise InputError(f"--holdout {holdout}", "not a number", f"{known}, all or none", "check it") from error
    folds = []
    for number in dict.fromkeys(numbers):
        training = tuple(area for area in areas if area.number != number)
        validation = tuple(area for area in areas if area.number == number)
        if not validation:
            raise InputError(data, f"no area of number {number}", known, "choose another --holdout")
        if not training:
            raise InputError(
                data, f"only areas of number {number}", "others to train on", "add some, or --holdout none"
            )
        folds.append(Fold(number, training, validation))
    if not folds:
        raise InputError(data, "no area with a number", known, "rename areas, or give --holdout none")
    return folds


def read_class_table(path: Path) -> dict[str, str]:
    """Read which label of the data means which trained class.

    Args:
        path: CSV with two columns, label and class, a header ``label,class`` optional; or JSON, one object. A class
            that is empty, ``unknown`` or ``-`` drops the label, as if it were not in the table.

    Returns:
        Class by label.

    Raises:
        InputError: Another layout, a label given twice, too few or too many classes, or a name that breaks headers.
        OSError: The file cannot be opened.
    """
    remedy = "see 'mcpseg train --help'"
    try:
        text = path.read_text(encoding="utf-8-sig")
        pairs = _json_pairs(text) if path.suffix.lower() == ".json" else _csv_pairs(text)
    except (ValueError, csv.Error) as error:
        expected = "lines 'label,class', or one JSON object of texts"
        raise InputError(path, str(error) or "another layout", expected, remedy) from error
    table = {label: name for label, name in pairs if name.lower() not in _IGNORED}
    if len({label for label, _ in pairs}) < len(pairs):
        twice = next(label for label, _ in pairs if sum(label == other for other, _ in pairs) > 1)
        raise InputError(path, f"label {twice!r} twice", "every label once", "delete one")
    if len(set(table.values())) < 2:
        raise InputError(path, f"{len(set(table.values()))} classes", "two or more", remedy)
    if problem := table_problem(sorted(set(table.values()))):
        raise InputError(path, problem, TABLE_EXPECTED, "rename or merge classes")
    return table


def _json_pairs(text: str) -> list[tuple[str, str]]:
    document = json.loads(text, object_pairs_hook=tuple)  # keeps labels that are given twice
    if not isinstance(document, tuple) or not all(isinstance(name, str) for pair in document for name in pair):
        raise ValueError("values that are not texts")
    return [(label.strip(), name.strip()) for label, name in document]


def _csv_pairs(text: str) -> list[tuple[str, str]]:
    rows = [[cell.strip() for cell in row] for row in csv.reader(text.splitlines()) if row]
    rows = [row for row in rows if any(row) and not row[0].startswith("#")]
    if any(len(row) != 2 for row in rows):
        line = next(row for row in rows if len(row) != 2)
        raise ValueError(f"{len(line)} columns in {','.join(line)!r}")
    if rows and [cell.lower() for cell in rows[0]] == ["label", "class"]:
        rows = rows[1:]
    return [(label, name) for label, name in rows]


def trained_classes(tables: Sequence[Sequence[str]], mapping: Mapping[str, str] | None) -> tuple[str, ...]:
    """List the classes to train: those of the class table, else all that the areas have, in order of appearance.

    Args:
        tables: Class names of each area.
        mapping: From ``read_class_table``.

    Raises:
        InputError: The areas have too many classes, or one whose name cannot be used.
    """
    if mapping is not None:
        return tuple(dict.fromkeys(mapping.values()))
    classes = tuple(dict.fromkeys(name for table in tables for name in table))
    if problem := table_problem(classes):
        raise InputError("class tables of the data", problem, TABLE_EXPECTED, "choose classes with --classes")
    return classes
