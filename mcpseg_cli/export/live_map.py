"""A run shown in the Rerun viewer while it goes on (an extra: ``mcpseg[rerun]``)."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import OutputError
from mcpseg_cli.export.rerun import LabelledPoints, RerunLog, open_stream, recording_file
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.segment.scan_record import ScanRecord

SPAWN = "spawn"
_ANSWER_S = 5.0  # a viewer that is there takes what it is told within this time


class LiveMap:
    """Tells Rerun of each scan after it is committed; a context manager.

    Args:
        target: ``spawn`` starts a viewer, which comes with rerun-sdk; the URL of a viewer
            (``rerun+http://…/proxy``) is connected to; a .rrd file is written, replaced if there.
        classes: Names that ``semantic`` indexes.
        voxel_size: Metres.

    Raises:
        OutputError: Rerun is not installed, ``target`` is none of these, or no viewer answers.
        OSError: The file cannot be written.
    """

    def __init__(self, target: str, classes: tuple[str, ...], voxel_size: float) -> None:
        self._stream = open_stream()
        self._target = target
        self._ends: list[int] = []  # voxels after each scan told of
        self._file = ExitStack()

        # Rerun connects when it is first told something
        try:
            self._open()
            self._log = RerunLog(self._stream, classes, voxel_size)
            self._stream.flush(timeout_sec=_ANSWER_S)
        except RuntimeError as error:
            self._stream.disconnect()
            raise OutputError(
                f"--rerun {target}: no viewer answers; expected 'spawn', a running viewer's URL "
                "or a .rrd file; start it with 'rerun' or leave --rerun out"
            ) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self._file.__exit__(kind, error, trace)
        finally:
            self._stream.disconnect()

    @property
    def num_scans(self) -> int:
        """How many scans were told of."""
        return len(self._ends)

    def follow(
        self, scans: Iterable[ScanRecord], rows: MapRows, changed: NDArray[np.int32]
    ) -> None:
        """Tell of scans, and of earlier voxels whose labels changed.

        Args:
            scans: All since the last call.
            rows: The whole map as known now.
            changed: (Q,) int32 ids of earlier voxels whose labels changed, ascending.
        """
        # new scans with the voxels that they saw first
        known = len(self._ends)
        for number, scan in enumerate(scans, start=known):
            start = self._ends[-1] if self._ends else 0
            self._ends.append(scan.num_voxels)
            points = _points(rows, slice(start, self._ends[-1]))
            self._log.add_scan(number, scan.pose, points)

        # earlier scans of which a voxel changed
        ends = np.array(self._ends)
        owners = np.unique(np.searchsorted(ends, changed, side="right"))
        for number in owners[owners < known].tolist():
            start = self._ends[number - 1] if number else 0
            self._log.relabel(number, _points(rows, slice(start, self._ends[number])))

    def _open(self) -> None:
        """Start a viewer, connect to one, or open a file."""
        if self._target == SPAWN:
            self._stream.spawn()
        elif "://" in self._target:
            self._stream.connect_grpc(self._target)
        elif self._target.lower().endswith(".rrd"):
            path = Path(self._target)
            self._file.enter_context(recording_file(self._stream, path, path))
        else:
            raise OutputError(
                f"--rerun {self._target}: unknown; expected 'spawn', a viewer's URL or a .rrd file"
            )


def _points(rows: MapRows, which: slice) -> LabelledPoints:
    return LabelledPoints(
        rows.xyz[which], rows.semantic[which], rows.instance[which], rows.confidence[which]
    )
