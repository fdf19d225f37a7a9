"""A recording: a folder of scans in natural order, paired with their poses, read one by one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Frame, OnError
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import CLOUD_SUFFIXES, Cloud, read_cloud
from mcpseg_cli.formats.natural_order import natural_key
from mcpseg_cli.formats.pairing import MAX_GAP_S, Pairing, pair
from mcpseg_cli.formats.poses import Poses, read_poses
from mcpseg_cli.grid import MAX_VOXEL
from mcpseg_cli.scan import Scan, to_map_frame

MAX_COORDINATE = 65536.0
"""Metres from the origin at which float32 resolves no finer than 4 mm; farther is refused."""
_TOO_FAR = "subtract a common offset from scans and poses, or convert millimetres to metres"


@dataclass(frozen=True)
class ScanFile:
    """One scan of a recording.

    Attributes:
        path: Its file.
        pose: (4, 4) float64, sensor to map; NaN where it has none.
        lost: Why it has none.
    """

    path: Path
    pose: NDArray[np.float64]
    lost: str = ""


@dataclass(frozen=True)
class PairedScans:
    """The scans of a recording with their poses, in the order in which they were taken.

    Attributes:
        scans: The scans; those without a pose are to be skipped.
        paired: How they were paired, in words.
        columns: How the pose file was understood, in words.
        awaited: Names of scans without a pose that could still come.
        surplus: Names of poses of no scan.
    """

    scans: list[ScanFile]
    paired: str
    columns: str = ""
    awaited: frozenset[str] = frozenset()
    surplus: tuple[str, ...] = ()

    @property
    def told(self) -> str:
        """How they were paired, with how many were not."""
        unpaired = sum(bool(scan.lost) for scan in self.scans)
        words = [self.paired]
        words += [f"{unpaired:,} scans without a pose"] if unpaired else []
        words += [f"{len(self.surplus):,} poses without a scan"] if self.surplus else []
        return "; ".join(words)

    def as_json(self) -> dict[str, str | int]:
        """Say the same by name, for records."""
        unpaired = sum(bool(scan.lost) for scan in self.scans)
        facts: dict[str, str | int] = {"how": self.paired, "poses": self.columns}
        return facts | {"without_pose": unpaired, "without_scan": len(self.surplus)}


def list_clouds(directory: Path) -> list[Path]:
    """List the cloud files of a folder in natural order: ``scan_2`` before ``scan_10``.

    Args:
        directory: The folder; its subfolders and other files are passed over.

    Raises:
        InputError: Not a folder, no cloud in it, or two clouds whose names differ only in their
            ending.
    """
    if not directory.is_dir():
        found = "a file" if directory.exists() else "no such folder"
        raise InputError(directory, found, "a folder of scans", "check the path")
    files = [path for path in directory.iterdir() if path.name[0] != "." and path.is_file()]
    paths = [path for path in files if path.suffix.lower() in CLOUD_SUFFIXES]
    if not paths:
        expected = f"files ending in {', '.join(CLOUD_SUFFIXES)}"
        raise InputError(directory, "no scans", expected, "check the path")

    # each scan has one name, by which reports and poses know it
    paths.sort(key=lambda path: natural_key(path.name))
    seen: dict[str, Path] = {}
    for path in paths:
        if any("\ud800" <= letter <= "\udfff" for letter in path.name):
            found = f"a scan called {path.name!r}"
            raise InputError(directory, found, "a name in UTF-8", "rename it")
        if path.stem in seen:
            found = f"{seen[path.stem].name} and {path.name} have the same scan name"
            raise InputError(directory, found, "one file a scan", "rename or remove one")
        seen[path.stem] = path
    return paths


def open_recording(directory: Path, poses_path: Path, frame: Frame = "map") -> list[ScanFile]:
    """Pair the scans of a folder with their poses: the scans of ``pair_recording``."""
    return pair_recording(directory, poses_path, frame).scans


def pair_recording(
    directory: Path,
    poses_path: Path,
    frame: Frame = "map",
    *,
    max_gap: float = MAX_GAP_S,
    on_error: OnError = "stop",
) -> PairedScans:
    """Pair the scans of a folder with their poses; nothing but names and poses is read yet.

    Args:
        directory: Folder of scans.
        poses_path: Pose file, see ``read_poses``.
        frame: Frame of the scans' coordinates; poses of scans in the sensor's frame need an
            orientation.
        max_gap: Seconds from a scan to the nearest pose, where they pair by time.
        on_error: ``skip`` leaves scans without a pose and poses without a scan for what they are.

    Returns:
        The scans in natural order, or in order of time where their time stamps pair them.

    Raises:
        InputError: Names the scan without a pose, the pose without a scan, the two counts, or a
            position too far out.
    """
    paths = list_clouds(directory)
    poses = read_poses(poses_path, directory)
    check_poses(poses_path, poses, frame)
    names = [path.name for path in paths]
    paired = in_order(paths, pair(names, None, poses, max_gap, source=poses_path), poses)
    if on_error == "stop":
        _check_whole(poses_path, paired)
    return paired


def in_order(paths: list[Path], pairing: Pairing, poses: Poses) -> PairedScans:
    """Put scans in order, each with its pose."""
    scans = [
        ScanFile(paths[scan], pairing.poses[scan], pairing.unpaired.get(scan, ""))
        for scan in pairing.order.tolist()
    ]
    awaited = frozenset(paths[scan].name for scan in pairing.awaited)
    return PairedScans(scans, pairing.how, poses.columns, awaited, pairing.surplus)


def check_poses(path: Path, poses: Poses, frame: Frame) -> None:
    """See that scans of a frame can be moved by these poses.

    Raises:
        InputError: They lack what the frame needs, or lie too far out.
    """
    if frame == "sensor" and not poses.has_rotation:
        expected, remedy = "qx qy qz qw with --frame sensor", "add them, or use --frame map"
        raise InputError(path, "positions only", expected, remedy)
    farthest = np.nanmax(np.abs(poses.poses[:, :3, 3]))
    if farthest >= MAX_COORDINATE:
        found, expected = f"positions up to {farthest:.6g} m", f"less than {MAX_COORDINATE:.6g} m"
        raise InputError(path, found, expected, _TOO_FAR)


def _check_whole(poses_path: Path, paired: PairedScans) -> None:
    """Refuse scans without a pose and poses without a scan."""
    lost = next((scan for scan in paired.scans if scan.lost), None)
    if lost is not None:
        found, remedy = (
            f"no pose for scan {lost.path.name}: {lost.lost}",
            "add it or remove the scan",
        )
        by_time = ", or raise --max-time-gap" if paired.paired.startswith("by time") else ""
        remedy += f"{by_time}, or give --on-error skip"
        raise InputError(poses_path, found, "a pose for every scan", remedy)
    if paired.surplus:
        found = f"a pose for {paired.surplus[0]}, which is not among the scans"
        remedy = "remove the row, or give --on-error skip"
        raise InputError(poses_path, found, "a scan for every row", remedy)


def read_scan(source: ScanFile, frame: Frame, voxel_size: float) -> tuple[Scan, Cloud]:
    """Read one scan into the map frame.

    Args:
        source: The scan's file and pose.
        frame: Frame of the file's coordinates.
        voxel_size: Edge of a voxel, metres; bounds how far from the origin a point may lie.

    Returns:
        The scan, and the cloud it came from with all its attributes.

    Raises:
        InputError: There is no pose, the file is damaged, or its coordinates are too large for the
            map.
    """
    if source.lost:
        remedy = "add it, or give --on-error skip"
        raise InputError(source.path, f"no pose: {source.lost}", "one for every scan", remedy)
    cloud = read_cloud(source.path)
    with np.errstate(over="ignore", invalid="ignore"):
        if frame == "sensor":
            xyz_map = to_map_frame(cloud.xyz, source.pose)
        else:
            xyz_map = cloud.xyz.astype(np.float32, copy=False)
        largest = np.abs(xyz_map).max()

    # what the voxel map and float32 can hold
    limit = min(MAX_COORDINATE, (MAX_VOXEL - 16) * voxel_size)
    if not largest < limit:
        found = f"coordinates up to {largest:.6g} m"
        raise InputError(source.path, found, f"less than {limit:.6g} m from the origin", _TOO_FAR)
    return Scan(xyz_map, cloud.rgb, source.pose, source.path.name), cloud
