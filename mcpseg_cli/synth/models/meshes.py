"""Reading meshes: pieces of one material and one box, scaled to a size, in the frame of things."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.claims import open_bounded
from mcpseg_cli.formats.meshes import check_corners, places_in_picture, told_of_damage
from mcpseg_cli.synth.geometry.solids import Triangles, area_of
from mcpseg_cli.synth.models.boxes import cut
from mcpseg_cli.synth.surfaces.noise import Floats

if TYPE_CHECKING:
    import trimesh

_REMEDY = "take its class out of the table of models"
_FARTHEST = 1e6  # of a corner, in any unit
_LARGEST = 512  # pixels of a texture
_CLEAR = 0.05  # what is less opaque is left out
_TO_THINGS = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
"""From y up and the front to +z, to z up and the front to +y."""


@dataclass(frozen=True)
class Piece:
    """Triangles of one material that lie close together.

    Attributes:
        triangles: (F, 3, 3) float64, metres; the whole model stands on z = 0, its back at y = 0.
        material: Number of the material within the model.
        colour: (3,) float64 its mean colour, 0-255.
        opacity: 0-1.
        image: (H, W, 3) uint8 picture on it; None for the plain colour.
        uv: (F, 3, 2) float32 places of the corners in the picture.
    """

    triangles: Triangles
    material: int
    colour: NDArray[np.float64]
    opacity: float
    image: NDArray[np.uint8] | None = None
    uv: Floats | None = None


@lru_cache(maxsize=64)
def read_pieces(
    path: Path, rotation: tuple[float, ...], size: tuple[float, float, float]
) -> tuple[Piece, ...]:
    """Read a mesh.

    Args:
        path: What trimesh reads: OBJ, GLB and others; y up, its front to +z.
        rotation: (3, 3) by rows, how it is turned before; empty for not.
        size: Width, depth and height to scale it to, metres.

    Returns:
        Its pieces; together they fill the size.

    Raises:
        InputError: The mesh cannot be read or has no triangles.
    """
    path.open("rb").close()  # what cannot be opened says so itself
    with told_of_damage(path, _REMEDY):
        pieces = [_piece_of(mesh, number) for number, mesh in enumerate(_meshes_in(path))]
    pieces = [piece for piece in pieces if len(piece.triangles) and piece.opacity > _CLEAR]
    if not pieces:
        raise InputError(path, "no triangles", "a mesh", _REMEDY)

    # into the frame of things, and to its size
    turn = _TO_THINGS @ (np.array(rotation).reshape(3, 3) if rotation else np.eye(3))
    with np.errstate(over="ignore", invalid="ignore"):
        together = np.concatenate([piece.triangles for piece in pieces]) @ turn.T
    if not np.abs(together).max() < _FARTHEST:
        raise InputError(path, "corners that are no numbers, or far off", "a mesh", _REMEDY)
    low, high = together.min(axis=(0, 1)), together.max(axis=(0, 1))
    scale = np.array(size) / np.maximum(high - low, 1e-9)
    origin = np.array([(low[0] + high[0]) / 2, low[1], low[2]])
    together = (together - origin) * scale

    # in boxes, for collisions
    box = cut(together)
    ends = np.cumsum([len(piece.triangles) for piece in pieces])[:-1]
    found = []
    for piece, own, where in zip(
        pieces, np.split(together, ends), np.split(box, ends), strict=True
    ):
        has_area = area_of(own) > 1e-9
        for number in np.unique(where[has_area]).tolist():
            rows = np.flatnonzero((where == number) & has_area)
            uv = None if piece.uv is None else piece.uv[rows]
            found.append(
                Piece(own[rows], piece.material, piece.colour, piece.opacity, piece.image, uv)
            )
    return tuple(found)


def _meshes_in(path: Path) -> list[trimesh.Trimesh]:
    """Return the meshes of a file, one for each material, where its scene puts them."""
    import trimesh

    is_glb = path.suffix.lower() == ".glb"
    with open_bounded(path) if is_glb else nullcontext(path) as file:
        scene = trimesh.load_scene(file, file_type="glb" if is_glb else None, process=False)
    return [mesh for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh)]


def _piece_of(mesh: trimesh.Trimesh, number: int) -> Piece:
    """Return a mesh as one piece, as it is in the file."""
    check_corners(mesh)
    triangles = np.asarray(mesh.triangles, np.float64)
    material = getattr(mesh.visual, "material", None)
    picture = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    places = places_in_picture(mesh)
    colour = np.asarray(getattr(material, "main_color", (160, 160, 160, 255)), np.float64)
    opacity = _opacity_of(material, float(colour[3]) / 255 if len(colour) > 3 else 1.0)
    if picture is None or places is None:
        return Piece(triangles, number, colour[:3], opacity)

    # the picture, no larger than points can show
    picture = picture.convert("RGBA") if picture.mode in ("P", "LA", "PA") else picture
    picture = picture.convert("RGB")
    picture.thumbnail((_LARGEST, _LARGEST))
    image = np.asarray(picture, np.uint8)
    uv = places[np.asarray(mesh.faces)]
    return Piece(triangles, number, image.mean(axis=(0, 1)), opacity, image, uv)


def _opacity_of(material: object, alpha: float) -> float:
    """Return how opaque a material is, 0-1: of OBJ its ``d``, which trimesh hands on as text."""
    given = (getattr(material, "kwargs", None) or {}).get("d")
    return min(float(given[0]), 1.0) if given else alpha
