"""PLY: ascii and binary of either byte order, properties of any name, order and type.

Source: Greg Turk, "The PLY Polygon File Format", 1994.
"""

import re
import warnings
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from time import sleep, time
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats.cloud import Cloud, scalar_columns, without_spaces
from mcpseg_cli.formats.magic import recognise, saw
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
_MAX_HEADER = 1 << 24  # bytes: half a million properties
_ATTEMPTS = 20
_PAUSE_S = 0.02
_SETTLED_S = 1.0  # from the new vertices of a map to their number in its header at most


class _TooManyError(InputError):
    """More vertices than the header promises."""


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
    # the map of a run that goes on has new vertices before its header says so
    for _ in range(_ATTEMPTS):
        try:
            return _read(path, path.read_bytes())
        except _TooManyError:
            if time() - path.stat().st_mtime > _SETTLED_S:
                raise
            sleep(_PAUSE_S)
    return _read(path, path.read_bytes())


def _read(path: Path, data: bytes) -> Cloud:
    """Read the vertices of a whole file."""
    header = _parse_header(path, data)
    position = _vertex_position(path, header)
    if header.encoding == "ascii":
        table = _read_ascii(path, data, header, position)
    else:
        table = _read_binary(path, data, header, position)
    names = [name for name, _ in header.elements[position].properties]
    return Cloud({name: np.ascontiguousarray(table[name]) for name in names}, header.classes)


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

        # vertex after vertex
        table = np.empty(len(cloud), np.dtype([(name, "<" + dtype) for name, dtype in types]))
        for name, column in columns.items():
            table[name] = column
        file.write(table.data)


def _header_text(num_points: int, types: list[tuple[str, str]], classes: tuple[str, ...]) -> bytes:
    """Write the header of a binary file."""
    lines = ["ply", "format binary_little_endian 1.0"]
    lines += [f"comment {_CLASSES_COMMENT}{','.join(classes)}"] * bool(classes)
    lines.append(f"element vertex {num_points}")
    lines += [f"property {_NAMES[dtype]} {name}" for name, dtype in types]
    lines.append("end_header")
    text = ("\n".join(lines) + "\n").encode()
    if len(text) > _MAX_HEADER:
        raise OutputError(
            f"a header of {len(text):,} bytes for {len(types):,} attributes; "
            f"expected at most {_MAX_HEADER:,}; choose --format npz"
        )
    return text


def _storable(dtype: np.dtype[np.generic]) -> str:
    """Name the PLY type, as numpy spells it, that holds ``dtype``."""
    return dtype.str[1:] if dtype.str[1:] in _NAMES else "f8"


def _parse_header(path: Path, data: bytes) -> _Header:
    """Parse the header up to and including ``end_header``."""
    if not data.startswith(b"ply"):
        remedy = "check that this is a PLY file"
        found = f"starts with {data[:8]!r}{recognise(path, ', ')}"
        raise InputError(path, found, "the word 'ply'", remedy)
    end = re.search(rb"^end_header[ \t\r]*\n", data[:_MAX_HEADER], re.MULTILINE)
    if end is None:
        remedy = "the file is cut short or not PLY; copy it again"
        raise InputError(path, "no end_header", "a complete header", remedy)

    # line by line
    text = data[: end.start()].decode("utf-8", errors="replace")
    header = _Header("", [], (), end.end())
    for number, line in enumerate(text.splitlines()[1:], start=2):
        try:
            _parse_header_line(header, line.split(), line)
        except (ValueError, KeyError, IndexError) as error:
            found = f"header line {number} is {line[:60]!r}"
            expected = "a PLY keyword with its arguments"
            raise InputError(path, found, expected, "export it again") from error

    # that it makes sense
    if header.encoding not in _ORDERS:
        expected = f"one of {', '.join(_ORDERS)}"
        raise InputError(path, f"format {header.encoding!r}", expected, "export the cloud again")
    for element in header.elements:
        names = [name for name, _ in element.properties]
        if len(set(names)) != len(names):
            found = f"{element.name} properties {names} repeat a name"
            raise InputError(path, found, "each name once", "export it again")
    return header


def _vertex_position(path: Path, header: _Header) -> int:
    """Return the place of the vertices among the elements, if they can be read."""
    names = [element.name for element in header.elements]
    if "vertex" not in names:
        remedy = "export the cloud with its points"
        raise InputError(path, "no vertex element", "'element vertex N'", remedy)

    position = names.index("vertex")
    properties = dict(header.elements[position].properties)
    if missing := [axis for axis in "xyz" if axis not in properties]:
        found = f"no property {', '.join(missing)} among {saw(properties, missing)}"
        raise InputError(path, found, "x, y and z", "export the cloud with coordinates")
    if any(element.has_list for element in header.elements[: position + 1]):
        found = "a list property in or before the vertices"
        raise InputError(path, found, "scalar properties", "export points only")
    return position


def _parse_header_line(header: _Header, words: list[str], line: str) -> None:
    """Add one header line; ValueError, KeyError or IndexError when it makes no sense."""
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
        name = words[2].lower() if words[2] in "XYZ" else words[2]
        header.elements[-1].properties.append((name, _DTYPES[words[1]]))
    else:
        raise ValueError(words[0])


def _dtype(header: _Header, element: _Element) -> np.dtype[np.void]:
    order = _ORDERS[header.encoding]
    return np.dtype([(name, order + code) for name, code in element.properties])


def _read_binary(path: Path, data: bytes, header: _Header, position: int) -> NDArray[np.void]:
    """Cut the vertices out of the binary data and convert them to this machine's byte order."""
    # the elements before the vertices are passed over
    before = header.elements[:position]
    sizes = [_dtype(header, element).itemsize * element.count for element in before]
    start = header.size + sum(sizes)

    # as many vertices as promised, and nothing behind them
    vertex = header.elements[position]
    dtype = _dtype(header, vertex)
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
    # as many lines as promised, those of elements before the vertices left out
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
        with warnings.catch_warnings(action="error"):
            table: NDArray[np.void] = np.loadtxt(
                text, dtype, comments=None, ndmin=1, encoding="latin-1"
            )
    except (ValueError, OverflowError, Warning) as error:
        found = f"vertex lines that do not parse ({error})"
        expected = f"{len(vertex.properties)} numbers a line"
        raise InputError(path, found, expected, "export the cloud again") from error
    return table


def _miscounted(path: Path, promised: int, found: int) -> InputError:
    """Refuse a file with fewer or more vertices than its header promises."""
    counts, remedy = f"{promised:,} vertices promised, {found:,} found", "copy it again"
    if found < promised:
        return InputError(path, counts, f"{promised:,}", f"the file is cut short; {remedy}")
    return _TooManyError(path, counts, f"{promised:,}", "the header is wrong; export it again")
