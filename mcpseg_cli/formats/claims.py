"""What files claim to hold, compared with their size before room is made for it."""

from __future__ import annotations

import io
import sys
from pathlib import Path

from mcpseg_cli.errors import InputError

if sys.platform == "win32":
    from pathlib import WindowsPath as SystemPath
else:
    from pathlib import PosixPath as SystemPath

MOST_TIMES = 64
"""How many times its bytes a file may unpack to, beside ``SPARE``."""
SPARE = 64 << 20
"""Bytes that any file may unpack to."""
_FEW = 1 << 16  # bytes for which there is room in any case


def check_claim(path: Path, what: str, num_bytes: int, *, packed: int | None = None) -> None:
    """Refuse what would take far more room than it has bytes; sound scans pack at most tenfold.

    Args:
        path: The file.
        what: What makes the claim, for the message.
        num_bytes: What it would take unpacked.
        packed: Bytes of that part of the file; None: of all of it.

    Raises:
        InputError: More than ``MOST_TIMES`` the bytes and ``SPARE``.
        OSError: The file is gone.
    """
    size = path.stat().st_size if packed is None else packed
    most = MOST_TIMES * size + SPARE
    if num_bytes > most or num_bytes < 0:
        found = f"{what} promises {num_bytes:,} bytes in {size:,}"
        raise InputError(path, found, f"at most {most:,}", "the file is damaged; save it again")


class BoundedFile(io.BufferedReader):
    """A file of which no more is read than there is: ``read`` makes room before it looks."""

    def read(self, size: int | None = -1) -> bytes:
        """Read up to ``size`` bytes."""
        if size is not None and size > _FEW:
            at = self.tell()
            size = min(size, max(0, self.seek(0, io.SEEK_END) - at))
            self.seek(at)
        return super().read(size)


class BoundedPath(SystemPath):
    """A path of a file that, opened, makes no room for more bytes than it has."""

    def open(self, *_: object, **__: object) -> BoundedFile:  # type: ignore[override]
        """Open it to read bytes."""
        return open_bounded(self)


def open_bounded(path: Path) -> BoundedFile:
    """Open a file to read bytes, for a library that believes what records say of their length."""
    return BoundedFile(io.FileIO(str(path)))
