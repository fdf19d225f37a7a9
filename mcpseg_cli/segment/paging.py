"""Maps larger than memory: rows lie in files, and what is far from the robot leaves memory.

The files are mapped into memory by the operating system, which reads what is touched and takes back
what was let go. So the map is one map, whatever is in memory: no label can depend on it.
"""

from __future__ import annotations

import mmap
import shutil
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import OutputError
from mcpseg_cli.incremental.column import Memory, Near, ScalarT
from mcpseg_cli.incremental.growing_map import ROOM_HEIGHT

_RESERVED = 1 << 28  # rows of each file, which is sparse: no map copies itself to grow
_EVERY = 32  # scans
_LEAST_FREE = 200_000_000  # bytes of the disk, more than what is touched in between
_PAGE = mmap.PAGESIZE


class PagedMemory(Memory):
    """Rows in files without a name, which end with the process, however that ends.

    Args:
        folder: Where the files are; it must have room for the whole map, some 250 bytes a voxel.
        distance: Metres around the robot, horizontally, within which rows stay in memory.

    Raises:
        OutputError: The disk does not hold sparse files, or is nearly full.
    """

    holds_all = False

    def __init__(self, folder: Path, distance: float) -> None:
        self._folder, self._distance = folder, distance
        self._files: list[tuple[mmap.mmap, int, bool]] = []
        self._num_scans = 0

    def rows(self, dtype: type[ScalarT], shape: tuple[int, ...], count: int) -> NDArray[ScalarT]:
        """Map a file; see ``Memory``."""
        width = int(np.prod(shape, dtype=int)) * np.dtype(dtype).itemsize
        most = max(count, _RESERVED)
        try:
            with tempfile.TemporaryFile(dir=self._folder) as file:
                file.truncate(most * width)
                mapped = mmap.mmap(file.fileno(), most * width)
        except (OSError, ValueError) as error:
            raise OutputError(
                f"{self._folder}: no sparse file of {most * width / 1e9:,.0f} GB ({error}); "
                "expected a disk of this machine; leave --keep-near out"
            ) from error
        is_of_voxels = len(shape) == 0 or shape[-1] != 64  # else of blocks of voxels
        self._files.append((mapped, width, is_of_voxels))
        return np.frombuffer(mapped, dtype).reshape(most, *shape)

    def leave(self, position: NDArray[np.float64], near: Near) -> None:
        """Let go, now and then, what is far; see ``Memory``."""
        self._num_scans += 1
        self._check_room()
        if self._num_scans % _EVERY:
            return
        ids = near(position, self._distance, ROOM_HEIGHT).astype(np.int64)
        for mapped, width, is_of_voxels in self._files:
            kept = _pages(ids, width) if is_of_voxels else np.empty(0, np.int64)
            _let_go(mapped, kept)

    def leave_all(self) -> None:
        """Let everything go; see ``Memory``."""
        self._check_room()
        for mapped, _, _ in self._files:
            _let_go(mapped, np.empty(0, np.int64))

    def _check_room(self) -> None:
        """Stop before the disk is full: a page that cannot be written would kill the process."""
        free = shutil.disk_usage(self._folder).free
        if free < _LEAST_FREE:
            raise OutputError(
                f"{self._folder}: {free / 1e6:,.0f} MB free; expected room for the map, some 250 "
                "bytes a voxel; make space and run the same command again, finished scans are kept"
            )


def _pages(ids: NDArray[np.int64], width: int) -> NDArray[np.int64]:
    """List the pages that rows lie in, ascending."""
    return np.union1d(ids * width // _PAGE, ((ids + 1) * width - 1) // _PAGE)


def _let_go(mapped: mmap.mmap, kept: NDArray[np.int64]) -> None:
    """Let all pages of a file go but some; what was written is in the file."""
    starts = np.concatenate([[0], kept + 1])
    ends = np.concatenate([kept, [-(-len(mapped) // _PAGE)]])
    for row in np.flatnonzero(ends > starts):
        start, end = int(starts[row]) * _PAGE, min(int(ends[row]) * _PAGE, len(mapped))
        mapped.madvise(mmap.MADV_DONTNEED, start, end - start)
