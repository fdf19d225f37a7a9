"""The class table of a run, from its run.json."""

import json
from pathlib import Path

from mcpseg_cli.errors import InputError


def read_classes(path: Path) -> tuple[str, ...]:
    """Read the names that ``semantic`` indexes.

    Args:
        path: The run.json of a run.

    Returns:
        The names; none for a method that tells objects only, whose points all have 255.

    Raises:
        InputError: Missing, or without a class table.
    """
    remedy = "run 'mcpseg segment' on this folder again, which writes it"
    try:
        document: object = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise InputError(path, "not there", "the description of the run", remedy) from error
    except ValueError as error:
        raise InputError(path, "not JSON", "the description of the run", remedy) from error
    classes = document.get("classes") if isinstance(document, dict) else None
    if not isinstance(classes, list) or not all(isinstance(name, str) for name in classes):
        raise InputError(path, "no class table", "a list of names under 'classes'", remedy)
    return tuple(classes)
