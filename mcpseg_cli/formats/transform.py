"""A rigid motion in a text file: 4 x 4 numbers, as CloudCompare and Open3D write them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError

_TOLERANCE = 1e-3  # of the rotation's columns


def read_transform(path: Path) -> NDArray[np.float64]:
    """Read a rigid motion.

    Args:
        path: Text: four rows of four numbers, the last 0 0 0 1; metres.

    Returns:
        (4, 4) float64.

    Raises:
        InputError: It is none.
        OSError: The file cannot be opened.
    """
    expected, remedy = "4 rows of 4 numbers, a rotation and metres", "write it again"
    try:
        words = path.read_text(encoding="utf-8").replace(",", " ").split()
        matrix = np.array([float(word) for word in words])
    except ValueError as error:
        raise InputError(path, "no numbers", expected, remedy) from error
    if matrix.size != 16 or not np.isfinite(matrix).all():
        raise InputError(path, f"{matrix.size} numbers", expected, remedy)

    # a rotation and a way, nothing else
    matrix = matrix.reshape(4, 4)
    rotation = matrix[:3, :3]
    with np.errstate(over="ignore", invalid="ignore"):  # numbers too large are no rotation
        is_rigid = np.abs(rotation.T @ rotation - np.eye(3)).max() < _TOLERANCE
        is_rigid &= bool(np.linalg.det(rotation) > 0)
    if not is_rigid or not np.array_equal(matrix[3], (0, 0, 0, 1)):
        found = "a matrix that scales, mirrors or is no motion"
        raise InputError(path, found, "a rotation and metres, last row 0 0 0 1", remedy)
    return matrix
