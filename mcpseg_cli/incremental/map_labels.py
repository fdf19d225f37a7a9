"""The labels of a map's voxels: from the first look alone, as in the paper, or from all looks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.incremental.column import Column
from mcpseg_cli.incremental.evidence import Evidence, Look
from mcpseg_cli.incremental.growing_map import Observation
from mcpseg_cli.incremental.map_rows import VoxelLabels
from mcpseg_cli.incremental.voxel_map import VoxelMap


class FirstClassifier(Protocol):
    """What labels voxels once, when they are first seen."""

    def classify(
        self,
        voxel_map: VoxelMap,
        ids: NDArray[np.int32],
        position: NDArray[np.float64],
        floor: float,
        rng: np.random.Generator,
    ) -> VoxelLabels:
        """Find class and embedding of voxels; see ``SegmentationMethod``."""


class Looker(Protocol):
    """What looks at voxels again and again; see ``room_network.RoomNetwork``."""

    def looks_at(
        self, voxels: VoxelMap, observed: Observation, position: NDArray[np.float64]
    ) -> NDArray[np.int32]:
        """List (M,) int32 the voxels to judge at a scan, ascending, all new ones among them."""

    def look(
        self,
        voxels: VoxelMap,
        ids: NDArray[np.int32],
        looks: NDArray[np.uint16],
        position: NDArray[np.float64],
        floor: float,
        rng: np.random.Generator,
    ) -> tuple[Look, NDArray[np.int16]]:
        """Judge voxels; also give (M, E) int16 what neighbours are compared by, in that order."""


@dataclass(frozen=True)
class LabelUpdate:
    """What a scan told about voxels.

    Attributes:
        embedding: (M, E) int16 of the new voxels.
        judged: (J,) int32 voxels of which the evidence is another now; none where there is none.
        changed: (Q,) int32 earlier voxels whose class or confidence changed, ascending.
        num_reclassified: How many of these changed class.
    """

    embedding: NDArray[np.int16]
    judged: NDArray[np.int32]
    changed: NDArray[np.int32]
    num_reclassified: int


class FirstLooks:
    """Labels that stay as they were at first (III-B).

    Args:
        classifier: What labels.
    """

    def __init__(self, classifier: FirstClassifier) -> None:
        self._classifier = classifier
        self._semantic = Column(np.uint8)
        self._confidence = Column(np.float32)
        self.evidence: Evidence | None = None

    @property
    def semantic(self) -> NDArray[np.uint8]:
        """(V,) uint8 class index of every voxel: a view, until the next ``update``."""
        return self._semantic.rows

    @property
    def confidence(self) -> NDArray[np.float32]:
        """(V,) float32 in 0-1 probability of that class: a view, until the next ``update``."""
        return self._confidence.rows

    def update(
        self,
        voxels: VoxelMap,
        observed: Observation,
        position: NDArray[np.float64],
        rng: np.random.Generator,
    ) -> LabelUpdate:
        """Label what a scan showed.

        Args:
            voxels: The map, the scan included.
            observed: What the scan showed of it.
            position: (3,) float64 robot position, metres, map frame.
            rng: Decides every random choice.

        Returns:
            What that told: nothing of earlier voxels.
        """
        floor = observed.floor or 0.0
        found = self._classifier.classify(voxels, observed.new, position, floor, rng)
        self.append(found.semantic, found.confidence)
        nothing = np.empty(0, np.int32)
        return LabelUpdate(found.embedding, nothing, nothing, 0)

    def append(self, semantic: NDArray[np.uint8], confidence: NDArray[np.float32]) -> None:
        """Add labels of the next voxels, as kept of an earlier run."""
        self._semantic.append(semantic)
        self._confidence.append(confidence)


class AllLooks(FirstLooks):
    """Labels that improve with every look: decided by the evidence of all of them.

    Args:
        looker: What judges voxels.
        num_classes: C.
        only_first: Only the first look at each voxel counts.
    """

    def __init__(self, looker: Looker, num_classes: int, *, only_first: bool = False) -> None:
        self._semantic = Column(np.uint8)
        self._confidence = Column(np.float32)
        self._looker, self._only_first = looker, only_first
        self.evidence: Evidence = Evidence(num_classes)

    def update(
        self,
        voxels: VoxelMap,
        observed: Observation,
        position: NDArray[np.float64],
        rng: np.random.Generator,
    ) -> LabelUpdate:
        """Look at what is in range, and decide anew; see ``FirstLooks.update``."""
        new, evidence = observed.new, self.evidence
        evidence.extend(len(new))
        seen = np.concatenate([observed.seen_again, new])
        evidence.count_looks(seen)

        # one more look at each voxel
        ids = self._looker.looks_at(voxels, observed, position)
        floor = observed.floor or 0.0
        look, embedding = self._looker.look(voxels, ids, evidence.looks[ids], position, floor, rng)
        embedding = embedding[np.argsort(look.ids)][ids >= observed.first_new]
        if self._only_first:
            ids = new
            look = look.of(look.ids >= observed.first_new)
        evidence.add(look)

        # what all looks say now
        changed, num_reclassified = self._decide(ids, observed.first_new)
        judged = seen if self._only_first else ids
        return LabelUpdate(embedding, judged, changed, num_reclassified)

    def _decide(self, ids: NDArray[np.int32], first_new: int) -> tuple[NDArray[np.int32], int]:
        """Label voxels by evidence; return the earlier ones that changed, how many in class."""
        semantic, confidence = self.evidence.labels(ids)
        is_new = ids >= first_new
        self.append(semantic[is_new], confidence[is_new])

        known, semantic, confidence = ids[~is_new], semantic[~is_new], confidence[~is_new]
        is_other = semantic != self.semantic[known]
        is_changed = is_other | (confidence != self.confidence[known])
        self.semantic[known], self.confidence[known] = semantic, confidence
        return known[is_changed], int(is_other.sum())
