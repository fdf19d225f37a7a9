"""The durable checkpoint: one SQLite database, one transaction a scan: the truth of a run.

A voxel is written once, with the scan that first saw it; merges, moves and labels are logs. So
a transaction is as large as the scan's changes, and labels of any earlier moment can be rebuilt.
Evidence is kept as it is now, in blocks of voxels, of which those that a scan touched are
rewritten.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self, TypeGuard, cast

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.formats.fingerprint import Fingerprint
from mcpseg_cli.incremental.evidence import BLOCK
from mcpseg_cli.incremental.map_rows import COLUMNS, MapRows
from mcpseg_cli.incremental.regrouping import History, Moves
from mcpseg_cli.resumable import is_file_name
from mcpseg_cli.segment.database import Database, Value
from mcpseg_cli.segment.events import event_text, parse_event
from mcpseg_cli.segment.map_changes import (
    LabelChanges,
    MapChanges,
    are_within,
    packed_moves,
    unpacked_moves,
)
from mcpseg_cli.segment.scan_record import ScanRecord
from mcpseg_cli.segment.sources import Sources

SCHEMA_VERSION = 4
_TOGETHER = 1 << 14  # voxels that are read in one go, at least
_PART_ROWS = 1 << 20  # voxels a blob holds at most: SQLite's blobs end at 1 GB
_SCHEMA = """
CREATE TABLE configuration (
    number INTEGER PRIMARY KEY, settings TEXT NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE scans (
    number INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE,
    size INTEGER NOT NULL, mtime_ns INTEGER NOT NULL, sha256 TEXT NOT NULL, pose BLOB NOT NULL,
    num_points INTEGER NOT NULL, num_voxels INTEGER NOT NULL, floor REAL, error TEXT,
    event TEXT NOT NULL, output_size INTEGER NOT NULL, num_merges INTEGER NOT NULL,
    num_moves INTEGER NOT NULL, num_changes INTEGER NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE merges (
    scan INTEGER PRIMARY KEY, pairs BLOB NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE moves (
    scan INTEGER PRIMARY KEY, voxels BLOB NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE changes (
    scan INTEGER PRIMARY KEY, labels BLOB NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE evidence (
    block INTEGER PRIMARY KEY, rows BLOB NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE voxels (
    first_id INTEGER PRIMARY KEY, count INTEGER NOT NULL, xyz BLOB NOT NULL, rgb BLOB NOT NULL,
    semantic BLOB NOT NULL, confidence BLOB NOT NULL, instance BLOB NOT NULL,
    embedding BLOB NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE outputs (
    name TEXT PRIMARY KEY, num_scans INTEGER NOT NULL, sha256 TEXT NOT NULL,
    checksum INTEGER NOT NULL) STRICT, WITHOUT ROWID;
CREATE TABLE parts (
    number INTEGER PRIMARY KEY, facts TEXT NOT NULL, checksum INTEGER NOT NULL) STRICT;
CREATE TABLE sources (
    part INTEGER NOT NULL, first_id INTEGER NOT NULL, voxels BLOB NOT NULL,
    checksum INTEGER NOT NULL, PRIMARY KEY (part, first_id)) STRICT, WITHOUT ROWID;
"""

_ScanRow = tuple[
    int, str, int, int, str, bytes, int, int, float | None, str | None, str, int, int, int, int
]
"""A row of ``scans`` but for its checksum."""


class State:
    """An open checkpoint, locked against every other process until closed.

    Args:
        path: The database; made if not there.
        original: What it is a copy of; errors name that.
        is_durable: Whether what is committed survives a power cut, too.

    Raises:
        StateError: In use, damaged, not a checkpoint, or of another version.
        OutputError: It cannot be written.
    """

    def __init__(
        self, path: Path, *, original: Path | None = None, is_durable: bool = False
    ) -> None:
        self.path = original or path
        self._database = Database(path, _SCHEMA, SCHEMA_VERSION, self.path, is_durable=is_durable)
        self._known_sizes: list[_Sizes] | None = None  # until the next commit
        self._num_scans: int | None = None
        self.sources = Sources(self._database)

    def __enter__(self) -> State:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Release the lock; should the log not get into the database, it stays beside it."""
        self._database.close()

    def configuration(self) -> dict[str, object] | None:
        """Return the configuration the run was started with; None for a new checkpoint."""
        rows = list(self._database.rows("configuration"))
        if len(rows) != 1:
            if not rows and not self.num_scans:
                return None
            raise self._database.damaged("no configuration")
        try:
            settings = json.loads(str(rows[0][1]))
        except (ValueError, RecursionError) as error:
            raise self._database.damaged("configuration") from error
        if not isinstance(settings, dict):
            raise self._database.damaged("configuration")
        return settings

    def set_configuration(self, configuration: Mapping[str, object]) -> None:
        """Write down the configuration of a new run."""
        with self._database.transaction():
            text = json.dumps(configuration, sort_keys=True)
            self._database.insert("configuration", 0, text, replace=True)

    def written(self, name: str) -> str | None:
        """Return the hash of an output as it was written after the last scan; None if it was not.

        Args:
            name: What it is called.
        """
        known = {row[0]: row[1:] for row in self._database.rows("outputs")}  # none unchecked
        num_scans, sha256 = known.get(name, (None, None))
        return str(sha256) if num_scans == self.num_scans else None

    def set_written(self, name: str, sha256: str) -> None:
        """Write down the hash of an output that shows the map as it is after the last scan."""
        with self._database.transaction():
            self._database.insert("outputs", name, self.num_scans, sha256, replace=True)

    def commit(self, record: ScanRecord, rows: MapRows, changes: MapChanges) -> None:
        """Add one scan and all it did, or, if anything fails, nothing.

        Args:
            record: The scan.
            rows: Its new voxels, in id order, after those already here.
            changes: What it changed of what was here.

        Raises:
            OutputError: The disk is full or the file cannot grow.
            StateError: The database is damaged.
        """
        number = self.num_scans
        with self._database.transaction():
            self._insert(number, record, rows, changes)
        self._count(number + 1)

    def commit_all(self, scans: Sequence[tuple[ScanRecord, MapRows]]) -> None:
        """Add scans that were labelled together: all of them or, if anything fails, none.

        Args:
            scans: In order, each with its new voxels, as for ``commit``; labels are final, there
                are no merges.

        Raises:
            OutputError: The disk is full or the file cannot grow.
            StateError: The database is damaged.
        """
        first = self.num_scans
        with self._database.transaction():
            for number, (record, rows) in enumerate(scans, start=first):
                self._insert(number, record, rows, MapChanges.none())
        self._count(first + len(scans))

    def add_scans(self, records: Sequence[ScanRecord]) -> None:
        """Add scans of which the voxels are added by ``add_voxels``, in any number of calls."""
        nothing = MapRows(*(np.empty((0, *shape), dtype) for dtype, shape in COLUMNS.values()))
        self.commit_all([(record, nothing) for record in records])

    def add_voxels(
        self,
        first_id: int,
        rows: MapRows,
        evidence: Mapping[int, NDArray[np.uint16]],
        sources: Mapping[int, Moves],
    ) -> None:
        """Add voxels of scans that are here.

        Args:
            first_id: Of the first of them.
            rows: Them, labels final.
            evidence: By number of the block, see ``Evidence.blocks``.
            sources: By number of the part that has them, see ``Sources.insert``.
        """
        with self._database.transaction():
            self._insert_voxels(first_id, rows)
            self._insert_evidence(evidence)
            for part, voxels in sources.items():
                self.sources.insert(first_id, part, voxels)

    def first_rows(self) -> Iterator[MapRows]:
        """Iterate over every voxel with the labels it had when first seen, see ``map_rows``."""
        return self._first_rows()

    def _insert(self, number: int, record: ScanRecord, rows: MapRows, changes: MapChanges) -> None:
        """Add a scan within a transaction."""
        file = record.file
        identity = (
            number, record.name, file.size, file.mtime_ns, file.sha256, record.pose.tobytes()
        )  # fmt: skip
        event = event_text(record.event)
        outcome = (record.num_points, record.num_voxels, record.floor, record.error, event)
        counts = (len(changes.merges), len(changes.moves), len(changes.labels))
        self._database.insert("scans", *identity, *outcome, record.output_size, *counts)
        self._insert_changes(number, changes)

        self._insert_voxels(record.num_voxels - len(rows), rows)

    def _insert_voxels(self, first: int, rows: MapRows) -> None:
        """Add new voxels, in blobs that SQLite can hold."""
        for start in range(0, len(rows), _PART_ROWS):
            parts = [getattr(rows, name)[start : start + _PART_ROWS] for name in COLUMNS]
            blobs = [np.ascontiguousarray(part).data for part in parts]
            self._database.insert("voxels", first + start, len(parts[0]), *blobs)

    def _insert_changes(self, number: int, changes: MapChanges) -> None:
        """Add to the logs, and put evidence in the place of what was known before."""
        insert = self._database.insert
        if len(changes.merges):
            insert("merges", number, changes.merges.astype("<i4").tobytes())
        if len(changes.moves):
            insert("moves", number, packed_moves(changes.moves))
        if len(changes.labels):
            insert("changes", number, changes.labels.packed())
        self._insert_evidence(changes.evidence)

    def _insert_evidence(self, evidence: Mapping[int, NDArray[np.uint16]]) -> None:
        """Put evidence in the place of what was known before."""
        for block, rows in evidence.items():
            self._database.insert("evidence", int(block), rows.tobytes(), replace=True)

    def scans(self, first: int = 0) -> list[ScanRecord]:
        """List the consumed scans in order.

        Args:
            first: Number of the first.
        """
        records, sizes = [], []
        for row in self._scan_rows(first):
            sizes.append(_Sizes.of(row))
            number, name, size, mtime_ns, sha256, pose, num_points, num_voxels = row[:8]
            floor, error, text, output_size = row[8:12]
            try:
                event = parse_event(text)
            except (ValueError, TypeError, RecursionError) as problem:
                raise self._database.damaged(f"event of scan {number:,}") from problem

            file = Fingerprint(size, mtime_ns, sha256)
            matrix = np.frombuffer(pose, np.float64).reshape(4, 4)
            records.append(
                ScanRecord(
                    name, file, matrix, num_points, num_voxels, floor, error, event, output_size
                )
            )
        if first == 0:
            self._known_sizes = sizes
        return records

    @property
    def num_scans(self) -> int:
        """How many scans were consumed."""
        if self._num_scans is None:
            self._num_scans = len(self._sizes)
        return self._num_scans

    def _count(self, num_scans: int) -> None:
        """Take note of a commit; what each scan must have is read again when it is needed."""
        self._num_scans, self._known_sizes = num_scans, None

    @property
    def _sizes(self) -> list[_Sizes]:
        """How much there must be of every scan."""
        if self._known_sizes is None:
            self._known_sizes = [_Sizes.of(row) for row in self._scan_rows()]
        return self._known_sizes

    def _scan_rows(self, first: int = 0) -> Iterator[_ScanRow]:
        """Iterate over the consumed scans: none is missing, all have names of files."""
        rows = self._database.rows("scans", "number >= ?", (first,))
        for expected, row in enumerate(rows, start=first):
            number, name, pose = row[0], str(row[1]), row[5]
            is_pose = isinstance(pose, bytes) and len(pose) == 16 * 8
            if number != expected or not is_pose or not is_file_name(name):
                raise self._database.damaged(f"scan {expected:,}")
            yield cast(_ScanRow, row)

    def merges(self, until: int | None = None) -> NDArray[np.int32]:
        """Return (P, 2) int32 merges in order: all, or those of scans up to number ``until``.

        Raises:
            StateError: Some are missing or changed.
        """
        pairs = [blob for *_, blob in self._logged("merges", 0, until)]
        return np.frombuffer(b"".join(pairs), "<i4").reshape(-1, 2).astype(np.int32)

    def moves(self, first: int = 0, last: int | None = None) -> Iterator[Moves]:
        """Iterate over the voxels that went to other objects otherwise than by merges, in order.

        Args:
            first: Number of the first scan.
            last: Number of the last scan; None for all.

        Raises:
            StateError: A scan's are missing or changed.
        """
        for scan, count, num_voxels, blob in self._logged("moves", first, last):
            try:
                moves = unpacked_moves(blob)
                if len(moves) != count or not are_within(moves.ids, num_voxels):
                    raise ValueError
            except ValueError as error:
                raise self._database.damaged(f"moves of scan {scan:,}") from error
            yield moves

    def history(self, until: int | None = None) -> History:
        """Return all that became of objects, up to the scan of a number or up to now."""
        return History(self.merges(until), self.moves(last=until))

    def label_changes(self, first: int = 0, last: int | None = None) -> Iterator[LabelChanges]:
        """Iterate over what scans changed of the labels of voxels known before, in order.

        Args:
            first: Number of the first scan.
            last: Number of the last scan; None for all.

        Raises:
            StateError: A scan's are missing or changed.
        """
        for scan, count, num_voxels, blob in self._logged("changes", first, last):
            try:
                changes = LabelChanges.unpacked(blob)
                if len(changes) != count or not changes.are_within(num_voxels):
                    raise ValueError
            except ValueError as error:
                raise self._database.damaged(f"label changes of scan {scan:,}") from error
            yield changes

    def _logged(
        self, table: str, first: int, last: int | None
    ) -> Iterator[tuple[int, int, int, bytes]]:
        """Iterate over a log: scan, how many rows it must have, voxels in the map, what it has."""
        sizes = self._sizes[: None if last is None else last + 1]
        expected = [
            (scan, getattr(size, table), size.voxels)
            for scan, size in enumerate(sizes)
            if scan >= first and getattr(size, table) > 0
        ]
        bounds = (first, len(sizes) - 1)
        found = self._database.rows(table, "scan BETWEEN ? AND ?", bounds)
        for (scan, count, num_voxels), row in zip_longest(expected, found, fillvalue=(-1, 0, 0)):
            if row[0] != scan or not isinstance(row[1], bytes):
                raise self._database.damaged(f"{table} of scan {max(scan, 0):,}")
            if table == "merges" and len(row[1]) != 8 * count:
                raise self._database.damaged(f"{table} of scan {scan:,}")
            yield scan, count, num_voxels, row[1]

    def evidence(self) -> Iterator[NDArray[np.uint16]]:
        """Iterate over the evidence about all voxels, in id order; nothing for first looks.

        Yields:
            (M, K) uint16 rows of a block as ``Evidence.blocks`` gave them.

        Raises:
            StateError: A block is missing, cut or changed.
        """
        expected, num_voxels = 0, self._num_voxels()
        for block, blob in self._database.rows("evidence"):
            count = min(num_voxels - expected * BLOCK, BLOCK)
            is_whole = isinstance(blob, bytes) and count > 0 and len(blob) % (2 * count) == 0
            if block != expected or not isinstance(blob, bytes) or not is_whole:
                raise self._database.damaged(f"evidence about voxels from {expected * BLOCK:,}")
            expected += 1
            yield np.frombuffer(blob, "<u2").reshape(count, -1)
        if expected and expected * BLOCK < num_voxels:
            raise self._database.damaged(f"evidence about voxels from {expected * BLOCK:,}")

    def map_rows(self) -> Iterator[MapRows]:
        """Iterate over every voxel in id order, a scan or part of a scan at a time.

        Class and confidence are as known now, object ids as given at first.

        Raises:
            StateError: A part is missing, cut or changed.
        """
        # all are as they were first seen, or labels have changed since
        if next(self.label_changes(), None) is None:
            yield from self._first_rows()
            return
        semantic, confidence = self.first_labels()
        for changes in self.label_changes():
            changes.apply(semantic, confidence)

        start = 0
        for rows in self._first_rows():
            part = slice(start, start + len(rows))
            yield replace(rows, semantic=semantic[part], confidence=confidence[part])
            start += len(rows)

    def first_labels(self) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return (V,) uint8 class and (V,) float32 confidence of every voxel as first seen; copies.

        Raises:
            StateError: Some are missing.
        """
        semantic = np.empty(self._num_voxels(), np.uint8)
        confidence, start = np.empty(len(semantic), np.float32), 0
        for rows in self._first_rows():
            part = slice(start, start + len(rows))
            semantic[part], confidence[part] = rows.semantic, rows.confidence
            start += len(rows)
        return semantic, confidence

    def _first_rows(self) -> Iterator[MapRows]:
        """Iterate over every voxel as first seen, many at a time, see ``map_rows``."""
        expected, num_voxels = 0, self._num_voxels()
        waiting: list[list[bytes]] = []
        start = 0
        for first_id, count, *blobs in self._database.rows("voxels"):
            size = count if isinstance(count, int) and 0 < count <= num_voxels - expected else 0
            if first_id != expected or not size or not _are_columns(blobs, size):
                raise self._database.damaged(f"voxels from {expected:,}")
            expected += size
            waiting.append(blobs)
            if expected - start >= _TOGETHER:
                yield _joined(waiting)
                waiting, start = [], expected

        if expected != num_voxels:
            raise self._database.damaged(f"voxels from {expected:,}")
        if waiting:
            yield _joined(waiting)

    def instance_after(self, scan: int) -> NDArray[np.int32]:
        """Return (V,) int32 object ids as they were after a scan; later voxels have ids too.

        Args:
            scan: Number of the scan.
        """
        instance, _ = self.history(scan).apply(self.first_instance())
        return instance

    def first_instance(self) -> NDArray[np.int32]:
        """Return (V,) int32 object ids as each voxel got them at first; a copy."""
        parts = [rows.instance for rows in self._first_rows()]
        return np.concatenate([np.empty(0, np.int32), *parts])

    def _num_voxels(self) -> int:
        """Count the voxels that there must be: the last scan knows."""
        return self._sizes[-1].voxels if self._sizes else 0


class _Sizes(NamedTuple):
    """How much there must be of a scan, and of all before it."""

    output: int
    merges: int
    moves: int
    changes: int
    voxels: int

    @classmethod
    def of(cls, row: _ScanRow) -> Self:
        """Take them from a row of ``scans``."""
        return cls(*row[11:15], row[7])


def _joined(scans: Sequence[Sequence[bytes]]) -> MapRows:
    """Make rows of the columns of several scans."""
    columns = (b"".join(parts) for parts in zip(*scans, strict=True))
    return MapRows(
        *(
            np.frombuffer(column, dtype).reshape(-1, *shape)
            for column, (dtype, shape) in zip(columns, COLUMNS.values(), strict=True)
        )
    )


_ROW_BYTES = [np.dtype(dtype).itemsize * int(np.prod(shape)) for dtype, shape in COLUMNS.values()]


def _are_columns(blobs: Sequence[Value], count: int) -> TypeGuard[list[bytes]]:
    """Tell whether blobs are the columns of so many voxels."""
    for blob, size in zip(blobs, _ROW_BYTES, strict=True):
        if not isinstance(blob, bytes) or len(blob) != count * size:
            return False
    return True
