"""KITTI: poses of the camera, which a ``calib.txt`` makes those of the lidar."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.pose_files.matrices import are_rigid
from mcpseg_cli.formats.pose_files.text import read_text
from mcpseg_cli.formats.poses import Poses

_NAMES = ("Tr", "Tr_velo_to_cam", "Tr_velo_cam")


def to_lidar(poses: Poses, path: Path, scans: Path | None) -> Poses:
    """Turn poses of the camera into those of the lidar, where a calibration ties the two.

    Args:
        poses: Camera to first camera.
        path: The pose file; ``calib.txt`` may lie beside it.
        scans: Folder of the scans; or beside that.

    Returns:
        Lidar to first lidar; as they are where there is no calibration.

    Raises:
        InputError: A ``calib.txt`` is there and says nothing of the lidar.
    """
    calibration = next((one for one in _places(path, scans) if one.is_file()), None)
    if calibration is None:
        return poses
    to_camera = _read(calibration)
    moved = np.linalg.inv(to_camera) @ poses.poses @ to_camera
    told = f"KITTI, of the camera, made the lidar's by {calibration.name}"
    return replace(poses, poses=moved, columns=told)


def _places(path: Path, scans: Path | None) -> list[Path]:
    """List where the calibration of a sequence may lie: with poses, with scans, in sequences/."""
    folders = [path.parent, path.parent.parent / "sequences" / path.stem]
    if scans is not None:
        folders[1:1] = [scans, scans.absolute().parent]
    return [folder / "calib.txt" for folder in folders]


def _read(path: Path) -> NDArray[np.float64]:
    """Read lidar to camera, (4, 4)."""
    found: dict[str, NDArray[np.float64]] = {}
    for line in read_text(path).splitlines():
        name, _, rest = line.partition(":")
        try:
            found[name.strip()] = np.array(re.split(r"[\s,;]+", rest.strip()), np.float64)
        except ValueError:
            continue
    row = next((found[name] for name in _NAMES if name in found), None)
    if row is None or row.shape != (12,) or not are_rigid(row[None])[0]:
        lines = f"lines {', '.join(found)[:80]}" if found else "no calibration"
        remedy = "add it, or move the file away if the poses are the lidar's"
        raise InputError(path, lines, "Tr: and 12 numbers, lidar to camera", remedy)
    matrix = np.eye(4)
    matrix[:3] = row.reshape(3, 4)
    return matrix
