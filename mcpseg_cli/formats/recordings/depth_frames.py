"""Depth images: each is a scan, unprojected by Open3D; pixels without depth are no points."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from struct import error as StructError
from warnings import catch_warnings

import numpy as np
import open3d as o3d
from numpy.typing import NDArray
from PIL import Image

from mcpseg_cli.choices import Frame
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.claims import check_claim, open_bounded
from mcpseg_cli.formats.cloud import Cloud, checked
from mcpseg_cli.formats.fingerprint import Fingerprint
from mcpseg_cli.formats.npy import read_npy
from mcpseg_cli.formats.scan_source import Placeable
from mcpseg_cli.scan import GREY

_FARTHEST = 1000.0  # metres; what Open3D cuts off beyond
_INVALID = 65535  # as some sensors write what they did not see
_PICTURES = ("PNG", "JPEG")
_BYTES_A_PIXEL = 8  # of depth, in float64
_DAMAGE = (  # what Pillow raises for damaged files
    OSError, SyntaxError, ValueError, LookupError, TypeError, EOFError, StructError,
    ArithmeticError, zlib.error,
)  # fmt: skip
_FOCAL = (0.01, 1000.0)  # of the size of an image, between which a focal length lies
_CENTRAL = (0.25, 0.75)  # shares of an image between which its principal point lies


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Attributes:
        fx: Focal length, pixels, across.
        fy: Focal length, pixels, down.
        cx: Principal point, pixels, across.
        cy: Principal point, pixels, down.
    """

    fx: float
    fy: float
    cx: float
    cy: float

    @classmethod
    def of(cls, matrix: NDArray[np.float64]) -> Camera:
        """Take it from a matrix (3, 3) or larger."""
        return cls(*(float(matrix[place]) for place in ((0, 0), (1, 1), (0, 2), (1, 2))))

    def scaled(self, share: float) -> Camera:
        """Return the camera of images of another size."""
        return Camera(self.fx * share, self.fy * share, self.cx * share, self.cy * share)


@dataclass(frozen=True)
class Layout:
    """What the frames of a recording have in common.

    Attributes:
        camera: Of the depth images.
        colour_camera: Of the colour images.
        units_per_metre: Depth of one metre.
        described_by: Files that say so: a change there is a change of every scan.
    """

    camera: Camera
    colour_camera: Camera
    units_per_metre: float
    described_by: tuple[Path, ...] = ()


@dataclass(frozen=True)
class DepthFrame(Placeable):
    """One depth image, perhaps with a colour image.

    Attributes:
        name: Name of the depth image, with .ply.
        path: The depth image: 16-bit PNG, or NPY.
        pose: (4, 4) float64, camera (z forward, y down) to map; None where it has none.
        layout: What it has in common with the others.
        stamp: When it was taken, seconds.
        colour: The colour image.
        confidence: An image that is 0 where depth is not to be trusted.
        lost: Why it has no pose, where it is known.
    """

    name: str
    path: Path
    pose: NDArray[np.float64] | None
    layout: Layout
    stamp: float | None = None
    colour: Path | None = None
    confidence: Path | None = None
    frame: Frame | None = "sensor"
    lost: str = ""

    def read(self) -> Cloud:
        """Unproject it; its points are those pixels that have a depth, row by row."""
        depth = read_depth(self.path)
        if self.confidence is not None:
            trusted = read_image(self.confidence).astype(np.float64)
            if trusted.shape != depth.shape:
                found = f"an image of {_size(trusted)} for depth of {_size(depth)}"
                raise InputError(self.confidence, found, "one size", "remove it")
            depth = np.where(trusted > 0, depth, 0)
        colour = None if self.colour is None else read_colour(self.colour)
        cloud = unproject(self.path, depth / self.layout.units_per_metre, self.layout, colour)
        return checked(self.path, cloud)

    def fingerprint(self) -> Fingerprint:
        """Take the fingerprint of its images and of what describes them."""
        return Fingerprint.of(*self._files)

    def is_still(self, kept: Fingerprint) -> bool:
        """Tell whether its images, and what describes them, are still what they were."""
        return kept.matches(*self._files)

    @cached_property
    def _files(self) -> Sequence[Path]:
        files = (self.path, self.colour, self.confidence, *self.layout.described_by)
        return [path for path in files if path is not None]


def unproject(
    path: Path, depth: NDArray[np.floating], layout: Layout, colour: NDArray[np.uint8] | None
) -> Cloud:
    """Make a cloud of a depth image.

    Args:
        path: Where it is from, for messages.
        depth: (H, W) metres along the optical axis; 0, NaN and infinity are no points.
        layout: The cameras.
        colour: (H', W', 3) colour image; points outside it are grey.

    Returns:
        The points in the camera's frame: x right, y down, z forward.

    Raises:
        InputError: The cameras are not those of the images.
    """
    height, width = depth.shape
    camera = layout.camera
    _check_camera(path, camera, depth)
    seen = np.where(np.isfinite(depth) & (depth > 0), depth, 0).astype(np.float32)
    image = o3d.geometry.Image(np.ascontiguousarray(seen))
    pinhole = o3d.camera.PinholeCameraIntrinsic(
        width, height, camera.fx, camera.fy, camera.cx, camera.cy
    )
    points = o3d.geometry.PointCloud.create_from_depth_image(
        image, pinhole, depth_scale=1.0, depth_trunc=_FARTHEST, project_valid_depth_only=True
    )
    xyz = np.asarray(points.points)
    columns: dict[str, NDArray[np.generic]] = {
        axis: xyz[:, place].astype(np.float32) for place, axis in enumerate("xyz")
    }

    # colours by where the colour camera sees the points
    if colour is not None:
        _check_camera(path, layout.colour_camera, colour)
        rgb = _colours_at(xyz, colour, layout.colour_camera)
        columns |= {name: rgb[:, place] for place, name in enumerate(("red", "green", "blue"))}
    return Cloud(columns)


def _colours_at(
    xyz: NDArray[np.float64], colour: NDArray[np.uint8], camera: Camera
) -> NDArray[np.uint8]:
    """Return the (N, 3) colours of the pixels that points fall on, grey outside the image."""
    column = np.rint(camera.fx * xyz[:, 0] / xyz[:, 2] + camera.cx).astype(np.int64)
    row = np.rint(camera.fy * xyz[:, 1] / xyz[:, 2] + camera.cy).astype(np.int64)
    height, width = colour.shape[:2]
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    rgb = np.full((len(xyz), 3), GREY, np.uint8)
    rgb[inside] = colour[row[inside], column[inside]]
    return rgb


def _check_camera(path: Path, camera: Camera, image: NDArray[np.generic]) -> None:
    """Refuse intrinsics of images of another size: their principal point is near the middle."""
    height, width = image.shape[:2]
    focal = (camera.fx / max(width, 1), camera.fy / max(height, 1))
    if not all(_FOCAL[0] < share < _FOCAL[1] for share in focal):
        found = f"a focal length of {camera.fx:g}, {camera.fy:g} in an image of {_size(image)}"
        raise InputError(path, found, "pixels", "mend the intrinsics")
    low, high = _CENTRAL
    if not (low * width < camera.cx < high * width and low * height < camera.cy < high * height):
        found = f"a principal point at {camera.cx:g}, {camera.cy:g} in an image of {_size(image)}"
        raise InputError(path, found, "it near the middle", "give the intrinsics of this size")


def _size(image: NDArray[np.generic]) -> str:
    return f"{image.shape[1]} x {image.shape[0]}"


def read_depth(path: Path) -> NDArray[np.float64]:
    """Read a depth image: (H, W) float64 in the units of its file, 0 where there is none.

    Raises:
        InputError: Damaged, or no 16-bit PNG and no NPY of numbers.
        OSError: It cannot be opened.
    """
    is_array = path.suffix.lower() == ".npy"
    depth = read_npy(path, "a depth image") if is_array else read_image(path)
    if depth.ndim != 2 or depth.dtype == np.uint8 or depth.dtype.kind not in "uif":
        found = f"an image of {depth.dtype} {depth.shape}"
        raise InputError(path, found, "depth of 16 bits in one channel", "export it again")
    with np.errstate(invalid="ignore"):  # NaN of any kind is no depth
        values: NDArray[np.float64] = depth.astype(np.float64)
    if depth.dtype == np.uint16:
        return np.where(values == _INVALID, 0, values)
    return np.where(np.isfinite(values), values, 0)


def read_colour(path: Path) -> NDArray[np.uint8]:
    """Read a colour image: (H, W, 3) uint8.

    Raises:
        InputError: Damaged.
        OSError: It cannot be opened.
    """
    return _read(path, "RGB").astype(np.uint8, copy=False)


def read_image(path: Path) -> NDArray[np.generic]:
    """Read a PNG or JPEG as it is.

    Raises:
        InputError: Damaged.
        OSError: It cannot be opened.
    """
    return _read(path, None)


def _read(path: Path, mode: str | None) -> NDArray[np.generic]:
    """Read an image through Pillow, which Open3D brings: of its own reader, damage is the end."""
    with open_bounded(path) as file, catch_warnings(action="ignore"):
        try:
            with Image.open(file, formats=_PICTURES) as image:
                claim = f"an image of {image.width:,} x {image.height:,}"
                check_claim(path, claim, image.width * image.height * _BYTES_A_PIXEL)
                return np.asarray(image if mode is None else image.convert(mode))
        except (*_DAMAGE, Image.DecompressionBombError) as error:
            found = f"no whole image ({' '.join(str(error).split())[:60]})"
            raise InputError(path, found, "a PNG or JPEG", "copy it again") from error
