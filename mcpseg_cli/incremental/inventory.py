"""The objects of a map that is never in memory as a whole: some objects at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.incremental.map_rows import COLUMNS, MapRows
from mcpseg_cli.incremental.objects import MapObject, list_objects

_NO_EMBEDDING = np.empty((0, 0), np.int16)
_MOST = 1 << 20  # voxels whose objects are listed together, or one object that has more


def list_by_batches(
    pieces: Callable[[int, int], Iterable[MapRows]],
    sizes: NDArray[np.int64],
    classes: tuple[str, ...],
) -> list[MapObject]:
    """Take stock of objects as ``list_objects`` does.

    Args:
        pieces: Gives pieces of the map in id order, for the first and last of a range of objects:
            all pieces with voxels of these, and any others.
        sizes: (O,) int64 voxels of every object by id, 0 of none first.
        classes: Class names.
    """
    found = []
    for first, last in _batches(sizes):
        chosen = []
        for rows in pieces(first, last):
            is_of = (rows.instance >= first) & (rows.instance <= last)
            if is_of.any():
                chosen.append(
                    MapRows(
                        rows.xyz[is_of], rows.rgb[is_of], rows.semantic[is_of],
                        rows.confidence[is_of], rows.instance[is_of], _NO_EMBEDDING,
                    )
                )  # fmt: skip
        if chosen:
            columns = [[getattr(each, name) for each in chosen] for name in COLUMNS]
            found += list_objects(MapRows(*map(np.concatenate, columns)), classes)
    return found


def _batches(sizes: NDArray[np.int64]) -> Iterator[tuple[int, int]]:
    """Give first and last object of batches that have not too many voxels together."""
    first, voxels = 1, 0
    for owner, size in enumerate(sizes.tolist()):
        if owner > first and voxels + size > _MOST:
            yield first, owner - 1
            first, voxels = owner, 0
        voxels += size if owner else 0
    if len(sizes) > first:
        yield first, len(sizes) - 1
