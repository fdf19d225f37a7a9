"""What the content of a scan was when it was read, so that a change is noticed later."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

_CLOCK_NS = 2_000_000_000  # coarsest clock of a file system: FAT's


@dataclass(frozen=True)
class Fingerprint:
    """What a scan was when it was read.

    Attributes:
        size: Bytes of its file or files.
        mtime_ns: When they were last changed.
        sha256: Hash of its content, hex.
    """

    size: int
    mtime_ns: int
    sha256: str

    @classmethod
    def of(cls, *paths: Path) -> Fingerprint:
        """Take the fingerprint of a scan that is a file, or several read one after another."""
        if len(paths) > 1:
            size, mtime_ns = _status(paths)
            return cls(size, mtime_ns, _hash(paths))
        with paths[0].open("rb") as file:  # once opened, none is put in its place
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
            return cls(file.tell(), os.fstat(file.fileno()).st_mtime_ns, sha256)

    def is_still(self, path: Path) -> bool:
        """Tell whether a file has still this content; that of a new one is read again.

        Within the resolution of its clock a file system may tell the same time for two contents.
        """
        if (self.size, self.mtime_ns) != _status([path]):
            return False
        is_old = time.time_ns() - self.mtime_ns > _CLOCK_NS
        return is_old or _hash([path]) == self.sha256

    def matches(self, *paths: Path) -> bool:
        """Compare with files; their content is read only where size and time do not settle it."""
        size, mtime_ns = _status(paths)
        if size != self.size:
            return False
        return mtime_ns == self.mtime_ns or _hash(paths) == self.sha256

    @classmethod
    def of_part(cls, path: Path, content: Sequence[bytes | memoryview]) -> Fingerprint:
        """Take the fingerprint of a scan that is a part of a file.

        Args:
            path: The file, or the folder that files of its kind lie in.
            content: The bytes of the scan itself.
        """
        digest = hashlib.sha256()
        for part in content:
            digest.update(part)
        size, mtime_ns = _status(_files(path))
        return cls(size, mtime_ns, digest.hexdigest())

    def is_untouched(self, path: Path) -> bool:
        """Tell whether the file that the scan is a part of is as large and old as it was."""
        return (self.size, self.mtime_ns) == _status(_files(path))


def _files(path: Path) -> tuple[Path, ...]:
    """Return a file itself, or all files of a folder."""
    if path.is_dir():
        return tuple(sorted(inner for inner in path.iterdir() if inner.is_file()))
    return (path,)


def _status(paths: Sequence[Path]) -> tuple[int, int]:
    """Return bytes of all files, and when one was last changed."""
    if len(paths) == 1:
        one = paths[0].stat()
        return one.st_size, one.st_mtime_ns
    found = [path.stat() for path in paths]
    return sum(one.st_size for one in found), max((one.st_mtime_ns for one in found), default=0)


def _hash(paths: Sequence[Path]) -> str:
    digest = hashlib.sha256()
    for path in paths:
        with path.open("rb") as file:
            if len(paths) == 1:
                return hashlib.file_digest(file, "sha256").hexdigest()
            digest.update(hashlib.file_digest(file, "sha256").digest())
    return digest.hexdigest()
