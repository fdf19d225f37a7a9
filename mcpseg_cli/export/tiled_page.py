"""A page in a folder that loads the tiles it shows, for maps too large for one file.

``index.html`` is the page, ``map.bin`` what it knows of the whole map, ``tiles/`` the points.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import ColourBy
from mcpseg_cli.errors import OutputError
from mcpseg_cli.export.colours import class_palette, confidence_colours
from mcpseg_cli.export.html import map_bytes, tiled_page_text
from mcpseg_cli.export.octree import CELLS
from mcpseg_cli.export.page_map import Columns, PageMap, legend, object_columns, pack
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.export.spooled_map import SpooledMap
from mcpseg_cli.export.tiled_map import TileWriter
from mcpseg_cli.resumable import exclusive
from mcpseg_cli.segment.labelled_run import LabelledRun

PAGE, MAP, TILES = "index.html", "map.bin", "tiles"
_SCRATCH = ".page.part"
_LOCK = ".mcpseg.lock"
_TILE = re.compile(rf"{TILES}/\d{{1,2}}/\d{{1,7}}_\d{{1,7}}_\d{{1,7}}\.bin", re.ASCII)
_COLOURS: tuple[ColourBy, ...] = ("rgb", "class", "instance", "confidence")
_MOST_POSES = 20_000  # of the path; of more, every so many


def write_tiled_page(
    run: LabelledRun,
    folder: Path,
    selection: Selection,
    colour_by: ColourBy = "class",
    told: Callable[[int, int], None] = lambda *_: None,
) -> tuple[int, int]:
    """Write the chosen voxels as a page in a folder and the tiles that it loads.

    No more than a column of tiles is ever held, and what is known of objects; the disk has some
    40 bytes a voxel for a while. The page of before is there until the new one is complete.

    Args:
        run: The map.
        folder: Made if not there; has nothing but such a page.
        selection: Which voxels.
        colour_by: What colours say when the page opens.
        told: Called again and again: how many points are done, of how many.

    Returns:
        How many points and tiles there are.

    Raises:
        InputError: Nothing is chosen.
        OutputError: Something else is in the folder, or the page has no such colours.
        StateError: Another process writes there, or the checkpoint is damaged.
        OSError: The disk is full or the folder not writable.
    """
    if colour_by not in _COLOURS:
        raise OutputError(
            f"{folder}: --color {colour_by}; expected {', '.join(_COLOURS)} on a page in tiles; "
            "choose one of them"
        )
    with exclusive(folder):
        _check_foreign(folder)
        scratch = folder / _SCRATCH
        shutil.rmtree(scratch, ignore_errors=True)
        (scratch / TILES).mkdir(parents=True)
        (scratch / "points").mkdir()
        try:
            page_map, num_tiles = _write_map(run, scratch, selection, colour_by, told)
            (scratch / MAP).write_bytes(map_bytes(page_map, None))
            name = run.folder.resolve().name
            (scratch / PAGE).write_text(tiled_page_text(name), encoding="utf-8")
            _put_in_place(scratch, folder)
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
    return page_map.num_points, num_tiles


def is_tiled_page(folder: Path) -> bool:
    """Tell whether a folder has a page that ``write_tiled_page`` wrote."""
    return (folder / PAGE).is_file() and (folder / MAP).is_file()


def _check_foreign(folder: Path) -> None:
    """Refuse a folder that has anything but a page of before."""
    names = {path.name for path in folder.iterdir()} - {_LOCK, _SCRATCH}
    foreign = sorted(names - {PAGE, MAP, TILES})
    if PAGE in names and MAP not in names:
        foreign.append(PAGE)
    if foreign:
        raise OutputError(
            f"{folder}: has {foreign[0]}; expected an empty folder, or a page of before to be "
            "replaced; choose another -o"
        )


def _put_in_place(scratch: Path, folder: Path) -> None:
    """Take the page of before away, then put the new one there, its first file last."""
    (folder / PAGE).unlink(missing_ok=True)
    if (folder / TILES).exists():
        (folder / TILES).rename(scratch / "before")
    for name in (TILES, MAP, PAGE):
        (scratch / name).replace(folder / name)


def _write_map(
    run: LabelledRun,
    scratch: Path,
    selection: Selection,
    colour_by: ColourBy,
    told: Callable[[int, int], None],
) -> tuple[PageMap, int]:
    """Write the tiles; return what the page knows of them, and how many have a point."""
    spooled = SpooledMap(scratch / "points", run.voxel_size)
    for part in selection.parts(run):
        spooled.add(part)
    writer = TileWriter(run, spooled, scratch / TILES, scratch / "points")
    writer.write(told)
    return _describe(run, spooled, writer, colour_by), sum(map(bool, writer.tiles.values()))


def _describe(
    run: LabelledRun, spooled: SpooledMap, writer: TileWriter, colour_by: ColourBy
) -> PageMap:
    """Put together what the page knows but for the points."""
    origin = (spooled.lowest.astype(np.float64) + spooled.highest) / 2
    objects, grid = writer.objects.listed(), writer.grid
    known = object_columns(writer.objects.ids, objects, run.classes, origin)
    cloud, table = pack({**known, **_columns(run, writer, origin)})
    facts: dict[str, object] = {
        "num_points": len(spooled),
        "num_scans": len(run.scans),
        "num_objects": len(objects),
        "origin": origin.tolist(),
        "low": (spooled.lowest - origin).tolist(),
        "voxel_size": run.voxel_size,
        "cut": writer.ceilings.cut(),
        "highest": writer.most_height,
        "classes": legend(spooled.num_points, np.empty(0, np.uint8), run.classes),
        "colours": _COLOURS,
        "colour": colour_by,
        "columns": table,
        "tiles": {
            "corner": (grid.corner - origin).tolist(),
            "depth": grid.depth,
            "cells": CELLS,
            "steps": [grid.step(level) for level in range(grid.depth + 1)],
            "lowest_floor": writer.lowest_floor - float(origin[2]),
            "floor_step": writer.floor_step,
        },
    }
    return PageMap(facts, cloud, len(spooled))


def _columns(run: LabelledRun, writer: TileWriter, origin: NDArray[np.float64]) -> Columns:
    """Give the columns of tiles, colours and the path."""
    tiles = sorted(writer.tiles)
    place = np.array(tiles, np.uint32)
    every = -(-len(run.scans) // _MOST_POSES)
    return {
        "object_floors": (writer.objects.floors - origin[2]).astype(np.float32),
        "class_colours": class_palette(run.classes),
        "confidence_colours": confidence_colours(np.linspace(0.0, 1.0, 256)),
        "path": (run.poses[::every, :3, 3] - origin).astype(np.float32),
        "tile_levels": place[:, 0].astype(np.uint8),
        "tile_places": place[:, 1:],
        "tile_points": np.array([writer.tiles[tile] for tile in tiles], np.uint32),
    }


class PageFolder:
    """Such a page as a server gives it out: its own files, and nothing else.

    Args:
        folder: Where it is.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def answer(self, path: str) -> tuple[str, bytes]:
        """Return the kind and the bytes of what is at the path of a URL.

        Raises:
            LookupError: There is no such file.
        """
        name = path.removeprefix("/") or PAGE
        if name not in (PAGE, MAP) and not _TILE.fullmatch(name):
            raise LookupError(path)
        try:
            content = (self._folder / name).read_bytes()
        except OSError as error:
            raise LookupError(path) from error
        return "text/html" if name == PAGE else "application/octet-stream", content
