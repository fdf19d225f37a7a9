"""A run of ``mcpseg segment``: every scan of a recording through the segmenter, the checkpoint and the outputs."""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import perf_counter
from types import TracebackType

import numpy as np

from mcpseg_cli import __version__
from mcpseg_cli.config import RegionGrowingSettings
from mcpseg_cli.errors import InputError, StateError, naming
from mcpseg_cli.formats import PARTIAL, Cloud, write_cloud, write_partial
from mcpseg_cli.formats.recording import ScanFile, read_scan
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter, ScanUpdate
from mcpseg_cli.networks.weights import Weights
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.events import describe_scan, is_json
from mcpseg_cli.segment.folder import (
    _FIRST_TOLD,
    FLAGS,
    RunOptions,
    check_folders,
    check_outputs,
    configuration_of,
    short,
)
from mcpseg_cli.segment.map_ply import LabelledMap
from mcpseg_cli.segment.scan_record import ScanRecord, fingerprint, is_unchanged, skipped_scan


@dataclass(frozen=True)
class ScanReport:
    """What became of one scan.

    Attributes:
        name: File name.
        num_points: Points in it.
        update: What it changed; None when it was skipped.
        error: Why it was skipped.
        ms: Milliseconds from reading to the last output.
    """

    name: str
    num_points: int
    update: ScanUpdate | None
    error: str | None
    ms: float


class SegmentRun:
    """An open run: the segmenter, its checkpoint and its outputs, where the last scan left them.

    Args:
        recording: All scans, consumed ones included, in order.
        output: Folder of the run; made if not there.
        method: What labels: a network with its weights, or region growing.
        segmenter: A new segmenter with it.
        options: How to read and write.

    Raises:
        StateError: The folder is in use, or holds a run of other settings, weights or scans.
        OutputError: The folder cannot be written.
        InputError: A consumed scan whose labelled copy is lost cannot be read any more.
    """

    def __init__(
        self,
        recording: list[ScanFile],
        output: Path,
        method: Weights | RegionGrowingSettings,
        segmenter: IncrementalSegmenter,
        options: RunOptions,
    ) -> None:
        self.output = output
        self.segmenter = segmenter
        self._options = options
        self._is_committed = True
        check_folders(recording, output)
        check_outputs(output)
        (output / "scans").mkdir(parents=True, exist_ok=True)
        self._open_files = ExitStack()
        self._state = self._open_files.enter_context(State(output / "state.sqlite"))
        try:
            self._check_configuration(configuration_of(method, segmenter, options))
            self.records = self._state.scans()
            self.pending = _pending(recording, self.records, self._state.path)
            self.resumed_from = len(self.records)
            self._restore()
            self._map = self._open_files.enter_context(
                LabelledMap(output / "map.ply", segmenter.classes)
            )
            self._reconcile(recording)
            self._write_run_json(method)
        except BaseException:
            self._open_files.close()
            raise

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
        """Label the pending scans one after another; each is committed and written out before it is reported.

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
                identity = fingerprint(source)
                scan, cloud = read_scan(
                    source, self._options.frame, self.segmenter.settings.voxel_size
                )
            except (InputError, OSError) as error:
                if self._options.on_error != "skip":
                    raise
                yield self._skip(source, error, started)
                continue
            read_ms = 1e3 * (perf_counter() - started)
            self._is_committed = False
            update = self.segmenter.register_scan(scan)
            update = replace(update, ms={"read": read_ms, **update.ms})
            record = replace(
                identity,
                num_points=len(cloud),
                num_voxels=len(self.segmenter.map),
                floor=update.floor,
                event=describe_scan(
                    len(self.records),
                    source,
                    len(cloud),
                    update,
                    self.segmenter.clusters.num_objects,
                ),
            )
            yield self._finish_scan(source, cloud, update, record, started)

    def write_objects(self) -> None:
        """Write objects.json from the map as it is now; not after a failed commit: the map is ahead of the run then."""
        if not self._is_committed:
            return
        objects = self.segmenter.objects()
        _replace_text(
            self.output / "objects.json",
            json.dumps([asdict(item) for item in objects], indent=1) + "\n",
        )

    def _finish_scan(
        self, source: ScanFile, cloud: Cloud, update: ScanUpdate, record: ScanRecord, started: float
    ) -> ScanReport:
        """Commit a scan, then bring the outputs up to date; from the commit on nothing of it can be lost."""
        labels = self.segmenter.labels(update.point_ids)
        path = self._labelled_scan(source.path.name)
        before = perf_counter()
        partial = write_partial(
            path, cloud.with_labels(labels)
        )  # what cannot be written is not committed
        written = perf_counter()
        record = replace(record, output_size=partial.stat().st_size)
        try:
            self._state.commit(record, self.segmenter.rows(update.first_new), update.merges)
        except BaseException:
            partial.unlink()
            raise
        committed = perf_counter()
        self._is_committed = True
        self.records.append(record)
        partial.replace(path)
        self._map.update(self.segmenter.rows(), update.changed)
        write_s = written - before + perf_counter() - committed
        ms = update.ms | {"commit": 1e3 * (committed - written), "write": 1e3 * write_s}
        self._append_event(record.event, ms)
        return ScanReport(
            record.name,
            record.num_points,
            replace(update, ms=ms),
            None,
            1e3 * (perf_counter() - started),
        )

    def _skip(self, source: ScanFile, error: InputError | OSError, started: float) -> ScanReport:
        """Record a scan that cannot be read, and go on without it."""
        num_voxels = len(self.segmenter.map)
        floor = self.records[-1].floor if self.records else None
        record = skipped_scan(len(self.records), source, error, num_voxels, floor)
        self._state.commit(record, self.segmenter.rows(num_voxels), np.empty((0, 2), np.int32))
        self.records.append(record)
        self._append_event(record.event, None)
        return ScanReport(record.name, 0, None, str(error), 1e3 * (perf_counter() - started))

    def _check_configuration(self, asked: dict[str, object]) -> None:
        """Write down the configuration of a new run, or compare it with the one the run was started with."""
        kept = self._state.configuration()
        if kept is None:
            self._state.set_configuration(asked)
            return
        for key in sorted(
            kept.keys() | asked.keys(), key=lambda key: (key not in _FIRST_TOLD, key)
        ):
            if kept.get(key) != asked.get(key):
                flag = FLAGS.get(key, f"--{key.replace('_', '-')}")
                raise StateError(
                    f"{self._state.path}: made with {flag} {short(kept.get(key))}, now {short(asked.get(key))}; "
                    "expected the same; go back to it, choose another -o, or start again with --overwrite"
                )

    def _restore(self) -> None:
        """Put the segmenter where the checkpoint is."""
        used = [record for record in self.records if record.error is None]
        try:
            self.segmenter.restore(
                self._state.map_rows(),
                self._state.merges(),
                len(used),
                used[-1].floor if used else None,
            )
        except (ValueError, IndexError) as error:
            raise StateError(
                f"{self._state.path}: damaged ({error}); expected an mcpseg checkpoint; start again with --overwrite"
            ) from error

    def _reconcile(self, recording: list[ScanFile]) -> None:
        """Bring every output to where the checkpoint is: a killed run may have left them behind or ahead."""
        for leftover in (self.output / "scans").glob(f".*{PARTIAL}.*"):
            leftover.unlink()
        self._map.reconcile(self.segmenter.rows())
        self._reconcile_events()
        for number, (record, source) in enumerate(zip(self.records, recording, strict=False)):
            path = self._labelled_scan(record.name)
            if record.error is None and not (
                path.is_file() and path.stat().st_size == record.output_size
            ):
                scan, cloud = read_scan(
                    source, self._options.frame, self.segmenter.settings.voxel_size
                )
                point_ids = self.segmenter.find_points(scan)
                labels = self.segmenter.labels(point_ids)
                then = np.append(
                    self._state.instance_after(number), np.int32(0)
                )  # id -1 finds the 0 at the end
                write_cloud(path, cloud.with_labels(replace(labels, instance=then[point_ids])))

    def _reconcile_events(self) -> None:
        """Keep the complete lines of events.jsonl that belong to committed scans; take the rest from the checkpoint."""
        path = self.output / "events.jsonl"
        lines = path.read_text(errors="replace").split("\n")[:-1] if path.exists() else []
        kept = 0
        for record, line in zip(self.records, lines, strict=False):
            if not (line.startswith(record.event[:-1]) and is_json(line)):
                break
            kept += 1
        if kept != len(self.records) or kept != len(lines):
            events = lines[:kept] + [record.event for record in self.records[kept:]]
            _replace_text(path, "".join(f"{event}\n" for event in events))

    def _labelled_scan(self, name: str) -> Path:
        path = self.output / "scans" / name
        return path.with_suffix(f".{self._options.format}") if self._options.format else path

    def _append_event(self, event: str, ms: dict[str, float] | None) -> None:
        """Append a line to events.jsonl: the checkpoint's, plus the times that are known only after the commit."""
        times = {stage: round(value, 3) for stage, value in ms.items()} if ms else None
        line = f'{event[:-1]}, "ms": {json.dumps(times)}}}\n' if times else f"{event}\n"
        path = self.output / "events.jsonl"
        with naming(path), path.open("a") as file:
            file.write(line)

    def _write_run_json(self, method: Weights | RegionGrowingSettings) -> None:
        weights = None
        if isinstance(method, Weights):
            weights = {
                "name": method.name,
                "sha256": method.sha256,
                **method.info.model_dump(mode="json"),
            }
        document = {
            "mcpseg": __version__,
            "python": platform.python_version(),
            "command": list(self._options.command),
            "method": method.info.architecture if isinstance(method, Weights) else "region-growing",
            "configuration": configuration_of(method, self.segmenter, self._options),
            "weights": weights,
            "classes": list(self.segmenter.classes),
        }
        _replace_text(self.output / "run.json", json.dumps(document, indent=1) + "\n")


def _pending(
    recording: list[ScanFile], records: list[ScanRecord], state_path: Path
) -> list[ScanFile]:
    """Check the consumed scans against what was consumed; return the others."""
    if len(recording) < len(records):
        raise StateError(
            f"{state_path}: {len(records):,} scans consumed, {len(recording):,} given; expected all of them; "
            "restore the missing scans"
        )
    for source, record in zip(recording, records, strict=False):
        if source.path.name != record.name:
            raise StateError(
                f"{source.path}: stands where {record.name} was consumed; "
                "expected new scans after the consumed ones; rename it"
            )
        if record.error is None and not is_unchanged(source, record):
            raise StateError(
                f"{source.path}: changed since it was consumed; expected the same file and pose; "
                "restore it or start again with --overwrite"
            )
    return recording[len(records) :]


def _replace_text(path: Path, text: str) -> None:
    """Write a text file that appears under its name only when complete."""
    partial = path.with_name(f"{path.name}{PARTIAL}")
    try:
        with naming(path):
            partial.write_text(text)
            partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
