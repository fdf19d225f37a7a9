"""The recordings of a building: a table of what ``mcpseg segment`` is given for each."""

from __future__ import annotations

import csv
import shlex
from dataclasses import dataclass
from pathlib import Path

from mcpseg_cli.errors import InputError

_COLUMNS = ("scans", "poses", "transform", "settings", "name")


@dataclass(frozen=True)
class Recording:
    """A row.

    Attributes:
        name: What its map is called: as the table says, or after the folder of the scans, or, where
            that is called ``scans``, after the one that it is in.
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

    names = [row.name for row in rows]
    if twice := [name for name in names if names.count(name) > 1]:
        found, remedy = f"two recordings {twice[0]!r}", "tell them apart in a column 'name'"
        raise InputError(path, found, "each once", remedy)
    return rows


def _row(path: Path, line: int, row: dict[str, str | None]) -> Recording:
    source = f"{path}: line {line}"
    if None in row or None in row.values():
        raise InputError(source, "too many or too few values", "one a column", "mend the line")
    values = {name: (value or "").strip() for name, value in row.items()}
    if any("\0" in value for value in values.values()):
        raise InputError(source, "a byte of 0", "text", "mend the line")
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
    own = inputs[0].parent if inputs[0].name == "scans" else inputs[0]
    return Recording(values.get("name") or own.stem, inputs, motion, settings)
