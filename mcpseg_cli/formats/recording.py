"""A recording: a folder of scans in natural order, paired with their poses, read one by one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Frame
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import CLOUD_SUFFIXES, Cloud, read_measured
from mcpseg_cli.formats.intake import Intake, take_points
from mcpseg_cli.formats.natural_order import natural_key
from mcpseg_cli.formats.poses import PoseTable, read_poses
from mcpseg_cli.grid import MAX_VOXEL
from mcpseg_cli.scan import Scan

MAX_COORDINATE = 65536.0
"""Metres from the origin at which float32 resolves no finer than 4 mm; farther is refused."""
_TOO_FAR = (
    "subtract a common offset from scans and poses (--offset auto), or convert millimetres to "
    "metres (--scale 0.001)"
)


@dataclass(frozen=True)
class ScanFile:
    """One scan of a recording: its file and its pose, (4, 4) float64, sensor to map."""

    path: Path
    pose: NDArray[np.float64]


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


def open_recording(
    directory: Path, poses_path: Path, frame: Frame = "map", *, any_distance: bool = False
) -> list[ScanFile]:
    """Pair the scans of a folder with their poses; nothing but names and poses is read yet.

    Args:
        directory: Folder of scans.
        poses_path: Pose file; rows pair with scans by its ``scan`` column (with or without ending),
            else by order.
        frame: Frame of the scans' coordinates; poses of scans in the sensor's frame need an
            orientation.
        any_distance: Leave it to ``place_recording`` to refuse positions that are too far out.

    Returns:
        The scans in natural order.

    Raises:
        InputError: Names the scan without a pose, the pose without a scan, the two counts, or a
            position too far out.
    """
    paths = list_clouds(directory)
    table = read_poses(poses_path)

    # poses that these scans can be moved by
    if frame == "sensor" and not table.has_rotation:
        expected, remedy = "qx qy qz qw with --frame sensor", "add them, or use --frame map"
        raise InputError(poses_path, "positions only", expected, remedy)
    if not any_distance:
        _check_distance(poses_path, table.poses)

    # paired by name where the table has names, else by order
    if table.scans is not None:
        return _pair_by_name(poses_path, paths, table, table.scans)
    if len(table) != len(paths):
        found = f"{len(table):,} poses for {len(paths):,} scans in {directory}"
        raise InputError(poses_path, found, "as many", "add a scan column or the missing rows")
    return [ScanFile(path, pose) for path, pose in zip(paths, table.poses, strict=True)]


def place_recording(recording: list[ScanFile], intake: Intake, source: Path) -> list[ScanFile]:
    """Return the scans of a recording with their poses in the map's frame.

    Args:
        recording: The scans as they were opened.
        intake: How coordinates are taken.
        source: Where the poses are from, for the message.

    Raises:
        InputError: A position is too far out.
    """
    placed = [replace(scan, pose=intake.place_pose(scan.pose)) for scan in recording]
    if placed:
        _check_distance(source, np.stack([scan.pose for scan in placed]))
    return placed


def _check_distance(source: Path, poses: NDArray[np.float64]) -> None:
    """Refuse positions that float32 cannot hold well."""
    farthest = np.abs(poses[:, :3, 3]).max()
    if farthest >= MAX_COORDINATE:
        found, expected = f"positions up to {farthest:.6g} m", f"less than {MAX_COORDINATE:.6g} m"
        raise InputError(source, found, expected, _TOO_FAR)


def _pair_by_name(
    poses_path: Path, paths: list[Path], table: PoseTable, scans: tuple[str, ...]
) -> list[ScanFile]:
    """Find the pose of every scan and a scan for every pose."""
    rows = {name: row for row, name in enumerate(scans)}
    recording = []
    for path in paths:
        row = rows.pop(path.name, rows.pop(path.stem, None) if path.name not in rows else None)
        if row is None:
            found, remedy = f"no pose for scan {path.name}", "add it or remove the scan"
            raise InputError(poses_path, found, "a row for every scan", remedy)
        recording.append(ScanFile(path, table.poses[row]))

    if rows:
        found = f"a pose for {next(iter(rows))}, which is not among the scans"
        raise InputError(poses_path, found, "a scan for every row", "remove the row")
    return recording


def read_scan(source: ScanFile, frame: Frame | Intake, voxel_size: float) -> tuple[Scan, Cloud]:
    """Read one scan into the map frame.

    Args:
        source: The scan's file and pose, which is in the map's frame.
        frame: Frame of the file's coordinates, or all there is to say about taking them.
        voxel_size: Edge of a voxel, metres; bounds how far from the origin a point may lie.

    Returns:
        The scan with all points that are measured, and the cloud it came from with all its points
        and attributes.

    Raises:
        InputError: The file is damaged, or its coordinates are too large for the map.
    """
    intake = frame if isinstance(frame, Intake) else Intake(frame)
    xyz_map, cloud = take_points(read_measured(source.path), source.pose, intake, source.path)
    largest = np.abs(xyz_map).max()

    # what the voxel map and float32 can hold
    limit = min(MAX_COORDINATE, (MAX_VOXEL - 16) * voxel_size)
    if not largest < limit:
        found = f"coordinates up to {largest:.6g} m"
        raise InputError(source.path, found, f"less than {limit:.6g} m from the origin", _TOO_FAR)
    rgb = cloud.measured().colour(intake.colour, source.path)
    return Scan(xyz_map, rgb, source.pose, source.path.name), cloud
