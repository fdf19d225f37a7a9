"""What a scan changed of what was known before, as the checkpoint keeps it."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.incremental.evidence import HUNDREDTHS

_ROW = 6  # bytes of a changed label: 4 of its id, class, confidence


@dataclass(frozen=True)
class LabelChanges:
    """Labels that voxels have from some scan on, until another changes them.

    Attributes:
        ids: (Q,) int32 voxels, ascending.
        semantic: (Q,) uint8 class index.
        confidence: (Q,) float32 in 0-1, in hundredths.
    """

    ids: NDArray[np.int32]
    semantic: NDArray[np.uint8]
    confidence: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.ids)

    def are_within(self, num_voxels: int) -> bool:
        """Tell whether the voxels are in order, none twice, and of a map of so many."""
        return bool((np.diff(self.ids, prepend=np.int32(-1), append=num_voxels) > 0).all())

    def packed(self) -> bytes:
        """Compress: the steps from id to id are small, and labels repeat."""
        # bytes of one weight together: nearly all of the higher ones are 0
        steps = np.diff(self.ids, prepend=np.int32(0)).astype("<u4")
        planes = steps.view(np.uint8).reshape(-1, 4).T
        hundredths = np.round(self.confidence * HUNDREDTHS).astype(np.uint8)
        return zlib.compress(planes.tobytes() + self.semantic.tobytes() + hundredths.tobytes(), 1)

    @classmethod
    def unpacked(cls, data: bytes) -> LabelChanges:
        """Read what ``packed`` gave.

        Raises:
            ValueError: It is something else.
        """
        try:
            raw = zlib.decompress(data)
        except zlib.error as error:
            raise ValueError(str(error)) from error
        columns = np.frombuffer(raw, np.uint8).reshape(_ROW, -1)
        steps = np.ascontiguousarray(columns[:4].T).view("<u4")[:, 0]
        confidence = columns[5].astype(np.float32) / np.float32(HUNDREDTHS)
        return cls(np.cumsum(steps, dtype=np.int32), columns[4], confidence)

    def apply(self, semantic: NDArray[np.uint8], confidence: NDArray[np.float32]) -> None:
        """Change the labels of a map: (V,) each, in place."""
        semantic[self.ids], confidence[self.ids] = self.semantic, self.confidence


@dataclass(frozen=True)
class MapChanges:
    """All that a scan changed, beside the voxels that it added.

    Attributes:
        merges: (P, 2) int32 objects that merged: old id, surviving id.
        labels: Those of voxels known before.
        evidence: Rows of whole blocks by number, see ``Evidence.blocks``; none for methods whose
            first looks count alone.
    """

    merges: NDArray[np.int32]
    labels: LabelChanges
    evidence: Mapping[int, NDArray[np.uint16]]

    @classmethod
    def none(cls) -> MapChanges:
        """Return those of a scan that changed nothing."""
        labels = LabelChanges(np.empty(0, np.int32), np.empty(0, np.uint8), np.empty(0, np.float32))
        return cls(np.empty((0, 2), np.int32), labels, {})
