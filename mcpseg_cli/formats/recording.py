"""A recording, whatever holds it: scans in order, paired with their poses, read one by one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Frame, OnError
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import Cloud
from mcpseg_cli.formats.intake import Intake, take_points
from mcpseg_cli.formats.pairing import MAX_GAP_S, Pairing, pair
from mcpseg_cli.formats.pcd import pcd_pose
from mcpseg_cli.formats.poses import Poses, read_poses
from mcpseg_cli.formats.recordings import open_container
from mcpseg_cli.formats.recordings.stations import open_stations
from mcpseg_cli.formats.scan_files import STATION_SUFFIXES, ScanFile, list_clouds, list_scans
from mcpseg_cli.formats.scan_source import (
    POSES_NOTE,
    Recording,
    ScanSource,
    TopicChoice,
    check_names,
    pose_of,
)
from mcpseg_cli.grid import MAX_VOXEL
from mcpseg_cli.scan import Scan

MAX_COORDINATE = 65536.0
"""Metres from the origin at which float32 resolves no finer than 4 mm; farther is refused."""
_TOO_FAR = (
    "subtract a common offset from scans and poses (--offset auto), or convert millimetres to "
    "metres (--scale 0.001)"
)
_ANY_TOPIC = TopicChoice()


def open_recording(
    path: Path,
    poses_path: Path | None = None,
    frame: Frame = "map",
    *,
    topics: TopicChoice = _ANY_TOPIC,
    max_gap: float = MAX_GAP_S,
    on_error: OnError = "stop",
    any_distance: bool = False,
) -> Recording:
    """Find the scans of a recording and their poses; of clouds nothing but names is read yet.

    Args:
        path: Folder of scans, or of another layout; a bag, an E57 or PTX file.
        poses_path: Pose file, see ``read_poses``, instead of the poses that the recording holds.
        frame: Frame of the scans' coordinates, where their kind does not say; poses of scans in
            the sensor's frame need an orientation.
        topics: Which topics of a bag to take.
        max_gap: Seconds from a scan to the nearest pose, where they pair by time.
        on_error: ``skip``: scans may be without a pose, and poses without a scan; whoever reads
            the scans will skip those.
        any_distance: Leave it to ``place_recording`` to refuse positions that are too far out.

    Returns:
        The scans in natural order, or in order of time where their time stamps pair them.

    Raises:
        InputError: Names what is in the way: the scan without a pose, the pose without a scan,
            the two counts, a position too far out, topics to choose from.
        OSError: A file cannot be opened.
    """
    recording = list_recording(path, topics, has_pose_file=poses_path is not None)
    found_frame = recording.frame or frame
    if {source.frame for source in recording} == {None, "sensor"} and frame == "map":
        found = "scans of stations among clouds that say nothing of their frame"
        remedy = "give --frame sensor, or keep them apart"
        raise InputError(path, found, "one frame for all", remedy)

    # poses of a file of their own, else the recording's
    if poses_path is not None:
        paired = pair_with(recording, poses_path, found_frame, max_gap, any_distance=any_distance)
        if on_error == "stop":
            _check_whole(poses_path, paired)
        return paired
    if not recording.has_poses:
        recording = _with_viewpoints(recording)
    _check_own_poses(recording, on_error)
    if not any_distance:
        _check_distance(path, recording.poses)
    return recording


def list_recording(
    path: Path, topics: TopicChoice = _ANY_TOPIC, *, has_pose_file: bool = False
) -> Recording:
    """Find the scans of a recording, with the poses that it holds, if any.

    Args:
        path: As for ``open_recording``.
        topics: As for ``open_recording``.
        has_pose_file: Whether poses are given beside it, see ``open_container``.

    Raises:
        InputError: It is none, or damaged.
        OSError: A file cannot be opened.
    """
    container = open_container(path, topics, has_pose_file=has_pose_file)
    if container is None:
        container = _list_folder(path)
    check_names(path, container.scans)
    return container


def _list_folder(path: Path) -> Recording:
    """List the scans of a folder of files, each a scan or several stations."""
    # scans and their poses side by side, as mcpseg raytrace and KITTI have them
    for name in ("scans", "velodyne"):
        poses = [path / f"poses.{ending}" for ending in ("csv", "txt", "tum")]
        poses = [file for file in poses if file.is_file()]
        if (path / name).is_dir() and len(poses) == 1:
            frame: Frame = "sensor" if name == "velodyne" else "map"
            inner = _list_folder(path / name)
            paired = pair_with(inner, poses[0], frame, MAX_GAP_S, any_distance=True)
            if name == "velodyne":
                paired = paired.in_frame("sensor")
            note = f"{POSES_NOTE}{poses[0].name}, scans: {name}/"
            return replace(paired, path=path, notes=(note,))

    scans: list[ScanSource] = []
    files = list_scans(path)
    for file in files:
        if file.suffix.lower() in STATION_SUFFIXES:
            scans += open_stations(file)
        else:
            scans.append(ScanFile(file, None, path))
    endings = sorted({file.suffix.lower().lstrip(".") for file in files})
    return Recording(path, f"folder of scans ({', '.join(endings)})", tuple(scans))


def _with_viewpoints(recording: Recording) -> Recording:
    """Give scans of PCD the poses that their headers say; the first may be at the origin."""
    poses = [
        pcd_pose(source.path) if source.path.suffix.lower() == ".pcd" else None
        for source in recording
    ]
    first = next((number for number, pose in enumerate(poses) if pose is not None), None)
    if first is None:
        return recording
    if all(source.path.suffix.lower() == ".pcd" for source in recording[:first]):
        poses[:first] = [np.eye(4)] * first
    lost = "its VIEWPOINT says none"
    scans = tuple(
        source.with_pose(pose, "" if pose is not None else lost)
        for source, pose in zip(recording, poses, strict=True)
    )
    return replace(recording, scans=scans, no_poses=None, columns="VIEWPOINT of each scan")


def pair_with(
    recording: Recording,
    poses_path: Path,
    frame: Frame,
    max_gap: float,
    *,
    is_growing: bool = False,
    any_distance: bool = False,
) -> Recording:
    """Pair the scans of a recording with the poses of a file.

    Args:
        recording: Scans; poses that they have are forgotten.
        poses_path: Pose file, see ``read_poses``.
        frame: Frame of the scans' coordinates.
        max_gap: Seconds from a scan to the nearest pose, where they pair by time.
        is_growing: More scans and poses are to come.
        any_distance: Take positions that are too far out, too.

    Returns:
        The scans in the order in which they were taken; some perhaps without a pose.

    Raises:
        InputError: The poses cannot be read, lack what the frame needs, lie too far out, or
            nothing says which belongs to which scan.
        OSError: The pose file cannot be opened.
    """
    poses = read_poses(poses_path, recording.path, is_growing=is_growing)
    if frame == "sensor" and not poses.has_rotation:
        expected, remedy = "qx qy qz qw with --frame sensor", "add them, or use --frame map"
        raise InputError(poses_path, "positions only", expected, remedy)
    if not any_distance:
        _check_distance(poses_path, poses.poses)
    stamps = [source.stamp for source in recording if source.stamp is not None]
    known = np.array(stamps) if len(stamps) == len(recording) else None
    names = [source.name for source in recording]
    pairing = pair(names, known, poses, max_gap, source=poses_path, is_growing=is_growing)
    return _in_order(recording, pairing, poses)


def _in_order(recording: Recording, pairing: Pairing, poses: Poses) -> Recording:
    """Put scans in order, each with its pose."""
    scans = tuple(
        recording[scan].with_pose(
            None if scan in pairing.unpaired else pairing.poses[scan],
            pairing.unpaired.get(scan, ""),
        )
        for scan in pairing.order.tolist()
    )
    return replace(
        recording,
        scans=scans,
        notes=tuple(note for note in recording.notes if not note.startswith(POSES_NOTE)),
        no_poses=None,
        paired=pairing.how,
        columns=poses.columns,
        awaited=frozenset(recording[scan].name for scan in pairing.awaited),
        surplus=pairing.surplus,
    )


def place_recording(recording: Recording, intake: Intake, source: Path) -> Recording:
    """Return the scans of a recording with their poses in the map's frame.

    Args:
        recording: The scans as they were opened.
        intake: How coordinates are taken.
        source: Where the poses are from, for the message.

    Raises:
        InputError: A position is too far out.
    """
    scans = tuple(place_scan(scan, intake) for scan in recording)
    placed = replace(recording, scans=scans)
    _check_distance(source, placed.poses)
    return placed


def place_scan(source: ScanSource, intake: Intake) -> ScanSource:
    """Return a scan with its pose, if it has one, in the map's frame."""
    if source.pose is None:
        return source
    return source.with_pose(intake.place_pose(source.pose))


def _check_whole(poses_path: Path, recording: Recording) -> None:
    """Refuse scans without a pose and poses without a scan."""
    lost = next((source for source in recording if source.pose is None), None)
    if lost is not None:
        found, remedy = f"no pose for scan {lost.name}: {lost.lost}", "add it or remove the scan"
        by_time = ", or raise --max-time-gap" if recording.paired.startswith("by time") else ""
        remedy += f"{by_time}, or give --on-error skip"
        raise InputError(poses_path, found, "a pose for every scan", remedy)
    if recording.surplus:
        found = f"a pose for {recording.surplus[0]}, which is not among the scans"
        remedy = "remove the row, or give --on-error skip"
        raise InputError(poses_path, found, "a scan for every row", remedy)


def _check_distance(path: Path, poses: NDArray[np.float64]) -> None:
    """Refuse positions that float32 cannot hold well."""
    farthest = np.nanmax(np.abs(poses[:, :3, 3]), initial=0)
    if farthest >= MAX_COORDINATE:
        found, expected = f"positions up to {farthest:.6g} m", f"less than {MAX_COORDINATE:.6g} m"
        raise InputError(path, found, expected, _TOO_FAR)


def _check_own_poses(recording: Recording, on_error: OnError) -> None:
    """Refuse a recording without poses, or without some unless these scans are skipped."""
    missing = [source for source in recording if source.pose is None]
    if recording.no_poses is not None:
        raise recording.no_poses
    if len(missing) == len(recording):
        expected = "a pose file after the recording"
        remedy = f"give it: {recording.path.name} POSES"
        raise InputError(recording.path, f"{recording.kind}, without poses", expected, remedy)
    if on_error == "stop" and recording.surplus:
        _check_whole(recording.path, recording)
    if missing and on_error != "skip":
        found = f"no pose for {len(missing):,} of {len(recording):,} scans, as {missing[0].name}"
        remedy = "give --on-error skip to leave these out"
        raise InputError(recording.path, found, "a pose for every scan", remedy)


def read_scan(source: ScanSource, frame: Frame | Intake, voxel_size: float) -> tuple[Scan, Cloud]:
    """Read one scan into the map frame.

    Args:
        source: The scan, with its pose, which is in the map's frame.
        frame: Frame of its coordinates, where its kind does not say, or all there is to say about
            taking them.
        voxel_size: Edge of a voxel, metres; bounds how far from the origin a point may lie.

    Returns:
        The scan with all points that are measured, and the cloud it came from with all its points
        and attributes.

    Raises:
        InputError: The scan is damaged or without a pose, or its coordinates are too large for the
            map.
    """
    pose = pose_of(source)
    intake = frame if isinstance(frame, Intake) else Intake(frame)
    intake = replace(intake, frame=source.frame or intake.frame)
    xyz_map, cloud = take_points(source.read(), pose, intake, source.path)
    largest = np.abs(xyz_map).max()

    # what the voxel map and float32 can hold
    limit = min(MAX_COORDINATE, (MAX_VOXEL - 16) * voxel_size)
    if not largest < limit:
        found = f"coordinates up to {largest:.6g} m"
        raise InputError(source.path, found, f"less than {limit:.6g} m from the origin", _TOO_FAR)
    rgb = cloud.measured().colour(intake.colour, source.path)
    return Scan(xyz_map, rgb, pose, source.name), cloud


__all__ = [
    "MAX_COORDINATE",
    "Recording",
    "ScanFile",
    "ScanSource",
    "TopicChoice",
    "list_clouds",
    "list_recording",
    "list_scans",
    "open_recording",
    "read_scan",
]
