"""Putting objects into a room so that nothing meets, floats, or shuts a way off."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.synth.geometry.collisions import Boxes, Collisions, boxes_of, extent, moved, upright
from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.plan import Room
from mcpseg_cli.synth.rooms.contents.records import Amount, Chance, Several
from mcpseg_cli.synth.rooms.floor_space import FloorSpace, in_front
from mcpseg_cli.synth.rooms.placed import Placed, Pose, about_centre, holds, width_of
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import Style

_DOOR_DEPTH = 0.7  # metres in front of a door that stay free
_WINDOW_DEPTH = 0.1
_CORNERS = (0.7, 0.15, 0.15)  # shares of things along a wall, at its low end and at its high end


class Placement:
    """The furniture of a room while it is being placed."""

    def __init__(
        self, room: Room, style: Style, rng: np.random.Generator, wall: Material | None = None
    ) -> None:
        """Start with the bare room: what is taken, doors and windows keep furniture off.

        ``wall`` is the surface of its walls, for cabinets of their colour; None if not known.
        """
        self.room, self.style, self.rng, self.wall = room, style, rng, wall
        self.placed: list[Placed] = []
        self.rugs: list[Item] = []
        self.size = room.high - room.low
        self._floor = FloorSpace(room)
        self._solids, self._windows = Collisions(), Collisions()

        # what furniture keeps off
        for taken in room.taken:
            self._solids.add(upright(taken[0], taken[1]))
        for opening in room.openings:
            if opening.kind == "window":
                self._windows.add(in_front(room, opening, _WINDOW_DEPTH))
            else:
                self._solids.add(in_front(room, opening, _DOOR_DEPTH))

    @property
    def items(self) -> list[Item]:
        """Everything placed so far, map frame."""
        return [item for placed in self.placed for item in placed.items] + self.rugs

    @property
    def area(self) -> float:
        """Floor of the room, square metres."""
        return float(self.size.prod())

    @property
    def length(self) -> float:
        """The longer side of the room, metres."""
        return float(self.size.max())

    @property
    def middle(self) -> NDArray[np.float64]:
        """(2,) x and y of the room's middle, map frame."""
        return (self.room.low + self.room.high) / 2

    # What the tables of the rooms say, drawn

    def mess(self) -> float:
        """Return how untidy the building is, 0-1."""
        return 1.0 - self.style.tidiness

    def times(self, amount: Amount, size: float = 0.0) -> int:
        """Return a random number of things for a size, square metres of floor as a rule."""
        return int(self.rng.poisson(amount.on_average(size, self.mess())))

    def count(self, ends: tuple[int, int]) -> int:
        """Return a whole number from the first to the last."""
        return int(self.rng.integers(ends[0], ends[1] + 1))

    def chance(self, share: float) -> bool:
        """Return True that often."""
        return bool(self.rng.random() < share)

    def has(self, thing: Chance) -> bool:
        """Return whether the room has such a thing."""
        return self.area > thing.over and self.chance(thing.chance)

    def one_of(self, kinds: Sequence[str]) -> str:
        """Return one of the kinds."""
        return str(self.rng.choice(np.array(kinds)))

    def some_of(self, kinds: Sequence[str], amount: Amount, size: float = 0.0) -> list[str]:
        """Return a random number of the kinds, each as often as it likes."""
        drawn = self.rng.choice(np.array(kinds), self.times(amount, size))
        return [str(kind) for kind in drawn]

    def several(self, things: Several[str], size: float = 0.0) -> list[str]:
        """Return the kinds of the things that come."""
        return self.some_of(things.of, things, size)

    def square(self) -> float:
        """Return one of the four directions along the walls, radians."""
        return float(self.rng.integers(4)) * np.pi / 2

    # Placing

    def keep_free(self, low: Sequence[float], high: Sequence[float]) -> None:
        """Keep a box between two corners, map frame, free from now on."""
        self._solids.add(upright(np.asarray(low, np.float64), np.asarray(high, np.float64)))

    def keep_passage(self, width: float) -> None:
        """Keep a way of a width free along a corridor, nearer to one of its walls."""
        along = int(np.argmax(self.size))
        low, high = np.append(self.room.low, 0.0), np.append(self.room.high, 2.1)
        spare, flat = max(float(self.size[1 - along]) - width, 0.0), 0.12

        rich = self.chance(0.5)  # which wall has furniture
        low[1 - along] += min(flat, spare / 2) if rich else spare - min(flat, spare / 2)
        high[1 - along] = low[1 - along] + width
        self.keep_free(low.tolist(), high.tolist())

    def put(
        self,
        things: Item | Sequence[Item],
        pose: Pose,
        *,
        over_windows: bool = False,
        on: Placed | None = None,
    ) -> Placed | None:
        """Place an object, or one with things on it, if there is room.

        Args:
            things: In their own frame.
            pose: Where to.
            over_windows: Whether it may hang in front of windows.
            on: What it stands on; its top has to hold the whole foot of the first object.

        Returns:
            Where it was placed; None if it meets something, leaves the room, cuts off floor or
            would float.
        """
        return self.try_poses(things, [pose], over_windows=over_windows, on=on)

    def try_poses(
        self,
        things: Item | Sequence[Item],
        poses: Sequence[Pose],
        *,
        over_windows: bool = False,
        on: Placed | None = None,
    ) -> Placed | None:
        """Place an object at the first of the poses where there is room; see ``put``."""
        items = (things,) if isinstance(things, Item) else tuple(things)
        own = np.concatenate([boxes_of(item) for item in items])
        for pose in poses:
            placed = self._put(items, own, pose, over_windows=over_windows, on=on)
            if placed is not None:
                return placed
        return None

    def against_wall(
        self,
        things: Item | Sequence[Item],
        *,
        z: float = 0.0,
        gap: float = 0.03,
        near: Placed | None = None,
        tries: int = 8,
        over_windows: bool = False,
        turn: float = 0.01,
    ) -> Placed | None:
        """Place an object with its back to a wall: anywhere, in a corner, or beside another."""
        items = (things,) if isinstance(things, Item) else tuple(things)
        half = width_of(items) / 2
        poses = [] if near is None else self._beside(near, half, z)

        # longer walls are tried more often
        lengths = np.array([self.size[side % 2] for side in range(4)])
        for _ in range(tries):
            side = int(self.rng.choice(4, p=lengths / lengths.sum()))
            room_left = float(self.size[side % 2]) - 2 * half
            if room_left <= 0:
                continue

            # along the wall or in a corner, a little askew
            corner = min(0.02, room_left)
            spots = [self.rng.uniform(0, room_left), corner, room_left - corner]
            along = half + float(self.rng.choice(spots, p=_CORNERS))
            tilt = self.rng.normal(0, turn)
            off = self.rng.uniform(0.2, 1.0) * gap + half * abs(np.sin(tilt))
            poses.append(self.wall_pose(side, along, off, z, tilt))
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
        reach = np.maximum(self.size - 2 * margin, 0.1)
        for _ in range(tries):
            x, y = (self.room.low + margin + self.rng.random(2) * reach).tolist()
            if yaw is None:
                angle = self.rng.uniform(0, 2 * np.pi)
            else:
                angle = yaw + self.rng.normal(0, 0.03)
            poses.append(about_centre(items[0], x, y, angle))
        return self.try_poses(items, poses)

    def on_top(
        self, support: Placed, item: Item, *, yaw: float | None = None, tries: int = 6
    ) -> Placed | None:
        """Place something at a random spot on top of another object, turned like it or anyhow."""
        level = support.top
        if level is None:
            return None
        corners, poses = extent(boxes_of(item)), []
        own = (corners[1] - corners[0])[:2].min() / 2
        reach = np.maximum(support.size[:2] / 2 - own - 0.01, 0.0)

        # its middle stays so far from the edges that most of it lies on the top
        for _ in range(tries):
            along = self.rng.uniform(-1, 1) * reach[0]
            out = float(support.size[1]) / 2 + self.rng.uniform(-1, 1) * reach[1]
            x, y = support.at(along, out)
            if yaw is None:
                angle = self.rng.uniform(0, 2 * np.pi)
            else:
                angle = support.yaw + self.rng.normal(yaw, 0.15)
            poses.append(about_centre(item, x, y, angle, level[0]))
        return self.try_poses(item, poses, on=support)

    def wall_pose(self, side: int, along: float, gap: float, z: float, tilt: float = 0.0) -> Pose:
        """Return the pose of an object whose back is ``gap`` from a wall.

        It stands ``along`` metres from the wall's low end.
        """
        low, high = self.room.low, self.room.high
        x = {0: low[0] + along, 1: high[0] - gap, 2: low[0] + along, 3: low[0] + gap}[side]
        y = {0: low[1] + gap, 1: low[1] + along, 2: high[1] - gap, 3: low[1] + along}[side]
        return float(x), float(y), z, float((0.0, np.pi / 2, np.pi, -np.pi / 2)[side] + tilt)

    def _beside(self, near: Placed, half: float, z: float) -> list[Pose]:
        """Return poses at both sides of another object, in random order."""
        poses = []
        for sign in self.rng.permutation([-1.0, 1.0]):
            step = sign * (near.size[0] / 2 + half + self.rng.uniform(0.004, 0.03))
            x, y = near.at(float(step), 0.0)
            poses.append((x, y, z, near.yaw))
        return poses

    def _put(
        self,
        items: tuple[Item, ...],
        own: Boxes,
        pose: Pose,
        *,
        over_windows: bool,
        on: Placed | None,
    ) -> Placed | None:
        """Place items whose boxes in their own frame are known."""
        # inside the room
        boxes = moved(own, *pose)
        corners = extent(boxes)
        low, high = np.append(self.room.low, 0.0), np.append(self.room.high, self.room.ceiling)
        if (corners[0] < low - 1e-4).any() or (corners[1] > high + 1e-4).any():
            return None

        # on firm ground, clear of everything else, and in nobody's way
        if on is not None and not holds(on, boxes, pose[2]):
            return None
        if self._solids.meets(boxes) or (not over_windows and self._windows.meets(boxes)):
            return None
        if on is None and not self._floor.admits(boxes):
            return None

        self._solids.add(boxes)
        size = np.ptp(extent(own), axis=0)
        placed = Placed(tuple(item.moved(*pose) for item in items), size, *pose)
        self.placed.append(placed)
        return placed
