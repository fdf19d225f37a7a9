"""The floor plan a robot drives in: where the floor is, how high, which of it is free (III-A)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mcpseg_cli.errors import InputError

MAX_WORDS = 1 << 24
"""Cells times their layers, 6.4 m to a word: 128 MB, a building of 800 m x 800 m at 0.2 m."""
_LAYER = 0.1  # metres, the heights that tell stray points from floors
_CLIMB = 2  # layers from cell to cell that still are one surface: stairs, ramps, uneven floors
_MIN_AREA = 4.0  # square metres; a smaller surface below those beside it is a reflection
_CEILING_HEIGHT = 1.8  # metres; a surface that high over a floor ...
_CEILING_RANGE = 3.0  # ... within so many metres is not one
_NONE = np.iinfo(np.int32).max  # the layer of a cell without points
_MARGIN = 2  # cells around the points
_WINDOW = 5  # cells: the lowest point of 5 x 5 is the floor


@dataclass(frozen=True)
class FloorPlan:
    """Where a robot can stand, in square cells centred on multiples of their edge.

    Attributes:
        cell_size: Edge of a cell, metres.
        low: (2,) int64 cell at the plan's corner.
        floor: (X, Y) float32 height of the floor, metres, map frame; NaN where no floor was seen.
        free: (X, Y) bool, cells with a floor and nothing in the robot's way.
        region: (X, Y) int32, which of the connected parts a free cell belongs to; 1 is the largest,
            0 is not free.
    """

    cell_size: float
    low: NDArray[np.int64]
    floor: NDArray[np.float32]
    free: NDArray[np.bool_]
    region: NDArray[np.int32]

    def cell_of(self, xy: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the cells, counted from the plan's corner, of places; they may lie outside it.

        Args:
            xy: (N, 2) float64, metres, map frame.

        Returns:
            (N, 2) int64.
        """
        far = 1e9 * self.cell_size  # no plan is that large, and int64 holds it
        return np.floor(np.clip(xy, -far, far) / self.cell_size + 0.5).astype(np.int64) - self.low

    def centre_of(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the centres of cells.

        Args:
            cells: (N, 2) int64, counted from the plan's corner.

        Returns:
            (N, 2) float64, metres, map frame.
        """
        centre: NDArray[np.float64] = (cells + self.low).astype(np.float64) * self.cell_size
        return centre

    def region_at(self, xy: NDArray[np.float64]) -> NDArray[np.int32]:
        """Return the (N,) int32 region at places (N, 2); 0 where a robot cannot stand."""
        cells = self.cell_of(xy)
        inside = ((cells >= 0) & (cells < self.free.shape)).all(axis=1)
        region = np.zeros(len(cells), np.int32)
        region[inside] = self.region[tuple(cells[inside].T)]
        return region

    def floor_at(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the (N,) float64 height of the floor at places (N, 2) in the plan, or NaN."""
        height: NDArray[np.float64] = self.floor[tuple(self.cell_of(xy).T)].astype(np.float64)
        return height


def build_floor_plan(
    xyz: NDArray[np.float32],
    cell_size: float = 0.2,
    clearance_low: float = 0.1,
    clearance_high: float = 1.4,
    robot_radius: float = 0.0,
) -> FloorPlan:
    """Find the floor of a building and where a robot can stand on it.

    The height of the floor in a cell is the lowest point in it and its 5 x 5 neighbours. A cell is
    free when a floor was seen in it and no point lies between ``clearance_low`` and
    ``clearance_high`` over it. Gaps of two cells in a floor are bridged (S3DIS has no points on
    some thresholds). Left out are surfaces smaller than 4 square metres below those beside them
    (reflections) and surfaces 1.8 m over a floor within 3 m (ceilings where the floor is hidden).

    The default robot is a point, as in the paper's program: a cell is 0.2 m wide, door leaves and
    frames take a cell on each side, and of a door 0.8 m wide a robot of radius 0.2 m may be left no
    cell at all.

    Args:
        xyz: (N, 3) float32, metres, map frame, z up; at least one point.
        cell_size: Edge of a cell, metres.
        clearance_low: What the robot can drive over, metres.
        clearance_high: Height of the robot, metres.
        robot_radius: How far the centre of a free cell is from those of occupied ones at least,
            metres.

    Returns:
        The plan, with a margin of two cells; it may have no free cell.

    Raises:
        InputError: The bounding box is too large for the cell size.
    """
    # the lowest point of each cell, reflections below the floor left out
    low, low_layer, shape = _extent(xyz, cell_size)
    layers = np.zeros(shape, np.uint64)
    _mark_layers(xyz, cell_size, low, low_layer, layers)
    lowest_layer = _without_strays(layers, cell_size)
    lowest = np.full(shape[:2], np.inf, np.float32)
    _find_lowest(xyz, cell_size, low, low_layer, lowest_layer, lowest)

    # the floor, where it was seen and is no ceiling
    floor = _window_minimum(lowest, _WINDOW)
    ground = _window_minimum(lowest, 2 * round(_CEILING_RANGE / cell_size) + 1)
    seen = (lowest <= floor + np.float32(clearance_low)) & (lowest < ground + _CEILING_HEIGHT)

    # what the robot would run into
    blocked = np.zeros(shape[:2], np.bool_)
    clearance = np.array([clearance_low, clearance_high], np.float32)
    _mark_blocked(xyz, cell_size, low, clearance, floor, blocked)

    # free floor, gaps in it bridged
    bridged = ndimage.binary_closing(seen, np.ones((3, 3)))
    free = _reachable(bridged & ~blocked, seen)
    if robot_radius > 0.0:
        free &= ndimage.distance_transform_edt(~blocked) * cell_size >= robot_radius
    known = bridged | (blocked & (floor < ground + _CEILING_HEIGHT))
    return FloorPlan(cell_size, low, np.where(known, floor, np.float32(np.nan)), free, _label(free))


def _extent(
    xyz: NDArray[np.float32], cell_size: float
) -> tuple[NDArray[np.int64], int, tuple[int, int, int]]:
    """Return the cell (2,) at the corner, the lowest layer, and the shape in cells and words."""
    # cells with a margin around the points, layers from the lowest point to the highest
    bounds = np.stack([xyz.min(axis=0), xyz.max(axis=0)]).astype(np.float64)
    corners = np.floor(bounds[:, :2] / cell_size + 0.5).astype(np.int64)
    corners += np.array([[-_MARGIN], [_MARGIN]])
    low_layer, high_layer = (int(layer) for layer in np.floor(bounds[:, 2] / _LAYER))

    # 64 layers to a word
    width, depth = (int(size) for size in corners[1] - corners[0] + 1)
    shape = (width, depth, ((high_layer - low_layer) >> 6) + 1)
    if shape[0] * shape[1] * shape[2] > MAX_WORDS:
        extent = " x ".join(f"{size:,.0f}" for size in bounds[1] - bounds[0])
        found, expected = f"{extent} m in cells of {cell_size:g} m", f"at most {MAX_WORDS:,} cells"
        raise InputError("the building", found, expected, "remove stray points")
    return corners[0], low_layer, shape


def _window_minimum(heights: NDArray[np.float32], window: int) -> NDArray[np.float32]:
    """Return the lowest height of the window x window cells around each cell."""
    lowest: NDArray[np.float32] = ndimage.minimum_filter(
        heights, window, mode="constant", cval=np.inf
    )
    return lowest


def _reachable(free: NDArray[np.bool_], seen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the free cells less parts without seen floor: insides of walls, bridged over."""
    part, count = ndimage.label(free)
    is_real = np.zeros(count + 1, np.bool_)
    is_real[part[free & seen]] = True
    reachable: NDArray[np.bool_] = is_real[part]
    return reachable


def _label(free: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Number the 4-connected parts of the free cells from 1, the largest first."""
    label, count = ndimage.label(free)
    sizes = np.bincount(label.ravel(), minlength=count + 1)[1:]
    number = np.zeros(count + 1, np.int32)
    number[np.argsort(-sizes, kind="stable") + 1] = np.arange(1, count + 1)
    region: NDArray[np.int32] = number[label]
    return region


def _without_strays(layers: NDArray[np.uint64], cell_size: float) -> NDArray[np.int32]:
    """Return the (X, Y) lowest layer of each cell that is not a small surface below others."""
    lowest = _first_layer(layers, np.zeros(layers.shape[:2], np.int32))
    while True:
        # small surfaces, and the lowest large one beside each
        size = _surface_sizes(lowest)
        large = size >= min(_MIN_AREA / cell_size**2, size.max() / 2)
        beside = ndimage.minimum_filter(
            np.where(large, lowest, _NONE), _WINDOW, mode="constant", cval=_NONE
        )

        # those below it are strays: go on with what is over them
        stray = ~large & (beside < _NONE) & (lowest < beside - _CLIMB)
        if not stray.any():
            break
        lowest = _first_layer(layers, np.where(stray, beside - _CLIMB, lowest).astype(np.int32))
    return np.where(large | (beside < _NONE), lowest, _NONE).astype(np.int32)


def _surface_sizes(layer: NDArray[np.int32]) -> NDArray[np.int64]:
    """Count the cells of each cell's surface: those it reaches without a high step."""
    # cells beside each other without a high step between them
    index = np.arange(layer.size).reshape(layer.shape)
    edges = []
    for here, there in _neighbour_pairs():
        together = (layer[here] < _NONE) & (layer[there] < _NONE)
        together &= np.abs(np.where(together, layer[here] - layer[there], 0)) <= _CLIMB
        edges.append(np.stack([index[here][together], index[there][together]]))

    # the parts of the graph they make
    rows, columns = np.concatenate(edges, axis=1)
    is_edge = np.ones(len(rows), np.bool_)
    graph = coo_array((is_edge, (rows, columns)), shape=(layer.size, layer.size))
    surface = connected_components(graph, directed=False)[1]
    sizes: NDArray[np.int64] = np.bincount(surface)[surface].reshape(layer.shape)
    return np.where(layer < _NONE, sizes, 0)


def _neighbour_pairs() -> list[tuple[tuple[slice, slice], tuple[slice, slice]]]:
    """Return slices of the cells, and of their neighbours, in each of four directions."""
    every, first, last = slice(None), slice(None, -1), slice(1, None)
    sides = [((first, every), (last, every)), ((every, first), (every, last))]
    return [*sides, ((first, first), (last, last)), ((first, last), (last, first))]


@njit(cache=True, nogil=True)
def _cell(value: float, cell_size: float) -> int:
    """Return the cell a coordinate falls into."""
    return int(np.floor(np.float64(value) / cell_size + 0.5))


@njit(cache=True, nogil=True)
def _mark_layers(
    xyz: NDArray[np.float32],
    cell_size: float,
    low: NDArray[np.int64],
    low_layer: int,
    layers: NDArray[np.uint64],
) -> None:
    """Set a bit for each layer of a cell that holds points."""
    for row in range(len(xyz)):
        x, y = _cell(xyz[row, 0], cell_size) - low[0], _cell(xyz[row, 1], cell_size) - low[1]
        layer = int(np.floor(np.float64(xyz[row, 2]) / _LAYER)) - low_layer
        layers[x, y, layer >> 6] |= np.uint64(1) << np.uint64(layer & 63)


@njit(cache=True)
def _first_layer(layers: NDArray[np.uint64], least: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return each cell's first layer with points that is not below ``least``."""
    first = np.full(least.shape, _NONE, np.int32)
    num_layers = layers.shape[2] * 64
    for x in range(layers.shape[0]):
        for y in range(layers.shape[1]):
            for layer in range(max(0, least[x, y]), num_layers):
                if (layers[x, y, layer >> 6] >> np.uint64(layer & 63)) & np.uint64(1):
                    first[x, y] = layer
                    break
    return first


@njit(cache=True, nogil=True)
def _find_lowest(
    xyz: NDArray[np.float32],
    cell_size: float,
    low: NDArray[np.int64],
    low_layer: int,
    least: NDArray[np.int32],
    lowest: NDArray[np.float32],
) -> None:
    """Enter the lowest point of each cell that is not in a layer below ``least``."""
    for row in range(len(xyz)):
        x, y = _cell(xyz[row, 0], cell_size) - low[0], _cell(xyz[row, 1], cell_size) - low[1]
        z = xyz[row, 2]
        if z < lowest[x, y] and int(np.floor(np.float64(z) / _LAYER)) - low_layer >= least[x, y]:
            lowest[x, y] = z


@njit(cache=True, nogil=True)
def _mark_blocked(
    xyz: NDArray[np.float32],
    cell_size: float,
    low: NDArray[np.int64],
    clearance: NDArray[np.float32],
    floor: NDArray[np.float32],
    blocked: NDArray[np.bool_],
) -> None:
    """Mark the cells with a point that the robot would run into."""
    for row in range(len(xyz)):
        x, y = _cell(xyz[row, 0], cell_size) - low[0], _cell(xyz[row, 1], cell_size) - low[1]
        height = xyz[row, 2] - floor[x, y]
        if clearance[0] < height < clearance[1]:
            blocked[x, y] = True
