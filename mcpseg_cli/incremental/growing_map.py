"""The look-up table as a robot fills it (III-B): points near it go in, the floor is found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.config import MapSettings
from mcpseg_cli.incremental.column import IN_MEMORY, Memory
from mcpseg_cli.incremental.floor import find_floor
from mcpseg_cli.incremental.stopwatch import Stopwatch
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.scan import Scan, colour_of, near_robot

ROOM_HEIGHT = 8.0
"""Metres above and below the robot that belong to its room."""


@dataclass(frozen=True)
class Observation:
    """What one scan shows of the map.

    Attributes:
        point_ids: (N,) int32 voxel of every point of the scan, -1 for points out of range.
        first_new: Id of the first new voxel.
        new: (M,) int32 voxels seen for the first time: from ``first_new`` to the end of the map, in
            the order of the points that founded them.
        seen_again: (S,) int32 voxels known before, ascending.
        floor: Height of the floor, metres, map frame; None before any scan came in range.
        ms: Milliseconds by stage: ``insert`` and ``floor``.
    """

    point_ids: NDArray[np.int32]
    first_new: int
    new: NDArray[np.int32]
    seen_again: NDArray[np.int32]
    floor: float | None
    ms: dict[str, float]


class GrowingMap:
    """A voxel map that is fed one scan at a time; what segmentation sees, training sees.

    Args:
        settings: Edge of a voxel, range and floor.
        memory: Where the rows of the map are.

    Attributes:
        voxels: The look-up table.
        floor: Height of the floor at the last scan, metres, map frame; None before any came in
            range.
    """

    def __init__(self, settings: MapSettings, memory: Memory = IN_MEMORY) -> None:
        self.voxels = VoxelMap(settings.voxel_size, memory)
        self.floor: float | None = None
        self._settings = settings

    def observe(self, scan: Scan) -> Observation:
        """Insert the points of a scan that are near the robot, and find the floor under it.

        Args:
            scan: Points in the map frame.
        """
        clock = Stopwatch()
        first_new = len(self.voxels)

        # points near the robot
        near = near_robot(scan, self._settings.local_range)
        near_xyz = scan.xyz[near]

        # new table entries
        point_ids = np.full(len(scan.xyz), -1, np.int32)
        point_ids[near] = self.voxels.insert(near_xyz, colour_of(scan, near))
        new = np.arange(first_new, len(self.voxels), dtype=np.int32)
        seen_again = _distinct(point_ids[near & (point_ids < first_new)])
        clock.lap("insert")

        # the floor level
        if len(near_xyz):
            rule, position = self._settings.floor, scan.position
            self.floor = find_floor(rule, self.voxels, position, near_xyz, self.floor)
        clock.lap("floor")

        return Observation(point_ids, first_new, new, seen_again, self.floor, clock.ms)

    def find_points(self, scan: Scan) -> NDArray[np.int32]:
        """Return (N,) int32: voxel of each point of a scan observed before, -1 out of range."""
        near = near_robot(scan, self._settings.local_range)
        point_ids = np.full(len(scan.xyz), -1, np.int32)
        point_ids[near] = self.voxels.find(scan.xyz[near])
        return point_ids


def _distinct(ids: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return distinct ids, ascending; sorting int32 is several times faster than ``np.unique``."""
    ascending = np.sort(ids)
    return ascending[np.diff(ascending, prepend=-1) > 0]
