"""Slow, obvious twins of the fast kernels: dictionaries and loops, written from the paper."""

import itertools
import math

import numpy as np

Voxel = tuple[int, int, int]


def voxel_of(point, voxel_size: float) -> Voxel:
    return tuple(math.floor(float(coordinate) / voxel_size + 0.5) for coordinate in point)


class DictVoxelMap:
    """The look-up table of III-B as a dictionary."""

    def __init__(self, voxel_size: float) -> None:
        self.voxel_size = voxel_size
        self.ids: dict[Voxel, int] = {}
        self.points: list = []

    def insert(self, xyz) -> list[int]:
        ids = []
        for point in xyz:
            voxel = voxel_of(point, self.voxel_size)
            if voxel not in self.ids:
                self.ids[voxel] = len(self.ids)
                self.points.append(point)
            ids.append(self.ids[voxel])
        return ids

    def box(self, low: Voxel, shape: Voxel) -> list[int]:
        cells = itertools.product(
            *(range(start, start + size) for start, size in zip(low, shape, strict=True))
        )
        return [self.ids.get(cell, -1) for cell in cells]

    def by_blocks(self, low: Voxel, width: int) -> list[int]:
        """Voxels of a cube by their blocks of 4 x 4 x 4, then by their places in the block."""
        cells = itertools.product(*(range(start, start + width) for start in low))
        found = [cell for cell in cells if cell in self.ids]
        return [
            self.ids[cell]
            for cell in sorted(
                found, key=lambda cell: ([c // 4 for c in cell], [c % 4 for c in cell])
            )
        ]

    def neighbours(self, voxel_id: int) -> list[int]:
        x, y, z = voxel_of(self.points[voxel_id], self.voxel_size)
        offsets = [
            offset for offset in itertools.product((-1, 0, 1), repeat=3) if offset != (0, 0, 0)
        ]
        return [self.ids.get((x + dx, y + dy, z + dz), -1) for dx, dy, dz in offsets]

    def cells_context(self, voxel_id: int) -> set[int]:
        """Points at most three cells away (III-B)."""
        centre = voxel_of(self.points[voxel_id], self.voxel_size)
        return {
            other
            for voxel, other in self.ids.items()
            if max(abs(a - b) for a, b in zip(voxel, centre, strict=True)) <= 3
        }

    def coarse_context(self, voxel_id: int) -> set[int]:
        """Points in the 27 coarse cells, three voxels a side, around it (the authors' program)."""

        def coarse(point) -> Voxel:
            return voxel_of(point, 3 * self.voxel_size)

        centre = coarse(self.points[voxel_id])
        return {
            other
            for other, point in enumerate(self.points)
            if max(abs(a - b) for a, b in zip(coarse(point), centre, strict=True)) <= 1
        }


def sample(candidates: list[int], uniform: list[float]) -> list[int]:
    """Draw with the given uniform numbers: with replacement where there are too few."""
    candidates = list(candidates)
    enough = len(candidates) >= len(uniform)
    drawn = []
    for k, u in enumerate(uniform):
        done = k if enough else 0
        pick = done + min(
            int(np.float32(u) * np.float64(len(candidates) - done)), len(candidates) - done - 1
        )
        drawn.append(candidates[pick])
        candidates[done], candidates[pick] = candidates[pick], candidates[done]
    return drawn


def connected_components(num_voxels: int, edges: list[tuple[int, int]]) -> list[int]:
    """Label the connected components of all edges so far by the lowest voxel in each (III-C)."""
    component = list(range(num_voxels))
    changed = True
    while changed:
        changed = False
        for a, b in edges:
            low = min(component[a], component[b])
            if component[a] != low or component[b] != low:
                component[a] = component[b] = low
                changed = True
    return component


def smallest_rectangle_area(xy) -> float:
    """Least area of a rectangle around points over turns of one degree."""
    areas = []
    for degrees in range(90):
        turn = math.radians(degrees)
        u = [x * math.cos(turn) + y * math.sin(turn) for x, y in xy]
        v = [y * math.cos(turn) - x * math.sin(turn) for x, y in xy]
        areas.append((max(u) - min(u)) * (max(v) - min(v)))
    return min(areas)


def first_occupied(occupied: set[Voxel], start, direction, longest: float) -> Voxel | None:
    """Walk a ray face by face (voxel v spans [v, v + 1)) to the first occupied voxel, if any."""
    voxel = [math.floor(place) for place in start]
    reached = [math.inf] * 3
    apart = [math.inf] * 3
    step = [0] * 3

    # where along the ray the next face of each axis is, and how far apart they are
    for axis in range(3):
        if direction[axis] != 0:
            step[axis] = 1 if direction[axis] > 0 else -1
            face = voxel[axis] + (step[axis] > 0)
            reached[axis] = (face - start[axis]) / direction[axis]
            apart[axis] = step[axis] / direction[axis]

    # through the nearest face, until something is there
    while min(reached) <= longest:
        axis = reached.index(min(reached))
        voxel[axis] += step[axis]
        reached[axis] += apart[axis]
        if tuple(voxel) in occupied:
            return tuple(voxel)
    return None
