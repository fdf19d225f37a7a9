"""The folder of a run, as far as its scores need it; everything in it is read once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from mcpseg_cli.segment.events import ScanEvent, read_events
from mcpseg_cli.segment.outputs import labelled_name
from mcpseg_cli.segment.run_record import RunConfiguration, RunRecord


@dataclass(frozen=True)
class RunFolder:
    """What the small files of a run say, and where the large ones are.

    Attributes:
        path: The folder.
        configuration: What decided its outputs; the defaults for a folder with a map and no record.
        events: Its scans, in order; None without events.jsonl.
    """

    path: Path
    configuration: RunConfiguration
    events: tuple[ScanEvent, ...] | None

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read the record and the events of a run.

        Args:
            path: Its folder. A map alone is enough, but events are not understood without run.json.

        Raises:
            InputError: run.json or events.jsonl is damaged, or the first is missing.
            OSError: One of them cannot be read.
        """
        events = read_events(path / "events.jsonl") if (path / "events.jsonl").is_file() else None
        if events is None and not (path / "run.json").is_file():
            return cls(path, RunConfiguration(), None)
        configuration = RunRecord.read(path).configuration
        return cls(path, configuration, None if events is None else tuple(events))

    @property
    def events_path(self) -> Path:
        """A line for each scan."""
        return self.path / "events.jsonl"

    @property
    def state_path(self) -> Path:
        """The checkpoint, which has the poses of the scans."""
        return self.path / "state.sqlite"

    def labelled_scans(self) -> list[Path]:
        """List where the labelled copy of every scan that was read should be."""
        ending = self.configuration.format
        read = [event for event in self.events or () if not event.skipped]
        return [self.path / "scans" / labelled_name(event.name, ending) for event in read]
