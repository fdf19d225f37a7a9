"""Reads many S3DIS text files at once, in parts, into arrays of all points one after the other."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.natural_order import natural_key
from mcpseg_cli.formats.s3dis_text import BadLine, Lines, read_lines

ANNOTATIONS = "Annotations"
_LAYOUT = "an S3DIS area: Area_1/office_1/Annotations/chair_1.txt"
_PART = 1 << 24  # bytes of text a thread holds
_LONGEST_LINE = 1 << 16  # bytes
_FEW = 10  # bad lines a file may have however short it is
_SHARE = 1000  # one bad line in so many is too many


@dataclass(frozen=True)
class ObjectFile:
    """The text file of one object.

    Attributes:
        room: Name of its room.
        path: Where it is.
        size: Bytes.
        mtime_ns: When its content was last changed, as the file says.
        ctime_ns: When anything about it was last changed, as the file system knows.
    """

    room: str
    path: Path
    size: int
    mtime_ns: int
    ctime_ns: int

    def name_in(self, folder: Path) -> str:
        """Return its path from the area's folder on."""
        return self.path.relative_to(folder).as_posix()


@dataclass(frozen=True)
class Points:
    """The points of many files, file after file.

    Attributes:
        xyz: (N, 3) float32.
        rgb: (N, 3) uint8.
        counts: (files,) int64 points of each file.
        mended: ``file:line`` of bad lines that were read after all.
        dropped: ``file:line`` of bad lines that were not.
    """

    xyz: NDArray[np.float32]
    rgb: NDArray[np.uint8]
    counts: NDArray[np.int64]
    mended: tuple[str, ...]
    dropped: tuple[str, ...]


def list_area(path: Path) -> tuple[Path, list[ObjectFile], tuple[str, ...]]:
    """Find the object files of an area.

    Args:
        path: The area's folder, a room's, or a room's ``Annotations``.

    Returns:
        The area's (or the one room's) folder, its object files in order, and the folders without
        annotations.

    Raises:
        InputError: Not a folder in this layout, or no object files.
        OSError: A folder cannot be read.
    """
    if not path.is_dir():
        found = "a file" if path.exists() else "no such folder"
        raise InputError(path, found, _LAYOUT, "name the area's folder")

    # the rooms of an area, or the one that was named
    folder = Path(path.absolute().parent if path.name == ANNOTATIONS else path.absolute())
    if (folder / ANNOTATIONS).is_dir():
        rooms = [folder]
    else:
        rooms = _shown(entry for entry in folder.iterdir() if entry.is_dir())

    # their object files
    skipped = tuple(room.name for room in rooms if not (room / ANNOTATIONS).is_dir())
    files = [file for room in rooms if room.name not in skipped for file in _objects_in(room)]
    if not files:
        inner = [room.name for room in rooms if any(room.glob(f"*/{ANNOTATIONS}"))]
        remedy = f"name one area, such as {folder / inner[0]}" if inner else "check the path"
        raise InputError(path, "no object files", _LAYOUT, remedy)
    return folder, files, skipped


def _objects_in(room: Path) -> Iterator[ObjectFile]:
    """Give the object files of a room, in order."""
    texts = (path for path in (room / ANNOTATIONS).iterdir() if path.suffix.lower() == ".txt")
    for path in _shown(path for path in texts if path.is_file()):
        status = path.stat()
        yield ObjectFile(room.name, path, status.st_size, status.st_mtime_ns, status.st_ctime_ns)


def _shown(paths: Iterable[Path]) -> list[Path]:
    """Sort by name without ending, numbers in it by value; hidden ones are left out."""
    shown = (path for path in paths if not path.name.startswith("."))
    return sorted(shown, key=lambda path: (natural_key(path.stem), path.name))


def read_files(
    files: list[ObjectFile],
    folder: Path,
    threads: int,
    progress: Callable[[str, int, int], None] | None = None,
) -> Points:
    """Read the points of all files.

    Memory: the points, for each thread 16 MB of text, and the points of a few times that.

    Args:
        files: What to read.
        folder: The area's folder; files are named from there on.
        threads: Parts read at once.
        progress: Called with room, bytes read and bytes to read after each part.

    Returns:
        Their points in the order of ``files``.

    Raises:
        InputError: A file with more than 10 bad lines and 0.1 % of them, or with bad lines only.
        OSError: A file cannot be read.
    """
    total, done = sum(file.size for file in files), 0
    points = _GrowingPoints()
    counts = np.zeros(len(files), np.int64)
    bad_lines: list[tuple[str, bool]] = []
    with closing(_by_file(files, threads)) as by_file:
        for number, parts in by_file:
            # its points, part by part
            check = _LineCheck(files[number])
            for size, lines in parts:
                done += size
                check.add(lines)
                points.append(lines, done / total)
                counts[number] += len(lines.xyz)
                if progress is not None:
                    progress(files[number].room, done, total)

            # its bad lines, which must be few
            name, bad = files[number].name_in(folder), check.finish(int(counts[number]))
            bad_lines += [(f"{name}:{line.line}", line.mended) for line in bad]

    xyz, rgb = points.finish()
    mended = tuple(name for name, is_mended in bad_lines if is_mended)
    dropped = tuple(name for name, is_mended in bad_lines if not is_mended)
    return Points(xyz, rgb, counts, mended, dropped)


class _GrowingPoints:
    """Arrays that grow in place: the pages of large ones are moved, so no second copy exists."""

    def __init__(self) -> None:
        self._xyz, self._rgb = np.empty((0, 3), np.float32), np.empty((0, 3), np.uint8)
        self._count = 0

    def append(self, lines: Lines, share: float) -> None:
        """Append the points of one part, after which ``share`` of all text has been read."""
        start, end = self._count, self._count + len(lines.xyz)
        if end > len(self._xyz):
            self._resize(max(end, min(int(end / share * 1.01), 2 * end) + 1000))
        self._xyz[start:end], self._rgb[start:end], self._count = lines.xyz, lines.rgb, end

    def finish(self) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
        """Give up the memory that is not needed and return the arrays."""
        self._resize(self._count)
        return self._xyz, self._rgb

    def _resize(self, size: int) -> None:
        self._xyz.resize((size, 3), refcheck=False)
        self._rgb.resize((size, 3), refcheck=False)


class _LineCheck:
    """Collects the bad lines of one file and refuses it when they are too many."""

    def __init__(self, file: ObjectFile) -> None:
        self._file, self._num_lines = file, 0
        self._bad: list[BadLine] = []

    def add(self, lines: Lines) -> None:
        """Take in the next part."""
        self._bad += [
            BadLine(self._num_lines + bad.line, bad.text, bad.mended) for bad in lines.bad
        ]
        self._num_lines += lines.num_lines
        if not lines.is_whole:
            self._refuse("at least ")

    def finish(self, num_points: int) -> list[BadLine]:
        """Return the bad lines if they are few."""
        if self._bad and (len(self._bad) > max(_FEW, self._num_lines / _SHARE) or num_points == 0):
            self._refuse("")
        return self._bad

    def _refuse(self, approximation: str) -> None:
        """Name the first bad line of so many."""
        first, count = self._bad[0], f"{approximation}{len(self._bad):,}"
        found = f"{count} bad lines, first line {first.line:,}: {first.text!r}"
        expected = "lines of six numbers x y z r g b, colours 0 to 255"
        raise InputError(self._file.path, found, expected, "copy the file again or convert it")


def _by_file(
    files: list[ObjectFile], threads: int
) -> Generator[tuple[int, Iterator[tuple[int, Lines]]], None, None]:
    """Read ahead in threads; yield each file's parts, in order, with their bytes of text."""
    # a few parts are being read or wait
    jobs = (
        (number, start) for number, file in enumerate(files) for start in range(0, file.size, _PART)
    )
    running: deque[Future[Lines]] = deque()
    with ThreadPoolExecutor(threads) as pool:

        def fill() -> None:
            while len(running) < 2 * threads + 1:
                job = next(jobs, None)
                if job is None:
                    break
                running.append(pool.submit(_read_part, files[job[0]], job[1]))

        # each file asks for its parts when it is its turn
        def parts(file: ObjectFile) -> Iterator[tuple[int, Lines]]:
            for start in range(0, file.size, _PART):
                fill()
                yield min(_PART, file.size - start), running.popleft().result()

        for number, file in enumerate(files):
            yield number, parts(file)


def _read_part(file: ObjectFile, start: int) -> Lines:
    """Read the lines that begin in one part of a file."""
    with file.path.open("rb") as stream:
        # a line begins here only if the byte before ends another
        before = min(start, 1)
        stream.seek(start - before)
        text = stream.read(_PART + before)
        begin = text.find(b"\n") + 1 if before else 0
        if before and begin == 0:
            return read_lines(b"")

        # the last line ends in the next part
        if begin < len(text) and not text.endswith(b"\n"):
            text += stream.readline(_LONGEST_LINE)
    return read_lines(text[begin:] if begin else text)
