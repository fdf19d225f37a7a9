"""Work that survives being cut short: whole files, one process a folder, the same request."""

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from pydantic import JsonValue

from mcpseg_cli.errors import StateError, StateInUseError, naming


def printable(text: str) -> str:
    r"""Write bytes of paths and arguments that are no UTF-8 as ``\xff``, so that the text can be encoded."""
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "backslashreplace")


def write_whole(path: Path, text: str) -> None:
    """Write a text file; it appears under its name only when complete.

    Args:
        path: The file; its folder must exist; replaced if there.
        text: What to write.

    Raises:
        OSError: The disk is full or the folder not writable; nothing is left under ``path``'s name.
    """
    partial = path.with_name(f".{os.getpid()}.part.{path.name}")
    try:
        with naming(path):
            partial.write_text(text, encoding="utf-8")
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    partial.replace(path)


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


def check_identity(
    path: Path, before: Mapping[str, JsonValue], now: Mapping[str, JsonValue]
) -> None:
    """Refuse to continue under other settings or with other data.

    Raises:
        StateError: Names what differs.
    """
    now = json.loads(json.dumps(now))  # tuples as lists, as in the file
    names = list(_differences(before, now))
    if names:
        raise StateError(
            f"{path}: trained with another {', '.join(names)}; expected the same; "
            "choose another -o or --name, or give --overwrite to start anew"
        )


def _differences(before: Mapping[str, JsonValue], now: Mapping[str, JsonValue]) -> Iterator[str]:
    """Name what differs; of settings, one by one."""
    for key in [*now, *(key for key in before if key not in now)]:
        old, new = before.get(key), now.get(key)
        if isinstance(old, dict) and isinstance(new, dict):
            yield from _differences(old, new)
        elif old != new:
            is_long = len(f"{old}{new}") > 60
            yield (
                key.replace("_", " ") if is_long else f"{key.replace('_', ' ')} ({old}, not {new})"
            )
