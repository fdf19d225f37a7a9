"""One process at a time in a folder."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mcpseg_cli.errors import StateInUseError


@contextmanager
def exclusive(folder: Path, name: str = ".mcpseg.lock") -> Iterator[None]:
    """Hold a folder, or what a name stands for in it, against every other mcpseg process.

    Args:
        folder: Made if not there.
        name: An empty file that is there as long as it is held; the lock ends with the process, however that ends.

    Raises:
        StateInUseError: Another process holds it.
        OSError: The folder cannot be made or written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / name
    descriptor = _lock(path)
    while descriptor is None:  # the one who held it has just removed the file
        descriptor = _lock(path)
    try:
        yield
    finally:
        path.unlink(missing_ok=True)
        os.close(descriptor)


def _lock(path: Path) -> int | None:
    """Lock a file; None if it is no longer the one under this name."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if os.path.samestat(os.fstat(descriptor), path.stat()):
            return descriptor
    except FileNotFoundError:
        pass
    except BlockingIOError as error:
        os.close(descriptor)
        raise StateInUseError(
            f"{path.parent}: another mcpseg is writing there; expected to be the only one; wait for it or name another"
        ) from error
    os.close(descriptor)
    return None
