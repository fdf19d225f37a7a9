"""The labels of a run as they were after one scan or another, from its checkpoint."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.incremental.regrouping import History
from mcpseg_cli.scan import Labels
from mcpseg_cli.segment.checkpoint import State


class PastLabels:
    """Labels of a moment; later moments cost what changed since, earlier ones all from the start.

    Args:
        state: The checkpoint, open as long as this is used.
        classes: Class names that labels index.
    """

    def __init__(self, state: State, classes: tuple[str, ...]) -> None:
        self._state, self._classes = state, classes
        self._next = 0
        self._start()

    def after(self, scan: int, point_ids: NDArray[np.int32]) -> Labels:
        """Look up the labels of points as known after a scan.

        Args:
            scan: Number of the scan.
            point_ids: (N,) int32 voxel ids of that moment, -1 for points without one (they get 255,
                0 and 0).

        Raises:
            StateError: The checkpoint is damaged.
        """
        if scan < self._next - 1:
            self._start()
        for changes in self._state.label_changes(self._next, scan):
            changes.apply(self._semantic, self._confidence)
        for moves in self._state.moves(self._next, scan):
            self._instance[moves.ids] = moves.instance
        self._next = scan + 1

        # objects have merged; id -1 finds what stands for no voxel at the end of each
        instance, _ = History(self._state.merges(scan)).apply(self._instance)
        return Labels(
            self._semantic[point_ids],
            instance[point_ids],
            self._confidence[point_ids],
            self._classes,
        )

    def _start(self) -> None:
        """Go to before the first scan: every voxel as it was first seen."""
        semantic, confidence = self._state.first_labels()
        self._semantic = np.append(semantic, np.uint8(UNKNOWN))
        self._confidence = np.append(confidence, np.float32(0))
        self._instance = np.append(self._state.first_instance(), np.int32(0))
        self._next = 0
