"""Windows of the growing map to train the U-Net on, as it is at some scan, each time changed.

An area is replayed on a grid finer than the network's, so that a window can be turned and scaled
by any amount and still have a point in every voxel of its surfaces. A window is what some scans in
a row have seen within range of the last of them: a few, for a young map, or all there were.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.classes import remap_table
from mcpseg_cli.config import AugmentSettings, WindowSettings
from mcpseg_cli.errors import McpsegError
from mcpseg_cli.grid import voxel_of
from mcpseg_cli.incremental.window import window_input
from mcpseg_cli.networks.sparse import Level, find_neighbours, make_levels, number_voxels
from mcpseg_cli.networks.unet import NUM_LEVELS
from mcpseg_cli.train.augmentation import Scene, augment, draw_cut, draw_thinning
from mcpseg_cli.train.class_table import trained_names
from mcpseg_cli.train.draws import Order
from mcpseg_cli.train.mixing import LabelledScene, add_things, exchange_box
from mcpseg_cli.train.samples import AreaSamples

_APART = 1 << 13  # voxels from one window of a batch to the next: no level joins two of them
_FEWEST = 500  # points that an augmented window must have left
_LOWEST_CUT = (1.2, 2.6)  # metres over the floor above which a sensor may have seen nothing
_MOST_HOLES = 12
_SMALLEST_HOLE = 0.15  # metres
_TRIES = 8  # windows drawn from a place before a poor one is taken


@dataclass(frozen=True)
class WindowBatch:
    """Some windows, far apart, as the network sees them. The arrays belong to the batch.

    Attributes:
        inputs: (V, 14) float32, as ``window.window_input`` gives them.
        levels: Tables of all windows together.
        semantic: (V,) int64 class index, 255 unknown.
        instance: (V,) int64 object, 0 none; no two windows share one.
    """

    inputs: NDArray[np.float32]
    levels: list[Level]
    semantic: NDArray[np.int64]
    instance: NDArray[np.int64]


@dataclass(frozen=True)
class _Window:
    """One window: a point for every voxel."""

    inputs: NDArray[np.float32]
    voxel: NDArray[np.int32]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]


class WindowSource:
    """Batches of windows of many areas; every scan is the last of a window once an epoch.

    Args:
        areas: Replayed on a fine grid, without context.
        classes: Class table of the network; classes of an area are matched by name.
        mapping: Class by label of the data; None: the data's own.
        windows_per_batch: W.
        settings: Which windows.
        augmentation: How windows are changed; None: not at all.
        seed: Seed of every choice.

    Raises:
        McpsegError: No area has a scan.
    """

    def __init__(
        self,
        areas: Sequence[AreaSamples],
        classes: tuple[str, ...],
        mapping: Mapping[str, str] | None = None,
        *,
        windows_per_batch: int,
        settings: WindowSettings,
        augmentation: AugmentSettings | None,
        seed: int,
    ) -> None:
        self._areas = areas
        self._semantic = [
            remap_table(trained_names(area.classes, mapping), classes)[area.semantic]
            for area in areas
        ]
        self._size, self._settings = windows_per_batch, settings
        self._augmentation, self._seed = augmentation, seed

        counts = [area.num_scans for area in areas]
        self._area_of = np.repeat(np.arange(len(areas)), counts)
        self._scan_of = np.concatenate([np.arange(count) for count in counts])
        self._order = Order(seed, len(self._scan_of))
        if len(self) == 0:
            raise McpsegError(
                "too few scans for a batch of windows; expected more; give more areas"
            )

    def __len__(self) -> int:
        """Return the batches of an epoch."""
        return len(self._scan_of) // self._size

    def epoch(
        self, number: int, *, rank: int = 0, world: int = 1, start: int = 0
    ) -> Iterator[WindowBatch]:
        """Draw a window for every scan, in an order shuffled for each epoch.

        Args:
            number: Number of the epoch, from 0.
            rank: This process; it takes every ``world``-th batch.
            world: Number of processes.
            start: Batches of this process to pass over; what follows is the same as without.

        Yields:
            Batches; each depends on the seed, the epoch and its place in it only.
        """
        for step in range(start, len(self) // world):
            yield self.batch(number, world * step + rank)

    def batch(self, number: int, position: int) -> WindowBatch:
        """Draw the windows at a place in an epoch.

        Args:
            number: Number of the epoch, from 0.
            position: Less than the batches of an epoch.
        """
        order = self._order.places(number)
        rng = np.random.default_rng((self._seed, number, position + 1))
        places = order[self._size * position : self._size * (position + 1)]
        return _join([self._draw(place, rng) for place in places])

    def _draw(self, place: int, rng: np.random.Generator) -> _Window:
        """Draw the window of a scan; one with hardly anything in it is drawn anew."""
        for _ in range(_TRIES):
            window = self._draw_once(self._area_of[place], self._scan_of[place], rng)
            if len(window.voxel) >= _FEWEST:
                break
            place = int(rng.integers(len(self._scan_of)))
        return window

    def _draw_once(self, number: int, last: int, rng: np.random.Generator) -> _Window:
        settings = self._settings

        # what the robot has seen there, changed as another world would change it
        drawn = self._draw_scene(number, last, rng)
        if self._augmentation is not None:
            drawn = self._mix(drawn, self._augmentation, rng)
            scene = _lay(drawn.scene, self._augmentation, settings, rng)
            drawn = replace(drawn, scene=scene)

        # one point a voxel, whichever comes first
        scene, position = drawn.scene, self._areas[number].position[last]
        order = rng.permutation(len(scene.xyz))
        xyz = scene.xyz[order] - np.array([*position[:2], 0], np.float32)
        rows, voxel, most_looks = _voxelise(xyz, drawn.looks[order], settings)
        order = order[rows]
        inputs = window_input(
            xyz[rows],
            scene.rgb[order],
            most_looks,
            voxel,
            find_neighbours(voxel),
            voxel_size=settings.voxel_size,
            floor=scene.floor,
        )
        return _Window(inputs, voxel, drawn.semantic[order], drawn.instance[order])

    def _draw_scene(self, number: int, last: int, rng: np.random.Generator) -> LabelledScene:
        """Draw which scans a window is made of, and change what they saw within range."""
        area, settings = self._areas[number], self._settings
        reach = rng.uniform(settings.shortest_range, settings.longest_range)
        first = 0
        if rng.random() < settings.young:
            first = max(last + 1 - round(np.exp(rng.uniform(0, np.log(settings.most_scans)))), 0)
        ids, looks = _see(area, first, last, reach)

        scene = Scene(
            area.xyz[ids],
            area.rgb[ids].astype(np.float32),
            area.position[last],
            float(area.floor[last]),
        )
        drawn = LabelledScene(scene, looks, self._semantic[number][ids], area.instance[ids])
        if self._augmentation is None:
            return drawn
        drawn = drawn[_leave(scene, self._augmentation, rng)]
        return replace(drawn, scene=augment(drawn.scene, self._augmentation, rng))

    def _mix(
        self, drawn: LabelledScene, settings: AugmentSettings, rng: np.random.Generator
    ) -> LabelledScene:
        """Perhaps exchange a part of a window for that of another, perhaps add things of one."""
        for share, mix in (
            (settings.mixed_boxes, exchange_box),
            (settings.mixed_things, add_things),
        ):
            if share and rng.random() < share:
                place = rng.integers(len(self._scan_of))
                other = self._draw_scene(self._area_of[place], self._scan_of[place], rng)
                drawn = mix(drawn, other, rng)
        return drawn


def _see(
    area: AreaSamples, first: int, last: int, reach: float
) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
    """Find what scans ``first`` to ``last`` saw, each within reach, that is near the last.

    Returns:
        (N,) int64 points of the area and (N,) uint8 how many of the scans saw each.
    """
    scans = np.arange(first, last + 1)
    away = area.position[scans, :2] - area.position[last, :2]
    scans = scans[np.hypot(away[:, 0], away[:, 1]) < 2 * reach]
    looks = np.zeros(len(area.xyz), np.uint8)
    _count_looks(area.xyz, area.seen, area.seen_starts, area.position, scans, reach, looks)

    ids = np.flatnonzero(looks)
    away = area.xyz[ids, :2] - area.position[last, :2].astype(np.float32)
    ids = ids[np.hypot(away[:, 0], away[:, 1]) < reach]
    return ids, looks[ids]


@njit(cache=True, nogil=True)
def _count_looks(
    xyz: NDArray[np.float32],
    seen: NDArray[np.int32],
    starts: NDArray[np.int64],
    position: NDArray[np.float64],
    scans: NDArray[np.int64],
    reach: float,
    looks: NDArray[np.uint8],
) -> None:
    """Count how many of the scans saw each point within reach, horizontally."""
    for scan in scans:
        for place in range(starts[scan], starts[scan + 1]):
            i = seen[place]
            x, y = xyz[i, 0] - position[scan, 0], xyz[i, 1] - position[scan, 1]
            if x * x + y * y < reach * reach and looks[i] < 255:
                looks[i] += 1


def _leave(scene: Scene, settings: AugmentSettings, rng: np.random.Generator) -> NDArray[np.int64]:
    """Choose the points of a scene that are left: a partial view, holes, a ceiling out of sight."""
    count = len(scene.xyz)
    kept: NDArray[np.bool_] = np.ones(count, bool)
    cut = draw_cut(settings, rng)
    if cut is not None:
        kept &= ~cut.removes(scene.xyz, scene.position)
    if rng.random() < settings.no_ceiling:
        kept &= scene.xyz[:, 2] < scene.floor + rng.uniform(*_LOWEST_CUT)
    if count and rng.random() < settings.holes:
        for _ in range(rng.integers(1, _MOST_HOLES)):
            centre = scene.xyz[rng.integers(count)]
            radius = rng.uniform(_SMALLEST_HOLE, max(settings.hole_radius, _SMALLEST_HOLE))
            kept &= ((scene.xyz - centre) ** 2).sum(axis=1) > radius**2
    thinning = draw_thinning(settings, rng)
    if thinning:
        kept &= rng.random(count) >= thinning
    return np.flatnonzero(kept) if kept.sum() >= _FEWEST else np.arange(count)


def _lay(
    scene: Scene, augmentation: AugmentSettings, settings: WindowSettings, rng: np.random.Generator
) -> Scene:
    """Tilt a scene about the robot's foot, and shift it against the grid of voxels."""
    foot = np.array([*scene.position[:2], scene.floor])
    tilt = np.tan(np.radians(rng.normal(0, augmentation.tilt_deg, 2)))
    xyz = scene.xyz.copy()
    xyz[:, 2] += (scene.xyz[:, :2] - foot[:2]) @ tilt

    shift = rng.uniform(-1, 1, 3) * augmentation.grid_shift * settings.voxel_size
    xyz += shift.astype(np.float32)
    return replace(scene, xyz=xyz, floor=scene.floor + float(shift[2]))


def _voxelise(
    xyz: NDArray[np.float32], looks: NDArray[np.uint8], settings: WindowSettings
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.int32]]:
    """Keep the first point of each voxel, of the nearest voxels if there are too many.

    Returns:
        (V,) int64 rows of the points kept, (V, 3) int32 their voxels, in order of these, and (V,)
        int32 looks: the most of any point in the voxel.
    """
    rows, number = number_voxels(voxel_of(xyz, settings.voxel_size))
    most = np.zeros(len(rows), np.int32)
    np.maximum.at(most, number, looks)

    if len(rows) > settings.most_voxels:
        away = (xyz[rows, :2] ** 2).sum(axis=1)
        nearest = np.argsort(away, kind="stable")[: settings.most_voxels]
        rows, most = rows[nearest], most[nearest]
    voxel = voxel_of(xyz[rows], settings.voxel_size)
    order = np.lexsort(voxel.T[::-1])
    return rows[order], voxel[order], most[order]


def _join(windows: Sequence[_Window]) -> WindowBatch:
    """Put windows side by side, far apart, as one."""
    voxel, instance, used = [], [], 0
    for number, window in enumerate(windows):
        apart = np.array([number * _APART, 0, 0], np.int32)
        voxel.append(window.voxel + apart)
        objects, local = np.unique(window.instance, return_inverse=True)
        instance.append(np.where(window.instance > 0, local + 1 + used, 0))
        used += len(objects) + 1
    return WindowBatch(
        np.concatenate([window.inputs for window in windows]),
        make_levels(np.concatenate(voxel), NUM_LEVELS),
        np.concatenate([window.semantic for window in windows]).astype(np.int64),
        np.concatenate(instance).astype(np.int64),
    )
