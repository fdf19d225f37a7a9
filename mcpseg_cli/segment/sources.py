"""Where the voxels of a merged map come from: its parts, and the objects they were of in each."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.incremental.regrouping import Moves
from mcpseg_cli.segment.database import Database
from mcpseg_cli.segment.map_changes import packed_moves, unpacked_moves


@dataclass(frozen=True)
class Part:
    """A map that is part of a merged one.

    Attributes:
        name: What the merged map calls it.
        identity: Hash of the scans that it consumed, hex.
        scans: How many.
        voxels: Those it had.
        transform: 16 numbers, row by row: from its frame into that of the merged map; None: the
            same.
    """

    name: str
    identity: str
    scans: int
    voxels: int
    transform: tuple[float, ...] | None = None


class Sources:
    """The parts of the map in a checkpoint; none for a map of one run.

    Args:
        database: Of the checkpoint.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def write_parts(self, parts: list[Part]) -> None:
        """Write down what is merged, in order of number."""
        with self._database.transaction():
            for number, part in enumerate(parts):
                text = json.dumps(asdict(part), sort_keys=True)
                self._database.insert("parts", number, text)

    def parts(self) -> list[Part]:
        """Read them.

        Raises:
            StateError: Damaged.
        """
        found = []
        for expected, (number, text) in enumerate(self._database.rows("parts")):
            try:
                facts = json.loads(str(text))
                transform = facts.pop("transform")
                found.append(Part(**facts, transform=transform and tuple(transform)))
            except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
                raise self._database.damaged(f"part {expected}") from error
            if number != expected:
                raise self._database.damaged(f"part {expected}")
        return found

    def insert(self, first_id: int, part: int, voxels: Moves) -> None:
        """Write, within a transaction, which of some voxels a part has, and their objects in it.

        Args:
            first_id: The first of the voxels.
            part: Number.
            voxels: Ids counted from that one, ascending, each once; objects of the part.
        """
        self._database.insert("sources", part, first_id, packed_moves(voxels))

    def voxels(self, part: int) -> Iterator[Moves]:
        """Iterate over the voxels that a part has, with the objects they were of in it, by id.

        Raises:
            StateError: Damaged.
        """
        for _, first_id, blob in self._database.rows("sources", "part = ?", (part,)):
            try:
                moves = unpacked_moves(cast(bytes, blob))
            except (ValueError, TypeError) as error:
                raise self._database.damaged(f"sources of voxels from {first_id!r}") from error
            yield Moves(moves.ids + np.int32(cast(int, first_id)), moves.instance)

    def of_objects(self, instance: NDArray[np.int32]) -> dict[int, dict[str, list[int]]] | None:
        """Find which objects of the parts went into each object.

        Args:
            instance: (V,) int32 objects as known now.

        Returns:
            By object, by name of part: ids there, the one with most voxels first. None for a map
            that is not merged.
        """
        parts = self.parts()
        if not parts:
            return None
        found: dict[int, dict[str, list[int]]] = defaultdict(dict)
        for number, part in enumerate(parts):
            counts: dict[tuple[int, int], int] = defaultdict(int)
            for voxels in self.voxels(number):
                pairs = np.stack([instance[voxels.ids], voxels.instance], axis=1)
                for (now, then), count in _counted(pairs[(pairs > 0).all(axis=1)]):
                    counts[now, then] += count
            for (now, then), _ in sorted(counts.items(), key=lambda each: (-each[1], each[0])):
                found[now].setdefault(part.name, []).append(then)
        return found


def _counted(pairs: NDArray[np.int32]) -> Iterator[tuple[tuple[int, int], int]]:
    """Count rows that are equal."""
    keys = (pairs[:, 0].astype(np.int64) << 32) | pairs[:, 1]
    distinct, counts = np.unique(keys, return_counts=True)
    for key, count in zip(distinct.tolist(), counts.tolist(), strict=True):
        yield (key >> 32, key & 0xFFFFFFFF), count
