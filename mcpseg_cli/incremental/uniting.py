"""Voxels of several maps of one frame as one: evidence added, column by column of the building.

A column is a square of the ground with all that is above it. What its objects are depends on the
voxels next to it, too: these, its rim, are united with it but belong to its neighbours.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.grid import MAX_VOXEL
from mcpseg_cli.incremental.evidence import FULL
from mcpseg_cli.incremental.object_graph import INERTIA
from mcpseg_cli.networks.stencil import NUM_FORWARD

WIDTH = 128
"""Voxels along the edge of a column."""

_HALF = 13
_OFFSETS = np.array(
    [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)], np.int64
)
FORWARD = _OFFSETS[_HALF + 1 :]
"""(13, 3) int64 steps to the forward neighbours, in the order of their evidence."""


@dataclass(frozen=True)
class PartVoxels:
    """Voxels of the maps that are united, in any order.

    Attributes:
        voxel: (N, 3) int32.
        part: (N,) int32 number of the map; of one map, those of one voxel in an order of its own.
        xyz: (N, 3) float32, metres, frame of the united map.
        rgb: (N, 3) uint8.
        embedding: (N, E) int16.
        evidence: (N, C + 27) uint16 as of ``Evidence.rows``.
        instance: (N,) int32 object in its map.
    """

    voxel: NDArray[np.int32]
    part: NDArray[np.int32]
    xyz: NDArray[np.float32]
    rgb: NDArray[np.uint8]
    embedding: NDArray[np.int16]
    evidence: NDArray[np.uint16]
    instance: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.voxel)

    def select(self, rows: NDArray[np.integer] | NDArray[np.bool_] | slice) -> PartVoxels:
        """Return some of them."""
        return PartVoxels(*(column[rows] for column in vars(self).values()))


@dataclass(frozen=True)
class UnitedVoxels:
    """Distinct voxels: those of the column, by x, y and z, then those of its rim.

    Attributes:
        key: (V,) int64 what orders them, see ``keys_of``.
        num_inside: Those of the column.
        chosen: (V,) int64 the row that gives a voxel its point, colour and embedding.
        evidence: (V, C + 27) uint16 sums.
        source: (N,) int32 the voxel that each row went into.
    """

    key: NDArray[np.int64]
    num_inside: int
    chosen: NDArray[np.int64]
    evidence: NDArray[np.uint16]
    source: NDArray[np.int32]


def column_of(voxel: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return (N, 2) int32 the columns of (N, 3) int32 voxels."""
    return voxel[:, :2] >> np.int32(WIDTH.bit_length() - 1)


def keys_of(voxel: NDArray[np.integer], column: tuple[int, int]) -> NDArray[np.int64]:
    """Return (N,) int64 keys of voxels in a column or its rim, which order them by x, y and z."""
    place = voxel.astype(np.int64)
    place[:, 0] -= column[0] * WIDTH - 1
    place[:, 1] -= column[1] * WIDTH - 1
    keys: NDArray[np.int64] = (place[:, 0] << 32) | (place[:, 1] << 24) | (place[:, 2] + MAX_VOXEL)
    return keys


def voxels_of(keys: NDArray[np.int64], column: tuple[int, int]) -> NDArray[np.int64]:
    """Return (N, 3) int64 the voxels of keys; the inverse of ``keys_of``."""
    x, y, z = keys >> 32, (keys >> 24) & 255, keys & (2 * MAX_VOXEL - 1)
    low = np.array([column[0] * WIDTH - 1, column[1] * WIDTH - 1, -MAX_VOXEL])
    voxel: NDArray[np.int64] = np.stack([x, y, z], axis=1) + low
    return voxel


def is_rim(keys: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell of (N,) int64 keys whether they are of the rim of their column."""
    x, y = keys >> 32, (keys >> 24) & 255
    rim: NDArray[np.bool_] = (x == 0) | (x == WIDTH + 1) | (y == 0) | (y == WIDTH + 1)
    return rim


def unite(rows: PartVoxels, column: tuple[int, int]) -> UnitedVoxels:
    """Unite the voxels of a column and its rim.

    Nothing depends on the order of the maps but which of two rows, equal in evidence, point and
    colour, gives the embedding: that of the lower number.

    Args:
        rows: All there are, of all maps.
        column: Which.

    Returns:
        Evidence added; sums that are too large for their 16 bits are halved. Of looks, those of the
        maps are added. The row with most class evidence gives point, colour and embedding.
    """
    keys = keys_of(rows.voxel, column)
    rim = is_rim(keys)
    order = np.lexsort((rows.part, keys, rim))
    is_first = np.diff(keys[order], prepend=-1) != 0
    starts = np.append(np.flatnonzero(is_first), len(order)).astype(np.int64)

    num_classes = rows.evidence.shape[1] - 2 * NUM_FORWARD - 1
    evidence, chosen = _add_rows(
        order, starts, rows.part, rows.xyz, rows.rgb, rows.evidence, num_classes
    )
    source = np.empty(len(order), np.int32)
    source[order] = np.cumsum(is_first) - 1
    firsts = order[starts[:-1]]
    return UnitedVoxels(keys[firsts], int((~rim[firsts]).sum()), chosen, evidence, source)


def list_edges(
    rows: PartVoxels, united: UnitedVoxels, column: tuple[int, int]
) -> tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int64]]:
    """List the edges that the voxels of a column have, to each other and to those of the rim.

    What was one object in a map is rather one again, and what was two rather two, as when a robot
    looks again: each map says so with its share of the evidence.

    Args:
        rows: What was united.
        united: From ``unite``.
        column: Which.

    Returns:
        (E, 2) int32 rows of ``united``, the voxel that keeps the evidence first; (E,) int64
        evidence that both are of one object; (E,) int64 evidence for or against; both 100 fold.
    """
    objects = _PartObjects(rows, united)
    inside, voxel = united.num_inside, voxels_of(united.key, column)
    order = np.argsort(united.key)
    num_classes = united.evidence.shape[1] - 2 * NUM_FORWARD - 1
    pairs = united.evidence[:, num_classes:-1].astype(np.int64)
    together, total = pairs[:, :NUM_FORWARD], pairs[:, :NUM_FORWARD] + pairs[:, NUM_FORWARD:]

    ends, joint, both = [], [], []
    for k, step in enumerate(FORWARD):
        owner = np.flatnonzero(total[:, k] > 0)
        wanted = keys_of(voxel[owner] + step, column)
        place = np.minimum(np.searchsorted(united.key, wanted, sorter=order), len(order) - 1)
        other = order[place]
        is_there = (united.key[other] == wanted) & ((owner < inside) | (other < inside))
        owner, other = owner[is_there], other[is_there]
        ends.append(np.stack([owner, other], axis=1))
        one, two, known = objects.agreement(k, owner, other)
        said, weight = total[owner, k], INERTIA * total[owner, k]
        joint.append(100 * together[owner, k] + weight * one // known)
        both.append(100 * said + weight * (one + two) // known)
    return np.concatenate(ends).astype(np.int32), np.concatenate(joint), np.concatenate(both)


class _PartObjects:
    """What the maps say of pairs of voxels: of one object, or of two.

    Args:
        rows: Of all maps.
        united: Where they went.
    """

    def __init__(self, rows: PartVoxels, united: UnitedVoxels) -> None:
        num_classes = rows.evidence.shape[1] - 2 * NUM_FORWARD - 1
        pairs = rows.evidence[:, num_classes:-1].astype(np.int64)
        self._said = pairs[:, :NUM_FORWARD] + pairs[:, NUM_FORWARD:]
        self._count, self._instance = len(united.key), rows.instance
        self._part, self._source = rows.part.astype(np.int64), united.source

        # a map that had two voxels where there is one now says what the first was of
        self._place, self._row = np.unique(
            self._part * self._count + united.source, return_index=True
        )

    def agreement(
        self, k: int, owner: NDArray[np.int64], other: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Sum over maps the evidence on the edges to forward neighbours ``k``.

        Args:
            k: Which neighbour.
            owner: (E,) voxels that keep the evidence, each at most once.
            other: (E,) their neighbours.

        Returns:
            (E,) int64 evidence of maps where both were of one object; of maps where they were of
            two; of all maps, at least 1.
        """
        neighbour = np.full(self._count, -1, np.int64)
        neighbour[owner] = other
        rows = np.flatnonzero((self._said[:, k] > 0) & (neighbour[self._source] >= 0))
        source, said = self._source[rows], self._said[rows, k]
        wanted = self._part[rows] * self._count + neighbour[source]
        place = np.minimum(np.searchsorted(self._place, wanted), len(self._place) - 1)
        is_there = self._place[place] == wanted
        first = self._instance[rows]
        second = np.where(is_there, self._instance[self._row[place]], 0)
        objects = (first > 0) & (second > 0)

        def total(chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
            sums = np.zeros(self._count, np.int64)
            np.add.at(sums, source[chosen], said[chosen])
            return sums[owner]

        everything = total(np.ones(len(rows), bool))
        return (
            total(objects & (first == second)),
            total(objects & (first != second)),
            np.maximum(everything, 1),
        )


def move_evidence(
    moved: NDArray[np.int32],
    neighbours: NDArray[np.int32],
    evidence: NDArray[np.uint16],
) -> NDArray[np.uint16]:
    """Carry over what is known of pairs of voxels that were moved, and lie otherwise now.

    Args:
        moved: (V, 3) int32 voxels where they are now; several may be in one.
        neighbours: (V, 26) int32 who was next to whom, -1 for none.
        evidence: (V, C + 27) uint16 as of ``Evidence.rows``.

    Returns:
        (V, C + 27) uint16: that of pairs that have become one voxel, or are no neighbours any more,
        is gone.
    """
    turned = evidence.copy()
    num_classes = evidence.shape[1] - 2 * NUM_FORWARD - 1
    turned[:, num_classes:-1] = 0
    _move_pairs(moved, neighbours, evidence, num_classes, turned)
    return turned


@njit(cache=True)
def _move_pairs(
    moved: NDArray[np.int32],
    neighbours: NDArray[np.int32],
    evidence: NDArray[np.uint16],
    num_classes: int,
    turned: NDArray[np.uint16],
) -> None:
    for i in range(moved.shape[0]):
        for k in range(_HALF):
            j = neighbours[i, _HALF + k]
            joint = np.int64(evidence[i, num_classes + k])
            apart = np.int64(evidence[i, num_classes + _HALF + k])
            if j < 0 or joint + apart == 0:
                continue
            x, y, z = (
                moved[j, 0] - moved[i, 0], moved[j, 1] - moved[i, 1], moved[j, 2] - moved[i, 2]
            )  # fmt: skip
            direction = 9 * x + 3 * y + z
            if max(abs(x), abs(y), abs(z)) > 1 or direction == 0:
                continue

            # it is kept with the voxel of which the other is a forward one
            owner = i if direction > 0 else j
            column = num_classes + abs(direction) - 1
            joint += turned[owner, column]
            apart += turned[owner, column + _HALF]
            while max(joint, apart) > FULL:
                joint >>= 1
                apart >>= 1
            turned[owner, column], turned[owner, column + _HALF] = joint, apart


@njit(cache=True)
def _add_rows(
    order: NDArray[np.int64],
    starts: NDArray[np.int64],
    part: NDArray[np.int32],
    xyz: NDArray[np.float32],
    rgb: NDArray[np.uint8],
    evidence: NDArray[np.uint16],
    num_classes: int,
) -> tuple[NDArray[np.uint16], NDArray[np.int64]]:
    """Add the rows of each voxel; choose the one that knows most."""
    count, width = starts.size - 1, evidence.shape[1]
    united = np.empty((count, width), np.uint16)
    chosen = np.empty(count, np.int64)
    for i in range(count):
        sums = np.zeros(width, np.int64)
        best, most = order[starts[i]], np.int64(-1)
        here, looks = -1, np.int64(0)
        for at in range(starts[i], starts[i + 1]):
            row, known = order[at], np.int64(0)
            for c in range(width - 1):
                sums[c] += evidence[row, c]
            for c in range(num_classes):
                known += evidence[row, c]
            if known > most or (known == most and _is_before(xyz, rgb, row, best)):
                best, most = row, known

            # a scan that saw two voxels of a map that are one now saw one
            looks = max(looks, np.int64(evidence[row, width - 1])) if part[row] == here else (
                np.int64(evidence[row, width - 1])
            )  # fmt: skip
            here = part[row]
            if at + 1 == starts[i + 1] or part[order[at + 1]] != here:
                sums[width - 1] += looks
        chosen[i] = best
        _fit(sums, num_classes, united[i])
    return united, chosen


@njit(cache=True)
def _is_before(xyz: NDArray[np.float32], rgb: NDArray[np.uint8], one: int, other: int) -> bool:
    """Order rows by point and colour."""
    for axis in range(3):
        if xyz[one, axis] != xyz[other, axis]:
            return bool(xyz[one, axis] < xyz[other, axis])
    for channel in range(3):
        if rgb[one, channel] != rgb[other, channel]:
            return bool(rgb[one, channel] < rgb[other, channel])
    return False


@njit(cache=True)
def _fit(sums: NDArray[np.int64], num_classes: int, row: NDArray[np.uint16]) -> None:
    """Halve what is too large, as evidence does: all classes together, pairs one by one."""
    while num_classes > 0 and sums[:num_classes].max() > FULL:
        for c in range(num_classes):
            sums[c] >>= 1
    for k in range(num_classes, num_classes + _HALF):
        while max(sums[k], sums[k + _HALF]) > FULL:
            sums[k] >>= 1
            sums[k + _HALF] >>= 1
    sums[-1] = min(sums[-1], 65535)
    for c in range(sums.size):
        row[c] = sums[c]
