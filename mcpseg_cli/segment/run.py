"""A run of ``mcpseg segment``: every scan through the segmenter, the checkpoint and the outputs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter
from types import TracebackType

from mcpseg_cli.errors import InputError, StateError
from mcpseg_cli.formats import Cloud, whole_cloud, write_cloud
from mcpseg_cli.formats.fingerprint import Fingerprint
from mcpseg_cli.formats.recording import ScanSource, read_scan
from mcpseg_cli.formats.scan_files import ScanFile
from mcpseg_cli.formats.scan_source import pose_of
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.incremental.regrouping import Moves
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter, ScanUpdate
from mcpseg_cli.resumable import check_same
from mcpseg_cli.scan import Scan
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.events import LabelledEvent
from mcpseg_cli.segment.folder import held_folder
from mcpseg_cli.segment.map_changes import LabelChanges, MapChanges
from mcpseg_cli.segment.outputs import OBJECTS, Outputs
from mcpseg_cli.segment.past_labels import PastLabels
from mcpseg_cli.segment.run_record import RunConfiguration, RunOptions, RunRecord
from mcpseg_cli.segment.scan_log import ScanLog
from mcpseg_cli.segment.scan_record import ScanRecord, check_consumed, skipped_scan
from mcpseg_cli.segment.settled_file import read_settled

_DECISIVE = ("method", "offline", "weights")  # other differences follow from these
_REMEDY = "go back to it, choose another -o, or start again with --overwrite"


@dataclass(frozen=True)
class ScanReport:
    """What became of one scan.

    Attributes:
        name: Name of the scan.
        num_points: Points measured in it.
        update: What it changed; None when it was skipped.
        error: Why it was skipped.
        ms: Milliseconds from reading to the last output.
        num_unmeasured: Its other points: without coordinates, no return, withheld or noise.
        is_first: Whether it was the first to be labelled since the start, and waited for kernels.
    """

    name: str
    num_points: int
    update: ScanUpdate | None
    error: str | None
    ms: float
    num_unmeasured: int = 0
    is_first: bool = False


@dataclass(frozen=True)
class ReadScan:
    """A scan in memory.

    Attributes:
        source: Where it is from.
        file: What its content was.
        scan: Its measured points in the map frame.
        cloud: All that the file holds.
    """

    source: ScanSource
    file: Fingerprint
    scan: Scan
    cloud: Cloud


class SegmentRun:
    """An open run: the segmenter, its checkpoint and its outputs, where the last scan left them.

    Args:
        recording: All scans, consumed ones included, in order.
        output: Folder of the run; made if not there.
        segmenter: A new segmenter.
        options: How to read and write.
        overwrite: Delete the run that is there.

    Attributes:
        records: The consumed scans, counted.
        pending: The scans that were not consumed when the run was opened.
        resumed_from: How many were consumed then.
        outputs: The files that follow the checkpoint.

    Raises:
        StateError: The folder is in use, or holds a run of other settings, weights or scans.
        OutputError: The folder cannot be written, or is not one for results.
        InputError: A consumed scan whose labelled copy is lost cannot be read any more.
    """

    records: ScanLog
    pending: list[ScanSource]
    resumed_from: int
    outputs: Outputs

    def __init__(
        self,
        recording: Sequence[ScanSource],
        output: Path,
        segmenter: IncrementalSegmenter,
        options: RunOptions,
        *,
        overwrite: bool = False,
    ) -> None:
        self.output = output
        self.segmenter = segmenter
        self.options = options
        self._is_warm = False
        with ExitStack() as opened:
            opened.enter_context(held_folder(output, recording, overwrite=overwrite))
            state = State(output / "state.sqlite", is_durable=options.durable)
            self._state = opened.enter_context(state)
            self._open(recording, opened)
            self._open_files = opened.pop_all()

    def _open(self, recording: Sequence[ScanSource], opened: ExitStack) -> None:
        """Put everything where the checkpoint is."""
        self._check_request()
        records = self._state.scans()
        self.records = ScanLog(records)
        self.pending = check_consumed(recording, records, self._state.path)
        merged = [record for record in records if record.is_merged]
        self._merged = {record.file.sha256: record.name for record in merged}
        self.resumed_from = len(self.records)
        if self.options.offline and self.resumed_from and self.pending:
            raise StateError(
                f"{self.output}: {self.resumed_from:,} scans labelled offline, "
                f"{len(self.pending):,} more given; expected the same scans; "
                "choose another -o, or start again with --overwrite"
            )
        self._restore()

        # the outputs may be behind or ahead after a kill
        self.outputs = opened.enter_context(
            Outputs(self.output, self.segmenter.classes, self.options)
        )
        self.outputs.reconcile(self.segmenter.rows(), [record.event for record in records])
        self._write_lost_scans(recording, records)
        self.outputs.write_record(RunRecord.of(self.segmenter, self.options))

    def __enter__(self) -> SegmentRun:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._open_files.close()

    def run(self, should_stop: Callable[[], bool] = lambda: False) -> Iterator[ScanReport]:
        """Label the pending scans one by one; each is committed and written, then reported.

        Args:
            should_stop: Asked before every scan.

        Raises:
            InputError: A scan cannot be read and ``on_error`` is ``stop``; all scans before it are
                kept.
            OutputError: The disk is full; all committed scans are kept.
        """
        for source in self.pending:
            if should_stop():
                return
            started = perf_counter()
            try:
                read = self.read(source)
            except (InputError, OSError) as error:
                yield self.refuse(source, error, started)
            else:
                yield self.label(read, started)

    def scans_from(self, first: int) -> list[ScanRecord]:
        """List the consumed scans from a number on, from the checkpoint."""
        return self._state.scans(first)

    def read(self, source: ScanSource) -> ReadScan:
        """Read a scan as this run takes it.

        Raises:
            InputError: It is damaged, or a map that was merged into this one has consumed it.
            OSError: It cannot be read.
        """
        if not isinstance(source, ScanFile):  # a part of a container, with a content of its own
            file, points = source.fingerprint(), self._read_points(source)
        else:
            file, points = read_settled(source.path, lambda: self._read_points(source))
        if (known := self._merged.get(file.sha256)) is not None:
            found, expected = f"in the map already, as {known}", "a scan that no merged map has"
            raise InputError(source.path, found, expected, "leave it out")
        return ReadScan(source, file, *points)

    def _read_points(self, source: ScanSource) -> tuple[Scan, Cloud]:
        return read_scan(source, self.options.taken, self.segmenter.settings.voxel_size)

    def commit_all(self, scans: list[tuple[ScanRecord, MapRows]]) -> None:
        """Commit scans that were labelled together, see ``State.commit_all``."""
        self._state.commit_all(scans)
        for record, _ in scans:
            self.records.append(record)

    def write_objects(self) -> None:
        """Write objects.json from the map as it is now, unless that is ahead of the checkpoint.

        So it is after a failed commit. A file that shows this map already stays.
        """
        known = (self.records.num_used, self.records.num_voxels)
        if (self.segmenter.num_scans, len(self.segmenter.map)) != known:
            return
        before = self._state.written(OBJECTS)
        if before is None or before != self.outputs.hash_of_objects():
            parts = self._state.sources.of_objects(self.segmenter.clusters.instance)
            sha256 = self.outputs.write_objects(self.segmenter.objects(), parts)
            self._state.set_written(OBJECTS, sha256)

    def label(self, read: ReadScan, started: float) -> ScanReport:
        """Label a scan, commit it, then bring the outputs up to date.

        Args:
            read: The scan.
            started: When its reading began, on the clock of ``perf_counter``.

        Raises:
            OutputError: The disk is full; all committed scans are kept.
        """
        read_ms = 1e3 * (perf_counter() - started)
        update = self.segmenter.register_scan(read.scan)
        labels = self.segmenter.labels(update.point_ids)
        name, num_points = read.source.name, len(read.scan.xyz)
        num_objects = self.segmenter.clusters.num_objects
        event = LabelledEvent.of(len(self.records), name, num_points, update, num_objects)

        # what cannot be written is not committed; what is committed can be written again
        before = perf_counter()
        labelled = read.cloud.with_labels(labels)
        path, durable = self.outputs.labelled_scan(name), self.options.durable
        with whole_cloud(path, labelled, is_durable=durable) as partial:
            written = perf_counter()
            record = ScanRecord(
                name, read.file, pose_of(read.source), num_points, len(self.segmenter.map),
                update.floor, None, event, partial.stat().st_size,
            )  # fmt: skip
            rows = self.segmenter.rows(update.first_new)
            self._state.commit(record, rows, self._changes(update))
            committed = perf_counter()
            self.records.append(record)
        self.outputs.update_map(self.segmenter.rows(), update.changed)

        write_s = written - before + perf_counter() - committed
        ms = {"read": read_ms, **update.ms}
        ms |= {"commit": 1e3 * (committed - written), "write": 1e3 * write_s}
        is_first, self._is_warm = not self._is_warm, True
        self.outputs.append_event(event, ms, is_first=is_first)
        total_ms = 1e3 * (perf_counter() - started)
        num_unmeasured = len(read.cloud) - num_points
        update = replace(update, ms=ms)
        return ScanReport(name, num_points, update, None, total_ms, num_unmeasured, is_first)

    def _changes(self, update: ScanUpdate) -> MapChanges:
        """Collect what a scan changed of what is in the checkpoint."""
        ids, segmenter = update.relabelled, self.segmenter
        labels = LabelChanges(ids, segmenter.semantic[ids], segmenter.confidence[ids])
        moves = Moves(update.moved, segmenter.clusters.instance[update.moved])
        return MapChanges(update.merges, moves, labels, segmenter.evidence_blocks(update.judged))

    def refuse(self, source: ScanSource, error: InputError | OSError, started: float) -> ScanReport:
        """Record a scan that cannot be read, and go on without it.

        Args:
            source: The scan.
            error: Why; raised again where ``on_error`` is ``stop``.
            started: When its reading began, on the clock of ``perf_counter``.
        """
        if self.options.on_error != "skip":
            raise error
        num_voxels = len(self.segmenter.map)
        floor = self.records.floor
        record = skipped_scan(len(self.records), source, error, num_voxels, floor)
        self._state.commit(record, self.segmenter.rows(num_voxels), MapChanges.none())
        self.records.append(record)
        self.outputs.append_event(record.event, None)
        return ScanReport(record.name, 0, None, str(error), 1e3 * (perf_counter() - started))

    def _check_request(self) -> None:
        """Write down what a new run was asked for, or compare with what the run was begun with."""
        asked = RunConfiguration.of(self.segmenter, self.options).as_json()
        kept = self._state.configuration()
        if kept is None:
            self._state.set_configuration(asked)
            return
        check_same(self._state.path, kept, asked, remedy=_REMEDY, decisive=_DECISIVE)

    def _restore(self) -> None:
        """Put the segmenter where the checkpoint is."""
        state, log = self._state, self.records
        evidence = None if self.options.offline else state.evidence()
        try:
            self.segmenter.restore(
                state.map_rows(), state.history(), log.num_used, log.floor, evidence
            )
        except (ValueError, IndexError) as error:
            raise StateError(
                f"{state.path}: damaged ({error}); expected an mcpseg checkpoint; "
                "start again with --overwrite"
            ) from error

    def _write_lost_scans(
        self, recording: Sequence[ScanSource], records: Sequence[ScanRecord]
    ) -> None:
        """Write labelled scans that are missing or cut, with the labels they had."""
        past: PastLabels | None = None
        own = [each for each in enumerate(records) if not each[1].is_merged]
        for (number, record), source in zip(own, recording, strict=False):
            if record.error is not None or self.outputs.has_labelled(record):
                continue
            path = self.outputs.labelled_scan(record.name)
            scan, cloud = self._read_points(source)
            past = past or PastLabels(self._state, self.segmenter.classes)
            labels = past.after(number, self.segmenter.find_points(scan))
            write_cloud(path, cloud.with_labels(labels))
