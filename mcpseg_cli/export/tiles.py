"""A labelled map as square tiles, each a cloud, for maps that no program opens as a whole."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import ColourBy
from mcpseg_cli.errors import naming
from mcpseg_cli.export.colours import colouring
from mcpseg_cli.export.map_cloud import as_cloud, label_prefix_for
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.formats import Cloud, write_parts
from mcpseg_cli.resumable import write_whole
from mcpseg_cli.segment.labelled_run import LabelledRun, MapPart

INDEX = "tiles.json"
_Place = tuple[int, int]


@dataclass
class Tile:
    """A tile as the index lists it.

    Attributes:
        file: Its name.
        points: How many it has.
        low: Lowest corner of its points, metres.
        high: Highest corner of its points, metres.
    """

    file: str
    points: int
    low: list[float]
    high: list[float]


def write_tiles(
    run: LabelledRun,
    folder: Path,
    suffix: str,
    edge: float,
    selection: Selection,
    colour_by: ColourBy = "rgb",
) -> int:
    """Write the chosen voxels by tiles, ``3_-1.laz`` and so on, and an index of them, tiles.json.

    A point is in exactly one tile: x and y from its number times ``edge`` up to the next. Nothing
    but a part of the map is ever held; the disk has it twice for a while.

    Args:
        run: The map.
        folder: Where; made if not there.
        suffix: Ending of the clouds.
        edge: Of a tile, metres.
        selection: Which voxels.
        colour_by: What the colours say.

    Returns:
        How many tiles there are.

    Raises:
        InputError: Nothing is chosen.
        OSError: The disk is full or the folder not writable.
    """
    selection.check(run)
    colour = colouring(run, colour_by)
    folder.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".tiles-") as name:
        tiles = _sort_into_tiles(run, Path(name), suffix, edge, selection)
        if not tiles:
            raise selection.nothing_chosen(run)
        for tile in tiles.values():
            path = folder / tile.file
            pieces = _Pieces(Path(name) / f"{tile.file}.rows", tile.points, run, colour, path)
            write_parts(path, pieces)

    listed = [asdict(tiles[place]) for place in sorted(tiles)]
    index = {"edge": edge, "classes": run.classes, "tiles": listed}
    write_whole(folder / INDEX, json.dumps(index, indent=1) + "\n")
    return len(tiles)


def _sort_into_tiles(
    run: LabelledRun, scratch: Path, suffix: str, edge: float, selection: Selection
) -> dict[_Place, Tile]:
    """Append the voxels of every part to files by tile."""
    tiles: dict[_Place, Tile] = {}
    for part in run.parts():
        chosen = part
        if not selection.is_everything:
            chosen = part.select(selection.mask(part, run.classes))
        for (x, y), rows in _by_tile(chosen.xyz, edge):
            piece = chosen.select(rows)
            file = f"{x}_{y}{suffix}"
            low, high = piece.xyz.min(axis=0), piece.xyz.max(axis=0)
            tile = tiles.setdefault((x, y), Tile(file, 0, low.tolist(), high.tolist()))
            tile.points += len(piece)
            tile.low = np.minimum(tile.low, low).tolist()
            tile.high = np.maximum(tile.high, high).tolist()
            path = scratch / f"{file}.rows"
            with naming(path), path.open("ab") as rows_file:
                for field in fields(MapPart):
                    np.save(rows_file, getattr(piece, field.name), allow_pickle=False)
    return tiles


def _by_tile(xyz: NDArray[np.float32], edge: float) -> Iterator[tuple[_Place, NDArray[np.int64]]]:
    """Give the rows of each tile, ascending."""
    tile = np.floor(xyz[:, :2].astype(np.float64) / edge).astype(np.int64)
    order = np.lexsort((tile[:, 1], tile[:, 0]))
    changes = np.flatnonzero((np.diff(tile[order], axis=0) != 0).any(axis=1)) + 1
    for rows in np.split(order, changes) if len(order) else []:
        x, y = tile[rows[0]].tolist()
        yield (x, y), rows


class _Pieces:
    """The voxels of a tile as cloud parts, read from the disk; see ``CloudParts``."""

    def __init__(
        self,
        rows: Path,
        count: int,
        run: LabelledRun,
        colour: Callable[[MapPart], NDArray[np.uint8]],
        path: Path,
    ) -> None:
        self._rows, self._count, self._classes = rows, count, run.classes
        self._colour, self._prefix = colour, label_prefix_for(path)

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Cloud]:
        with self._rows.open("rb") as file:
            end = file.seek(0, 2)
            file.seek(0)
            while file.tell() < end:
                part = MapPart(*[np.load(file, allow_pickle=False) for _ in fields(MapPart)])
                yield as_cloud(part, self._colour, self._classes, self._prefix)
