"""What the sparse U-Net is told about each voxel: colour, place, looks, the surface around it.

A window is all voxels of the map within range of the robot. The inputs depend on the window's
voxels and the floor only, not on where the robot stands in it or how often it is asked.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.incremental.context import Colour

NUM_INPUTS = 14
_NEAR_FLOOR = (-0.3, 0.7)  # metres; skirtings, seats and table tops differ by centimetres
_FLAT = 1e-6  # variance, in voxels, of what is a point


def window_input(
    xyz: NDArray[np.float32],
    rgb: Colour,
    looks: NDArray[np.integer],
    voxel: NDArray[np.int32],
    neighbours: NDArray[np.int32],
    *,
    voxel_size: float,
    floor: float,
) -> NDArray[np.float32]:
    """Describe the voxels of a window.

    Args:
        xyz: (V, 3) float32, metres: the point of each voxel.
        rgb: (V, 3) uint8, or float32 in 0-255.
        looks: (V,) integer: how many scans saw each.
        voxel: (V, 3) int32 voxel indices.
        neighbours: (V, 27) int32 from ``networks.sparse.find_neighbours``.
        voxel_size: Edge of a voxel, metres.
        floor: Height of the floor, metres.

    Returns:
        (V, 14) float32: colour / 255 - 0.5; height over the floor, coarse and fine; the point's
        place in its voxel; one; looks, as a logarithm; linearity, planarity, scattering and
        the normal's upright part of the surface within two voxels.
    """
    height = xyz[:, 2] - np.float32(floor)
    place = (xyz / np.float32(voxel_size) - voxel).astype(np.float32)

    inputs = np.empty((len(xyz), NUM_INPUTS), np.float32)
    inputs[:, 0:3] = rgb / np.float32(255) - np.float32(0.5)
    inputs[:, 3] = height / 2 - np.float32(0.5)
    inputs[:, 4] = np.clip(height, *_NEAR_FLOOR)
    inputs[:, 5:8] = place
    inputs[:, 8] = 1
    inputs[:, 9] = np.log1p(looks.astype(np.float32)) / 2 - np.float32(0.5)
    _describe_surface(_moments(place), neighbours, inputs[:, 10:])
    return inputs


def _moments(place: NDArray[np.float32]) -> NDArray[np.float64]:
    """Give (V, 10) float64 one, places and their products of (V, 3) points."""
    x, y, z = place.T.astype(np.float64)
    return np.stack([np.ones(len(x)), x, y, z, x * x, y * y, z * z, x * y, x * z, y * z], axis=1)


@njit(cache=True, nogil=True)
def _describe_surface(
    own: NDArray[np.float64], neighbours: NDArray[np.int32], shape: NDArray[np.float32]
) -> None:
    """Fill (V, 4) linearity, planarity, scattering and |normal z| from points within two voxels.

    A point counts as often as there are ways of two steps to it: nearer ones count more. So the
    moments of the neighbours, ``own`` (V, 10), are summed, and then the sums of the neighbours.
    """
    count = own.shape[0]
    near = np.zeros((count, 10), np.float64)
    for i in range(count):
        for k in range(27):
            if neighbours[i, k] >= 0:
                _add_moments(own[neighbours[i, k]], k, near[i])

    moments = np.empty(10, np.float64)
    for i in range(count):
        moments[:] = 0
        for k in range(27):
            if neighbours[i, k] >= 0:
                _add_moments(near[neighbours[i, k]], k, moments)
        _shape_of(moments, shape[i])


@njit(cache=True, nogil=True)
def _add_moments(there: NDArray[np.float64], k: int, moments: NDArray[np.float64]) -> None:
    """Add the moments of neighbour ``k``, as they are from the voxel's own centre."""
    x, y, z = k // 9 - 1, k // 3 % 3 - 1, k % 3 - 1
    moments[0] += there[0]
    moments[1] += there[1] + x * there[0]
    moments[2] += there[2] + y * there[0]
    moments[3] += there[3] + z * there[0]
    moments[4] += there[4] + 2 * x * there[1] + x * x * there[0]
    moments[5] += there[5] + 2 * y * there[2] + y * y * there[0]
    moments[6] += there[6] + 2 * z * there[3] + z * z * there[0]
    moments[7] += there[7] + x * there[2] + y * there[1] + x * y * there[0]
    moments[8] += there[8] + x * there[3] + z * there[1] + x * z * there[0]
    moments[9] += there[9] + y * there[3] + z * there[2] + y * z * there[0]


@njit(cache=True, nogil=True)
def _shape_of(moments: NDArray[np.float64], shape: NDArray[np.float32]) -> None:
    """Turn moments into linearity, planarity, scattering (Weinmann et al., 2015) and |normal z|.

    A point alone has none of them.

    Eigenvalues in closed form (Smith, 1961); the normal is the longest cross product of two rows
    of the covariance less its least eigenvalue.
    """
    count = moments[0]
    x, y, z = moments[1] / count, moments[2] / count, moments[3] / count
    xx, yy, zz = moments[4] / count - x * x, moments[5] / count - y * y, moments[6] / count - z * z
    xy, xz, yz = moments[7] / count - x * y, moments[8] / count - x * z, moments[9] / count - y * z

    # eigenvalues, largest first
    mean = (xx + yy + zz) / 3
    spread = (xx - mean) ** 2 + (yy - mean) ** 2 + (zz - mean) ** 2
    spread = np.sqrt((spread + 2 * (xy * xy + xz * xz + yz * yz)) / 6) + 1e-9
    a, b, c = (xx - mean) / spread, (yy - mean) / spread, (zz - mean) / spread
    d, e, f = xy / spread, xz / spread, yz / spread
    half = (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)) / 2
    angle = np.arccos(min(1.0, max(-1.0, half))) / 3
    largest = mean + 2 * spread * np.cos(angle)
    least = mean + 2 * spread * np.cos(angle + 2 * np.pi / 3)
    middle = 3 * mean - largest - least
    if largest < _FLAT:
        shape[:] = 0
        return

    # the direction that varies least
    a, b, c = xx - least, yy - least, zz - least
    best, upright = 0.0, 0.0
    for pair in range(3):
        if pair == 0:
            nx, ny, nz = xy * yz - xz * b, xz * xy - a * yz, a * b - xy * xy
        elif pair == 1:
            nx, ny, nz = xy * c - xz * yz, xz * xz - a * c, a * yz - xy * xz
        else:
            nx, ny, nz = b * c - yz * yz, yz * xz - xy * c, xy * yz - b * xz
        length = nx * nx + ny * ny + nz * nz
        if length > best:
            best, upright = length, abs(nz) / np.sqrt(length)

    shape[0] = (largest - middle) / largest
    shape[1] = (middle - least) / largest
    shape[2] = least / largest
    shape[3] = upright
