"""What every recording is, whatever it is stored in: scans in order, each read when it is due."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol, overload

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Frame
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.cloud import Cloud
from mcpseg_cli.formats.fingerprint import Fingerprint

POSES_NOTE = "poses: "
"""What a recording's note of its own poses begins with."""


class ScanSource(Protocol):
    """One scan of a recording."""

    @property
    def name(self) -> str:
        """What reports and poses call it: its path below the recording, or a name with .ply."""

    @property
    def path(self) -> Path:
        """The file it is, or that it is a part of, for messages."""

    @property
    def pose(self) -> NDArray[np.float64] | None:
        """(4, 4) float64, sensor to map, metres; None where it has none."""

    @property
    def stamp(self) -> float | None:
        """When it was taken, seconds; None where nothing says so."""

    @property
    def frame(self) -> Frame | None:
        """Frame of its coordinates, where its kind says so."""

    def with_pose(self, pose: NDArray[np.float64] | None) -> ScanSource:
        """Return the same scan with another pose."""

    def in_frame(self, frame: Frame) -> ScanSource:
        """Return the same scan, known to be in a frame."""

    def read(self) -> Cloud:
        """Read its points.

        Raises:
            InputError: It is damaged.
            OSError: It cannot be read.
        """

    def fingerprint(self) -> Fingerprint:
        """Take the fingerprint of its content.

        Raises:
            InputError: It is damaged.
            OSError: It cannot be read.
        """

    def is_still(self, kept: Fingerprint) -> bool:
        """Tell whether its content is still what it was.

        Raises:
            OSError: It cannot be read.
        """


@dataclass(frozen=True)
class Recording(Sequence[ScanSource]):
    """Scans in order, and what they were found in.

    Attributes:
        path: What the user named.
        kind: What that is, in words.
        scans: All scans, in the order they are labelled in.
        notes: How it was read where that was a choice; a line each.
        no_poses: Why none of its scans has a pose, where its kind could have held them.
    """

    path: Path
    kind: str
    scans: tuple[ScanSource, ...]
    notes: tuple[str, ...] = ()
    no_poses: InputError | None = None

    @overload
    def __getitem__(self, which: int) -> ScanSource: ...

    @overload
    def __getitem__(self, which: slice) -> tuple[ScanSource, ...]: ...

    def __getitem__(self, which: int | slice) -> ScanSource | tuple[ScanSource, ...]:
        return self.scans[which]

    def __len__(self) -> int:
        return len(self.scans)

    @property
    def has_poses(self) -> bool:
        """Whether any scan has a pose."""
        return any(source.pose is not None for source in self.scans)

    @property
    def frame(self) -> Frame | None:
        """The frame of all its scans, where its kind says so."""
        frames = {source.frame for source in self.scans}
        return frames.pop() if len(frames) == 1 else None

    def in_frame(self, frame: Frame) -> Recording:
        """Return the same scans, known to be in a frame."""
        return replace(self, scans=tuple(source.in_frame(frame) for source in self.scans))

    def with_poses(self, poses: Iterable[NDArray[np.float64] | None]) -> Recording:
        """Return the same scans with other poses, one each."""
        scans = tuple(
            source.with_pose(pose) for source, pose in zip(self.scans, poses, strict=True)
        )
        notes = tuple(note for note in self.notes if not note.startswith(POSES_NOTE))
        return replace(self, scans=scans, notes=notes, no_poses=None)


@dataclass(frozen=True)
class TopicChoice:
    """Which topics of a bag to take where there are several.

    Attributes:
        scans: Topic of the point clouds or depth images.
        poses: Topic of the poses.
    """

    scans: str | None = None
    poses: str | None = None


def pose_of(source: ScanSource) -> NDArray[np.float64]:
    """Return the pose of a scan.

    Raises:
        InputError: It has none.
    """
    if source.pose is None:
        found, expected = f"no pose for scan {source.name}", "a pose for every scan"
        remedy = "remove the scan, or give --on-error skip"
        raise InputError(source.path, found, expected, remedy)
    return source.pose


def check_names(path: Path, scans: Sequence[ScanSource]) -> None:
    """Refuse scans that cannot be told from each other by their names.

    Raises:
        InputError: Two have the same name, or one is not UTF-8.
    """
    seen: dict[str, ScanSource] = {}
    for source in scans:
        if any("\ud800" <= letter <= "\udfff" for letter in source.name):
            found = f"a scan called {source.name!r}"
            raise InputError(path, found, "a name in UTF-8", "rename it")
        stem = str(Path(source.name).with_suffix(""))
        if stem in seen:
            found = f"{seen[stem].name} and {source.name} have the same scan name"
            raise InputError(path, found, "one file a scan", "rename or remove one")
        seen[stem] = source
