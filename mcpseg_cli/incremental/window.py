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
_NUM_MOMENTS = 10
_FINE = 4096.0  # parts of a voxel
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
    _describe_surface(_moments(place, voxel), neighbours, inputs[:, 10:])
    return inputs


@njit(cache=True, nogil=True)
def _moments(place: NDArray[np.float32], voxel: NDArray[np.int32]) -> NDArray[np.float64]:
    """Give (V, 10) one, places and their products of (V, 3) points.

    All are counted from one origin in whole fractions of a voxel: sums of them are exact, so that
    the origin does not matter.
    """
    count = place.shape[0]
    own = np.empty((count, _NUM_MOMENTS), np.float64)
    for i in range(count):
        x, y, z = (
            np.rint(place[i, 0] * _FINE) + (voxel[i, 0] - voxel[0, 0]) * _FINE,
            np.rint(place[i, 1] * _FINE) + (voxel[i, 1] - voxel[0, 1]) * _FINE,
            np.rint(place[i, 2] * _FINE) + (voxel[i, 2] - voxel[0, 2]) * _FINE,
        )
        own[i, 0], own[i, 1], own[i, 2], own[i, 3] = 1, x, y, z
        own[i, 4], own[i, 5], own[i, 6] = x * x, y * y, z * z
        own[i, 7], own[i, 8], own[i, 9] = x * y, x * z, y * z
    return own


@njit(cache=True, nogil=True)
def _describe_surface(
    own: NDArray[np.float64], neighbours: NDArray[np.int32], shape: NDArray[np.float32]
) -> None:
    """Fill (V, 4) linearity, planarity, scattering and |normal z| from points within two voxels.

    A point counts as often as there are ways of two steps to it: nearer ones count more. So the
    moments of the neighbours, ``own`` (V, 10), are summed, and then the sums of the neighbours.
    """
    near = _add_neighbours(own, neighbours)
    moments = _add_neighbours(near, neighbours)
    for i in range(own.shape[0]):
        _move_to(own[i], moments[i])
        _shape_of(moments[i], shape[i])


@njit(cache=True, nogil=True)
def _add_neighbours(own: NDArray[np.float64], neighbours: NDArray[np.int32]) -> NDArray[np.float64]:
    """Sum (V, 10) moments over each voxel's neighbours, itself among them."""
    near = np.zeros(own.shape, np.float64)
    for i in range(own.shape[0]):
        for k in range(neighbours.shape[1]):
            j = neighbours[i, k]
            if j >= 0:
                for n in range(_NUM_MOMENTS):
                    near[i, n] += own[j, n]
    return near


@njit(cache=True, nogil=True)
def _move_to(point: NDArray[np.float64], moments: NDArray[np.float64]) -> None:
    """Count moments from a point on, in voxels; all is exact until the last division."""
    count, x, y, z = moments[0], point[1], point[2], point[3]
    of_x, of_y, of_z = moments[1], moments[2], moments[3]
    moments[4] += x * (x * count - 2 * of_x)
    moments[5] += y * (y * count - 2 * of_y)
    moments[6] += z * (z * count - 2 * of_z)
    moments[7] += x * y * count - x * of_y - y * of_x
    moments[8] += x * z * count - x * of_z - z * of_x
    moments[9] += y * z * count - y * of_z - z * of_y
    moments[1] -= x * count
    moments[2] -= y * count
    moments[3] -= z * count
    for n in range(1, _NUM_MOMENTS):
        moments[n] /= _FINE if n < 4 else _FINE * _FINE


@njit(cache=True, nogil=True)
def _shape_of(moments: NDArray[np.float64], shape: NDArray[np.float32]) -> None:
    """Turn moments into linearity, planarity, scattering (Weinmann et al., 2015) and |normal z|.

    A point alone has none of them.

    Eigenvalues in closed form (Smith, 1961); the normal is the longest cross product of two rows
    of the covariance less its least eigenvalue.
    """
    # mean and covariance
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
