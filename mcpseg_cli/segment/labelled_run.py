"""The folder of a run, read as it is at one moment: voxels in parts, scans, classes, objects."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError, OutputError, StateError
from mcpseg_cli.formats.intake import Intake
from mcpseg_cli.incremental.clustering import dequantise
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.incremental.objects import MapObject, list_objects
from mcpseg_cli.incremental.regrouping import Moves
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.map_changes import LabelChanges
from mcpseg_cli.segment.run_record import RunRecord
from mcpseg_cli.segment.scan_record import ScanRecord

_PART_ROWS = 1 << 16  # voxels handed out at a time: 20 MB with all that is made of them on the way
_WAL_HEADER = 32  # bytes; holds the salts that change whenever the log starts again
_ATTEMPTS = 20


@dataclass(frozen=True)
class MapPart:
    """A range of voxels as they are now.

    Attributes:
        ids: (V,) int64 consecutive voxel ids.
        xyz: (V, 3) float32, metres, map frame.
        rgb: (V, 3) uint8.
        semantic: (V,) uint8 class index.
        instance: (V,) int32 object id after all merges.
        confidence: (V,) float32 in 0-1.
        quantised: (V, E) int16 embedding as stored.
        scan: (V,) int32 number of the scan that first saw the voxel.
    """

    ids: NDArray[np.int64]
    xyz: NDArray[np.float32]
    rgb: NDArray[np.uint8]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]
    confidence: NDArray[np.float32]
    quantised: NDArray[np.int16]
    scan: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def embedding(self) -> NDArray[np.float32]:
        """(V, E) float32 embedding, of unit length but for rounding; a new array."""
        return dequantise(self.quantised)

    def select(self, rows: NDArray[np.bool_] | NDArray[np.intp] | slice) -> MapPart:
        """Return some of its voxels: (V,) bool, indices or a slice."""
        return MapPart(*(getattr(self, field.name)[rows] for field in fields(self)))


def joined(parts: Iterable[MapPart]) -> MapPart:
    """Return several parts as one; a copy."""
    columns = [[getattr(part, field.name) for field in fields(MapPart)] for part in parts]
    return MapPart(*(np.concatenate(column) for column in zip(*columns, strict=True)))


class LabelledRun:
    """The folder of a run, finished or in progress, as it was when this was made.

    The checkpoint is copied first, so that a run in progress is neither disturbed nor followed, and
    nothing is ever written into its folder. The copy (about 130 bytes a voxel,
    230 where all looks count) lies in the system's folder for temporary files.

    Args:
        folder: Folder of the run.
        told: Called while ``parts`` goes through the map: voxels done, voxels in all.

    Raises:
        InputError: Not the folder of a run, or of one without any voxel yet.
        StateError: The checkpoint is damaged or of another version.
        OutputError: There is no room for the copy.
    """

    def __init__(self, folder: Path, told: Callable[[int, int], None] = lambda *_: None) -> None:
        self.folder = folder
        self._told = told
        _check_folder(folder)
        self.classes = RunRecord.read(folder).classes

        with ExitStack() as opened:
            # a copy: the original may be written at this moment
            scratch = opened.enter_context(tempfile.TemporaryDirectory(prefix="mcpseg-"))
            copy = _copy_checkpoint(folder, Path(scratch))
            self._state = opened.enter_context(State(copy, original=folder / "state.sqlite"))

            self.scans: list[ScanRecord] = self._state.scans()
            if not self.scans or self.scans[-1].num_voxels == 0:
                found, expected = "a run without any labelled voxel yet", "a labelled map"
                raise InputError(folder, found, expected, "wait for a scan")
            self._open_files = opened.pop_all()

    def __enter__(self) -> LabelledRun:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._open_files.close()

    def __len__(self) -> int:
        return self.scans[-1].num_voxels

    @property
    def poses(self) -> NDArray[np.float64]:
        """(S, 4, 4) poses of all scans, sensor to map, metres; of those without, the last known."""
        poses = np.stack([record.pose for record in self.scans])
        known = np.flatnonzero(np.isfinite(poses[:, 0, 3]))
        latest = np.searchsorted(known, np.arange(len(poses)), side="right") - 1
        last_known: NDArray[np.float64] = poses[known[latest.clip(0)]]
        return last_known

    @cached_property
    def settings(self) -> dict[str, object]:
        """The configuration of the run: ``voxel_size``, ``frame``, all that decided its labels."""
        return self._state.configuration() or {}

    @property
    def intake(self) -> Intake:
        """How the recording's coordinates became those of the map."""
        return Intake.of(self.settings)

    @property
    def voxel_size(self) -> float:
        """Edge of a voxel, metres; 0.1 where the configuration does not say."""
        size = self.settings.get("voxel_size")
        return size if isinstance(size, float) else 0.1

    def parts(self) -> Iterator[MapPart]:
        """Iterate over all voxels, many at a time, by id: in the order they were first seen in.

        Raises:
            StateError: The checkpoint is damaged.
        """
        current = self.instance_after(len(self.scans) - 1)
        last_ids = np.array([record.num_voxels for record in self.scans])

        start = 0
        for rows in _regrouped(self._state.map_rows()):
            ids = np.arange(start, start + len(rows))

            # labels as they are now; the scan is the first that ends behind a voxel
            instance = current[start : start + len(rows)]
            scan = np.searchsorted(last_ids, ids, side="right").astype(np.int32)
            yield MapPart(
                ids, rows.xyz, rows.rgb, rows.semantic, instance, rows.confidence,
                rows.embedding, scan,
            )  # fmt: skip

            start += len(rows)
            self._told(start, len(self))

    def whole(self) -> MapPart:
        """Return all voxels at once: about 150 bytes each."""
        return joined(self.parts())

    def instance_after(self, scan: int) -> NDArray[np.int32]:
        """Return (V,) int32 object ids as they were after a scan, see ``State``."""
        return self._state.instance_after(scan)

    def merges(self, until: int | None = None) -> NDArray[np.int32]:
        """Return (P, 2) int32 merges in order, old id and surviving id, see ``State``."""
        return self._state.merges(until)

    def label_changes(self, scan: int) -> Iterator[LabelChanges]:
        """Give what a scan changed of the labels of voxels known before, if anything."""
        return self._state.label_changes(scan, scan)

    def moves(self, scan: int) -> Iterator[Moves]:
        """Give the voxels that a scan took to other objects otherwise than by merges, if any."""
        return self._state.moves(scan, scan)

    def first_labels(self) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
        """Return (V,) uint8 class and (V,) int32 object id of every voxel as first seen; copies."""
        return self._state.first_labels()[0], self._state.first_instance()

    def objects(self) -> list[MapObject]:
        """Take stock of the objects, by id; needs all voxels but their embedding in memory."""
        known = joined(replace(part, quantised=part.quantised[:, :0]) for part in self.parts())
        rows = MapRows(
            known.xyz, known.rgb, known.semantic, known.confidence, known.instance, known.quantised
        )
        return list_objects(rows, self.classes)


def _check_folder(folder: Path) -> None:
    """Refuse what is not the folder of a run."""
    if (folder / "state.sqlite").is_file():
        return
    if folder.is_dir():
        found = "no state.sqlite"
    else:
        found = "a file" if folder.exists() else "no such folder"
    raise InputError(folder, found, "the folder of a run of 'mcpseg segment'", "check the path")


def _regrouped(parts: Iterator[MapRows]) -> Iterator[MapRows]:
    """Join small parts and cut large ones."""
    waiting: list[MapRows] = []
    for part in parts:
        for start in range(0, len(part), _PART_ROWS):
            waiting.append(_cut(part, slice(start, start + _PART_ROWS)))
            if sum(map(len, waiting)) >= _PART_ROWS:
                yield _joined_rows(waiting)
                waiting = []
    if waiting:
        yield _joined_rows(waiting)


def _cut(rows: MapRows, which: slice) -> MapRows:
    return MapRows(*(getattr(rows, field.name)[which] for field in fields(MapRows)))


def _joined_rows(parts: list[MapRows]) -> MapRows:
    return MapRows(
        *(
            np.concatenate([getattr(part, field.name) for part in parts])
            for field in fields(MapRows)
        )
    )


def _copy_checkpoint(folder: Path, scratch: Path) -> Path:
    """Copy a checkpoint that may be written at this moment, as it is after one of its transactions.

    The writer appends to the log, and now and then brings what is in the log into the database and
    starts the log again. A database copied in between is mended by the log, unless the log has been
    started again meanwhile.
    """
    source, copy = folder / "state.sqlite", scratch / "state.sqlite"
    source_log, log = folder / "state.sqlite-wal", scratch / "state.sqlite-wal"
    for _ in range(_ATTEMPTS):
        before = _identity(source_log)

        # the database first: the log mends it
        try:
            shutil.copyfile(source, copy)
            log.unlink(missing_ok=True)
            if before:
                shutil.copyfile(source_log, log)
        except FileNotFoundError:  # the log: its run has just ended
            continue
        except OSError as error:
            raise OutputError(
                f"{scratch.parent}: no copy of {source} ({error.strerror}); "
                f"expected permission to read, and room for {source.stat().st_size / 1e6:,.0f} MB; "
                "make space or set TMPDIR to another folder"
            ) from error

        # the same log before, after and in the copy
        if _identity(source_log) == before == _identity(log):
            return copy
    raise StateError(
        f"{source}: changes too fast to be copied; expected a pause between scans; try again later"
    )


def _identity(log: Path) -> bytes:
    """Give what changes when a log is started again; nothing for an empty or missing log."""
    try:
        with log.open("rb") as file:
            return file.read(_WAL_HEADER)
    except FileNotFoundError:
        return b""
