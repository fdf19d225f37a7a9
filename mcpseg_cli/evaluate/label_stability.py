"""How steady labels are: what becomes of a voxel's class and object when it is looked at again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN


@dataclass(frozen=True)
class Stability:
    """Changes of labels over the scans of a run.

    Attributes:
        looks_again: Voxels seen again, counted each time.
        flips: How many of these carried another class than at the look before.
        flips_per_look: Their share.
        flips_to_right: Flips to the true class.
        flips_to_wrong: Flips away from it.
        flips_unseen: Voxels of the final map that carry another class than at their last look.
        ids_switched: How many of ``looks_again`` carried another object id than at the look before.
        switches_per_look: Their share.
        ids_switched_unseen: Voxels of the final map that carry another id than at their last look.
        ids_merged: Objects that went over into an object known before.
        ids_split: Times that voxels of one object were found in several.
    """

    looks_again: int
    flips: int
    flips_per_look: float
    flips_to_right: int
    flips_to_wrong: int
    flips_unseen: int
    ids_switched: int
    switches_per_look: float
    ids_switched_unseen: int
    ids_merged: int
    ids_split: int


class LabelHistory:
    """The labels that the voxels of a map had when last seen, and counts of how they changed.

    Args:
        true_semantic: (V,) uint8 true class of each voxel of the final map, 255 unknown.
    """

    def __init__(self, true_semantic: NDArray[np.uint8]) -> None:
        self._true = true_semantic
        self._semantic = np.full(len(true_semantic), UNKNOWN, np.uint8)
        self._instance = np.full(len(true_semantic), -1, np.int32)  # -1: not seen yet
        self._known = {0}
        self._merged: set[int] = set()
        self._again = self._flips = self._right = self._wrong = self._switched = self._split = 0

    def look(
        self, ids: NDArray[np.integer], semantic: NDArray[np.uint8], instance: NDArray[np.int32]
    ) -> None:
        """Take in one labelled scan.

        Args:
            ids: (M,) voxels it shows, none twice.
            semantic: (M,) uint8 their classes as known then.
            instance: (M,) int32 their objects as known then.
        """
        # classes of the voxels that were seen before
        again = self._instance[ids] >= 0
        old, new, true = self._semantic[ids][again], semantic[again], self._true[ids][again]
        flipped = (old != new) & (true != UNKNOWN)
        self._again += int(again.sum())
        self._flips += int((old != new).sum())
        self._right += int((flipped & (new == true)).sum())
        self._wrong += int((flipped & (old == true)).sum())

        # their objects, and what is known from now on
        self._switched += self._follow_objects(self._instance[ids][again], instance[again])
        self._known.update(np.unique(instance).tolist())
        self._semantic[ids], self._instance[ids] = semantic, instance

    def finish(self, semantic: NDArray[np.uint8], instance: NDArray[np.int32]) -> Stability:
        """Compare with the final map and return all counts; call it once.

        Args:
            semantic: (V,) uint8 final classes.
            instance: (V,) int32 final objects.
        """
        seen = self._instance >= 0
        looks = max(self._again, 1)
        return Stability(
            looks_again=self._again,
            flips=self._flips,
            flips_per_look=self._flips / looks,
            flips_to_right=self._right,
            flips_to_wrong=self._wrong,
            flips_unseen=int((self._semantic != semantic)[seen].sum()),
            ids_switched=self._switched,
            switches_per_look=self._switched / looks,
            ids_switched_unseen=self._follow_objects(self._instance[seen], instance[seen]),
            ids_merged=len(self._merged),
            ids_split=self._split,
        )

    def _follow_objects(self, old: NDArray[np.int32], new: NDArray[np.int32]) -> int:
        """Count merges and splits between two looks at voxels; return how many ids changed."""
        # which objects of now have voxels of one of before
        switched = old != new
        pairs = np.unique(old.astype(np.int64) << 32 | new)
        sources, counts = np.unique(pairs >> 32, return_counts=True)
        self._split += int((counts[sources > 0] > 1).sum())

        # those that went over as a whole into one that was known
        whole = np.isin(pairs >> 32, sources[(counts == 1) & (sources > 0)])
        for source, target in zip(
            (pairs >> 32)[whole].tolist(), (pairs & 0xFFFFFFFF)[whole].tolist(), strict=True
        ):
            if source != target and target > 0 and target in self._known:
                self._merged.add(source)
        return int(switched.sum())
