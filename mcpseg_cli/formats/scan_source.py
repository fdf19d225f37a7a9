"""What every recording is, whatever it is stored in: scans in order, each read when it is due."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol, Self, overload

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Frame
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.cloud import Cloud
from mcpseg_cli.formats.fingerprint import Fingerprint
from mcpseg_cli.formats.natural_order import split_ending

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
    def lost(self) -> str:
        """Why it has no pose, where it is known."""

    @property
    def stamp(self) -> float | None:
        """When it was taken, seconds; None where nothing says so."""

    @property
    def frame(self) -> Frame | None:
        """Frame of its coordinates, where its kind says so."""

    def with_pose(self, pose: NDArray[np.float64] | None, lost: str = "") -> ScanSource:
        """Return the same scan with another pose, or with none and why."""

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


class Placeable:
    """What scans that are dataclasses, with a pose, ``lost`` and a frame, have in common."""

    def with_pose(self, pose: NDArray[np.float64] | None, lost: str = "") -> Self:
        """Return the same scan with another pose, or with none and why."""
        return replace(self, pose=pose, lost=lost)  # type: ignore[type-var]

    def in_frame(self, frame: Frame) -> Self:
        """Return the same scan, known to be in a frame."""
        return replace(self, frame=frame)  # type: ignore[type-var]


@dataclass(frozen=True)
class Recording(Sequence[ScanSource]):
    """Scans in order, and what they were found in.

    Attributes:
        path: What the user named.
        kind: What that is, in words.
        scans: All scans, in the order they are labelled in.
        notes: How it was read where that was a choice; a line each.
        no_poses: Why none of its scans has a pose, where its kind could have held them.
        paired: How scans and poses were paired, in words.
        columns: What the poses were taken for, in words.
        awaited: Names of scans without a pose that could still come.
        surplus: Names of poses of no scan.
    """

    path: Path
    kind: str
    scans: tuple[ScanSource, ...]
    notes: tuple[str, ...] = ()
    no_poses: InputError | None = None
    paired: str = "each scan has its own"
    columns: str = "of the recording"
    awaited: frozenset[str] = frozenset()
    surplus: tuple[str, ...] = ()

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

    @property
    def poses(self) -> NDArray[np.float64]:
        """(P, 4, 4) float64 poses of the scans that have one."""
        known = [source.pose for source in self.scans if source.pose is not None]
        return np.stack(known) if known else np.empty((0, 4, 4))

    @property
    def num_lost(self) -> int:
        """Count the scans without a pose."""
        return sum(source.pose is None for source in self.scans)

    @property
    def told(self) -> str:
        """How scans and poses were paired, with how many were not."""
        words = [self.paired]
        words += [f"{self.num_lost:,} scans without a pose"] if self.num_lost else []
        words += [f"{len(self.surplus):,} poses without a scan"] if self.surplus else []
        return "; ".join(words)

    def pairing_as_json(self) -> dict[str, str | int]:
        """Say the same by name, for records."""
        facts: dict[str, str | int] = {"how": self.paired, "poses": self.columns}
        return facts | {"without_pose": self.num_lost, "without_scan": len(self.surplus)}

    def in_frame(self, frame: Frame) -> Recording:
        """Return the same scans, known to be in a frame."""
        return replace(self, scans=tuple(source.in_frame(frame) for source in self.scans))


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
        why = f": {source.lost}" if source.lost else ""
        found, expected = f"no pose for scan {source.name}{why}", "a pose for every scan"
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
        name = source.name
        if not name.isascii() and any("\ud800" <= letter <= "\udfff" for letter in name):
            found = f"a scan called {name!r}"
            raise InputError(path, found, "a name in UTF-8", "rename it")
        stem, _ = split_ending(name)
        if stem in seen:
            found = f"{seen[stem].name} and {name} have the same scan name"
            raise InputError(path, found, "one file a scan", "rename or remove one")
        seen[stem] = source
