"""One process at a time in a folder."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mcpseg_cli.errors import StateInUseError


@contextmanager
def exclusive(folder: Path) -> Iterator[None]:
    """Hold a folder against every other mcpseg process; the lock ends with the process, however that ends.

    Args:
        folder: Made if not there; gets a hidden, empty file.

    Raises:
        StateInUseError: Another process holds it.
        OSError: The folder cannot be made or written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(folder / ".mcpseg.lock", os.O_RDWR | os.O_CREAT, 0o666)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise StateInUseError(
                f"{folder}: another mcpseg is writing there; expected to be the only one; wait for it or name another"
            ) from error
        yield
    finally:
        os.close(descriptor)
