"""Incremental point classification (III-B): a network over batches of the voxels seen first."""

from __future__ import annotations

import copy
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from numpy.typing import NDArray

from mcpseg_cli.choices import Precision
from mcpseg_cli.config import EMBEDDING, SegmentSettings
from mcpseg_cli.incremental.clustering import embed_classes, quantise
from mcpseg_cli.incremental.context import context_input, network_input
from mcpseg_cli.incremental.evidence import Look
from mcpseg_cli.incremental.growing_map import Observation
from mcpseg_cli.incremental.map_rows import VoxelLabels
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.networks.description import resolve_precision
from mcpseg_cli.networks.device import find_device, one_thread_per_operation
from mcpseg_cli.networks.weights import Weights

_CHUNK_BATCHES = 64  # batches whose pooled context is kept at a time, which bounds memory
# voxels whose context is pooled at a time: 3,200 points with 200 features stay in a core's cache
_TILE_VOXELS = 64


class NetworkClassifier:
    """A network that classifies and embeds voxels in batches.

    Args:
        weights: Network and class table.
        settings: Batch size among them, complete.
        precision: Arithmetic of context pooling, which runs on as many threads as torch is set to;
            ``auto`` is bf16 where the processor computes it natively.
        device: Where the network runs, as torch names it.

    Raises:
        McpsegError: The device does not exist here.
    """

    def __init__(
        self,
        weights: Weights,
        settings: SegmentSettings,
        *,
        precision: Precision = "auto",
        device: str = "cpu",
    ) -> None:
        self.weights = weights
        self.settings = settings
        self.classes = weights.info.classes
        self.precision = resolve_precision(precision, device)

        # a network of its own, and who runs it
        self._device = find_device(device)
        self._network = copy.deepcopy(weights.network).to(self._device)
        self._network.pool_in(self.precision)
        self._workers = ThreadPoolExecutor(
            torch.get_num_threads(), initializer=torch.set_num_threads, initargs=(1,)
        )

    def classify(
        self,
        voxel_map: VoxelMap,
        ids: NDArray[np.int32],
        position: NDArray[np.float64],
        floor: float,
        rng: np.random.Generator,
    ) -> VoxelLabels:
        """Run the network over voxels in shuffled batches; see ``SegmentationMethod``."""
        probability, embedding = self._judge(voxel_map, ids, position, floor, rng)
        semantic = probability.argmax(axis=1).astype(np.uint8)
        return VoxelLabels(semantic, probability.max(axis=1, initial=0), quantise(embedding))

    def looks_at(
        self, voxels: VoxelMap, observed: Observation, position: NDArray[np.float64]
    ) -> NDArray[np.int32]:
        """List the voxels to judge at a scan: those that it saw; see ``map_labels.Looker``."""
        return np.concatenate([observed.seen_again, observed.new])

    def look(
        self,
        voxels: VoxelMap,
        ids: NDArray[np.int32],
        looks: NDArray[np.uint16],
        position: NDArray[np.float64],
        floor: float,
        number: int,
        rng: np.random.Generator,
    ) -> tuple[Look, NDArray[np.int16]]:
        """Judge voxels with the context there is by now; see ``map_labels.Looker``."""
        probability, embedding = self._judge(voxels, ids, position, floor, rng)
        weight = np.ones(len(ids), np.float32)
        return Look(ids, probability, weight), quantise(embedding)

    def _judge(
        self,
        voxel_map: VoxelMap,
        ids: NDArray[np.int32],
        position: NDArray[np.float64],
        floor: float,
        rng: np.random.Generator,
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Find (M, C) float32 probabilities and (M, E) float32 embedding of voxels."""
        embedding = np.empty((len(ids), EMBEDDING), np.float32)
        probability = np.empty((len(ids), len(self.classes)), np.float32)

        # the last chunk takes what is left too: its last batch is filled up from it
        order = rng.permutation(len(ids))
        chunk = _CHUNK_BATCHES * self.settings.batch_size
        ends = list(range(chunk, len(ids) - chunk + 1, chunk))
        chunks = np.split(order, ends) if len(ids) else []

        # recombine the output of all batches
        with one_thread_per_operation():
            for rows in chunks:
                unit, logits = self._run_batches(voxel_map, ids[rows], position, floor, rng)
                probability[rows] = torch.softmax(logits, dim=1).cpu().numpy()
                if unit is None:
                    embedding[rows] = embed_classes(probability[rows].argmax(axis=1))
                else:
                    embedding[rows] = unit.cpu().numpy()
        return probability, embedding

    @torch.inference_mode()
    def _run_batches(
        self,
        voxel_map: VoxelMap,
        ids: NDArray[np.int32],
        position: NDArray[np.float64],
        floor: float,
        rng: np.random.Generator,
    ) -> tuple[torch.Tensor | None, torch.Tensor]:
        """Embed and classify voxels in batches of N (III-B)."""
        # normalise, retrieve context
        xyz, rgb, size = voxel_map.xyz[ids], voxel_map.rgb[ids], self.settings.batch_size
        centre = torch.from_numpy(network_input(xyz, rgb, position, floor)).to(self._device)
        needs_context = self._network.traits.needs_context
        pooled = self._pool_context(voxel_map, ids, rng) if needs_context else None

        # the last batch is sampled with replacement; a single one would be filled from itself,
        # which changes no maximum
        rows = torch.arange(len(ids))
        if len(ids) > size:
            filling = torch.from_numpy(rng.integers(len(ids), size=-len(ids) % size))
            rows = torch.cat([rows, filling])
        batches = torch.split(rows.to(self._device), size)

        # the workers share the batches
        contexts = [None if pooled is None else pooled[batch] for batch in batches]
        centres = [centre[batch] for batch in batches]
        outputs = list(self._workers.map(self._run_batch, centres, contexts))
        units = [embedding for embedding, _ in outputs if embedding is not None]
        unit = torch.cat(units)[: len(ids)] if units else None
        return unit, torch.cat([logits for _, logits in outputs])[: len(ids)]

    @torch.inference_mode()
    def _run_batch(
        self, centre: torch.Tensor, pooled: torch.Tensor | None
    ) -> tuple[torch.Tensor | None, torch.Tensor]:
        return self._network.label(centre, pooled)

    def _pool_context(
        self, voxel_map: VoxelMap, ids: NDArray[np.int32], rng: np.random.Generator
    ) -> torch.Tensor:
        """Sample, gather and pool context in tiles that stay in cache, shared among the workers.

        Threads that meet once a scan stand a busy machine far better than operations that each wait
        for all cores. The tiles do not depend on how many workers there are, and so neither do the
        labels.
        """
        uniform = rng.random((len(ids), self.weights.info.num_context), np.float32)

        # an even number of tiles, for two cores; all at once on a GPU
        num_tiles = 1
        if self._device.type == "cpu":
            num_tiles = min(2 * -(-len(ids) // (2 * _TILE_VOXELS)), len(ids))

        tiles = self._workers.map(
            self._pool_tile,
            [voxel_map] * num_tiles,
            np.array_split(ids, num_tiles),
            np.array_split(uniform, num_tiles),
        )
        return torch.cat(list(tiles))

    @torch.inference_mode()
    def _pool_tile(
        self, voxel_map: VoxelMap, ids: NDArray[np.int32], uniform: NDArray[np.float32]
    ) -> torch.Tensor:
        sample = voxel_map.sample_context(ids, self.weights.info.context_window, uniform)
        context = context_input(ids, sample, voxel_map.xyz, voxel_map.rgb)
        return self._network.pool_context(torch.from_numpy(context).to(self._device))
