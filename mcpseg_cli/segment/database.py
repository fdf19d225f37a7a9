"""A SQLite file of one writer: locked until closed, its errors told in one line."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mcpseg_cli.errors import OutputError, StateError, StateInUseError

_APPLICATION_ID = 0x6D637073  # "mcps"
_NOT_WRITABLE = ("full", "I/O", "readonly", "unable to open")  # in SQLite's words


class Database:
    """An open database, locked against every other process until closed.

    Args:
        path: The file; made if not there.
        schema: Statements that make its tables, each ended by a semicolon.
        version: Of the schema.
        name: What errors call the file.

    Attributes:
        connection: To it; every use within ``explained``.

    Raises:
        StateError: In use, damaged, another program's, or of another version.
        OutputError: It cannot be written.
    """

    def __init__(self, path: Path, schema: str, version: int, name: Path) -> None:
        self._name = name
        with self.explained():
            self.connection = sqlite3.connect(path, timeout=0, isolation_level=None)
        try:
            with self.explained():
                self._open(schema, version)
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
        except sqlite3.Error as error:
            reason = str(error)
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

    def _open(self, schema: str, version: int) -> None:
        """Take the lock; make the tables of a new file or check the version of an old one."""
        # a writer of its own until closed; a transaction survives a killed process
        run = self.connection.execute
        run("PRAGMA locking_mode = EXCLUSIVE")
        run("PRAGMA journal_mode = WAL")
        run("PRAGMA synchronous = NORMAL")
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
