"""The recordings of a building: a table of what ``mcpseg segment`` is given for each."""

from __future__ import annotations

import csv
import shlex
from dataclasses import dataclass
from pathlib import Path

from mcpseg_cli.errors import InputError
from mcpseg_cli.merge.part import names_of

_COLUMNS = ("scans", "poses", "transform", "settings", "name")


@dataclass(frozen=True)
class Recording:
    """A row.

    Attributes:
        name: What its map is called.
        inputs: What is given before the options: scans, and poses where there are any.
        transform: File with the motion into the frame of the building; None: the same frame.
        settings: Options of its own.
    """

    name: str
    inputs: tuple[Path, ...]
    transform: Path | None
    settings: tuple[str, ...]


def read_recordings(path: Path) -> list[Recording]:
    """Read a table of recordings.

    Args:
        path: CSV with a header: ``scans``, and any of ``poses``, ``transform``, ``settings``
            (options as on the command line) and ``name``; paths from the table's folder.

    Returns:
        At least one.

    Raises:
        InputError: Names the line at fault.
        OSError: It cannot be opened.
    """
    expected, remedy = f"columns {', '.join(_COLUMNS)}", "scans is needed, the others are not"
    with path.open(newline="", encoding="utf-8-sig", errors="replace") as file:
        reader = csv.DictReader(file, skipinitialspace=True)
        header = reader.fieldnames or []
        unknown = [name for name in header if name not in _COLUMNS]
        if unknown or "scans" not in header:
            found = f"column {unknown[0]!r}" if unknown else "no column 'scans'"
            raise InputError(path, found, expected, remedy)
        rows = [_row(path, reader.line_num, row) for row in reader]
    if not rows:
        raise InputError(path, "no recording", "a line for each", "add one")

    # names of folders, told apart
    found_names = names_of([_own_folder(row.inputs[0], rows) for row in rows])
    named = [
        Recording(row.name or name.replace("/", "_"), row.inputs, row.transform, row.settings)
        for row, name in zip(rows, found_names, strict=True)
    ]
    names = [row.name for row in named]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InputError(path, f"two recordings {twice[0]!r}", "each once", "give another name")
    return named


def _row(path: Path, line: int, row: dict[str, str | None]) -> Recording:
    source = f"{path}: line {line}"
    if None in row or None in row.values():
        raise InputError(source, "too many or too few values", "one a column", "mend the line")
    values = {name: (value or "").strip() for name, value in row.items()}
    if not values["scans"]:
        raise InputError(source, "no scans", "a folder of scans", "name it")
    if "/" in values.get("name", "") or values.get("name", "").startswith("."):
        raise InputError(source, f"name {values['name']!r}", "the name of a folder", "mend it")
    given = [(path.parent / values[name]) for name in ("scans", "poses") if values.get(name)]
    transform = values.get("transform")
    try:
        settings = tuple(shlex.split(values.get("settings", "")))
    except ValueError as error:
        raise InputError(source, f"settings: {error}", "options", "mend the line") from error
    inputs = tuple(each.resolve() for each in given)
    motion = (path.parent / transform).resolve() if transform else None
    return Recording(values.get("name", ""), inputs, motion, settings)


def _own_folder(scans: Path, rows: list[Recording]) -> Path:
    """Return the folder that a recording is named by: one that not all have, where there is one."""
    others = {row.inputs[0] for row in rows}
    while len(others) > 1 and len({path.name for path in others}) == 1:
        scans, others = scans.parent, {path.parent for path in others}
    return scans
