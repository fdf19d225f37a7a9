"""The durable checkpoint: one SQLite database, one transaction a scan: the truth of a run.

A voxel is written once, with the scan that first saw it; merges are a log. So a transaction is as
large as the scan's changes, and the labels of any earlier moment can be rebuilt.
"""

from __future__ import annotations

import json
import sqlite3
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import OutputError, StateError, StateInUseError
from mcpseg_cli.incremental.clustering import resolve
from mcpseg_cli.incremental.map_rows import COLUMNS, MapRows
from mcpseg_cli.segment.events import event_text, parse_event
from mcpseg_cli.segment.scan_record import Fingerprint, ScanRecord

SCHEMA_VERSION = 1
_APPLICATION_ID = 0x6D637073  # "mcps"
_PART_ROWS = 1 << 20  # voxels a blob holds at most: SQLite's blobs end at 1 GB
_NOT_WRITABLE = ("full", "I/O", "readonly", "unable to open")  # in SQLite's words
_SCHEMA = """
CREATE TABLE configuration (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE scans (
    number INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE,
    size INTEGER NOT NULL, mtime_ns INTEGER NOT NULL, sha256 TEXT NOT NULL, pose BLOB NOT NULL,
    num_points INTEGER NOT NULL, num_voxels INTEGER NOT NULL, floor REAL, error TEXT,
    event TEXT NOT NULL, output_size INTEGER NOT NULL, num_merges INTEGER NOT NULL);
CREATE TABLE merges (scan INTEGER PRIMARY KEY, pairs BLOB NOT NULL, crc INTEGER NOT NULL);
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
        with self._explained():
            self._db = sqlite3.connect(path, timeout=0, isolation_level=None)
        try:
            with self._explained():
                self._open()
        except BaseException:
            self._db.close()
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
        self._db.close()

    def configuration(self) -> dict[str, object] | None:
        """Return the configuration the run was started with; None for a new checkpoint."""
        with self._explained():
            rows = self._db.execute("SELECT key, value FROM configuration").fetchall()
        if not rows and self._num_scans:
            raise self._damaged("no configuration")
        try:
            return {key: json.loads(value) for key, value in rows} or None
        except (ValueError, TypeError) as error:
            raise self._damaged("configuration") from error

    def set_configuration(self, configuration: Mapping[str, object]) -> None:
        """Write down the configuration of a new run."""
        rows = [(key, json.dumps(value, sort_keys=True)) for key, value in configuration.items()]
        with self._transaction():
            self._db.executemany("INSERT INTO configuration VALUES (?, ?)", rows)

    def commit(self, record: ScanRecord, rows: MapRows, merges: NDArray[np.int32]) -> None:
        """Add one scan and all it did, or, if anything fails, nothing.

        Args:
            record: The scan.
            rows: Its new voxels, in id order, after those already here.
            merges: (P, 2) int32 merges it caused.

        Raises:
            OutputError: The disk is full or the file cannot grow.
            StateError: The database is damaged.
        """
        with self._transaction():
            self._insert(self._num_scans, record, rows, merges)
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
        with self._transaction():
            for number, (record, rows) in enumerate(scans, start=self._num_scans):
                self._insert(number, record, rows, np.empty((0, 2), np.int32))
        self._num_scans += len(scans)

    def _insert(
        self, number: int, record: ScanRecord, rows: MapRows, merges: NDArray[np.int32]
    ) -> None:
        """Add a scan within a transaction."""
        file = record.file
        identity = (
            number, record.name, file.size, file.mtime_ns, file.sha256, record.pose.tobytes()
        )  # fmt: skip
        event = event_text(record.event)
        outcome = (record.num_points, record.num_voxels, record.floor, record.error, event)
        sizes = (record.output_size, len(merges))
        self._db.execute(f"INSERT INTO scans VALUES ({_holes(13)})", identity + outcome + sizes)

        if len(merges):
            pairs = merges.astype("<i4").tobytes()
            values: tuple[object, ...] = (number, pairs, zlib.crc32(pairs))
            self._db.execute(f"INSERT INTO merges VALUES ({_holes(3)})", values)

        # new voxels, in blobs that SQLite can hold
        for start in range(0, len(rows), _PART_ROWS):
            parts = [getattr(rows, name)[start : start + _PART_ROWS] for name in COLUMNS]
            first_id = record.num_voxels - len(rows) + start
            blobs = [np.ascontiguousarray(part).data for part in parts]
            values = (first_id, len(parts[0]), *blobs, _checksum(blobs))
            self._db.execute(f"INSERT INTO voxels VALUES ({_holes(9)})", values)

    def scans(self) -> list[ScanRecord]:
        """List the consumed scans in order."""
        with self._explained():
            rows = self._db.execute("SELECT * FROM scans ORDER BY number").fetchall()
        records = []
        for expected, (number, name, size, mtime_ns, sha256, pose, *outcome) in enumerate(rows):
            if number != expected or not isinstance(pose, bytes) or len(pose) != 16 * 8:
                raise self._damaged(f"scan {expected:,}")

            # what became of it
            num_points, num_voxels, floor, error, text, output_size, _ = outcome
            try:
                event = parse_event(text)
            except (ValueError, TypeError) as problem:
                raise self._damaged(f"event of scan {expected:,}") from problem

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
        with self._explained():
            rows = self._db.execute(
                "SELECT pairs, crc FROM merges WHERE scan <= ? ORDER BY scan", (last,)
            ).fetchall()
            (count,) = self._db.execute(
                "SELECT total(num_merges) FROM scans WHERE number <= ?", (last,)
            ).fetchone()

        # every scan's must be whole, and all of them there
        if any(not isinstance(pairs, bytes) or zlib.crc32(pairs) != crc for pairs, crc in rows):
            raise self._damaged("merges")
        joined = np.frombuffer(b"".join(pairs for pairs, _ in rows), "<i4")
        merges = joined.reshape(-1, 2).astype(np.int32)
        if len(merges) != count:
            raise self._damaged("merges")
        return merges

    def map_rows(self) -> Iterator[MapRows]:
        """Iterate over every voxel as first seen, in id order, a scan or part of a scan at a time.

        Raises:
            StateError: A part is missing, cut or changed.
        """
        expected = 0
        with self._explained():
            for first_id, count, *blobs, crc in self._db.execute(
                f"SELECT first_id, count, {', '.join(COLUMNS)}, crc FROM voxels ORDER BY first_id"
            ):
                is_whole = all(isinstance(blob, bytes) for blob in blobs)
                if first_id != expected or not is_whole or _checksum(blobs) != crc:
                    raise self._damaged(f"voxels from {expected:,}")
                expected += count
                columns = zip(blobs, COLUMNS.values(), strict=True)
                yield MapRows(
                    *(
                        np.frombuffer(blob, dtype).reshape(count, *shape)
                        for blob, (dtype, shape) in columns
                    )
                )

            # the last scan knows how many there must be
            last = self._db.execute(
                "SELECT num_voxels FROM scans ORDER BY number DESC LIMIT 1"
            ).fetchone()
        if expected != (last[0] if last else 0):
            raise self._damaged(f"voxels from {expected:,}")

    def instance_after(self, scan: int) -> NDArray[np.int32]:
        """Return (V,) int32 object ids as they were after a scan; later voxels have ids too.

        Args:
            scan: Number of the scan.
        """
        with self._explained():
            rows = self._db.execute("SELECT instance FROM voxels ORDER BY first_id").fetchall()
        instance = np.frombuffer(b"".join(row[0] for row in rows), "<i4").astype(np.int32)
        survivor = np.arange(instance.max(initial=0) + 1, dtype=np.int32)
        merges = self.merges(scan)
        survivor[merges[:, 0]] = merges[:, 1]
        resolved: NDArray[np.int32] = resolve(instance, survivor)
        return resolved

    def _open(self) -> None:
        """Take the lock; make the tables of a new checkpoint or check the version of an old one."""
        # a writer of its own until closed; a transaction survives a killed process
        self._db.execute("PRAGMA locking_mode = EXCLUSIVE")
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = NORMAL")
        self._db.execute("BEGIN IMMEDIATE")

        # a new database gets its tables, an old one must be ours and of this version
        version = self._db.execute("PRAGMA user_version").fetchone()[0]
        if self._db.execute("SELECT count(*) FROM sqlite_schema").fetchone()[0] == 0:
            for statement in filter(str.strip, _SCHEMA.split(";")):
                self._db.execute(statement)
            self._db.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
            self._db.execute(f"PRAGMA application_id = {_APPLICATION_ID}")
        elif self._db.execute("PRAGMA application_id").fetchone()[0] != _APPLICATION_ID:
            raise self._damaged("another program's database")
        elif version != SCHEMA_VERSION:
            raise StateError(
                f"{self.path}: version {version}; expected version {SCHEMA_VERSION}; "
                "use the mcpseg it was made with, or --overwrite"
            )
        self._db.execute("COMMIT")

        self._num_scans = self._db.execute("SELECT count(*) FROM scans").fetchone()[0]

    def _damaged(self, what: str) -> StateError:
        found = f"damaged ({what})"
        return StateError(
            f"{self.path}: {found}; expected an mcpseg checkpoint; start again with --overwrite"
        )

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        with self._explained():
            self._db.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._db.execute("COMMIT")
            except BaseException:
                if self._db.in_transaction:
                    self._db.execute("ROLLBACK")
                raise

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Turn SQLite's errors into one line."""
        try:
            yield
        except sqlite3.Error as error:
            reason = str(error)
            if "locked" in reason:
                raise StateInUseError(
                    f"{self.path}: in use by another mcpseg; expected one writer; "
                    "wait for it or choose another -o"
                ) from error

            # what the disk refuses can be mended; all else is damage
            if any(words in reason for words in _NOT_WRITABLE):
                raise OutputError(
                    f"{self.path}: cannot be written ({reason}); expected room and permission; "
                    "make space and run the same command again, finished scans are kept"
                ) from error
            raise self._damaged(reason) from error


def _checksum(blobs: Sequence[bytes | memoryview]) -> int:
    """Checksum some blobs as one."""
    crc = 0
    for blob in blobs:
        crc = zlib.crc32(blob, crc)
    return crc


def _holes(count: int) -> str:
    return ", ".join("?" * count)
