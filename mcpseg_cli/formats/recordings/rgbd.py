"""Folders of depth images with their poses, as datasets and apps lay them out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.natural_order import natural_key
from mcpseg_cli.formats.recordings.depth_frames import Camera, DepthFrame, Layout
from mcpseg_cli.formats.rigid import check_rotations
from mcpseg_cli.formats.scan_source import Recording

_MM = 1000.0
_KINECT_DEPTH, _KINECT_COLOUR = Camera(585, 585, 320, 240), Camera(525, 525, 320, 240)
_COLOURS = ("color", "colour", "rgb", "image", "images")
_POSES = ("pose", "poses")
_INTRINSICS = (
    "intrinsic/intrinsic_depth.txt",
    "intrinsic_depth.txt",
    "intrinsics_depth.txt",
    "intrinsics.txt",
    "intrinsic.txt",
    "camera.txt",
    "camera-intrinsics.txt",
    "K.txt",
)


def open_rgbd(path: Path) -> Recording | None:
    """Open a folder of depth images; None where it is none.

    Args:
        path: The folder.

    Raises:
        InputError: It looks like one but something is missing or damaged.
        OSError: A file cannot be opened.
    """
    from mcpseg_cli.formats.recordings import phone, tum_rgbd

    if any(path.glob("frame-*.depth.png")):
        return _seven_scenes(path)
    if (path / "odometry.csv").is_file() and (path / "depth").is_dir():
        return phone.open_stray(path)
    if any((path / name).is_file() for name in ("metadata", "metadata.json")):
        return phone.open_record3d(path)
    if (path / "depth.txt").is_file() and (path / "depth").is_dir():
        return tum_rgbd.open_tum(path)
    if (path / "depth").is_dir() and any((path / name).is_dir() for name in _POSES):
        return _scannet(path)
    return None


def _scannet(path: Path) -> Recording:
    """Open ``depth/``, ``pose/`` and ``color/`` of ScanNet's export: millimetres."""
    depths = images_of(path / "depth")
    poses = {file.stem: file for name in _POSES for file in (path / name).glob("*.txt")}
    colours = colours_of(path)
    camera, described_by = read_intrinsics(path)
    colour_camera = camera
    for colour in (path / "intrinsic/intrinsic_color.txt", path / "intrinsic_color.txt"):
        if colour.is_file():
            colour_camera, described_by = _camera(colour), (*described_by, colour)

    layout = Layout(camera, colour_camera, _MM, described_by)
    frames = []
    for file in depths:
        pose = read_pose(poses[file.stem]) if file.stem in poses else None
        colour_image = colours.get(file.stem)
        frames.append(DepthFrame(f"{file.stem}.ply", file, pose, layout, None, colour_image))
    return Recording(path, "RGB-D folder (ScanNet)", tuple(frames))


def _seven_scenes(path: Path) -> Recording:
    """Open a sequence of 7-Scenes, whose Kinect's intrinsics are known: millimetres."""
    layout = Layout(_KINECT_DEPTH, _KINECT_COLOUR, _MM)
    note = "intrinsics: 7-Scenes' own"
    if own := _intrinsics_file(path):
        layout, note = Layout(_camera(own), _camera(own), _MM, (own,)), f"intrinsics: {own.name}"

    frames = []
    for file in sorted(path.glob("frame-*.depth.png"), key=lambda one: natural_key(one.name)):
        stem = file.name.removesuffix(".depth.png")
        pose_file, colour = path / f"{stem}.pose.txt", path / f"{stem}.color.png"
        pose = read_pose(pose_file) if pose_file.is_file() else None
        shown = colour if colour.is_file() else None
        frames.append(DepthFrame(f"{stem}.ply", file, pose, layout, None, shown))
    return Recording(path, "RGB-D folder (7-Scenes)", tuple(frames), (note,))


def images_of(folder: Path) -> Sequence[Path]:
    """List the depth images of a folder in natural order.

    Raises:
        InputError: There are none that can be read.
    """
    files = sorted(folder.iterdir(), key=lambda path: natural_key(path.name))
    images = [path for path in files if path.suffix.lower() in (".png", ".npy")]
    if not images:
        endings = sorted({path.suffix for path in files}) or ["nothing"]
        found = f"no depth images, but {', '.join(endings)[:60]}"
        raise InputError(folder, found, "16-bit PNG or NPY", "export or convert them")
    return [path for path in images if path.name[0] != "."]


def colours_of(path: Path) -> dict[str, Path]:
    """List the colour images of a recording by their names without ending."""
    folders = [path / name for name in _COLOURS if (path / name).is_dir()]
    return {
        file.stem: file
        for folder in folders[:1]
        for file in folder.iterdir()
        if file.suffix.lower() in (".png", ".jpg", ".jpeg")
    }


def read_intrinsics(path: Path) -> tuple[Camera, tuple[Path, ...]]:
    """Read the intrinsics of the depth images of a recording, and say from which file.

    Raises:
        InputError: There are none.
    """
    file = _intrinsics_file(path)
    if file is None:
        remedy = f"write fx fy cx cy into {path / 'intrinsics.txt'}"
        raise InputError(path, "depth images without intrinsics", " or ".join(_INTRINSICS), remedy)
    return _camera(file), (file,)


def _intrinsics_file(path: Path) -> Path | None:
    return next((path / name for name in _INTRINSICS if (path / name).is_file()), None)


def _camera(path: Path) -> Camera:
    """Read fx fy cx cy, or a matrix of 3 x 3 or 4 x 4."""
    numbers = read_numbers(path)
    side = {9: 3, 16: 4}.get(len(numbers))
    if side is not None:
        return Camera.of(numbers.reshape(side, side))
    if len(numbers) == 4:
        return Camera(*numbers.tolist())
    found, expected = f"{len(numbers)} numbers", "fx fy cx cy, or a 3 x 3 or 4 x 4 matrix"
    raise InputError(path, found, expected, "mend it")


def read_pose(path: Path) -> NDArray[np.float64] | None:
    """Read a pose of 4 x 4 numbers; None where tracking was lost, which is written as -inf.

    Raises:
        InputError: It is no pose.
        OSError: It cannot be opened.
    """
    numbers = read_numbers(path)
    if len(numbers) not in (12, 16):
        found = f"{len(numbers)} numbers"
        raise InputError(path, found, "a pose of 4 x 4", "export it again")
    if not np.isfinite(numbers).all():
        return None
    pose = np.eye(4)
    pose[: len(numbers) // 4] = numbers.reshape(-1, 4)
    check_rotations(path, pose[None], lambda _: "it")
    return pose


def read_numbers(path: Path) -> NDArray[np.float64]:
    """Read all numbers of a text file, parted by spaces or commas.

    Raises:
        InputError: It has other words.
        OSError: It cannot be opened.
    """
    words = path.read_bytes().decode("utf-8-sig", "replace").replace(",", " ").split()
    try:
        return np.array([float(word) for word in words])
    except ValueError as error:
        found = f"{str(error).rpartition(':')[2].strip()[:40]} among the numbers"
        raise InputError(path, found, "numbers only", "export it again") from error
