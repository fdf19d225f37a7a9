"""The one rounding rule: which voxel a coordinate falls into."""

import numpy as np
from numpy.typing import NDArray

MAX_VOXEL = 1 << 22
"""Voxel indices lie in [-MAX_VOXEL, MAX_VOXEL): three of them pack into one 64-bit key."""


def voxel_of(xyz: NDArray[np.float32], voxel_size: float) -> NDArray[np.int32]:
    """Return the voxel of each point: the nearest multiple of ``voxel_size``, halves upwards.

    Args:
        xyz: (N, 3) float32, metres, map frame; finite and within ``MAX_VOXEL`` voxels of the
            origin.
        voxel_size: Edge of a voxel, metres.

    Returns:
        (N, 3) int32 voxel indices; empty for no points.
    """
    return np.floor(xyz.astype(np.float64) / voxel_size + 0.5).astype(np.int32)
