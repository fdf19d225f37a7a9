"""What a run writes, as a log of steps, and the folders that a power cut may leave of it.

Our own writers are recorded call by call. SQLite's are not seen from Python: what it changed of its
two files is found after each of its transactions and split as it writes: frames of the log in
their order, pages of the database. Between two waits for the disk (``sync``), a disk may have kept
any of the writes, and the first few of the new names.
"""

from __future__ import annotations

import os
import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from unittest.mock import patch

from mcpseg_cli.segment import database

_PAGE, _LOG_HEADER, _FRAME_HEADER = 4096, 32, 24


@dataclass(frozen=True)
class Step:
    """One step: ``write``, ``cut``, ``rename``, ``remove``, ``sync`` or ``told``."""

    kind: str
    name: str = ""
    offset: int = 0
    data: bytes = b""
    target: str = ""


@dataclass
class Recorder:
    """The steps of a run in a folder."""

    folder: Path
    steps: list[Step] = field(default_factory=list)
    known: dict[str, bytes] = field(default_factory=dict)

    @contextmanager
    def recording(self) -> Iterator[None]:
        """Record all that is written meanwhile."""
        pwrite, fsync, replace = os.pwrite, os.fsync, Path.replace
        transaction, close = database.Database.transaction, database.Database.close

        def recorded_pwrite(file: int, data: bytes, offset: int) -> int:
            written = pwrite(file, data, offset)
            self._catch_up(Path(f"/proc/self/fd/{file}").readlink())
            return written

        def recorded_fsync(file: int) -> None:
            fsync(file)
            path = Path(f"/proc/self/fd/{file}").readlink()
            self._catch_up(path)
            self._add("sync", path)

        def recorded_replace(path: Path, target: Path) -> Path:
            self._catch_up(path)
            self._catch_up(self.folder / "events.jsonl")
            done = replace(path, target)
            if (name := self._name(path)) is not None:
                new = target.relative_to(self.folder).as_posix()
                self.steps.append(Step("rename", name, target=new))
                self.known[new] = self.known.pop(name)
            return done

        @contextmanager
        def recorded_transaction(self_: database.Database) -> Iterator[None]:
            with transaction(self_):
                yield
            self.catch_up_database()

        def recorded_close(self_: database.Database) -> None:
            close(self_)
            self.catch_up_database(("state.sqlite", "state.sqlite-wal"))

        with (
            patch.object(os, "pwrite", recorded_pwrite),
            patch.object(os, "fsync", recorded_fsync),
            patch.object(Path, "replace", recorded_replace),
            patch.object(database.Database, "transaction", recorded_transaction),
            patch.object(database.Database, "close", recorded_close),
        ):
            yield

    def told(self) -> None:
        """Note that a scan was told of."""
        self._catch_up(self.folder / "events.jsonl")
        self.steps.append(Step("told"))

    def catch_up_database(
        self, names: tuple[str, str] = ("state.sqlite-wal", "state.sqlite")
    ) -> None:
        """Find what SQLite wrote, in its order; it waits for the disk after each of its files."""
        for name in names:
            if self._catch_up(self.folder / name):
                self._add("sync", self.folder / name)

    def _name(self, path: Path) -> str | None:
        """Name a path within the folder; None outside."""
        inside = path == self.folder or self.folder in path.parents
        return path.relative_to(self.folder).as_posix() if inside else None

    def _add(self, kind: str, path: Path) -> None:
        if (name := self._name(path)) is not None:
            self.steps.append(Step(kind, name))

    def _catch_up(self, path: Path) -> bool:
        """Find what was written of a file since the last time; tell whether anything was."""
        name = self._name(path)
        if name is None or path.is_dir():
            return False
        before = self.known.get(name)
        if not path.exists():
            if before is not None:
                self.steps.append(Step("remove", name))
                del self.known[name]
            return before is not None

        now = path.read_bytes()
        if before == now:
            return False
        if before is None or len(now) < len(before):
            self.steps.append(Step("cut", name, len(now) if before is not None else 0))
            before = (before or b"")[: len(now)]
        for start, end in _blocks(name, len(now)):
            if before[start:end] != now[start:end]:
                self.steps.append(Step("write", name, start, now[start:end]))
        self.known[name] = now
        return True


def _blocks(name: str, size: int) -> Iterator[tuple[int, int]]:
    """Split a file as it is written: the log of SQLite in frames, all else in pages."""
    start, step = (_LOG_HEADER, _FRAME_HEADER + _PAGE) if name.endswith("-wal") else (0, _PAGE)
    if start:
        yield 0, start
    for begin in range(start, size, step):
        yield begin, min(begin + step, size)


def folder_after(steps: list[Step], folder: Path, keeps: Callable[[], bool] = lambda: True) -> None:
    """Make the folder that a power cut leaves after some steps.

    Args:
        steps: All that was begun before.
        folder: Where; must not exist.
        keeps: Asked for each write, and for each new name in turn, that nobody waited for.
    """
    synced = {step.name: number for number, step in enumerate(steps) if step.kind == "sync"}
    files: dict[str, bytearray] = {}
    names_end = False
    for number, step in enumerate(steps):
        parent = step.name.rpartition("/")[0] or "."
        is_named = number < max(synced.get(parent, -1), synced.get(step.target, -1))
        if step.kind == "rename" and not names_end and step.name in files:
            names_end = not is_named and not keeps()
            if not names_end:
                files[step.target] = files.pop(step.name)
                synced[step.target] = max(synced.get(step.target, -1), synced.get(step.name, -1))
        elif step.kind == "remove":
            files.pop(step.name, None)
        elif step.kind == "cut":
            content = files.setdefault(step.name, bytearray())
            del content[step.offset :]
        elif step.kind == "write" and (number < synced.get(step.name, -1) or keeps()):
            content = files.setdefault(step.name, bytearray())
            content.extend(bytes(max(0, step.offset - len(content))))
            content[step.offset : step.offset + len(step.data)] = step.data

    (folder / "scans").mkdir(parents=True)
    for name, content in files.items():
        (folder / name).write_bytes(content)


def some(rng: random.Random) -> Callable[[], bool]:
    """Keep every other thing, at random."""
    return lambda: rng.random() < 0.5


__all__ = ["Recorder", "Step", "folder_after", "some"]
