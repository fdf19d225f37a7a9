"""Class tables of S3DIS folders: the 13 classes, or those that a ``classes.txt`` names."""

from __future__ import annotations

from pathlib import Path

from mcpseg_cli.classes import S3DIS_CLASSES, TABLE_EXPECTED, table_problem
from mcpseg_cli.errors import InputError

CLASSES = "classes.txt"
_REMEDY = "write one class a line, or remove the file for the 13 of S3DIS"


def read_classes(folder: Path) -> tuple[str, ...]:
    """Read the class table of an area, or of one room of it.

    Args:
        folder: The folder; ``classes.txt`` lies in it or, for a room, in the area's, and has one
            class a line. Empty lines and those that begin with # are passed over.

    Returns:
        The classes in order, in small letters; those of S3DIS where there is no such file.

    Raises:
        InputError: The file names no classes, one twice, or some that cannot be used.
        OSError: The file cannot be read.
    """
    places = (folder / CLASSES, folder.parent / CLASSES)
    path = next((place for place in places if place.is_file()), None)
    if path is None:
        return S3DIS_CLASSES
    try:
        lines = [line.strip().lower() for line in path.read_text(encoding="utf-8-sig").splitlines()]
    except UnicodeDecodeError as error:
        raise InputError(path, "no text in UTF-8", "class names", _REMEDY) from error

    # what can be used
    classes = tuple(line for line in lines if line and not line.startswith("#"))
    problem = table_problem(classes) if classes else "no class"
    if problem:
        raise InputError(path, problem, TABLE_EXPECTED, _REMEDY)
    twice = next((name for name in classes if classes.count(name) > 1), None)
    if twice is not None:
        raise InputError(path, f"class {twice!r} twice", "every class once", _REMEDY)
    return classes
