"""S3DIS folders: ``Area_1/office_1/Annotations/chair_2.txt``, a text file of points each object."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from mcpseg_cli.building import Building
from mcpseg_cli.classes import S3DIS_CLASSES, UNKNOWN
from mcpseg_cli.errors import InputError, McpsegError, OutputError, naming
from mcpseg_cli.formats.hdf5 import read_building_h5, read_tags, write_building_h5
from mcpseg_cli.formats.s3dis_classes import read_classes
from mcpseg_cli.formats.s3dis_files import ANNOTATIONS, ObjectFile, Points, list_area, read_files
from mcpseg_cli.formats.s3dis_text import format_lines
from mcpseg_cli.resumable import whole_folder

_CACHE_VERSION = "1"  # raise it when the same text comes to give another building
_NAME = re.compile(r"[^\W_][\w.-]*")

Progress = Callable[[str, int, int], None]
"""Called with the room being read, the bytes read and the bytes to read."""


@dataclass(frozen=True)
class AreaReport:
    """What was noticed when reading an area; every list names files from the area's folder on.

    Attributes:
        num_files: Object files with points.
        mended: ``file:line`` of each bad line that was read after all.
        dropped: ``file:line`` of each bad line that was not.
        empty: Object files without a point; passed over.
        without_annotations: Folders that hold no annotations or only empty ones; passed over.
        other_classes: Objects by class that is not in the area's table.
        counted_as: What those are, clutter or unknown where the table has no clutter.
        from_cache: Whether the points came from the cache.
        cache_notice: Why there is no cache, or why it was made anew; empty when all is as usual.
    """

    num_files: int
    mended: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
    empty: tuple[str, ...] = ()
    without_annotations: tuple[str, ...] = ()
    other_classes: tuple[tuple[str, int], ...] = ()
    counted_as: str = "clutter"
    from_cache: bool = False
    cache_notice: str = ""

    def notices(self) -> tuple[str, ...]:
        """Give one line for each kind of thing a user should know; nothing when all is as usual."""
        others = tuple(f"{name} ({count})" for name, count in self.other_classes)
        counted = f"class counted as {self.counted_as}"
        kinds = (
            ("bad line mended", self.mended),
            ("bad line dropped", self.dropped),
            ("file without points passed over", self.empty),
            ("folder without annotations passed over", self.without_annotations),
            (counted, others),
        )
        lines = [f"{len(found):,} x {kind}: {_some(found)}" for kind, found in kinds if found]
        return (*lines, *([self.cache_notice] if self.cache_notice else []))


def read_area(
    path: Path,
    cache: Path | None = None,
    progress: Progress | None = None,
    threads: int = 2,
    *,
    use_cache: bool = True,
) -> tuple[Building, AreaReport]:
    """Read an S3DIS area, or one room of it, from text or from the cache made of it.

    Rooms and files come in natural order (office_2 before office_10), objects are numbered in this
    order from 1. The class is the file's name up to the number, one of the 13 or of those that
    ``classes.txt`` names (see ``s3dis_classes.read_classes``); other classes become clutter. Hidden
    files, and files that are not .txt, are passed over. See ``s3dis_text.read_lines`` for what
    becomes of bad lines.

    The cache belongs to the names, sizes and times of all object files: whenever one differs, or it
    is damaged, the text is read again. That it cannot be written is a notice, no error.

    Args:
        path: The area's folder, a room's, or a room's ``Annotations``.
        cache: Folder of the cache, made if not there; the area's own by default (a hidden file).
        progress: Told how far reading has come.
        threads: Files, or parts of them, read at once.
        use_cache: False neither reads nor writes the cache.

    Returns:
        The building, with 20 bytes for each point, and what was noticed.

    Raises:
        InputError: Not the layout, no points at all, or a file with more than 10 bad lines and 0.1
            % of them.
        OSError: A file cannot be read.
    """
    folder, files, skipped = list_area(path)
    cached = _cache_of(folder, cache) if use_cache else None
    classes = read_classes(folder)
    fingerprint = _fingerprint(folder, files, classes)

    # from the cache, if it is that of these files
    notice = ""
    if cached is not None:
        found, notice = _from_cache(cached, fingerprint)
        if found is not None:
            return found

    # from text
    points = read_files(files, folder, threads, progress)
    building, report = _assemble(folder, files, points, classes)
    report = replace(report, without_annotations=skipped + report.without_annotations)

    # which is cached for the next time
    if cached is not None:
        tags = {"fingerprint": fingerprint, "report": json.dumps(asdict(report))}
        notice = _to_cache(cached, building, tags) or notice
    return building, replace(report, cache_notice=notice)


def write_room(
    area: Path, room: str, objects: Iterable[tuple[str, NDArray[np.float32], NDArray[np.uint8]]]
) -> tuple[str, ...]:
    """Write one room in the S3DIS layout: ``area/room/Annotations/class_k.txt``.

    Objects are numbered from 1 in each class. The room appears under its name only when complete;
    until then it lies in a hidden folder, which ``read_area`` passes over and the next attempt
    replaces. Coordinates are rounded to millimetres.

    Args:
        area: The area's folder, made if not there.
        room: Name of the room, such as ``office_1``.
        objects: Class, (N, 3) float32 metres in the map frame and (N, 3) uint8 colour of each;
            consumed one at a time. Objects without points are not written.

    Returns:
        The name of each object's file without .txt, in the order given; empty for one that was not
        written.

    Raises:
        OutputError: The room is already there, a name has characters other than letters, digits and
            ``_ . -``, or a coordinate is not finite.
        OSError: The disk is full or the folder not writable; nothing is left behind.
    """
    _check_name(area, room)
    if (area / room).exists():
        raise OutputError(
            f"{area / room}: already there; expected a new room; remove it or name another"
        )
    with whole_folder(area / room) as partial:
        (partial / ANNOTATIONS).mkdir()
        return _write_objects(partial / ANNOTATIONS, area / room, objects)


def _write_objects(
    folder: Path, room: Path, objects: Iterable[tuple[str, NDArray[np.float32], NDArray[np.uint8]]]
) -> tuple[str, ...]:
    """Write a file for each object that has points."""
    counts: dict[str, int] = {}
    names = []
    for name, xyz, rgb in objects:
        _check_name(room, name)
        if len(xyz) == 0:
            names.append("")
            continue

        # numbered in its class
        counts[name] = counts.get(name, 0) + 1
        names.append(f"{name}_{counts[name]}")
        path = folder / f"{names[-1]}.txt"
        try:
            with naming(path), path.open("wb") as file:
                for piece in format_lines(xyz, rgb):
                    file.write(piece)
        except ValueError as error:
            raise OutputError(
                f"{room}: {names[-1]}: {error}; expected metres; write other points"
            ) from error
    return tuple(names)


def _check_name(source: Path, name: str) -> None:
    """Refuse names that are no plain file name."""
    if not _NAME.fullmatch(name):
        raise OutputError(
            f"{source}: the name {name!r}; expected letters, digits and _ . - in it; rename it"
        )


def _class_of(file: ObjectFile) -> str:
    """Return the class an object file is named after."""
    return re.sub(r"_?\d*$", "", file.path.stem).lower()


def _assemble(
    folder: Path, files: list[ObjectFile], points: Points, classes: tuple[str, ...]
) -> tuple[Building, AreaReport]:
    """Label the points and number rooms and objects that have any."""
    # files with points
    counts = points.counts
    kept = [number for number in range(len(files)) if counts[number] > 0]
    if not kept:
        found = f"{len(files):,} object files without a point"
        raise InputError(folder, found, "at least one point", "copy it again")

    # an object each, of the class its file is named after
    names = [_class_of(files[number]) for number in kept]
    label_of = {name: label for label, name in enumerate(classes)}
    rest = label_of.get("clutter", UNKNOWN)
    labels = [label_of.get(name, rest) for name in names]
    objects = np.arange(1, len(kept) + 1, dtype=np.int32)

    # rooms in the order of their first file
    sizes = dict.fromkeys((files[number].room for number in kept), 0)
    for number in kept:
        sizes[files[number].room] += int(counts[number])

    building = Building(
        points.xyz,
        points.rgb,
        np.repeat(np.array(labels, np.uint8), counts[kept]),
        np.repeat(objects, counts[kept]),
        classes,
        rooms=tuple(sizes),
        room_starts=np.concatenate([[0], np.cumsum(list(sizes.values()))]).astype(np.int64),
        object_names=tuple(f"{files[number].room}/{files[number].path.stem}" for number in kept),
    )
    return building, _report(folder, files, points, names, classes)


def _report(
    folder: Path,
    files: list[ObjectFile],
    points: Points,
    names: list[str],
    classes: tuple[str, ...],
) -> AreaReport:
    """Say what was noticed, given the class names of the files with points."""
    empty = [file for file, count in zip(files, points.counts, strict=True) if count == 0]
    filled = {file.room for file, count in zip(files, points.counts, strict=True) if count > 0}
    rooms = dict.fromkeys(file.room for file in files)
    others = sorted(name for name in names if name not in classes)
    return AreaReport(
        num_files=len(names),
        mended=points.mended,
        dropped=points.dropped,
        empty=tuple(file.name_in(folder) for file in empty),
        without_annotations=tuple(room for room in rooms if room not in filled),
        other_classes=tuple((name, others.count(name)) for name in dict.fromkeys(others)),
        counted_as="clutter" if "clutter" in classes else "unknown",
    )


def _fingerprint(folder: Path, files: list[ObjectFile], classes: tuple[str, ...]) -> str:
    """Hash what tells one state of the object files from another."""
    lines = [
        f"{file.name_in(folder)}\0{file.size}\0{file.mtime_ns}\0{file.ctime_ns}" for file in files
    ]
    named = [] if classes == S3DIS_CLASSES else list(classes)
    text = "\n".join([_CACHE_VERSION, *lines, *named])
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()


def _cache_of(folder: Path, cache: Path | None) -> Path:
    """Return where an area's cache lies."""
    if cache is None:
        return folder / ".mcpseg.h5"

    # in a folder of caches, areas of one name are told apart by their paths
    path = hashlib.sha256(os.fsencode(os.path.abspath(folder))).hexdigest()[:8]  # noqa: PTH100
    return cache / f"{folder.name}-{path}.mcpseg.h5"


def _from_cache(path: Path, fingerprint: str) -> tuple[tuple[Building, AreaReport] | None, str]:
    """Read the cache if it belongs to these files; else say why it was made anew."""
    if not path.exists():
        return None, ""
    try:
        tags = read_tags(path)
        if tags.get("fingerprint") != fingerprint:
            return None, f"{path}: made from other files; the cache was made anew"
        report = TypeAdapter(AreaReport).validate_python(json.loads(tags["report"]))
        return (read_building_h5(path), replace(report, from_cache=True)), ""
    except (McpsegError, OSError, ValueError, KeyError, RecursionError) as error:
        cause = "no report" if isinstance(error, ValidationError) else error
        return None, f"{path}: not usable ({cause}); the cache was made anew"


def _to_cache(path: Path, building: Building, tags: dict[str, str]) -> str:
    """Write the cache; say why if that cannot be done."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_building_h5(path, building, tags)
    except (McpsegError, OSError) as error:
        return (
            f"no cache was written ({error}); give another folder for it to read faster next time"
        )
    return ""


def _some(found: tuple[str, ...]) -> str:
    """List a few."""
    return ", ".join(found[:5]) + (f" and {len(found) - 5:,} more" if len(found) > 5 else "")
