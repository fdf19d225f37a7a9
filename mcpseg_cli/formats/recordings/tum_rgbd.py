"""TUM RGB-D: lists of images with their times, and poses denser than these."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import numpy as np

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.recordings.depth_frames import Camera, DepthFrame, Layout
from mcpseg_cli.formats.recordings.rgbd import read_intrinsics
from mcpseg_cli.formats.rigid import NEAREST_NS, Trajectory, from_quaternion, is_lost
from mcpseg_cli.formats.scan_source import Recording

_PER_METRE = 5000.0
_LATEST_S = 9_000_000_000  # in 64 bits of nanoseconds: the year 2255
_KNOWN = {  # of the dataset's three cameras
    "freiburg1": Camera(517.3, 516.5, 318.6, 255.3),
    "freiburg2": Camera(520.9, 521.0, 325.1, 249.7),
    "freiburg3": Camera(535.4, 539.2, 320.1, 247.6),
}


def open_tum(path: Path) -> Recording:
    """Open ``depth.txt``, ``rgb.txt`` and ``groundtruth.txt``; 5000 units are a metre.

    Args:
        path: Folder of the recording; has an intrinsics.txt, or the name of a known camera.

    Raises:
        InputError: A list is damaged, an image missing, or the intrinsics are not known.
        OSError: A file cannot be opened.
    """
    depths, colours = _images(path, "depth.txt"), _images(path, "rgb.txt")
    poses = _poses(path / "groundtruth.txt")
    layout, note = _layout(path)

    # each depth image with the nearest colour image, and the pose of its moment
    colour_times = np.array(sorted(colours), np.int64)
    frames = []
    for time_ns, file in sorted(depths.items()):
        colour = None
        if len(colour_times):
            nearest = int(colour_times[np.abs(colour_times - time_ns).argmin()])
            colour = colours[nearest] if abs(nearest - time_ns) <= NEAREST_NS else None
        pose = None if poses is None else poses.at(time_ns)
        frame = DepthFrame(f"{file.stem}.ply", file, pose, layout, time_ns / 1e9, colour)
        frames.append(frame)
    notes = (note, "poses: groundtruth.txt, by time") if poses else (note,)
    return Recording(path, "RGB-D folder (TUM)", tuple(frames), notes)


def _layout(path: Path) -> tuple[Layout, str]:
    """Find the camera: of a file, else by the dataset's name for it."""
    name = next((name for name in _KNOWN if name in path.resolve().name.lower()), None)
    try:
        camera, described_by = read_intrinsics(path)
    except InputError:
        if name is None:
            raise
        camera = _KNOWN[name]
        return Layout(camera, camera, _PER_METRE), f"intrinsics: {name}'s"
    return Layout(camera, camera, _PER_METRE, described_by), f"intrinsics: {described_by[0].name}"


def _images(path: Path, name: str) -> dict[int, Path]:
    """Read a list of times and images; nanoseconds to file."""
    if not (path / name).is_file():
        return {}
    images = {}
    for number, words in _rows(path / name):
        if len(words) != 2:
            found = f"line {number} has {len(words)} columns"
            raise InputError(path / name, found, "timestamp filename", "mend the line")
        if not words[1].isprintable():
            found = f"line {number} names {words[1][:40]!r}"
            raise InputError(path / name, found, "an image", "mend the line")
        images[_time_ns(path / name, number, words[0])] = path / words[1]
    return images


def _poses(path: Path) -> Trajectory | None:
    """Read ``timestamp tx ty tz qx qy qz qw``; None where there is no such file."""
    if not path.is_file():
        return None
    times, poses = [], []
    for number, words in _rows(path):
        try:
            values = [float(word) for word in words[1:]]
            if len(values) != 7:
                raise ValueError(f"{len(words)} columns")
        except ValueError as error:
            found, expected = f"line {number}: {error}", "timestamp tx ty tz qx qy qz qw"
            raise InputError(path, found, expected, "mend the line") from error
        if not is_lost(values[:3], values[3:]):
            times.append(_time_ns(path, number, words[0]))
            poses.append(from_quaternion(path, values[:3], values[3:], f"line {number}"))
    if not poses:
        raise InputError(path, "no poses", "a line for each", "remove it, and give a pose file")
    return Trajectory.of(np.array(times, np.int64), np.stack(poses))


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Split the lines that are no comments."""
    lines = path.read_bytes().decode("utf-8-sig", "replace").splitlines()
    rows = [(number, line.split()) for number, line in enumerate(lines, start=1)]
    return [(number, words) for number, words in rows if words and words[0][0] != "#"]


def _time_ns(path: Path, number: int, word: str) -> int:
    """Read seconds, exactly, as nanoseconds."""
    try:
        seconds = Decimal(word)
        if not abs(seconds) < _LATEST_S:
            raise ValueError(word)
        return int(seconds * 1_000_000_000)
    except (ArithmeticError, ValueError) as error:
        found = f"{word[:40]!r} in line {number}"
        raise InputError(path, found, "a time in seconds", "mend the line") from error
