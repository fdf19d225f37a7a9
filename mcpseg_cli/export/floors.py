"""Heights above the floor, and where to cut a map so that its ceilings do not hide it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.export.normals import surface_normals
from mcpseg_cli.segment.labelled_run import LabelledRun

_LEAST_CUT = 1.6  # metres above the floor: what is lower is no ceiling
_BIN = 0.1  # metres, of the histogram that ceilings are found in
_LEAST_SHARE = 0.01  # of all points must look down from above for there to be a ceiling
_LAYER_SHARE = 0.15  # of the fullest layer makes another layer one of a ceiling
_FACING_DOWN = -0.8  # z of a normal
_KEPT = 0.75  # of a room's height: lamps and beams go with the ceiling, furniture stays


def floor_heights(run: LabelledRun) -> NDArray[np.float64]:
    """Return (S,) the floor's height at each scan, metres, map frame.

    Where it was not known, it is that of the scan before that knew it, else of the first that did;
    0 where no scan knew it.
    """
    heights = np.array([np.nan if record.floor is None else record.floor for record in run.scans])
    known = np.flatnonzero(np.isfinite(heights))
    if len(known) == 0:
        return np.zeros(len(heights))
    nearest = np.searchsorted(known, np.arange(len(heights)), side="right") - 1
    filled: NDArray[np.float64] = heights[known[np.maximum(nearest, 0)]]
    return filled


def below_ceiling(height: NDArray[np.floating], normal: NDArray[np.floating]) -> float | None:
    """Choose the height that cuts the lowest ceiling off, with what hangs from it.

    Args:
        height: (N,) of points above their floor, metres.
        normal: (N, 3) unit normals, towards where the points were seen from.

    Returns:
        Metres above the floor; None where hardly anything looks down from above.
    """
    ceilings = Ceilings()
    ceilings.add(height, normal)
    return ceilings.cut()


class Ceilings:
    """Counts what hangs over the floor, of a map that comes in parts."""

    def __init__(self) -> None:
        self._counts = np.zeros(0, np.int64)  # what looks down, by height
        self._total = 0

    def add(self, height: NDArray[np.floating], normal: NDArray[np.floating]) -> None:
        """Count points, see ``below_ceiling``."""
        hanging = height[(normal[:, 2] < _FACING_DOWN) & (height > _LEAST_CUT)]
        number = np.floor((hanging - _LEAST_CUT) / _BIN).astype(np.int64)
        counts = np.bincount(number, minlength=len(self._counts))
        counts[: len(self._counts)] += self._counts
        self._counts = counts
        self._total += len(height)

    def cut(self) -> float | None:
        """Choose the height, see ``below_ceiling``."""
        counts = self._counts
        if counts.sum() <= _LEAST_SHARE * self._total:
            return None

        # a layer may be halved by the border of two bins
        layers = counts + np.append(counts[1:], 0)
        lowest = int(np.argmax(layers >= _LAYER_SHARE * layers.max()))
        ceiling = _LEAST_CUT + (lowest - 0.5) * _BIN
        return round(max(_KEPT * ceiling, _LEAST_CUT), 2)


def are_below_ceiling(
    run: LabelledRun, xyz: NDArray[np.float32], scan: NDArray[np.int32]
) -> NDArray[np.bool_]:
    """Mark the voxels that stay where the lowest ceiling is cut off; all where there is none.

    Args:
        run: The map.
        xyz: (N, 3) float32 voxels of it, metres, map frame.
        scan: (N,) int32 the scans that first saw them.
    """
    height = xyz[:, 2] - floor_heights(run)[scan]
    normal = surface_normals(xyz, run.poses[scan, :3, 3], run.voxel_size)
    cut = below_ceiling(height, normal)
    return np.ones(len(xyz), bool) if cut is None else height <= cut
