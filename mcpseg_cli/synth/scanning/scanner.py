"""Scanning a room: tripods, what they see, and what real scanners and cameras do wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.plan import Room
from mcpseg_cli.synth.scanning.lighting import bake
from mcpseg_cli.synth.scanning.photo import develop, take_from_panorama
from mcpseg_cli.synth.scanning.sampling import Mesh, Samples, mesh_of, paint_samples, sample_mesh
from mcpseg_cli.synth.scanning.viewing import covered, seen
from mcpseg_cli.synth.scanning.visibility import RoomGrid, build_room_grid
from mcpseg_cli.synth.surfaces.noise import Floats, fbm
from mcpseg_cli.synth.surfaces.styles import Style

_MIDDLE, _SPREAD = 0.515, 0.12  # mean and standard deviation of the noise that gaps are cut from


@dataclass(frozen=True)
class Scan:
    """The points of a room.

    Attributes:
        xyz: (N, 3) float32, metres, map frame.
        rgb: (N, 3) uint8.
        item: (N,) int32 number of the object in the list given.
    """

    xyz: NDArray[np.float32]
    rgb: NDArray[np.uint8]
    item: NDArray[np.int32]


def scan_room(
    items: list[Item], room: Room, style: Style, spacing: float, rng: np.random.Generator
) -> Scan:
    """Scan a furnished room from a few tripods, with light, noise and gaps.

    Args:
        items: All objects in the room, shell and furniture.
        room: The room.
        style: The building's.
        spacing: Mean distance of points, metres; varies from room to room.
        rng: Random numbers.

    Returns:
        What can be seen from inside.
    """
    # the room, and where the scanner stands in it
    mesh = mesh_of(items)
    grid = build_room_grid(mesh.triangles[~mesh.is_glass[mesh.part]])
    tripods = place_tripods(room, grid, rng)

    # points on its surfaces, those that are seen, less the gaps
    samples = sample_mesh(mesh, spacing * rng.uniform(0.8, 1.15), rng)
    samples = samples.chosen(~covered(mesh, samples, room))
    samples, tripod = seen(mesh, grid, samples, tripods)
    kept = ~_gaps(mesh, samples, rng)
    samples, tripod = samples.chosen(kept), tripod[kept]

    # the photo
    painted = paint_samples(mesh, samples, rng)
    light = bake(mesh, grid, samples, rng)
    rgb = develop(mesh, samples, painted, light, tripod, style, rng)

    # what goes wrong
    xyz = _warped(samples, rng)
    xyz, rgb = take_from_panorama(xyz, rgb, tripod, tripods, rng)
    xyz = _noisy(xyz, tripod, tripods, rng)
    return Scan(xyz, rgb, mesh.item[samples.part])


def place_tripods(room: Room, grid: RoomGrid, rng: np.random.Generator) -> NDArray[np.float64]:
    """Choose 3-12 places in free space, far from each other: (T, 3), metres, map frame."""
    size = room.high - room.low
    wanted_views = max(2 + float(np.prod(size)) / 9, float(size.max()) / 3)
    count = int(np.clip(round(wanted_views + rng.normal(0, 0.7)), 3, 12))

    # spots with some room around them from the floor to the scanner
    tries = rng.uniform(room.low + 0.35, room.high - 0.35, (400, 2))
    heights = np.arange(0.15, 1.8, 0.15)
    columns = [np.column_stack([tries, np.full(len(tries), height)]) for height in heights]
    room_to_stand = grid.at(np.concatenate(columns)).reshape(len(heights), -1).min(axis=0)
    wanted = min(6, int(np.partition(room_to_stand, -20)[-20]))
    spots = tries[room_to_stand >= max(wanted, 2)]
    if not len(spots):  # nowhere to stand: hold the scanner over the furniture
        spots = tries[:20]

    # each far from the ones before
    chosen = [spots[0]]
    while len(chosen) < count:
        apart = np.min([np.hypot(*(spots - spot).T) for spot in chosen], axis=0)
        chosen.append(spots[int(np.argmax(apart * rng.uniform(0.6, 1.0, len(apart))))])
    return np.column_stack([np.array(chosen), rng.uniform(1.2, 1.7, count)])


def _gaps(mesh: Mesh, samples: Samples, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return which points the scanner loses: patches of the dark and shiny, half of all glass."""
    materials = [part.material for part in mesh.parts]
    dark = np.array([sum(material.base) < 130 for material in materials])
    shiny = np.array([material.pattern in ("metal", "screen", "marble") for material in materials])

    # about which share of the points each part loses; some windows go as a whole
    size = (0.12 * dark + 0.2 * shiny) * rng.uniform(0.2, 1.2)
    is_lost = rng.random(mesh.is_glass.sum()) < 0.12
    size[mesh.is_glass] = np.where(is_lost, 1.2, rng.uniform(0.03, 0.4))
    size += 0.03 if rng.random() < 0.08 else 0.0

    # patches of noise with ragged edges
    seed = np.array([material.seed & 0xFFFFFFFF for material in materials], np.uint32)
    holes = np.zeros(len(samples.xyz), np.bool_)
    rows = np.flatnonzero(size[samples.part] > 0)
    part = samples.part[rows]
    frequency = np.where(mesh.is_glass, 1.4, 2.5).astype(np.float32)[part]
    field = fbm(samples.xyz[rows], frequency, seed[part] + np.uint32(int(rng.integers(1 << 16))), 3)
    field += np.float32(0.03) * rng.random(len(rows), np.float32)
    level = _MIDDLE + _SPREAD * ndtri(np.clip(size, 1e-6, 1 - 1e-6))
    holes[rows] = field < level[part]
    return holes


def _warped(samples: Samples, rng: np.random.Generator) -> Floats:
    """Bend surfaces gently, as registration and meshing do."""
    seed = np.full(len(samples.xyz), int(rng.integers(1 << 31)), np.uint32)
    bump = (fbm(samples.xyz, 1.0, seed, 1) - 0.5) * np.float32(2 * rng.uniform(0.003, 0.012))
    bent: Floats = samples.xyz + bump[:, None] * samples.normals
    return bent


def _noisy(
    xyz: Floats, tripod: NDArray[np.int8], tripods: NDArray[np.float64], rng: np.random.Generator
) -> Floats:
    """Move points along their rays, and each tripod's together by a few millimetres."""
    sigma = rng.uniform(0.002, 0.007)
    error = rng.standard_normal(len(xyz), np.float32) * np.float32(sigma)
    error[rng.random(len(xyz), np.float32) < 0.01] *= 5  # one in a hundred far

    # more from afar
    ray = xyz - tripods.astype(np.float32)[tripod]
    length = np.linalg.norm(ray, axis=1)
    share = error * (0.7 + 0.1 * length) / np.maximum(length, 0.1)

    offset = np.clip(rng.normal(0, 0.003, (len(tripods), 3)), -0.01, 0.01).astype(np.float32)
    moved: Floats = xyz + ray * share[:, None] + offset[tripod]
    return moved
