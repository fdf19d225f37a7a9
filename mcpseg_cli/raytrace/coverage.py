"""Waypoints for a building that has none: a scanner sees all there is from them.

Also tells which rooms the robot does not get to.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.building import Building
from mcpseg_cli.raytrace.floor_plan import FloorPlan
from mcpseg_cli.raytrace.occupancy import OccupancyGrid
from mcpseg_cli.raytrace.rays import ScanPattern, visible_voxels

_SPACING = 0.4  # metres between places that waypoints are chosen from
_ANGLE_DEG = 3.0  # between the rays that places are compared with; 5 m away that is 0.26 m
_SHARE = 0.95  # of what is seen from all places; scans between the waypoints see the rest
_AREA = 2.0  # square metres; a place that shows so much more is a waypoint all the same: closets
_MIN_AREA = 0.1  # square metres; a place that shows less is none
_THICKNESS = 0.1  # metres over the floor; its points are no higher


def choose_waypoints(
    grid: OccupancyGrid,
    plan: FloorPlan,
    pattern: ScanPattern,
    sensor_height: float = 1.0,
    *,
    region: int = 1,
    num_threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> NDArray[np.float64]:
    """Choose places in one region of the floor plan that together show what can be seen from it.

    Places are taken greedily, each the one that shows most voxels not seen before (set cover),
    compared with fewer rays than the scanner has.

    Args:
        grid: The building.
        plan: Its floor plan.
        pattern: The scanner; its reach and elevations count.
        sensor_height: Height of the sensor over the floor, metres.
        region: Region of the plan to drive in; 1 is the largest.
        num_threads: Threads to cast rays in; the result does not depend on it.
        progress: Called with how many of how many places have been looked from.

    Returns:
        (W, 2) float64 centres of free cells, metres, map frame, the one that shows most first;
        empty for no free cell.
    """
    places = plan.centre_of(_thinned(plan, region))
    origins = np.column_stack([places, plan.floor_at(places) + sensor_height])

    # what each place shows, looked at with few rays
    coarse = replace(
        pattern,
        horizontal_deg=max(pattern.horizontal_deg, _ANGLE_DEG),
        vertical_deg=max(pattern.vertical_deg, _ANGLE_DEG),
    )
    directions, reach = coarse.directions(), pattern.reach
    views: list[NDArray[np.int32]] = []
    pool = ThreadPoolExecutor(num_threads)
    try:
        for view in pool.map(lambda place: visible_voxels(grid, place, directions, reach), origins):
            views.append(view)
            if progress is not None:
                progress(len(views), len(origins))
    finally:
        pool.shutdown(cancel_futures=True)  # Ctrl-C does not wait for the rest

    # the few that together show what all do
    return places[_cover(views, len(grid), grid.voxel_size)]


def _thinned(plan: FloorPlan, region: int) -> NDArray[np.int64]:
    """Return one cell (M, 2) of the region for each block of ``_SPACING`` that has any."""
    cells = np.argwhere(plan.region == region)
    blocks = (cells + plan.low) // max(1, round(_SPACING / plan.cell_size))
    first = np.unique(blocks, axis=0, return_index=True)[1]
    thinned: NDArray[np.int64] = cells[np.sort(first)]
    return thinned


def _cover(views: list[NDArray[np.int32]], num_voxels: int, voxel_size: float) -> NDArray[np.int64]:
    """Choose views that show most of the union of all (lazy greedy set cover; Minoux, 1978)."""
    # what can be seen at all, and how little of it may be missing
    in_union = np.zeros(num_voxels, np.bool_)
    for view in views:
        in_union[view] = True
    missing, enough = np.count_nonzero(in_union), (1.0 - _SHARE) * np.count_nonzero(in_union)

    is_seen = np.zeros(num_voxels, np.bool_)
    queue: list[tuple[int, int]] = [(-len(view), number) for number, view in enumerate(views)]
    heapq.heapify(queue)
    chosen = []
    while queue:
        # the first of the queue, whose gain there may be an older, higher one
        number = queue[0][1]
        gain = int(np.count_nonzero(~is_seen[views[number]]))
        if len(queue) > 1 and (-gain, number) > min(queue[1:3]):
            heapq.heapreplace(queue, (-gain, number))
            continue

        # it shows most: take it, or stop where it shows too little
        if gain * voxel_size**2 < (_MIN_AREA if missing > enough else _AREA):
            break
        heapq.heappop(queue)
        chosen.append(number)
        is_seen[views[number]] = True
        missing -= gain
    return np.array(chosen, np.int64)


def room_of_cells(building: Building, plan: FloorPlan) -> NDArray[np.int32]:
    """Return the (X, Y) int32 room with most floor points in each cell of the plan; -1 for none."""
    starts = building.room_starts
    if starts is None:
        starts = np.array([0, len(building)] if building.rooms else [0], np.int64)
    highest = plan.floor + np.float32(_THICKNESS)
    return _count_floor(building.xyz, starts, plan.cell_size, plan.low, highest)


def reached_shares(
    building: Building, plan: FloorPlan, regions: NDArray[np.int32]
) -> dict[str, float]:
    """Measure how much of each room's free floor a robot gets to.

    Args:
        building: The building the plan was made from.
        plan: Its floor plan.
        regions: (G,) int32 numbers of regions of the plan, such as those of a route.

    Returns:
        The share by room, 0-1, in the order of the building; 0 for a room without free floor; empty
        when the rooms are not known.
    """
    # cells of each room's free floor
    room = room_of_cells(building, plan)
    free = np.bincount(room[plan.free & (room >= 0)], minlength=len(building.rooms))

    # those in regions that are driven in
    driven = np.isin(plan.region, regions[regions > 0]) & (room >= 0)
    reached = np.bincount(room[driven], minlength=len(building.rooms)) / np.maximum(free, 1)
    return dict(zip(building.rooms, reached.tolist(), strict=True))


@njit(cache=True)
def _count_floor(
    xyz: NDArray[np.float32],
    room_starts: NDArray[np.int64],
    cell_size: float,
    low: NDArray[np.int64],
    highest: NDArray[np.float32],
) -> NDArray[np.int32]:
    """Return for each cell the room with most points up to ``highest``, the first of equal ones."""
    most = np.zeros(highest.shape, np.int32)
    owner = np.full(highest.shape, -1, np.int32)
    for room in range(len(room_starts) - 1):
        count = np.zeros(highest.shape, np.int32)
        for row in range(room_starts[room], room_starts[room + 1]):
            x = int(np.floor(np.float64(xyz[row, 0]) / cell_size + 0.5)) - low[0]
            y = int(np.floor(np.float64(xyz[row, 1]) / cell_size + 0.5)) - low[1]
            if xyz[row, 2] <= highest[x, y]:  # never where there is no floor
                count[x, y] += 1
                if count[x, y] > most[x, y]:
                    most[x, y] = count[x, y]
                    owner[x, y] = room
    return owner
