"""The labels of a map's voxels: from the first look alone, as in the paper, or from all looks."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.incremental.column import IN_MEMORY, Column, Memory
from mcpseg_cli.incremental.evidence import UNIT, Evidence, Look
from mcpseg_cli.incremental.growing_map import Observation
from mcpseg_cli.incremental.map_rows import VoxelLabels
from mcpseg_cli.incremental.voxel_map import VoxelMap

_LOOKS_OFFLINE = 8  # scans taken to have seen each voxel of a complete cloud


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
        number: int,
        rng: np.random.Generator,
    ) -> tuple[Look, NDArray[np.int16]]:
        """Judge voxels at the scan of a number, each look in its own way.

        Also give (M, E) int16 what neighbours are compared by, in the order of the look.
        """


@dataclass(frozen=True)
class Judged:
    """What a scan told about voxels.

    Attributes:
        embedding: (M, E) int16 of the new voxels.
        ids: (J,) int32 voxels of which the evidence is another now; none where there is none.
    """

    embedding: NDArray[np.int16]
    ids: NDArray[np.int32]


class FirstLooks:
    """Labels that stay as they were at first (III-B).

    Args:
        classifier: What labels.
        num_classes: C.
        memory: Where the rows of voxels are.
    """

    def __init__(
        self, classifier: FirstClassifier, num_classes: int, *, memory: Memory = IN_MEMORY
    ) -> None:
        self._classifier = classifier
        self._num_classes = num_classes
        self._semantic = Column(np.uint8, memory=memory)
        self._confidence = Column(np.float32, memory=memory)
        self.evidence: Evidence | None = None

    @property
    def semantic(self) -> NDArray[np.uint8]:
        """(V,) uint8 class index of every voxel: a view, until the next ``judge``."""
        return self._semantic.rows

    @property
    def confidence(self) -> NDArray[np.float32]:
        """(V,) float32 in 0-1 probability of that class: a view, until the next ``judge``."""
        return self._confidence.rows

    def looks_at(
        self, voxels: VoxelMap, observed: Observation, position: NDArray[np.float64]
    ) -> NDArray[np.int32]:
        """List (M,) int32 the voxels to judge at a scan, ascending, all new ones among them."""
        return observed.new

    def judge(
        self,
        voxels: VoxelMap,
        ids: NDArray[np.int32],
        observed: Observation,
        position: NDArray[np.float64],
        number: int,
        rng: np.random.Generator,
    ) -> Judged:
        """Find out about voxels what a scan tells.

        Args:
            voxels: The map, the scan included.
            ids: (M,) int32 voxels, as of ``looks_at``.
            observed: What the scan showed of the map.
            position: (3,) float64 robot position, metres, map frame.
            number: Of the scan, from 0.
            rng: Decides every random choice.
        """
        floor = observed.floor or 0.0
        found = self._classifier.classify(voxels, ids, position, floor, rng)
        self.append(found.semantic, found.confidence)
        return Judged(found.embedding, np.empty(0, np.int32))

    def decide(
        self, ids: NDArray[np.int32], prior: NDArray[np.float32] | None
    ) -> tuple[NDArray[np.int32], int]:
        """Label the voxels judged last; here they have their labels, once and for all.

        Args:
            ids: (M,) int32, as of ``looks_at``.
            prior: (M, C) float32 what the objects they are of are, rows sum to 1 or, where nothing
                is known, to 0; None: only what is known of themselves counts.

        Returns:
            (Q,) int32 earlier voxels whose class or confidence changed, ascending, and how many of
            these changed class.
        """
        return np.empty(0, np.int32), 0

    def class_evidence(self, ids: NDArray[np.int32]) -> NDArray[np.uint16]:
        """Give (M, C) uint16 evidence of each class about (M,) int32 voxels."""
        evidence = np.zeros((len(ids), self._num_classes), np.uint16)
        semantic = self.semantic[ids]
        rows = np.flatnonzero(semantic < self._num_classes)
        confidence = np.round(self.confidence[ids[rows]] * UNIT)
        evidence[rows, semantic[rows]] = confidence.astype(np.uint16)
        return evidence

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
        memory: Where the rows of voxels are.
    """

    def __init__(
        self,
        looker: Looker,
        num_classes: int,
        *,
        only_first: bool = False,
        memory: Memory = IN_MEMORY,
    ) -> None:
        self._semantic = Column(np.uint8, memory=memory)
        self._confidence = Column(np.float32, memory=memory)
        self._num_classes = num_classes
        self._looker, self._only_first = looker, only_first
        self.evidence: Evidence = Evidence(num_classes, memory)

    def looks_at(
        self, voxels: VoxelMap, observed: Observation, position: NDArray[np.float64]
    ) -> NDArray[np.int32]:
        """List what the looker looks at; see ``FirstLooks.looks_at``."""
        return self._looker.looks_at(voxels, observed, position)

    def judge(
        self,
        voxels: VoxelMap,
        ids: NDArray[np.int32],
        observed: Observation,
        position: NDArray[np.float64],
        number: int,
        rng: np.random.Generator,
    ) -> Judged:
        """Look at voxels once more; see ``FirstLooks.judge``."""
        new, evidence = observed.new, self.evidence
        evidence.extend(len(new))
        seen = np.concatenate([observed.seen_again, new])
        evidence.count_looks(seen)

        # one more look at each voxel
        floor = observed.floor or 0.0
        looks = evidence.looks[ids]
        look, embedding = self._looker.look(voxels, ids, looks, position, floor, number, rng)
        embedding = embedding[np.argsort(look.ids)][ids >= observed.first_new]
        if self._only_first:
            look = look.of(look.ids >= observed.first_new)
        evidence.add(look)
        return Judged(embedding, seen if self._only_first else ids)

    def decide(
        self, ids: NDArray[np.int32], prior: NDArray[np.float32] | None
    ) -> tuple[NDArray[np.int32], int]:
        """Label voxels by what all looks say, and what their objects are; see ``FirstLooks``."""
        first_new = len(self.semantic)
        if self._only_first:
            ids, prior = ids[ids >= first_new], None
        semantic, confidence = self.evidence.labels(ids, prior)
        is_new = ids >= first_new
        self.append(semantic[is_new], confidence[is_new])

        known, semantic, confidence = ids[~is_new], semantic[~is_new], confidence[~is_new]
        is_other = semantic != self.semantic[known]
        is_changed = is_other | (confidence != self.confidence[known])
        self.semantic[known], self.confidence[known] = semantic, confidence
        return known[is_changed], int(is_other.sum())

    def judge_complete(
        self, voxels: VoxelMap, position: NDArray[np.float64], floor: float | None
    ) -> NDArray[np.int16]:
        """Look at all voxels of a complete map, as if it had been seen from all sides.

        Args:
            voxels: The map.
            position: (3,) float64 a robot position, metres, map frame.
            floor: Height of the floor, metres, map frame.

        Returns:
            (V, E) int16 embeddings.
        """
        everything = np.arange(len(voxels), dtype=np.int32)
        self.evidence.extend(len(voxels))
        for _ in range(_LOOKS_OFFLINE):
            self.evidence.count_looks(everything)
        looks, floor, rng = self.evidence.looks, floor or 0.0, np.random.default_rng(0)
        for number in range(_LOOKS_OFFLINE):
            look, embedding = self._looker.look(
                voxels, everything, looks, position, floor, number, rng
            )
            self.evidence.add(replace(look, weight=np.ones(len(voxels), np.float32)))
        return embedding[np.argsort(look.ids)]

    def class_evidence(self, ids: NDArray[np.int32]) -> NDArray[np.uint16]:
        """Give (M, C) uint16 evidence of each class about (M,) int32 voxels."""
        return self.evidence.of_class[ids]
