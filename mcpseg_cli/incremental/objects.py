"""The object inventory: what and where the objects of a labelled map are."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.incremental.map_rows import MapRows

_BOX_ANGLES = 90  # directions tried for the smallest oriented box, one degree apart


@dataclass(frozen=True)
class MapObject:
    """One object.

    Attributes:
        id: Its object id.
        class_name: Class by vote of its points; a tie goes to the first in the table. ``unknown``
            without classes.
        confidence: Mean confidence of the points that voted for that class, 0-1.
        num_points: Points (voxels) it has.
        centroid: Mean of its points, metres, map frame.
        aabb_min: Lowest corner of the axis-aligned box.
        aabb_max: Highest corner of the axis-aligned box.
        obb_centre: Centre of the oriented box: upright, of the smallest ground area.
        obb_size: Its length, width and height, length >= width.
        obb_yaw_deg: Turn of its length from the x axis about z, degrees in [0, 180).
    """

    id: int
    class_name: str
    confidence: float
    num_points: int
    centroid: tuple[float, float, float]
    aabb_min: tuple[float, float, float]
    aabb_max: tuple[float, float, float]
    obb_centre: tuple[float, float, float]
    obb_size: tuple[float, float, float]
    obb_yaw_deg: float


def objects_text(
    items: Iterable[MapObject], parts: Mapping[int, Mapping[str, list[int]]] | None = None
) -> Iterator[str]:
    """Write an inventory as JSON with an indent of 1, object by object.

    Args:
        items: The objects.
        parts: Of a merged map, by object: its ids in each part.

    Yields:
        Parts of the text.
    """
    opened = "["
    for item in items:
        facts = vars(item) if parts is None else vars(item) | {"parts": parts.get(item.id, {})}
        values = (f'  "{name}": {_value_text(value)}' for name, value in facts.items())
        yield opened + "\n {\n" + ",\n".join(values) + "\n }"
        opened = ","
    yield "\n]\n" if opened == "," else "[]\n"


def _value_text(value: object) -> str:
    """Write a number, a text or a place as ``json.dumps`` would in there."""
    if isinstance(value, tuple):
        return "[\n   " + ",\n   ".join(map(json.dumps, value)) + "\n  ]"
    return json.dumps(value, indent=1).replace("\n", "\n  ")


def list_objects(rows: MapRows, classes: tuple[str, ...]) -> list[MapObject]:
    """Take stock of the objects of a map.

    Args:
        rows: The whole map; ``instance`` as known now.
        classes: Class names that ``semantic`` indexes.

    Returns:
        Every object, by id; empty for a map without any. Voxels of object 0 are of none.
    """
    order = np.argsort(rows.instance, kind="stable")
    order = order[np.searchsorted(rows.instance[order], 1) :]
    ids, starts, counts = np.unique(rows.instance[order], return_index=True, return_counts=True)
    if len(ids) == 0:
        return []

    # voxels in the order of their objects
    xyz = rows.xyz[order].astype(np.float64)
    semantic = rows.semantic[order]
    owner = np.repeat(np.arange(len(ids)), counts)

    # class by vote, confidence of those who voted for it
    voted = _vote(semantic, owner, len(ids))
    agrees = semantic == voted[owner]
    confidence = np.bincount(owner, rows.confidence[order] * agrees) / np.bincount(owner, agrees)

    # place, upright box, oriented box
    centroid = np.add.reduceat(xyz, starts) / counts[:, None]
    low, high = np.minimum.reduceat(xyz, starts), np.maximum.reduceat(xyz, starts)
    centre, size, yaw_deg = _oriented_boxes(xyz[:, :2], starts, counts)
    height = np.stack([(low[:, 2] + high[:, 2]) / 2, high[:, 2] - low[:, 2]])

    return [
        MapObject(
            id=int(ids[i]),
            class_name=_name(classes, voted[i]),
            confidence=round(float(confidence[i]), 4),
            num_points=int(counts[i]),
            centroid=_rounded(centroid[i]),
            aabb_min=_rounded(low[i]),
            aabb_max=_rounded(high[i]),
            obb_centre=_rounded([*centre[i], height[0, i]]),
            obb_size=_rounded([*size[i], height[1, i]]),
            obb_yaw_deg=float(yaw_deg[i]),
        )
        for i in range(len(ids))
    ]


def _vote(
    semantic: NDArray[np.uint8], owner: NDArray[np.int64], num_objects: int
) -> NDArray[np.int64]:
    """Find the most frequent class of each object without a table of objects times classes."""
    pair, votes = np.unique((owner << 8) | semantic, return_counts=True)
    # the last of each object: most votes, then the lowest class
    best = np.lexsort((-pair, votes, pair >> 8))
    last = np.flatnonzero(np.diff(pair[best] >> 8, append=num_objects))
    voted: NDArray[np.int64] = pair[best][last] & 255
    return voted


def _name(classes: tuple[str, ...], index: int) -> str:
    return classes[index] if index < len(classes) else "unknown"


def _rounded(values: NDArray[np.float64] | list[float]) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 4) for value in values)
    return x, y, z


def _oriented_boxes(
    xy: NDArray[np.float64], starts: NDArray[np.int64], counts: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Fit upright boxes of the smallest area.

    Returns:
        (O, 2) centres, (O, 2) length and width, (O,) yaw in degrees.
    """
    angles = np.deg2rad(np.arange(_BOX_ANGLES))
    boxes = _smallest_rectangles(xy, starts, counts, np.cos(angles), np.sin(angles))
    step, low, high = boxes[:, 0].astype(np.int64), boxes[:, 1:3], boxes[:, 3:5]
    middle, size = (low + high) / 2, high - low

    # back from the turned frame
    cos, sin = np.cos(angles[step]), np.sin(angles[step])
    centre = np.stack(
        [middle[:, 0] * cos - middle[:, 1] * sin, middle[:, 0] * sin + middle[:, 1] * cos], axis=1
    )

    # the length is the longer side
    is_tall = size[:, 1] > size[:, 0]
    yaw_deg = step + 90.0 * is_tall
    return centre, np.where(is_tall[:, None], size[:, ::-1], size), yaw_deg


@njit(cache=True)
def _smallest_rectangles(
    xy: NDArray[np.float64],
    starts: NDArray[np.int64],
    counts: NDArray[np.int64],
    cos: NDArray[np.float64],
    sin: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Try every angle on every object.

    Returns:
        (O, 5): angle index, then low u, low v, high u, high v in the turned frame.
    """
    boxes = np.empty((starts.size, 5))
    for i in range(starts.size):
        best = np.inf
        points = xy[starts[i] : starts[i] + counts[i]]
        for a in range(cos.size):
            u = points[:, 0] * cos[a] + points[:, 1] * sin[a]
            v = points[:, 1] * cos[a] - points[:, 0] * sin[a]

            # by more than rounding: the first of equals stays
            area = (u.max() - u.min()) * (v.max() - v.min())
            if area < best - 1e-9:
                best = area
                boxes[i] = np.array([float(a), u.min(), v.min(), u.max(), v.max()])
    return boxes
