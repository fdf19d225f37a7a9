"""One scan through the whole method (III-E): insert, embed and classify, cluster. Read it first."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Precision
from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.config import RegionGrowingSettings, SegmentSettings
from mcpseg_cli.incremental.column import IN_MEMORY, Memory
from mcpseg_cli.incremental.growing_map import GrowingMap
from mcpseg_cli.incremental.inventory import list_by_batches
from mcpseg_cli.incremental.map_objects import make_objects
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.incremental.methods import make_labels, make_method
from mcpseg_cli.incremental.network_method import NetworkMethod
from mcpseg_cli.incremental.objects import MapObject, list_objects
from mcpseg_cli.incremental.regrouping import History
from mcpseg_cli.incremental.stopwatch import Stopwatch
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.networks.description import DEFAULT_WEIGHTS, DescribedWeights, find_weights
from mcpseg_cli.scan import Labels, Scan

if TYPE_CHECKING:
    from mcpseg_cli.networks.weights import Weights

_PIECE = 1 << 18  # voxels touched before those far from the robot leave memory


@dataclass(frozen=True)
class ScanUpdate:
    """What one scan did to the map.

    Attributes:
        index: Number of the scan, from 0.
        point_ids: (N,) int32 voxel of every point of the scan, -1 for points out of range.
        first_new: Id of the first new voxel; they run to the end of the map.
        num_new: M, how many voxels were seen for the first time.
        num_seen: How many of the scan's voxels were known before.
        merges: (P, 2) int32 objects that merged: old id, surviving id.
        splits: (S, 2) int32 objects that parts of others became: the other's id, the new id.
        moved: (O,) int32 ids of earlier voxels that went to another object otherwise than by
            merges, ascending.
        changed: (Q,) int32 ids of earlier voxels whose labels changed, ascending.
        relabelled: (R,) int32 those of them whose class or confidence changed, ascending.
        num_reclassified: How many of these changed class.
        judged: (J,) int32 ids of voxels of which the evidence changed, see ``evidence_blocks``.
        floor: Height of the floor used, metres, map frame; None before any scan came in range.
        ms: Milliseconds by stage.
    """

    index: int
    point_ids: NDArray[np.int32]
    first_new: int
    num_new: int
    num_seen: int
    merges: NDArray[np.int32]
    splits: NDArray[np.int32]
    moved: NDArray[np.int32]
    changed: NDArray[np.int32]
    relabelled: NDArray[np.int32]
    num_reclassified: int
    judged: NDArray[np.int32]
    floor: float | None
    ms: dict[str, float]


class IncrementalSegmenter:
    """A growing labelled map, fed one scan at a time.

    Args:
        method: What labels: a network with its weights, which are read at the first look where they
            are only described, or region growing, which gives objects without classes.
        settings: Everything else that decides the labels; batch size and similarity, where not
            given, are the network's own. A network without embedding joins neighbours of one class
            (IV-B), whatever the similarity.
        precision: Arithmetic of context pooling, which runs on as many threads as torch is set to;
            ``auto`` is bf16 where the processor computes it natively.
        device: Where the network runs, as torch names it.
        memory: Where the rows of the map are.

    Attributes:
        method: What labels, made ready.
        settings: Complete, as the method has them.
        classes: Class names that labels index; none for region growing.
        precision: ``bf16`` or ``fp32``.
        device: As given.
        clusters: Object ids of all voxels.
        num_scans: Scans registered so far.

    Raises:
        McpsegError: The device does not exist here.
    """

    def __init__(
        self,
        method: Weights | DescribedWeights | RegionGrowingSettings,
        settings: SegmentSettings | None = None,
        *,
        precision: Precision = "auto",
        device: str = "cpu",
        memory: Memory = IN_MEMORY,
    ) -> None:
        self.method = make_method(method, settings or SegmentSettings(), precision, device)
        self.settings = self.method.settings
        self.classes = self.method.classes
        self.device = device
        self.precision = self.method.precision

        # the map: voxels, their classes, their objects
        self.num_scans = 0
        self._memory, self._num_touched = memory, 0
        self._growing_map = GrowingMap(self.settings, memory)
        self._labels = make_labels(self.method, memory)
        self.clusters = make_objects(self.method, self._labels, memory)

    @classmethod
    def load(
        cls, weights: str = DEFAULT_WEIGHTS, settings: SegmentSettings | None = None
    ) -> IncrementalSegmenter:
        """Make a segmenter from a weights file or the name of bundled weights.

        Raises:
            WeightsError: The weights are not there or damaged.
        """
        from mcpseg_cli.networks.weights import load_weights

        return cls(load_weights(find_weights(weights)), settings)

    def get_ready(self) -> None:
        """Read the weights, where they are only described, and build the network.

        Raises:
            WeightsError: They are damaged, or changed since they were described.
            McpsegError: The device does not exist here.
        """
        if isinstance(self.method, NetworkMethod):
            self.method.get_ready()

    @property
    def map(self) -> VoxelMap:
        """The look-up table: one point a voxel."""
        return self._growing_map.voxels

    @property
    def semantic(self) -> NDArray[np.uint8]:
        """(V,) uint8 class index of every voxel. A view, valid until the next scan."""
        return self._labels.semantic

    @property
    def confidence(self) -> NDArray[np.float32]:
        """(V,) float32 in 0-1: probability of that class. A view, valid until the next scan."""
        return self._labels.confidence

    def register_scan(self, scan: Scan) -> ScanUpdate:
        """Label a scan and grow the map by it (III-E).

        Earlier labels change where objects merge and, unless only first looks count, where another
        look says so.

        Args:
            scan: Points in the map frame; points farther than ``local_range`` from the robot are
                left for later.

        Returns:
            What changed. The scan's number, with the seed, decides every random choice.
        """
        rng = np.random.default_rng((self.settings.seed, self.num_scans))

        # add new voxels
        observed = self._growing_map.observe(scan)
        clock = Stopwatch()

        # embed and classify, update look-up table
        ids = self._labels.looks_at(self.map, observed, scan.position)
        clock.lap("network")
        self.clusters.take_apart(self.map, ids, observed, scan.position)
        clock.lap("cluster")
        judged = self._labels.judge(self.map, ids, observed, scan.position, self.num_scans, rng)
        clock.lap("network")

        # cluster with neighbours
        objects = self.clusters.put_together(self.map, judged.embedding)
        clock.lap("cluster")

        # labels, by what is known of voxels and of what they are part of
        relabelled, num_reclassified = self._labels.decide(ids, self.clusters.class_shares(ids))
        clock.lap("network")

        # report all changes
        self.num_scans += 1
        self._memory.leave(scan.position, self.map.near)
        return ScanUpdate(
            index=self.num_scans - 1,
            point_ids=observed.point_ids,
            first_new=observed.first_new,
            num_new=len(observed.new),
            num_seen=len(observed.seen_again),
            merges=objects.merges,
            splits=objects.splits,
            moved=objects.moved,
            changed=np.union1d(objects.changed, relabelled),
            relabelled=relabelled,
            num_reclassified=num_reclassified,
            judged=judged.ids,
            floor=observed.floor,
            ms=observed.ms | clock.ms,
        )

    def find_points(self, scan: Scan) -> NDArray[np.int32]:
        """Return (N,) int32: voxel of each point of a scan registered before, -1 out of range."""
        return self._growing_map.find_points(scan)

    def labels(self, point_ids: NDArray[np.int32]) -> Labels:
        """Look up the labels of points as known now.

        Args:
            point_ids: (N,) int32 voxel ids, -1 for points without one (they get 255, 0 and 0).
        """
        semantic = np.full(len(point_ids), UNKNOWN, np.uint8)
        instance = np.zeros(len(point_ids), np.int32)
        confidence = np.zeros(len(point_ids), np.float32)

        # points that have a voxel
        known = point_ids >= 0
        ids = point_ids[known]
        semantic[known], confidence[known] = self.semantic[ids], self.confidence[ids]
        instance[known] = self.clusters.instance[ids]
        return Labels(semantic, instance, confidence, self.classes)

    def objects(self) -> list[MapObject]:
        """Take stock of the objects of the map as known now; the cost grows with the map."""
        if self._memory.holds_all:
            return list_objects(self.rows(), self.classes)
        sizes = np.bincount(self.clusters.instance)
        return list_by_batches(lambda first, last: self._pieces(), sizes, self.classes)

    def _pieces(self) -> Iterator[MapRows]:
        """Give the map's rows piece by piece; what was read leaves memory."""
        rows = self.rows()
        for start in range(0, len(rows), _PIECE):
            yield rows.part(slice(start, start + _PIECE))
            self._memory.leave_all()

    def rows(self, start: int = 0) -> MapRows:
        """Give the map's rows from voxel ``start`` on. Views, valid until the next scan."""
        return MapRows(
            self.map.xyz[start:],
            self.map.rgb[start:],
            self.semantic[start:],
            self.confidence[start:],
            self.clusters.instance[start:],
            self.clusters.embedding[start:],
        )

    def evidence_blocks(self, ids: NDArray[np.int32]) -> dict[int, NDArray[np.uint16]]:
        """Copy the evidence about the blocks in which voxels lie; empty if only first looks count.

        Args:
            ids: (M,) int32, as of ``ScanUpdate.judged``.
        """
        known = self._labels.evidence
        return {} if known is None else known.blocks(ids)

    def restore(
        self,
        parts: Iterable[MapRows],
        history: History,
        num_scans: int,
        floor: float | None,
        evidence: Iterable[NDArray[np.uint16]] | None = None,
    ) -> None:
        """Put a new segmenter where an earlier one was after ``num_scans`` scans.

        Args:
            parts: Every voxel in id order, in pieces of any size: class and confidence as they
                were at last, object ids as given at first.
            history: All that became of objects so far.
            num_scans: Scans consumed.
            floor: Floor height of the last scan, metres, map frame.
            evidence: That about all voxels, in id order, in pieces of any size; None for a map
                that no more scans are added to.

        Raises:
            ValueError: The rows are not a map's, or lack evidence.
        """
        for part in parts:
            self._leave_now_and_then(len(part))
            self.map.restore(part.xyz, part.rgb)
            self._labels.append(part.semantic, part.confidence)
            self.clusters.restore(part.embedding, part.instance)
        self.num_scans, self._growing_map.floor = num_scans, floor

        if evidence is not None and (known := self._labels.evidence) is not None:
            for block in evidence:
                known.restore(block)
                self._leave_now_and_then(len(block))
            if len(known) != len(self.map):
                raise ValueError(f"evidence about {len(known):,} of {len(self.map):,} voxels")
        self.clusters.finish_restore(self.map, history, goes_on=evidence is not None)
        self._memory.leave_all()

    def _leave_now_and_then(self, count: int) -> None:
        """Let rows leave memory whenever many were touched."""
        self._num_touched += count
        if self._num_touched >= _PIECE:
            self._num_touched = 0
            self._memory.leave_all()
