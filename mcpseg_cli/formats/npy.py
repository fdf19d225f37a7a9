"""Arrays as numpy writes them (.npy), checked before room is made for them. Never unpickles."""

from __future__ import annotations

import struct
import tokenize
import warnings
from io import BytesIO
from math import prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError

NOT_AN_ARRAY = (
    ValueError, TypeError, EOFError, KeyError, RuntimeError, ArithmeticError, SyntaxError,
    MemoryError, tokenize.TokenError, struct.error, AttributeError, IndexError,
)  # fmt: skip
"""What numpy raises of damaged headers."""
MAGIC = b"\x93NUMPY"


def parse_npy(data: bytes) -> NDArray[np.generic]:
    """Make an array of the bytes of a file of one.

    Args:
        data: All of the file; shared by the array.

    Raises:
        ValueError: Not as many bytes as its header says, or objects; others of ``NOT_AN_ARRAY``.
    """
    stream = BytesIO(data)
    version = np.lib.format.read_magic(stream)
    readers = {(1, 0): np.lib.format.read_array_header_1_0}
    reader = readers.get(version, np.lib.format.read_array_header_2_0)
    with warnings.catch_warnings(action="ignore"):
        if version == (3, 0):  # as 2.0, but for letters in the names of fields
            data = data[:6] + b"\x02\x00" + data[8:]
            stream = BytesIO(data)
            np.lib.format.read_magic(stream)
        shape, is_fortran, dtype = reader(stream)
    if dtype.hasobject:
        raise ValueError("objects, which are never loaded")

    # as many as promised
    start = stream.tell()
    if min(shape, default=0) < 0 or prod(shape) * dtype.itemsize > len(data) - start:
        raise ValueError(f"{shape} of {dtype} promised in {len(data) - start:,} bytes")
    count = prod(shape) if dtype.itemsize else 0
    array: NDArray[np.generic] = np.frombuffer(data, dtype, count, start)
    return array.reshape(shape, order="F" if is_fortran else "C")


def read_npy(path: Path, expected: str) -> NDArray[np.generic]:
    """Read a file of one array.

    Args:
        path: The file.
        expected: What it should hold, for the message.

    Raises:
        InputError: It is none, cut short, or holds objects.
        OSError: It cannot be opened.
    """
    data = path.read_bytes()
    try:
        return parse_npy(data)
    except NOT_AN_ARRAY as error:
        cause = (str(error).splitlines() or [type(error).__name__])[0][:80]
        raise InputError(
            path, f"no array of numbers ({cause})", expected, "save it again"
        ) from error
