"""The training samples of ray-traced areas: one HDF5 file each, made once and then streamed."""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from collections.abc import Callable, Iterator
from math import prod
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.config import SampleSettings
from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats.claims import check_claim
from mcpseg_cli.formats.steady import SteadyFile, steady_file
from mcpseg_cli.incremental.column import ScalarT
from mcpseg_cli.train.replay import Replay, ScanSamples, list_scans

_FORMAT = "mcpseg samples 1"
_FACTS = "facts_crc32"
_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_BLOCK = 1 << 15  # samples kept in memory before they are written: 7 MB
_CHUNK_BYTES = 1 << 16
_VERIFIED_BYTES = 1 << 22  # read at once to verify a file
# what h5py raises on damaged files
_DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError, MemoryError)
_VOXELS: dict[str, tuple[str, tuple[int, ...]]] = {
    "xyz": ("<f4", (3,)), "rgb": ("|u1", (3,)), "semantic": ("|u1", ()), "instance": ("<i4", ()),
}  # fmt: skip
_STREAMS = ("voxel", "context", "seen")
_SCANS = ("position", "floor", "num_new", "starts", "seen_starts")

ScanProgress = Callable[[int, int], None]
"""Called with the scans of an area that are done, and their number."""


class AreaSamples:
    """The samples of one area, read scan by scan.

    Safe to use from several threads, and in forked and spawned processes.

    Args:
        path: A file that ``prepare_samples`` wrote.

    Attributes:
        name: What the area is called.
        classes: Class table of ``semantic``.
        num_scans: Scans of the area.
        num_samples: Samples of all scans.
        starts: (num_scans + 1,) int64 where each scan's samples start.
        xyz: (V, 3) float32, metres, map frame: every voxel's point, mapped from the file.
        rgb: (V, 3) uint8, mapped from the file.
        semantic: (V,) uint8 class of the point that founded the voxel, 255 unknown, mapped from the
            file.
        instance: (V,) int32 its object, 0 none, mapped from the file.
        position: (num_scans, 3) float64 robot positions, metres, map frame.
        floor: (num_scans,) float64 height of the floor, metres, map frame.
        seen: (T,) int32 voxels that the scans see, one scan after the other, mapped from the file;
            only where there are no samples, for networks that see whole windows.
        seen_starts: (num_scans + 1,) int64 where each scan's voxels start in it.

    Raises:
        InputError: Not such a file, or damaged.
        OSError: The file cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with path.open("rb"):  # h5py's own messages for a missing or unreadable file say little
            pass

        try:
            self._open_file = _open(path)
            self._opened_by = os.getpid()
            _check_claims(path, self._open_file)
            self._read_tables(self._open_file)
        except _DAMAGE as error:
            cause = " ".join(str(error).split()) or type(error).__name__
            raise InputError(
                path, f"no training samples ({cause[:160]})", "an undamaged file", "remove it"
            ) from error

    def __reduce__(self) -> tuple[type[AreaSamples], tuple[Path]]:
        return AreaSamples, (self.path,)

    def scan(self, number: int) -> ScanSamples:
        """Read the samples of one scan.

        Args:
            number: Number of the scan, from 0.

        Raises:
            InputError: The file was replaced by another since it was opened, or is damaged.
        """
        rows = slice(self.starts[number], self.starts[number + 1])
        seen = slice(self.seen_starts[number], self.seen_starts[number + 1])
        return ScanSamples(
            self.position[number], float(self.floor[number]), int(self._num_new[number]),
            self._read("voxel", rows), self._read("context", rows), self._read("seen", seen),
        )  # fmt: skip

    def voxels(self, first: int, last: int) -> NDArray[np.int32]:
        """Read (S,) int32 the voxel of every sample of the scans from ``first`` up to ``last``.

        ``last`` itself is not among them.
        """
        return self._read("voxel", slice(self.starts[first], self.starts[last]))

    def _read(self, table: str, rows: slice) -> NDArray[np.int32]:
        """Read rows of a table of integers."""
        file = self._file()
        try:
            read: NDArray[np.int32] = file[table][rows]
        except _DAMAGE as error:
            cause = " ".join(str(error).split()) or type(error).__name__
            found = f"{table} that cannot be read ({cause[:160]})"
            raise InputError(self.path, found, "an undamaged file", "remove it") from error
        return read

    def _read_tables(self, file: h5py.File) -> None:
        """Read what does not grow with the samples and map the table of voxels."""
        # what it is
        if file.attrs.get("format") != _FORMAT.encode():
            raise ValueError(f"not of the format {_FORMAT!r}")
        self.name = file.attrs["name"].decode()
        self.fingerprint: bytes = file.attrs["fingerprint"]
        self.classes: tuple[str, ...] = tuple(json.loads(file.attrs["classes"]))

        # scans, then voxels
        self.position, self.floor, self._num_new, self.starts, self.seen_starts = (
            file[key][...] for key in _SCANS
        )
        self.num_scans = len(self.floor)
        self.num_samples = len(file["voxel"]) if "voxel" in file else len(file["seen"])
        self.xyz = self._mapped(file["xyz"], np.float32)
        self.rgb = self._mapped(file["rgb"], np.uint8)
        self.semantic = self._mapped(file["semantic"], np.uint8)
        self.instance = self._mapped(file["instance"], np.int32)
        if "voxel" not in file:
            self.seen = self._mapped(file["seen"], np.int32)

    def _mapped(self, dataset: h5py.Dataset, dtype: type[ScalarT]) -> NDArray[ScalarT]:
        """Map a table into memory: rows picked here and there cost no call of HDF5 and no copy."""
        table: NDArray[ScalarT] = np.memmap(
            self.path, dtype, "r", dataset.id.get_offset(), dataset.shape
        )
        return table

    def _file(self) -> h5py.File:
        """Return the open file; a forked process opens its own."""
        if self._opened_by != os.getpid():
            file = _open(self.path)
            if file.attrs.get("fingerprint") != self.fingerprint:
                raise InputError(
                    self.path, "other samples than before", "the same file", "start again"
                )
            self._open_file, self._opened_by = file, os.getpid()
        return self._open_file


def prepare_samples(
    area: Path,
    settings: SampleSettings,
    cache: Path | None = None,
    progress: ScanProgress | None = None,
) -> AreaSamples:
    """Open the samples of an area; first replay it and write them, unless a valid file is there.

    A file is valid for the same scans, poses, truth and settings, if undamaged. Several processes
    may prepare areas, even the same one, at the same time.

    Args:
        area: Folder that ``mcpseg raytrace`` wrote.
        settings: Everything that decides the samples.
        cache: The file; ``samples.h5`` in the area's folder if not given.
        progress: Called after each scan that is replayed.

    Raises:
        InputError: The area is not complete, damaged, or changes meanwhile.
        OutputError: ``cache`` is a file of something else.
        OSError: The disk is full or the folder not writable; nothing is left behind.
    """
    path = cache or area / "samples.h5"
    fingerprint = area_fingerprint(area, settings)
    if _is_valid(path, fingerprint):
        return AreaSamples(path)

    # the file appears under its name only when it is whole
    replay = Replay(area, settings)
    with steady_file(path) as stream:
        with h5py.File(stream, "w") as file:
            _write(file, stream, replay, progress)
            if not len(replay.map):
                raise InputError(
                    area, "no point near the robot", "points within local_range", "check the poses"
                )
            facts = {
                "format": _FORMAT,
                "fingerprint": fingerprint,
                "name": area.resolve().name,
                "classes": json.dumps(replay.classes),
                "settings": settings.model_dump_json(),
            }
            for name, fact in facts.items():
                file.attrs[name] = np.bytes_(fact.encode(errors="replace"))
            file.attrs[_FACTS] = _checksum_of_facts(file)
        stream.check()
        if area_fingerprint(area, settings) != fingerprint:
            found, expected = "changed while its samples were prepared", "an area at rest"
            raise InputError(area, found, expected, "run the same command again")
    return AreaSamples(path)


def area_fingerprint(area: Path, settings: SampleSettings) -> str:
    """Return a hash of what decides the samples.

    Records, poses and settings; names, sizes and times of scans and truth.

    Raises:
        InputError: The area is not complete.
        OSError: A file cannot be read.
    """
    digest = hashlib.blake2b(f"{_FORMAT}\n{settings.model_dump_json()}\n".encode(), digest_size=16)
    for record in (area / "raytrace.json", area / "poses.csv"):
        digest.update(record.read_bytes() if record.is_file() else b"")

    for source in list_scans(area):
        for path in (source.path, area / "gt" / source.name):
            facts = path.stat()
            digest.update(
                f"{path.parent.name}/{path.name} {facts.st_size} {facts.st_mtime_ns}\n".encode()
            )
    return digest.hexdigest()


def _write(
    file: h5py.File, stream: SteadyFile, replay: Replay, progress: ScanProgress | None
) -> None:
    """Replay an area into a file, a block of samples at a time."""
    # one growing table for each stream; windows need but what each scan sees, mapped in one piece
    num_context = replay.settings.num_context
    streams = {"voxel": (), "context": (num_context,), "seen": ()} if num_context else {}
    for name, width in streams.items():
        chunk = (max(_CHUNK_BYTES // (4 * (width[0] if width else 1)), 1), *width)
        file.create_dataset(name, (0, *width), "<i4", maxshape=(None, *width), chunks=chunk)
    checksums = dict.fromkeys(streams, 0)

    scans: list[tuple[NDArray[np.float64], float, int, int, int]] = []
    block: list[ScanSamples] = []
    seen: list[NDArray[np.int32]] = []
    for done, scan in enumerate(replay.run(), start=1):
        scans.append((scan.position, scan.floor, scan.num_new, len(scan.voxel), len(scan.seen)))
        block.append(scan)
        if not num_context:
            seen.append(scan.seen)
        if done == len(replay.scans) or sum(len(part.voxel) for part in block) >= _BLOCK:
            for name in streams:
                rows = np.concatenate([getattr(part, name) for part in block])
                checksums[name] = _append(file[name], rows, checksums[name])
            block.clear()
            stream.check()
        if progress is not None:
            progress(done, len(replay.scans))
    if not num_context:
        file.create_dataset("seen", data=np.concatenate(seen).astype("<i4"))
        checksums["seen"] = _checksum(file["seen"])

    # tables that are read whole, and what all must sum to
    _write_tables(file, replay, scans)
    for name in (*_VOXELS, *_SCANS):
        checksums[name] = zlib.crc32(np.ascontiguousarray(file[name][...]).data)
    file.attrs["crc32"] = np.bytes_(json.dumps(checksums).encode())


def _append(dataset: h5py.Dataset, rows: NDArray[np.int32], checksum: int) -> int:
    """Append rows; return the checksum of all."""
    before = len(dataset)
    dataset.resize(before + len(rows), axis=0)
    dataset[before:] = rows
    return zlib.crc32(np.ascontiguousarray(rows).data, checksum)


def _write_tables(
    file: h5py.File, replay: Replay, scans: list[tuple[NDArray[np.float64], float, int, int, int]]
) -> None:
    """Write the table of voxels and that of scans."""
    # lists of scans as columns; where each scan starts
    position, floor, num_new, sizes, seen = zip(*scans, strict=True)
    tables: dict[str, NDArray[np.generic]] = {
        "xyz": replay.map.xyz,
        "rgb": replay.map.rgb,
        "semantic": replay.semantic,
        "instance": replay.instance,
        "position": np.array(position, "<f8"),
        "floor": np.array(floor, "<f8"),
        "num_new": np.array(num_new, "<i8"),
        "starts": np.cumsum([0, *sizes], dtype="<i8"),
        "seen_starts": np.cumsum([0, *seen], dtype="<i8"),
    }

    for name, table in tables.items():
        file.create_dataset(name, data=table.astype(_VOXELS[name][0]) if name in _VOXELS else table)


def _is_valid(path: Path, fingerprint: str) -> bool:
    """Tell whether a file holds these samples, whole.

    Raises:
        OutputError: It is a file of something else.
    """
    if not path.exists():
        return False

    # a user's file of another kind is not replaced
    with path.open("rb") as raw:
        if raw.read(len(_SIGNATURE)) not in (_SIGNATURE, b""):
            raise OutputError(
                f"{path}: not a file of training samples; expected one or none; choose another name"
            )

    try:
        with _open(path) as file:
            if not file.attrs.get("format", b"").startswith(b"mcpseg samples"):
                raise OutputError(
                    f"{path}: HDF5 of something else; expected training samples; "
                    "choose another name"
                )
            if file.attrs["fingerprint"] != fingerprint.encode():
                return False
            if file.attrs[_FACTS] != _checksum_of_facts(file):
                return False
            _check_claims(path, file)
            checksums = json.loads(file.attrs["crc32"])
            streams = _STREAMS if "voxel" in file else _STREAMS[-1:]
            return all(
                _checksum(file[name]) == checksums[name] for name in (*_VOXELS, *_SCANS, *streams)
            )
    except (*_DAMAGE, InputError):
        return False


def _check_claims(path: Path, file: h5py.File) -> None:
    """Refuse tables that claim far more rows than they have bytes: HDF5 would make them up."""
    for name, table in file.items():
        if isinstance(table, h5py.Dataset):
            num_bytes = prod(table.shape) * table.dtype.itemsize
            check_claim(path, name, num_bytes, packed=table.id.get_storage_size())


def _checksum_of_facts(file: h5py.File) -> int:
    """Return the CRC-32 of everything that the file says beside its tables."""
    names = sorted(name for name in file.attrs if name != _FACTS)
    return zlib.crc32(repr([(name, bytes(file.attrs[name])) for name in names]).encode())


def _checksum(dataset: h5py.Dataset) -> int:
    """Return the CRC-32 of a dataset, read in parts."""
    checksum = 0
    for part in _parts(dataset):
        checksum = zlib.crc32(np.ascontiguousarray(part).data, checksum)
    return checksum


def _parts(dataset: h5py.Dataset) -> Iterator[NDArray[np.generic]]:
    width = int(np.prod(dataset.shape[1:], dtype=np.int64)) * dataset.dtype.itemsize
    step = max(_VERIFIED_BYTES // width, 1)
    for start in range(0, len(dataset), step):
        yield dataset[start : start + step]


def _open(path: Path) -> h5py.File:
    """Open for reading; without a lock, for a file under this name never changes."""
    return h5py.File(path, "r", locking=False)
