"""A column of the merged map on its way: united, then linked, then labelled."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import naming
from mcpseg_cli.incremental.evidence import BLOCK
from mcpseg_cli.incremental.regrouping import Moves
from mcpseg_cli.incremental.uniting import PartVoxels, UnitedVoxels


@dataclass(frozen=True)
class UnitedColumn:
    """The voxels of a column, by x, y and z.

    Attributes:
        key: (V,) int64, see ``uniting.keys_of``.
        xyz: (V, 3) float32, metres.
        rgb: (V, 3) uint8.
        embedding: (V, E) int16.
        evidence: (V, C + 27) uint16.
        cluster: (V,) int32 number of the cluster, counted within the column.
        part: (N,) int32 number of the map that each source is of, ascending.
        source: (N,) int32 voxel of each source, ascending within a map, each once.
        instance: (N,) int32 its object there.
    """

    key: NDArray[np.int64]
    xyz: NDArray[np.float32]
    rgb: NDArray[np.uint8]
    embedding: NDArray[np.int16]
    evidence: NDArray[np.uint16]
    cluster: NDArray[np.int32]
    part: NDArray[np.int32]
    source: NDArray[np.int32]
    instance: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.key)

    @classmethod
    def of(cls, rows: PartVoxels, united: UnitedVoxels, cluster: NDArray[np.int32]) -> Self:
        """Put together what is kept of the voxels of a column; its rim is left out."""
        inside = slice(0, united.num_inside)
        chosen = united.chosen[inside]

        # of two voxels of a map that have become one, the first
        own = np.flatnonzero(united.source < united.num_inside)
        own = own[np.lexsort((own, united.source[own], rows.part[own]))]
        pairs = (rows.part[own].astype(np.int64) << 32) | united.source[own]
        own = own[np.diff(pairs, prepend=-1) != 0]
        return cls(
            united.key[inside], rows.xyz[chosen], rows.rgb[chosen], rows.embedding[chosen],
            united.evidence[inside], cluster, rows.part[own], united.source[own],
            rows.instance[own],
        )  # fmt: skip

    def write(self, path: Path) -> None:
        """Write it.

        Raises:
            OSError: The disk is full.
        """
        with naming(path), path.open("wb") as file:
            for values in vars(self).values():
                np.save(file, values, allow_pickle=False)

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read what ``write`` wrote."""
        with path.open("rb") as file:
            return cls(*[np.load(file, allow_pickle=False) for _ in fields(cls)])

    def sources(self) -> dict[int, Moves]:
        """Give the voxels that each map has, by its number, with their objects there."""
        numbers, starts = np.unique(self.part, return_index=True)
        ends = [*starts[1:], len(self.part)]
        return {
            int(number): Moves(self.source[start:end], self.instance[start:end])
            for number, start, end in zip(numbers, starts, ends, strict=True)
        }

    @staticmethod
    def read_clusters(path: Path) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
        """Read keys and clusters alone."""
        column = UnitedColumn.read(path)
        return column.key, column.cluster


class EvidenceBlocks:
    """Cuts the evidence about consecutive voxels into the blocks it is kept in."""

    def __init__(self) -> None:
        self._rest: NDArray[np.uint16] | None = None
        self._next = 0

    def add(self, rows: NDArray[np.uint16], *, is_last: bool) -> dict[int, NDArray[np.uint16]]:
        """Give the blocks that are complete, or, with the last rows, all."""
        joined = rows if self._rest is None else np.concatenate([self._rest, rows])
        count = -(-len(joined) // BLOCK) if is_last else len(joined) // BLOCK
        self._rest = joined[count * BLOCK :]
        first, self._next = self._next, self._next + count
        return {first + at: joined[at * BLOCK : (at + 1) * BLOCK] for at in range(count)}
