"""Cutting a mesh into few tight boxes, so that a chair's seat fits under a table's top."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.synth.geometry.solids import Triangles, area_of

_MOST = 16  # boxes of one model
_GAIN = 0.08  # of the volume of the whole that a cut has to save
_PLACES = 12  # where cuts are tried along each axis
_LOOKED_AT = 2000  # triangles that cuts are chosen by: the largest, and as many of the others


def cut(triangles: Triangles) -> NDArray[np.int64]:
    """Sort triangles into boxes that together are as small as a few cuts can make them.

    The box with most to gain is cut in two by the plane that saves most of its volume, until a cut
    would save little of the whole. A triangle goes where its middle lies.

    Args:
        triangles: (F, 3, 3) metres.

    Returns:
        (F,) number of the box of each triangle.
    """
    all_low, all_high = triangles.min(axis=1), triangles.max(axis=1)
    chosen = _some(triangles)
    low, high = all_low[chosen], all_high[chosen]
    whole = _volume(low, high)
    number, looked_at = np.zeros(len(triangles), np.int64), np.zeros(len(chosen), np.int64)
    best = {0: _best_cut(low, high)}
    for new in range(1, _MOST):
        old = max(best, key=lambda box: best[box][0])
        gain, axis, place = best[old]
        if gain < _GAIN * whole:
            break

        number[(number == old) & ((all_low + all_high)[:, axis] / 2 > place)] = new
        looked_at[(looked_at == old) & ((low + high)[:, axis] / 2 > place)] = new
        for box in (old, new):
            inside = looked_at == box
            best[box] = _best_cut(low[inside], high[inside])
    return number


def _some(triangles: Triangles) -> NDArray[np.int64]:
    """Return which triangles of a large mesh cuts are chosen by."""
    by_area = np.argsort(-area_of(triangles), kind="stable")
    rest = by_area[_LOOKED_AT:]
    return np.concatenate([by_area[:_LOOKED_AT], rest[:: max(1, len(rest) // _LOOKED_AT)]])


def _best_cut(low: NDArray[np.float64], high: NDArray[np.float64]) -> tuple[float, int, float]:
    """Return what the best cut of a box saves, cubic metres, its axis and where it lies."""
    middle, best = (low + high) / 2, (0.0, 0, 0.0)
    whole = _volume(low, high)
    for axis in range(3):
        ends = middle[:, axis].min(), middle[:, axis].max()
        for place in np.linspace(*ends, _PLACES + 2)[1:-1].tolist():
            above = middle[:, axis] > place
            if above.any() and not above.all():
                rest = _volume(low[above], high[above]) + _volume(low[~above], high[~above])
                best = max(best, (whole - rest, axis, place))
    return best


def _volume(low: NDArray[np.float64], high: NDArray[np.float64]) -> float:
    """Return the volume of the box around boxes, none of its edges taken for less than 2 cm."""
    return float(np.prod(np.maximum(high.max(axis=0) - low.min(axis=0), 0.02)))
