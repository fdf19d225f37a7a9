"""Texts of LAS records in other encodings, shown to laspy as the UTF-8 that it takes alone.

Source: LAS 1.4, tables 3, 8, 9 and 24. Texts are ASCII there; programs write Latin-1.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator

from mcpseg_cli.formats.claims import BoundedFile

_HEADER_1_4 = 375  # bytes
_RECORD, _EXTENDED = struct.Struct("<2x16sHH32s"), struct.Struct("<2x16sHQ32s")
_OWNER = (2, 16)  # of a record: where, and bytes
_EXTRA_BYTES = (b"LASF_Spec", 4)
_DIMENSION, _TEXTS = 192, ((4, 32), (160, 32))  # bytes of one, and of its name and description


class LasFile(io.BufferedIOBase):
    """A LAS file with the texts of its records as UTF-8; all else is as it is.

    Args:
        file: LAS or LAZ, whose header has room for the records it promises; closed with this.
    """

    def __init__(self, file: BoundedFile) -> None:
        self._file = file
        self._texts = dict(_as_utf8(file))
        self._end = max((at + len(text) for at, text in self._texts.items()), default=0)
        self.seek(0)

    def read(self, size: int | None = -1, /) -> bytes:
        """Read up to ``size`` bytes."""
        at = self.tell()
        data = self._file.read(size)
        if at >= self._end:
            return data
        shown = bytearray(data)
        for start, text in self._texts.items():
            first, last = max(start, at), min(start + len(text), at + len(data))
            if first < last:
                shown[first - at : last - at] = text[first - start : last - start]
        return bytes(shown)

    def seek(self, place: int, whence: int = io.SEEK_SET, /) -> int:
        """Go to a place."""
        return self._file.seek(place, whence)

    def tell(self) -> int:
        """Return the place."""
        return self._file.tell()

    def seekable(self) -> bool:
        """Tell that places can be gone to."""
        return True

    def readable(self) -> bool:
        """Tell that it can be read."""
        return True

    def close(self) -> None:
        """Close the file."""
        self._file.close()
        super().close()


def _as_utf8(file: BoundedFile) -> Iterator[tuple[int, bytes]]:
    """Give place and UTF-8 of each text that is none."""
    for place, size in _places(file):
        file.seek(place)
        field = file.read(size)
        text = field.split(b"\0")[0]
        try:
            text.decode()
        except UnicodeDecodeError:
            shown = text.decode("latin-1").encode()[:size].decode(errors="ignore").encode()
            yield place, shown.ljust(len(field), b"\0")


def _places(file: BoundedFile) -> Iterator[tuple[int, int]]:
    """Give place and bytes of each text of a record that laspy decodes."""
    file.seek(0)
    head = file.read(_HEADER_1_4).ljust(_HEADER_1_4, b"\0")
    (header_size,) = struct.unpack_from("<H", head, 94)
    (count,) = struct.unpack_from("<I", head, 100)
    yield from _of_records(file, header_size, count, _RECORD)
    if head[25] >= 4:
        first, count = struct.unpack_from("<QI", head, 235)
        yield from _of_records(file, first, count, _EXTENDED)


def _of_records(
    file: BoundedFile, at: int, count: int, kind: struct.Struct
) -> Iterator[tuple[int, int]]:
    """Give the same of records that follow one another."""
    size = file.seek(0, io.SEEK_END)
    for _ in range(count):
        if at + kind.size > size:
            return
        file.seek(at)
        owner, number, length, _ = kind.unpack(file.read(kind.size))
        yield at + _OWNER[0], _OWNER[1]
        if (owner.rstrip(b"\0"), number) == _EXTRA_BYTES:
            end = min(at + kind.size + length, size)
            for dimension in range(at + kind.size, end - _DIMENSION + 1, _DIMENSION):
                yield from ((dimension + place, many) for place, many in _TEXTS)
        at += kind.size + length
