"""Where a robot can go between the furniture of a room."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from mcpseg_cli.synth.building.walls import leaf_line
from mcpseg_cli.synth.geometry.collisions import Boxes, reach_of, upright
from mcpseg_cli.synth.plan import Opening, Room

CELL = 0.1
"""Edge of a cell, metres."""
ROBOT_RADIUS = 0.26
"""Half the width that has to fit through, metres: on such cells a way of 0.52 m is never lost."""
ROBOT_HEIGHT = 1.5
"""What hangs higher is no obstacle, metres."""


class FloorSpace:
    """Raster of a room's floor: where a robot can stand and get to from the doors."""

    def __init__(self, room: Room) -> None:
        """Rasterise a room without furniture; columns and open leaves are obstacles."""
        self._low = room.low
        shape = np.maximum(np.floor((room.high - room.low) / CELL).astype(int), 1)
        self._x = room.low[0] + (np.arange(shape[0]) + 0.5) * CELL
        self._y = room.low[1] + (np.arange(shape[1]) + 0.5) * CELL

        # walls keep the robot off by its radius
        axes = zip((self._x, self._y), room.low, room.high, strict=True)
        along, across = (
            (axis > low + ROBOT_RADIUS) & (axis < high - ROBOT_RADIUS) for axis, low, high in axes
        )
        self.free: NDArray[np.bool_] = along[:, None] & across

        # so do columns, which are taken up to the ceiling, and open leaves
        standing = [box for box in room.taken if box[1, 2] > room.ceiling - 0.1 and box[0, 2] < 0.5]
        obstacles = [upright(low, high) for low, high in standing]
        leaves = [leaf for opening in room.openings for leaf in leaf_line(room, opening)]
        obstacles += [_leaf_box(*leaf) for leaf in leaves]
        for obstacle in obstacles:
            window, blocked = self._shadow(obstacle)
            self.free[window] &= ~blocked

        # it comes in through the doors, whatever stands there
        doors = [opening for opening in room.openings if opening.kind != "window"]
        self._doors = [
            self._cells_at(room, door.side, (door.start + door.end) / 2) for door in doors
        ]
        for cells in self._doors:
            self.free[cells] = True
        self._lost = self._cut_off(self.free)
        self._allowed = self._lost + max(20, int(0.015 * self.free.sum()))

    def admits(self, boxes: Boxes) -> bool:
        """Take an object's boxes, (P, 8), in, unless it cuts floor off from the doors."""
        standing = boxes[(boxes[:, 6] < ROBOT_HEIGHT)]
        if len(standing) == 0:
            return True
        window, blocked = self._shadow(standing)
        if not (self.free[window] & blocked).any():
            return True

        # nothing changes if it is refused
        free = self.free.copy()
        free[window] &= ~blocked
        lost = self._cut_off(free)
        if lost > self._allowed:
            return False
        self.free = free
        return True

    def _cells_at(self, room: Room, side: int, along: float) -> tuple[slice, slice]:
        """Return the cells in front of an opening's middle, 0.2-0.5 m into the room."""
        x = {0: along, 1: room.high[0] - 0.35, 2: along, 3: room.low[0] + 0.35}[side]
        y = {0: room.low[1] + 0.35, 1: along, 2: room.high[1] - 0.35, 3: along}[side]
        cell = ((np.array([x, y]) - self._low) / CELL).astype(int)
        spot = np.clip(cell, 1, np.array(self.free.shape) - 2)
        return slice(spot[0] - 1, spot[0] + 2), slice(spot[1] - 1, spot[1] + 2)

    def _shadow(self, boxes: Boxes) -> tuple[tuple[slice, slice], NDArray[np.bool_]]:
        """Return a window of cells and which of them a robot cannot stand in beside the boxes."""
        reach = reach_of(boxes) + ROBOT_RADIUS
        low = np.floor(((boxes[:, :2] - reach).min(axis=0) - self._low) / CELL).astype(int).clip(0)
        high = np.ceil(((boxes[:, :2] + reach).max(axis=0) - self._low) / CELL).astype(int).clip(0)
        window = slice(low[0], high[0]), slice(low[1], high[1])

        # how far cells are from each box, in its own frame
        x = self._x[window[0]][None, :, None] - boxes[:, 0, None, None]
        y = self._y[window[1]][None, None, :] - boxes[:, 1, None, None]
        cosine, sine = boxes[:, 2, None, None], boxes[:, 3, None, None]
        along = np.maximum(np.abs(x * cosine + y * sine) - boxes[:, 4, None, None], 0)
        across = np.maximum(np.abs(y * cosine - x * sine) - boxes[:, 5, None, None], 0)
        blocked: NDArray[np.bool_] = (along**2 + across**2 < ROBOT_RADIUS**2).any(axis=0)
        return window, blocked

    def _cut_off(self, free: NDArray[np.bool_]) -> int:
        """Count free cells the doors do not lead to; a door that is shut in counts as all."""
        labels, count = ndimage.label(free)
        if count == 0:
            return free.size
        sizes = np.bincount(labels.ravel())[1:]
        if not self._doors:
            return int(sizes.sum() - sizes.max())

        # the largest region at the first door has to reach all others
        main = set(np.unique(labels[self._doors[0]]).tolist()) - {0}
        if not main:
            return free.size
        best = max(main, key=lambda label: int(sizes[label - 1]))
        if any(best not in labels[cells] for cells in self._doors):
            return free.size
        return int(sizes.sum() - sizes[best - 1])


def _leaf_box(hinge: NDArray[np.float64], edge: NDArray[np.float64]) -> Boxes:
    """Return the box, (1, 8), of a door's leaf between two points, (2,) each."""
    along = edge - hinge
    length = float(np.hypot(*along))
    cosine, sine = along / length
    middle = (hinge + edge) / 2
    return np.array([[middle[0], middle[1], cosine, sine, length / 2, 0.025, 0.0, 2.0]])


def in_front(room: Room, opening: Opening, depth: float) -> Boxes:
    """Return the box of a depth in front of an opening, inside the room."""
    first, last = np.empty(3), np.empty(3)
    axis, along = (0, 1) if opening.side % 2 else (1, 0)  # across the wall and along it

    first[along], last[along] = opening.start, opening.end
    near = room.low[axis] if opening.side in (0, 3) else room.high[axis] - depth
    first[axis], last[axis] = near, near + depth
    first[2], last[2] = opening.low, opening.high
    return upright(first, last)
