"""Draw rooms of a labelled building from inside, by colour and by class.

    python examples/render_building.py b/Area_1 --rooms office_1 hallway_1 -o pictures/
    python examples/render_building.py b/Area_1 --above -o pictures/

The building is whatever 'mcpseg raytrace' reads. Each room gives ROOM.png: from a corner at eye
height, in its own colours on the left and in those of its classes on the right. ``--above`` draws
the floor plan without its ceilings.
"""

import argparse
from itertools import product
from pathlib import Path

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.building import Building
from mcpseg_cli.export.colours import class_palette
from mcpseg_cli.formats.buildings import read_building

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.patches import Patch

SIZE = (600, 800)  # height and width of a picture, pixels
FOCAL = 0.6  # of the width: 80 degrees across
NEAR = 0.7  # metres; nearer points are left out
SPLAT = 0.045  # metres a point covers
BACKGROUND = 20


def look(
    xyz: NDArray[np.float64],
    rgb: NDArray[np.uint8],
    eye: NDArray[np.float64],
    target: NDArray[np.float64],
) -> NDArray[np.uint8]:
    """Draw points in perspective as squares that hide what is behind them.

    Args:
        xyz: (N, 3), metres.
        rgb: (N, 3).
        eye: (3,) where the camera is.
        target: (3,) what it looks at; z is up.

    Returns:
        (height, width, 3) picture.
    """
    # from metres to what the camera sees: right, up, ahead
    height, width = SIZE
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(right, forward), forward])
    view = (xyz - eye) @ axes.T
    shown = view[:, 2] > NEAR
    view, rgb = view[shown], rgb[shown]

    # where each point falls, and how large its square is
    scale = FOCAL * width / view[:, 2]
    column = width / 2 + view[:, 0] * scale
    row = height / 2 - view[:, 1] * scale
    half = np.clip(np.rint(SPLAT * scale / 2), 0, 14).astype(int)

    # pixel by pixel of the squares, for all points of a size together
    order = np.argsort(-view[:, 2], kind="stable")  # the nearest is drawn last
    picture = np.full((height, width, 3), BACKGROUND, np.uint8)
    depth = np.full((height, width), np.inf)
    for size in range(int(half.max(initial=0)), -1, -1):
        some = order[half[order] == size]
        for down, across in product(range(-size, size + 1), repeat=2):
            rows, columns = row[some] + down, column[some] + across
            _draw(picture, depth, rows, columns, view[some, 2], rgb[some])
    return picture


def _draw(
    picture: NDArray[np.uint8],
    depth: NDArray[np.float64],
    row: NDArray[np.float64],
    column: NDArray[np.float64],
    distance: NDArray[np.float64],
    rgb: NDArray[np.uint8],
) -> None:
    """Set the pixels that points, the nearest last, fall into, where nothing nearer is."""
    rows, columns = np.floor(row).astype(int), np.floor(column).astype(int)
    inside = (rows >= 0) & (rows < picture.shape[0]) & (columns >= 0) & (columns < picture.shape[1])
    rows, columns, distance, rgb = rows[inside], columns[inside], distance[inside], rgb[inside]
    nearer = distance < depth[rows, columns]
    rows, columns, distance, rgb = rows[nearer], columns[nearer], distance[nearer], rgb[nearer]
    picture[rows, columns] = rgb
    depth[rows, columns] = distance


def class_colours(building: Building) -> NDArray[np.uint8]:
    """Return the (N, 3) colour of every point's class."""
    return class_palette(building.classes)[building.semantic]


def draw_room(building: Building, room: int, path: Path, corner: int) -> None:
    """Draw one room from one of its four corners, in its colours and in those of its classes."""
    assert building.room_starts is not None
    # its points without strays, and a corner at eye height
    rows = slice(int(building.room_starts[room]), int(building.room_starts[room + 1]))
    xyz = building.xyz[rows].astype(np.float64)
    low, high = np.percentile(xyz, 0.5, axis=0), np.percentile(xyz, 99.5, axis=0)
    inset = np.minimum(0.5, (high - low) / 4)
    side = np.array([corner & 1, corner >> 1], bool)
    eye = np.append(np.where(side, high[:2] - inset[:2], low[:2] + inset[:2]), low[2] + 1.65)
    target = np.append(np.where(side, low[:2], high[:2]), low[2] + 0.9)
    colourings = (building.rgb, class_colours(building))
    pictures = [look(xyz, rgb[rows], eye, target) for rgb in colourings]

    # the classes that are in it
    present = np.unique(building.semantic[rows])
    names = [building.classes[index] for index in present if index < len(building.classes)]
    palette = class_palette(building.classes)
    colours = [f"#{bytes(palette[building.classes.index(name)]).hex()}" for name in names]
    legend = [Patch(color=colour, label=name) for colour, name in zip(colours, names, strict=True)]

    figure, axes = plt.subplots(1, 2, figsize=(16, 6.8))
    for axis, picture in zip(axes, pictures, strict=True):
        axis.imshow(picture)
        axis.axis("off")
    figure.legend(handles=legend, loc="lower center", ncols=13, frameon=False)
    figure.suptitle(f"{building.rooms[room]}: {len(xyz):,} points")
    figure.tight_layout(rect=(0, 0.05, 1, 1))
    figure.savefig(path, dpi=80)
    plt.close(figure)


def draw_above(building: Building, path: Path) -> None:
    """Draw the building from above without ceilings, in its colours and those of its classes."""
    # what is left, the highest last
    names = np.array(building.classes)
    is_floor = building.semantic == np.flatnonzero(names == "floor")[0]
    height = building.xyz[:, 2] - np.median(building.xyz[is_floor, 2])
    keep = (height < 2.0) & ~np.isin(building.semantic, np.flatnonzero(names == "ceiling"))
    order = np.flatnonzero(keep)[np.argsort(height[keep], kind="stable")]

    # a pixel for every few centimetres
    low, high = building.xyz[order, :2].min(axis=0), building.xyz[order, :2].max(axis=0)
    pixel = max(float((high - low).max()) / 1400, SPLAT)
    size = np.ceil((high - low) / pixel).astype(int) + 1

    figure, axes = plt.subplots(1, 2, figsize=(18, 9 * size[1] / size[0] + 0.6))
    for axis, rgb in zip(axes, (building.rgb, class_colours(building)), strict=True):
        picture = np.full((size[1], size[0], 3), 255, np.uint8)
        column, row = ((building.xyz[order, :2] - low) / pixel).astype(int).T
        picture[size[1] - 1 - row, column] = rgb[order]
        axis.imshow(picture, extent=(low[0], high[0], low[1], high[1]))
        axis.set_xlabel("x, metres")
    figure.tight_layout()
    figure.savefig(path, dpi=80)
    plt.close(figure)


def main() -> None:
    """Draw what the command line asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("building", type=Path)
    parser.add_argument(
        "--rooms", nargs="*", default=[], help="names; without any, and without --above, all rooms"
    )
    parser.add_argument(
        "--corner", type=int, default=0, choices=range(4), help="corner of the room to look from"
    )
    parser.add_argument("--above", action="store_true", help="draw the whole building from above")
    parser.add_argument("-o", "--output", type=Path, default=Path("pictures"))
    arguments = parser.parse_args()

    building, _ = read_building(arguments.building)
    arguments.output.mkdir(parents=True, exist_ok=True)
    if arguments.above:
        draw_above(building, arguments.output / "above.png")

    # the rooms named; all of them where nothing is asked for
    wanted = arguments.rooms or ([] if arguments.above else building.rooms)
    for name in wanted:
        if name not in building.rooms:
            raise SystemExit(f"{name}: no such room; there are {', '.join(building.rooms)}")
        path = arguments.output / f"{name}.png"
        draw_room(building, building.rooms.index(name), path, arguments.corner)


if __name__ == "__main__":
    main()
