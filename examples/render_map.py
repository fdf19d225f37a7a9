"""Draw a labelled map from above and aslant: ``python examples/render_map.py out/ -o map.png``.

Needs matplotlib (``pip install matplotlib``); no display, no graphics card.
"""

import argparse
import colorsys
from pathlib import Path

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.formats import read_cloud

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.patches import Patch

COLOURS = {
    "ceiling": "#b8c8d8", "floor": "#c8b088", "wall": "#8899aa", "beam": "#e0a030", "column": "#ff00c8",
    "window": "#46d2f0", "door": "#a0622d", "table": "#2f7fe0", "chair": "#e23b3b", "sofa": "#8b2fc9",
    "bookcase": "#2ca02c", "board": "#151515", "clutter": "#f2d024",
}  # fmt: skip


def class_colours(semantic: NDArray[np.integer], classes: tuple[str, ...]) -> NDArray[np.float64]:
    """Return (N, 3) colours in 0-1 by class."""
    table = np.full((256, 3), 0.5)
    for index, name in enumerate(classes):
        table[index] = mpl.colors.to_rgb(COLOURS.get(name, "#808080"))
    colours: NDArray[np.float64] = table[semantic]
    return colours


def instance_colours(instance: NDArray[np.integer]) -> NDArray[np.float64]:
    """Return (N, 3) colours in 0-1, far apart for consecutive objects (golden-ratio hues)."""
    _, number = np.unique(instance, return_inverse=True)
    hues = (np.arange(number.max() + 1) * 0.618034) % 1.0
    lightness = 0.45 + 0.25 * ((np.arange(len(hues)) * 7) % 3) / 2
    table = np.array([colorsys.hls_to_rgb(h, level, 0.8) for h, level in zip(hues, lightness, strict=True)])
    return table[number]


def project(
    xyz: NDArray[np.floating], yaw_deg: float, pitch_deg: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Look at points from a direction: (N, 2) picture coordinates and (N,) depth towards the viewer, metres."""
    yaw, pitch = np.deg2rad((yaw_deg, pitch_deg))
    right = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    view = np.array([-np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), -np.sin(pitch)])
    up = np.cross(right, view)
    return np.stack([xyz @ right, xyz @ up], axis=1), -(xyz @ view)


def draw(map_path: Path, picture: Path, cut: float, yaw_deg: float) -> None:
    """Draw the map without its ceiling: above and aslant, by class, by object and in its own colours."""
    cloud = read_cloud(map_path)
    xyz = cloud.xyz.astype(np.float64)
    keep = xyz[:, 2] < np.percentile(xyz[:, 2], 2) + cut
    semantic, instance, rgb = cloud.label("semantic"), cloud.label("instance"), cloud.rgb
    if semantic is None or instance is None or rgb is None:
        raise SystemExit(f"{map_path}: no labels or no colour; expected a map that 'mcpseg segment' wrote")
    looks = {
        "colour": rgb[keep] / 255.0,
        "class": class_colours(semantic[keep].astype(int), cloud.classes),
        "object": instance_colours(instance[keep].astype(int)),
    }
    figure, axes = plt.subplots(2, 3, figsize=(18, 9), dpi=80, layout="constrained")
    for row, pitch_deg in enumerate((90.0, 40.0)):
        points, depth = project(xyz[keep], yaw_deg if row else 0.0, pitch_deg)
        order = np.argsort(depth)
        extent = np.ptp(points, axis=0).max()
        for axis, (title, colours) in zip(axes[row], looks.items(), strict=True):
            axis.scatter(*points[order].T, c=colours[order], s=(42 / max(extent, 1.0)) ** 2, marker="s", linewidths=0)
            axis.set_aspect("equal")
            axis.axis("off")
            axis.set_title(f"{title}, {'from above' if row == 0 else 'aslant'}")
    names = [name for index, name in enumerate(cloud.classes) if (semantic == index).any()]
    patches = [Patch(color=COLOURS.get(name, "#808080"), label=name) for name in names]
    figure.legend(handles=patches, loc="outside lower center", ncols=len(names))
    figure.savefig(picture)
    plt.close(figure)


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("map", type=Path, help="a run's folder, or a labelled cloud")
    parser.add_argument("-o", "--output", type=Path, default=Path("map.png"))
    parser.add_argument("--cut", type=float, default=2.0, help="leave out what is higher above the floor, metres")
    parser.add_argument("--yaw", type=float, default=30.0, help="direction of view, degrees")
    arguments = parser.parse_args()
    path: Path = arguments.map
    draw(path / "map.ply" if path.is_dir() else path, arguments.output, arguments.cut, arguments.yaw)
    print(arguments.output)


if __name__ == "__main__":
    main()
