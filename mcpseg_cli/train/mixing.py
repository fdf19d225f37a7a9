"""Windows mixed with others: a part of a room, or things that stand on the floor, from elsewhere.

A network that sees whole rooms learns what stands beside what, which other worlds do not keep to.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.train.augmentation import Scene

_BOX_EDGES = (0.8, 3.0)  # metres, of the part of a room that is exchanged, seen from above
_LARGEST = 2.5  # metres: what is wider or higher is no thing that stands about
_FEWEST = 50  # points of a thing that is taken along
_ON_FLOOR = 0.15  # metres over the floor at most, the lowest point of what stands on it
_MOST_THINGS = 4
_TRIES = 4  # places tried for a thing
_MOST_INSIDE = 0.02  # points in a thing's place, as a share of its own, where it is free


@dataclass(frozen=True)
class LabelledScene:
    """Points of a window and what is known of each.

    Attributes:
        scene: L points.
        looks: (L,) uint8 scans that saw each.
        semantic: (L,) uint8 class index, 255 unknown.
        instance: (L,) int32 object, 0 none.
    """

    scene: Scene
    looks: NDArray[np.uint8]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]

    def __getitem__(self, rows: NDArray[np.int64]) -> LabelledScene:
        """Return a part of the points."""
        scene = replace(self.scene, xyz=self.scene.xyz[rows], rgb=self.scene.rgb[rows])
        return LabelledScene(scene, self.looks[rows], self.semantic[rows], self.instance[rows])

    @property
    def foot(self) -> NDArray[np.float32]:
        """(3,) float32 where the robot stands on the floor, metres."""
        return np.array([*self.scene.position[:2], self.scene.floor], np.float32)

    def moved(self, offset: NDArray[np.float32], xyz: NDArray[np.float32]) -> LabelledScene:
        """Return the same points, ``xyz`` from ``offset``."""
        return replace(self, scene=replace(self.scene, xyz=xyz + offset))


def exchange_box(
    window: LabelledScene, other: LabelledScene, rng: np.random.Generator
) -> LabelledScene:
    """Put a part of another window in the place of what is there.

    Both lie about their robots, so that the part keeps its distance and its height over the floor.

    Args:
        window: Points; not changed.
        other: Where the part comes from, all heights of it.
        rng: Source of the choice of a box.

    Returns:
        The window with the part; no object of it has the number of one of the window's.
    """
    if len(other.scene.xyz) == 0:
        return window
    mine, its = window.scene.xyz - window.foot, other.scene.xyz - other.foot
    centre = its[rng.integers(len(its)), :2]
    half = rng.uniform(*_BOX_EDGES, 2).astype(np.float32) / 2

    left = np.flatnonzero((np.abs(mine[:, :2] - centre) >= half).any(axis=1))
    taken = np.flatnonzero((np.abs(its[:, :2] - centre) < half).all(axis=1))
    return _join(window[left], other[taken].moved(window.foot, its[taken]))


def add_things(
    window: LabelledScene, other: LabelledScene, rng: np.random.Generator
) -> LabelledScene:
    """Stand some of the things of another window on free places of a window's floor, turned anyhow.

    Args:
        window: Points; not changed.
        other: Where the things come from.
        rng: Source of the choice of things, places and turns.

    Returns:
        The window with the things; no object of them has the number of one of the window's.
    """
    things = standing_things(other)
    for number in rng.permutation(len(things))[: rng.integers(1, _MOST_THINGS + 1)]:
        window = _stand(window, things[number], rng)
    return window


def standing_things(window: LabelledScene) -> list[LabelledScene]:
    """Find the objects that stand on the floor and are no part of the building, by their size.

    Returns:
        The points of each, about the middle of its foot (metres; floor at height 0).
    """
    xyz = window.scene.xyz - window.foot
    order = np.argsort(window.instance, kind="stable")
    cuts = np.flatnonzero(np.diff(window.instance[order])) + 1
    things = []
    for rows in np.split(order, cuts):
        if len(rows) < _FEWEST or window.instance[rows[0]] == 0:
            continue
        lowest, highest = xyz[rows].min(axis=0), xyz[rows].max(axis=0)
        if (
            lowest[2] > _ON_FLOOR
            or highest[2] < 2 * _ON_FLOOR
            or np.any(highest - lowest > _LARGEST)
        ):
            continue
        middle = np.array([*(lowest + highest)[:2] / 2, 0], np.float32)
        things.append(window[rows].moved(-middle, xyz[rows]))
    return things


def _stand(window: LabelledScene, thing: LabelledScene, rng: np.random.Generator) -> LabelledScene:
    """Stand a thing on the floor where nothing else is; leave it out where no place is found."""
    xyz = window.scene.xyz - window.foot
    floor = np.flatnonzero(np.abs(xyz[:, 2]) < _ON_FLOOR)
    for _ in range(_TRIES if len(floor) else 0):
        angle = rng.uniform(-np.pi, np.pi)
        cos, sin = np.cos(angle), np.sin(angle)
        turn = np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]], np.float32)
        there = np.array([*xyz[rng.choice(floor), :2], 0], np.float32)
        placed = thing.scene.xyz @ turn.T + there

        lowest, highest = placed.min(axis=0), placed.max(axis=0)
        lowest[2] = max(lowest[2], _ON_FLOOR)
        inside = ((xyz > lowest) & (xyz < highest)).all(axis=1).sum()
        if inside <= _MOST_INSIDE * len(placed):
            return _join(window, thing.moved(window.foot, placed))
    return window


def _join(window: LabelledScene, added: LabelledScene) -> LabelledScene:
    """Join the points of two scenes; objects of the second get new numbers."""
    above = int(window.instance.max(initial=0))
    new = np.where(added.instance > 0, added.instance + above, 0).astype(np.int32)
    scene = replace(
        window.scene,
        xyz=np.concatenate([window.scene.xyz, added.scene.xyz]),
        rgb=np.concatenate([window.scene.rgb, added.scene.rgb]),
    )
    return LabelledScene(
        scene,
        np.concatenate([window.looks, added.looks]),
        np.concatenate([window.semantic, added.semantic]),
        np.concatenate([window.instance, new]),
    )
