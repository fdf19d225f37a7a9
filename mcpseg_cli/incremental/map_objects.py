"""What makes objects of a map's voxels: the paper's clustering, or the graph of all evidence."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import McpsegError
from mcpseg_cli.incremental.clustering import Clusters
from mcpseg_cli.incremental.column import IN_MEMORY, Memory
from mcpseg_cli.incremental.edges import Edges, EmbeddingEdges, EvidenceEdges
from mcpseg_cli.incremental.growing_map import Observation
from mcpseg_cli.incremental.map_labels import FirstLooks
from mcpseg_cli.incremental.methods import AnyMethod
from mcpseg_cli.incremental.network_method import NetworkMethod
from mcpseg_cli.incremental.object_graph import ObjectGraph
from mcpseg_cli.incremental.regrouping import History, Regrouping
from mcpseg_cli.incremental.voxel_map import VoxelMap


class MapObjects(Protocol):
    """The objects of a map: a scan takes apart, then, with new evidence, puts together."""

    @property
    def num_objects(self) -> int:
        """How many there are now."""

    @property
    def instance(self) -> NDArray[np.int32]:
        """(V,) int32 object id of every voxel as known now, 0 none: a view."""

    @property
    def embedding(self) -> NDArray[np.int16]:
        """(V, E) int16 unit embeddings, as fractions of 32767: a view."""

    def take_apart(
        self,
        voxels: VoxelMap,
        ids: NDArray[np.int32],
        observed: Observation,
        position: NDArray[np.float64],
    ) -> None:
        """Make ready for evidence about voxels to change.

        Args:
            voxels: The map, the scan included.
            ids: (M,) int32 voxels that will be judged, ascending, new ones last.
            observed: What the scan showed.
            position: (3,) float64 robot position, metres, map frame.
        """

    def put_together(self, voxels: VoxelMap, embedding: NDArray[np.int16]) -> Regrouping:
        """Give the new voxels, the map's last, objects; (N, E) int16 are their embeddings."""

    def put_all_together(self, voxels: VoxelMap, embedding: NDArray[np.int16]) -> None:
        """Give all voxels of a complete map objects; (V, E) int16 are their embeddings."""

    def class_shares(self, ids: NDArray[np.int32]) -> NDArray[np.float32] | None:
        """Give (M, C) float32 what the objects of voxels are; None where that does not count."""

    def restore(self, embedding: NDArray[np.int16], instance: NDArray[np.int32]) -> None:
        """Append voxels kept of an earlier run, with the objects they got at first."""

    def finish_restore(self, voxels: VoxelMap, history: History, *, goes_on: bool) -> None:
        """Bring the objects of restored voxels up to date; more scans may follow if it goes on."""


class ConnectedObjects(Clusters):
    """Objects by similar neighbours (III-C), as networks tell them.

    Args:
        method: What says which neighbours may connect, and from which similarity on.
        memory: Where the rows of voxels are.
    """

    def __init__(self, method: AnyMethod, memory: Memory = IN_MEMORY) -> None:
        super().__init__(method.similarity, memory)
        self._method = method

    def take_apart(
        self,
        voxels: VoxelMap,
        ids: NDArray[np.int32],
        observed: Observation,
        position: NDArray[np.float64],
    ) -> None:
        """Do nothing: what is connected stays so."""

    def put_together(self, voxels: VoxelMap, embedding: NDArray[np.int16]) -> Regrouping:
        """Connect the new voxels; see ``MapObjects``."""
        new = np.arange(len(self.instance), len(voxels), dtype=np.int32)
        partners = self._method.partners(voxels, new, embedding, self.embedding)
        merges, changed = self.add(embedding, partners)
        return Regrouping(merges, np.empty((0, 2), np.int32), np.empty(0, np.int32), changed)

    def put_all_together(self, voxels: VoxelMap, embedding: NDArray[np.int16]) -> None:
        """Connect all voxels; see ``MapObjects``."""
        self.put_together(voxels, embedding)

    def class_shares(self, ids: NDArray[np.int32]) -> None:
        """Say nothing: labels are those of voxels."""

    def finish_restore(self, voxels: VoxelMap, history: History, *, goes_on: bool) -> None:
        """Apply the merges; see ``MapObjects``."""
        self.restore_merges(history.merges)


def make_objects(method: AnyMethod, labels: FirstLooks, memory: Memory = IN_MEMORY) -> MapObjects:
    """Make what keeps the objects of a map.

    Args:
        method: What labels; its settings say which.
        labels: Those of the map.
        memory: Where the rows of voxels are.

    Raises:
        McpsegError: The method has nothing that a graph could be made of.
    """
    settings = method.settings
    if settings.clustering != "graph":
        return ConnectedObjects(method, memory)
    if not method.classes:
        raise McpsegError(
            f"--clustering graph: {method.name} has no classes and no embedding; "
            "expected a network; leave it out"
        )

    # what tells edges, and how far around the robot objects are put together anew
    edges: Edges = EmbeddingEdges(method.similarity)
    reach: float | None = settings.local_range
    if isinstance(method, NetworkMethod) and method.sees_windows and labels.evidence is not None:
        edges, reach = EvidenceEdges(labels.evidence), None
    return ObjectGraph(
        labels,
        edges,
        len(method.classes),
        threshold=settings.affinity,
        least=settings.object_voxels,
        reach=reach,
        memory=memory,
    )
