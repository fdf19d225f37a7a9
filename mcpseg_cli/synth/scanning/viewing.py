"""Which points of a room its tripods see, and from which of them each is taken."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.synth.geometry.solids import Part
from mcpseg_cli.synth.plan import Room
from mcpseg_cli.synth.scanning.sampling import Mesh, Samples
from mcpseg_cli.synth.scanning.visibility import (
    VOXEL,
    RoomGrid,
    facing_of,
    is_clear,
    number_cells,
)
from mcpseg_cli.synth.surfaces.noise import Floats

Bools = NDArray[np.bool_]
Doubles = NDArray[np.float64]

_ENOUGH = 3  # tripods that a point is looked at from


def covered(mesh: Mesh, samples: Samples, room: Room) -> Bools:
    """Return which points, (N,), nobody can see whatever the tripods.

    Args:
        mesh: The room.
        samples: The points.
        room: Its plan.

    Returns:
        Those on walls, floor and ceiling under something that touches them, and those of solids
        that face outwards at the room's border.
    """
    marked = np.zeros(len(samples.xyz), np.bool_)
    box = np.array([[*room.low, 0.0], [*room.high, room.ceiling]])
    _mark_outward(samples.xyz, samples.normals, mesh.is_closed[samples.part], box, marked)

    # boxes against the sheets that the shell is made of, sorted by x
    is_shell = np.flatnonzero(~mesh.is_closed[samples.part])
    order = is_shell[np.argsort(samples.xyz[is_shell, 0], kind="stable")]
    boxes = [part for part in mesh.parts if is_box(part)]
    if boxes:
        corners = [part.triangles.reshape(-1, 3) for part in boxes]
        around = np.array([[xyz.min(axis=0), xyz.max(axis=0)] for xyz in corners])
        own = np.array([[part.low, part.high, part.origin] for part in boxes])
        yaw = np.array([part.yaw for part in boxes])
        _mark_under(samples.xyz[order], samples.normals[order], order, around, own, yaw, marked)
    return marked


def is_box(part: Part) -> bool:
    """Return whether a part is one box: 12 triangles between 8 corners."""
    if len(part.triangles) != 12:
        return False
    return len(np.unique(part.triangles.reshape(-1, 3).round(5), axis=0)) == 8


@njit(cache=True, nogil=True)
def _mark_outward(
    xyz: Floats, normals: Floats, is_closed: Bools, box: Doubles, marked: Bools
) -> None:
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
    xyz: Floats, normals: Floats, order: NDArray[np.int64], around: Doubles, own: Doubles,
    yaw: Doubles, marked: Bools,
) -> None:  # fmt: skip
    """Mark the points, sorted by x, that have a box before them within 5 cm."""
    for number in range(len(around)):
        low, high = around[number, 0] - 0.05, around[number, 1] + 0.05
        cosine, sine = np.cos(yaw[number]), np.sin(yaw[number])
        for row in range(np.searchsorted(xyz[:, 0], low[0]), len(xyz)):
            if xyz[row, 0] > high[0]:
                break
            if xyz[row, 1] < low[1] or xyz[row, 1] > high[1]:
                continue
            if xyz[row, 2] < low[2] or xyz[row, 2] > high[2]:
                continue

            # steps along the normal, in the box's own frame
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


def seen(
    mesh: Mesh, grid: RoomGrid, samples: Samples, tripods: Doubles
) -> tuple[Samples, NDArray[np.int8]]:
    """Keep the points that a tripod sees, fewer where it looks from afar or at a flat angle.

    Args:
        mesh: The room.
        grid: The room in voxels.
        samples: The points.
        tripods: (T, 3) float64 places, metres, map frame.

    Returns:
        The points kept, their normals towards the tripod, and (N,) int8 which tripod that is.
    """
    # points in one voxel that face the same way see the same tripods
    shape = np.array(grid.distance.shape, np.int64)
    cell = ((samples.xyz - grid.low) / VOXEL).astype(np.int32)
    cell = np.clip(cell, 0, shape.astype(np.int32) - 1)
    own = np.empty(len(cell), np.int32)
    table = np.zeros(int(np.prod(shape)) * 6, np.int32)
    first = number_cells(cell, facing_of(samples.normals), shape, table, own)

    views, closed = np.zeros(len(first), np.uint16), mesh.is_closed[samples.part]
    xyz, normals = samples.xyz[first], samples.normals[first]
    _look_out(xyz, normals, closed[first], tripods, grid.low, grid.distance, views)
    tripod = np.full(len(samples.xyz), -1, np.int8)
    _choose_viewer(samples.xyz, samples.normals, closed, views, own, tripods, samples.rank, tripod)

    # normals turn to the tripod
    is_seen = tripod >= 0
    samples, tripod = samples.chosen(is_seen), tripod[is_seen]
    towards = tripods.astype(np.float32)[tripod] - samples.xyz
    flip = (towards * samples.normals).sum(axis=1) < 0
    samples.normals[flip] *= -1
    return samples, tripod


@njit(cache=True, nogil=True)
def _look_out(
    xyz: Floats, normals: Floats, is_closed: Bools, tripods: Doubles, low: Doubles,
    distance: NDArray[np.uint8], views: NDArray[np.uint16],
) -> None:  # fmt: skip
    """Set a bit for each tripod that sees each point; three are enough, the nearest ones."""
    apart = np.empty(len(tripods))
    for row in range(len(xyz)):
        x = (xyz[row, 0] - low[0]) / VOXEL
        y = (xyz[row, 1] - low[1]) / VOXEL
        z = (xyz[row, 2] - low[2]) / VOXEL
        _measure(xyz[row], tripods, apart)
        found = 0
        for _ in range(len(tripods)):
            # the nearest that has not been tried
            view = int(np.argmin(apart))
            apart[view] = np.inf
            to_x = (tripods[view, 0] - low[0]) / VOXEL
            to_y = (tripods[view, 1] - low[1]) / VOXEL
            to_z = (tripods[view, 2] - low[2]) / VOXEL

            # solids hide their backs; sheets have two faces
            along_x, along_y = (to_x - x) * normals[row, 0], (to_y - y) * normals[row, 1]
            facing = along_x + along_y + (to_z - z) * normals[row, 2]
            if is_closed[row] and facing < 0:
                continue
            side = 1.0 if facing > 0 else -1.0

            # a ray from one voxel before the point
            a, b = x + side * normals[row, 0], y + side * normals[row, 1]
            c = z + side * normals[row, 2]
            if is_clear(a, b, c, to_x, to_y, to_z, distance):
                views[row] |= np.uint16(1 << view)
                found += 1
                if found == _ENOUGH:
                    break


@njit(cache=True, nogil=True)
def _measure(point: Floats, tripods: Doubles, apart: Doubles) -> None:
    """Fill in how far each tripod is from a point on the floor plan, squared."""
    for view in range(len(tripods)):
        dx, dy = tripods[view, 0] - point[0], tripods[view, 1] - point[1]
        apart[view] = dx**2 + dy**2


@njit(cache=True, nogil=True)
def _choose_viewer(
    xyz: Floats, normals: Floats, is_closed: Bools, views: NDArray[np.uint16],
    own: NDArray[np.int32], tripods: Doubles, draws: Floats, tripod: NDArray[np.int8],
) -> None:  # fmt: skip
    """Choose the nearest tripod that sees each point well enough for its draw; -1 for none."""
    apart = np.empty(len(tripods))
    for row in range(len(xyz)):
        if views[own[row]] == 0:
            continue
        need = draws[row]
        _measure(xyz[row], tripods, apart)
        for _ in range(len(tripods)):
            # the nearest that has not been tried
            view = int(np.argmin(apart))
            apart[view] = np.inf
            if not (views[own[row]] >> view) & 1:
                continue

            # how squarely it looks at the surface
            dx, dy = tripods[view, 0] - xyz[row, 0], tripods[view, 1] - xyz[row, 1]
            dz = tripods[view, 2] - xyz[row, 2]
            square = dx * dx + dy * dy + dz * dz
            facing = dx * normals[row, 0] + dy * normals[row, 1] + dz * normals[row, 2]
            facing /= np.sqrt(square + 1e-9)
            if is_closed[row] and facing < 0.02:
                continue

            # points are rarer far away and at flat angles
            need -= min(0.4 + 2.2 * abs(facing) / (1.0 + square / 9.0), 1.0)
            if need <= 0:
                tripod[row] = view
                break
