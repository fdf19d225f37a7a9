"""A file that a recorder may still be writing: what is read of it is what its hash is of."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from time import sleep
from typing import TypeVar

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.fingerprint import Fingerprint

_T = TypeVar("_T")
_ATTEMPTS = 3
_PAUSE_S = 0.2  # for a recorder to finish


def read_settled(path: Path, read: Callable[[], _T]) -> tuple[Fingerprint, _T]:
    """Read a file that stays as it is meanwhile; try again where it does not.

    Args:
        path: The file.
        read: Reads it.

    Returns:
        What the file was, before and after it was read, and what ``read`` returned.

    Raises:
        InputError: It changes all the time, or ``read`` refuses it.
        OSError: It cannot be read.
    """
    for attempt in range(_ATTEMPTS):
        if attempt:
            sleep(_PAUSE_S)
        before = Fingerprint.of(path)
        try:
            content = read()
        except (InputError, OSError):
            if before.is_still(path):
                raise
            continue
        if before.is_still(path):
            return before, content

    expected = "one that is complete"
    remedy = "write scans under another name and rename them when complete"
    raise InputError(path, "a file that changes while it is read", expected, remedy)
