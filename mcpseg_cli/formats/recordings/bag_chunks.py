"""Compressed chunks of bags, unpacked up to a bound: a small one may claim or hold any size."""

from __future__ import annotations

from bz2 import BZ2Decompressor

import zstandard
from lz4.frame import LZ4FrameDecompressor

from mcpseg_cli.formats.claims import MOST_TIMES, SPARE


def unpack_bz2(data: bytes) -> bytes:
    """Unpack a chunk of bz2.

    Raises:
        ValueError: It holds too much, or is cut short.
        OSError: It is damaged.
    """
    return _unpack(BZ2Decompressor(), data)


def unpack_lz4(data: bytes) -> bytes:
    """Unpack a chunk of lz4.

    Raises:
        ValueError: It holds too much, or is cut short.
        RuntimeError: It is damaged.
    """
    return _unpack(LZ4FrameDecompressor(), data)


def unpack_zstd(data: bytes, claimed: int) -> bytes:
    """Unpack a chunk of zstd.

    Args:
        data: A frame, which may say how large it is unpacked.
        claimed: How large it is otherwise, bytes.

    Raises:
        ValueError: It claims too much.
        ZstdError: It is damaged, or larger than that.
    """
    stated = zstandard.frame_content_size(data)
    if max(stated, claimed) > _most(data):
        raise _too_large(data)
    return zstandard.decompress(data, claimed)


def _unpack(decompressor: BZ2Decompressor | LZ4FrameDecompressor, data: bytes) -> bytes:
    """Unpack as much as may be, and see whether that is all."""
    most = _most(data)
    unpacked: bytes = decompressor.decompress(data, max_length=most)
    if not decompressor.eof:
        raise _too_large(data) if len(unpacked) >= most else ValueError("a chunk that is cut short")
    return unpacked


def _most(data: bytes) -> int:
    """Return the bytes that a chunk may have unpacked, see ``claims``."""
    return MOST_TIMES * len(data) + SPARE


def _too_large(data: bytes) -> ValueError:
    return ValueError(f"a chunk of {len(data):,} bytes that unpacks to more than {_most(data):,}")
