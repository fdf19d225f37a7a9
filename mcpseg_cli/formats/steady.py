"""Files for HDF5 to write into: there whole or not at all, and safe on a full disk."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from mcpseg_cli.resumable import whole_file


@contextmanager
def steady_file(path: Path) -> Iterator[SteadyFile]:
    """Open a file to write that appears under its name only when complete.

    Args:
        path: The file; its folder must exist; replaced if there.

    Yields:
        The open file, under another name.

    Raises:
        OSError: The disk is full or the folder not writable; nothing is left behind.
    """
    with whole_file(path) as partial, partial.open("w+b") as raw:
        file = SteadyFile(raw)
        yield file
        file.close()


class SteadyFile(io.RawIOBase):
    """A file that goes on after a failed write and says so when closed.

    HDF5 crashes the process over a full disk.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._error: BaseException | None = None

    def write(self, data: object) -> int:
        """Write, or after a failure pretend to."""
        view = memoryview(data)  # type: ignore[arg-type]
        if self._error is None:
            try:
                self._file.write(view)
            except BaseException as error:  # an interrupt, too, has to wait
                self._error = error
        return view.nbytes

    def truncate(self, size: int | None = None) -> int:
        """Change the size, or after a failure pretend to."""
        if self._error is None:
            try:
                self._file.truncate(size)
            except BaseException as error:
                self._error = error
        return size or 0

    def readinto(self, buffer: object) -> int:
        """Read into a buffer."""
        return self._file.readinto(buffer)  # type: ignore[attr-defined, no-any-return]

    def seek(self, offset: int, whence: int = 0) -> int:
        """Move, or after a failure pretend to."""
        try:
            return self._file.seek(offset, whence)
        except OSError as error:  # it writes what is buffered first
            self._error = self._error or error
            return offset

    def tell(self) -> int:
        """Tell the position."""
        return self._file.tell()

    def check(self) -> None:
        """Raise what went wrong so far, so that long work stops early."""
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Raise what went wrong, else write what is buffered."""
        super().close()
        self.check()
        self._file.flush()
