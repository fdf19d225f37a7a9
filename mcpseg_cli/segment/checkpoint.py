"""The durable checkpoint: one SQLite database, one transaction a scan: the truth of a run.

A voxel is written once, with the scan that first saw it; merges, moves and labels are logs. So
a transaction is as large as the scan's changes, and labels of any earlier moment can be rebuilt.
Evidence is kept as it is now, in blocks of voxels, of which those that a scan touched are
rewritten.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.incremental.evidence import BLOCK
from mcpseg_cli.incremental.map_rows import COLUMNS, MapRows
from mcpseg_cli.incremental.regrouping import History, Moves
from mcpseg_cli.segment.database import Database
from mcpseg_cli.segment.events import event_text, parse_event
from mcpseg_cli.segment.map_changes import (
    LabelChanges,
    MapChanges,
    are_within,
    packed_moves,
    unpacked_moves,
)
from mcpseg_cli.segment.scan_record import Fingerprint, ScanRecord
from mcpseg_cli.segment.sources import Sources

SCHEMA_VERSION = 3
_PART_ROWS = 1 << 20  # voxels a blob holds at most: SQLite's blobs end at 1 GB
_SCHEMA = """
CREATE TABLE configuration (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE scans (
    number INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE,
    size INTEGER NOT NULL, mtime_ns INTEGER NOT NULL, sha256 TEXT NOT NULL, pose BLOB NOT NULL,
    num_points INTEGER NOT NULL, num_voxels INTEGER NOT NULL, floor REAL, error TEXT,
    event TEXT NOT NULL, output_size INTEGER NOT NULL, num_merges INTEGER NOT NULL,
    num_moves INTEGER NOT NULL, num_changes INTEGER NOT NULL);
CREATE TABLE merges (scan INTEGER PRIMARY KEY, pairs BLOB NOT NULL, crc INTEGER NOT NULL);
CREATE TABLE moves (scan INTEGER PRIMARY KEY, voxels BLOB NOT NULL, crc INTEGER NOT NULL);
CREATE TABLE changes (scan INTEGER PRIMARY KEY, labels BLOB NOT NULL, crc INTEGER NOT NULL);
CREATE TABLE evidence (block INTEGER PRIMARY KEY, rows BLOB NOT NULL, crc INTEGER NOT NULL);
CREATE TABLE voxels (
    first_id INTEGER PRIMARY KEY, count INTEGER NOT NULL, xyz BLOB NOT NULL, rgb BLOB NOT NULL,
    semantic BLOB NOT NULL, confidence BLOB NOT NULL, instance BLOB NOT NULL,
    embedding BLOB NOT NULL, crc INTEGER NOT NULL);
"""


class State:
    """An open checkpoint, locked against every other process until closed.

    Args:
        path: The database; made if not there.
        original: What it is a copy of; errors name that.

    Raises:
        StateError: In use, damaged, not a checkpoint, or of another version.
        OutputError: It cannot be written.
    """

    def __init__(self, path: Path, *, original: Path | None = None) -> None:
        self.path = original or path
        self._database = Database(path, _SCHEMA, SCHEMA_VERSION, self.path)
        self._db = self._database.connection
        self.sources = Sources(self._database)
        try:
            with self._database.explained():
                self._num_scans = self._db.execute("SELECT count(*) FROM scans").fetchone()[0]
        except BaseException:
            self.close()
            raise

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
        with self._database.explained():
            rows = self._db.execute("SELECT key, value FROM configuration").fetchall()
        if not rows and self._num_scans:
            raise self._database.damaged("no configuration")
        try:
            return {key: json.loads(value) for key, value in rows} or None
        except (ValueError, TypeError) as error:
            raise self._database.damaged("configuration") from error

    def set_configuration(self, configuration: Mapping[str, object]) -> None:
        """Write down the configuration of a new run."""
        rows = [(key, json.dumps(value, sort_keys=True)) for key, value in configuration.items()]
        with self._database.transaction():
            self._db.executemany("INSERT INTO configuration VALUES (?, ?)", rows)

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
        with self._database.transaction():
            self._insert(self._num_scans, record, rows, changes)
        self._num_scans += 1

    def commit_all(self, scans: Sequence[tuple[ScanRecord, MapRows]]) -> None:
        """Add scans that were labelled together: all of them or, if anything fails, none.

        Args:
            scans: In order, each with its new voxels, as for ``commit``; labels are final, there
                are no merges.

        Raises:
            OutputError: The disk is full or the file cannot grow.
            StateError: The database is damaged.
        """
        with self._database.transaction():
            for number, (record, rows) in enumerate(scans, start=self._num_scans):
                self._insert(number, record, rows, MapChanges.none())
        self._num_scans += len(scans)

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
        sizes = (
            record.output_size, len(changes.merges), len(changes.moves), len(changes.labels)
        )  # fmt: skip
        self._db.execute(f"INSERT INTO scans VALUES ({_holes(15)})", identity + outcome + sizes)
        self._insert_changes(number, changes)

        self._insert_voxels(record.num_voxels - len(rows), rows)

    def _insert_voxels(self, first: int, rows: MapRows) -> None:
        """Add new voxels, in blobs that SQLite can hold."""
        for start in range(0, len(rows), _PART_ROWS):
            parts = [getattr(rows, name)[start : start + _PART_ROWS] for name in COLUMNS]
            first_id = first + start
            blobs = [np.ascontiguousarray(part).data for part in parts]
            values = (first_id, len(parts[0]), *blobs, _checksum(blobs))
            self._db.execute(f"INSERT INTO voxels VALUES ({_holes(9)})", values)

    def _insert_changes(self, number: int, changes: MapChanges) -> None:
        """Add to the logs, and put evidence in the place of what was known before."""
        if len(changes.merges):
            pairs = changes.merges.astype("<i4").tobytes()
            values = (number, pairs, zlib.crc32(pairs))
            self._db.execute("INSERT INTO merges VALUES (?, ?, ?)", values)
        if len(changes.moves):
            voxels = packed_moves(changes.moves)
            values = (number, voxels, zlib.crc32(voxels))
            self._db.execute("INSERT INTO moves VALUES (?, ?, ?)", values)
        if len(changes.labels):
            labels = changes.labels.packed()
            values = (number, labels, zlib.crc32(labels))
            self._db.execute("INSERT INTO changes VALUES (?, ?, ?)", values)

        self._insert_evidence(changes.evidence)

    def _insert_evidence(self, evidence: Mapping[int, NDArray[np.uint16]]) -> None:
        """Put evidence in the place of what was known before."""
        blobs = ((block, rows.tobytes()) for block, rows in evidence.items())
        self._db.executemany(
            "INSERT OR REPLACE INTO evidence VALUES (?, ?, ?)",
            ((block, blob, zlib.crc32(blob)) for block, blob in blobs),
        )

    def scans(self) -> list[ScanRecord]:
        """List the consumed scans in order."""
        with self._database.explained():
            rows = self._db.execute("SELECT * FROM scans ORDER BY number").fetchall()
        records = []
        for expected, (number, name, size, mtime_ns, sha256, pose, *outcome) in enumerate(rows):
            if number != expected or not isinstance(pose, bytes) or len(pose) != 16 * 8:
                raise self._database.damaged(f"scan {expected:,}")

            # what became of it
            num_points, num_voxels, floor, error, text, output_size, *_ = outcome
            try:
                event = parse_event(text)
            except (ValueError, TypeError) as problem:
                raise self._database.damaged(f"event of scan {expected:,}") from problem

            file = Fingerprint(size, mtime_ns, sha256)
            matrix = np.frombuffer(pose, np.float64).reshape(4, 4)
            records.append(
                ScanRecord(
                    name, file, matrix, num_points, num_voxels, floor, error, event, output_size
                )
            )
        return records

    def merges(self, until: int | None = None) -> NDArray[np.int32]:
        """Return (P, 2) int32 merges in order: all, or those of scans up to number ``until``.

        Raises:
            StateError: Some are missing or changed.
        """
        last = 1 << 60 if until is None else until
        with self._database.explained():
            rows = self._db.execute(
                "SELECT pairs, crc FROM merges WHERE scan <= ? ORDER BY scan", (last,)
            ).fetchall()
            (count,) = self._db.execute(
                "SELECT total(num_merges) FROM scans WHERE number <= ?", (last,)
            ).fetchone()

        # every scan's must be whole, and all of them there
        if any(not isinstance(pairs, bytes) or zlib.crc32(pairs) != crc for pairs, crc in rows):
            raise self._database.damaged("merges")
        joined = np.frombuffer(b"".join(pairs for pairs, _ in rows), "<i4")
        merges = joined.reshape(-1, 2).astype(np.int32)
        if len(merges) != count:
            raise self._database.damaged("merges")
        return merges

    def moves(self, first: int = 0, last: int | None = None) -> Iterator[Moves]:
        """Iterate over the voxels that went to other objects otherwise than by merges, in order.

        Args:
            first: Number of the first scan.
            last: Number of the last scan; None for all.

        Raises:
            StateError: A scan's are missing or changed.
        """
        for scan, count, num_voxels, blob in self._logged("moves", "voxels", first, last):
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
        for scan, count, num_voxels, blob in self._logged("changes", "labels", first, last):
            try:
                changes = LabelChanges.unpacked(blob)
                if len(changes) != count or not changes.are_within(num_voxels):
                    raise ValueError
            except ValueError as error:
                raise self._database.damaged(f"label changes of scan {scan:,}") from error
            yield changes

    def _logged(
        self, table: str, column: str, first: int, last: int | None
    ) -> Iterator[tuple[int, int, int, bytes]]:
        """Iterate over a log: scan, how many rows it must have, voxels in the map, what it has."""
        bounds = (first, 1 << 60 if last is None else last)
        with self._database.explained():
            for scan, count, num_voxels, blob, crc in self._db.execute(
                f"SELECT number, num_{table}, num_voxels, {column}, {table}.crc "
                f"FROM scans LEFT JOIN {table} ON scan = number "
                f"WHERE num_{table} > 0 AND number BETWEEN ? AND ? ORDER BY number",
                bounds,
            ):
                if not isinstance(blob, bytes) or zlib.crc32(blob) != crc:
                    raise self._database.damaged(f"{table} of scan {scan:,}")
                yield scan, count, num_voxels, blob

    def evidence(self) -> Iterator[NDArray[np.uint16]]:
        """Iterate over the evidence about all voxels, in id order; nothing for first looks.

        Yields:
            (M, K) uint16 rows of a block as ``Evidence.blocks`` gave them.

        Raises:
            StateError: A block is missing, cut or changed.
        """
        expected, num_voxels = 0, self._num_voxels()
        with self._database.explained():
            for block, blob, crc in self._db.execute(
                "SELECT block, rows, crc FROM evidence ORDER BY block"
            ):
                count = min(num_voxels - expected * BLOCK, BLOCK)
                is_whole = isinstance(blob, bytes) and zlib.crc32(blob) == crc
                if block != expected or count <= 0 or not is_whole or len(blob) % (2 * count):
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
        semantic, confidence = self._column("semantic"), self._column("confidence")
        if not len(semantic) == len(confidence) == self._num_voxels():
            raise self._database.damaged("labels of voxels")
        return semantic.astype(np.uint8), confidence.astype(np.float32)

    def _first_rows(self) -> Iterator[MapRows]:
        """Iterate over every voxel as first seen, see ``map_rows``."""
        expected = 0
        with self._database.explained():
            for first_id, count, *blobs, crc in self._db.execute(
                f"SELECT first_id, count, {', '.join(COLUMNS)}, crc FROM voxels ORDER BY first_id"
            ):
                is_whole = all(isinstance(blob, bytes) for blob in blobs)
                if first_id != expected or not is_whole or _checksum(blobs) != crc:
                    raise self._database.damaged(f"voxels from {expected:,}")
                expected += count
                columns = zip(blobs, COLUMNS.values(), strict=True)
                yield MapRows(
                    *(
                        np.frombuffer(blob, dtype).reshape(count, *shape)
                        for blob, (dtype, shape) in columns
                    )
                )

        if expected != self._num_voxels():
            raise self._database.damaged(f"voxels from {expected:,}")

    def instance_after(self, scan: int) -> NDArray[np.int32]:
        """Return (V,) int32 object ids as they were after a scan; later voxels have ids too.

        Args:
            scan: Number of the scan.
        """
        instance, _ = self.history(scan).apply(self.first_instance())
        return instance

    def first_instance(self) -> NDArray[np.int32]:
        """Return (V,) int32 object ids as each voxel got them at first; a copy."""
        return self._column("instance").astype(np.int32)

    def _num_voxels(self) -> int:
        """Count the voxels that there must be: the last scan knows."""
        with self._database.explained():
            found = self._db.execute("SELECT max(num_voxels) FROM scans").fetchone()[0]
        return int(found or 0)

    def _column(self, name: str) -> NDArray[np.generic]:
        """Read one number of every voxel as first seen; read-only."""
        with self._database.explained():
            rows = self._db.execute(f"SELECT {name} FROM voxels ORDER BY first_id").fetchall()
        if not all(isinstance(blob, bytes) for (blob,) in rows):
            raise self._database.damaged(f"{name} of voxels")
        return np.frombuffer(b"".join(blob for (blob,) in rows), COLUMNS[name][0])


def _checksum(blobs: Sequence[bytes | memoryview]) -> int:
    """Checksum some blobs as one."""
    crc = 0
    for blob in blobs:
        crc = zlib.crc32(blob, crc)
    return crc


def _holes(count: int) -> str:
    return ", ".join("?" * count)
