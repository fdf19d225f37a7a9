"""What scans did to the objects known before: merges of whole objects, and voxels that moved."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.incremental.clustering import resolve


@dataclass(frozen=True)
class Regrouping:
    """What became of the objects known before.

    Attributes:
        merges: (P, 2) int32 objects that merged: old id, surviving id, in order of old id.
        splits: (S, 2) int32 objects that parts of others became: the other's id, the new id, in
            order of the new one.
        moved: (M,) int32 earlier voxels that went to another object otherwise than by merges,
            ascending.
        changed: (Q,) int32 all earlier voxels whose object is another now, ascending.
    """

    merges: NDArray[np.int32]
    splits: NDArray[np.int32]
    moved: NDArray[np.int32]
    changed: NDArray[np.int32]


@dataclass(frozen=True)
class Moves:
    """Voxels that went to another object otherwise than by merges.

    Attributes:
        ids: (M,) int32 voxels, ascending.
        instance: (M,) int32 the objects they are of from then on.
    """

    ids: NDArray[np.int32]
    instance: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.ids)


@dataclass(frozen=True)
class History:
    """All that scans did to objects, in order.

    Attributes:
        merges: (P, 2) int32 old id, surviving id.
        moves: Of each scan that moved voxels.
    """

    merges: NDArray[np.int32]
    moves: Iterable[Moves] = ()

    def apply(self, instance: NDArray[np.int32]) -> tuple[NDArray[np.int32], int]:
        """Bring object ids up to date.

        An id that merged is never given out again, so that it does not matter which merges came
        before a move and which after.

        Args:
            instance: (V,) int32 as each voxel got them at first; changed in place.

        Returns:
            (V,) int32 ids as known now, and how many were ever given out, 0 included.

        Raises:
            IndexError: There is no such voxel.
        """
        most = max(instance.max(initial=0), self.merges.max(initial=0))
        for moves in self.moves:
            instance[moves.ids] = moves.instance
            most = max(most, moves.instance.max(initial=0))
        survivor = np.arange(most + 1, dtype=np.int32)
        survivor[self.merges[:, 0]] = self.merges[:, 1]
        return resolve(instance, survivor), int(most) + 1
