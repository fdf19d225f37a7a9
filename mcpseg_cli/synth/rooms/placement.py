"""Putting objects into a room so that nothing meets, floats, or shuts a way off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mcpseg_cli.synth.geometry.collisions import Boxes, Collisions, boxes_of, extent, moved, upright
from mcpseg_cli.synth.geometry.shapes import Points
from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.plan import Opening, Room
from mcpseg_cli.synth.rooms.floor_space import FloorSpace
from mcpseg_cli.synth.surfaces.styles import Style

_DOOR_DEPTH = 0.7  # metres in front of a door that stay free
_WINDOW_DEPTH = 0.1
_CORNERS = (0.7, 0.15, 0.15)  # shares of things along a wall, at its low end and at its high end


@dataclass(frozen=True)
class Placed:
    """An object, or one with the things on it, that found its place.

    Attributes:
        items: The objects in the map frame; the first is the main one.
        size: (3,) its width, depth and height in its own frame, metres.
        x: Where the origin of its own frame (the middle of its back) lies, map frame.
        y: The same along y.
        z: The same along z.
        yaw: How it is turned, radians.
    """

    items: tuple[Item, ...]
    size: Points
    x: float
    y: float
    z: float
    yaw: float

    @cached_property
    def top(self) -> tuple[float, Points] | None:
        """Height of the largest level surface of the main object, and its triangles seen from above, (T, 3, 2).

        None if it has none of at least 0.02 square metres.
        """
        return _top_of(self.items[0])

    def at(self, along: float, out: float) -> tuple[float, float]:
        """Return the map x and y of a spot in its own frame."""
        cosine, sine = np.cos(self.yaw), np.sin(self.yaw)
        return float(self.x + cosine * along - sine * out), float(
            self.y + sine * along + cosine * out
        )


class Placement:
    """The furniture of a room while it is being placed."""

    def __init__(self, room: Room, style: Style, rng: np.random.Generator) -> None:
        """Start with the bare room: what is taken, its doors and windows keep furniture off."""
        self.room, self.style, self.rng = room, style, rng
        self.placed: list[Placed] = []
        self.rugs: list[Item] = []
        self.size = room.high - room.low
        self._floor = FloorSpace(room)
        self._solids, self._windows = Collisions(), Collisions()
        for taken in room.taken:
            self._solids.add(upright(taken[0], taken[1]))
        for opening in room.openings:
            depth = _WINDOW_DEPTH if opening.kind == "window" else _DOOR_DEPTH
            (self._windows if opening.kind == "window" else self._solids).add(
                self._in_front(opening, depth)
            )

    @property
    def items(self) -> list[Item]:
        """Everything placed so far, map frame."""
        return [item for placed in self.placed for item in placed.items] + self.rugs

    def mess(self) -> float:
        """Return how untidy the building is, 0-1."""
        return 1.0 - self.style.tidiness

    def times(self, mean: float) -> int:
        """Return a random number of things with a mean."""
        return int(self.rng.poisson(max(mean, 0.0)))

    def chance(self, share: float) -> bool:
        """Return True that often."""
        return bool(self.rng.random() < share)

    def keep_free(self, low: Sequence[float], high: Sequence[float]) -> None:
        """Keep a box between two corners, map frame, free from now on."""
        self._solids.add(upright(np.asarray(low, np.float64), np.asarray(high, np.float64)))

    def put(
        self, things: Item | Sequence[Item], pose: tuple[float, float, float, float], *, over_windows: bool = False,
        on: Placed | None = None,
    ) -> Placed | None:  # fmt: skip
        """Place an object, or one with things on it, if there is room.

        Args:
            things: In their own frame.
            pose: x, y, z of the origin of their frame and yaw, map frame.
            over_windows: Whether it may hang in front of windows.
            on: What it stands on; its top has to hold the whole foot of the first object.

        Returns:
            Where it was placed; None if it meets something, leaves the room, cuts off floor or
            would float.
        """
        items = (things,) if isinstance(things, Item) else tuple(things)
        own = np.concatenate([boxes_of(item) for item in items])
        return self._put(items, own, pose, over_windows=over_windows, on=on)

    def try_poses(
        self, things: Item | Sequence[Item], poses: Sequence[tuple[float, float, float, float]], *,
        over_windows: bool = False,
        on: Placed | None = None,
    ) -> Placed | None:  # fmt: skip
        """Place an object at the first of the poses where there is room; see ``put``."""
        items = (things,) if isinstance(things, Item) else tuple(things)
        own = np.concatenate([boxes_of(item) for item in items])
        for pose in poses:
            placed = self._put(items, own, pose, over_windows=over_windows, on=on)
            if placed is not None:
                return placed
        return None

    def against_wall(
        self, things: Item | Sequence[Item], *, z: float = 0.0, gap: float = 0.03, near: Placed | None = None,
        tries: int = 8,
        over_windows: bool = False, sides: Sequence[int] = (0, 1, 2, 3), turn: float = 0.01,
    ) -> Placed | None:  # fmt: skip
        """Place an object with its back to a wall: at a random spot, in a corner, or beside another."""
        items = (things,) if isinstance(things, Item) else tuple(things)
        half = _width(items) / 2
        poses = []
        if near is not None:
            for sign in self.rng.permutation([-1.0, 1.0]):
                step = sign * (near.size[0] / 2 + half + self.rng.uniform(0.004, 0.03))
                x, y = near.at(float(step), 0.0)
                poses.append((x, y, z, near.yaw))
        lengths = np.array([self.size[side % 2] for side in sides])
        for _ in range(tries):
            side = sides[int(self.rng.choice(len(sides), p=lengths / lengths.sum()))]
            room_left = float(self.size[side % 2]) - 2 * half
            if room_left <= 0:
                continue
            corner = min(0.02, room_left)
            along = half + float(
                self.rng.choice(
                    [self.rng.uniform(0, room_left), corner, room_left - corner], p=_CORNERS
                )
            )
            tilt = self.rng.normal(0, turn)
            poses.append(
                self.wall_pose(
                    side,
                    along,
                    self.rng.uniform(0.2, 1.0) * gap + half * abs(np.sin(tilt)),
                    z,
                    tilt,
                )
            )
        return self.try_poses(items, poses, over_windows=over_windows)

    def hang(
        self, item: Item, z: float, *, over_windows: bool = False, tries: int = 8
    ) -> Placed | None:
        """Hang an object on a wall, its back 2 mm off it, its lowest point at a height."""
        return self.against_wall(
            item, z=z, gap=0.002, tries=tries, over_windows=over_windows, turn=0.0
        )

    def freely(
        self,
        things: Item | Sequence[Item],
        *,
        tries: int = 8,
        yaw: float | None = None,
        margin: float = 0.1,
    ) -> Placed | None:
        """Place an object anywhere on the floor, at a random angle or about the one given."""
        items = (things,) if isinstance(things, Item) else tuple(things)
        poses = []
        for _ in range(tries):
            spot = (
                self.room.low
                + margin
                + self.rng.random(2) * np.maximum(self.size - 2 * margin, 0.1)
            )
            angle = (
                self.rng.uniform(0, 2 * np.pi) if yaw is None else yaw + self.rng.normal(0, 0.03)
            )
            poses.append(about_centre(items[0], float(spot[0]), float(spot[1]), angle))
        return self.try_poses(items, poses)

    def on_top(
        self, support: Placed, item: Item, *, yaw: float | None = None, tries: int = 6
    ) -> Placed | None:
        """Place something at a random spot on top of another object, turned like it or at random."""
        level = support.top
        if level is None:
            return None
        corners, poses = extent(boxes_of(item)), []
        reach = np.maximum(
            support.size[:2] / 2 - (corners[1] - corners[0])[:2].min() / 2 - 0.01, 0.0
        )
        for _ in range(tries):
            x, y = support.at(
                self.rng.uniform(-1, 1) * reach[0],
                float(support.size[1]) / 2 + self.rng.uniform(-1, 1) * reach[1],
            )
            angle = (
                self.rng.uniform(0, 2 * np.pi)
                if yaw is None
                else support.yaw + self.rng.normal(yaw, 0.15)
            )
            poses.append(about_centre(item, x, y, angle, level[0]))
        return self.try_poses(item, poses, on=support)

    def wall_pose(
        self, side: int, along: float, gap: float, z: float, tilt: float = 0.0
    ) -> tuple[float, float, float, float]:
        """Return the pose of an object whose back is ``gap`` from a wall, ``along`` metres from the wall's low end."""
        low, high = self.room.low, self.room.high
        x = {0: low[0] + along, 1: high[0] - gap, 2: low[0] + along, 3: low[0] + gap}[side]
        y = {0: low[1] + gap, 1: low[1] + along, 2: high[1] - gap, 3: low[1] + along}[side]
        return float(x), float(y), z, float((0.0, np.pi / 2, np.pi, -np.pi / 2)[side] + tilt)

    def _put(
        self, items: tuple[Item, ...], own: Boxes, pose: tuple[float, float, float, float], *, over_windows: bool,
        on: Placed | None,
    ) -> Placed | None:  # fmt: skip
        """Place items whose boxes in their own frame are known."""
        boxes = moved(own, *pose)
        corners = extent(boxes)
        low, high = np.append(self.room.low, 0.0), np.append(self.room.high, self.room.ceiling)
        if (corners[0] < low - 1e-4).any() or (corners[1] > high + 1e-4).any():
            return None
        if on is not None and not _holds(on, boxes, pose[2]):
            return None
        if self._solids.meets(boxes) or (not over_windows and self._windows.meets(boxes)):
            return None
        if on is None and not self._floor.admits(boxes):
            return None
        self._solids.add(boxes)
        size = np.ptp(extent(own), axis=0)
        placed = Placed(
            tuple(item.moved(pose[0], pose[1], pose[2], pose[3]) for item in items), size, *pose
        )
        self.placed.append(placed)
        return placed

    def _in_front(self, opening: Opening, depth: float) -> Boxes:
        """Return the box in front of an opening, inside the room."""
        low, high = self.room.low, self.room.high
        across = opening.side % 2  # the wall's normal is along x for sides 1 and 3
        first, last = np.empty(3), np.empty(3)
        axis, along = (0, 1) if across else (1, 0)
        first[along], last[along] = opening.start, opening.end
        near = low[axis] if opening.side in (0, 3) else high[axis] - depth
        first[axis], last[axis] = near, near + depth
        first[2], last[2] = opening.low, opening.high
        return upright(first, last)


def about_centre(
    item: Item, x: float, y: float, yaw: float, z: float = 0.0
) -> tuple[float, float, float, float]:
    """Return the pose that brings the middle of an object's foot to a spot."""
    corners = extent(boxes_of(item))
    out = float(corners[0, 1] + corners[1, 1]) / 2
    return x + np.sin(yaw) * out, y - np.cos(yaw) * out, z, yaw


def _top_of(item: Item) -> tuple[float, Points] | None:
    """Return the largest level surface of an object; high ones are preferred."""
    triangles = np.concatenate([part.triangles for part in item.parts])
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    area = (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
    level = (np.ptp(triangles[..., 2], axis=1) < 1e-4) & (area > 1e-6)
    if not level.any():
        return None
    heights = np.round(triangles[level, 0, 2], 3)
    values, which = np.unique(heights, return_inverse=True)
    areas = np.bincount(which, area[level])
    best = int(np.argmax(areas + 0.3 * areas.max() * (values == values.max())))
    chosen = triangles[level][which == best]
    return (float(chosen[0, 0, 2]), chosen[..., :2]) if areas[best] >= 0.02 else None


def _holds(support: Placed, boxes: Boxes, z: float) -> bool:
    """Tell whether the corners of what touches a support's top at z all lie on it."""
    top = support.top
    if top is None or abs(top[0] - z) > 1e-3:
        return False
    feet = boxes[boxes[:, 6] < z + 0.012]
    corners = extent(feet)[:, :2]
    spots = np.array(
        [[corners[a, 0], corners[b, 1]] for a in (0, 1) for b in (0, 1)] + [corners.mean(axis=0)]
    )
    a, b, c = top[1][:, 0], top[1][:, 1], top[1][:, 2]
    inside = np.ones((len(spots), len(a)), bool)
    for first, last in ((a, b), (b, c), (c, a)):
        edge, step = last - first, spots[:, None] - first
        inside &= edge[:, 0] * step[..., 1] - edge[:, 1] * step[..., 0] >= -1e-9
    return bool(inside.any(axis=1).all())


def _width(items: Sequence[Item]) -> float:
    """Return the width of items along x, symmetric about their frame's origin."""
    corners = extent(np.concatenate([boxes_of(item) for item in items]))
    return float(2 * np.abs(corners[:, 0]).max())
