"""Meshes of buildings: the named parts of a GLB, OBJ, PLY and what else trimesh reads."""

from __future__ import annotations

import logging
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from struct import error as StructError
from typing import TYPE_CHECKING, Any
from warnings import catch_warnings, filterwarnings

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.claims import open_bounded
from mcpseg_cli.formats.obj_groups import regroup_obj
from mcpseg_cli.scan import GREY

if TYPE_CHECKING:
    import trimesh

MESH_SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".off", ".ifc")
"""Endings of meshes; a PLY is one if it has faces."""
_NEEDS = "needs trimesh; expected it installed; run: pip install 'mcpseg[models]'"
_DAMAGE = (  # what trimesh raises for damaged files
    ValueError, LookupError, TypeError, AttributeError, ArithmeticError, NotImplementedError,
    EOFError, MemoryError, NameError, StructError, AssertionError, SyntaxError, zlib.error,
)  # fmt: skip
_TOO_LARGE = "Image size"  # how Pillow's warning of pictures that lie begins
_SILENT = logging.NullHandler()  # in place of stderr
_LARGEST = 2048  # pixels of a texture


@dataclass(frozen=True)
class MeshPart:
    """Triangles of one object of a file, as they are there.

    Attributes:
        name: What the object is called; parts of one name are one object.
        labels: The names that a class table may know it by, the most telling first.
        triangles: (T, 3, 3) float64 corners, in the file's axes and unit.
        colour: (T, 3, 3) float32 colour of each corner, 0-255.
        uv: (T, 3, 2) float32 places of the corners in the picture; None without one.
        picture: (H, W, 3) uint8 picture on it.
    """

    name: str
    labels: tuple[str, ...]
    triangles: NDArray[np.float64]
    colour: NDArray[np.float32]
    uv: NDArray[np.float32] | None = None
    picture: NDArray[np.uint8] | None = None

    def paint(self, row: NDArray[np.int64], weight: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the colours of points on the triangles.

        Args:
            row: (N,) int64 the triangle of each point.
            weight: (N, 3) float64 the shares of its corners, which add up to 1.

        Returns:
            (N, 3) uint8.
        """
        if self.picture is None or self.uv is None:
            colour = np.einsum("nk,nkc->nc", weight, self.colour[row])
            plain: NDArray[np.uint8] = np.clip(np.rint(colour), 0, 255).astype(np.uint8)
            return plain

        # a picture repeats beyond its border, and its first row is its upper one
        place = np.einsum("nk,nkc->nc", weight, self.uv[row]) % 1.0
        height, width = self.picture.shape[:2]
        column = np.minimum((place[:, 0] * width).astype(np.int64), width - 1)
        line = np.minimum(((1.0 - place[:, 1]) * height).astype(np.int64), height - 1)
        painted: NDArray[np.uint8] = self.picture[line, column]
        return painted


def is_mesh(path: Path) -> bool:
    """Tell whether a file is a mesh by its ending; of a PLY, whether its header promises faces."""
    if path.suffix.lower() != ".ply" or not path.is_file():
        return path.suffix.lower() in MESH_SUFFIXES
    with path.open("rb") as file:
        head = file.read(1 << 16).split(b"end_header")[0].split(b"\n")
    faces = [line.split()[-1] for line in head if line.startswith(b"element face")]
    labels = any(line.split()[-1:] == [b"semantic"] for line in head)
    return bool(faces) and faces[0].strip() != b"0" and not labels


def read_mesh(path: Path) -> list[MeshPart]:
    """Read the parts of a mesh, where its scene puts them.

    Args:
        path: What trimesh reads. Faces of more than three corners are cut into triangles.

    Returns:
        The parts, by name.

    Raises:
        InputError: It cannot be read, or has no triangles.
        OSError: It cannot be opened.
    """
    with told_of_damage(path, "export it again, or as GLB"):
        parts = [
            part for mesh, name, labels in _meshes_in(path) if (part := _part(mesh, name, labels))
        ]
    if not parts:
        raise InputError(path, "no triangles", "a mesh", "export it with its faces")
    return sorted(parts, key=lambda part: (part.name, part.labels))


@contextmanager
def told_of_damage(path: Path, remedy: str) -> Iterator[None]:
    """Have what trimesh raises for a damaged file be an error of one line, and it silent else.

    Corners that are no numbers are for the caller to refuse.

    Args:
        path: The mesh.
        remedy: What the user can do.

    Raises:
        InputError: It is damaged.
        OSError: It, or what belongs to it, cannot be opened.
    """
    logging.getLogger("trimesh").addHandler(_SILENT)
    try:
        with np.errstate(all="ignore"), catch_warnings(action="ignore"):
            filterwarnings("error", _TOO_LARGE)
            yield
    except (*_DAMAGE, Warning, OSError) as error:
        if isinstance(error, OSError) and error.filename is not None:  # no damage, but not there
            raise
        found = f"no mesh: {str(error) or type(error).__name__}"
        raise InputError(path, found, "GLB, OBJ, PLY or STL", remedy) from error


def check_corners(mesh: trimesh.Trimesh) -> None:
    """Refuse a mesh whose faces have corners that it has not, or corners that are no x y z.

    Raises:
        ValueError: Says which.
    """
    corners, vertices = np.asarray(mesh.faces), np.asarray(mesh.vertices)
    if corners.size and not (corners.min() >= 0 and corners.max() < len(vertices)):
        last = len(vertices) - 1
        raise ValueError(f"faces of corners {corners.min()} to {corners.max()}, not 0 to {last}")
    if vertices.shape[1:] != (3,):
        raise ValueError(f"vertices of shape {vertices.shape}, not x y z each")


def _meshes_in(path: Path) -> list[tuple[trimesh.Trimesh, str, tuple[str, ...]]]:
    """Return the meshes of a file, the objects they are of, and all their names."""
    try:
        import trimesh
    except ImportError as error:
        raise InputError(path, "a mesh", "trimesh", _NEEDS) from error

    path.open("rb").close()  # what cannot be opened says so itself
    is_obj = path.suffix.lower() == ".obj"
    if is_obj:
        text, resolver, objects = regroup_obj(path)
        scene = trimesh.load_scene(text, file_type="obj", resolver=resolver, process=False)
    else:
        objects = {}
        is_glb = path.suffix.lower() == ".glb"
        with open_bounded(path) if is_glb else nullcontext(path) as file:
            scene = trimesh.load_scene(file, file_type="glb" if is_glb else None, process=False)

    found = []
    for node in scene.graph.nodes_geometry:
        place, geometry = scene.graph[node]
        mesh = scene.geometry[geometry]
        if not isinstance(mesh, trimesh.Trimesh):
            continue
        visual = mesh.visual
        mesh = mesh.copy(include_visual=False)  # a copy of its pictures would be no use
        mesh.apply_transform(place)
        mesh.visual = visual
        own = objects.get(str(geometry))
        names = own or _names(scene, str(node), str(geometry), mesh, path)
        found.append((mesh, names[0], names))
    return found


def _names(
    scene: trimesh.Scene, node: str, geometry: str, mesh: trimesh.Trimesh, path: Path
) -> tuple[str, ...]:
    """Return the names of a mesh: of its node, of the mesh, of its material."""
    # a glTF node of several materials is one object of several meshes below it
    if mesh.metadata.get("from_gltf_primitive"):
        node = scene.graph.transforms.parents.get(node, node)
    material = getattr(getattr(mesh.visual, "material", None), "name", None)
    if len(scene.graph.nodes_geometry) == 1 and path.suffix.lower() not in (".glb", ".gltf"):
        return (path.stem, *([str(material)] if material else []))
    return tuple(dict.fromkeys(str(name) for name in (node, geometry, material) if name))


def _part(mesh: trimesh.Trimesh, name: str, labels: tuple[str, ...]) -> MeshPart | None:
    """Return a mesh as a part; None without triangles."""
    from trimesh.visual import ColorVisuals

    check_corners(mesh)
    triangles = np.asarray(mesh.triangles, np.float64)
    if not len(triangles):
        return None

    # corners in their own colours, or in that of a material
    faces, visual = np.asarray(mesh.faces), mesh.visual
    material = getattr(visual, "material", None)
    colour = np.full((len(faces), 3, 3), GREY, np.float32)
    if isinstance(visual, ColorVisuals) and visual.kind == "vertex":
        colour = np.asarray(visual.vertex_colors, np.float32)[faces, :3]
    elif isinstance(visual, ColorVisuals) and visual.kind == "face":
        colour[:] = np.asarray(visual.face_colors, np.float32)[:, None, :3]
    elif material is not None:
        colour[:] = np.asarray(material.main_color, np.float32)[:3]

    # a picture, no larger than points can show
    image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    uv = places_in_picture(mesh)
    if image is None or uv is None:
        return MeshPart(name, labels, triangles, colour)
    image = image.convert("RGBA").convert("RGB")
    image.thumbnail((_LARGEST, _LARGEST))
    return MeshPart(name, labels, triangles, colour, uv[faces], np.asarray(image, np.uint8))


def places_in_picture(mesh: trimesh.Trimesh) -> NDArray[np.float32] | None:
    """Return (V, 2) float32 where the corners of a mesh are in its picture; None if it has none."""
    uv: Any = getattr(mesh.visual, "uv", None)
    shape = np.shape(uv)
    if len(shape) != 2 or shape[0] != len(mesh.vertices) or shape[1] < 2:
        return None
    places: NDArray[np.float32] = np.nan_to_num(np.asarray(uv, np.float32)[:, :2])
    return places
