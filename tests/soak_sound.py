"""What the long campaign damages: a sound file, or one of a folder that is read as a whole."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from mcpseg_cli.errors import McpsegError
from tests.commands import invoke

Read = Callable[[Path], object]


@dataclass(frozen=True)
class Sound:
    """A sound file and what reads it.

    Attributes:
        name: What it is to be called; its ending says which reader it is for.
        data: What is in it.
        read: Reads it at another place.
        is_slow: Whether a whole command reads it, or a process of its own; such are rarer.
    """

    name: str
    data: bytes
    read: Read
    is_slow: bool = False


def sound_of(path: Path, read: Read, *, is_slow: bool = False) -> Sound:
    """Take a file for one that is read by itself."""
    return Sound(path.name, path.read_bytes(), read, is_slow)


def sound_in(folder: Path, inner: str, read: Read, *, is_slow: bool = False) -> Sound:
    """Take a file for one of a folder that is read as a whole.

    Args:
        folder: All its files are sound; stays where it is.
        inner: Path of the file in it.
        read: Reads the folder.
        is_slow: See ``Sound``.
    """
    place = folder / inner
    data = place.read_bytes()

    def read_whole(damaged: Path) -> object:
        place.write_bytes(damaged.read_bytes())
        try:
            return read(folder)
        finally:
            place.write_bytes(data)

    return Sound(f"{folder.name}.{inner.replace('/', '.')}", data, read_whole, is_slow)


def obey(*words: object) -> None:
    """Run a command of mcpseg in this process, which may end well in silence or in one line.

    Raises:
        McpsegError: It ended in one; this is what it said.
    """
    ended = invoke(*words)
    if ended.exception is not None and not isinstance(ended.exception, SystemExit):
        raise ended.exception
    said = ended.stderr.rstrip("\n")
    if ended.exit_code == 1 and said:
        raise McpsegError(said)
    if ended.exit_code or said:
        raise AssertionError(f"exit {ended.exit_code}: {said[-300:]}")
