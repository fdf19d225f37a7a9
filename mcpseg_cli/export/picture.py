"""Pictures of a labelled map with legend and robot path: from above, cut away, in perspective."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from mcpseg_cli.choices import View
from mcpseg_cli.export.colours import colouring
from mcpseg_cli.export.floors import floor_heights
from mcpseg_cli.export.legend import LegendEntry, legend_entries, scale_entry, with_legend
from mcpseg_cli.export.raster import Camera, draw_points, shade
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.export.views import PITCH_DEG, YAW_DEG, PictureSettings
from mcpseg_cli.resumable import whole_file
from mcpseg_cli.segment.labelled_run import LabelledRun, MapPart

_SIZE, _TURNTABLE_SIZE = 1600, 640  # longest side without the legend, pixels
_OVERSIZE = 2  # pixels drawn for each that is kept, in both directions
_RADIUS = 1.0  # of a disc, in voxels: points lie anywhere in their voxel, and surfaces shall close
_MARGIN = 0.03  # of the picture's longer side, around the map
_FRAMES = 48  # of a turntable
_PATH_COLOUR, _PATH_EDGE = (24, 24, 24), (255, 255, 255)


@dataclass(frozen=True)
class _Scene:
    """What is drawn.

    Attributes:
        xyz: (N, 3) float32 points, metres, map frame.
        rgb: (N, 3) uint8.
        path: (S, 3) float64 positions of the robot.
        voxel_size: Metres.
        entries: The legend.
    """

    xyz: NDArray[np.float32]
    rgb: NDArray[np.uint8]
    path: NDArray[np.float64]
    voxel_size: float
    entries: list[LegendEntry]


def write_picture(
    run: LabelledRun, path: Path, selection: Selection, settings: PictureSettings
) -> int:
    """Draw a map into a PNG file.

    Args:
        run: The map; coordinates and colours of the chosen voxels are held, 20 bytes each.
        path: The file; replaced if there.
        selection: Which voxels.
        settings: What the picture shows.

    Returns:
        How many points there are to be seen.

    Raises:
        InputError: Nothing is chosen, or nothing is left under the cut.
        OSError: The disk is full or the folder not writable; nothing is left under ``path``'s name.
    """
    scene = _collect(run, selection, settings)
    yaw_deg = YAW_DEG[settings.view] if settings.yaw_deg is None else settings.yaw_deg
    _save(_draw(scene, settings.view, yaw_deg, _SIZE), path)
    return len(scene.xyz)


def write_turntable(
    run: LabelledRun, path: Path, selection: Selection, settings: PictureSettings
) -> int:
    """Draw a map that turns once around into a GIF file; see ``write_picture``."""
    scene = _collect(run, selection, settings)
    turns = np.linspace(0.0, 360.0, _FRAMES, endpoint=False) + (settings.yaw_deg or 0.0)
    frames = [
        _draw(scene, settings.view, yaw_deg, _TURNTABLE_SIZE, is_turning=True)
        for yaw_deg in turns.tolist()
    ]
    _save(frames[0], path, frames[1:])
    return len(scene.xyz)


def _save(picture: Image.Image, path: Path, others: list[Image.Image] | None = None) -> None:
    """Write a picture that appears under its name only when complete."""
    with whole_file(path) as partial:
        if others is None:
            picture.save(partial)
        else:
            picture.save(partial, save_all=True, append_images=others, duration=80, loop=0)


def _collect(run: LabelledRun, selection: Selection, settings: PictureSettings) -> _Scene:
    """Gather what is to be drawn."""
    selection.check(run)
    colour = colouring(run, settings.colour_by)
    floor = floor_heights(run)

    # what is chosen and not cut off, part by part
    xyz, rgb, present = [], [], np.zeros(256, bool)
    for part in run.parts():
        is_low = part.xyz[:, 2] - floor[part.scan] < settings.cut
        kept: MapPart = part.select(selection.mask(part, run.classes) & is_low)
        xyz.append(kept.xyz)
        rgb.append(colour(kept))
        present[kept.semantic] = True
    points = np.concatenate(xyz)
    if len(points) == 0:
        raise selection.nothing_chosen(run)

    # what the colours mean that are to be seen
    entries = legend_entries(settings.colour_by, run.classes, present)
    entries.append(LegendEntry("robot path", _PATH_COLOUR, is_line=True))
    voxel_size = float(str(run.settings["voxel_size"]))
    return _Scene(points, np.concatenate(rgb), run.poses[:, :3, 3], voxel_size, entries)


def _draw(
    scene: _Scene, view: View, yaw_deg: float, longest: int, *, is_turning: bool = False
) -> Image.Image:
    """Draw the scene from one direction, with its legend and scale.

    The longest side of the picture without them has that many pixels. In perspective the scale is
    that of the middle of the map.
    """
    # the camera looks at the middle, whatever stray points there are
    low, high = np.percentile(scene.xyz, (0.1, 99.9), axis=0)
    reach = float(np.linalg.norm(high - low))
    distance = 1.1 * reach + 2.0 if view == "perspective" else None
    camera = Camera.aslant((low + high) / 2, yaw_deg, PITCH_DEG[view], distance)
    plane, depth, size = camera.project(scene.xyz)

    # every frame of a turntable shows the same piece of the world
    if is_turning:
        left_bottom, right_top = np.full(2, -reach / 2), np.full(2, reach / 2)
    else:
        left_bottom, right_top = np.nanpercentile(plane, (0.1, 99.9), axis=0)

    # from metres in the picture's plane to pixels
    extent = np.maximum(right_top - left_bottom, scene.voxel_size)
    margin = _MARGIN * extent.max() + scene.voxel_size
    scale = _OVERSIZE * longest / float(extent.max() + 2 * margin)  # pixels a metre
    columns, rows = (int(side) for side in np.ceil((extent + 2 * margin) * scale))
    corner = np.array([left_bottom[0] - margin, right_top[1] + margin])

    def place(plane: NDArray[np.float64]) -> NDArray[np.float64]:
        pixels: NDArray[np.float64] = (plane - corner) * np.array([scale, -scale])
        return pixels

    # discs, shading, the path, and what was drawn too large made small
    radius = np.maximum(_RADIUS * scene.voxel_size * scale * size, 0.5)
    bulge = _RADIUS * scene.voxel_size
    image, nearest = draw_points(place(plane), depth, radius, scene.rgb, (rows, columns), bulge)
    picture = Image.fromarray(shade(image, nearest, _reaches(radius)))
    _draw_path(picture, place(camera.project(scene.path)[0]))
    small = picture.resize((columns // _OVERSIZE, rows // _OVERSIZE), Image.Resampling.BOX)
    return with_legend(small, [*scene.entries, scale_entry(small.width, scale / _OVERSIZE)])


def _reaches(radius: NDArray[np.float64]) -> tuple[int, ...]:
    """Choose how far shading looks, pixels: in even steps to twice the size of a disc."""
    farthest = max(float(np.nanmedian(radius)) * 2, 4 * _OVERSIZE)
    return tuple(max(1, round(farthest * share)) for share in (0.25, 0.5, 0.75, 1.0))


def _draw_path(picture: Image.Image, places: NDArray[np.float64]) -> None:
    """Draw the robot's path over a picture, with a dot at its end."""
    points = [(x, y) for x, y in places.tolist() if np.isfinite((x, y)).all()]
    if not points:
        return

    # the path with an edge, so that it stands out from what it crosses
    canvas = ImageDraw.Draw(picture)
    width = max(3, max(picture.size) // 640)
    for colour, wide in ((_PATH_EDGE, 2 * width), (_PATH_COLOUR, width)):
        canvas.line(points, fill=colour, width=wide, joint="curve")

    x, y = points[-1]
    dot = (x - 2 * width, y - 2 * width, x + 2 * width, y + 2 * width)
    canvas.ellipse(dot, _PATH_COLOUR, _PATH_EDGE, width // 2)
