"""``mcpseg segment --offline``: all scans make one cloud, labelled when the last is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import write_cloud
from mcpseg_cli.formats.fingerprint import Fingerprint
from mcpseg_cli.formats.recording import ScanSource
from mcpseg_cli.formats.scan_source import pose_of
from mcpseg_cli.incremental.growing_map import GrowingMap
from mcpseg_cli.incremental.offline import label_cloud
from mcpseg_cli.incremental.regrouping import History
from mcpseg_cli.incremental.segmenter import ScanUpdate
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.segment.events import LabelledEvent
from mcpseg_cli.segment.run import ScanReport, SegmentRun
from mcpseg_cli.segment.scan_record import ScanRecord, skipped_scan

_NO_MERGES = np.empty((0, 2), np.int32)
_NOBODY = np.empty(0, np.int32)


@dataclass(frozen=True)
class _InCloud:
    """A scan that is part of the cloud, or was skipped.

    Attributes:
        number: Its number, from 0.
        source: Where it is from.
        read: What its file was; why it was not read.
        first_new: Voxels in the cloud before it.
        num_voxels: Voxels in the cloud after it.
        ms: Milliseconds that reading took.
    """

    number: int
    source: ScanSource
    read: Fingerprint | InputError | OSError
    first_new: int
    num_voxels: int
    ms: float


def label_offline(
    run: SegmentRun, should_stop: Callable[[], bool] = lambda: False
) -> Iterator[ScanReport]:
    """Read all scans, label the cloud, then commit and report them.

    What labelling took is shared among the scans evenly. It is one transaction: an interrupted run
    starts afresh, and scans cannot be added to one. The outputs are those of ``SegmentRun.run``;
    the labelled scans carry the final labels.

    Args:
        run: A run whose ``options.offline`` is set.
        should_stop: Asked before every scan is read and written; nothing is kept then.

    Raises:
        InputError: A scan cannot be read and ``on_error`` is ``stop``; nothing is kept.
        OutputError: The disk is full; nothing is kept.
    """
    # read
    cloud = GrowingMap(run.segmenter.settings)
    scans: list[_InCloud] = []
    for source in run.pending:
        if should_stop():
            return
        scans.append(_read(run, cloud, len(scans), source))
    if not scans:
        return

    # label
    started = perf_counter()
    floor = _label(run, cloud.voxels, scans)
    share_ms = 1e3 * (perf_counter() - started) / len(scans)

    # write and commit, all or nothing
    done = []
    try:
        for scan in scans:
            if should_stop():
                return
            done.append(_write(run, scan, floor, share_ms))
        _commit(run, [record for record, _ in done])
    finally:
        if not run.records:
            for scan in scans:
                run.outputs.labelled_scan(scan.source.name).unlink(missing_ok=True)
    for record, report in done:
        run.outputs.append_event(record.event, report.update.ms if report.update else None)
    yield from (report for _, report in done)


def _read(run: SegmentRun, cloud: GrowingMap, number: int, source: ScanSource) -> _InCloud:
    """Add a scan's points in range to the cloud."""
    before, started = len(cloud.voxels), perf_counter()

    outcome: Fingerprint | InputError | OSError
    try:
        read = run.read(source)
    except (InputError, OSError) as error:
        if run.options.on_error != "skip":
            raise
        outcome = error
    else:
        cloud.observe(read.scan)
        outcome = read.file

    ms = 1e3 * (perf_counter() - started)
    return _InCloud(number, source, outcome, before, len(cloud.voxels), ms)


def _label(run: SegmentRun, cloud: VoxelMap, scans: list[_InCloud]) -> float | None:
    """Label the cloud and hand it to the segmenter; return the height of the floor."""
    used = [scan for scan in scans if isinstance(scan.read, Fingerprint)]
    if not len(cloud):
        run.segmenter.restore([], History(_NO_MERGES), len(used), None)
        return None
    positions = np.array([pose_of(scan.source)[:3, 3] for scan in used])
    rows, floor = label_cloud(cloud, positions, run.segmenter.method)
    run.segmenter.restore([rows], History(_NO_MERGES), len(used), floor)
    return floor


def _write(
    run: SegmentRun, scan: _InCloud, floor: float | None, share_ms: float
) -> tuple[ScanRecord, ScanReport]:
    """Write the labelled copy of a scan and make its record."""
    name, started = scan.source.name, perf_counter()
    if not isinstance(scan.read, Fingerprint):
        skipped = skipped_scan(scan.number, scan.source, scan.read, scan.first_new, None)
        return skipped, ScanReport(name, 0, None, skipped.error, scan.ms)

    # label its points, those too that were out of its range
    read = run.read(scan.source)
    if read.file.sha256 != scan.read.sha256:
        found, expected = "changed since the cloud was made of it", "the same file"
        raise InputError(scan.source.path, found, expected, "run the same command again")
    point_ids = run.segmenter.find_points(read.scan)
    path = run.outputs.labelled_scan(name)
    write_cloud(path, read.cloud.with_labels(run.segmenter.labels(point_ids)))
    ms = {"read": scan.ms, "label": share_ms, "write": 1e3 * (perf_counter() - started)}

    # tell what it would have told as one of many
    known = np.unique(point_ids[(point_ids >= 0) & (point_ids < scan.first_new)])
    update = ScanUpdate(
        scan.number, point_ids, scan.first_new, scan.num_voxels - scan.first_new, len(known),
        _NO_MERGES, _NO_MERGES, _NOBODY, _NOBODY, _NOBODY, 0, _NOBODY, floor, ms,
    )  # fmt: skip
    num_points, num_objects = len(read.scan.xyz), run.segmenter.clusters.num_objects
    event = LabelledEvent.of(scan.number, name, num_points, update, num_objects)
    record = ScanRecord(
        name, scan.read, pose_of(scan.source), num_points, scan.num_voxels, floor, None, event,
        path.stat().st_size,
    )  # fmt: skip
    total_ms, num_unmeasured = sum(ms.values()), len(read.cloud) - num_points
    return record, ScanReport(name, num_points, update, None, total_ms, num_unmeasured)


def _commit(run: SegmentRun, records: list[ScanRecord]) -> None:
    """Commit all scans in one transaction, each with its new voxels; bring the map up to date."""
    rows, first = run.segmenter.rows(), 0
    parts = []
    for record in records:
        parts.append(rows.part(slice(first, record.num_voxels)))
        first = record.num_voxels
    run.commit_all(list(zip(records, parts, strict=True)))
    run.outputs.update_map(rows, _NOBODY)
