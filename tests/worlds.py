"""Small buildings of rectangles, sampled on a lattice, for the tests of floor plans and routes."""

import numpy as np

from mcpseg_cli.building import Building
from mcpseg_cli.raytrace.floor_plan import FloorPlan, _label

SPACING = 0.08  # metres between points: no voxel of 0.1 m is missed
HEIGHT = 2.6


def rectangle(low, high, spacing=SPACING):
    """Sample a box of which one side has no length."""
    low, high = np.array(low, float), np.array(high, float)
    counts = np.maximum(np.ceil((high - low) / spacing).astype(int), 1)
    axes = [
        start + (np.arange(n) + 0.5) * (end - start) / n
        for start, end, n in zip(low, high, counts, strict=True)
    ]
    return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1).astype(
        np.float32
    )


def box(low, high):
    """Sample the six sides of a box."""
    sides = []
    for axis in range(3):
        for value in (low[axis], high[axis]):
            near, far = list(low), list(high)
            near[axis] = far[axis] = value
            sides.append(rectangle(near, far))
    return np.concatenate(sides)


def wall(start, end, door=None):
    """Sample a wall from (x, y) to (x, y) along an axis; ``door``: from where to where along it."""
    axis = int(start[0] == end[0])
    if door is None:
        return rectangle([*start, 0.0], [*end, HEIGHT])
    left, right = list(end), list(start)
    left[axis], right[axis] = door
    over = rectangle(
        [*right_of(start, axis, door[0]), 2.0], [*right_of(end, axis, door[1]), HEIGHT]
    )
    return np.concatenate([wall(start, left), over, wall([*right_of(start, axis, door[1])], end)])


def right_of(place, axis, value):
    moved = list(place)
    moved[axis] = value
    return moved


def room(low, high):
    """Sample floor and ceiling."""
    return np.concatenate([rectangle([*low, z], [*high, z]) for z in (0.0, HEIGHT)])


def table(low, high):
    """Sample a table top and its legs."""
    legs = [
        box([x, y, 0.0], [x + 0.05, y + 0.05, 0.7])
        for x in (low[0], high[0] - 0.05)
        for y in (low[1], high[1])
    ]
    return np.concatenate([box([*low, 0.7], [*high, 0.75]), *legs])


def three_rooms():
    """Rooms of 4 m x 4 m along x: a table in one, a doorway to the second, the third is closed."""
    outside = [wall((0, y), (12, y)) for y in (0.0, 4.0)] + [
        wall((x, 0), (x, 4)) for x in (0.0, 12.0)
    ]
    inside = [wall((4, 0), (4, 4), door=(1.4, 2.4)), wall((8, 0), (8, 4))]
    return np.concatenate([room((0, 0), (12, 4)), *outside, *inside, table((1.2, 1.4), (2.4, 2.4))])


def offices(rng, num_rooms=4):
    """A corridor with rooms of 4 m x 4 m on both sides, in each a cupboard, a table and a box."""
    length = 4.0 * num_rooms / 2
    parts = [room((0, 0), (length, 10))]
    parts += [wall((0, y), (length, y)) for y in (0.0, 10.0)]
    parts += [wall((x, 0), (x, 10)) for x in (0.0, length)]
    for left in np.arange(0, length, 4.0):
        for low, side in ((0.0, 4.0), (6.0, 6.0)):
            parts.append(wall((left, side), (left + 4, side), door=(left + 1.5, left + 2.4)))
            if left > 0:
                parts.append(wall((left, low), (left, low + 4)))
            x, y = rng.uniform([left + 0.4, low + 1.0], [left + 1.8, low + 2.0])
            parts += [
                table((x, y), (x + 1.4, y + 0.8)),
                box((left + 3, low + 0.2, 0), (left + 3.9, low + 0.6, 2)),
            ]
            parts.append(box((left + 3.2, y, 0.0), (left + 3.7, y + 0.5, 0.5)))
    return np.concatenate(parts)


def building_of(xyz, names, boundaries):
    """Make a building whose rooms lie side by side along x, parted at ``boundaries``."""
    number = np.searchsorted(boundaries, xyz[:, 0])
    order = np.argsort(number, kind="stable")
    count = len(xyz)
    starts = np.concatenate([[0], np.cumsum(np.bincount(number, minlength=len(names)))])
    nothing = np.zeros(count, np.int32)
    rgb = np.zeros((count, 3), np.uint8)
    return Building(
        xyz[order], rgb, nothing.astype(np.uint8), nothing, rooms=names, room_starts=starts
    )


def plan_of(free):
    """Make the plan of a level floor at z = 0.5 m with these free cells."""
    return FloorPlan(
        0.2, np.array([-3, 7]), np.full(free.shape, 0.5, np.float32), free, _label(free)
    )


def random_plan(rng, shape=(30, 24), share=0.3):
    """Make a plan with obstacles scattered over it."""
    free = np.pad(rng.random(shape) > share, 1)
    return plan_of(free)
