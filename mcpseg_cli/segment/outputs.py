"""What people and programs read of a run: the files that follow its checkpoint."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.formats import CLOUD_SUFFIXES
from mcpseg_cli.formats.natural_order import split_ending
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.incremental.objects import MapObject, objects_text
from mcpseg_cli.resumable import flush, remove_leftovers, whole_file
from mcpseg_cli.segment.events import Event, append_event, reconcile_events
from mcpseg_cli.segment.map_ply import LabelledMap
from mcpseg_cli.segment.run_record import RunOptions, RunRecord
from mcpseg_cli.segment.scan_record import ScanRecord

OBJECTS = "objects.json"


def labelled_name(name: str, ending: str | None) -> str:
    """Name the labelled copy of a scan.

    Args:
        name: Name of the scan.
        ending: Format of the copy, without a dot; None for the scan's own, or PLY where that is
            only read.
    """
    stem, suffix = split_ending(name)
    own = suffix if suffix.lower() in CLOUD_SUFFIXES else ".ply"
    return f"{stem}.{ending}" if ending else f"{stem}{own}"


class Outputs:
    """map.ply, the labelled scans, events.jsonl, objects.json and run.json in the folder of a run.

    Args:
        folder: The folder, with ``scans/`` in it; no other process may be writing there.
        classes: Class names, for the header of map.ply.
        options: Format of the labelled scans; what was subtracted from coordinates, for the header
            of map.ply; whether all that is written is on the disk at once.
    """

    def __init__(self, folder: Path, classes: tuple[str, ...], options: RunOptions) -> None:
        self.folder = folder
        self._format = options.format
        self._is_durable = options.durable
        self._map = LabelledMap(folder / "map.ply", classes, options.taken.offset)

    def __enter__(self) -> Outputs:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._map.close()

    def reconcile(self, rows: MapRows, events: Sequence[Event]) -> None:
        """Bring map and events to where the checkpoint is: a killed run leaves them elsewhere.

        Args:
            rows: The whole map.
            events: Those of all consumed scans.

        Raises:
            OSError: The disk is full.
        """
        scans = self.folder / "scans"
        for folder in (self.folder, scans, *scans.rglob("*/")):
            remove_leftovers(folder)
        self._map.reconcile(rows)
        self.reconcile_events(events)

    def reconcile_events(self, events: Sequence[Event]) -> None:
        """Bring events.jsonl to where the checkpoint is, see ``reconcile``."""
        reconcile_events(self.folder / "events.jsonl", events)
        if self._is_durable:
            (self.folder / "events.jsonl").touch()
            for path in (self.folder / "events.jsonl", self.folder / "scans", self.folder):
                flush(path)
            self._map.flush()

    def labelled_scan(self, name: str) -> Path:
        """Return where the labelled copy of a scan goes."""
        path = self.folder / "scans" / labelled_name(name, self._format)
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def has_labelled(self, record: ScanRecord) -> bool:
        """Tell whether the labelled copy of a scan is there, of its size; no link is followed."""
        path = f"{self.folder}/scans/{labelled_name(record.name, self._format)}"
        try:
            status = os.lstat(path)
        except FileNotFoundError:
            return False
        return stat.S_ISREG(status.st_mode) and status.st_size == record.output_size

    def update_map(self, rows: MapRows, changed: NDArray[np.int32]) -> None:
        """Bring map.ply up to date, see ``LabelledMap.update``."""
        self._map.update(rows, changed)
        if self._is_durable:
            self._map.flush()

    def append_event(
        self, event: Event, ms: Mapping[str, float] | None, *, is_first: bool = False
    ) -> None:
        """Append a line to events.jsonl, see ``events.append_event``."""
        durable = self._is_durable
        path = self.folder / "events.jsonl"
        append_event(path, event, ms, is_first=is_first, is_durable=durable)

    def write_objects(
        self,
        objects: Iterable[MapObject],
        parts: Mapping[int, Mapping[str, list[int]]] | None = None,
    ) -> str:
        """Write objects.json, object by object; return its SHA-256.

        Args:
            objects: All.
            parts: Of a merged map, by object: the ids in each part, see ``Sources.of_objects``.
        """
        digest = hashlib.sha256()
        with (
            whole_file(self.folder / OBJECTS, is_durable=self._is_durable) as partial,
            partial.open("wb") as file,
        ):
            for text in objects_text(objects, parts):
                data = text.encode()
                digest.update(data)
                file.write(data)
        return digest.hexdigest()

    def hash_of_objects(self) -> str | None:
        """Return the SHA-256 of objects.json as it is; None where there is none."""
        path = self.folder / OBJECTS
        if not path.is_file():
            return None
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()

    def write_record(self, record: RunRecord) -> None:
        """Write run.json."""
        record.write(self.folder)
