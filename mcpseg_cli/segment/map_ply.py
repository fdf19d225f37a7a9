"""map.ply, kept current in place: new vertices appended, changed ones patched, the count last."""

from __future__ import annotations

import os
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import naming
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.resumable import write_whole

_VERTEX = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1"),
     ("semantic", "u1"), ("instance", "<i4"), ("confidence", "<f4")]
)  # fmt: skip
_PROPERTIES = (
    "property float x",
    "property float y",
    "property float z",
    "property uchar red",
    "property uchar green",
    "property uchar blue",
    "property uchar semantic",
    "property int instance",
    "property float confidence",
)
_COUNT_DIGITS = 12
_GAP = 4096 // _VERTEX.itemsize  # changed vertices this close are written in one go
_CHUNK = 1 << 16  # vertices compared at a time when reconciling


class LabelledMap:
    """The whole labelled map as a PLY file that any viewer opens at any moment.

    At every moment the header names no more vertices than the file has: new ones are written before
    it, and are cut off after it.

    Args:
        path: The file; made if not there; no link is followed.
        classes: Class names, written into the header.
        offset: What was subtracted from the recording's coordinates, written into the header
            unless it is nothing.

    Raises:
        OSError: It cannot be written, or is a link.
    """

    def __init__(
        self, path: Path, classes: tuple[str, ...], offset: tuple[float, ...] = ()
    ) -> None:
        self._path = path
        self._offset_words = " ".join(f"{value:.17g}" for value in offset) if any(offset) else ""
        self._classes = classes
        self._count = 0
        if not path.exists():  # whole from the first moment on
            write_whole(path, self._header(0))
        self._file = os.open(path, os.O_RDWR | os.O_NOFOLLOW)

    def __enter__(self) -> LabelledMap:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)

    def update(self, rows: MapRows, changed: NDArray[np.int32]) -> None:
        """Append the vertices that are new and rewrite those that changed.

        Args:
            rows: The whole map as known now.
            changed: (Q,) int32 ids of earlier voxels whose labels changed, ascending.

        Raises:
            OSError: The disk is full; the file still opens with the vertices it had.
        """
        start = self._count
        self._write(self._offset(start), _vertices(rows, slice(start, len(rows))))
        for first, last in _runs(changed):
            self._write(self._offset(first), _vertices(rows, slice(first, last + 1)))
        if len(rows) != start or start == 0:
            self._write(0, self._header(len(rows)))
        self._count = len(rows)

    def append(self, rows: MapRows) -> None:
        """Append vertices; they count from ``finish`` on."""
        self._write(self._offset(self._count), _vertices(rows, slice(None)))
        self._count += len(rows)

    def finish(self) -> None:
        """Write the header for all vertices appended."""
        self._write(0, self._header(self._count))

    def reconcile(self, rows: MapRows) -> None:
        """Make the file equal to the map, writing only where it differs.

        Args:
            rows: The whole map as known now.

        Raises:
            OSError: The disk is full.
        """
        for start in range(0, len(rows), _CHUNK):
            expected = _vertices(rows, slice(start, start + _CHUNK))
            if os.pread(self._file, len(expected), self._offset(start)) != expected:
                self._write(self._offset(start), expected)
        header = self._header(len(rows))
        if os.pread(self._file, len(header), 0) != header:
            self._write(0, header)
        if os.fstat(self._file).st_size != self._offset(len(rows)):
            os.ftruncate(self._file, self._offset(len(rows)))
        self._count = len(rows)

    def flush(self) -> None:
        """Wait until the file is on the disk."""
        os.fsync(self._file)

    def _offset(self, vertex: int) -> int:
        return len(self._header(0)) + vertex * _VERTEX.itemsize

    def _header(self, count: int) -> bytes:
        """Give the header, of the same length for any count: a comment takes up the slack."""
        digits = str(count)
        lines = (
            "ply",
            "format binary_little_endian 1.0",
            *[f"comment mcpseg classes {','.join(self._classes)}"] * bool(self._classes),
            *[f"comment mcpseg offset {self._offset_words}"] * bool(self._offset_words),
            f"comment {'.' * (_COUNT_DIGITS - len(digits))}",
            f"element vertex {digits}",
            *_PROPERTIES,
            "end_header",
        )
        return ("\n".join(lines) + "\n").encode()

    def _write(self, offset: int, data: bytes) -> None:
        view = memoryview(data)
        with naming(self._path):
            while view:
                written = os.pwrite(self._file, view, offset)
                view, offset = view[written:], offset + written


def _vertices(rows: MapRows, which: slice) -> bytes:
    """Pack some rows of the map as vertices."""
    table = np.empty(len(rows.xyz[which]), _VERTEX)
    for column, name in enumerate(("x", "y", "z")):
        table[name] = rows.xyz[which, column]
    for column, name in enumerate(("red", "green", "blue")):
        table[name] = rows.rgb[which, column]
    table["semantic"], table["instance"] = rows.semantic[which], rows.instance[which]
    table["confidence"] = rows.confidence[which]
    return table.tobytes()


def _runs(ids: NDArray[np.int32]) -> list[tuple[int, int]]:
    """Split ascending ids into ranges (first, last) with no large gap inside."""
    if len(ids) == 0:
        return []
    breaks = np.flatnonzero(np.diff(ids) > _GAP)
    firsts, lasts = (
        np.concatenate([ids[:1], ids[breaks + 1]]),
        np.concatenate([ids[breaks], ids[-1:]]),
    )
    return list(zip(firsts.tolist(), lasts.tolist(), strict=True))
