"""Replay of a ray-traced area: every scan as segmentation sees it, with the truth about it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.config import SampleSettings
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import Cloud, read_cloud
from mcpseg_cli.formats.labels import point_labels
from mcpseg_cli.formats.recording import ScanSource, open_recording, read_scan
from mcpseg_cli.incremental.column import Column
from mcpseg_cli.incremental.growing_map import GrowingMap
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.scan import Scan

_REMEDY = "ray-trace the area again"


@dataclass(frozen=True)
class ScanSamples:
    """The samples of one scan.

    Attributes:
        position: (3,) float64 robot position, metres, map frame.
        floor: Height of the floor that segmentation would use, metres, map frame.
        num_new: M, how many voxels were seen for the first time; they come first.
        voxel: (S,) int32 voxel of each sample: all new ones in the order of segmentation, then some
            seen before.
        context: (S, K) int32 voxels of its context points, from this and earlier scans.
        seen: (T,) int32 all voxels that this scan sees, ascending.
    """

    position: NDArray[np.float64]
    floor: float
    num_new: int
    voxel: NDArray[np.int32]
    context: NDArray[np.int32]
    seen: NDArray[np.int32]


class Replay:
    """The voxel map of an area as it grows, with the truth about every voxel.

    Args:
        area: Folder that ``mcpseg raytrace`` wrote.
        settings: Everything that decides the samples.

    Raises:
        InputError: Scans, poses and truth are not there or do not fit together.
    """

    def __init__(self, area: Path, settings: SampleSettings) -> None:
        self.settings = settings
        self.scans = list_scans(area)
        self.classes: tuple[str, ...] = ()
        self._semantic = Column(np.uint8)
        self._instance = Column(np.int32)
        self._growing_map = GrowingMap(settings)
        self._truth = area / "gt"

    @property
    def map(self) -> VoxelMap:
        """The voxels so far."""
        return self._growing_map.voxels

    @property
    def semantic(self) -> NDArray[np.uint8]:
        """(V,) uint8 class of the point that founded each voxel, 255 unknown.

        A view, valid until the next scan.
        """
        return self._semantic.rows

    @property
    def instance(self) -> NDArray[np.int32]:
        """(V,) int32 object of that point, 0 none. A view, valid until the next scan."""
        return self._instance.rows

    def run(self) -> Iterator[ScanSamples]:
        """Insert scan after scan.

        Yields:
            The samples of each scan; ``map``, ``semantic`` and ``instance`` are as after that scan.

        Raises:
            InputError: A file is damaged, or a scan and its truth are not the same points.
        """
        for number, source in enumerate(self.scans):
            scan, cloud = read_scan(source, "map", self.settings.voxel_size)
            semantic, instance = self._read_truth(source, cloud)
            if cloud.valid is not None:
                semantic, instance = semantic[cloud.valid], instance[cloud.valid]
            yield self._insert(number, scan, semantic, instance)

    def _read_truth(
        self, source: ScanSource, cloud: Cloud
    ) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
        """Read the labels of a scan and check that they are those of its points."""
        path = self._truth / source.name
        truth = read_cloud(path)
        if not truth.classes:
            raise InputError(path, "no semantic, instance or class table", "all three", _REMEDY)

        # the same points as the scan's, in the classes of the scans before
        if not all(np.array_equal(truth.columns[axis], cloud.columns[axis]) for axis in "xyz"):
            raise InputError(
                path, "other points than the scan's", "the same points in the same order", _REMEDY
            )
        if (self.classes or truth.classes) != truth.classes:
            raise InputError(
                path, "another class table than the scans before", "one table for all", _REMEDY
            )
        self.classes = truth.classes
        return point_labels(truth, path)

    def _insert(
        self, number: int, scan: Scan, semantic: NDArray[np.uint8], instance: NDArray[np.int32]
    ) -> ScanSamples:
        """Grow the map by one scan, as ``IncrementalSegmenter.register_scan`` does."""
        rng = np.random.default_rng((self.settings.seed, number))
        observed = self._growing_map.observe(scan)

        # truth of the founding points
        founders = founding_points(observed.point_ids, observed.first_new)
        self._semantic.append(semantic[founders])
        self._instance.append(instance[founders])

        # new voxels, then some seen again
        new = observed.new[rng.permutation(len(observed.new))]
        parts = [(new, self._sample(new, rng))]
        again = rng.permutation(observed.seen_again)[: self.settings.seen_again]
        parts.append((again, self._sample(again, rng)))
        voxel, context = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
        seen = np.concatenate([observed.seen_again, observed.new])
        return ScanSamples(scan.position, observed.floor or 0.0, len(new), voxel, context, seen)

    def _sample(self, ids: NDArray[np.int32], rng: np.random.Generator) -> NDArray[np.int32]:
        uniform = rng.random((len(ids), self.settings.num_context), np.float32)
        return self.map.sample_context(ids, self.settings.context_window, uniform)


def list_scans(area: Path) -> Sequence[ScanSource]:
    """List the scans of a ray-traced area with their poses, in order.

    Args:
        area: Folder that ``mcpseg raytrace`` wrote.

    Raises:
        InputError: No scans, no poses, a run that was not finished, or a scan without truth.
        OSError: The poses cannot be opened.
    """
    if not (area / "poses.csv").is_file():
        raise InputError(
            area, "no poses.csv", "a folder that mcpseg raytrace wrote", "check the path"
        )
    scans = open_recording(area / "scans", area / "poses.csv")
    for source in scans:
        if not (area / "gt" / source.name).is_file():
            raise InputError(area, f"no gt/{source.name}", "the truth of every scan", _REMEDY)
    return scans


def founding_points(ids: NDArray[np.int32], first_new: int) -> NDArray[np.intp]:
    """Find the points that founded new voxels.

    Args:
        ids: (N,) int32 voxels of a scan's points, as ``GrowingMap.observe`` gave them.
        first_new: Id of the first new voxel.

    Returns:
        (M,) rows of ``ids``, in the order of the new voxels: ids are given in the order of the
        points.
    """
    highest = np.maximum.accumulate(np.maximum(ids, first_new - 1))
    return np.flatnonzero(np.diff(highest, prepend=first_new - 1) > 0)
