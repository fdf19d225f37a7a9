"""Value noise: random numbers on a lattice, blended in between; one place and seed, one value."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float32]


def fbm(
    xyz: Floats, frequency: Floats | float, seed: NDArray[np.uint32], octaves: int = 3
) -> Floats:
    """Sum noise of ever finer lattices, each half as strong (fractal Brownian motion).

    Args:
        xyz: (N, 3) float32, metres.
        frequency: (N,) or one, lattice cells a metre of the coarsest octave.
        seed: (N,) uint32, tells surfaces apart.
        octaves: How many lattices.

    Returns:
        (N,) float32, 0-1, mean near 0.5.
    """
    cells = np.broadcast_to(np.asarray(frequency, np.float32), len(xyz))
    out = np.empty(len(xyz), np.float32)
    _fbm(np.ascontiguousarray(xyz, np.float32), cells, seed, octaves, out)
    return out


def hash01(first: NDArray[np.int32], second: NDArray[np.int32], seed: NDArray[np.uint32]) -> Floats:
    """Return an (N,) float32 random number, 0-1, for each pair of cell numbers and seed."""
    out = np.empty(len(first), np.float32)
    _hash_cells(first, second, seed, out)
    return out


@njit(cache=True, inline="always")
def _lattice(x: int, y: int, z: int, seed: np.uint32) -> np.float32:
    """Return a random number, 0-1, for a lattice point (the finaliser of MurmurHash3)."""
    h = (
        np.uint32(x) * np.uint32(0x8DA6B343)
        ^ np.uint32(y) * np.uint32(0xD8163841)
        ^ np.uint32(z) * np.uint32(0xCB1AB31F)
    )
    h = np.uint32(h ^ np.uint32(seed * np.uint32(0x9E3779B1)))
    h = np.uint32((h ^ (h >> np.uint32(16))) * np.uint32(0x85EBCA6B))
    h = np.uint32((h ^ (h >> np.uint32(13))) * np.uint32(0xC2B2AE35))
    h = np.uint32(h ^ (h >> np.uint32(16)))
    return np.float32(np.float32(h >> np.uint32(8)) * np.float32(1.0 / 16777216.0))


@njit(cache=True, nogil=True)
def _hash_cells(
    first: NDArray[np.int32],
    second: NDArray[np.int32],
    seed: NDArray[np.uint32],
    out: NDArray[np.float32],
) -> None:
    """Fill in a random number for each pair of cells."""
    for row in range(len(first)):
        out[row] = _lattice(first[row], second[row], 17, seed[row])


@njit(cache=True, nogil=True)
def _fbm(
    xyz: NDArray[np.float32],
    frequency: NDArray[np.float32],
    seed: NDArray[np.uint32],
    octaves: int,
    out: NDArray[np.float32],
) -> None:
    """Sum the octaves at every point."""
    for row in range(len(xyz)):
        total, weight, size, cells = 0.0, 1.0, 0.0, float(frequency[row])
        for octave in range(octaves):
            total += weight * _noise(
                xyz[row, 0] * cells, xyz[row, 1] * cells, xyz[row, 2] * cells, seed[row] + octave
            )
            size += weight
            weight *= 0.5
            cells *= 2.03
        out[row] = total / size


@njit(cache=True, nogil=True)
def _noise(x: float, y: float, z: float, seed: np.uint32) -> float:
    """Blend the eight lattice points around a place."""
    i, j, k = int(np.floor(x)), int(np.floor(y)), int(np.floor(z))
    u, v, w = x - i, y - j, z - k
    u, v, w = u * u * (3 - 2 * u), v * v * (3 - 2 * v), w * w * (3 - 2 * w)
    total = 0.0
    for corner in range(8):
        a, b, c = corner & 1, (corner >> 1) & 1, corner >> 2
        share = (u if a else 1 - u) * (v if b else 1 - v) * (w if c else 1 - w)
        total += share * float(_lattice(i + a, j + b, k + c, np.uint32(seed)))
    return total
