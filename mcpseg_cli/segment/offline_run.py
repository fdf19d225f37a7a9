"""A run of ``mcpseg segment --offline``: all scans make one cloud, which is labelled when the last is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np

from mcpseg_cli.config import RegionGrowingSettings
from mcpseg_cli.errors import InputError, StateError
from mcpseg_cli.formats import write_cloud
from mcpseg_cli.formats.recording import ScanFile, read_scan
from mcpseg_cli.incremental.offline import label_cloud
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter, ScanUpdate
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.networks.weights import Weights
from mcpseg_cli.scan import colour_of, near_robot
from mcpseg_cli.segment.events import describe_scan
from mcpseg_cli.segment.folder import RunOptions
from mcpseg_cli.segment.run import ScanReport, SegmentRun
from mcpseg_cli.segment.scan_record import ScanRecord, fingerprint, skipped_scan


@dataclass(frozen=True)
class _ReadScan:
    """A scan that is part of the cloud: its record so far, and how long reading took."""

    source: ScanFile
    record: ScanRecord
    num_new: int
    ms: float


class OfflineRun(SegmentRun):
    """An open offline run. It is one transaction: an interrupted run starts afresh, and scans cannot be added to one.

    The outputs are those of a ``SegmentRun``; the labelled scans carry the final labels.

    Args:
        recording: All scans, in order.
        output: Folder of the run; made if not there.
        method: What labels: a network with its weights, or region growing.
        segmenter: A new segmenter with it.
        options: How to read and write; ``offline`` is set.

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
        super().__init__(recording, output, method, segmenter, options)
        if self.resumed_from and self.pending:
            self._open_files.close()
            raise StateError(
                f"{output}: {self.resumed_from:,} scans labelled offline, {len(self.pending):,} more given; expected "
                "the same scans; choose another -o, or start again with --overwrite"
            )

    def run(self, should_stop: Callable[[], bool] = lambda: False) -> Iterator[ScanReport]:
        """Read all scans, label the cloud, then commit and report them; labelling's time is shared among them evenly.

        Args:
            should_stop: Asked before every scan is read and written; nothing is kept then.

        Raises:
            InputError: A scan cannot be read and ``on_error`` is ``stop``; nothing is kept.
            OutputError: The disk is full; nothing is kept.
        """
        voxel_map = VoxelMap(self.segmenter.settings.voxel_size)
        scans: list[_ReadScan] = []
        for source in self.pending:
            if should_stop():
                return
            scans.append(self._read(len(scans), source, voxel_map))
        if not scans:
            return
        self._is_committed = False
        started = perf_counter()
        floor = self._label(voxel_map, scans)
        share_ms = 1e3 * (perf_counter() - started) / len(scans)
        records, reports = [], []
        try:
            for number, scan in enumerate(scans):
                if should_stop():
                    return
                record, report = self._write(number, scan, floor, share_ms)
                records.append(record)
                reports.append(report)
            self._commit(records)
        finally:
            if not self._is_committed:
                for scan in scans:
                    self._labelled_scan(scan.source.path.name).unlink(missing_ok=True)
        for record, report in zip(records, reports, strict=True):
            self._append_event(record.event, report.update.ms if report.update else None)
        yield from reports

    def _read(self, number: int, source: ScanFile, voxel_map: VoxelMap) -> _ReadScan:
        """Add a scan's points in range to the cloud."""
        before, started = len(voxel_map), perf_counter()
        try:
            record = fingerprint(source)
            scan, cloud = read_scan(source, self._options.frame, voxel_map.voxel_size)
        except (InputError, OSError) as error:
            if self._options.on_error != "skip":
                raise
            record = skipped_scan(number, source, error, before, None)
        else:
            near = near_robot(scan, self.segmenter.settings.local_range)
            voxel_map.insert(scan.xyz[near], colour_of(scan, near))
            record = replace(record, num_points=len(cloud), num_voxels=len(voxel_map))
        return _ReadScan(source, record, len(voxel_map) - before, 1e3 * (perf_counter() - started))

    def _label(self, voxel_map: VoxelMap, scans: list[_ReadScan]) -> float | None:
        """Label the cloud and hand it to the segmenter; return the height of the floor."""
        used = [scan for scan in scans if scan.record.error is None]
        if not len(voxel_map):
            return None
        positions = np.array([scan.source.pose[:3, 3] for scan in used])
        rows, floor = label_cloud(voxel_map, positions, self.segmenter.method)
        self.segmenter.restore([rows], np.empty((0, 2), np.int32), len(used), floor)
        return floor

    def _write(
        self, number: int, scan: _ReadScan, floor: float | None, share_ms: float
    ) -> tuple[ScanRecord, ScanReport]:
        """Write the labelled copy of a scan; complete its record."""
        record, started = scan.record, perf_counter()
        if record.error is not None:
            return record, ScanReport(record.name, 0, None, record.error, scan.ms)
        points, cloud = read_scan(
            scan.source, self._options.frame, self.segmenter.settings.voxel_size
        )
        point_ids = self.segmenter.find_points(points)
        path = self._labelled_scan(record.name)
        write_cloud(path, cloud.with_labels(self.segmenter.labels(point_ids)))
        ms = {"read": scan.ms, "label": share_ms, "write": 1e3 * (perf_counter() - started)}
        first_new = record.num_voxels - scan.num_new
        known = point_ids[(point_ids >= 0) & (point_ids < first_new)]
        nothing = np.empty((0, 2), np.int32)
        update = ScanUpdate(
            number,
            point_ids,
            first_new,
            scan.num_new,
            len(np.unique(known)),
            nothing,
            nothing[:, 0],
            floor,
            ms,
        )
        event = describe_scan(
            number, scan.source, len(cloud), update, self.segmenter.clusters.num_objects
        )
        record = replace(record, floor=floor, event=event, output_size=path.stat().st_size)
        return record, ScanReport(record.name, len(cloud), update, None, sum(ms.values()))

    def _commit(self, records: list[ScanRecord]) -> None:
        """Commit all scans in one transaction and bring the map up to date."""
        rows, first = self.segmenter.rows(), 0
        parts = []
        for record in records:
            parts.append(rows.part(slice(first, record.num_voxels)))
            first = record.num_voxels
        self._state.commit_all(list(zip(records, parts, strict=True)))
        self._is_committed = True
        self.records += records
        self._map.update(rows, np.empty(0, np.int32))
