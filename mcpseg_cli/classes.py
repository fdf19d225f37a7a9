"""Class tables: which index means which class.

They travel with weights and clouds; nothing assumes an order.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

UNKNOWN = 255
"""The semantic label of a point that has no class (yet)."""

MOST_CLASSES = 254
"""Classes of a table at most; the labels above them mean no class."""

S3DIS_CLASSES = (
    "ceiling",
    "floor",
    "wall",
    "beam",
    "column",
    "window",
    "door",
    "table",
    "chair",
    "sofa",
    "bookcase",
    "board",
    "clutter",
)
"""The 13 classes in the order the S3DIS community uses."""

HOME_CLASSES = (
    *S3DIS_CLASSES,
    "bed",
    "cabinet",
    "curtain",
    "kitchen",
    "appliance",
    "sanitary",
    "screen",
    "lamp",
    "plant",
    "picture",
    "rug",
    "box",
)
"""The 13 classes and what homes are full of: kitchen units, household appliances, toilets, basins
and baths, screens of computers and televisions, boxes and bags; clutter is the rest.
"""

MCPNET_CLASSES = (
    "clutter",
    "board",
    "bookcase",
    "beam",
    "chair",
    "column",
    "door",
    "sofa",
    "table",
    "window",
    "ceiling",
    "floor",
    "wall",
)
"""The same 13 classes in the order of the MCPNet authors' program and weights."""


def table_problem(classes: Sequence[str]) -> str | None:
    """Say what keeps a class table out of labels of a byte, or out of the headers of clouds.

    Commas part the names there.

    Args:
        classes: Class names.

    Returns:
        What is there that must not be, in some words; None where the table can be used.
    """
    if len(classes) > MOST_CLASSES:
        return f"{len(classes)} classes"
    bad = next((name for name in classes if "," in name or not name.isprintable()), None)
    return None if bad is None else f"a class named {bad!a}"


TABLE_EXPECTED = f"up to {MOST_CLASSES} names without commas, line breaks and control characters"
"""What ``table_problem`` asks of a table, for messages."""


def remap_table(source: Sequence[str], target: Sequence[str]) -> NDArray[np.uint8]:
    """Build the look-up table from class indices of one table to those of another, by name.

    Args:
        source: Class names the labels are in now.
        target: Class names they should be in.

    Returns:
        (256,) uint8; ``table[semantic]`` is the label in ``target``, ``UNKNOWN`` for classes
        ``target`` does not have.
    """
    table = np.full(256, UNKNOWN, np.uint8)
    for index, name in enumerate(source):
        if name in target:
            table[index] = target.index(name)
    return table
