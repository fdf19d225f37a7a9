"""NPZ: numpy archives with ``xyz``, ``rgb`` (N, 3) and any further arrays. Never unpickles."""

import lzma
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats.claims import check_claim
from mcpseg_cli.formats.cloud import Cloud
from mcpseg_cli.formats.magic import recognise
from mcpseg_cli.formats.npy import MAGIC, parse_npy
from mcpseg_cli.formats.parts import CloudParts

_SPLIT = {"xyz": ("x", "y", "z"), "rgb": ("red", "green", "blue")}
_COORDINATES = (
    "xyz", "points", "coords", "coord", "coordinates", "positions", "position", "pos", "vertices",
    "pts", "pcd", "point_cloud",
)  # fmt: skip
_CLASSES = "class_names"
_MOST_NAMES = 1 << 16
_LAST_LETTER, _SURROGATES = 0x10FFFF, 0xD800 >> 11  # of Unicode; the latter are no letters
_DAMAGE = (  # what zipfile, its decompressors and numpy's header parser raise for damaged files
    ValueError, KeyError, TypeError, EOFError, MemoryError, RuntimeError, ArithmeticError, OSError,
    SyntaxError, AttributeError, IndexError, zipfile.BadZipFile, zlib.error, lzma.LZMAError,
    struct.error, tokenize.TokenError,
)  # fmt: skip


def read_npz(path: Path) -> Cloud:
    """Read a numpy archive: ``xyz`` is required, ``rgb`` and other arrays of N rows are kept.

    Coordinates are found as ``points``, ``coords``, ``positions`` and the like, too.

    Args:
        path: The file; opened with ``allow_pickle=False``.

    Returns:
        Its points; ``class_names`` becomes the class table.

    Raises:
        InputError: Not an archive, pickled objects, no ``xyz``, or arrays of differing lengths.
    """
    # coordinates, once
    arrays = _load(path)
    xyz = _coordinates(path, arrays)
    if doubled := ", ".join(name for name in ("x", "y", "z") if name in arrays):
        raise InputError(path, f"{doubled} beside xyz", "coordinates once", f"remove {doubled}")

    # the class table, and an attribute for every other array
    classes = _class_names(path, arrays.pop(_CLASSES, np.empty(0, str)))
    if "" in arrays:
        raise InputError(path, "an array without a name", "a name for every array", "save it again")
    columns: dict[str, NDArray[np.generic]] = {}
    for name, array in arrays.items():
        if array.ndim == 0 or len(array) != len(xyz):
            found = f"{name} has shape {array.shape}, xyz {xyz.shape}"
            raise InputError(path, found, f"{len(xyz):,} rows in every array", "save it again")
        if name in _SPLIT and array.shape == xyz.shape and array.dtype.kind in "biuf":
            columns |= {part: array[:, column] for column, part in enumerate(_SPLIT[name])}
        else:
            columns[name] = array
    return Cloud(columns, classes)


def write_npz(file: BinaryIO, parts: CloudParts) -> None:
    """Write a cloud as an uncompressed archive: ``xyz``, ``rgb`` and an array each attribute.

    An archive holds one array after another: the parts are gone through once for each.
    """
    first = next(iter(parts))
    with zipfile.ZipFile(file, "w") as archive:  # numpy.savez takes no array named "file"
        if first.classes:
            _write_array(archive, _CLASSES, [np.array(first.classes)], len(first.classes))
        for name in joined_columns(first):
            rows = (joined_columns(cloud)[name] for cloud in parts)
            _write_array(archive, name, rows, len(parts))


def joined_columns(cloud: Cloud) -> dict[str, NDArray[np.generic]]:
    """Give a cloud's attributes with coordinates and colours as ``xyz`` and ``rgb``, (N, 3)."""
    columns = dict(cloud.columns)
    arrays: dict[str, NDArray[np.generic]] = {}
    for joined, axes in _SPLIT.items():
        if all(axis in columns for axis in axes) and (joined == "xyz" or joined not in columns):
            arrays[joined] = np.stack([columns.pop(axis) for axis in axes], axis=1)
    columns.pop(_CLASSES if cloud.classes else "", None)
    return arrays | columns | arrays


def _write_array(
    archive: zipfile.ZipFile, name: str, rows: Iterable[NDArray[np.generic]], num_rows: int
) -> None:
    """Write one array of the archive from its rows, a part of them at a time."""
    with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
        for number, part in enumerate(rows):
            if part.dtype.hasobject:
                raise OutputError(
                    f"attribute {name}: holds {part.dtype}; expected numbers or text; remove it"
                )
            if number == 0:
                header = np.lib.format.header_data_from_array_1_0(part)
                header |= {"shape": (num_rows, *part.shape[1:]), "fortran_order": False}
                np.lib.format.write_array_header_1_0(entry, header)
            entry.write(part.tobytes())


def _coordinates(path: Path, arrays: dict[str, NDArray[np.generic]]) -> NDArray[np.generic]:
    """Return the (N, 3) coordinates of an archive."""
    expected = "an array xyz (N, 3) of numbers"
    remedy = "save it with numpy.savez(path, xyz=…, rgb=…)"
    if "xyz" not in arrays:
        _rename_coordinates(arrays)
    if "xyz" not in arrays:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise InputError(path, f"arrays {shapes or '(none)'}", expected, remedy)
    xyz = arrays["xyz"]
    if xyz.ndim != 2 or xyz.shape[1] != 3 or xyz.dtype.kind not in "fiu":
        raise InputError(path, f"xyz is {xyz.dtype} {xyz.shape}", expected, remedy)
    return xyz


def _rename_coordinates(arrays: dict[str, NDArray[np.generic]]) -> None:
    """Call coordinates under another usual name ``xyz``, if there is one such array."""
    lowered = {name.lower(): name for name in arrays}
    for known in _COORDINATES:
        name = lowered.get(known, "")
        if name and arrays[name].ndim == 2 and arrays[name].shape[1] == 3:
            arrays["xyz"] = arrays.pop(name)
            return
    if all(axis in lowered and arrays[lowered[axis]].ndim == 1 for axis in "xyz"):
        axes = [arrays.pop(lowered[axis]) for axis in "xyz"]
        if len({len(axis) for axis in axes}) == 1:
            arrays["xyz"] = np.stack(axes, axis=1)


def _load(path: Path) -> dict[str, NDArray[np.generic]]:
    """Load every array of the archive into memory; what else lies in it is passed over."""
    with path.open("rb") as file:
        if file.read(len(MAGIC)) == MAGIC:
            raise InputError(path, "a single array", "an NPZ archive", "save it with numpy.savez")
    try:
        with zipfile.ZipFile(path) as archive:
            members = {one.filename: one for one in archive.infolist()}
            total = sum(one.file_size for one in archive.infolist())
            check_claim(path, "the archive", total)
            return dict(_arrays(archive, members.values()))
    except _DAMAGE as error:
        cause = str(error).splitlines()[0] if str(error) else type(error).__name__
        kind = recognise(path, ", ").replace(", it is a ZIP or NPZ archive", "")
        found, expected = f"an archive that does not load ({cause}){kind}", "plain arrays"
        raise InputError(
            path, found, f"{expected} in an undamaged NPZ", "save it again, no objects"
        ) from error


def _arrays(
    archive: zipfile.ZipFile, members: Iterable[zipfile.ZipInfo]
) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """Yield the arrays of an archive by name."""
    for member in members:
        with archive.open(member) as entry:
            head = entry.read(len(MAGIC))
            if head == MAGIC:
                yield member.filename.removesuffix(".npy"), parse_npy(head + entry.read())
            elif member.filename.endswith(".npy"):
                raise ValueError(f"{member.filename} is no array")


def _class_names(path: Path, array: NDArray[np.generic]) -> tuple[str, ...]:
    """Take class names out of their array."""
    names = np.ascontiguousarray(array).ravel()
    if names.size > _MOST_NAMES or names.dtype.kind not in "USbiuf":
        found = f"{_CLASSES} holds {names.size:,} {names.dtype}"
        raise InputError(path, found, f"up to {_MOST_NAMES:,} texts", "save it again")
    if names.dtype.kind == "S":
        return tuple(bytes(name).decode("utf-8", "replace") for name in names.tolist())
    if names.dtype.kind == "U" and names.size:
        letters = names.astype(names.dtype.newbyteorder("=")).view(np.uint32)
        if ((letters > _LAST_LETTER) | ((letters >> 11) == _SURROGATES)).any():
            found = f"{_CLASSES} with letters that are none"
            raise InputError(path, found, "Unicode texts", "save it again")
    return tuple(str(name) for name in names)
