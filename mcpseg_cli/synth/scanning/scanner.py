"""Scanning a room: tripods, what they see, and what real scanners and cameras do wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.special import ndtri

from mcpseg_cli.synth.geometry.solids import Item, Part
from mcpseg_cli.synth.plan import Room
from mcpseg_cli.synth.scanning.lighting import bake
from mcpseg_cli.synth.scanning.photo import develop, take_from_panorama
from mcpseg_cli.synth.scanning.sampling import Mesh, Samples, mesh_of, paint_samples, sample_mesh
from mcpseg_cli.synth.scanning.visibility import (
    VOXEL,
    RoomGrid,
    build_room_grid,
    facing_of,
    is_clear,
    number_cells,
)
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
    mesh = mesh_of(items)
    grid = build_room_grid(mesh.triangles[~mesh.is_glass[mesh.part]])
    tripods = place_tripods(room, grid, rng)
    samples = sample_mesh(mesh, spacing * rng.uniform(0.8, 1.15), rng)
    samples = samples.chosen(~_covered(mesh, samples, room))
    samples, tripod = _seen(mesh, grid, samples, tripods)
    kept = ~_gaps(mesh, samples, rng)
    samples, tripod = samples.chosen(kept), tripod[kept]
    painted = paint_samples(mesh, samples, rng)
    rgb = develop(mesh, samples, painted, bake(mesh, grid, samples, rng), tripod, style, rng)
    xyz = _warped(samples, rng)
    xyz, rgb = take_from_panorama(xyz, rgb, tripod, tripods, rng)
    xyz = _noisy(xyz, tripod, tripods, rng)
    return Scan(xyz, rgb, mesh.item[samples.part])


def place_tripods(room: Room, grid: RoomGrid, rng: np.random.Generator) -> NDArray[np.float64]:
    """Choose 3-12 places in free space, far from each other: (T, 3), metres, map frame."""
    size = room.high - room.low
    wanted_views = max(2 + float(np.prod(size)) / 9, float(size.max()) / 3)
    count = int(np.clip(round(wanted_views + rng.normal(0, 0.7)), 3, 12))
    tries = rng.uniform(room.low + 0.35, room.high - 0.35, (400, 2))
    heights = np.arange(0.15, 1.8, 0.15)
    probes = np.concatenate(
        [np.column_stack([tries, np.full(len(tries), height)]) for height in heights]
    )
    room_to_stand = grid.at(probes).reshape(len(heights), -1).min(axis=0)
    wanted = min(6, int(np.partition(room_to_stand, -20)[-20]))
    spots = tries[room_to_stand >= max(wanted, 2)]
    if not len(spots):  # nowhere to stand: hold the scanner over the furniture
        spots = tries[:20]
    chosen = [spots[0]]
    while len(chosen) < count:
        apart = np.min([np.hypot(*(spots - spot).T) for spot in chosen], axis=0)
        chosen.append(spots[int(np.argmax(apart * rng.uniform(0.6, 1.0, len(apart))))])
    return np.column_stack([np.array(chosen), rng.uniform(1.2, 1.7, count)])


def _covered(mesh: Mesh, samples: Samples, room: Room) -> NDArray[np.bool_]:
    """Return which points on walls, floor and ceiling lie under something that touches them, or face outwards."""
    covered = np.zeros(len(samples.xyz), np.bool_)
    box = np.array([[*room.low, 0.0], [*room.high, room.ceiling]])
    _mark_outward(samples.xyz, samples.normals, mesh.is_closed[samples.part], box, covered)
    is_shell = np.flatnonzero(~mesh.is_closed[samples.part])
    order = is_shell[np.argsort(samples.xyz[is_shell, 0], kind="stable")]
    boxes = [part for part in mesh.parts if _is_box(part)]
    if boxes:
        around = np.array(
            [[f(part.triangles.reshape(-1, 3), axis=0) for f in (np.min, np.max)] for part in boxes]
        )
        own = np.array([[part.low, part.high, part.origin] for part in boxes])
        yaw = np.array([part.yaw for part in boxes])
        _mark_under(samples.xyz[order], samples.normals[order], order, around, own, yaw, covered)
    return covered


def _is_box(part: Part) -> bool:
    """Return whether a part is one box: 12 triangles between 8 corners."""
    return (
        len(part.triangles) == 12
        and len(np.unique(part.triangles.reshape(-1, 3).round(5), axis=0)) == 8
    )


@njit(cache=True, nogil=True)
def _mark_outward(
    xyz: NDArray[np.float32], normals: NDArray[np.float32], is_closed: NDArray[np.bool_], box: NDArray[np.float64],
    marked: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Mark points of solids that lie in the room's box and whose outside, 1 cm on, does not."""
    for row in range(len(xyz)):
        if is_closed[row]:
            inside = True
            leaves = False
            for axis in range(3):
                place, out = xyz[row, axis], xyz[row, axis] + 0.01 * normals[row, axis]
                inside = inside and box[0, axis] - 0.001 <= place <= box[1, axis] + 0.001
                leaves = leaves or out < box[0, axis] - 0.001 or out > box[1, axis] + 0.001
            marked[row] = inside and leaves


@njit(cache=True, nogil=True)
def _mark_under(
    xyz: NDArray[np.float32], normals: NDArray[np.float32], order: NDArray[np.int64], around: NDArray[np.float64],
    own: NDArray[np.float64], yaw: NDArray[np.float64], marked: NDArray[np.bool_],
) -> None:  # fmt: skip
    """Mark the points, sorted by x, that have a box before them within 5 cm."""
    for number in range(len(around)):
        low, high = around[number, 0] - 0.05, around[number, 1] + 0.05
        cosine, sine = np.cos(yaw[number]), np.sin(yaw[number])
        for row in range(np.searchsorted(xyz[:, 0], low[0]), len(xyz)):
            if xyz[row, 0] > high[0]:
                break
            if (
                xyz[row, 1] < low[1]
                or xyz[row, 1] > high[1]
                or xyz[row, 2] < low[2]
                or xyz[row, 2] > high[2]
            ):
                continue
            for step in (0.004, 0.012, 0.024, 0.036, 0.05):
                dx = xyz[row, 0] + step * normals[row, 0] - own[number, 2, 0]
                dy = xyz[row, 1] + step * normals[row, 1] - own[number, 2, 1]
                x, y = dx * cosine + dy * sine, dy * cosine - dx * sine
                z = xyz[row, 2] + step * normals[row, 2] - own[number, 2, 2]
                if (
                    own[number, 0, 0] < x < own[number, 1, 0]
                    and own[number, 0, 1] < y < own[number, 1, 1]
                    and own[number, 0, 2] < z < own[number, 1, 2]
                ):
                    marked[order[row]] = True
                    break


def _seen(
    mesh: Mesh, grid: RoomGrid, samples: Samples, tripods: NDArray[np.float64]
) -> tuple[Samples, NDArray[np.int8]]:
    """Keep the points that a tripod sees, fewer where it looks from afar or at a flat angle; turn normals to it."""
    tripod = np.full(len(samples.xyz), -1, np.int8)
    shape = np.array(grid.distance.shape, np.int64)
    cell = np.clip(
        ((samples.xyz - grid.low) / VOXEL).astype(np.int32), 0, shape.astype(np.int32) - 1
    )
    own = np.empty(len(cell), np.int32)
    table = np.zeros(int(np.prod(shape)) * 6, np.int32)
    first = number_cells(cell, facing_of(samples.normals), shape, table, own)
    views = np.zeros(len(first), np.uint16)
    closed = mesh.is_closed[samples.part]
    _look_out(
        samples.xyz[first],
        samples.normals[first],
        closed[first],
        tripods,
        grid.low,
        grid.distance,
        views,
    )
    _choose_viewer(samples.xyz, samples.normals, closed, views, own, tripods, samples.rank, tripod)
    seen = tripod >= 0
    samples, tripod = samples.chosen(seen), tripod[seen]
    towards = tripods.astype(np.float32)[tripod] - samples.xyz
    flip = (towards * samples.normals).sum(axis=1) < 0
    samples.normals[flip] *= -1
    return samples, tripod


@njit(cache=True, nogil=True)
def _look_out(
    xyz: NDArray[np.float32], normals: NDArray[np.float32], is_closed: NDArray[np.bool_], tripods: NDArray[np.float64],
    low: NDArray[np.float64], distance: NDArray[np.uint8], views: NDArray[np.uint16],
) -> None:  # fmt: skip
    """Set a bit for each tripod that sees each point; three are enough, the nearest ones."""
    apart = np.empty(len(tripods))
    for row in range(len(xyz)):
        x, y, z = (
            (xyz[row, 0] - low[0]) / VOXEL,
            (xyz[row, 1] - low[1]) / VOXEL,
            (xyz[row, 2] - low[2]) / VOXEL,
        )
        for view in range(len(tripods)):
            apart[view] = (tripods[view, 0] - xyz[row, 0]) ** 2 + (
                tripods[view, 1] - xyz[row, 1]
            ) ** 2
        found = 0
        for _ in range(len(tripods)):
            view = int(np.argmin(apart))
            apart[view] = np.inf
            to_x, to_y, to_z = (
                (tripods[view, 0] - low[0]) / VOXEL,
                (tripods[view, 1] - low[1]) / VOXEL,
                (tripods[view, 2] - low[2]) / VOXEL,
            )
            facing = (
                (to_x - x) * normals[row, 0]
                + (to_y - y) * normals[row, 1]
                + (to_z - z) * normals[row, 2]
            )
            if is_closed[row] and facing < 0:
                continue
            side = 1.0 if facing > 0 else -1.0
            a, b, c = (
                x + side * normals[row, 0],
                y + side * normals[row, 1],
                z + side * normals[row, 2],
            )
            if is_clear(a, b, c, to_x, to_y, to_z, distance):
                views[row] |= np.uint16(1 << view)
                found += 1
                if found == 3:
                    break


@njit(cache=True, nogil=True)
def _choose_viewer(
    xyz: NDArray[np.float32], normals: NDArray[np.float32], is_closed: NDArray[np.bool_], views: NDArray[np.uint16],
    own: NDArray[np.int32], tripods: NDArray[np.float64], draws: NDArray[np.float32], tripod: NDArray[np.int8],
) -> None:  # fmt: skip
    """Choose the nearest tripod that sees each point well enough for its draw; -1 for none."""
    apart = np.empty(len(tripods))
    for row in range(len(xyz)):
        if views[own[row]] == 0:
            continue
        need = draws[row]
        for view in range(len(tripods)):
            apart[view] = (tripods[view, 0] - xyz[row, 0]) ** 2 + (
                tripods[view, 1] - xyz[row, 1]
            ) ** 2
        for _ in range(len(tripods)):
            view = int(np.argmin(apart))
            apart[view] = np.inf
            if not (views[own[row]] >> view) & 1:
                continue
            dx, dy, dz = (
                tripods[view, 0] - xyz[row, 0],
                tripods[view, 1] - xyz[row, 1],
                tripods[view, 2] - xyz[row, 2],
            )
            square = dx * dx + dy * dy + dz * dz
            facing = (dx * normals[row, 0] + dy * normals[row, 1] + dz * normals[row, 2]) / np.sqrt(
                square + 1e-9
            )
            if is_closed[row] and facing < 0.02:
                continue
            need -= min(0.4 + 2.2 * abs(facing) / (1.0 + square / 9.0), 1.0)
            if need <= 0:
                tripod[row] = view
                break


def _gaps(mesh: Mesh, samples: Samples, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return which points the scanner loses: patches of what is dark or shiny, and half of all glass."""
    materials = [part.material for part in mesh.parts]
    dark = np.array([sum(material.base) < 130 for material in materials])
    shiny = np.array([material.pattern in ("metal", "screen", "marble") for material in materials])
    size = (0.12 * dark + 0.2 * shiny) * rng.uniform(
        0.2, 1.2
    )  # about the share of points that are lost
    is_lost = rng.random(mesh.is_glass.sum()) < 0.12  # whole windows
    size[mesh.is_glass] = np.where(is_lost, 1.2, rng.uniform(0.03, 0.4))
    size += 0.03 if rng.random() < 0.08 else 0.0
    seed = np.array([material.seed & 0xFFFFFFFF for material in materials], np.uint32)
    holes = np.zeros(len(samples.xyz), np.bool_)
    rows = np.flatnonzero(size[samples.part] > 0)
    part = samples.part[rows]
    frequency = np.where(mesh.is_glass, 1.4, 2.5).astype(np.float32)[part]
    field = fbm(samples.xyz[rows], frequency, seed[part] + np.uint32(int(rng.integers(1 << 16))), 3)
    field += np.float32(0.03) * rng.random(len(rows), np.float32)  # ragged edges
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
    """Move points along their rays, one in a hundred far, and each tripod's together by a few millimetres."""
    sigma = rng.uniform(0.002, 0.007)
    error = rng.standard_normal(len(xyz), np.float32) * np.float32(sigma)
    error[rng.random(len(xyz), np.float32) < 0.01] *= 5
    ray = xyz - tripods.astype(np.float32)[tripod]
    length = np.linalg.norm(ray, axis=1)
    offset = np.clip(rng.normal(0, 0.003, (len(tripods), 3)), -0.01, 0.01).astype(np.float32)
    moved: Floats = (
        xyz
        + ray * (error * (0.7 + 0.1 * length) / np.maximum(length, 0.1))[:, None]
        + offset[tripod]
    )
    return moved
