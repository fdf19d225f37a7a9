"""What a LAZ says of its compressed chunks, checked before lazrs reads it.

lazrs makes room for what it is told, and ends the process where there is not as much.

Source: "LAZ specification 1.4 R1"; Isenburg, "LASzip", 2013.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import lazrs

from mcpseg_cli.formats.claims import check_claim

_RECORD = 54  # bytes of a record's header
_DESCRIPTION, _ITEM = 34, 6  # bytes of the record of LAZ, and of each of its items
_OWNER, _NUMBER = b"laszip encoded", 22204
_POINTWISE, _LAYERED = 2, 3  # compressors with chunks
_VARIABLE = 0xFFFFFFFF  # the chunk size of files whose chunks differ in size
_SIZES = {6: 20, 7: 8, 8: 6, 9: 29, 10: 30, 11: 6, 12: 8, 13: 29}  # bytes of items by type
_BYTES, _LAYERED_BYTES = 0, 14  # types of items of any size: extra bytes
_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}  # layers of an item; extra bytes are a layer each


@dataclass(frozen=True)
class _Compression:
    """What the record of LAZ says: it is handed to lazrs as it is, as ``record``."""

    record: bytes
    is_layered: bool
    chunk_size: int
    num_layers: int


def check_chunks(path: Path, start: int, point_size: int, num_points: int) -> None:
    """Refuse a LAZ whose chunks are not those that its points need.

    Args:
        path: The file, whose header has room for what it says.
        start: Where the points begin, bytes.
        point_size: Bytes of a point.
        num_points: As the header says.

    Raises:
        ValueError: Says what does not fit.
        InputError: It would unpack to far more than it has bytes.
        LazrsError: The chunk table does not decode.
        OSError: It cannot be read.
    """
    size = path.stat().st_size
    check_claim(path, f"{num_points:,} points", num_points * point_size)
    with path.open("rb") as file:
        compression = _compression(file, point_size)
        if compression.chunk_size != _VARIABLE:
            claim = f"a chunk of {compression.chunk_size:,} points"
            check_claim(path, claim, compression.chunk_size * point_size)

        # how many chunks there are, each of which starts with a whole point
        table = _table_offset(file, start, size)
        file.seek(table + 4)
        (num_chunks,) = struct.unpack("<I", file.read(4))
        if num_chunks * point_size > size:
            raise ValueError(f"{num_chunks:,} chunks promised in {size:,} bytes")
        needed = -(-num_points // compression.chunk_size)
        if compression.chunk_size != _VARIABLE and num_chunks != needed:
            chunks = f"{num_chunks:,} chunks of {compression.chunk_size:,}"
            raise ValueError(f"{chunks} for {num_points:,} points")

        # how long they are
        file.seek(start)
        chunks = lazrs.read_chunk_table(file, lazrs.LazVlr(compression.record))
        _check_table(chunks, compression, table - start - 8, num_points)
        if compression.is_layered:
            _check_layers(file, chunks, compression, start + 8, point_size)


def _compression(file: BinaryIO, point_size: int) -> _Compression:
    """Find and check the record of LAZ."""
    file.seek(94)
    header_size, _, num_records = struct.unpack("<HII", file.read(10))
    file.seek(header_size)
    for _ in range(num_records):
        head = file.read(_RECORD)
        if len(head) < _RECORD:
            break
        number, length = struct.unpack_from("<HH", head, 18)
        record = file.read(length)
        if (head[2:18].split(b"\0")[0], number) == (_OWNER, _NUMBER):
            return _parse(record, point_size)
    raise ValueError("no record of how it is compressed")


def _parse(record: bytes, point_size: int) -> _Compression:
    """Take the record of LAZ apart; struct.error where it is cut short."""
    compressor, coder = struct.unpack_from("<HH", record)
    (chunk_size,) = struct.unpack_from("<I", record, 12)
    (num_items,) = struct.unpack_from("<H", record, _DESCRIPTION - 2)
    items = [
        struct.unpack_from("<HHH", record, _DESCRIPTION + number * _ITEM)
        for number in range(num_items)
    ]
    if compressor not in (_POINTWISE, _LAYERED) or coder != 0 or chunk_size == 0:
        raise ValueError(f"compressor {compressor}, coder {coder}, chunks of {chunk_size:,} points")
    wrong = [kind for kind, size, _ in items if size != _SIZES.get(kind, size)]
    is_layered = compressor == _LAYERED
    unknown = [kind for kind, _, _ in items if (kind >= 10) != is_layered or kind > _LAYERED_BYTES]
    if wrong or unknown or sum(size for _, size, _ in items) != point_size:
        raise ValueError(f"items {items[:8]} for points of {point_size} bytes")
    num_layers = sum(_LAYERS.get(kind, size) for kind, size, _ in items)
    return _Compression(record, is_layered, chunk_size, num_layers)


def _table_offset(file: BinaryIO, start: int, size: int) -> int:
    """Find the chunk table; a file that was written to a stream says at its end where it is."""
    file.seek(start)
    (table,) = struct.unpack("<q", file.read(8).ljust(8, b"\0"))
    if table == -1 and size >= start + 16:
        file.seek(size - 8)
        (table,) = struct.unpack("<q", file.read(8))
    if not start + 8 <= table <= size - 8:
        raise ValueError(f"a chunk table at byte {table:,} of {size:,}, the file may be cut short")
    return int(table)


def _check_table(
    chunks: list[tuple[int, int]], compression: _Compression, num_bytes: int, num_points: int
) -> None:
    """Compare the chunk table, points and bytes of each chunk, with what there is."""
    total = sum(length for _, length in chunks)
    if total != num_bytes:
        raise ValueError(f"chunks of {total:,} bytes in {num_bytes:,}")
    points = sum(count for count, _ in chunks)
    if compression.chunk_size == _VARIABLE and points != num_points:
        raise ValueError(f"chunks of {points:,} points for {num_points:,}")


def _check_layers(
    file: BinaryIO,
    chunks: list[tuple[int, int]],
    compression: _Compression,
    first: int,
    point_size: int,
) -> None:
    """Compare the layers of each chunk with its length: a point, a count, lengths, layers."""
    head = point_size + 4 + 4 * compression.num_layers
    for number, (_, length) in enumerate(chunks):
        file.seek(first + point_size)
        numbers = struct.unpack(f"<{1 + compression.num_layers}I", file.read(head - point_size))
        if head + sum(numbers[1:]) != length:
            promised = f"layers of {sum(numbers[1:]):,} bytes"
            raise ValueError(f"{promised} in chunk {number} of {length:,}")
        first += length
