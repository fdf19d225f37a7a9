"""One scan through the whole method (III-E): insert, add context, embed and classify, cluster. Read this first."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
import torch
from numpy.typing import NDArray

from mcpseg_cli.clustering import Clusters, embed_classes, quantise
from mcpseg_cli.columns import Column
from mcpseg_cli.config import EMBEDDING, SIMILARITY, Precision, SegmentSettings
from mcpseg_cli.context import context_input, network_input
from mcpseg_cli.device import find_device
from mcpseg_cli.floor import find_floor
from mcpseg_cli.formats.cloud import Labels
from mcpseg_cli.networks.network import Network
from mcpseg_cli.objects import MapObject, list_objects
from mcpseg_cli.scan import Scan, colour_of, near_robot
from mcpseg_cli.state import MapRows
from mcpseg_cli.voxel_map import VoxelMap
from mcpseg_cli.weights import Weights, find_weights, load_weights

_CHUNK_BATCHES = 64  # batches whose pooled context is kept at a time, which bounds memory
_TILE_VOXELS = 64  # voxels whose context is pooled at a time: 3,200 points with 200 features stay in a core's cache


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
        changed: (Q,) int32 ids of earlier voxels whose labels changed, ascending.
        floor: Height of the floor used, metres, map frame; None before any scan came in range.
        ms: Milliseconds by stage.
    """

    index: int
    point_ids: NDArray[np.int32]
    first_new: int
    num_new: int
    num_seen: int
    merges: NDArray[np.int32]
    changed: NDArray[np.int32]
    floor: float | None
    ms: dict[str, float]


class IncrementalSegmenter:
    """A growing labelled map, fed one scan at a time.

    Args:
        weights: Network and class table.
        settings: Everything else that decides the labels; batch size and similarity, where not given, are the network's
            own. A network without embedding joins neighbours of one class (IV-B), whatever the similarity.
        precision: Arithmetic of context pooling, which runs on as many threads as torch is set to; ``auto`` is bf16
            where the processor computes it natively.
        device: Where the network runs, as torch names it.

    Raises:
        McpsegError: The device does not exist here.
    """

    def __init__(
        self,
        weights: Weights,
        settings: SegmentSettings | None = None,
        *,
        precision: Precision = "auto",
        device: str = "cpu",
    ) -> None:
        self.settings = _complete(settings or SegmentSettings(), weights.network)
        self.info = weights.info
        self.device = device
        self.precision = resolve_precision(precision, device)
        self.map = VoxelMap(self.settings.voxel_size)
        self.clusters = Clusters(self.settings.similarity if weights.network.has_embedding else SIMILARITY)
        self.num_scans = 0
        self._semantic = Column(np.uint8)
        self._confidence = Column(np.float32)
        self._floor: float | None = None
        self._device = find_device(device)
        self._network = copy.deepcopy(weights.network).to(self._device)
        self._network.pool_in(self.precision)
        self._workers = ThreadPoolExecutor(torch.get_num_threads(), initializer=torch.set_num_threads, initargs=(1,))

    @classmethod
    def load(cls, weights: str = "smoke-test", settings: SegmentSettings | None = None) -> IncrementalSegmenter:
        """Make a segmenter from a weights file or the name of bundled weights.

        Raises:
            WeightsError: The weights are not there or damaged.
        """
        return cls(load_weights(Path(find_weights(weights))), settings)

    @property
    def semantic(self) -> NDArray[np.uint8]:
        """(V,) uint8 class index of every voxel. A view, valid until the next scan."""
        return self._semantic.rows

    @property
    def confidence(self) -> NDArray[np.float32]:
        """(V,) float32 in 0-1: probability of that class. A view, valid until the next scan."""
        return self._confidence.rows

    def register_scan(self, scan: Scan) -> ScanUpdate:
        """Label a scan and grow the map by it (III-E). Earlier labels change only where objects merge.

        Args:
            scan: Points in the map frame; points farther than ``local_range`` from the robot are left for later.

        Returns:
            What changed. The scan's number, with the seed, decides every random choice.
        """
        rng = np.random.default_rng((self.settings.seed, self.num_scans))
        clock = _Stopwatch()
        near = near_robot(scan, self.settings.local_range)
        first_new = len(self.map)
        point_ids = np.full(len(scan.xyz), -1, np.int32)
        point_ids[near] = self.map.insert(scan.xyz[near], colour_of(scan, near))
        new = np.arange(first_new, len(self.map), dtype=np.int32)
        num_seen = _count_distinct(point_ids[near & (point_ids < first_new)])
        clock.lap("insert")
        if len(near_xyz := scan.xyz[near]):
            self._floor = find_floor(self.settings.floor, self.map, scan.position, near_xyz, self._floor)
        clock.lap("floor")
        with _one_thread_per_operation():
            embedding = self._embed_and_classify(new, scan.position, rng)
        clock.lap("network")
        merges, changed = self.clusters.add(quantise(embedding), self.map.neighbours(new))
        clock.lap("cluster")
        self.num_scans += 1
        return ScanUpdate(
            self.num_scans - 1, point_ids, first_new, len(new), num_seen, merges, changed, self._floor, clock.ms
        )

    def find_points(self, scan: Scan) -> NDArray[np.int32]:
        """Return (N,) int32: the voxel of every point of a scan registered before, -1 for points out of range."""
        near = near_robot(scan, self.settings.local_range)
        point_ids = np.full(len(scan.xyz), -1, np.int32)
        point_ids[near] = self.map.find(scan.xyz[near])
        return point_ids

    def labels(self, point_ids: NDArray[np.int32]) -> Labels:
        """Look up the labels of points as known now.

        Args:
            point_ids: (N,) int32 voxel ids, -1 for points without one (they get 255, 0 and 0).
        """
        known = point_ids >= 0
        semantic = np.full(len(point_ids), 255, np.uint8)
        instance = np.zeros(len(point_ids), np.int32)
        confidence = np.zeros(len(point_ids), np.float32)
        ids = point_ids[known]
        semantic[known], confidence[known] = self.semantic[ids], self.confidence[ids]
        instance[known] = self.clusters.instance[ids]
        return Labels(semantic, instance, confidence, self.info.classes)

    def objects(self) -> list[MapObject]:
        """Take stock of the objects of the map as known now; the cost grows with the map."""
        return list_objects(self.rows(), self.info.classes)

    def rows(self, start: int = 0) -> MapRows:
        """Give the map's rows from voxel ``start`` on. Views, valid until the next scan."""
        return MapRows(
            self.map.xyz[start:], self.map.rgb[start:], self.semantic[start:], self.confidence[start:],
            self.clusters.instance[start:], self.clusters.embedding[start:],
        )  # fmt: skip

    def restore(self, parts: Iterable[MapRows], merges: NDArray[np.int32], num_scans: int, floor: float | None) -> None:
        """Put a new segmenter where an earlier one was after ``num_scans`` scans.

        Args:
            parts: Every voxel as first seen, in id order, in pieces of any size.
            merges: (P, 2) int32 all merges so far, in order.
            num_scans: Scans consumed.
            floor: Floor height of the last scan, metres, map frame.

        Raises:
            ValueError: The rows are not a map's.
        """
        for part in parts:
            self.map.restore(part.xyz, part.rgb)
            self._semantic.append(part.semantic)
            self._confidence.append(part.confidence)
            self.clusters.restore(part.embedding, part.instance)
        self.clusters.restore_merges(merges)
        self.num_scans, self._floor = num_scans, floor

    def _embed_and_classify(
        self, new: NDArray[np.int32], position: NDArray[np.float64], rng: np.random.Generator
    ) -> NDArray[np.float32]:
        """Run the network over new voxels in shuffled batches; keep their classes, return (M, E) embeddings."""
        embedding = np.empty((len(new), EMBEDDING), np.float32)
        semantic, confidence = np.empty(len(new), np.uint8), np.empty(len(new), np.float32)
        order = rng.permutation(len(new))
        chunk = _CHUNK_BATCHES * self.settings.batch_size
        # The last chunk takes what is left too: its last batch is filled up from it.
        ends = list(range(chunk, len(new) - chunk + 1, chunk))
        for rows in np.split(order, ends) if len(new) else []:
            unit, logits = self._run_batches(new[rows], position, rng)
            probability, best = torch.softmax(logits, dim=1).max(dim=1)
            semantic[rows], confidence[rows] = best.cpu().numpy(), probability.cpu().numpy()
            embedding[rows] = embed_classes(semantic[rows]) if unit is None else unit.cpu().numpy()
        self._semantic.append(semantic)
        self._confidence.append(confidence)
        return embedding

    @torch.inference_mode()
    def _run_batches(
        self, ids: NDArray[np.int32], position: NDArray[np.float64], rng: np.random.Generator
    ) -> tuple[torch.Tensor | None, torch.Tensor]:
        """Label voxels in batches of N, the last one filled up by sampling with replacement (III-B)."""
        xyz, rgb, size = self.map.xyz[ids], self.map.rgb[ids], self.settings.batch_size
        centre = torch.from_numpy(network_input(xyz, rgb, position, self._floor or 0.0)).to(self._device)
        pooled = self._pool_context(ids, rng) if self._network.needs_context else None
        rows = torch.arange(len(ids))
        if len(ids) > size:  # a single batch would be filled from itself, which changes no maximum
            rows = torch.cat([rows, torch.from_numpy(rng.integers(len(ids), size=-len(ids) % size))])
        batches = torch.split(rows.to(self._device), size)
        contexts = [None if pooled is None else pooled[batch] for batch in batches]
        outputs = list(self._workers.map(self._label_batch, [centre[batch] for batch in batches], contexts))
        units = [embedding for embedding, _ in outputs if embedding is not None]
        unit = torch.cat(units)[: len(ids)] if units else None
        return unit, torch.cat([logits for _, logits in outputs])[: len(ids)]

    @torch.inference_mode()
    def _label_batch(
        self, centre: torch.Tensor, pooled: torch.Tensor | None
    ) -> tuple[torch.Tensor | None, torch.Tensor]:
        return self._network.label(centre, pooled)

    def _pool_context(self, ids: NDArray[np.int32], rng: np.random.Generator) -> torch.Tensor:
        """Sample, gather and pool context in tiles that stay in cache, shared among the workers.

        Threads that meet once a scan stand a busy machine far better than operations that each wait for all cores. The
        tiles do not depend on how many workers there are, and so neither do the labels.
        """
        uniform = rng.random((len(ids), self.info.num_context), np.float32)
        num_tiles = min(2 * -(-len(ids) // (2 * _TILE_VOXELS)), len(ids)) if self._device.type == "cpu" else 1
        tiles = self._workers.map(self._pool_tile, np.array_split(ids, num_tiles), np.array_split(uniform, num_tiles))
        return torch.cat(list(tiles))

    @torch.inference_mode()
    def _pool_tile(self, ids: NDArray[np.int32], uniform: NDArray[np.float32]) -> torch.Tensor:
        sample = self.map.sample_context(ids, self.info.context_window, uniform)
        context = context_input(ids, sample, self.map.xyz, self.map.rgb)
        return self._network.pool_context(torch.from_numpy(context).to(self._device))


@contextmanager
def _one_thread_per_operation() -> Iterator[None]:
    """Keep torch from splitting single operations among cores: the workers share whole tiles instead."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


class _Stopwatch:
    """Milliseconds between laps, by name."""

    def __init__(self) -> None:
        self.ms: dict[str, float] = {}
        self._last = perf_counter()

    def lap(self, name: str) -> None:
        now = perf_counter()
        self.ms[name] = 1e3 * (now - self._last)
        self._last = now


def _complete(settings: SegmentSettings, network: Network) -> SegmentSettings:
    """Fill in what was not given by what the network was made for."""
    own = {"batch_size": network.batch_size, "similarity": network.similarity}
    return settings.model_copy(update={name: own[name] for name in own.keys() - settings.model_fields_set})


def resolve_precision(precision: Precision, device: str = "cpu") -> Precision:
    """Replace ``auto`` by what this machine does best: bf16 where it is native, else fp32."""
    if precision != "auto":
        return precision
    return "bf16" if device == "cpu" and _cpu_has_bf16() else "fp32"


def _cpu_has_bf16() -> bool:
    """Tell whether the processor multiplies bfloat16 natively (AMX or AVX512-BF16), as Linux reports it."""
    try:
        flags = Path("/proc/cpuinfo").read_text().split()
    except OSError:
        return False
    return "avx512_bf16" in flags or "amx_bf16" in flags


def _count_distinct(ids: NDArray[np.int32]) -> int:
    """Count distinct ids; sorting int32 is several times faster than ``np.unique``."""
    return int(np.count_nonzero(np.diff(np.sort(ids), prepend=-1)))
