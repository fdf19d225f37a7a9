"""PCD, the Point Cloud Library's format, 0.7: ascii, binary and compressed, any fields.

Read with numpy: Open3D's reader leaves memory unset where a file is damaged and keeps one number of
a longer field.
"""

import re
import warnings
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats.cloud import Cloud, Organisation, as_number, without_spaces
from mcpseg_cli.formats.magic import recognise, saw
from mcpseg_cli.formats.parts import CloudParts

_MAX_HEADER = 1 << 24  # bytes: hundreds of thousands of fields
_FIRST_PART = 1 << 14  # bytes of a file that most headers are shorter than
_MOST_VALUES = 1 << 24  # of a field
_MOST_UNPACKED = 88  # bytes that LZF makes of one: 264 of three
_ENCODINGS = ("ascii", "binary", "binary_compressed")
_KINDS = {"F": "f", "I": "i", "U": "u"}
_SIZES = {"F": (4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
_PADDING = "_"
_COLOURS = ("red", "green", "blue")
_PACKED = {"rgb": 3, "rgba": 4}
_CLASSES_COMMENT = "# mcpseg classes "
_NOWHERE = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)  # the viewpoint of a file that says none


@dataclass
class _Header:
    """A checked header and the byte at which the data starts."""

    dtype: np.dtype[np.void]
    num_points: int
    encoding: str
    classes: tuple[str, ...]
    size: int
    organisation: Organisation


def read_pcd(path: Path) -> Cloud:
    """Read a PCD file with all its fields.

    Args:
        path: The file.

    Returns:
        Its points; packed ``rgb`` becomes ``red``, ``green`` and ``blue``, padding is left out.

    Raises:
        InputError: A damaged header, missing coordinates, fewer points than promised or data that
            do not parse.
    """
    data = path.read_bytes()
    header = _parse_header(path, data)
    if header.encoding == "ascii":
        table = _read_ascii(path, data[header.size :], header)
    elif header.encoding == "binary":
        found = (len(data) - header.size) // header.dtype.itemsize
        if found < header.num_points:
            raise _cut_short(path, header.num_points, found)
        table = np.frombuffer(data, header.dtype, header.num_points, header.size)
    else:
        table = _read_compressed(path, data[header.size :], header)

    # packed colours, unless there are plain ones; padding is left out
    columns: dict[str, NDArray[np.generic]] = {}
    for name in header.dtype.names or ():
        column = np.ascontiguousarray(table[name])
        if name in _PACKED and column.dtype.itemsize == 4 and column.ndim == 1:
            if not set(_COLOURS) & set(header.dtype.names or ()):
                columns |= _unpack_colours(column, _PACKED[name])
        elif not name.startswith(_PADDING + " "):
            columns[name] = column
    return Cloud(columns, header.classes, organisation=header.organisation)


def pcd_pose(path: Path) -> NDArray[np.float64] | None:
    """Read the viewpoint of a PCD file as a pose.

    Args:
        path: The file; only its header is read.

    Returns:
        (4, 4) float64, sensor to map; None where the header says none, or the origin.

    Raises:
        InputError: A damaged header.
    """
    with path.open("rb") as file:
        head = file.read(_FIRST_PART)
        if _data_line(head) is None:
            head += file.read(_MAX_HEADER - len(head))
    viewpoint = _parse_header(path, head).organisation.viewpoint
    norm = float(np.linalg.norm(viewpoint[3:]))
    if viewpoint == _NOWHERE or not norm > 0:
        return None
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(viewpoint[3:], scalar_first=True).as_matrix()
    pose[:3, 3] = viewpoint[:3]
    return pose


def write_pcd(file: BinaryIO, parts: CloudParts) -> None:
    """Write a cloud as binary PCD; colours are packed into ``rgb``, booleans become bytes.

    Args:
        file: Where to write.
        parts: The points; colours of more than 8 bits are also written as they are.

    Raises:
        OutputError: An attribute that is not a number.
    """
    for number, cloud in enumerate(parts):
        columns = _fields(cloud)
        if number == 0:
            file.write(_header_text(len(parts), columns, cloud))

        # point after point
        dtype = [
            (name, column.dtype.newbyteorder("<"), column.shape[1:])
            for name, column in columns.items()
        ]
        table = np.empty(len(cloud), dtype)
        for name, column in columns.items():
            table[name] = column
        file.write(table.data)


def _fields(cloud: Cloud) -> dict[str, NDArray[np.generic]]:
    """Give every field as (N, count)."""
    numbers = {name: as_number(name, column) for name, column in cloud.columns.items()}
    columns = without_spaces(numbers)
    if set(_COLOURS) <= columns.keys() and (rgb := cloud.rgb) is not None:
        red, green, blue = rgb.astype(np.uint32).T
        columns["rgb"] = (red << 16 | green << 8 | blue).view(np.float32)
        if all(columns[name].dtype == np.uint8 for name in _COLOURS):
            columns = {name: column for name, column in columns.items() if name not in _COLOURS}
    return {name: column.reshape(len(cloud), -1) for name, column in columns.items()}


def _header_text(num_points: int, columns: dict[str, NDArray[np.generic]], cloud: Cloud) -> bytes:
    """Write the header of a binary file; the cloud says its classes and how it is laid out."""
    layout = cloud.organisation or Organisation(_NOWHERE, num_points, 1)
    is_organised = layout.width * layout.height == num_points
    width, height = (layout.width, layout.height) if is_organised else (num_points, 1)
    viewpoint = " ".join(f"{number:.9g}" for number in layout.viewpoint)
    kinds = {kind: letter for letter, kind in _KINDS.items()}
    lines = ["# .PCD v0.7 - Point Cloud Data file format"]
    lines += [_CLASSES_COMMENT + ",".join(cloud.classes)] * bool(cloud.classes)
    lines += ["VERSION 0.7", f"FIELDS {' '.join(columns)}"]
    lines += [f"SIZE {' '.join(str(column.dtype.itemsize) for column in columns.values())}"]
    lines += [f"TYPE {' '.join(kinds[column.dtype.kind] for column in columns.values())}"]
    lines += [f"COUNT {' '.join(str(column.shape[1]) for column in columns.values())}"]
    lines += [f"WIDTH {width}", f"HEIGHT {height}", f"VIEWPOINT {viewpoint}"]
    lines += [f"POINTS {num_points}", "DATA binary"]
    text = ("\n".join(lines) + "\n").encode()
    if len(text) > _MAX_HEADER:
        raise OutputError(
            f"a header of {len(text):,} bytes for {len(columns):,} attributes; "
            f"expected at most {_MAX_HEADER:,}; choose --format npz"
        )
    return text


def _unpack_colours(
    column: NDArray[np.generic], num_channels: int
) -> dict[str, NDArray[np.generic]]:
    packed = column.view("<u4")
    shifts = dict(zip((*_COLOURS, "alpha")[:num_channels], (16, 8, 0, 24), strict=False))
    return {name: (packed >> shift & 255).astype(np.uint8) for name, shift in shifts.items()}


def _parse_header(path: Path, data: bytes) -> _Header:
    """Parse and check the header up to and including its DATA line."""
    match = _data_line(data)
    if match is None:
        remedy = "the file is cut short or not PCD; copy it again"
        found = f"no DATA line{recognise(path, ', ').replace(', it is PCD', '')}"
        raise InputError(path, found, "a PCD header", remedy)
    lines = data[: match.start()].decode("utf-8", errors="replace").splitlines()
    entries = [line.split() for line in lines if line.strip() and not line.startswith("#")]
    words = {entry[0]: entry[1:] for entry in entries}
    if "FIELDS" in words:
        words["FIELDS"] = [name.lower() if name in "XYZ" else name for name in words["FIELDS"]]

    # how the points are written, and as what
    encoding = match.group(1).decode("latin-1")
    if encoding not in _ENCODINGS:
        expected = f"one of {', '.join(_ENCODINGS)}"
        raise InputError(path, f"DATA {encoding}", expected, "convert the file")
    if missing := [axis for axis in "xyz" if axis not in words.get("FIELDS", "xyz")]:
        found = f"no field {', '.join(missing)} among {saw(words['FIELDS'], missing)}"
        raise InputError(path, found, "x, y and z", "export the cloud with coordinates")
    try:
        dtype, num_points = _dtype(words), int(words["POINTS"][0])
        if num_points < 0 or any(dtype[axis].shape for axis in "xyz"):
            raise ValueError("counts")
    except (KeyError, ValueError, IndexError) as error:
        found, expected = "a header that does not add up", "FIELDS, SIZE, TYPE, COUNT and POINTS"
        raise InputError(path, found, expected, "export it again") from error

    # the class table is in a comment
    comments = [line for line in lines if line.startswith(_CLASSES_COMMENT)]
    names = comments[0].removeprefix(_CLASSES_COMMENT).strip() if comments else ""
    classes = tuple(names.split(",")) if comments else ()
    return _Header(dtype, num_points, encoding, classes, match.end(), _organisation(words))


def _data_line(data: bytes) -> re.Match[bytes] | None:
    """Find the line that ends a header."""
    return re.search(rb"^DATA[ \t]+(\S+)[^\n]*\n", data[:_MAX_HEADER], re.MULTILINE)


def _organisation(words: dict[str, list[str]]) -> Organisation:
    """Take viewpoint, width and height of a header; what makes no sense is as if not there."""
    try:
        viewpoint = tuple(map(float, words.get("VIEWPOINT", [])))
        if len(viewpoint) != len(_NOWHERE) or not np.isfinite(viewpoint).all():
            viewpoint = _NOWHERE
        return Organisation(viewpoint, int(words["WIDTH"][0]), int(words["HEIGHT"][0]))
    except (KeyError, ValueError, IndexError):
        return Organisation(_NOWHERE, 0, 1)


def _dtype(words: dict[str, list[str]]) -> np.dtype[np.void]:
    """Build the type of a point; KeyError or ValueError when the header makes no sense."""
    fields, kinds, sizes = words["FIELDS"], words["TYPE"], [int(size) for size in words["SIZE"]]
    counts = [int(count) for count in words.get("COUNT", ["1"] * len(fields))]

    types: list[tuple[str, str, tuple[int, ...]]] = []
    entries = zip(fields, kinds, sizes, counts, strict=True)
    for number, (name, kind, size, count) in enumerate(entries):
        if size not in _SIZES[kind] or not 0 < count < _MOST_VALUES:
            raise ValueError(name)
        unique = f"{_PADDING} {number}" if name == _PADDING else name  # padding repeats its name
        types.append((unique, f"<{_KINDS[kind]}{size}", (count,) if count > 1 else ()))
    return np.dtype(types)


def _read_ascii(path: Path, body: bytes, header: _Header) -> NDArray[np.void]:
    """Parse one line per point."""
    lines = [line for line in body.split(b"\n") if line.strip()]
    if len(lines) < header.num_points:
        raise _cut_short(path, header.num_points, len(lines))
    if header.num_points == 0:
        return np.empty(0, header.dtype)

    text = BytesIO(b"\n".join(lines[: header.num_points]))
    try:
        with warnings.catch_warnings(action="error"):
            table: NDArray[np.void] = np.loadtxt(
                text, header.dtype, comments=None, ndmin=1, encoding="latin-1"
            )
    except (ValueError, OverflowError, Warning) as error:
        found, remedy = f"point lines that do not parse ({error})", "export the cloud again"
        raise InputError(path, found, "a number for every field", remedy) from error
    return table


def _read_compressed(path: Path, body: bytes, header: _Header) -> NDArray[np.void]:
    """Decompress the body, which holds one field of all points after another."""
    packed_size, size = np.frombuffer(body[:8].ljust(8, b"\0"), "<u4").tolist()
    found = size // header.dtype.itemsize if len(body) - 8 >= packed_size else 0
    if found < header.num_points:
        raise _cut_short(path, header.num_points, found)
    if size > _MOST_UNPACKED * packed_size:
        claim = f"{size:,} bytes promised in {packed_size:,}"
        raise InputError(path, claim, "compressed data", "copy the file again")

    # all of it, to the byte
    table = np.empty(header.num_points, header.dtype)
    columns = np.empty(table.nbytes, np.uint8)
    written = _decompress(np.frombuffer(body, np.uint8, packed_size, 8), columns)
    if size != len(columns) or written != size:
        expected = f"{len(columns):,} bytes"
        raise InputError(
            path, "compressed data that do not unpack", expected, "copy the file again"
        )

    # field by field
    start = 0
    for name in header.dtype.names or ():
        kind, shape = header.dtype[name].base, header.dtype[name].shape
        column: NDArray[np.generic] = np.frombuffer(columns, kind, table[name].size, start)
        table[name] = column.reshape(header.num_points, *shape)
        start += column.nbytes
    return table


@njit(cache=True)
def _decompress(packed: NDArray[np.uint8], out: NDArray[np.uint8]) -> int:
    """Unpack LZF into ``out``; return the bytes written, -1 when the data are damaged."""
    source, target = 0, 0
    while source < len(packed):
        control = int(packed[source])
        source += 1
        if control < 32:  # a run of bytes as they are
            length = control + 1
            if source + length > len(packed) or target + length > len(out):
                return -1
            out[target : target + length] = packed[source : source + length]
            source += length
        else:  # a copy of earlier output, which may overlap itself
            length = (control >> 5) + 2
            if length == 9 and source < len(packed):
                length += int(packed[source])
                source += 1
            if source >= len(packed):
                return -1
            start = target - ((control & 31) << 8) - int(packed[source]) - 1
            source += 1
            if start < 0 or target + length > len(out):
                return -1
            for offset in range(length):
                out[target + offset] = out[start + offset]
        target += length
    return target


def _cut_short(path: Path, promised: int, found: int) -> InputError:
    counts = f"{promised:,} points promised, {found:,} found"
    return InputError(path, counts, f"{promised:,}", "the file is cut short; copy it again")
