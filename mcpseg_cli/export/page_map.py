"""A labelled map as the page takes it: facts as JSON, and columns as compact arrays."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import ColourBy
from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.export.colours import (
    COLOUR_BY,
    class_palette,
    colouring,
    confidence_colours,
    instance_colours,
)
from mcpseg_cli.export.floors import below_ceiling, floor_heights
from mcpseg_cli.export.label_history import LabelHistory
from mcpseg_cli.export.normals import surface_normals
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.incremental.objects import MapObject, list_objects
from mcpseg_cli.segment.labelled_run import LabelledRun, MapPart

Columns = dict[str, NDArray[np.generic]]
Legend = list[dict[str, str | int]]

_STEPS = 65_535  # positions are kept as 16-bit steps of the longest side: 1.5 mm for 100 m
_TYPES = {
    "u1": np.uint8, "i1": np.int8, "u2": np.uint16, "u4": np.uint32, "i4": np.int32,
    "f4": np.float32,
}  # fmt: skip


@dataclass(frozen=True)
class PageMap:
    """What a page holds.

    Attributes:
        facts: What fits into JSON.
        cloud: The columns one after another, each at a multiple of four bytes; ``facts`` lists
            where they are.
        num_points: Points in it.
    """

    facts: dict[str, object]
    cloud: bytes
    num_points: int

    @property
    def packed(self) -> bytes:
        """The cloud, compressed."""
        return zlib.compress(self.cloud, 6)


@dataclass(frozen=True)
class _Points:
    """What the page shows, in the order it was first seen in; columns as those of ``MapPart``."""

    ids: NDArray[np.int64]
    xyz: NDArray[np.float32]
    rgb: NDArray[np.uint8]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]
    confidence: NDArray[np.float32]
    scan: NDArray[np.int32]
    embedding_rgb: NDArray[np.uint8]


def gather_map(run: LabelledRun, selection: Selection, colour_by: ColourBy) -> PageMap:
    """Take from a run all that its page shows.

    Args:
        run: The map.
        selection: Which voxels.
        colour_by: What colours say when the page opens.

    Raises:
        InputError: Nothing is chosen.
        StateError: The checkpoint is damaged.
    """
    points = _gather(selection.parts(run), colouring(run, "embedding"))
    floors = floor_heights(run)
    eyes = run.poses[:, :3, 3]

    # positions as steps from a corner, around an origin in the middle
    origin = (points.xyz.min(axis=0).astype(np.float64) + points.xyz.max(axis=0)) / 2
    local = points.xyz - origin
    step = max(float(np.ptp(local, axis=0).max()), 1e-3) / _STEPS
    normal = surface_normals(points.xyz, eyes[points.scan], run.voxel_size)

    # objects of all times by number, and those of now as a list
    history = LabelHistory.of(run, points.ids)
    objects = _objects(points, run.classes)
    columns = {
        **_point_columns(points, local, step, normal),
        **object_columns(history.object_ids, objects, run.classes, origin),
        **history.columns(points.instance),
        "class_colours": class_palette(run.classes),
        "confidence_colours": confidence_colours(np.linspace(0.0, 1.0, 256)),
        "scan_ends": np.cumsum(np.bincount(points.scan, minlength=len(eyes))).astype(np.uint32),
        "path": (eyes - origin).astype(np.float32),
        "floors": (floors - origin[2]).astype(np.float32),
    }
    cloud, table = pack(columns)
    facts: dict[str, object] = {
        "num_points": len(local),
        "num_scans": len(eyes),
        "num_objects": len(objects),
        "origin": origin.tolist(),
        "low": local.min(axis=0).tolist(),
        "step": step,
        "voxel_size": run.voxel_size,
        "cut": below_ceiling(points.xyz[:, 2] - floors[points.scan], normal),
        "classes": legend(
            np.bincount(points.semantic, minlength=256), history.classes, run.classes
        ),
        "colours": COLOUR_BY,
        "colour": colour_by,
        "columns": table,
    }
    return PageMap(facts, cloud, len(local))


def _gather(parts: Iterable[MapPart], colour: Callable[[MapPart], NDArray[np.uint8]]) -> _Points:
    """Join the parts without their embeddings, of which only the colours are shown."""
    rows = [
        (
            part.ids, part.xyz, part.rgb, part.semantic, part.instance, part.confidence, part.scan,
            colour(part),
        )
        for part in parts
    ]  # fmt: skip
    return _Points(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def _objects(points: _Points, classes: tuple[str, ...]) -> list[MapObject]:
    """Take stock of the objects of what is shown."""
    rows = MapRows(
        points.xyz, points.rgb, points.semantic, points.confidence, points.instance,
        np.empty((len(points.xyz), 0), np.int16),
    )  # fmt: skip
    return list_objects(rows, classes)


def _point_columns(
    points: _Points, local: NDArray[np.float64], step: float, normal: NDArray[np.float32]
) -> Columns:
    """Give the columns of the points; positions axis by axis, which packs better."""
    return {
        "xyz": np.rint((local - local.min(axis=0)) / step).astype(np.uint16).T,
        "normal": np.rint(127 * normal).astype(np.int8).T,
        "rgb": points.rgb,
        "embedding": points.embedding_rgb,
        "semantic": points.semantic,
        "confidence": np.rint(255 * points.confidence).astype(np.uint8),
    }


def object_columns(
    ids: NDArray[np.int32],
    objects: list[MapObject],
    classes: tuple[str, ...],
    origin: NDArray[np.float64],
) -> Columns:
    """Give a row for every object there ever was; size 0 for those that are none any more.

    Args:
        ids: (K,) int32 all of them, ascending.
        objects: Those of now.
        classes: Names by class.
        origin: (3,) the place that is 0 on the page, metres, map frame.
    """
    place = np.searchsorted(ids, [item.id for item in objects])
    number = {name: index for index, name in reversed(list(enumerate(classes)))}
    box = np.zeros((len(ids), 7), np.float32)
    size, confidence = np.zeros(len(ids), np.uint32), np.zeros(len(ids), np.uint8)
    semantic = np.full(len(ids), UNKNOWN, np.uint8)

    for row, item in zip(place.tolist(), objects, strict=True):
        size[row] = item.num_points
        semantic[row] = number.get(item.class_name, UNKNOWN)
        confidence[row] = round(255 * item.confidence)
        centre = np.array(item.obb_centre) - origin
        box[row] = (*centre, *item.obb_size, np.deg2rad(item.obb_yaw_deg))
    return {
        "object_ids": ids,
        "object_sizes": size,
        "object_classes": semantic,
        "object_confidences": confidence,
        "object_boxes": box,
        "object_colours": instance_colours(ids),
    }


def pack(columns: Columns) -> tuple[bytes, list[dict[str, str | int]]]:
    """Put arrays one after another, each at a multiple of four bytes, and list where they are."""
    names = {np.dtype(dtype): name for name, dtype in _TYPES.items()}
    blob, table = bytearray(), []
    for name, column in columns.items():
        entry: dict[str, str | int] = {"name": name, "type": names[column.dtype]}
        table.append(entry | {"offset": len(blob), "length": column.size})
        blob += np.ascontiguousarray(column).astype(column.dtype.newbyteorder("<")).tobytes()
        blob += bytes(-len(blob) % 4)
    return bytes(blob), table


def legend(
    num_points: NDArray[np.integer], past: NDArray[np.uint8], classes: tuple[str, ...]
) -> Legend:
    """List the classes that occur now, and after them those that only occurred once.

    Args:
        num_points: (256,) points of each class now.
        past: (P,) uint8 classes that points ever had, ascending.
        classes: Names by class.
    """
    counts = num_points.tolist()
    names = {**dict(enumerate(classes)), UNKNOWN: "unknown"}
    present = [index for index in range(256) if counts[index]]
    present += [index for index in past.tolist() if not counts[index]]
    return [
        {
            "semantic": index,
            "name": names.get(index, f"class {index}"),
            "num_points": counts[index],
        }
        for index in present
    ]
