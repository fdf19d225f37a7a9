"""How labels came about, scan by scan, in the form that the page plays forward and backward."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.segment.events import LabelledEvent
from mcpseg_cli.segment.labelled_run import LabelledRun


@dataclass(frozen=True)
class _Log:
    """What scans changed, one after another.

    Attributes:
        ends: (S,) uint32 how many changes there are up to each scan.
        rows: (Q,) uint32 which points.
        swaps: (Q,) old XOR new value: applied once it takes a step forward, once more it takes
            that step back.
    """

    ends: NDArray[np.uint32]
    rows: NDArray[np.uint32]
    swaps: NDArray[np.uint32]


@dataclass(frozen=True)
class LabelHistory:
    """The labels of points as first seen, and all that became of them.

    Attributes:
        object_ids: (K,) int32 ids of all objects there ever were, 0 among them, ascending.
        classes: (P,) uint8 classes that points ever had, ascending.
        semantic: (N,) uint8 class as first seen.
        instance: (N,) uint32 object as first seen, as its place in ``object_ids``.
        class_log: Changes of classes.
        move_log: Points that went to other objects otherwise than by merges, as places.
        merge_ends: (S,) uint32 how many merges there are up to each scan.
        merges: (M, 2) uint32 old and surviving object, as places.
    """

    object_ids: NDArray[np.int32]
    classes: NDArray[np.uint8]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.uint32]
    class_log: _Log
    move_log: _Log
    merge_ends: NDArray[np.uint32]
    merges: NDArray[np.uint32]

    @classmethod
    def of(cls, run: LabelledRun, ids: NDArray[np.int64]) -> LabelHistory:
        """Read the history of some voxels from a run.

        Args:
            run: The map.
            ids: (N,) voxel ids, ascending.

        Raises:
            StateError: The checkpoint is damaged.
        """
        # as first seen, and what each scan changed
        first_semantic, first_instance = run.first_labels()
        semantic, instance = first_semantic[ids], first_instance[ids]
        classes, class_log = _class_log(run, ids, semantic.copy())
        merges, merge_ends = run.merges(), _merge_ends(run)

        # all objects by their place among those that occur
        moved = [moves.instance for scan in range(len(run.scans)) for moves in run.moves(scan)]
        owners = [np.zeros(1, np.int32), instance, merges.ravel(), *moved]
        object_ids = np.unique(np.concatenate(owners))
        place = np.searchsorted(object_ids, instance).astype(np.uint32)
        return cls(
            object_ids.astype(np.int32), classes, semantic, place, class_log,
            _move_log(run, ids, object_ids, place.copy()), merge_ends,
            np.searchsorted(object_ids, merges).astype(np.uint32),
        )  # fmt: skip

    def columns(self, current: NDArray[np.int32]) -> dict[str, NDArray[np.generic]]:
        """Give the columns of the page.

        Args:
            current: (N,) int32 object ids as they are now.
        """
        return {
            "object": np.searchsorted(self.object_ids, current).astype(np.uint32),
            "first_semantic": self.semantic,
            "first_object": self.instance,
            "class_ends": self.class_log.ends,
            "class_rows": self.class_log.rows,
            "class_swaps": self.class_log.swaps.astype(np.uint8),
            "move_ends": self.move_log.ends,
            "move_rows": self.move_log.rows,
            "move_swaps": self.move_log.swaps,
            "merge_ends": self.merge_ends,
            "merges": self.merges,
        }


def _class_log(
    run: LabelledRun, ids: NDArray[np.int64], semantic: NDArray[np.uint8]
) -> tuple[NDArray[np.uint8], _Log]:
    """Follow the classes, ``semantic`` along with them; give those that ever were, and the log."""
    ever = np.bincount(semantic, minlength=256) > 0
    log = _Growing()
    for scan in range(len(run.scans)):
        for changes in run.label_changes(scan):
            rows, among = _among(ids, changes.ids)
            to = changes.semantic[among]
            log.add(rows, semantic[rows] ^ to)
            semantic[rows] = to
            ever[to] = True
        log.end_scan()
    return np.flatnonzero(ever).astype(np.uint8), log.done()


def _move_log(
    run: LabelledRun,
    ids: NDArray[np.int64],
    object_ids: NDArray[np.int32],
    place: NDArray[np.uint32],
) -> _Log:
    """Follow the objects but for merges, ``place`` along with them."""
    log = _Growing()
    for scan in range(len(run.scans)):
        for moves in run.moves(scan):
            rows, among = _among(ids, moves.ids)
            to = np.searchsorted(object_ids, moves.instance[among]).astype(np.uint32)
            log.add(rows, place[rows] ^ to)
            place[rows] = to
        log.end_scan()
    return log.done()


class _Growing:
    """A log while it is being written."""

    def __init__(self) -> None:
        self._rows: list[NDArray[np.uint32]] = []
        self._swaps: list[NDArray[np.uint32]] = []
        self._ends: list[int] = []
        self._count = 0

    def add(self, rows: NDArray[np.intp], swaps: NDArray[np.integer]) -> None:
        """Add the changes among these."""
        is_change = swaps != 0
        self._rows.append(rows[is_change].astype(np.uint32))
        self._swaps.append(swaps[is_change].astype(np.uint32))
        self._count += int(is_change.sum())

    def end_scan(self) -> None:
        """Note that all changes of a scan are there."""
        self._ends.append(self._count)

    def done(self) -> _Log:
        """Give the log."""
        nothing = np.empty(0, np.uint32)
        return _Log(
            np.array(self._ends, np.uint32),
            np.concatenate([nothing, *self._rows]),
            np.concatenate([nothing, *self._swaps]),
        )


def _among(
    ids: NDArray[np.int64], changed: NDArray[np.int32]
) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Say which changed voxels are among ``ids`` (a mask), and in which rows those are."""
    rows = np.searchsorted(ids, changed)
    among = ids[np.minimum(rows, len(ids) - 1)] == changed
    return rows[among], among


def _merge_ends(run: LabelledRun) -> NDArray[np.uint32]:
    """Count the merges up to each scan, as its event tells."""
    events = [record.event for record in run.scans]
    counts = [len(event.merges) if isinstance(event, LabelledEvent) else 0 for event in events]
    return np.cumsum(counts).astype(np.uint32)
