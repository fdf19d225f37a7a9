"""Poses in JSON: Record3D, ``transforms.json``, and a file a frame of ARKit apps and Polycam."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.pose_files.matrices import Lost, from_matrices, from_quaternions
from mcpseg_cli.formats.pose_files.text import read_text
from mcpseg_cli.formats.poses import Poses
from mcpseg_cli.formats.time_stamps import in_seconds

ENDING = ".json"
_SQUARES = ("transform_matrix", "cameraPoseARFrame", "pose", "camera_pose", "transform", "matrix")
_NAMES = ("file_path", "scan", "name", "file", "filename", "image")
_STAMPS = ("timestamp", "time", "stamp")
_POLYCAM = tuple(f"t_{row}{column}" for row in range(3) for column in range(4))
_LAST = [0.0, 0.0, 0.0, 1.0]
_CAMERA = "camera axes as ARKit has them: y up, looking along -z"
_EXPECTED = "Record3D's metadata, a transforms.json, or a list of 4 x 4 matrices"


def read_json(path: Path, text: str) -> Poses:
    """Read a document of poses.

    Args:
        path: The file, for messages.
        text: Record3D's ``metadata`` (``poses``: qx qy qz qw x y z), ``transforms.json``
            (``frames``), a list of 4 x 4 matrices, or one frame of an ARKit app.

    Raises:
        InputError: Not JSON, or none of these.
    """
    document = _parse(path, text)
    if isinstance(document, dict):
        if isinstance(document.get("poses"), list):
            return _read_record3d(path, document)
        frames = document.get("frames", [document])
        told = "frames of JSON, camera axes as the tool has them"
        return _read_frames(path, frames, told)
    return _read_frames(path, document, "matrices in JSON")


def read_frame_files(folder: Path, files: Sequence[Path]) -> Poses:
    """Read a folder with a JSON file for each frame.

    Args:
        folder: For messages.
        files: The files in order; the name of each is that of its scan.

    Raises:
        InputError: One is no frame.
    """
    frames: list[object] = []
    names = []
    for path in files:
        frame = _parse(path, read_text(path))
        if isinstance(frame, dict) and _square(frame) is not None:
            frames.append(frame)
            names.append(path.name)
    if not frames:
        raise InputError(folder, "JSON files without poses", _EXPECTED, "give the pose file")
    poses = _read_frames(folder, frames, f"{len(frames):,} frames of JSON, {_CAMERA}")
    return Poses(poses.poses, tuple(names), poses.stamps, lost=poses.lost, columns=poses.columns)


def _parse(path: Path, text: str) -> object:
    try:
        document: object = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(path, "no complete JSON", _EXPECTED, "export it again") from error
    return document


def _read_record3d(path: Path, document: dict[str, object]) -> Poses:
    """Read Record3D's list of quaternions and positions."""
    values = _array(document["poses"])
    if values is None or values.ndim != 2 or values.shape[1] != 7:
        raise InputError(path, "poses of another kind", "7 numbers each", "export it again")
    lost: Lost = {row: f"no numbers in pose {row}" for row in _not_finite(values)}
    numbers = list(range(len(values)))
    poses = from_quaternions(path, numbers, values[:, 4:7], values[:, :4], lost)
    stamps = _array(document.get("frameTimestamps"))
    if stamps is not None and stamps.shape != (len(values),):
        stamps = None
    told = f"Record3D: qx qy qz qw x y z, {_CAMERA}"
    return Poses(poses, stamps=stamps, ids=np.arange(len(values)), lost=lost, columns=told)


def _read_frames(path: Path, frames: object, told: str) -> Poses:
    """Read a list of frames, each with a matrix and perhaps a name and a time."""
    if not isinstance(frames, list) or not frames:
        raise InputError(path, "JSON without poses", _EXPECTED, "give the pose file")
    squares = [_square(frame) for frame in frames]
    number = next((n for n, square in enumerate(squares) if square is None), None)
    if number is not None:
        raise InputError(path, f"no 4 x 4 matrix in frame {number}", _EXPECTED, "export it again")
    rows = np.array([square for square in squares if square is not None])
    lost: Lost = {row: f"no numbers in frame {row}" for row in _not_finite(rows)}
    rows[list(lost)] = np.nan
    poses = from_matrices(path, list(range(len(rows))), rows, lost)

    named = [frame if isinstance(frame, dict) else {} for frame in frames]
    names = _column(named, _NAMES)
    stamps = _array(_column(named, _STAMPS))
    stamps = None if stamps is None else in_seconds(stamps)
    scans = tuple(map(str, names)) if names and len({*map(str, names)}) == len(names) else None
    return Poses(poses, scans, stamps, lost=lost, columns=told)


def _square(frame: object) -> NDArray[np.float64] | None:
    """Find the first three rows of a frame's matrix, (12,); None where there is none."""
    if isinstance(frame, dict):
        if all(name in frame for name in _POLYCAM):
            return _array([frame[name] for name in _POLYCAM])
        frame = next((frame[name] for name in _SQUARES if name in frame), None)
    values = _array(frame)
    if values is None or values.size not in (12, 16):
        return None
    flat = values.ravel()
    if values.ndim == 1 and values.size == 16 and flat[12:].tolist() != _LAST:
        flat = flat.reshape(4, 4).T.ravel()  # column by column, as graphics has it
    return flat[:12] if values.size == 12 or flat[12:].tolist() == _LAST else None


def _array(value: object) -> NDArray[np.float64] | None:
    """Make an array of numbers; None of anything else."""
    if value is None:
        return None
    try:
        return np.array(value, np.float64)
    except (ValueError, TypeError, OverflowError):
        return None


def _not_finite(rows: NDArray[np.float64]) -> list[int]:
    found: list[int] = np.flatnonzero(~np.isfinite(rows).all(axis=1)).tolist()
    return found


def _column(frames: list[dict[str, object]], names: Sequence[str]) -> list[object] | None:
    """Collect what all frames have under one of some names."""
    for name in names:
        if all(name in frame for frame in frames):
            return [frame[name] for frame in frames]
    return None
