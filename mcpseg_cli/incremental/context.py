"""Network input (III-B): centre points around the robot, context points around each centre."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.config import NUM_FEATURES

Colour = NDArray[np.uint8] | NDArray[np.float32]
"""Colours in 0-255; fractions where training has changed them."""


def network_input(
    xyz: NDArray[np.float32], rgb: Colour, position: NDArray[np.float64], floor: float
) -> NDArray[np.float32]:
    """Centre points on the robot and scale their colour.

    Args:
        xyz: (M, 3) float32, metres, map frame.
        rgb: (M, 3) uint8, or float32 in 0-255.
        position: (3,) float64 robot position, metres, map frame; only x and y are used.
        floor: Height of the floor, metres, map frame.

    Returns:
        (M, 6) float32: x and y from the robot, z from the floor, colour / 255 - 0.5.
    """
    centre = np.empty((len(xyz), NUM_FEATURES), np.float32)
    centre[:, :3] = xyz - np.array([position[0], position[1], floor])
    centre[:, 3:] = rgb / np.float32(255) - np.float32(0.5)
    return centre


def context_input(
    ids: NDArray[np.int32], sample: NDArray[np.int32], xyz: NDArray[np.float32], rgb: Colour
) -> NDArray[np.float32]:
    """Gather context points relative to their centres, position and colour alike.

    Args:
        ids: (M,) int32 voxel ids of the centres.
        sample: (M, K) int32 voxel ids of their context points.
        xyz: (V, 3) float32, metres, map frame: all voxels.
        rgb: (V, 3) uint8, or float32 in 0-255: all voxels.

    Returns:
        (M, K, 6) float32.
    """
    context = np.empty((*sample.shape, NUM_FEATURES), np.float32)
    _gather_relative(ids, sample, xyz, rgb, context)
    return context


@njit(cache=True, nogil=True)
def _gather_relative(
    ids: NDArray[np.int32],
    sample: NDArray[np.int32],
    xyz: NDArray[np.float32],
    rgb: Colour,
    context: NDArray[np.float32],
) -> None:
    scale = np.float32(1 / 255)
    for i in range(sample.shape[0]):
        centre = ids[i]
        for k in range(sample.shape[1]):
            point = sample[i, k]
            for axis in range(3):
                context[i, k, axis] = xyz[point, axis] - xyz[centre, axis]
                difference = np.float32(rgb[point, axis]) - np.float32(rgb[centre, axis])
                context[i, k, 3 + axis] = difference * scale
