"""Scans that are files of their own, and which files of a folder are scans."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Frame
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import CLOUD_SUFFIXES, READ_ONLY_SUFFIXES, Cloud, read_measured
from mcpseg_cli.formats.fingerprint import Fingerprint
from mcpseg_cli.formats.magic import recognise
from mcpseg_cli.formats.natural_order import natural_key, split_ending
from mcpseg_cli.formats.scan_source import Placeable, check_names

STATION_SUFFIXES = (".e57", ".ptx")  # files of several scans, each with its pose
_ALSO_OTHER_THINGS = (".bin", ".txt")  # scans only where nothing surer is: poses are .txt, too
_RUN = "state.sqlite"  # what lies in the folder of a run


@dataclass(frozen=True)
class ScanFile(Placeable):
    """One scan of a recording that is a file of its own.

    Attributes:
        path: The file.
        pose: (4, 4) float64, sensor to map; None where it has none.
        folder: The recording that ``name`` is a path below; None for the file's own folder.
        stamp: When it was taken, seconds; None where nothing says so.
        frame: Frame of its coordinates, where its kind says so.
        lost: Why it has no pose, where it is known.
    """

    path: Path
    pose: NDArray[np.float64] | None
    folder: Path | None = None
    stamp: float | None = None
    frame: Frame | None = None
    lost: str = ""

    @cached_property
    def name(self) -> str:
        """Its path below the recording: a file name, or ``run1/000000.ply``."""
        if self.folder is None:
            return self.path.name
        folder, path = f"{self.folder}{os.sep}", str(self.path)
        if path.startswith(folder):  # what pathlib finds out part by part
            return path[len(folder) :].replace(os.sep, "/")
        return self.path.relative_to(self.folder).as_posix()

    def read(self) -> Cloud:
        """Read its points, see ``read_measured``."""
        return read_measured(self.path)

    def fingerprint(self) -> Fingerprint:
        """Take the fingerprint of its file."""
        return Fingerprint.of(self.path)

    def is_still(self, kept: Fingerprint) -> bool:
        """Tell whether its file is still what it was."""
        return kept.matches(self.path)


def list_clouds(directory: Path) -> list[Path]:
    """List the cloud files of a folder in natural order: ``scan_2`` before ``scan_10``.

    Args:
        directory: The folder; its sub-folders are gone through only where it has no cloud itself.

    Raises:
        InputError: Not a folder, no cloud in it, or two clouds whose names differ only in their
            ending.
    """
    return _list(directory, (*CLOUD_SUFFIXES, *READ_ONLY_SUFFIXES))


def list_scans(directory: Path) -> list[Path]:
    """List the files of a folder that hold scans, those of several stations among them.

    Args:
        directory: As for ``list_clouds``.

    Raises:
        InputError: As for ``list_clouds``.
    """
    return _list(directory, (*CLOUD_SUFFIXES, *READ_ONLY_SUFFIXES, *STATION_SUFFIXES))


def _list(directory: Path, suffixes: tuple[str, ...]) -> list[Path]:
    if not directory.is_dir():
        found = "a file" if directory.exists() else "no such folder"
        raise InputError(directory, found, "a folder of scans", "check the path")
    paths = _files_below(directory, suffixes)
    if not paths:
        expected = f"files ending in {', '.join(suffixes)}"
        raise InputError(directory, f"no scans{_instead(directory)}", expected, "check the path")

    # each scan has one name, by which reports and poses know it
    check_names(directory, [ScanFile(path, None, directory) for path in paths])
    return paths


def _files_below(directory: Path, suffixes: tuple[str, ...]) -> list[Path]:
    """List the scans of a folder; of its sub-folders where it has none, runs left out."""
    with os.scandir(directory) as found:
        named = {entry.name: entry for entry in found if entry.name[0] != "."}
    names = sorted(named, key=natural_key)
    ended = [name for name in names if split_ending(name)[1].lower() in suffixes]
    files = [directory / name for name in ended if named[name].is_file()]

    surest = min(map(_doubt, files), default=len(_ALSO_OTHER_THINGS) + 1)
    files = [path for path in files if _doubt(path) == surest]
    if surest < len(_ALSO_OTHER_THINGS):
        return files
    folders = [directory / name for name in names if named[name].is_dir()]
    folders = [folder for folder in folders if not (folder / _RUN).exists()]
    below = [path for folder in folders for path in _files_below(folder, suffixes)]
    return below if min(map(_doubt, below), default=surest) < surest else files


def _doubt(path: Path) -> int:
    """Tell how likely a file is something else than a scan, by its ending: 0, not at all."""
    suffix = path.suffix.lower()
    return 1 + _ALSO_OTHER_THINGS.index(suffix) if suffix in _ALSO_OTHER_THINGS else 0


def _instead(directory: Path) -> str:
    """Say what is in a folder: its most frequent endings, and what files of the first are."""
    files = [path for path in directory.rglob("*") if path.is_file() and path.name[0] != "."]
    ending_of = {path: "".join(path.suffixes[-2:]) or "without ending" for path in sorted(files)}
    endings = Counter(ending_of.values())
    if not endings:
        return ", an empty folder" if not any(directory.iterdir()) else ""
    counts = endings.most_common(3)
    listed = ", ".join(f"{count:,} {ending}" for ending, count in counts)
    first = next(path for path in ending_of if ending_of[path] == counts[0][0])
    return f", but {listed}{recognise(first, f'; {first.name}: ')}"
