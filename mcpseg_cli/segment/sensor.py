"""How far from the robot to label: what serves the sensor, as its first scans show it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Frame
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.intake import Intake
from mcpseg_cli.formats.recording import ScanSource, read_scan
from mcpseg_cli.scan import Scan
from mcpseg_cli.segment.folder import kept_state

NUM_SCANS = 5
"""Scans that are looked at."""

_IN_ROOMS = 2.0  # metres: the paper's, and better than 2.5 in real rooms
_CAMERA = 3.5  # metres: beyond that, depth is too coarse to tell things apart
_LONG = 5.0  # metres: as far as networks learn to see
_LONG_REACH = 8.0  # metres, horizontally, that a tenth of a long lidar's points lie beyond
_FIELD_OF_VIEW = 120.0  # degrees across that a camera's points lie within
_RINGS = 60.0  # degrees from the lowest to the highest rays of a lidar of rings
_STRAYS = 0.01  # share of points that may lie anywhere


def guess_range(scans: Iterable[Scan]) -> tuple[float, str]:
    """Choose a range by what scans look like: the reach of their points, and the field of view.

    Args:
        scans: The first ones; empty scans say nothing.

    Returns:
        Metres, horizontally, and what that is chosen for.
    """
    seen = [scan.xyz - scan.position.astype(np.float32) for scan in scans if len(scan.xyz)]
    if not seen:
        return _IN_ROOMS, "no scan to tell the sensor by"

    # of most scans
    reach = np.median([np.percentile(np.hypot(xyz[:, 0], xyz[:, 1]), 90) for xyz in seen])
    if reach > _LONG_REACH:
        return _LONG, "a long lidar, by its reach"
    if np.median([_field_of_view(xyz) for xyz in seen]) < _FIELD_OF_VIEW:
        return _CAMERA, "a depth camera, by its field of view"
    if np.median([_elevations(xyz) for xyz in seen]) < _RINGS:
        return _LONG, "a lidar of rings, by its narrow band of elevations"
    return _IN_ROOMS, "a scanner that sees all around, in rooms"


def first_scans(
    recording: Sequence[ScanSource], frame: Frame | Intake, voxel_size: float
) -> Iterator[Scan]:
    """Read the first scans, one in memory at a time; what cannot be read is passed over.

    Args:
        recording: The scans in order; no more than the first few are touched.
        frame: Frame of the files' coordinates, or all there is to say about taking them.
        voxel_size: Edge of a voxel, metres.
    """
    for source in recording[:NUM_SCANS]:
        try:
            scan, _ = read_scan(source, frame, voxel_size)
        except (InputError, OSError):
            continue  # the run itself says so when it comes to it
        yield scan


def range_in(configuration: Mapping[str, object]) -> float | None:
    """Return the range of a run by its configuration; None where it has none."""
    value = configuration.get("local_range")
    return float(value) if isinstance(value, int | float) else None


def kept_configuration(output: Path) -> Mapping[str, object] | None:
    """Return what a run was begun with; None where there is no run.

    Args:
        output: Folder of the run.

    Raises:
        StateError: The checkpoint there is in use or damaged.
    """
    with kept_state(output) as state:
        return None if state is None else state.configuration()


def _elevations(xyz: NDArray[np.float32]) -> float:
    """Give the degrees of elevation that nearly all points lie in, as seen from the origin."""
    away = xyz[xyz.any(axis=1)]
    if len(away) == 0:
        return 180.0
    elevation = np.arctan2(away[:, 2], np.hypot(away[:, 0], away[:, 1]))
    lowest, highest = np.quantile(elevation, [_STRAYS / 2, 1 - _STRAYS / 2])
    return float(np.degrees(highest - lowest))


def _field_of_view(xyz: NDArray[np.float32]) -> float:
    """Give the degrees across the cone that nearly all points lie in, as seen from the origin.

    Its axis is the points' mean direction, so that a camera that looks down is one, too.
    """
    distance = np.linalg.norm(xyz, axis=1)
    direction = xyz[distance > 0] / distance[distance > 0, None]
    axis = direction.mean(axis=0, dtype=np.float64) if len(direction) else np.zeros(3)
    if not np.linalg.norm(axis) > 0:
        return 360.0
    cosine = direction @ (axis / np.linalg.norm(axis))
    return 2 * float(np.degrees(np.arccos(np.clip(np.quantile(cosine, _STRAYS), -1, 1))))
