"""Light: lamps and windows shine on surfaces, with shadows and dark corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.synth.geometry.solids import area_of
from mcpseg_cli.synth.scanning.sampling import Mesh, Samples
from mcpseg_cli.synth.scanning.visibility import VOXEL, RoomGrid, facing_of, is_clear, number_cells
from mcpseg_cli.synth.surfaces.noise import Floats

Doubles = NDArray[np.float64]

PROBE = 0.08
"""Edge of the cells in which light is worked out for each way a surface may face, metres."""
SPOTS = 16
"""Places on each lamp or window that light comes from."""
LAMP_GAIN = 8.0  # a lamp is that much brighter than a window of the same area and glow


@dataclass(frozen=True)
class Lights:
    """All that glows in a room.

    Attributes:
        spots: (L, S, 3) float64 places that light comes from, voxels.
        facing: (L, S, 3) float64 unit vectors, which way they face.
        colour: (L, 3) float32, 0-1, in linear light.
        power: (L,) float32.
    """

    spots: Doubles
    facing: Doubles
    colour: Floats
    power: Floats


def bake(mesh: Mesh, grid: RoomGrid, samples: Samples, rng: np.random.Generator) -> Floats:
    """Work out the light that falls on points.

    Args:
        mesh: The room; its parts that glow are the lights.
        grid: The room in voxels, without glass.
        samples: Points, their normals towards the viewer.
        rng: Random numbers: where on a lamp a shadow ray ends.

    Returns:
        (N, 3) float32 light by colour, its mean 1 over the room, nothing below 0.
    """
    cells, first, table, shape = _probe_cells(samples, rng)
    xyz = (samples.xyz[first].astype(np.float64) - grid.low) / VOXEL
    normals = samples.normals[first].astype(np.float64)

    # straight from the lamps
    lights = _lights(mesh, grid, rng)
    spots, power = lights.spots, lights.power
    direct = np.zeros((len(first), 3), np.float32)
    if len(spots):
        draws = rng.integers(SPOTS, size=(len(first), len(spots)), dtype=np.uint8)
        _shine(
            xyz, normals, spots, lights.facing, lights.colour, power, draws, grid.distance, direct
        )
    openness = np.empty(len(first), np.float32)
    _look_around(xyz, normals, grid.distance, openness)

    # after a bounce off floor and walls; floors shine back
    mean = direct.mean(axis=0) if len(first) else np.ones(3, np.float32)
    if mean.sum() < 0.02:
        mean = np.full(3, 0.2, np.float32)
    ambient = rng.uniform(0.3, 0.8) * mean * np.array([1.03, 1.0, 0.94], np.float32)
    below = (1.0 - 0.3 * normals[:, 2:]).astype(np.float32)
    light = direct + ambient * openness[:, None] * below

    # from the probes to the points
    light = _blur(light, table, shape)
    light /= max(float(light.mean()), 1e-6)
    shone: Floats = (light[cells[0]] + light[cells[1]]) * np.float32(0.5)
    return shone


def _probe_cells(
    samples: Samples, rng: np.random.Generator
) -> tuple[list[NDArray[np.int32]], NDArray[np.int64], NDArray[np.int32], NDArray[np.int64]]:
    """Number the probes: cells that points lie in, for each way those face.

    Returns:
        Two (N,) probes for each point, for each probe the point that stands for it, the table of
        cells and its shape. A point looks up places shaken by a cell, where there are probes, so
        that the edges of cells and the grain of shadows do not show.
    """
    low = samples.xyz.min(axis=0) - 2 * PROBE
    shape = np.ceil(np.ptp(samples.xyz, axis=0) / PROBE).astype(np.int64) + 5
    facing = facing_of(samples.normals)
    table = np.zeros(int(np.prod(shape)) * 6, np.int32)
    own = np.empty(len(facing), np.int32)
    place = (samples.xyz - low) / np.float32(PROBE)
    firsts = number_cells(place.astype(np.int32), facing, shape, table, own)

    near = []
    for _ in range(2):
        shake = np.float32(1.4) * (rng.random(place.shape, np.float32) - np.float32(0.5))
        near.append(np.empty(len(facing), np.int32))
        _look_up((place + shake).astype(np.int32), facing, shape, table, own, near[-1])
    return near, firsts, table, shape


@njit(cache=True, nogil=True)
def _blur(
    light: NDArray[np.float32], table: NDArray[np.int32], shape: NDArray[np.int64]
) -> NDArray[np.float32]:
    """Average the light of each probe with that of those around it that face the same way."""
    out = np.zeros_like(light)
    for x in range(1, shape[0] - 1):
        for y in range(1, shape[1] - 1):
            for z in range(1, shape[2] - 1):
                for facing in range(6):
                    probe = table[((x * shape[1] + y) * shape[2] + z) * 6 + facing] - 1
                    if probe < 0:
                        continue

                    # it counts for three
                    total = 0.0
                    for near in range(27):
                        i, j, k = x + near // 9 - 1, y + near // 3 % 3 - 1, z + near % 3 - 1
                        other = table[((i * shape[1] + j) * shape[2] + k) * 6 + facing] - 1
                        if other >= 0:
                            weight = 3.0 if near == 13 else 1.0
                            total += weight
                            out[probe] += weight * light[other]
                    out[probe] /= total
    return out


@njit(cache=True, nogil=True)
def _look_up(
    cell: NDArray[np.int32], facing: NDArray[np.int64], shape: NDArray[np.int64],
    table: NDArray[np.int32], own: NDArray[np.int32], near: NDArray[np.int32],
) -> None:  # fmt: skip
    """Find the probe at each shaken place, a point's own where there is none."""
    for row in range(len(cell)):
        key = ((cell[row, 0] * shape[1] + cell[row, 1]) * shape[2] + cell[row, 2]) * 6 + facing[row]
        near[row] = table[key] - 1 if table[key] > 0 else own[row]


def _lights(mesh: Mesh, grid: RoomGrid, rng: np.random.Generator) -> Lights:
    """Find all that glows, with random places on it."""
    glow = np.array([part.material.glow for part in mesh.parts])
    areas = area_of(mesh.triangles)
    spots, facing, colours, powers = [], [], [], []
    for number in np.flatnonzero(glow > 0.02):
        faces = np.flatnonzero(mesh.part == number)
        if not len(faces):
            continue

        # evenly spread over its triangles
        area = float(areas[faces].sum())
        face = faces[rng.choice(len(faces), SPOTS, p=areas[faces] / areas[faces].sum())]
        u, v = np.sort(rng.random((2, SPOTS)), axis=0)
        a, b, c = mesh.triangles[face].transpose(1, 0, 2)
        place = a * u[:, None] + b * (v - u)[:, None] + c * (1 - v)[:, None]
        spots.append((place - grid.low) / VOXEL)
        facing.append(mesh.normals[face])
        colours.append(np.array(mesh.parts[number].material.base, np.float32) / 255)
        power = area if mesh.is_glass[number] else LAMP_GAIN * max(area, 0.1)
        powers.append(glow[number] * power)

    if not spots:
        nowhere, dark = np.zeros((0, SPOTS, 3)), np.zeros((0, 3), np.float32)
        return Lights(nowhere, nowhere, dark, np.zeros(0, np.float32))
    colour = (np.array(colours) ** 2.2).astype(np.float32)
    return Lights(np.array(spots), np.array(facing), colour, np.array(powers, np.float32))


@njit(cache=True, nogil=True)
def _shine(
    xyz: Doubles, normals: Doubles, spots: Doubles, facing: Doubles, colour: Floats, power: Floats,
    draws: NDArray[np.uint8], distance: NDArray[np.uint8], out: Floats,
) -> None:  # fmt: skip
    """Add up the light of all lamps at every probe; only lamps that matter there cast shadows."""
    strength = np.empty(len(spots))
    for row in range(len(xyz)):
        # without shadows
        total = 0.0
        for lamp in range(len(spots)):
            spot = draws[row, lamp]
            dx = spots[lamp, spot, 0] - xyz[row, 0]
            dy = spots[lamp, spot, 1] - xyz[row, 1]
            dz = spots[lamp, spot, 2] - xyz[row, 2]
            square = dx * dx + dy * dy + dz * dz + 20.0
            length = np.sqrt(square)
            falls = (dx * normals[row, 0] + dy * normals[row, 1] + dz * normals[row, 2]) / length
            f_x, f_y, f_z = facing[lamp, spot, 0], facing[lamp, spot, 1], facing[lamp, spot, 2]
            leaves = -(dx * f_x + dy * f_y + dz * f_z) / length
            strength[lamp] = power[lamp] * max(falls, 0.0) * (0.05 + max(leaves, 0.0)) / square
            total += strength[lamp]

        # three shadow rays to the strongest, one to the others, none to the weakest
        for lamp in range(len(spots)):
            rays = 1 if strength[lamp] < 0.2 * total else 3
            if strength[lamp] <= 0.04 * total:
                rays = 0
            reached = 0
            for ray in range(rays):
                spot = (draws[row, lamp] + 5 * ray) % len(spots[lamp])
                reached += is_clear(
                    xyz[row, 0] + normals[row, 0],
                    xyz[row, 1] + normals[row, 1],
                    xyz[row, 2] + normals[row, 2],
                    spots[lamp, spot, 0] + 2 * facing[lamp, spot, 0],
                    spots[lamp, spot, 1] + 2 * facing[lamp, spot, 1],
                    spots[lamp, spot, 2] + 2 * facing[lamp, spot, 2],
                    distance,
                )
            share = strength[lamp] * (reached / rays if rays else 0.6)
            for channel in range(3):
                out[row, channel] += share * colour[lamp, channel] * 400.0


@njit(cache=True, nogil=True)
def _look_around(xyz: Doubles, normals: Doubles, distance: NDArray[np.uint8], out: Floats) -> None:
    """Work out how open space is before each probe: how far surfaces are along the normal."""
    for row in range(len(xyz)):
        total = 0.0
        for reach in (3.0, 7.0, 14.0):
            i = int(np.floor(xyz[row, 0] + reach * normals[row, 0]))
            j = int(np.floor(xyz[row, 1] + reach * normals[row, 1]))
            k = int(np.floor(xyz[row, 2] + reach * normals[row, 2]))
            a, b, c = distance.shape
            if 0 <= i < a and 0 <= j < b and 0 <= k < c:
                total += min(distance[i, j, k] / (reach - 1.0), 1.0)
        out[row] = 0.25 + 0.25 * total
