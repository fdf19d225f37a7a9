"""The route of the robot: waypoints in order, the way between them and where it scans."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from mcpseg_cli.errors import InputError
from mcpseg_cli.raytrace.floor_plan import FloorPlan

_STARTS = 30  # waypoints that orders for 2-opt to improve start from
_TINY = 1e-9  # metres; keeps rounding from adding or losing a scan


@dataclass(frozen=True)
class Route:
    """A drive through a building: one segment in each region of the floor plan that has waypoints.

    Attributes:
        positions: (S, 3) float64 where the sensor scans, metres, map frame, in the order of
            driving.
        poses: (S, 4, 4) float64 sensor to map; x is the direction of travel, z is up.
        path: (P, 2) float64 corners of the way, metres, map frame, segment after segment.
        waypoints: (W, 2) float64 what was visited, in that order: centres of cells.
        skipped: (K, 2) float64 waypoints, as given, that are not in free space.
        regions: (G,) int32 region of the floor plan that each segment is driven in.
        scan_starts: (G + 1,) int64; segment ``g`` has the positions from ``scan_starts[g]`` to
            ``scan_starts[g + 1]``.
        path_starts: (G + 1,) int64, the same for ``path``.
    """

    positions: NDArray[np.float64]
    poses: NDArray[np.float64]
    path: NDArray[np.float64]
    waypoints: NDArray[np.float64]
    skipped: NDArray[np.float64]
    regions: NDArray[np.int32]
    scan_starts: NDArray[np.int64]
    path_starts: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.positions)

    @property
    def length(self) -> float:
        """Metres driven; ways between segments do not count."""
        parts = np.split(self.path, self.path_starts[1:-1])
        return float(sum(np.linalg.norm(np.diff(part, axis=0), axis=1).sum() for part in parts))


def read_waypoints(path: Path) -> NDArray[np.float64]:
    """Read waypoints from a text file such as the paper's program has: ``x y`` on each line.

    Args:
        path: Numbers are separated by spaces, tabs or commas; columns after the second are ignored,
            as are empty lines, what follows a ``#``, and a first line ``x y``.

    Returns:
        (W, 2) float64, metres, map frame; at least one.

    Raises:
        InputError: A line is not two finite numbers, or there is none.
        OSError: The file cannot be opened.
    """
    waypoints: list[tuple[float, float]] = []
    lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    for number, line in enumerate(lines, 1):
        fields = line.partition("#")[0].replace(",", " ").split()
        is_header = not waypoints and [field.lower() for field in fields[:2]] == ["x", "y"]
        if not fields or is_header:
            continue

        # two finite numbers, whatever follows them
        try:
            x, y = (float(field) for field in fields[:2])
        except ValueError:
            x = y = np.nan
        if not np.isfinite([x, y]).all():
            source, found = f"{path}, line {number}", f"{line.strip()[:40]!r}"
            raise InputError(source, found, "x and y in metres", "correct the line")
        waypoints.append((x, y))

    if not waypoints:
        expected, remedy = "a line 'x y' in metres for each", "add some or leave the file out"
        raise InputError(path, "no waypoints", expected, remedy)
    return np.array(waypoints, np.float64)


def plan_route(
    plan: FloorPlan, waypoints: NDArray[np.float64], step: float = 0.2, sensor_height: float = 1.0
) -> Route:
    """Plan the shortest drive past waypoints and a scan every ``step`` metres on it (paper III-A).

    Waypoints move to the centre of their cell; several in one cell are one. The order is the best
    of several that 2-opt finds; between two of them the robot takes the shortest way over the 8
    neighbours of cells and never cuts the corner of an occupied one. A place passed twice is
    scanned twice. Regions that are not connected are driven one after the other, the largest first.

    Args:
        plan: Where the robot can stand.
        waypoints: (W, 2) float64, metres, map frame.
        step: Metres from scan to scan along the way, across corners; each segment starts with a
            scan.
        sensor_height: Height of the sensor over the floor, metres.

    Returns:
        The route; empty when no waypoint is in free space.
    """
    # one drive in each region that has waypoints, past each cell once
    region = plan.region_at(waypoints)
    cells = plan.cell_of(waypoints)
    segments, orders = [], []
    regions = np.unique(region[region > 0])
    for number in regions:
        places = cells[region == number]
        first = np.sort(np.unique(places, axis=0, return_index=True)[1])
        order, path = _drive(plan, int(number), places[first])
        orders.append(plan.centre_of(order))
        segments.append(plan.centre_of(path))

    # a scan every step
    poses = [_scans(plan, path, step, sensor_height) for path in segments]
    every_pose = np.concatenate([np.empty((0, 4, 4)), *poses])

    return Route(
        positions=every_pose[:, :3, 3],
        poses=every_pose,
        path=np.concatenate([np.empty((0, 2)), *segments]),
        waypoints=np.concatenate([np.empty((0, 2)), *orders]),
        skipped=waypoints[region == 0],
        regions=regions,
        scan_starts=np.cumsum([0, *(len(part) for part in poses)]),
        path_starts=np.cumsum([0, *(len(part) for part in segments)]),
    )


def _drive(
    plan: FloorPlan, region: int, cells: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the cells (W, 2) in visiting order, and the corners (P, 2) of the way past them."""
    # how far each waypoint is from each other
    inside = np.argwhere(plan.region == region)
    index = np.full(plan.region.shape, -1)
    index[tuple(inside.T)] = np.arange(len(inside))
    graph = _graph(index, len(inside))
    nodes = index[tuple(cells.T)]
    distance = np.stack([dijkstra(graph, indices=node)[nodes] for node in nodes])

    order = visiting_order((distance + distance.T) / 2)  # rounding must not make it asymmetric

    # the shortest way from waypoint to waypoint, found backwards
    steps = [nodes[order[:1]]]
    for here, there in pairwise(order):
        limit = distance[here, there] + 0.5
        previous = dijkstra(graph, indices=nodes[here], limit=limit, return_predecessors=True)[1]
        way = [nodes[there]]
        while way[-1] != nodes[here]:
            way.append(previous[way[-1]])
        steps.append(np.array(way[-2::-1], dtype=np.int64))

    # only its corners
    path = inside[np.concatenate(steps)]
    moves = np.diff(path, axis=0)
    turns = np.flatnonzero((moves[1:] != moves[:-1]).any(axis=1)) + 1
    corners = np.unique(np.concatenate([[0], turns, [len(path) - 1]]))
    return cells[order], path[corners]


def _graph(index: NDArray[np.int64], count: int) -> csr_array:
    """Return the moves, in cells, from node to node."""
    starts, ends, lengths = [], [], []
    padded = np.pad(index, 1, constant_values=-1)
    nodes = np.argwhere(padded >= 0)
    for move in ((1, 0), (0, 1), (1, 1), (1, -1)):
        # a diagonal one only where both cells beside it are free: no corner is cut
        target = padded[tuple((nodes + move).T)]
        beside_x = padded[nodes[:, 0] + move[0], nodes[:, 1]]
        beside_y = padded[nodes[:, 0], nodes[:, 1] + move[1]]
        possible = (target >= 0) & (beside_x >= 0) & (beside_y >= 0)
        starts.append(np.flatnonzero(possible))
        ends.append(target[possible])
        lengths.append(np.full(len(ends[-1]), np.hypot(*move)))

    # there and back
    start, end, length = np.concatenate(starts), np.concatenate(ends), np.concatenate(lengths)
    both = (np.concatenate([start, end]), np.concatenate([end, start]))
    return coo_array((np.tile(length, 2), both), shape=(count, count)).tocsr()


def visiting_order(distance: NDArray[np.float64]) -> NDArray[np.int64]:
    """Order places so that the way past all of them is short; it may start and end anywhere.

    Args:
        distance: (W, W) float64 from each place to each other, symmetric, finite.

    Returns:
        (W,) int64; no longer than the nearest-neighbour order from the first place. Empty for no
        place.
    """
    best, shortest = np.arange(len(distance)), np.inf
    starts = np.linspace(0, len(distance) - 1, min(len(distance), _STARTS)).astype(int)
    for start in np.unique(starts):
        order = _nearest_neighbours(distance, start)
        _two_opt(distance, order)
        length = distance[order[:-1], order[1:]].sum()
        if length < shortest:
            best, shortest = order, length
    return best


@njit(cache=True)
def _nearest_neighbours(distance: NDArray[np.float64], start: int) -> NDArray[np.int64]:
    """Go from place to the nearest one not visited yet."""
    count = len(distance)
    order = np.empty(count, np.int64)
    is_visited = np.zeros(count, np.bool_)
    here = start
    for place in range(count):
        order[place] = here
        is_visited[here] = True

        nearest = -1
        for there in range(count):
            if is_visited[there]:
                continue
            if nearest < 0 or distance[here, there] < distance[here, nearest]:
                nearest = there
        here = nearest
    return order


@njit(cache=True)
def _two_opt(distance: NDArray[np.float64], order: NDArray[np.int64]) -> None:
    """Reverse parts of an open path as long as one gets it shorter (2-opt; Croes, 1958)."""
    count = len(order)
    has_improved = True
    while has_improved:
        has_improved = False
        for first in range(count - 1):
            for last in range(first + 1, count):
                # only the two moves at its ends change
                gain = 0.0
                if first > 0:
                    before = order[first - 1]
                    gain += distance[before, order[first]] - distance[before, order[last]]
                if last < count - 1:
                    after = order[last + 1]
                    gain += distance[order[last], after] - distance[order[first], after]

                if gain > _TINY:
                    order[first : last + 1] = order[first : last + 1][::-1].copy()
                    has_improved = True


def _scans(
    plan: FloorPlan, path: NDArray[np.float64], step: float, sensor_height: float
) -> NDArray[np.float64]:
    """Return the (S, 4, 4) poses every ``step`` metres along a polyline (P, 2)."""
    # on which move each scan is
    moves = np.diff(path, axis=0, append=path[-1:])
    arrival = np.concatenate([[0.0], np.cumsum(np.linalg.norm(moves[:-1], axis=1))])
    along = step * np.arange(int(arrival[-1] / step + _TINY) + 1)
    place = np.searchsorted(arrival, along + _TINY, side="right") - 1
    place = np.clip(place, 0, max(0, len(path) - 2))

    # turned to where the robot drives
    yaw = np.arctan2(moves[place, 1], moves[place, 0])
    poses = np.tile(np.eye(4), (len(along), 1, 1))
    poses[:, 0, 0] = poses[:, 1, 1] = np.cos(yaw)
    poses[:, 1, 0] = np.sin(yaw)
    poses[:, 0, 1] = -np.sin(yaw)

    # on its way, over its floor
    for axis in (0, 1):
        poses[:, axis, 3] = np.interp(along, arrival, path[:, axis])
    poses[:, 2, 3] = plan.floor_at(poses[:, :2, 3]) + sensor_height
    return poses
