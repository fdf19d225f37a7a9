"""Class tables: which index means which class. They travel with weights and clouds; nothing assumes an order."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

UNKNOWN = 255
"""The semantic label of a point that has no class (yet)."""

S3DIS_CLASSES = (
    "ceiling", "floor", "wall", "beam", "column", "window", "door", "table", "chair", "sofa", "bookcase", "board", "clutter",
)  # fmt: skip
"""The 13 classes in the order the S3DIS community uses."""

MCPNET_CLASSES = (
    "clutter", "board", "bookcase", "beam", "chair", "column", "door", "sofa", "table", "window", "ceiling", "floor", "wall",
)  # fmt: skip
"""The same 13 classes in the order of the MCPNet authors' program and weights."""


def remap_table(source: Sequence[str], target: Sequence[str]) -> NDArray[np.uint8]:
    """Build the look-up table from class indices of one table to those of another, by name.

    Args:
        source: Class names the labels are in now.
        target: Class names they should be in.

    Returns:
        (256,) uint8; ``table[semantic]`` is the label in ``target``, ``UNKNOWN`` for classes ``target`` does not have.
    """
    table = np.full(256, UNKNOWN, np.uint8)
    for index, name in enumerate(source):
        if name in target:
            table[index] = target.index(name)
    return table
