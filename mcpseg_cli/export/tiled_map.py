"""A labelled map as a tree of tiles, for a page that loads what it shows.

Voxels go to columns on the disk; column by column they become the deepest tiles, which hand an even
sample up to the level above; that is done in the same way, level by level. So memory holds one
column and what is known of objects, whatever the size of the map.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.export.column_files import ColumnFiles
from mcpseg_cli.export.floors import Ceilings, floor_heights
from mcpseg_cli.export.normals import surface_normals
from mcpseg_cli.export.octree import TileGrid, places_of
from mcpseg_cli.export.spooled_map import SpooledMap
from mcpseg_cli.export.tiled_objects import TiledObjects
from mcpseg_cli.segment.labelled_run import LabelledRun

POINT = np.dtype(
    [("key", "<i8"), ("xyz", "<f4", (3,)), ("normal", "i1", (3,)), ("rgb", "u1", (3,)),
     ("semantic", "u1"), ("confidence", "u1"), ("object", "<u4"), ("floor", "<u2")]
)  # fmt: skip
"""A point on its way to its tile: its cell as key, its object by place, its floor in steps."""
_FLOOR_STEP = 0.01  # metres, that heights of floors are kept as
Tile = tuple[int, int, int, int]
"""Level, and x, y, z among the cubes of that level."""


class TileWriter:
    """Makes tiles of voxels that are in columns.

    Args:
        run: The map.
        spooled: Its chosen voxels, of which nothing is left afterwards.
        folder: Where tiles go, ``LEVEL/X_Y_Z.bin``.
        scratch: A folder for what waits.

    Attributes:
        grid: Where the tiles are.
        objects: What is known of them once all tiles are written.
        ceilings: Of all points.
        tiles: How many points each has; all above those that have some are among them.
        lowest_floor, floor_step: Metres; of the heights that floors are kept as.
        most_height: Of a point above its floor, metres.
    """

    def __init__(self, run: LabelledRun, spooled: SpooledMap, folder: Path, scratch: Path) -> None:
        self.grid = TileGrid.around(spooled.low, spooled.high, run.voxel_size)
        self.objects = TiledObjects(spooled.sizes, run.classes, scratch)
        self.ceilings = Ceilings()
        self.tiles: dict[Tile, int] = {}
        self.most_height = -np.inf
        self._spooled, self._folder, self._scratch = spooled, folder, scratch
        self._eyes, self._floors = run.poses[:, :3, 3], floor_heights(run)
        self.lowest_floor = float(self._floors.min())
        self.floor_step = max(_FLOOR_STEP, float(np.ptp(self._floors)) / 65_535)

    def write(self, told: Callable[[int, int], None] = lambda *_: None) -> None:
        """Write all tiles.

        Args:
            told: Called again and again: how many points are done, of how many.

        Raises:
            OSError: The disk is full.
        """
        done, total = 0, len(self._spooled)
        above = self._level(self.grid.depth - 1)
        for column in self._spooled.columns:
            points = self._points(*self._spooled.take(column))
            self._divide(points, self.grid.depth, above)
            done += len(points)
            told(done, total)

        # the same with what each level handed up
        for level in range(self.grid.depth - 1, -1, -1):
            waiting, above = above, self._level(level - 1)
            for column in waiting.columns:
                self._divide(waiting.take(column), level, above)
        self._add_those_above()

    def _level(self, level: int) -> ColumnFiles:
        """Make room for what a level gets."""
        return ColumnFiles(self._scratch, POINT, f"level{level}")

    def _points(self, seen: NDArray[np.void], rim: NDArray[np.float32]) -> NDArray[np.void]:
        """Take what is known of voxels to what the page shows of them."""
        # the way their surface faces, by all around
        eyes = np.concatenate([self._eyes[seen["scan"]], np.zeros((len(rim), 3))])
        xyz = np.concatenate([seen["xyz"], rim])
        normal = surface_normals(xyz, eyes, self.grid.voxel_size)[: len(seen)]
        floor = self._floors[seen["scan"]]
        height = seen["xyz"][:, 2] - floor
        self.ceilings.add(height, normal)
        self.most_height = max(self.most_height, float(height.max()))

        points = np.empty(len(seen), POINT)
        for name in ("xyz", "rgb", "semantic"):
            points[name] = seen[name]
        points["key"] = self.grid.keys(seen["xyz"])
        points["normal"] = np.rint(127 * normal)
        points["confidence"] = np.rint(255 * seen["confidence"])
        points["object"] = self.objects.add(seen, floor)
        points["floor"] = np.rint((floor - self.lowest_floor) / self.floor_step)
        return points

    def _divide(self, points: NDArray[np.void], level: int, above: ColumnFiles) -> None:
        """Write the tiles of a column, without what the level above takes."""
        points = points[np.argsort(points["key"], kind="stable")]
        if level > 0:
            taken = self.grid.taken_up(points["key"], points["xyz"], level)
            handed = points[taken]
            tile = self.grid.tiles_of(handed["key"], level - 1)
            above.add(places_of(tile)[:, :2], handed)
            points = points[~taken]
        for place, rows in self._by_tile(points, level):
            self._write_tile((level, *place), rows)

    def _by_tile(
        self, points: NDArray[np.void], level: int
    ) -> Iterator[tuple[tuple[int, int, int], NDArray[np.void]]]:
        """Give the points of each tile, which are next to each other."""
        tiles = self.grid.tiles_of(points["key"], level)
        starts = np.flatnonzero(np.diff(tiles, prepend=-1))
        places = [(x, y, z) for x, y, z in places_of(tiles[starts]).tolist()]
        # of no points there is one piece all the same
        yield from zip(places, np.split(points, starts[1:]), strict=False)

    def _write_tile(self, tile: Tile, rows: NDArray[np.void]) -> None:
        level, x, y, z = tile
        folder = self._folder / str(level)
        folder.mkdir(exist_ok=True)
        low = self.grid.corner + self.grid.edge(level) * np.array([x, y, z])
        (folder / f"{x}_{y}_{z}.bin").write_bytes(tile_bytes(rows, low, self.grid.step(level)))
        self.tiles[tile] = len(rows)

    def _add_those_above(self) -> None:
        """Note tiles without a point of their own that some are below of."""
        for level, x, y, z in list(self.tiles):
            for up in range(1, level + 1):
                self.tiles.setdefault((level - up, x >> up, y >> up, z >> up), 0)


def tile_bytes(rows: NDArray[np.void], low: NDArray[np.float64], step: float) -> bytes:
    """Pack the points of a tile: every byte of every column by itself, deflated.

    Args:
        rows: (N,) of the kind ``POINT``.
        low: (3,) lowest corner of the tile, metres, map frame.
        step: Metres that positions are kept as.

    Returns:
        Deflated, N bytes of each: x, y, z (low byte, then high), normal, colour, class, confidence,
        object (three bytes, the lowest first), floor (two).
    """
    steps = np.rint((rows["xyz"] - low) / step).clip(0, 65_535).astype("<u2")
    planes = [
        steps.view(np.uint8).reshape(-1, 6).T,
        rows["normal"].view(np.uint8).reshape(-1, 3).T,
        rows["rgb"].T,
        rows["semantic"][None],
        rows["confidence"][None],
        np.ascontiguousarray(rows["object"]).view(np.uint8).reshape(-1, 4).T[:3],
        np.ascontiguousarray(rows["floor"]).view(np.uint8).reshape(-1, 2).T,
    ]
    return zlib.compress(np.concatenate(planes).tobytes(), 6)
