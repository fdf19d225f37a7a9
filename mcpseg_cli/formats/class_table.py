"""Tables of two columns that users write: which label means which class."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from pathlib import Path

from mcpseg_cli.classes import TABLE_EXPECTED, table_problem
from mcpseg_cli.errors import InputError

_IGNORED = ("", "unknown", "-")  # names of classes for labels that mean none
_REMEDY = "mend the table"


def read_class_table(path: Path) -> dict[str, str]:
    """Read which label means which class.

    Args:
        path: CSV with two columns, label and class, a header ``label,class`` optional; or JSON, one
            object.

    Returns:
        Class by label, as ``check_class_table`` gives it.

    Raises:
        InputError: Another layout, or a table that cannot be used.
        OSError: The file cannot be opened.
    """
    return check_class_table(path, read_rows(path))


def read_rows(path: Path) -> list[tuple[str, str]]:
    """Read the labels and classes of a table as they are written, those that are dropped, too.

    Raises:
        InputError: Another layout.
        OSError: The file cannot be opened.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        return _json_pairs(text) if path.suffix.lower() == ".json" else _csv_pairs(text)
    except (ValueError, csv.Error, RecursionError) as error:
        expected = "lines 'label,class', or one JSON object of texts"
        raise InputError(path, str(error) or "another layout", expected, _REMEDY) from error


def check_class_table(source: Path | str, pairs: Sequence[tuple[str, str]]) -> dict[str, str]:
    """Make a class table of labels and their classes.

    Args:
        source: Named in messages.
        pairs: Label and class. A class that is empty, ``unknown`` or ``-`` drops the label, as if
            it were not in the table.

    Returns:
        Class by label.

    Raises:
        InputError: A label given twice, too few or too many classes, or a name that breaks headers.
    """
    table = {label: name for label, name in pairs if name.lower() not in _IGNORED}
    if len({label for label, _ in pairs}) < len(pairs):
        twice = next(label for label, _ in pairs if sum(label == other for other, _ in pairs) > 1)
        raise InputError(source, f"label {twice!r} twice", "every label once", "delete one")

    classes = sorted(set(table.values()))
    if len(classes) < 2:
        raise InputError(source, f"{len(classes)} classes", "two or more", _REMEDY)
    if problem := table_problem(classes):
        raise InputError(source, problem, TABLE_EXPECTED, "rename or merge classes")
    return table


def _json_pairs(text: str) -> list[tuple[str, str]]:
    document = json.loads(text, object_pairs_hook=tuple)  # keeps labels that are given twice
    if not isinstance(document, tuple) or not all(
        isinstance(name, str) for pair in document for name in pair
    ):
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
