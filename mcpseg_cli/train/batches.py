"""Training batches (III-D): points of one scan with their context, each time augmented anew.

Networks pool over a batch, so a batch is points of one scan, as at inference; they are drawn evenly
from its objects.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN, remap_table
from mcpseg_cli.config import AugmentSettings
from mcpseg_cli.errors import McpsegError
from mcpseg_cli.incremental.context import context_input, network_input
from mcpseg_cli.train.augmentation import (
    Scene,
    augment,
    draw_cut,
    draw_thinning,
    drop_context,
    replace_gone,
)
from mcpseg_cli.train.class_table import trained_names
from mcpseg_cli.train.draws import Order, choose_balanced, choose_plain, number_locally
from mcpseg_cli.train.replay import ScanSamples
from mcpseg_cli.train.samples import AreaSamples

_FEWEST = 32  # points that a partial view must leave; new voxels that make a batch of their own
_SCANS_AT_ONCE = 512  # whose samples are counted at once
_FEWEST_USABLE = 2  # points of a scan that is of use at all: what is missing is repeated


@dataclass(frozen=True)
class Batch:
    """Points of one scan as the network sees them. The arrays belong to the batch.

    Attributes:
        centre: (N, 6) float32, as ``context.network_input`` gives them.
        context: (N, K, 6) float32, as ``context.context_input`` gives them; None when not asked
            for.
        semantic: (N,) int64 class index.
        instance: (N,) int64 object of the area.
    """

    centre: NDArray[np.float32]
    context: NDArray[np.float32] | None
    semantic: NDArray[np.int64]
    instance: NDArray[np.int64]


class BatchSource:
    """Batches of many areas.

    Args:
        areas: Samples to draw from.
        classes: Class table of the network; classes of an area are matched by name, points of
            others are not drawn.
        mapping: Class by label of the areas, as ``class_table.read_class_table`` gives it; None:
            labels are classes.
        batch_size: N.
        with_context: Whether the network needs context.
        augmentation: How batches are changed; None leaves them as segmentation sees them.
        seed: Seed of every choice.
        samples_per_instance: Points taken from a random object at a time until a batch is full, so
            that large objects do not crowd out small ones, as in the authors' program; 0 draws all
            points with equal odds.
        plain_share: Share of the batches drawn with equal odds all the same, from the voxels seen
            for the first time if they suffice: such batches are what segmentation pools over.

    Raises:
        McpsegError: No scan has a point that can be drawn.
    """

    def __init__(
        self,
        areas: Sequence[AreaSamples],
        classes: tuple[str, ...],
        mapping: Mapping[str, str] | None = None,
        *,
        batch_size: int,
        with_context: bool,
        augmentation: AugmentSettings | None,
        seed: int,
        samples_per_instance: int = 16,
        plain_share: float = 0.25,
    ) -> None:
        self._areas = [_Area(area, classes, mapping) for area in areas]
        self._batch_size, self._with_context = batch_size, with_context
        self._augmentation, self._seed = augmentation, seed
        self._per_instance, self._plain_share = samples_per_instance, plain_share

        # an epoch takes one batch from every scan that has points to draw
        scans = [area.usable_scans() for area in self._areas]
        self._area_of = np.repeat(np.arange(len(scans)), [len(part) for part in scans])
        self._scan_of = np.concatenate([*scans, np.empty(0, np.int64)])
        self._order = Order(seed, len(self._scan_of))
        if len(self._scan_of) == 0:
            names = ", ".join(area.samples.name for area in self._areas) or "none"
            raise McpsegError(
                f"areas {names}: no scan shows an object of the classes {', '.join(classes)}; "
                "expected some; check the class tables"
            )

    def __len__(self) -> int:
        """Return the batches of an epoch: one for each scan with points to draw."""
        return len(self._scan_of)

    def epoch(
        self, number: int, *, rank: int = 0, world: int = 1, start: int = 0
    ) -> Iterator[Batch]:
        """Draw one batch from every scan, in an order shuffled for each epoch.

        Args:
            number: Number of the epoch, from 0.
            rank: This process; it takes every ``world``-th batch.
            world: Number of processes. All draw equally many batches, up to ``world - 1`` scans sit
                out.
            start: Batches of this process to pass over; what follows is the same as without.

        Yields:
            Batches; each depends on the seed, the epoch and its place in it only.
        """
        for step in range(start, len(self) // world):
            yield self.batch(number, world * step + rank)

    def batch(self, number: int, position: int) -> Batch:
        """Draw the batch at a place in an epoch.

        Args:
            number: Number of the epoch, from 0.
            position: Less than the batches of an epoch.
        """
        place = self._order.places(number)[position]
        # 0 would be the generator of the order
        rng = np.random.default_rng((self._seed, number, position + 1))
        return self._draw(self._areas[self._area_of[place]], int(self._scan_of[place]), rng)

    def _draw(self, area: _Area, number: int, rng: np.random.Generator) -> Batch:
        """Choose the points of a batch and give them as the network sees them."""
        # points with a label, but for what a partial view leaves out
        scan = area.samples.scan(number)
        pool, gone = area.usable[scan.voxel].nonzero()[0], None
        if self._augmentation is not None:
            gone = _Gone(area.samples, scan, self._augmentation, rng)
            pool = gone.leave(pool, rng)

        # N of them, with their context
        rows = self._choose(pool, scan, area, rng)
        ids = scan.voxel[rows]
        context = scan.context[rows] if self._with_context else None
        scene, centre, context = _make_scene(area.samples, scan, ids, context, gone, rng)

        # seen as another sensor, light or map would show them
        if self._augmentation is not None:
            if context is not None:
                context = drop_context(context, self._augmentation, rng)
            scene = augment(scene, self._augmentation, rng)

        return Batch(
            network_input(scene.xyz[centre], scene.rgb[centre], scene.position, scene.floor),
            None if context is None else context_input(centre, context, scene.xyz, scene.rgb),
            area.semantic[ids].astype(np.int64),
            area.samples.instance[ids].astype(np.int64),
        )

    def _choose(
        self, pool: NDArray[np.intp], scan: ScanSamples, area: _Area, rng: np.random.Generator
    ) -> NDArray[np.intp]:
        """Draw a batch of rows, balanced or plain; too few are repeated."""
        if self._per_instance and rng.random() >= self._plain_share:
            instance = area.samples.instance[scan.voxel[pool]]
            return pool[choose_balanced(instance, self._batch_size, self._per_instance, rng)]
        new = pool[pool < scan.num_new]
        pool = new if len(new) >= _FEWEST else pool
        return pool[choose_plain(len(pool), self._batch_size, rng)]


class _Area:
    """An area with its labels in the network's classes."""

    def __init__(
        self, samples: AreaSamples, classes: tuple[str, ...], mapping: Mapping[str, str] | None
    ) -> None:
        self.samples = samples
        names = trained_names(samples.classes, mapping)
        self.semantic = remap_table(names, classes)[samples.semantic]
        self.usable: NDArray[np.bool_] = (self.semantic != UNKNOWN) & (samples.instance > 0)

    def usable_scans(self) -> NDArray[np.int64]:
        """List the scans with points to draw."""
        counts = [np.empty(0, np.int64)]
        for first in range(0, self.samples.num_scans, _SCANS_AT_ONCE):
            last = min(first + _SCANS_AT_ONCE, self.samples.num_scans)
            total = np.concatenate([[0], np.cumsum(self.usable[self.samples.voxels(first, last)])])
            counts.append(
                np.diff(total[self.samples.starts[first : last + 1] - self.samples.starts[first]])
            )
        return np.flatnonzero(np.concatenate(counts) >= _FEWEST_USABLE)


class _Gone:
    """The voxels an augmented batch lacks: cut away, thinned out, or of earlier scans only."""

    def __init__(
        self,
        area: AreaSamples,
        scan: ScanSamples,
        settings: AugmentSettings,
        rng: np.random.Generator,
    ) -> None:
        self._area, self._scan = area, scan
        self._cut = draw_cut(settings, rng)
        self._thinning = draw_thinning(settings, rng)
        self._only_seen = rng.random() < settings.same_scan

    def leave(self, pool: NDArray[np.intp], rng: np.random.Generator) -> NDArray[np.intp]:
        """Return the rows of the pool that are left; where few would be, nothing is cut."""
        left = pool[~self._lost(self._scan.voxel[pool], rng)]
        if len(left) >= min(_FEWEST, len(pool)):
            return left
        self._cut, self._thinning = None, 0.0
        return pool

    def mark(self, ids: NDArray[np.int32], rng: np.random.Generator) -> NDArray[np.bool_] | None:
        """Mark the voxels that are gone; None if no voxel can be."""
        if self._cut is None and not self._thinning and not self._only_seen:
            return None
        gone = self._lost(ids, rng)
        if self._only_seen:
            seen = self._scan.seen
            gone |= seen[np.minimum(np.searchsorted(seen, ids), len(seen) - 1)] != ids
        return gone

    def _lost(self, ids: NDArray[np.int32], rng: np.random.Generator) -> NDArray[np.bool_]:
        gone: NDArray[np.bool_] = np.zeros(len(ids), bool)
        if self._cut is not None:
            gone |= self._cut.removes(self._area.xyz[ids], self._scan.position)
        if self._thinning:
            gone |= rng.random(len(ids)) < self._thinning
        return gone


def _make_scene(
    area: AreaSamples,
    scan: ScanSamples,
    ids: NDArray[np.int32],
    context: NDArray[np.int32] | None,
    gone: _Gone | None,
    rng: np.random.Generator,
) -> tuple[Scene, NDArray[np.int32], NDArray[np.int32] | None]:
    """Gather every point of a batch once; say where in the scene centres and context are."""
    # centres and their context, each point once
    everything = ids if context is None else np.concatenate([ids, context.ravel()])
    unique, number = number_locally(everything)
    xyz, rgb = np.asarray(area.xyz[unique]), area.rgb[unique].astype(np.float32)
    scene, centre = Scene(xyz, rgb, scan.position, scan.floor), number[: len(ids)]
    if context is None:
        return scene, centre, None

    # context that is gone is replaced by the rest
    local = number[len(ids) :].reshape(context.shape)
    mark = gone.mark(unique, rng) if gone is not None else None
    if mark is not None:
        mark[centre] = False
        replace_gone(local, centre, mark)
    return scene, centre, local
