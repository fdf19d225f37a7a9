"""Meshes taken for buildings: upright and in metres, classes by name, points on every triangle."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.building import Building, Mesh
from mcpseg_cli.choices import MeshUpAxis
from mcpseg_cli.classes import S3DIS_CLASSES, UNKNOWN
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.meshes import MeshPart, read_mesh

_UP: dict[str, MeshUpAxis] = {".glb": "y", ".gltf": "y", ".ifc": "z"}  # formats that say it
_TO_Z = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])  # (x, y, z) to (x, -z, y)
_HEIGHTS = (1.8, 500.0)  # metres; no building is lower or higher
_MOST_POINTS = 50_000_000  # of 20 bytes
_BLOCK = 1 << 18  # points placed at once
_STEP = np.array([0.7548776662466927, 0.5698402909980532])  # of R2, a sequence without gaps
_MOST_NAMED = 6  # objects of a notice

_TYPES = {
    "ifcslab.roof": "ceiling", "ifcslab.underside": "ceiling", "ifcslab": "floor",
    "ifcroof": "ceiling", "ifccovering.ceiling": "ceiling", "ifccovering.flooring": "floor",
    "ifcwindow": "window", "ifcdoor": "door", "ifcwall*": "wall", "ifccurtainwall": "wall",
    "ifccolumn": "column", "ifcbeam": "beam", "ifcmember": "beam",
}  # fmt: skip
_OTHER_TYPES = dict.fromkeys(
    ("ifcfurniture", "ifcfurnishingelement", "ifcflow*", "ifcsanitary*", "ifcstair*", "ifcrailing",
     "ifcramp*"), "clutter",
)  # fmt: skip
_WORDS = {
    **{name: name for name in S3DIS_CLASSES},
    "slab": "floor", "roof": "ceiling", "pillar": "column", "desk": "table", "stool": "chair",
    "armchair": "chair", "couch": "sofa", "shelf": "bookcase", "bookshelf": "bookcase",
    "whiteboard": "board", "blackboard": "board",
}  # fmt: skip


@dataclass(frozen=True)
class MeshOptions:
    """How a mesh becomes a building.

    Attributes:
        up: The axis that points up; None: what the format says.
        scale: Metres to one unit of the file; None: what the format says, else 1.
        classes: Class by name of objects, of meshes, of materials or of IFC types; ``*`` stands for
            any letters; the first that fits counts. None: the 13 of S3DIS by the words in a name.
        voxel_size: Edge of a voxel that rays will be told apart by, metres; decides how many points
            are laid on the triangles.
    """

    up: MeshUpAxis | None = None
    scale: float | None = None
    classes: Mapping[str, str] | None = None
    voxel_size: float = 0.1


def read_mesh_building(path: Path, options: MeshOptions) -> tuple[Building, tuple[str, ...]]:
    """Read a mesh as a building without rooms.

    Args:
        path: What ``meshes.read_mesh`` or ``ifc.read_ifc`` reads.
        options: How to take it.

    Returns:
        The building, about 16 points for each voxel that a triangle goes through and at least one
        for each triangle; and a line for each thing the user should know. Objects whose names have
        no class are unknown (255).

    Raises:
        InputError: It cannot be read, does not say what is up, or is no building in metres.
        OSError: It cannot be opened.
    """
    up = options.up or _UP.get(path.suffix.lower())
    if up is None:
        found, expected = f"{path.suffix} does not say what is up", "--up y or --up z"
        raise InputError(path, found, expected, "Blender writes OBJ with y up, CAD mostly z")
    if path.suffix.lower() == ".ifc":
        from mcpseg_cli.formats.ifc import read_ifc

        parts = read_ifc(path)
    else:
        parts = read_mesh(path)

    # upright, in metres
    turn = (_TO_Z if up == "y" else np.eye(3)) * (options.scale or 1.0)
    with np.errstate(over="ignore", invalid="ignore"):  # corners that are no numbers: see below
        corners = [part.triangles @ turn.T for part in parts]
    _check_size(path, corners)

    # objects and their classes
    names = list(dict.fromkeys(part.name for part in parts))
    instance = [names.index(part.name) + 1 for part in parts]
    named = [(part, class_of(part.labels, options.classes)) for part in parts]
    given = options.classes
    table = S3DIS_CLASSES if given is None else tuple(dict.fromkeys(given.values()))
    semantic = [table.index(of) if of else UNKNOWN for _, of in named]

    # points on them
    spacing = options.voxel_size / 4
    _check_points(path, corners, spacing)
    building = _sampled(parts, corners, spacing, semantic, instance, table, tuple(names))
    return building, tuple(_notices([part.name for part, of in named if not of]))


def class_of(labels: Sequence[str], classes: Mapping[str, str] | None) -> str:
    """Find the class of an object by its names.

    Args:
        labels: Its names, the most telling first.
        classes: Class by name, ``*`` for any letters, whatever the case; None: the 13 of S3DIS.

    Returns:
        The class of the first name that has one; empty where none has.
    """
    if classes is not None:
        return _look_up(labels, classes)
    return _look_up(labels, _TYPES) or _read_words(labels) or _look_up(labels, _OTHER_TYPES)


def _look_up(labels: Sequence[str], table: Mapping[str, str]) -> str:
    """Return the class of the first name that fits a row of a table, with or without its number."""
    for label in map(str.lower, labels):
        plain = re.sub(r"[._ #-]*\d+$", "", label)  # Chair.003, chair_12
        for pattern, name in table.items():
            if fnmatchcase(label, pattern.lower()) or fnmatchcase(plain, pattern.lower()):
                return name
    return ""


def _read_words(labels: Sequence[str]) -> str:
    """Return the class that the last known word of a name says: office chair, WindowBoard."""
    for label in labels:
        parted = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", label).lower()
        for word in reversed(re.split(r"[^a-z]+", parted)):
            if name := _WORDS.get(word) or _WORDS.get(word.removesuffix("s")):
                return name
    return ""


def _check_size(path: Path, corners: list[NDArray[np.float64]]) -> None:
    """Refuse what has no finite corners, or is no building in metres."""
    low = np.min([part.min(axis=(0, 1)) for part in corners], axis=0)
    high = np.max([part.max(axis=(0, 1)) for part in corners], axis=0)
    if not np.isfinite([low, high]).all():
        raise InputError(path, "corners that are no numbers", "finite ones", "export it again")
    height = float(high[2] - low[2])
    if not _HEIGHTS[0] <= height <= _HEIGHTS[1]:
        expected = f"a building of {_HEIGHTS[0]:g} to {_HEIGHTS[1]:g} m"
        remedy = "give --scale (0.001 for millimetres, 0.0254 for inches), or another --up"
        raise InputError(path, f"{height:,.4g} m high", expected, remedy)


def _check_points(path: Path, corners: list[NDArray[np.float64]], spacing: float) -> None:
    """Refuse more points than memory holds."""
    with np.errstate(over="ignore", invalid="ignore"):
        area = sum(float(_areas(part).sum()) for part in corners)
    if not area / spacing**2 <= _MOST_POINTS:
        found = f"{area:,.0f} square metres of surface"
        expected = f"at most {_MOST_POINTS * spacing**2:,.0f} at this --voxel-size"
        raise InputError(path, found, expected, "give a larger one, or a part of the building")


def _areas(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the (T,) areas of triangles (T, 3, 3)."""
    sides = triangles[:, 1:] - triangles[:, :1]
    areas: NDArray[np.float64] = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
    return areas


def _sampled(
    parts: Sequence[MeshPart],
    corners: Sequence[NDArray[np.float64]],
    spacing: float,
    semantic: Sequence[int],
    instance: Sequence[int],
    classes: tuple[str, ...],
    names: tuple[str, ...],
) -> Building:
    """Lay points on all parts."""
    # how many on each triangle, then where they are
    rng = np.random.default_rng(0)
    drawn = [_draw(triangles, spacing, rng) for triangles in corners]
    sizes = [int(count.sum()) for count, _ in drawn]
    xyz, rgb = np.empty((sum(sizes), 3), np.float32), np.empty((sum(sizes), 3), np.uint8)
    start = 0
    for part, triangles, (count, corner), size in zip(parts, corners, drawn, sizes, strict=True):
        for first in range(0, size, _BLOCK):
            row, weight = _spread(count, corner, first, min(first + _BLOCK, size))
            rows = slice(start + first, start + first + len(row))
            xyz[rows] = np.einsum("nk,nkc->nc", weight, triangles[row]).astype(np.float32)
            rgb[rows] = part.paint(row, weight)
        start += size

    counts = np.concatenate([count for count, _ in drawn])
    mesh = Mesh(np.concatenate(corners).astype(np.float32), np.cumsum(counts) - counts)
    return Building(
        xyz,
        rgb,
        np.repeat(np.array(semantic, np.uint8), sizes),
        np.repeat(np.array(instance, np.int32), sizes),
        classes,
        object_names=names,
        mesh=mesh,
    )


def _draw(
    triangles: NDArray[np.float64], spacing: float, rng: np.random.Generator
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Draw how many points each triangle gets, (T,), and where its first one is, (T, 2)."""
    expected = _areas(triangles) / spacing**2
    count = np.maximum(np.floor(expected + rng.random(len(expected))).astype(np.int64), 1)
    return count, rng.random((len(triangles), 2))


def _spread(
    count: NDArray[np.int64], corner: NDArray[np.float64], first: int, last: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Place points on triangles, see ``_draw``.

    Args:
        count: (T,) int64 points of each triangle.
        corner: (T, 2) float64 place of its first one, in a square.
        first: The first of all points to place.
        last: The one behind the last.

    Returns:
        The triangle (N,) of each, ascending, and its (N, 3) weights.
    """
    ends = np.cumsum(count)
    points = np.arange(first, last)
    row = np.searchsorted(ends, points, side="right")
    place = points - (ends - count)[row]

    # evenly in a square, of which one half is folded onto the other
    square = corner[row] + place[:, None] * _STEP
    square -= np.floor(square)
    folded = square[:, 0] + square[:, 1] > 1.0
    square[folded] = 1.0 - square[folded]
    return row, np.column_stack([1.0 - (square[:, 0] + square[:, 1]), square])


def _notices(unknown: Sequence[str]) -> list[str]:
    """Say which objects have no class."""
    names = list(dict.fromkeys(unknown))
    if not names:
        return []
    listed = ", ".join(names[:_MOST_NAMED]) + (", …" if len(names) > _MOST_NAMED else "")
    return [f"{len(names):,} objects of no class, unknown in the truth: {listed}; --classes names"]
