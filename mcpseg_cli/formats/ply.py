"""PLY: ascii and binary of either byte order, properties of any name, order and type.

Source: Greg Turk, "The PLY Polygon File Format", 1994.
"""

import re
import warnings
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.cloud import Cloud, scalar_columns, without_spaces
from mcpseg_cli.formats.parts import CloudParts

_DTYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_NAMES = {
    "i1": "char", "u1": "uchar", "i2": "short", "u2": "ushort",
    "i4": "int", "u4": "uint", "f4": "float", "f8": "double",
}  # fmt: skip
_ORDERS = {"ascii": "=", "binary_little_endian": "<", "binary_big_endian": ">"}
_CLASSES_COMMENT = "mcpseg classes "
_MAX_HEADER = 1 << 16


@dataclass
class _Element:
    """One ``element`` of the header: its name, how many, and its scalar properties."""

    name: str
    count: int
    properties: list[tuple[str, str]]
    has_list: bool = False


@dataclass
class _Header:
    """A parsed header and the byte at which the data starts."""

    encoding: str
    elements: list[_Element]
    classes: tuple[str, ...]
    size: int


def read_ply(path: Path) -> Cloud:
    """Read the vertices of a PLY file; faces and other elements are passed over.

    Args:
        path: The file.

    Returns:
        Its vertices with all their properties.

    Raises:
        InputError: Not a PLY, a header that makes no sense, or fewer vertices than promised.
    """
    data = path.read_bytes()
    header = _parse_header(path, data)
    position = next(
        (i for i, element in enumerate(header.elements) if element.name == "vertex"), None
    )
    if position is None:
        raise InputError(
            path, "no vertex element", "'element vertex N'", "export the cloud with its points"
        )
    vertex = header.elements[position]
    missing = [axis for axis in "xyz" if axis not in dict(vertex.properties)]
    if missing:
        raise InputError(
            path,
            f"no property {', '.join(missing)}",
            "x, y and z",
            "export the cloud with coordinates",
        )
    if any(element.has_list for element in header.elements[: position + 1]):
        raise InputError(
            path,
            "a list property in or before the vertices",
            "scalar properties",
            "export points only",
        )
    if header.encoding == "ascii":
        table = _read_ascii(path, data, header, position)
    else:
        table = _read_binary(path, data, header, position)
    return Cloud(
        {name: np.ascontiguousarray(table[name]) for name, _ in vertex.properties}, header.classes
    )


def write_ply(file: BinaryIO, parts: CloudParts) -> None:
    """Write a cloud as binary little-endian PLY; 64-bit integers become doubles, booleans bytes.

    Raises:
        OutputError: An attribute that is not a number.
    """
    for number, cloud in enumerate(parts):
        columns = without_spaces(scalar_columns(cloud.columns))
        types = [(name, _storable(column.dtype)) for name, column in columns.items()]
        if number == 0:
            file.write(_header_text(len(parts), types, cloud.classes))
        table = np.empty(len(cloud), np.dtype([(name, "<" + dtype) for name, dtype in types]))
        for name, column in columns.items():
            table[name] = column
        file.write(table.data)


def _header_text(num_points: int, types: list[tuple[str, str]], classes: tuple[str, ...]) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0"]
    lines += [f"comment {_CLASSES_COMMENT}{','.join(classes)}"] * bool(classes)
    lines += [
        f"element vertex {num_points}",
        *(f"property {_NAMES[dtype]} {name}" for name, dtype in types),
        "end_header",
    ]
    return ("\n".join(lines) + "\n").encode()


def _storable(dtype: np.dtype[np.generic]) -> str:
    """Name the PLY type, as numpy spells it, that holds ``dtype``."""
    return dtype.str[1:] if dtype.str[1:] in _NAMES else "f8"


def _parse_header(path: Path, data: bytes) -> _Header:
    """Parse the header up to and including ``end_header``."""
    if not data.startswith(b"ply"):
        raise InputError(
            path, f"starts with {data[:8]!r}", "the word 'ply'", "check that this is a PLY file"
        )
    end = re.search(rb"^end_header[ \t\r]*\n", data[:_MAX_HEADER], re.MULTILINE)
    if end is None:
        raise InputError(
            path,
            "no end_header",
            "a complete header",
            "the file is cut short or not PLY; copy it again",
        )
    text = data[: end.start()].decode("utf-8", errors="replace")
    header = _Header("", [], (), end.end())
    for number, line in enumerate(text.splitlines()[1:], start=2):
        try:
            _parse_header_line(header, line.split(), line)
        except (ValueError, KeyError, IndexError) as error:
            raise InputError(
                path,
                f"header line {number} is {line[:60]!r}",
                "a PLY keyword with its arguments",
                "export it again",
            ) from error
    if header.encoding not in _ORDERS:
        raise InputError(
            path,
            f"format {header.encoding!r}",
            f"one of {', '.join(_ORDERS)}",
            "export the cloud again",
        )
    for element in header.elements:
        names = [name for name, _ in element.properties]
        if len(set(names)) != len(names):
            raise InputError(
                path,
                f"{element.name} properties {names} repeat a name",
                "each name once",
                "export it again",
            )
    return header


def _parse_header_line(header: _Header, words: list[str], line: str) -> None:
    """Add one header line to ``header``; ValueError, KeyError or IndexError when it makes no sense."""
    if not words or words[0] == "obj_info":
        return
    if words[0] == "comment":
        if line.partition("comment ")[2].startswith(_CLASSES_COMMENT):
            header.classes = tuple(line.partition(_CLASSES_COMMENT)[2].strip().split(","))
    elif words[0] == "format":
        header.encoding = words[1]
    elif words[0] == "element":
        count = int(words[2])
        if count < 0:
            raise ValueError(words[2])
        header.elements.append(_Element(words[1], count, []))
    elif words[0] == "property" and words[1] == "list":
        header.elements[-1].has_list = True
    elif words[0] == "property":
        header.elements[-1].properties.append((words[2], _DTYPES[words[1]]))
    else:
        raise ValueError(words[0])


def _dtype(header: _Header, element: _Element) -> np.dtype[np.void]:
    order = _ORDERS[header.encoding]
    return np.dtype([(name, order + code) for name, code in element.properties])


def _read_binary(path: Path, data: bytes, header: _Header, position: int) -> NDArray[np.void]:
    """Cut the vertices out of the binary data and convert them to this machine's byte order."""
    sizes = [
        _dtype(header, element).itemsize * element.count
        for element in header.elements[: position + 1]
    ]
    vertex = header.elements[position]
    dtype = _dtype(header, vertex)
    start = header.size + sum(sizes[:-1])
    available = max(0, len(data) - start) // dtype.itemsize
    is_last = position == len(header.elements) - 1
    if available < vertex.count or (is_last and available > vertex.count):
        raise _miscounted(path, vertex.count, available)
    if vertex.count == 0:
        return np.empty(0, dtype.newbyteorder("="))
    table: NDArray[np.void] = np.frombuffer(data, dtype, vertex.count, start)
    return table.astype(dtype.newbyteorder("="))


def _read_ascii(path: Path, data: bytes, header: _Header, position: int) -> NDArray[np.void]:
    """Parse the vertex lines of an ascii file."""
    skipped = sum(element.count for element in header.elements[:position])
    vertex = header.elements[position]
    lines = [line for line in data[header.size :].split(b"\n") if line.strip()][skipped:]
    is_last = position == len(header.elements) - 1
    if len(lines) < vertex.count or (is_last and len(lines) > vertex.count):
        raise _miscounted(path, vertex.count, len(lines))
    dtype = _dtype(header, vertex)
    if vertex.count == 0:
        return np.empty(0, dtype)
    text = BytesIO(b"\n".join(lines[: vertex.count]))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            table: NDArray[np.void] = np.loadtxt(
                text, dtype, comments=None, ndmin=1, encoding="latin-1"
            )
    except (ValueError, OverflowError, Warning) as error:
        raise InputError(
            path,
            f"vertex lines that do not parse ({error})",
            f"{len(vertex.properties)} numbers a line",
            "export the cloud again",
        ) from error
    return table


def _miscounted(path: Path, promised: int, found: int) -> InputError:
    cause = (
        "the file is cut short; copy it again"
        if found < promised
        else "the header is wrong; export it again"
    )
    return InputError(
        path, f"{promised:,} vertices promised, {found:,} found", f"{promised:,}", cause
    )
