"""HDF5: a labelled building as plain arrays, and files of the MCPNet authors. Never unpickles."""

from __future__ import annotations

import json
import zlib
from math import prod
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.building import Building
from mcpseg_cli.classes import MCPNET_CLASSES
from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats.claims import check_claim
from mcpseg_cli.formats.labels import check_classes
from mcpseg_cli.formats.steady import SteadyFile, steady_file

_FORMAT = "mcpseg building 1"
_COLUMNS: dict[str, tuple[str, tuple[int, ...]]] = {
    "xyz": ("<f4", (3,)), "rgb": ("|u1", (3,)), "semantic": ("|u1", ()), "instance": ("<i4", ()),
}  # fmt: skip
_NAMES = ("classes", "rooms", "object_names")
_ROWS = 1 << 20  # rows of the authors' table converted at once
_REMEDY = "write or copy it again"
_DAMAGE = (  # what h5py and json raise for damaged files
    OSError, RuntimeError, LookupError, ValueError, TypeError, MemoryError, AttributeError,
    ArithmeticError,
)  # fmt: skip


def write_building_h5(path: Path, building: Building, tags: dict[str, str] | None = None) -> None:
    """Write a building as an HDF5 file of plain arrays.

    It appears under its name only when complete. Uncompressed: LZF saves nothing on coordinates and
    takes ten times as long.

    Args:
        path: The file; its folder must exist; replaced if there.
        building: What to write.
        tags: Any further text by name, see ``read_tags``.

    Raises:
        OutputError: A name is empty or not printable.
        OSError: The disk is full or the folder not writable; nothing is left behind.
    """
    with steady_file(path) as file:
        _write_datasets(path, file, building, tags or {})


def read_building_h5(path: Path) -> Building:
    """Read a building that ``write_building_h5`` wrote, or a file of the MCPNet authors.

    Theirs holds ``points`` (N, 8): x y z r g b object class, classes in ``MCPNET_CLASSES``. Colours
    below 0 are taken for -0.5 to 0.5, colours that are all at most 1 for 0 to 1, others for 0 to
    255. Where ``count_room`` gives the points of each room, object ids restart in every room and
    are numbered anew from 1; the rooms have no names.

    Args:
        path: The file.

    Returns:
        The building; ids are checked against the tables of names.

    Raises:
        InputError: Not HDF5, cut, damaged, or without the datasets expected.
        OSError: The file cannot be opened.
    """
    with path.open("rb"):  # h5py's own messages for a missing or unreadable file say little
        pass
    try:
        with h5py.File(path, "r") as file:
            return _authors_building(path, file) if "points" in file else _own_building(path, file)
    except _DAMAGE as error:
        raise _damaged(path, error) from error


def read_tags(path: Path) -> dict[str, str]:
    """Read the text that ``write_building_h5`` was given as ``tags``.

    Raises:
        InputError: Not a file of ours, or damaged.
        OSError: The file cannot be opened.
    """
    with path.open("rb"):
        pass
    try:
        with h5py.File(path, "r") as file:
            text = _array(path, file, "tags", "|u1", (None,)).tobytes()
            if int(file.attrs["tags_crc32"]) != zlib.crc32(text):
                raise ValueError("tags that differ from their checksum")
            tags = json.loads(text)
    except _DAMAGE as error:
        raise _damaged(path, error) from error
    if not isinstance(tags, dict) or not all(isinstance(text, str) for text in tags.values()):
        raise InputError(path, "tags that are no texts", "text by name", _REMEDY)
    return tags


def _write_datasets(
    path: Path, stream: SteadyFile, building: Building, tags: dict[str, str]
) -> None:
    """Write every array under its name."""
    # points and rooms
    arrays: dict[str, NDArray[np.generic]] = {name: getattr(building, name) for name in _COLUMNS}
    if building.room_starts is not None:
        arrays["room_starts"] = building.room_starts.astype("<i8")

    # tables of names, and tags
    for name in _NAMES:
        if any(not text or not text.isprintable() for text in getattr(building, name)):
            raise OutputError(
                f"{path}: {name} holds a name that is empty or not printable; "
                "expected text; rename it"
            )
        texts = [text.encode(errors="replace") for text in getattr(building, name)]
        arrays[name] = np.array(texts, f"S{max(map(len, texts), default=1)}")
    arrays["tags"] = np.frombuffer(json.dumps(tags).encode(), np.uint8)

    with h5py.File(stream, "w") as file:
        file.attrs["format"] = np.bytes_(_FORMAT)
        file.attrs["crc32"] = np.int64(_checksum(building))
        file.attrs["tags_crc32"] = np.int64(zlib.crc32(arrays["tags"].tobytes()))
        for name, array in arrays.items():
            file.create_dataset(name, data=array)


def _own_building(path: Path, file: h5py.File) -> Building:
    """Read and check what ``_write_datasets`` wrote."""
    if file.attrs.get("format") != _FORMAT.encode():
        found = f"datasets {', '.join(file) or '(none)'}"
        expected = f"a file of the format {_FORMAT!r}, or points (N, 8)"
        raise InputError(path, found, expected, _REMEDY)

    # every dataset in its type and shape
    columns = {
        name: _array(path, file, name, dtype, (None, *shape))
        for name, (dtype, shape) in _COLUMNS.items()
    }
    names = {name: _texts(path, file, name) for name in _NAMES}
    starts = None
    if "room_starts" in file:
        starts = _array(path, file, "room_starts", "<i8", (len(names["rooms"]) + 1,))

    # that it makes sense as a building, and is what was written
    building = Building(**columns, **names, room_starts=starts)  # type: ignore[arg-type]
    _check(path, building)
    if int(file.attrs["crc32"]) != _checksum(building):
        found = "content that differs from its checksum"
        raise InputError(path, found, "what was written", _REMEDY)
    return building


def _check(path: Path, building: Building) -> None:
    """Refuse labels, objects and rooms that the tables do not have."""
    count = len(building)
    if count == 0:
        raise InputError(path, "zero points", "at least one point", _REMEDY)
    if not np.isfinite(building.xyz).all():
        raise InputError(path, "NaN or infinite coordinates", "finite coordinates", _REMEDY)

    check_classes(building.semantic, building.classes, path)
    first, last = int(building.instance.min()), int(building.instance.max())
    most = len(building.object_names) or np.iinfo(np.int32).max
    if first < 0 or last > most:
        raise InputError(path, f"objects {first} to {last}", f"0 to {most}", _REMEDY)

    starts = building.room_starts
    if starts is None:
        return
    if starts[0] != 0 or starts[-1] != count or (np.diff(starts) < 0).any():
        found = "room_starts that are no division of the points"
        raise InputError(path, found, f"0 to {count:,}, rising", _REMEDY)


def _checksum(building: Building) -> int:
    """Return the CRC-32 of all points, names and rooms."""
    starts = [] if building.room_starts is None else building.room_starts.tolist()
    tables = (starts, *(getattr(building, name) for name in _NAMES))
    checksum = zlib.crc32(repr(tables).encode())
    for name in _COLUMNS:
        checksum = zlib.crc32(np.ascontiguousarray(getattr(building, name)).data, checksum)
    return checksum


def _authors_building(path: Path, file: h5py.File) -> Building:
    """Convert the authors' table."""
    table = _dataset(path, file, "points")
    if table.ndim != 2 or table.shape[1] != 8 or table.dtype.kind not in "fiu" or len(table) == 0:
        found, expected = f"points {table.dtype} {table.shape}", "points (N, 8)"
        raise InputError(path, found, f"{expected}: x y z r g b object class", "convert it")

    # points, a block of rows at a time
    count, scale = len(table), _colour_scale(table)
    xyz, rgb = np.empty((count, 3), np.float32), np.empty((count, 3), np.uint8)
    semantic, instance = np.empty(count, np.uint8), np.empty(count, np.int32)
    for start in range(0, count, _ROWS):
        with np.errstate(invalid="ignore"):  # NaN is refused below
            rows = table[start : start + _ROWS].astype(np.float64)
        part = slice(start, start + len(rows))
        labels, classes = rows[:, 6:], len(MCPNET_CLASSES)
        in_range = (labels[:, 1] >= 0).all() and (labels < [2**31, classes]).all()
        if not (np.isfinite(rows).all() and in_range):
            found = "points with NaN, or classes out of range"
            expected = f"finite numbers, classes 0 to {classes - 1}"
            raise InputError(path, found, expected, "mend it")
        xyz[part] = rows[:, :3]
        rgb[part] = np.clip(np.rint(rows[:, 3:6] * scale[0] + scale[1]), 0, 255)
        instance[part] = np.maximum(labels[:, 0], 0)
        semantic[part] = labels[:, 1]

    # rooms, if the file has them: objects are numbered anew through all
    starts = _room_starts(path, file, count)
    rooms: tuple[str, ...] = ()
    if starts is not None:
        room = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        instance = _numbered(instance, room)
        rooms = tuple(f"room_{number}" for number in range(1, len(starts)))
    return Building(xyz, rgb, semantic, instance, MCPNET_CLASSES, rooms, starts)


def _colour_scale(table: h5py.Dataset) -> tuple[float, float]:
    """Return factor and summand that take the authors' colours to 0-255."""
    low, high = np.inf, -np.inf
    for start in range(0, len(table), _ROWS):
        colours = table[start : start + _ROWS, 3:6]
        low, high = min(low, float(colours.min())), max(high, float(colours.max()))
    if low < 0:
        return 255.0, 127.5
    return (255.0, 0.0) if high <= 1 else (1.0, 0.0)


def _room_starts(path: Path, file: h5py.File, count: int) -> NDArray[np.int64] | None:
    """Return where the authors' rooms start, if the file says."""
    if "count_room" not in file:
        return None
    counts = _dataset(path, file, "count_room")[...]
    is_list = counts.ndim == 1 and counts.dtype.kind in "iu"
    if not is_list or (counts < 0).any() or int(counts.sum()) != count:
        found, expected = "count_room that does not add up", f"room sizes that sum to {count:,}"
        raise InputError(path, found, expected, _REMEDY)
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _numbered(instance: NDArray[np.int32], room: NDArray[np.int64]) -> NDArray[np.int32]:
    """Number objects through all rooms from 1; 0 stays 0."""
    keys = (room << 32) | instance
    unique, numbers = np.unique(keys[instance > 0], return_inverse=True)
    numbered = np.zeros(len(instance), np.int32)
    numbered[instance > 0] = np.arange(1, len(unique) + 1, dtype=np.int32)[numbers]
    return numbered


def _dataset(path: Path, file: h5py.File, name: str) -> h5py.Dataset:
    """Return a dataset whose numbers lie in this file."""
    dataset = file.get(name) if file.get(name, getlink=True).__class__ is h5py.HardLink else None
    if not isinstance(dataset, h5py.Dataset) or dataset.external or dataset.is_virtual:
        found = f"no dataset {name!r} (datasets {', '.join(file) or '(none)'})"
        raise InputError(path, found, f"{name!r}", _REMEDY)
    if dataset.size and not dataset.id.get_storage_size():
        raise InputError(path, f"{name!r} without data", f"{dataset.shape} values", _REMEDY)

    # HDF5 unpacks chunk by chunk, and what was never written is nothing in the file
    packed = dataset.id.get_storage_size()
    for what, shape in (("", dataset.shape), ("a chunk of ", dataset.chunks or ())):
        check_claim(path, f"{what}{name}", prod(shape) * dataset.dtype.itemsize, packed=packed)
    return dataset


def _array(
    path: Path, file: h5py.File, name: str, dtype: str, shape: tuple[int | None, ...]
) -> NDArray[np.generic]:
    """Read a dataset of this type and shape; None stands for any length."""
    dataset = _dataset(path, file, name)
    fits = len(dataset.shape) == len(shape) and all(
        want in (None, have) for want, have in zip(shape, dataset.shape, strict=True)
    )
    if dataset.dtype.str != dtype or not fits:
        sizes = ", ".join("N" if size is None else str(size) for size in shape)
        found, expected = f"{name} {dataset.dtype} {dataset.shape}", f"{np.dtype(dtype)} ({sizes})"
        raise InputError(path, found, expected, _REMEDY)
    return np.asarray(dataset[...])


def _texts(path: Path, file: h5py.File, name: str) -> tuple[str, ...]:
    """Read a table of names, stored as fixed-length UTF-8."""
    dataset = _dataset(path, file, name)
    if dataset.dtype.kind != "S" or dataset.ndim != 1:
        found = f"{name} {dataset.dtype} {dataset.shape}"
        raise InputError(path, found, "names of fixed length (N,)", _REMEDY)
    return tuple(text.decode() for text in dataset[...].tolist())


def _damaged(path: Path, error: BaseException) -> InputError:
    """Explain what h5py says of a file it cannot read."""
    cause = " ".join(str(error).split()) or type(error).__name__
    found = f"not a readable HDF5 file ({cause[:160]})"
    return InputError(path, found, "an undamaged HDF5 file", _REMEDY)
