"""How a recording's coordinates become metres of the map: unit, up axis, offset, frame, colour."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import ColourUnit, Frame, UpAxis
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.cloud import Cloud
from mcpseg_cli.scan import to_map_frame

_AT_SENSOR = 1e-3  # metres: nothing is seen this near

_NOWHERE = (0.0, 0.0, 0.0)
_TURNS: dict[UpAxis, tuple[tuple[int, int, int], ...]] = {  # rows: x, y and z of the map
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "x": ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
    "-x": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
}


@dataclass(frozen=True)
class Intake:
    """How the coordinates and colours of a recording are taken.

    Attributes:
        frame: Frame of the scans' coordinates.
        up: Which of the recording's axes points up.
        scale: Metres in a unit of the scans.
        pose_scale: Metres in a unit of the poses; None: as of the scans.
        offset: What is subtracted from coordinates, in the recording's axes and unit.
        colour: Unit of the colours; None: each scan's is told from it alone.
    """

    frame: Frame = "map"
    up: UpAxis = "z"
    scale: float = 1.0
    pose_scale: float | None = None
    offset: tuple[float, float, float] = _NOWHERE
    colour: ColourUnit | None = None

    @classmethod
    def of(cls, configuration: Mapping[str, object]) -> Intake:
        """Return how a run took its recording, by its configuration; what it lacks is default."""
        known = {name: configuration[name] for name in cls.__annotations__ if name in configuration}
        if isinstance(offset := known.get("offset"), Sequence):
            known["offset"] = tuple(offset)
        return cls(**known)  # type: ignore[arg-type]

    def as_settings(self) -> dict[str, object]:
        """Give what is not default, by name, for the configuration of a run."""
        default = Intake()
        named = {name: getattr(self, name) for name in Intake.__annotations__}
        return {name: value for name, value in named.items() if value != getattr(default, name)}

    @property
    def is_plain(self) -> bool:
        """Whether coordinates are metres of the map as they are."""
        places = (self.up, self.scale, self.pose_scale or self.scale, self.offset)
        return places == ("z", 1.0, 1.0, _NOWHERE)

    def describe(self) -> str:
        """Say how coordinates are taken, where not as they are."""
        parts = [f"{self.up} up"] * (self.up != "z")
        parts += [f"{self.scale:g} m in a unit"] * (self.scale != 1.0)
        if self.pose_scale not in (None, self.scale):
            parts.append(f"{self.pose_scale:g} m in a unit of the poses")
        if any(self.offset):
            parts.append(f"less {', '.join(f'{value:.15g}' for value in self.offset)}")
        return ", ".join(parts)

    @property
    def turn(self) -> NDArray[np.float64]:
        """(3, 3) rotation from the recording's axes to the map's."""
        return np.array(_TURNS[self.up], np.float64)

    @property
    def offset_metres(self) -> NDArray[np.float64]:
        """(3,) the offset in metres, in the map's axes: add it to the map for where it lies."""
        world = self.scale if self.frame == "map" else self._pose_scale
        place: NDArray[np.float64] = self.turn @ (world * np.array(self.offset))
        return place

    @property
    def _pose_scale(self) -> float:
        return self.scale if self.pose_scale is None else self.pose_scale

    def place_pose(self, pose: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return a pose of the recording, (4, 4), sensor to the recording's frame, in the map's."""
        if self.is_plain:
            return pose
        placed = np.eye(4)
        placed[:3, :3] = self.turn @ pose[:3, :3]
        placed[:3, 3] = self._pose_scale * (self.turn @ pose[:3, 3]) - self.offset_metres
        return placed

    def place_points(
        self, xyz: NDArray[np.floating], pose: NDArray[np.float64] | None = None
    ) -> NDArray[np.float32]:
        """Move points of a scan into the map's frame.

        Args:
            xyz: (N, 3) in the scan's frame and unit.
            pose: (4, 4) of the scan, in the map's frame; None for points that are in the
                recording's map frame whatever ``frame`` says.

        Returns:
            (N, 3) float32, metres, map frame; computed in float64.
        """
        if self.frame == "sensor" and pose is not None:
            return to_map_frame(xyz if self.scale == 1.0 else self.scale * xyz, pose)
        if self.is_plain:
            return xyz.astype(np.float32, copy=False)
        world = self.scale if self.frame == "map" else self._pose_scale
        metres = world * (xyz.astype(np.float64) - np.array(self.offset))
        placed: NDArray[np.float64] = metres @ self.turn.T
        return placed.astype(np.float32)

    def to_recording(self, xyz: NDArray[np.floating]) -> NDArray[np.float64]:
        """Move points of the map back to where the recording had them; a new array.

        Args:
            xyz: (N, 3) metres, map frame.

        Returns:
            (N, 3) float64 in the recording's axes and unit.
        """
        world = self.scale if self.frame == "map" else self._pose_scale
        turned: NDArray[np.float64] = xyz.astype(np.float64) @ self.turn
        turned /= world
        turned += np.array(self.offset)
        return turned


def take_points(
    cloud: Cloud, pose: NDArray[np.float64], intake: Intake, source: Path
) -> tuple[NDArray[np.float32], Cloud]:
    """Move the measured points of a scan into the map's frame.

    Args:
        cloud: As ``read_measured`` gives it.
        pose: (4, 4) float64, sensor to map, metres.
        intake: How coordinates are taken.
        source: The scan's file, for the message.

    Returns:
        (N, 3) float32, metres, map frame: the valid points; and the cloud, in which points at the
        sensor, where rays that hit nothing end, are not valid any more.

    Raises:
        InputError: All points lie at the sensor.
    """
    xyz = cloud.measured().xyz
    with np.errstate(over="ignore", invalid="ignore"):
        placed = intake.place_points(xyz, pose)
        is_hit = ~_are_at_sensor(xyz, placed, pose, intake.frame)
    if is_hit.all():
        return placed, cloud
    if not is_hit.any():
        found = f"all {len(xyz):,} points lie at the sensor"
        raise InputError(source, found, "points that rays have hit", "remove the scan")

    valid = np.zeros(len(cloud), bool)
    valid[np.flatnonzero(is_hit) if cloud.valid is None else cloud.valid.nonzero()[0][is_hit]] = (
        True
    )
    return placed[is_hit], replace(cloud, valid=valid)


def _are_at_sensor(
    xyz: NDArray[np.floating],
    placed: NDArray[np.float32],
    pose: NDArray[np.float64],
    frame: Frame,
) -> NDArray[np.bool_]:
    """Tell which points lie where rays that hit nothing end: at the sensor, or all at 0; (N,)."""
    at_origin: NDArray[np.bool_] = np.all(xyz == 0, axis=1)
    if frame == "sensor":
        return at_origin
    away = np.abs(placed - pose[:3, 3].astype(np.float32))
    at_sensor: NDArray[np.bool_] = np.all(away <= _AT_SENSOR, axis=1)
    at_sensor[at_origin] |= at_origin.sum() > 1
    return at_sensor
