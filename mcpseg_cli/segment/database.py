"""A SQLite file of one writer: locked until closed, every row checked, errors told in one line."""

from __future__ import annotations

import sqlite3
import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path

from mcpseg_cli.errors import OutputError, StateError, StateInUseError

Value = None | int | float | str | bytes | memoryview
"""What a cell of a row may hold."""

_APPLICATION_ID = 0x6D637073  # "mcps"
_NOT_WRITABLE = ("full", "I/O", "readonly", "unable to open")  # in SQLite's words
_SMALL = 1 << 12  # bytes of a row that are joined before they are checked: one call, not thirty
_SHOWN_SCHEMA = "SELECT type, name, tbl_name, sql FROM sqlite_schema ORDER BY type, name"


class Database:
    """An open database, locked against every other process until closed.

    The last column of every table is ``checksum``: of all other values of the row and their types.

    Args:
        path: The file; made if not there.
        schema: Statements that make its tables, each ended by a semicolon.
        version: Of the schema.
        name: What errors call the file.
        is_durable: Whether a transaction that has ended survives a power cut, too.

    Raises:
        StateError: In use, damaged, another program's, or of another version.
        OutputError: It cannot be written.
    """

    def __init__(
        self, path: Path, schema: str, version: int, name: Path, *, is_durable: bool = False
    ) -> None:
        self._name = name
        with self.explained():
            self.connection = sqlite3.connect(path, timeout=0, isolation_level=None)
        self.connection.text_factory = _text
        try:
            with self.explained():
                self._open(schema, version, is_durable=is_durable)
                self._check(schema)
        except BaseException:
            self.connection.close()
            raise

    def close(self) -> None:
        """Release the lock; should the log not get into the database, it stays beside it."""
        self.connection.close()

    def damaged(self, what: str) -> StateError:
        """Make the error that says that the file is not as it was written."""
        found = f"damaged ({what})"
        return StateError(
            f"{self._name}: {found}; expected an mcpseg checkpoint; start again with --overwrite"
        )

    def insert(self, table: str, *values: Value, replace: bool = False) -> None:
        """Write a row with its checksum; within a transaction.

        Args:
            table: Where.
            values: Of all columns but the checksum.
            replace: Put it in the place of the row of the same key.
        """
        verb = "INSERT OR REPLACE" if replace else "INSERT"
        holes = ", ".join("?" * (len(values) + 1))
        statement = f"{verb} INTO {table} VALUES ({holes})"
        self.connection.execute(statement, (*values, row_checksum(table, values)))

    def rows(
        self, table: str, condition: str = "TRUE", arguments: Sequence[Value] = ()
    ) -> Iterator[tuple[Value, ...]]:
        """Iterate over rows by the first two columns, each as it was written.

        Args:
            table: Which.
            condition: SQL that rows must meet.
            arguments: For its question marks.

        Yields:
            All columns but the checksum.

        Raises:
            StateError: A row is not as it was written.
        """
        statement = f"SELECT * FROM {table} WHERE {condition} ORDER BY 1, 2"
        with self.explained():
            for *values, checksum in self.connection.execute(statement, arguments):
                if row_checksum(table, values) != checksum:
                    raise self.damaged(f"a row of {table}")
                yield tuple(values)

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write all or nothing of what is done within."""
        with self.explained():
            self.connection.execute("BEGIN IMMEDIATE")
            try:
                yield
                self.connection.execute("COMMIT")
            except BaseException:
                if self.connection.in_transaction:
                    self.connection.execute("ROLLBACK")
                raise

    @contextmanager
    def explained(self) -> Iterator[None]:
        """Turn SQLite's errors into one line."""
        try:
            yield
        except UnicodeDecodeError as error:  # damage in what SQLite itself reads
            raise self.damaged("text that is no UTF-8") from error
        except sqlite3.Error as error:
            reason = " ".join(str(error).split())  # SQLite shows statements as they were written
            if "locked" in reason:
                raise StateInUseError(
                    f"{self._name}: in use by another mcpseg; expected one writer; "
                    "wait for it or choose another -o"
                ) from error

            # what the disk refuses can be mended; all else is damage
            if any(words in reason for words in _NOT_WRITABLE):
                raise OutputError(
                    f"{self._name}: cannot be written ({reason}); expected room and permission; "
                    "make space and run the same command again, finished scans are kept"
                ) from error
            raise self.damaged(reason) from error

    def _open(self, schema: str, version: int, *, is_durable: bool) -> None:
        """Take the lock; make the tables of a new file or check the version of an old one."""
        # a writer of its own until closed; a transaction survives a killed process
        run = self.connection.execute
        run("PRAGMA locking_mode = EXCLUSIVE")
        run("PRAGMA journal_mode = WAL")
        run(f"PRAGMA synchronous = {'FULL' if is_durable else 'NORMAL'}")
        run("BEGIN IMMEDIATE")

        # a new database gets its tables, an old one must be ours and of this version
        found = run("PRAGMA user_version").fetchone()[0]
        if run("SELECT count(*) FROM sqlite_schema").fetchone()[0] == 0:
            for statement in filter(str.strip, schema.split(";")):
                run(statement)
            run(f"PRAGMA user_version = {version}")
            run(f"PRAGMA application_id = {_APPLICATION_ID}")
        elif run("PRAGMA application_id").fetchone()[0] != _APPLICATION_ID:
            raise self.damaged("another program's database")
        elif found != version:
            raise StateError(
                f"{self._name}: version {found}; expected version {version}; "
                "use the mcpseg it was made with, or --overwrite"
            )
        run("COMMIT")

    def _check(self, schema: str) -> None:
        """See that the tables are ours and that no page is torn or used twice."""
        with closing(sqlite3.connect(":memory:")) as fresh:
            fresh.executescript(schema)
            expected = fresh.execute(_SHOWN_SCHEMA).fetchall()
        if self.connection.execute(_SHOWN_SCHEMA).fetchall() != expected:
            raise self.damaged("its tables are not those of this version")
        (found,) = self.connection.execute("PRAGMA quick_check(1)").fetchone()
        if found != "ok":
            raise self.damaged(" ".join(str(found).split()))


def row_checksum(table: str, values: Sequence[Value]) -> int:
    """Checksum a row: CRC-32 of its table, and of type, length and bytes of each value.

    Raises:
        TypeError: A value of a type that no column has.
    """
    parts: list[bytes | memoryview] = [table.encode()]
    for value in values:
        if value is None:
            parts.append(b"n;")
        elif type(value) is int:
            parts.append(b"i%d;" % value)
        elif type(value) is float:
            parts.append(b"f" + struct.pack("<d", value))
        else:
            parts += _sized(value)
    is_small = sum(map(len, parts)) < _SMALL
    crc = 0
    for part in [b"".join(parts)] if is_small else parts:
        crc = zlib.crc32(part, crc)
    return crc


def _sized(value: Value) -> tuple[bytes, bytes | memoryview]:
    """Give type and length of a text or blob, and its bytes."""
    if isinstance(value, str):
        data = value.encode("utf-8", "surrogateescape")
        return b"s%d:" % len(data), data
    if isinstance(value, bytes):
        return b"b%d:" % len(value), value
    if isinstance(value, memoryview):
        return b"b%d:" % value.nbytes, value
    raise TypeError(f"a {type(value).__name__} in a row")


def _text(data: bytes) -> str:
    """Read text; what is no UTF-8 stays different from any text that is."""
    return data.decode("utf-8", "surrogateescape")
