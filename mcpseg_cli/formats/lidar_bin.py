"""Raw lidar sweeps: KITTI's ``.bin`` (x y z intensity) and nuScenes' ``.pcd.bin`` (and a ring)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.cloud import Cloud

_FARTHEST = 1000.0  # metres a lidar sees; other numbers than coordinates are beyond it
_MOST_RINGS = 256


def read_bin(path: Path) -> Cloud:
    """Read float32 x y z intensity, and ring where every point has one.

    Args:
        path: The file; has no header, so what it holds is told by its size and values.

    Raises:
        InputError: Its numbers are not those of a lidar sweep.
        OSError: It cannot be opened.
    """
    numbers = np.fromfile(path, "<f4")
    is_whole = path.stat().st_size % 4 == 0
    for width in (5, 4) if path.stem.endswith(".pcd") else (4, 5):
        if is_whole and len(numbers) % width == 0 and _is_sweep(numbers.reshape(-1, width)):
            names = ("x", "y", "z", "intensity", "ring")[:width]
            rows = numbers.reshape(-1, width)
            return Cloud({name: rows[:, place].copy() for place, name in enumerate(names)})

    found = f"{path.stat().st_size:,} bytes that are no x y z intensity (and ring)"
    raise InputError(path, found, "a sweep of KITTI or nuScenes, float32", "convert it to PLY")


def _is_sweep(rows: NDArray[np.float32]) -> bool:
    """Tell whether rows of four or five numbers are what they should be."""
    with np.errstate(invalid="ignore"):
        if not (np.abs(rows[:, :3]) < _FARTHEST).all() or not (rows[:, 3] >= 0).all():
            return False
        ring = rows[:, 4] if rows.shape[1] == 5 else np.zeros(1, np.float32)
        return bool(((ring == np.rint(ring)) & (ring >= 0) & (ring < _MOST_RINGS)).all())
