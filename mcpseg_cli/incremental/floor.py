"""The height of the floor (III-B: "the z-coordinate is zero at the floor level").

The lowest point of a scan is the floor only for a scanner that sees the whole sphere and no stray
point below it. The map around the robot remembers a floor that this scan does not see.
"""

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import FloorRule
from mcpseg_cli.grid import voxel_of
from mcpseg_cli.incremental.voxel_map import VoxelMap

_RADIUS = 2.0  # metres around the robot in which to look
_BELOW = 3.0  # the floor is at most this far below the sensor, metres
_ABOVE = 0.15  # ... or this far above the pose, for poses given at the robot's foot
_FLAT_NEIGHBOURS = 6  # of 8 beside a voxel, a layer up or down allowed
_CLEAR_LAYERS = (2, 3, 4)  # nothing is above a floor; above a voxel of a thick wall is wall
_MIN_AREA = 0.2  # square metres of flat voxels that make a floor
_MIN_SHARE = 0.2  # ... and their share of the largest flat layer


def floor_height(voxel_map: VoxelMap, position: NDArray[np.float64]) -> float | None:
    """Find the lowest large level surface around the robot.

    Args:
        voxel_map: The map, this scan included.
        position: (3,) float64 sensor position, metres, map frame.

    Returns:
        Mean height of that surface's points, metres, map frame; None if the map shows no level
        surface there.
    """
    size = voxel_map.voxel_size

    # the map around the robot
    corners = np.array([[-_RADIUS, -_RADIUS, -_BELOW], [_RADIUS, _RADIUS, _ABOVE]])
    low, high = voxel_of(position + corners, size)
    shape = high - low + 1
    ids = voxel_map.occupancy(low, (int(shape[0]), int(shape[1]), int(shape[2])))
    flat = _flat(ids >= 0)

    # a floor at a voxel border is split between two layers
    area = flat.sum(axis=(0, 1))
    area[:-1] += area[1:]

    # the lowest of the large surfaces
    is_wide = (area * size**2 >= _MIN_AREA) & (area >= _MIN_SHARE * area.max(initial=0))
    wide = np.flatnonzero(is_wide)
    if len(wide) == 0:
        return None
    layers = slice(wide[0], wide[0] + 2)
    return float(voxel_map.xyz[ids[:, :, layers][flat[:, :, layers]], 2].mean(dtype=np.float64))


def find_floor(
    rule: FloorRule | float,
    voxel_map: VoxelMap,
    position: NDArray[np.float64],
    near_xyz: NDArray[np.float32],
    last: float | None,
) -> float:
    """Apply a floor setting.

    Where the map shows no floor, the last one holds, else the scan's lowest point.

    Args:
        rule: The setting: from the map around the robot, the scan's lowest point, or a height.
        voxel_map: The map, this scan included.
        position: (3,) float64 sensor position, metres, map frame.
        near_xyz: (N, 3) float32, metres, map frame: the scan's points in range, at least one.
        last: Floor of the scan before; None at the first.

    Returns:
        Height of the floor, metres, map frame.
    """
    if isinstance(rule, float):
        return rule

    # the floor remembered, where the map shows none
    if rule == "map":
        found = floor_height(voxel_map, position)
        found = last if found is None else found
        if found is not None:
            return found

    return float(near_xyz[:, 2].min())


def _flat(occupied: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark voxels with most neighbours beside them occupied and nothing above; (X, Y, Z)."""
    thick = occupied.copy()
    thick[:, :, 1:] |= occupied[:, :, :-1]
    thick[:, :, :-1] |= occupied[:, :, 1:]

    # occupied neighbours of each voxel, itself not among them
    thick = np.pad(thick.view(np.uint8), ((1, 1), (1, 1), (0, 0)))
    rows = thick[:-2] + thick[1:-1] + thick[2:]
    beside: NDArray[np.uint8] = rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:] - thick[1:-1, 1:-1]

    flat = occupied & (beside >= _FLAT_NEIGHBOURS)
    for layer in _CLEAR_LAYERS:
        flat[:, :, :-layer] &= ~occupied[:, :, layer:]
    return flat
