"""What people and programs read of a run: the files that follow its checkpoint."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.incremental.objects import MapObject
from mcpseg_cli.resumable import remove_leftovers, write_whole
from mcpseg_cli.segment.events import Event, append_event, reconcile_events
from mcpseg_cli.segment.map_ply import LabelledMap
from mcpseg_cli.segment.run_record import RunRecord


class Outputs:
    """map.ply, the labelled scans, events.jsonl, objects.json and run.json in the folder of a run.

    Args:
        folder: The folder, with ``scans/`` in it; no other process may be writing there.
        classes: Class names, for the header of map.ply.
        scan_format: Ending of the labelled scans, without its dot; None for each scan's own.
    """

    def __init__(self, folder: Path, classes: tuple[str, ...], scan_format: str | None) -> None:
        self.folder = folder
        self._format = scan_format
        self._map = LabelledMap(folder / "map.ply", classes)

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
        for folder in (self.folder, self.folder / "scans"):
            remove_leftovers(folder)
        self._map.reconcile(rows)
        reconcile_events(self.folder / "events.jsonl", events)

    def labelled_scan(self, name: str) -> Path:
        """Return where the labelled copy of a scan goes."""
        path = self.folder / "scans" / name
        return path.with_suffix(f".{self._format}") if self._format else path

    def update_map(self, rows: MapRows, changed: NDArray[np.int32]) -> None:
        """Bring map.ply up to date, see ``LabelledMap.update``."""
        self._map.update(rows, changed)

    def append_event(
        self, event: Event, ms: Mapping[str, float] | None, *, is_first: bool = False
    ) -> None:
        """Append a line to events.jsonl, see ``events.append_event``."""
        append_event(self.folder / "events.jsonl", event, ms, is_first=is_first)

    def write_objects(self, objects: Sequence[MapObject]) -> None:
        """Write objects.json."""
        text = json.dumps([asdict(item) for item in objects], indent=1) + "\n"
        write_whole(self.folder / "objects.json", text)

    def write_record(self, record: RunRecord) -> None:
        """Write run.json."""
        record.write(self.folder)
