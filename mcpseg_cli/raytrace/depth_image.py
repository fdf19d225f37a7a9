"""The image of a depth camera: its rays, its noise, and the holes in it.

Depth cameras lose what sends little of their light back (dark, shiny or grazing surfaces), and what
is thin or at an edge, where one pixel sees two depths. Holes are patches rather than grains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.special import ndtr

from mcpseg_cli.building import Building

IMAGE_SHAPE = (120, 160)
"""Rows and columns."""

_DARK = 80.0  # luminance, of 255, below which light is lost, all of it ...
_DARK_RANGE = 4.0  # ... of black at so many metres
_GRAZING = (0.3, 0.05)  # cosine to the normal: below the first some are lost, at the second all
_JUMP = 0.1  # metres of depth to the pixel beside, that make an edge
_THIN = 2  # pixels from a thing to what is behind it, on both sides, that make it thin
_LOST_AT_EDGE, _LOST_IF_THIN, _LOST_IF_SHINY = 0.5, 0.7, 0.7  # shares
_SMOOTH = (3.0, 4.0)  # pixels that noise, and holes, are smooth over
_PATCHY = 0.7  # of the holes' variance, the share that is smooth

# how many objects of a class are shiny: glass, enamel, metal, varnish
_SHINY = {
    "window": 0.9, "board": 0.4, "door": 0.1, "table": 0.15, "chair": 0.1, "bookcase": 0.05,
    "wall": 0.0, "floor": 0.0, "ceiling": 0.0, "beam": 0.0, "column": 0.0, "sofa": 0.0,
    "bed": 0.0, "curtain": 0.0, "rug": 0.0, "cabinet": 0.1, "appliance": 0.5, "sanitary": 0.7,
    "screen": 0.8,
}  # fmt: skip
_SHINY_ELSE = 0.15
_SHININESS = 3  # what else is drawn by the seed


@dataclass(frozen=True)
class DepthImage:
    """What the pixels of an image see, row after row.

    Attributes:
        depth: (R,) float64 along the optical axis, metres, infinite for nothing.
        cosine: (R,) float64 between ray and normal, 0 to 1.
        brightness: (R,) float64 luminance, 0 to 255.
        is_shiny: (R,) bool.
    """

    depth: NDArray[np.float64]
    cosine: NDArray[np.float64]
    brightness: NDArray[np.float64]
    is_shiny: NDArray[np.bool_]


def image_rays(field_deg: float) -> NDArray[np.float64]:
    """Return the rays of a pinhole camera with square pixels, row after row from the upper left.

    Args:
        field_deg: Horizontal field of view, degrees.

    Returns:
        (R, 3) float64 unit directions, sensor frame: x ahead, y left, z up.
    """
    num_rows, num_columns = IMAGE_SHAPE
    pixel = 2.0 * np.tan(np.radians(field_deg) / 2) / num_columns
    left = -pixel * (np.arange(num_columns) - (num_columns - 1) / 2)
    up = -pixel * (np.arange(num_rows) - (num_rows - 1) / 2)
    z, y = (grid.ravel() for grid in np.meshgrid(up, left, indexing="ij"))
    rays = np.stack([np.ones_like(y), y, z], axis=1)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    return rays


def draw_noise(rng: np.random.Generator, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Draw (R,) standard normal errors of an image, half of their variance smooth."""
    return _mixed(rng, shape, 0.5, _SMOOTH[0])


def find_lost(image: DepthImage, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Draw which pixels give no depth.

    Args:
        image: What the pixels see.
        rng: Decides which are lost of those that may be.

    Returns:
        (R,) bool.
    """
    # each cause by itself
    near = np.minimum(image.depth, _DARK_RANGE) / _DARK_RANGE
    dark = np.clip((_DARK - image.brightness) / _DARK, 0.0, 1.0) * near
    most, least = _GRAZING
    grazing = np.clip((most - image.cosine) / (most - least), 0.0, 1.0)
    shiny = _LOST_IF_SHINY * image.is_shiny
    edge, thin = (mark.ravel() for mark in find_edges(image.depth.reshape(IMAGE_SHAPE)))

    # patches: together, as if one did not know of the other
    kept = (1 - dark) * (1 - grazing) * (1 - shiny)
    patches = ndtr(_mixed(rng, IMAGE_SHAPE, _PATCHY, _SMOOTH[1])) < 1 - kept

    # grains
    share = np.where(thin, _LOST_IF_THIN, np.where(edge, _LOST_AT_EDGE, 0.0))
    lost: NDArray[np.bool_] = patches | (rng.random(share.shape) < share)
    return lost


def find_edges(depth: NDArray[np.float64]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Find the edges and the thin things of a depth image.

    Inverse depth is linear over a plane's pixels, however slanted it is: an edge is where it bends.

    Args:
        depth: (Y, X) float64 along the optical axis, metres, infinite for nothing.

    Returns:
        (Y, X) bool, pixels beside a jump of depth, and (Y, X) bool, those with something farther
        on both sides.
    """
    inverse = 1.0 / depth
    jump = _JUMP * inverse**2  # the same jump, in inverse depth
    edge, thin = np.zeros(depth.shape, bool), np.zeros(depth.shape, bool)
    for axis in (0, 1):
        inner = (slice(1, -1), slice(None)) if axis == 0 else (slice(None), slice(1, -1))
        edge[inner] |= np.abs(np.diff(inverse, 2, axis)) > jump[inner]
        for away in range(1, _THIN + 1):
            before, after = (_moved(inverse, step, axis) for step in (away, -away))
            thin |= (inverse - before > jump) & (inverse - after > jump)
    return edge & np.isfinite(depth), thin


def _moved(image: NDArray[np.float64], step: int, axis: int) -> NDArray[np.float64]:
    """Move an image by some pixels; what comes in repeats its border."""
    size = image.shape[axis]
    moved: NDArray[np.float64] = image.take(np.clip(np.arange(size) - step, 0, size - 1), axis)
    return moved


def _mixed(
    rng: np.random.Generator, shape: tuple[int, int], share: float, smooth: float
) -> NDArray[np.float64]:
    """Draw (R,) standard normal values, this share of their variance smooth over some pixels."""
    grains, patches = rng.normal(size=(2, *shape))
    patches = gaussian_filter(patches, smooth, mode="wrap") * 2 * np.sqrt(np.pi) * smooth
    mixed: NDArray[np.float64] = np.sqrt(1 - share) * grains + np.sqrt(share) * patches
    return mixed.ravel()


def shiny_voxels(building: Building, points: NDArray[np.int64], seed: int) -> NDArray[np.bool_]:
    """Draw which objects are shiny, by what they are: windows are, walls are not.

    Args:
        building: Classes and objects.
        points: (V,) int64 point that stands for each voxel.
        seed: Decides, with the object's number, which of a class are.

    Returns:
        (V,) bool; what is no object is not shiny.
    """
    shares = np.zeros(256)
    for number, name in enumerate(building.classes):
        shares[number] = _SHINY.get(name, _SHINY_ELSE)
    objects, place = np.unique(building.instance[points], return_inverse=True)
    draws = [
        np.random.default_rng((seed, number, _SHININESS)).random() if number > 0 else 1.0
        for number in objects.tolist()
    ]
    shiny: NDArray[np.bool_] = np.array(draws)[place] < shares[building.semantic[points]]
    return shiny
