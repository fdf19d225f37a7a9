"""A picture of a route on its floor plan."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.building import Building
from mcpseg_cli.errors import OutputError, naming
from mcpseg_cli.raytrace.coverage import room_of_cells
from mcpseg_cli.raytrace.floor_plan import FloorPlan
from mcpseg_cli.raytrace.route import Route

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_NUMBERS = 60  # waypoints; more would hide each other's numbers
_UNKNOWN, _OCCUPIED, _CUT_OFF, _FREE = "#3b4048", "#b9bec6", "#e3dccb", "#ffffff"


def plot_route(path: Path, plan: FloorPlan, route: Route, building: Building | None = None) -> None:
    """Draw the floor plan, the way of the robot, its scans, waypoints and rooms as a PNG file.

    Args:
        path: The picture; replaced if there.
        plan: What the robot drives on.
        route: Where it drives.
        building: Gives the rooms to name; None names none.

    Raises:
        OutputError: matplotlib is not installed.
        OSError: The file cannot be written.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise OutputError(
            f"{path}: no matplotlib to draw it with; expected the extra 'plot'; "
            "run: pip install 'mcpseg[plot]'"
        ) from error

    # a page in the shape of the floor
    corners = _corners(plan)
    size = np.ptp(corners, axis=0)
    scale = min(14.0 / size[0], 11.0 / size[1])
    page = max(7.0, size[0] * scale + 1.8), max(5.0, size[1] * scale + 1.2)
    figure = Figure(figsize=page, layout="constrained")

    # the drive on its plan
    axes = figure.add_subplot()
    _draw_plan(axes, plan, route.regions if len(route.regions) else np.ones(1, np.int32))
    _draw_route(axes, route, scale)
    if building is not None:
        _name_rooms(axes, plan, building, scale)

    # what it is
    axes.set(xlim=corners[:, 0], ylim=corners[:, 1], xlabel="x (m)", ylabel="y (m)", aspect="equal")
    stops = f"{len(route.waypoints)} waypoint{'s' * (len(route.waypoints) != 1)}"
    axes.set_title(f"{route.length:,.0f} m, {len(route):,} scans, {stops}", fontsize=11)

    with naming(path), path.open("wb") as file, warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of letters that the font lacks
        figure.savefig(file, format="png", dpi=150, bbox_inches="tight", pad_inches=0.1)


def _corners(plan: FloorPlan) -> NDArray[np.float64]:
    """Return the (2, 2) lowest and highest place to show, metres: two cells around the floor."""
    shown = np.argwhere(np.isfinite(plan.floor))
    if len(shown) == 0:
        return np.eye(2)
    return plan.centre_of(np.array([shown.min(axis=0) - 2, shown.max(axis=0) + 2]))


def _draw_plan(axes: Axes, plan: FloorPlan, regions: NDArray[np.int32]) -> None:
    """Colour the cells, the regions driven in among them, and say what the colours mean."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    # what kind each cell is of
    kind = np.where(np.isfinite(plan.floor), 1, 0)
    kind[plan.free] = 2
    kind[np.isin(plan.region, regions)] = 3

    # a colour for each
    low, high = plan.centre_of(np.array([[0, 0], plan.free.shape])) - plan.cell_size / 2
    extent = (low[0], high[0], low[1], high[1])
    colours = ListedColormap([_UNKNOWN, _OCCUPIED, _CUT_OFF, _FREE])
    axes.imshow(kind.T, cmap=colours, vmin=-0.5, vmax=3.5, origin="lower", extent=extent)

    # a legend of those that occur
    patches = [
        Patch(fc=colours(number), ec="#6b7280", lw=0.5, label=name)
        for number, name in enumerate(["no floor seen", "occupied", "free, not reached", "free"])
        if (kind == number).any()
    ]
    axes.figure.legend(
        handles=patches, loc="outside lower center", ncols=4, fontsize=8, frameon=False
    )


def _draw_route(axes: Axes, route: Route, scale: float) -> None:
    """Draw the way, coloured by how far along it is, the scans on it and the numbered waypoints."""
    from matplotlib.collections import LineCollection

    # the way, which does not lead from segment to segment
    parts = np.split(route.path, route.path_starts[1:-1])
    lines = [np.stack([part[:-1], part[1:]], axis=1) for part in parts if len(part)]
    moves = np.concatenate([np.empty((0, 2, 2)), *lines])
    along = np.cumsum(np.linalg.norm(moves[:, 1] - moves[:, 0], axis=1))
    way = LineCollection(
        list(moves), array=along, cmap="viridis", linewidths=1.6, zorder=2, capstyle="round"
    )
    axes.add_collection(way)
    if len(along):
        axes.figure.colorbar(way, ax=axes, label="metres driven", shrink=0.6, aspect=30, pad=0.01)

    # scans
    x, y, _ = route.positions.T
    axes.scatter(x, y, s=4.0, c="#111827", linewidths=0, zorder=3)

    # waypoints, with numbers while there is room for them
    numbered = route.waypoints if len(route.waypoints) <= _MOST_NUMBERS else ()
    dot, font = (70.0, 6.0) if scale > 0.3 else (36.0, 4.5)
    dot = dot if len(route.waypoints) <= _MOST_NUMBERS else 9.0
    x, y = route.waypoints.T
    axes.scatter(x, y, s=dot, c="white", edgecolors="#c2410c", linewidths=0.8, zorder=4)
    for number, place in enumerate(numbered, 1):
        text = axes.annotate(str(number), tuple(place), ha="center", va="center", fontsize=font)
        text.set(color="#9a3412", zorder=5)

    # those the robot cannot get to
    x, y = route.skipped.T
    axes.scatter(x, y, s=dot, c="#dc2626", marker="x", linewidths=1.2, zorder=5)


def _name_rooms(axes: Axes, plan: FloorPlan, building: Building, scale: float) -> None:
    """Write the name of each room where its floor is."""
    from matplotlib import patheffects

    outline = [patheffects.withStroke(linewidth=2.5, foreground="white")]
    rooms = room_of_cells(building, plan)
    for number, name in enumerate(building.rooms):
        cells = np.argwhere(rooms == number)
        if len(cells):
            x, y = plan.centre_of(_middle(cells)[None])[0]
            size = 9 if scale > 0.3 else 7
            text = axes.text(x, y, name, ha="center", va="center", fontsize=size, zorder=6)
            text.set(parse_math=False, color="#1e3a8a", weight="bold", alpha=0.9)
            text.set(path_effects=outline)


def _middle(cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the cell of a room nearest to its middle: that of an L-shaped one is outside it."""
    middle: NDArray[np.int64] = cells[np.argmin(((cells - cells.mean(axis=0)) ** 2).sum(axis=1))]
    return middle
