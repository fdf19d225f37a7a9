"""``mcpseg segment --follow``: a recording that grows, as the command sees it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from mcpseg_cli.choices import Frame

if TYPE_CHECKING:
    from mcpseg_cli.formats.growing_folder import GrowingFolder
    from mcpseg_cli.formats.recording import Recording
    from mcpseg_cli.segment.run import ScanReport, SegmentRun


@dataclass(frozen=True)
class Arriving:
    """Scans that arrive while they are labelled."""

    folder: GrowingFolder

    @classmethod
    def of(
        cls, scans: Path, poses: Path, frame: Frame, max_gap: float, output: Path | None
    ) -> Arriving:
        """Watch a folder and a pose file; ``output`` is the folder of a run to be continued."""
        from mcpseg_cli.formats.growing_folder import GrowingFolder
        from mcpseg_cli.segment.follow import consumed_scans

        consumed = consumed_scans(output) if output else []
        return cls(GrowingFolder(scans, poses, frame, max_gap, consumed))

    @property
    def paired(self) -> Recording:
        """All scans that are there now."""
        assert self.folder.paired is not None, "wait for the first"
        return self.folder.paired

    def first(self, idle_s: float | None, *, quiet: bool) -> Recording:
        """Wait for as many scans as the sensor is told by; give those that are complete."""
        from mcpseg_cli.segment.follow import wait_for_scans
        from mcpseg_cli.segment.sensor import NUM_SCANS

        told = partial(_tell, quiet=quiet)
        ready = wait_for_scans(self.folder, NUM_SCANS, idle_s, told)
        return replace(self.paired, scans=tuple(ready))

    def label(
        self,
        run: SegmentRun,
        idle_s: float | None,
        should_stop: Callable[[], bool],
        *,
        quiet: bool,
    ) -> Iterator[ScanReport]:
        """Label what arrives, see ``label_arriving``."""
        from mcpseg_cli.segment.follow import label_arriving

        told = partial(_tell, quiet=quiet)
        yield from label_arriving(run, self.folder, should_stop, idle_s, told)


def _tell(problem: str, *, quiet: bool) -> None:
    from mcpseg_cli.cli.display import notice

    notice(f"mcpseg: waiting: {problem}", quiet=quiet)
