"""A network as a method: what it says of itself is known at once, torch is imported when it looks.

A run with nothing new, a merge and a score need no network, only what weights say of themselves.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Precision
from mcpseg_cli.config import SIMILARITY, SegmentSettings
from mcpseg_cli.incremental.evidence import Look
from mcpseg_cli.incremental.growing_map import Observation
from mcpseg_cli.incremental.map_rows import VoxelLabels
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.networks.description import DescribedWeights, resolve_precision

if TYPE_CHECKING:
    from mcpseg_cli.incremental.classification import NetworkClassifier
    from mcpseg_cli.incremental.room_network import RoomNetwork
    from mcpseg_cli.networks.weights import Weights


class NetworkMethod:
    """Any network, as ``SegmentationMethod`` asks.

    Args:
        weights: Network and class table; of weights that are only described, the tensors are read
            when they are needed.
        settings: Batch size and similarity, where not given, are the network's own. A network
            without embedding joins neighbours of one class (IV-B), whatever the similarity.
        precision: Arithmetic of context pooling or of the dense layers, see
            ``description.resolve_precision``.
        device: Where the network runs, as torch names it.

    Attributes: See ``SegmentationMethod``.

    Raises:
        McpsegError: The weights are loaded, and the device does not exist here.
    """

    def __init__(
        self,
        weights: Weights | DescribedWeights,
        settings: SegmentSettings,
        *,
        precision: Precision = "auto",
        device: str = "cpu",
    ) -> None:
        traits = weights.info.traits
        self.name: str = weights.info.architecture
        self.weights = weights
        self.classes = weights.info.classes
        self.settings = traits.complete(settings)
        self.similarity = self.settings.similarity if traits.has_embedding else SIMILARITY
        self.precision = resolve_precision(precision, device)
        self.sees_windows = traits.sees_windows

        self._device = device
        self._room: RoomNetwork | None = None
        self._classifier: NetworkClassifier | None = None
        if not isinstance(weights, DescribedWeights):
            self.get_ready()

    def configuration(self) -> dict[str, object]:
        """Record the hash of the weights, which says all; see ``SegmentationMethod``."""
        return {"weights": self.weights.sha256}

    def get_ready(self) -> None:
        """Build the network, unless that was done.

        Raises:
            WeightsError: The weights are damaged, or changed since they were described.
            McpsegError: The device does not exist here.
        """
        if self._room or self._classifier:
            return
        from mcpseg_cli.incremental.classification import NetworkClassifier
        from mcpseg_cli.incremental.room_network import RoomNetwork
        from mcpseg_cli.networks.weights import load_described

        weights = self.weights
        loaded = load_described(weights) if isinstance(weights, DescribedWeights) else weights
        precision, device = self.precision, self._device
        if self.sees_windows:
            self._room = RoomNetwork(loaded, self.settings, precision=precision, device=device)
        else:
            self._classifier = NetworkClassifier(
                loaded, self.settings, precision=precision, device=device
            )

    def classify(
        self,
        voxel_map: VoxelMap,
        ids: NDArray[np.int32],
        position: NDArray[np.float64],
        floor: float,
        rng: np.random.Generator,
    ) -> VoxelLabels:
        """Run a network that sees batches over voxels; see ``SegmentationMethod``."""
        self.get_ready()
        assert self._classifier is not None  # one that sees windows looks
        return self._classifier.classify(voxel_map, ids, position, floor, rng)

    def looks_at(
        self, voxels: VoxelMap, observed: Observation, position: NDArray[np.float64]
    ) -> NDArray[np.int32]:
        """List the voxels to judge at a scan; see ``map_labels.Looker``."""
        return self._looker.looks_at(voxels, observed, position)

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
        """Judge voxels; see ``map_labels.Looker``."""
        return self._looker.look(voxels, ids, looks, position, floor, number, rng)

    def partners(
        self,
        voxel_map: VoxelMap,
        new: NDArray[np.int32],
        embedding: NDArray[np.int16],
        known: NDArray[np.int16],
    ) -> NDArray[np.int32]:
        """Give all neighbours: how similar they are decides; see ``SegmentationMethod``."""
        return voxel_map.neighbours(new)

    @property
    def _looker(self) -> RoomNetwork | NetworkClassifier:
        self.get_ready()
        looker = self._room or self._classifier
        assert looker is not None
        return looker
