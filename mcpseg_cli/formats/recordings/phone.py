"""What phones with a lidar export: Record3D and Stray Scanner; ARKit's map has y up."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.recordings.depth_frames import Camera, DepthFrame, Layout, read_depth
from mcpseg_cli.formats.recordings.rgbd import colours_of, images_of, read_numbers
from mcpseg_cli.formats.rigid import from_quaternion, is_lost
from mcpseg_cli.formats.scan_source import Recording

_MM = 1000.0
_WIDEST = 1e6  # pixels
_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # from y up
_FORWARD = np.diag([1.0, -1.0, -1.0, 1.0])  # from ARKit's camera, which looks along -z
_STRAY_WIDTH = 1920  # pixels that Stray Scanner's intrinsics are for
_NOTE = "ARKit's map, y up, turned to z up"


def open_record3d(path: Path) -> Recording | None:
    """Open a Record3D export whose depth was written as 16-bit PNG or NPY: millimetres.

    Args:
        path: Folder with ``metadata`` or ``metadata.json``, ``depth/`` and perhaps ``rgb/``.

    Returns:
        None where the metadata are not Record3D's.

    Raises:
        InputError: Depth is in the app's own compression, or does not go with the poses.
        OSError: A file cannot be opened.
    """
    file = next(path / name for name in ("metadata", "metadata.json") if (path / name).is_file())
    try:
        facts = json.loads(file.read_bytes())
    except (ValueError, RecursionError):
        return None
    if not isinstance(facts, dict) or not {"poses", "K"} <= set(facts):
        return None
    if not (path / "depth").is_dir():
        found = "Record3D's own depth files (LZFSE)" if (path / "rgbd").is_dir() else "no depth/"
        remedy = "convert them to 16-bit PNG, millimetres, in depth/"
        raise InputError(path, found, "depth images in depth/", remedy)

    depths, colours = images_of(path / "depth"), colours_of(path)
    poses, matrix, width = _facts(file, facts)
    if len(poses) != len(depths):
        found = f"{len(poses):,} poses for {len(depths):,} depth images"
        raise InputError(file, found, "as many", "export it again")
    colour_camera = Camera.of(matrix)
    camera = colour_camera.scaled(read_depth(depths[0]).shape[1] / width)
    layout = Layout(camera, colour_camera, _MM, (file,))
    frames = tuple(
        DepthFrame(f"{depth.stem}.ply", depth, pose, layout, None, colours.get(depth.stem))
        for depth, pose in zip(depths, poses, strict=True)
    )
    return Recording(path, "RGB-D folder (Record3D)", frames, (_NOTE,))


def _facts(
    file: Path, facts: dict[str, object]
) -> tuple[list[NDArray[np.float64] | None], NDArray[np.float64], float]:
    """Take poses, None where tracking was lost; the colour camera's matrix (3, 3) and width."""
    try:
        rows = np.array(facts["poses"], np.float64).reshape(-1, 7)
        matrix = np.array(facts["K"], np.float64).reshape(3, 3).T
        width = float(str(facts["w"])) if "w" in facts else 2 * matrix[0, 2]
        if not 0 < width < _WIDEST:
            raise ValueError(f"an image {width:g} pixels wide")
    except (ValueError, TypeError, OverflowError) as error:
        found = f"poses or K that are none ({error})"
        raise InputError(file, found, "7 numbers a pose, 9 of K", "export again") from error
    poses = [
        None
        if is_lost(row[4:].tolist(), row[:4].tolist())
        else _Z_UP
        @ from_quaternion(file, row[4:].tolist(), row[:4].tolist(), f"pose {number}")
        @ _FORWARD
        for number, row in enumerate(rows)
    ]
    return poses, matrix, width


def open_stray(path: Path) -> Recording:
    """Open a Stray Scanner recording: millimetres; its colours are a video, which is not read.

    Args:
        path: Folder with ``odometry.csv``, ``camera_matrix.csv``, ``depth/``, perhaps
            ``confidence/`` (depth of confidence 0 is dropped) and ``rgb/``.

    Raises:
        InputError: A file is missing or damaged.
        OSError: A file cannot be opened.
    """
    file, matrix_file = path / "odometry.csv", path / "camera_matrix.csv"
    if not matrix_file.is_file():
        raise InputError(path, "no camera_matrix.csv", "the camera's intrinsics", "export it again")
    numbers = read_numbers(matrix_file)
    if len(numbers) != 9:
        raise InputError(matrix_file, f"{len(numbers)} numbers", "3 x 3", "export it again")

    depths, colours, poses = images_of(path / "depth"), colours_of(path), _odometry(file)
    colour_camera = Camera.of(numbers.reshape(3, 3))
    camera = colour_camera.scaled(read_depth(depths[0]).shape[1] / _STRAY_WIDTH)
    layout = Layout(camera, colour_camera, _MM, (matrix_file,))
    frames = []
    for depth in depths:
        stamp, pose = poses.get(depth.stem, (None, None))
        trusted = path / "confidence" / f"{depth.stem}.png"
        frames.append(
            DepthFrame(
                f"{depth.stem}.ply", depth, pose, layout, stamp, colours.get(depth.stem),
                trusted if trusted.is_file() else None,
            )
        )  # fmt: skip
    notes = [_NOTE, "depth of confidence 0 dropped"]
    if not colours and (path / "rgb.mp4").exists():
        notes.append("no colours: rgb.mp4 is a video; frames in rgb/ would be used")
    return Recording(path, "RGB-D folder (Stray Scanner)", tuple(frames), tuple(notes))


def _odometry(file: Path) -> dict[str, tuple[float | None, NDArray[np.float64]]]:
    """Read time and pose by frame; rows without a frame's name are counted."""
    with file.open(newline="", encoding="utf-8-sig", errors="replace") as text:
        rows = list(csv.DictReader(text, skipinitialspace=True))
    poses = {}
    for number, row in enumerate(rows):
        try:
            position = [float(row[name]) for name in ("x", "y", "z")]
            quaternion = [float(row[name]) for name in ("qx", "qy", "qz", "qw")]
            stamp = float(row["timestamp"]) if "timestamp" in row else None
        except (KeyError, TypeError, ValueError) as error:
            found = f"line {number + 2}: {error}"
            raise InputError(file, found, "timestamp, frame, x … qw", "export again") from error
        if not is_lost(position, quaternion):
            pose = from_quaternion(file, position, quaternion, f"line {number + 2}")
            poses[(row.get("frame") or f"{number:06d}").strip()] = (stamp, _Z_UP @ pose)
    return poses
