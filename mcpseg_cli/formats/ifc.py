"""IFC: the elements of a building model, in metres, named by what they are."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.meshes import MeshPart
from mcpseg_cli.scan import GREY

_NEEDS = "needs ifcopenshell; expected it installed; run: pip install 'mcpseg[ifc]'"
_DOWN = 0.7  # cosine from which a side of a slab faces down
_NO_SURFACE = ("IfcOpeningElement", "IfcSpace", "IfcGrid", "IfcAnnotation", "IfcVirtualElement")


class Tint(Protocol):
    """A colour of ifcopenshell."""

    def r(self) -> float: ...  # noqa: D102
    def g(self) -> float: ...  # noqa: D102
    def b(self) -> float: ...  # noqa: D102


class Material(Protocol):
    """A material of ifcopenshell."""

    diffuse: Tint


class Geometry(Protocol):
    """A triangulation of ifcopenshell, flat."""

    verts: Sequence[float]
    faces: Sequence[int]
    materials: Sequence[Material]
    material_ids: Sequence[int]


class Shape(Protocol):
    """An element of ifcopenshell with its triangulation."""

    id: int
    type: str
    name: str | None
    geometry: Geometry


def read_ifc(path: Path) -> list[MeshPart]:
    """Read the elements of an IFC file.

    Args:
        path: IFC 2x3 or 4.

    Returns:
        A part for each element with a shape, z up, metres; its labels are its name, its type with
        the predefined kind (``IfcSlab.FLOOR``) and its type (``IfcSlab``).

    Raises:
        InputError: It cannot be read, or has no shape.
        OSError: It cannot be opened.
    """
    try:
        import ifcopenshell
        import ifcopenshell.geom
    except ImportError as error:
        raise InputError(path, "an IFC file", "ifcopenshell", _NEEDS) from error

    path.open("rb").close()  # what cannot be opened says so itself
    try:
        model = ifcopenshell.open(str(path))
    except (RuntimeError, ValueError, ifcopenshell.Error) as error:
        found = f"no IFC: {error}"
        raise InputError(path, found, "IFC 2x3 or 4", "export it again") from error

    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    iterator = ifcopenshell.geom.iterator(settings, model, 1)
    parts = []
    going = iterator.initialize()
    while going:
        shape = iterator.get()
        if shape.type not in _NO_SURFACE:
            parts += _parts(shape, model.by_id(shape.id))
        going = iterator.next()
    parts = [part for part in parts if len(part.triangles)]
    if not parts:
        raise InputError(path, "no element with a shape", "a building", "export it with geometry")
    return sorted(parts, key=lambda part: part.name)


def _parts(shape: Shape, element: object) -> list[MeshPart]:
    """Return an element as a part; a slab as two, what faces down apart."""
    geometry = shape.geometry
    vertices = np.array(geometry.verts, np.float64).reshape(-1, 3)
    faces = np.array(geometry.faces, np.int64).reshape(-1, 3)
    triangles, colours = vertices[faces], _colours(geometry, len(faces))
    kind, name = shape.type, shape.name or ""
    predefined = getattr(element, "PredefinedType", None)
    exact = f"{kind}.{predefined}" if predefined else ""
    labels = tuple(label for label in (name, exact, kind) if label)
    unique = f"{name or kind} #{shape.id}"
    if kind != "IfcSlab":
        return [MeshPart(unique, labels, triangles, colours)]

    # the ceiling of the storey below
    sides = triangles[:, 1:] - triangles[:, :1]
    normal = np.cross(sides[:, 0], sides[:, 1])
    down = normal[:, 2] < -_DOWN * np.linalg.norm(normal, axis=1)
    under = (name, "IfcSlab.UNDERSIDE", kind)
    return [
        MeshPart(unique, labels, triangles[~down], colours[~down]),
        MeshPart(f"{unique} underside", under, triangles[down], colours[down]),
    ]


def _colours(geometry: Geometry, num_faces: int) -> NDArray[np.float32]:
    """Return the (T, 3, 3) colours of the corners: those of the materials, grey without one."""
    palette = [
        [255.0 * value for value in (tint.r(), tint.g(), tint.b())]
        for tint in (material.diffuse for material in geometry.materials)
    ]
    ids = np.array(geometry.material_ids, np.int64)
    colours = np.array([*palette, [float(GREY)] * 3], np.float32)
    ids = ids if len(ids) == num_faces else np.full(num_faces, -1)
    return np.repeat(colours[ids][:, None], 3, axis=1)
