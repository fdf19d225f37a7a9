"""LAS and LAZ through laspy, in chunks; scales, reference system and extra bytes are kept."""

import copy
import struct
from pathlib import Path
from typing import BinaryIO

import laspy
import numpy as np
from laspy.header import Version
from laspy.point.dims import VERSION_TO_POINT_FMT
from laspy.vlrs.vlrlist import VLRList
from lazrs import LazrsError
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats.claims import open_bounded
from mcpseg_cli.formats.cloud import LABEL_NAMES, Cloud, scalar_columns
from mcpseg_cli.formats.las_texts import LasFile
from mcpseg_cli.formats.laz_chunks import check_chunks
from mcpseg_cli.formats.magic import recognise
from mcpseg_cli.formats.parts import CloudParts

_CHUNK = 1_000_000  # points decompressed at a time
_CLASS_BASE = 64  # classifications 64-255 are the user's (LAS 1.4, table 17)
_COORDINATES = ("X", "Y", "Z")  # as LAS stores them: integers
_COLOURS = ("red", "green", "blue")
_NAME_BYTES = 32  # of an extra dimension
_HEADER_1_0, _HEADER_1_4 = 227, 375  # bytes of headers (LAS 1.4, table 3)
_RECORD, _EXTENDED_RECORD = 54, 60  # bytes of a record's header (tables 8 and 9)
_COMPRESSED = 0x80  # bit of the point format
_STEP, _WIDE_STEP = 1e-4, 1e-2  # of coordinates, which LAS has as integers of 32 bits
_FAR = 1e5  # from here on they need an offset, and clouds this wide the wider step
_MOST_STEPS = 2e9  # of an offset, in 31 bits
_TOO_FAR = (
    "LAS has no place for coordinates this far apart; expected them within the map; "
    "choose --format ply, pcd or npz"
)
_NOISE = (7, 18)  # classifications of points that are none (LAS 1.4, table 17)
_VERSIONS = [(1, minor) for minor in range(6)]
_FIRST_WRITTEN = 2  # minor version: laspy reads older files and writes none
_DAMAGE = (  # what laspy and lazrs raise for damaged files
    laspy.LaspyException, LazrsError, ValueError, TypeError, LookupError, AttributeError, EOFError,
    ArithmeticError, MemoryError, struct.error,
)  # fmt: skip
_PANIC = "PanicException"  # of lazrs: no Exception, and of no module that can be imported
_MOST_EXTRA = 65535 // 192  # extra bytes, which one record describes (LAS 1.4, table 24)
_MOST_RECORD = 65535  # bytes of a point, and of a record of a header
_CLASSES_RECORD = ("mcpseg", 1)


def read_las(path: Path) -> Cloud:
    """Read a LAS or LAZ file with all its dimensions; coordinates are scaled to float64 metres.

    Args:
        path: The file; COPC and versions 1.0 and 1.1 are read, and written back as 1.4.

    Returns:
        Its points, those withheld and of noise marked, and its header for writing them back.

    Raises:
        InputError: Not LAS, cut short, or a compressed chunk that does not decode.
    """
    # all points, in chunks
    _check_counts(path)
    try:
        with laspy.open(LasFile(open_bounded(path))) as reader:
            header = reader.header
            records = [record.array.copy() for record in reader.chunk_iterator(_CHUNK)]
    except BaseException as error:
        if not isinstance(error, _DAMAGE) and type(error).__name__ != _PANIC:
            raise
        raise _undecodable(path, str(error).strip() or type(error).__name__) from error
    table = np.concatenate(records) if records else np.empty(0, header.point_format.dtype())
    if len(table) != header.point_count:
        raise _cut_short(path, header.point_count, len(table))
    for dimension in header.point_format.extra_dimensions:
        offsets = 0.0 if dimension.offsets is None else dimension.offsets
        if not _is_scaled(dimension.scales) or not np.isfinite(offsets).all():
            raise _undecodable(path, f"{dimension.name} has a scale or an offset of no use")
    try:
        columns = _columns(header, table)
    except _DAMAGE as error:
        raise _undecodable(path, str(error).strip() or type(error).__name__) from error
    excluded = _excluded(columns)
    return Cloud(columns, _read_classes(header), _writable(header), excluded=excluded)


def _is_scaled(scales: NDArray[np.float64] | None) -> bool:
    """Tell whether values can be multiplied by these, and divided by them again."""
    return scales is None or bool((np.isfinite(scales) & (scales != 0)).all())


def _columns(header: laspy.LasHeader, table: NDArray[np.void]) -> dict[str, NDArray[np.generic]]:
    """Take all dimensions; coordinates of damaged scales are refused later."""
    points = laspy.ScaleAwarePointRecord(table, header.point_format, header.scales, header.offsets)
    with np.errstate(over="ignore", invalid="ignore"):
        columns: dict[str, NDArray[np.generic]] = {name: np.asarray(points[name]) for name in "xyz"}
        for name in header.point_format.dimension_names:
            if name not in _COORDINATES:
                columns[name] = np.asarray(points[name])
    return columns


def _excluded(columns: dict[str, NDArray[np.generic]]) -> NDArray[np.bool_] | None:
    """Tell which points are not to be processed: withheld, or noise; None where all are."""
    excluded = np.isin(columns["classification"], _NOISE)
    if "withheld" in columns:
        excluded |= columns["withheld"] != 0
    return excluded if excluded.any() else None


def _writable(header: laspy.LasHeader) -> laspy.LasHeader:
    """Return a header that can be written: without what only COPC has, of a version that fits."""
    for name in ("vlrs", "evlrs"):
        if records := getattr(header, name):
            kept = [record for record in records if record.user_id.lower() != "copc"]
            for record in kept:  # laspy takes more letters here than it writes
                if not record.user_id.isascii():
                    record._user_id = record.user_id.encode("ascii", "replace").decode()
                if not record.description.isascii() and name == "evlrs":
                    text = record.description
                    data = text if isinstance(text, bytes) else text.encode()
                    record._description = data.decode("ascii", "replace").replace("\ufffd", "?")
            setattr(header, name, VLRList(kept))
    fitting = VERSION_TO_POINT_FMT.get(str(header.version), ())
    if header.version.minor < _FIRST_WRITTEN or header.point_format.id not in fitting:
        header.version = Version(1, 4)  # which takes any points
    return header


def _check_counts(path: Path) -> None:
    """Refuse counts that the file has no room for; laspy would go on reading past its end."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_HEADER_1_4)
    if head[:4] != b"LASF" or len(head) < _HEADER_1_0:
        remedy = "check that this is a LAS file"
        found = f"starts with {head[:8]!r}{recognise(path, ', ')}"
        raise InputError(path, found, "a LAS or LAZ header", remedy)

    if (version := (head[24], head[25])) not in _VERSIONS:
        found = f"LAS {version[0]}.{version[1]}"
        raise InputError(path, found, "LAS 1.0 to 1.5", "copy it again, or convert it")

    # version 1.4 counts in 64 bits
    start, num_records, point_format, point_size, num_points = struct.unpack_from(
        "<IIBHI", head, 96
    )
    if head[25] >= 4:
        if len(head) < _HEADER_1_4:
            raise _undecodable(path, "the header is cut short")
        first_extended, num_extended, num_points = struct.unpack_from("<QIQ", head, 235)
        if num_extended and first_extended + num_extended * _EXTENDED_RECORD > size:
            cause = f"{num_extended:,} extended records promised in {size:,} bytes"
            raise _undecodable(path, cause)

    # records before the points, then as many points as there is room for
    if start > size or num_records * _RECORD > start or point_size == 0:
        promised = f"{num_records:,} records and points from byte {start:,}"
        raise _undecodable(path, f"{promised} promised in {size:,} bytes")
    found = (size - start) // point_size
    if point_format & _COMPRESSED:
        try:
            check_chunks(path, start, point_size, num_points)
        except (LazrsError, ValueError, struct.error) as error:
            raise _undecodable(path, str(error)) from error
    elif num_points > found:
        raise _cut_short(path, num_points, found)


def _cut_short(path: Path, promised: int, found: int) -> InputError:
    counts = f"{promised:,} points promised, {found:,} found"
    return InputError(path, counts, "all of them", "the file is cut short; copy it again")


def _undecodable(path: Path, cause: str) -> InputError:
    found = f"a file that does not decode ({cause})"
    return InputError(path, found, "an undamaged LAS or LAZ", "copy it again")


def write_las(file: BinaryIO, parts: CloudParts, *, compress: bool) -> None:
    """Write a cloud as LAS 1.4 or LAZ, in chunks.

    Labels go to extra bytes and, from 64 up, to ``classification``.

    Args:
        file: Where to write.
        parts: The points; attributes LAS has no dimension for become extra bytes.
        compress: Whether to write LAZ.
    """
    first = next(iter(parts))
    if not all(np.isfinite(first.columns[axis]).all() for axis in "xyz"):
        raise OutputError(
            "LAS has no place for points without coordinates, which the scan has; expected finite "
            "ones; choose --format ply, pcd or npz"
        )
    blank = _header_for(first)
    header = copy.deepcopy(blank)
    _make_room(header, first)

    # header texts that are no ASCII ("Zoller+Fröhlich") stay as they are
    writer = laspy.open(
        file, mode="w", header=header, do_compress=compress, closefd=False,
        encoding_errors="replace",
    )  # fmt: skip
    with writer, np.errstate(over="ignore", invalid="ignore"):
        for cloud in parts:
            columns = _make_room(copy.deepcopy(blank), cloud)
            for start in range(0, len(cloud), _CHUNK):
                rows = slice(start, start + _CHUNK)
                try:
                    writer.write_points(_record(header, cloud, columns, rows))
                except OverflowError as error:
                    raise OutputError(_TOO_FAR) from error
        if header.evlrs:
            writer.write_evlrs(header.evlrs)


def _header_for(cloud: Cloud) -> laspy.LasHeader:
    """Make the cloud's header, or a new one, with the cloud's class names."""
    if cloud.las_header is not None:
        header = copy.deepcopy(cloud.las_header)
    else:
        header = laspy.LasHeader(point_format=7 if cloud.rgb is not None else 6, version="1.4")
    header.scales = np.abs(header.scales)
    if cloud.las_header is None or not header.scales.all():
        _choose_scales(header, cloud)

    # the class table replaces an earlier one
    if cloud.classes:
        names = ",".join(cloud.classes).encode()
        if len(names) > _MOST_RECORD:
            raise OutputError(
                f"LAS has room for {_MOST_RECORD:,} letters of class names, there are "
                f"{len(names):,}; expected fewer; choose --format ply, pcd or npz"
            )
        header.vlrs = [vlr for vlr in header.vlrs if not _has_classes(vlr)]
        header.vlrs.append(laspy.VLR(*_CLASSES_RECORD, "class names", names))
    return header


def _choose_scales(header: laspy.LasHeader, cloud: Cloud) -> None:
    """Choose steps and offsets for coordinates that have none, or of which LAS makes no sense.

    Raises:
        OutputError: The coordinates lie farther apart than numbers go.
    """
    axes = [cloud.columns[axis].astype(np.float64) for axis in "xyz"]
    low = np.array([axis.min() if len(axis) else 0.0 for axis in axes])
    high = np.array([axis.max(initial=0.0) for axis in axes])
    low = np.where(np.abs(low) < _FAR, np.minimum(low, 0.0), low)
    with np.errstate(over="ignore"):
        width = float((high - low).max())
    if not np.isfinite(width):
        raise OutputError(_TOO_FAR)
    step = _STEP if width < _FAR else _WIDE_STEP
    while width / step > _MOST_STEPS:
        step *= 10
    header.scales, header.offsets = np.full(3, step), np.floor(low)


def _make_room(header: laspy.LasHeader, cloud: Cloud) -> dict[str, NDArray[np.generic]]:
    """Add extra bytes for attributes without a dimension; return the attributes by dimension."""
    # attributes that LAS has a dimension for, and others
    own, others = {}, {}
    has_colour = cloud.las_header is None and cloud.rgb is not None
    for name, column in cloud.columns.items():
        if name in header.point_format.extra_dimension_names and name in LABEL_NAMES:
            header.remove_extra_dim(name)  # its type may not hold our labels
        fits = name in "xyz" or (has_colour and name in _COLOURS)
        if fits or _has_dimension(header, cloud, name):
            own[name] = column
        else:
            is_taken = name in header.point_format.dimension_names
            others[f"scalar_{name}" if is_taken else name] = column

    # extra bytes for these, with names as long as LAS allows
    shortened: dict[str, NDArray[np.generic]] = {}
    scalars = scalar_columns(others)
    _check_room(header, scalars)
    for name, column in scalars.items():
        short = name.encode()[:_NAME_BYTES].decode(errors="ignore")
        if short in own or short in shortened:
            cause = f"another one starts with the same {_NAME_BYTES} bytes"
            raise OutputError(f"attribute {name}: {cause}; rename it")
        header.add_extra_dim(laspy.ExtraBytesParams(name=short, type=column.dtype))
        shortened[short] = column
    return own | shortened


def _check_room(header: laspy.LasHeader, scalars: dict[str, NDArray[np.generic]]) -> None:
    """Refuse more attributes than LAS has room for.

    Raises:
        OutputError: Too many, or too large together.
    """
    count = len(list(header.point_format.extra_dimension_names)) + len(scalars)
    size = header.point_format.size + sum(column.dtype.itemsize for column in scalars.values())
    if count > _MOST_EXTRA or size > _MOST_RECORD:
        raise OutputError(
            f"LAS has room for {_MOST_EXTRA} attributes beside its own, there are {count:,}; "
            "expected fewer; choose --format ply, pcd or npz"
        )


def _has_dimension(header: laspy.LasHeader, cloud: Cloud, name: str) -> bool:
    """Tell whether the header has a dimension of this name that holds the cloud's values."""
    if name not in header.point_format.dimension_names or name in _COORDINATES:
        return False
    if cloud.las_header is not None:  # where they come from
        return True
    dimension, column = header.point_format.dimension_by_name(name), cloud.columns[name]
    return column.dtype == (dimension.dtype or np.uint8) and column.max(initial=0) <= dimension.max


def _record(
    header: laspy.LasHeader, cloud: Cloud, columns: dict[str, NDArray[np.generic]], rows: slice
) -> laspy.ScaleAwarePointRecord:
    """Fill a point record with some rows of the cloud."""
    points = laspy.ScaleAwarePointRecord.zeros(len(cloud.columns["x"][rows]), header=header)
    for name, column in columns.items():
        if cloud.las_header is not None or name not in _COLOURS:
            points[name] = column[rows]

    # colours of 16 bits
    if cloud.las_header is None and (rgb := cloud.rgb) is not None:
        for channel, name in enumerate(_COLOURS):
            points[name] = rgb[rows, channel].astype(np.uint16) * 257

    # classes of the user's range
    if "semantic" in cloud.columns and header.point_format.id >= 6:
        semantic = cloud.columns["semantic"][rows].astype(np.int64)
        points["classification"] = np.where(semantic < 255 - _CLASS_BASE, semantic + _CLASS_BASE, 1)
    return points


def _read_classes(header: laspy.LasHeader) -> tuple[str, ...]:
    """Return the class table of a header, if it has one."""
    for vlr in header.vlrs:
        if _has_classes(vlr):
            return tuple(vlr.record_data_bytes().decode("utf-8", errors="replace").split(","))
    return ()


def _has_classes(vlr: laspy.VLR) -> bool:
    """Tell whether a record of a header is our class table."""
    return (vlr.user_id, vlr.record_id) == _CLASSES_RECORD
