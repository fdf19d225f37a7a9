"""What a recording is, put together: frame, unit, upwards, offset, colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import ColourUnit, Frame, UpAxis
from mcpseg_cli.examine.coincidence import Coincidence, compare_scans
from mcpseg_cli.examine.look import FIRST_SCANS, Glance, colour_unit
from mcpseg_cli.examine.structure import (
    Room,
    axis_name,
    find_room,
    flat_axis,
    turning_axis,
    upward,
    usual_range,
)
from mcpseg_cli.examine.units import Unit, find_unit
from mcpseg_cli.formats.intake import Intake
from mcpseg_cli.formats.recording import MAX_COORDINATE

_AROUND = 4_000  # points of each scan that rooms are found with
_OTHER_UNITS = (1000.0, 100.0, 0.001, 0.01)  # units of poses in one of the scans
_BESIDE = 4.0  # times a scan's size: how far a sensor is from its middle
_NEARER = 1.5  # times nearer than as it is: a unit that positions are in
_MOVES = 0.05  # of a scan's size: how far a sensor moves at least
_ROUND = 100.0  # what offsets are multiples of
_FAR = 1000.0  # metres: what lies nearer needs no offset
_COINCIDE = 0.5  # share of points, above which scans surely lie on one another


@dataclass(frozen=True)
class Examination:
    """What is found; lengths in metres where nothing else is said.

    Attributes:
        coincidence: How well scans lie on one another.
        frame: Which frame scans are in; None where it cannot be told.
        unit: Of the scans.
        pose_scale: Metres in a unit of the poses; None: as of the scans.
        up: Which axis points up; None where it cannot be told.
        up_reason: What speaks for it.
        room: Floor and ceiling as seen from the sensor.
        reach: How far most points are from the sensor.
        offset: A round place near the recording, in its axes and unit; 0, 0, 0 for one near the
            origin.
        low: (3,) lowest coordinates of what was looked at, in the recording's axes and unit.
        high: (3,) highest ones.
        colour: Unit of colours that do not say it themselves.
    """

    coincidence: Coincidence
    frame: Frame | None
    unit: Unit
    pose_scale: float | None
    up: UpAxis | None
    up_reason: str
    room: Room
    reach: float
    offset: tuple[float, float, float]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    colour: ColourUnit | None

    def intake(self, asked: Intake, own_frame: Frame | None = None) -> Intake:
        """Return how to take the recording: as it says itself, else as found, else as asked."""
        return Intake(
            frame=own_frame or self.frame or asked.frame,
            up=self.up or asked.up,
            scale=self.unit.scale,
            pose_scale=self.pose_scale,
            offset=self.offset,
            colour=self.colour,
        )


def examine(
    glances: Sequence[Glance], poses: NDArray[np.float64], asked: Frame = "map"
) -> Examination:
    """Find out what a recording is.

    Args:
        glances: Some scans, at least one with points; the first ones in a row.
        poses: (P, 4, 4) of all scans, as the pose file has them.
        asked: The frame to take where it cannot be told.
    """
    clouds = [glance.xyz for glance in glances]
    own = [glance.pose for glance in glances]
    near = slice(FIRST_SCANS)  # the others are too far apart to lie on one another
    coincidence, frame, pose_units = _find_frame(clouds[near], own[near], asked)
    assumed = frame or asked

    # points around the sensor, in the recording's axes and the scans' unit
    scaled = [_moved(pose, pose_units) for pose in own]
    placed = [
        _some(xyz) @ pose[:3, :3].T + pose[:3, 3] if assumed == "sensor" else _some(xyz)
        for xyz, pose in zip(clouds, scaled, strict=True)
    ]
    around = np.concatenate([xyz - pose[:3, 3] for xyz, pose in zip(placed, scaled, strict=True)])
    reach = usual_range(around)

    # the vertical, floor and ceiling along it, and what they say of the unit
    all_scaled = np.stack([_moved(pose, pose_units) for pose in poses])
    up, up_reason = _find_up(around, all_scaled, reach)
    room = find_room(around, Intake(up=up or "z").turn[2])
    unit = find_unit(room, reach)

    world = np.concatenate(placed)
    metres = unit.scale
    return Examination(
        coincidence=coincidence,
        frame=frame,
        unit=unit,
        pose_scale=None if pose_units == 1.0 else unit.scale * pose_units,
        up=up,
        up_reason=up_reason,
        room=Room(*(None if way is None else way * metres for way in (room.below, room.above))),
        reach=reach * metres,
        offset=_round_place(world, metres),
        low=world.min(axis=0),
        high=world.max(axis=0),
        colour=colour_unit(glances),
    )


def round_offset(
    recording_poses: NDArray[np.float64], intake: Intake
) -> tuple[float, float, float]:
    """Choose an offset for a recording: a round place near its first pose.

    Args:
        recording_poses: (P, 4, 4) as the pose file has them.
        intake: How coordinates are taken, but for the offset.
    """
    pose_scale = intake.scale if intake.pose_scale is None else intake.pose_scale
    world = intake.scale if intake.frame == "map" else pose_scale
    return _round_place(recording_poses[:1, :3, 3] * pose_scale / world, world, _FAR)


def _find_frame(
    clouds: list[NDArray[np.floating]], poses: list[NDArray[np.float64]], asked: Frame
) -> tuple[Coincidence, Frame | None, float]:
    """Find the frame of scans, and how many of their units are one of the poses'."""
    found = compare_scans(clouds, poses)
    if found.best in ("as they are", "by the poses") and found.shares[found.best] > _COINCIDE:
        frame: Frame = "map" if found.best == "as they are" else "sensor"
        return found, frame, _units_in_map(clouds, poses) if frame == "map" else 1.0

    # poses in another unit than the scans; not where scans look alike from everywhere
    in_map = _units_in_map(clouds, poses) if asked == "map" else 1.0
    if found.shares["by the poses"] > _COINCIDE:
        return found, None, in_map
    for units in _OTHER_UNITS:
        scaled = compare_scans(clouds, [_moved(pose, units) for pose in poses])
        if scaled.best is None or scaled.shares[scaled.best] <= _COINCIDE:
            continue
        if scaled.best == "by the poses":
            return scaled, "sensor", units
        if scaled.best == "as they are" and asked == "map":
            return scaled, "map", in_map
    return found, None, in_map


def _units_in_map(clouds: list[NDArray[np.floating]], poses: list[NDArray[np.float64]]) -> float:
    """Find in which unit positions lie beside their scans, which are in the map's frame."""
    middles = np.array([np.median(xyz, axis=0) for xyz in clouds])
    size = float(
        np.median([usual_range(xyz - middle) for xyz, middle in zip(clouds, middles, strict=True)])
    )
    positions = np.array([pose[:3, 3] for pose in poses])
    if size <= 0:
        return 1.0

    # how many times its size a scan is away, by the unit
    away = {
        units: float(np.median(np.linalg.norm(units * positions - middles, axis=1))) / size
        for units in (1.0, *_OTHER_UNITS)
        if units == 1.0 or units * np.ptp(positions, axis=0).max() > _MOVES * size
    }
    nearest = min(away, key=lambda units: away[units])
    is_it = away[nearest] < _BESIDE and away[1.0] > _NEARER * away[nearest]
    return nearest if is_it else 1.0


def _find_up(
    around: NDArray[np.floating], poses: NDArray[np.float64], reach: float
) -> tuple[UpAxis | None, str]:
    """Find the vertical by how the sensor moves and turns; z where nothing speaks against it."""
    flat, turned = flat_axis(poses[:, :3, 3], reach), turning_axis(poses[:, :3, :3])
    axis = turned if flat is None else flat
    if axis is None or (turned is not None and turned != flat and flat is not None):
        return None, "the sensor neither moves in a plane nor turns about an axis"
    how = "moves across" if flat is not None else "turns about"
    reason = f"the sensor {how} {'xyz'[axis]}"
    if axis == 2:  # a ceiling may be nearer than the floor
        return "z", reason
    return axis_name(axis, upward(around, axis)), reason


def _round_place(
    world: NDArray[np.floating], metres: float, least: float = MAX_COORDINATE
) -> tuple[float, float, float]:
    """Return a round place in the middle of (N, 3) points that lie far out; else 0, 0, 0."""
    middle = np.median(world, axis=0)
    if np.abs(world).max() * metres < least:
        return 0.0, 0.0, 0.0
    rounded = np.where(np.abs(middle) * metres >= _FAR, np.rint(middle / _ROUND) * _ROUND, 0.0)
    x, y, z = (float(value) for value in rounded)
    return x, y, z


def _moved(pose: NDArray[np.float64], units: float) -> NDArray[np.float64]:
    """Return a pose with its position in another unit."""
    scaled = pose.copy()
    scaled[:3, 3] *= units
    return scaled


def _some(xyz: NDArray[np.floating]) -> NDArray[np.float64]:
    return xyz[:: max(1, len(xyz) // _AROUND)].astype(np.float64)
