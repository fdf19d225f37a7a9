"""The object inventory as JSON, CSV and GeoJSON footprints, and a cloud for each object."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import ColourBy
from mcpseg_cli.export.colours import colouring
from mcpseg_cli.export.map_cloud import as_cloud, in_recording, label_prefix_for
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.formats import write_parts
from mcpseg_cli.formats.parts import OnePart
from mcpseg_cli.incremental.objects import MapObject, objects_text
from mcpseg_cli.resumable import guarded_cell, write_whole
from mcpseg_cli.segment.labelled_run import LabelledRun, joined

_PLACES = ("centroid", "aabb_min", "aabb_max", "obb_centre")
_AXES = {
    "centroid": ("x", "y", "z"), "aabb_min": ("x", "y", "z"), "aabb_max": ("x", "y", "z"),
    "obb_centre": ("x", "y", "z"), "obb_size": ("length", "width", "height"),
}  # fmt: skip


def write_objects(run: LabelledRun, path: Path, selection: Selection) -> int:
    """Write the inventory of the chosen objects.

    Args:
        run: The map.
        path: A .json file (as objects.json of a run), .csv (a row an object) or .geojson (a
            footprint an object: its oriented box from above, coordinates in metres of the map
            frame, where the run's offset is added again); replaced if there.
        selection: Which objects: by their class, id, confidence and centroid.

    Returns:
        How many objects there are.

    Raises:
        InputError: Nothing is chosen.
        OSError: The disk is full or the folder not writable.
    """
    items = [_moved(item, run.intake.offset_metres) for item in _chosen(run, selection)]
    suffix = path.suffix.lower()
    if suffix == ".csv":
        text = _as_csv(items)
    elif suffix == ".geojson":
        text = _as_geojson(items, float(str(run.settings["voxel_size"])))
    else:
        text = "".join(objects_text(items))
    write_whole(path, text)
    return len(items)


def write_object_clouds(
    run: LabelledRun, folder: Path, suffix: str, selection: Selection, colour_by: ColourBy = "rgb"
) -> int:
    """Write a cloud for each chosen object, ``000017_chair.ply``; holds the voxels of all of them.

    Args:
        run: The map.
        folder: Where; made if not there.
        suffix: Ending of the clouds, ``.ply`` or another that ``map_cloud.write_map`` knows.
        selection: Which objects, as for ``write_objects``; the clouds have all their voxels.
        colour_by: What the colours say.

    Returns:
        How many objects there are.

    Raises:
        InputError: Nothing is chosen.
        OSError: The disk is full or the folder not writable.
    """
    items = _chosen(run, selection)

    # all voxels of these objects, object after object
    of_them = Selection(instances=tuple(item.id for item in items))
    colour = colouring(run, colour_by)
    voxels = joined(part.select(of_them.mask(part, run.classes)) for part in run.parts())
    order = np.argsort(voxels.instance, kind="stable")
    ends = np.cumsum([item.num_points for item in items])

    folder.mkdir(exist_ok=True)
    for item, rows in zip(items, np.split(order, ends[:-1]), strict=True):
        path = folder / f"{item.id:06d}_{item.class_name.replace('/', '_')}{suffix}"
        cloud = as_cloud(voxels.select(rows), colour, run.classes, label_prefix_for(path))
        cloud = in_recording(cloud, run.intake)
        write_parts(path, OnePart(cloud))
    return len(items)


def _chosen(run: LabelledRun, selection: Selection) -> list[MapObject]:
    """List the chosen objects by id."""
    selection.check(run)
    items = [item for item in run.objects() if selection.has_object(item)]
    if not items:
        raise selection.nothing_chosen(run)
    return items


def _moved(item: MapObject, offset: NDArray[np.float64]) -> MapObject:
    """Return an object moved by an offset, metres."""
    if not offset.any():
        return item
    places = {name: getattr(item, name) for name in _PLACES}
    moved = {
        name: tuple(round(value, 4) for value in (np.array(place) + offset).tolist())
        for name, place in places.items()
    }
    return replace(item, **moved)  # type: ignore[arg-type]


def _as_csv(items: list[MapObject]) -> str:
    """Give a row for each object; corners and sizes become a column for each axis."""
    rows = [_as_row(item) for item in items]
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _as_row(item: MapObject) -> dict[str, object]:
    """Give an object's values by column."""
    row: dict[str, object] = {}
    for name, value in asdict(item).items():
        if name in _AXES:
            named = zip(_AXES[name], value, strict=True)
            row |= {f"{name}_{axis}": number for axis, number in named}
        else:
            row[name] = guarded_cell(value) if isinstance(value, str) else value
    return row


def _as_geojson(items: list[MapObject], least: float) -> str:
    """Give the footprint of each object, at least a voxel wide, with all else as its properties."""
    features = [
        {
            "type": "Feature",
            "id": item.id,
            "geometry": {"type": "Polygon", "coordinates": [_footprint(item, least)]},
            "properties": asdict(item),
        }
        for item in items
    ]
    lines = ",\n".join(json.dumps(feature) for feature in features)
    return f'{{"type": "FeatureCollection", "features": [\n{lines}\n]}}\n'


def _footprint(item: MapObject, least: float) -> list[list[float]]:
    """Return the closed ring around an object's oriented box, counter-clockwise."""
    length, width = np.maximum(item.obb_size[:2], least)
    yaw = np.deg2rad(item.obb_yaw_deg)
    along = np.array([np.cos(yaw), np.sin(yaw)]) * length / 2
    across = np.array([-np.sin(yaw), np.cos(yaw)]) * width / 2
    corners = [-along - across, along - across, along + across, -along + across, -along - across]
    return [
        [round(float(value), 4) for value in corner + item.obb_centre[:2]] for corner in corners
    ]
