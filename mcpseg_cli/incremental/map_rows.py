"""The rows of a labelled map: what is known of every voxel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.config import EMBEDDING

COLUMNS: dict[str, tuple[type[np.generic], tuple[int, ...]]] = {
    "xyz": (np.float32, (3,)),
    "rgb": (np.uint8, (3,)),
    "semantic": (np.uint8, ()),
    "confidence": (np.float32, ()),
    "instance": (np.int32, ()),
    "embedding": (np.int16, (EMBEDDING,)),
}
"""What a map keeps of every voxel: type and shape of a row, by attribute of ``MapRows``."""


@dataclass(frozen=True)
class VoxelLabels:
    """What is found out about M voxels.

    Attributes:
        semantic: (M,) uint8 class index, 255 unknown.
        confidence: (M,) float32 in 0-1: probability of that class, 0 where it is unknown.
        embedding: (M, E) int16 what neighbours are compared by.
    """

    semantic: NDArray[np.uint8]
    confidence: NDArray[np.float32]
    embedding: NDArray[np.int16]


@dataclass(frozen=True)
class MapRows:
    """What the map knows of a range of voxels, as it was when they were first seen.

    Attributes:
        xyz: (V, 3) float32, metres, map frame.
        rgb: (V, 3) uint8.
        semantic: (V,) uint8 class index.
        confidence: (V,) float32 in 0-1.
        instance: (V,) int32 object id given at first; merges came later.
        embedding: (V, E) int16, see ``clustering.quantise``.
    """

    xyz: NDArray[np.float32]
    rgb: NDArray[np.uint8]
    semantic: NDArray[np.uint8]
    confidence: NDArray[np.float32]
    instance: NDArray[np.int32]
    embedding: NDArray[np.int16]

    def __len__(self) -> int:
        return len(self.xyz)

    def part(self, which: slice) -> MapRows:
        """Return some of the rows: views."""
        return MapRows(*[getattr(self, name)[which] for name in COLUMNS])
