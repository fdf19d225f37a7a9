"""IFC: the elements of a building model, in metres, named by what they are."""

from __future__ import annotations

import importlib.util
import io
import json
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import ifc_process
from mcpseg_cli.formats.claims import MOST_TIMES
from mcpseg_cli.formats.meshes import MeshPart
from mcpseg_cli.scan import GREY

_NEEDS = "needs ifcopenshell; expected it installed; run: pip install 'mcpseg[ifc]'"
_EXPORT = "export it again"
_SPARE = 2 << 30  # bytes of memory that any file may take
_DOWN = 0.7  # cosine from which a side of a slab faces down
_NO_SURFACE = ("IfcOpeningElement", "IfcSpace", "IfcGrid", "IfcAnnotation", "IfcVirtualElement")


@dataclass(frozen=True)
class _Element:
    """An element with its triangulation.

    Attributes:
        number: In the file.
        kind: Its type.
        name: What it is called; may be empty.
        predefined: Its predefined kind; None without one.
        vertices: (V, 3) float64, metres.
        faces: (T, 3) int64 corners of its triangles.
        palette: (P, 3) float64 colours, 0 to 1.
        materials: (T,) int64 colour of each triangle, -1 for none; of another length: unknown.
    """

    number: int
    kind: str
    name: str
    predefined: str | None
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    palette: NDArray[np.float64]
    materials: NDArray[np.int64]


def read_ifc(path: Path) -> list[MeshPart]:
    """Read the elements of an IFC file, in a process of its own.

    Args:
        path: IFC 2x3 or 4.

    Returns:
        A part for each element with a shape, z up, metres; its labels are its name, its type with
        the predefined kind (``IfcSlab.FLOOR``) and its type (``IfcSlab``).

    Raises:
        InputError: It cannot be read, has no shape, or takes more than 64 times its bytes and 2 GiB
            of memory.
        OSError: It cannot be opened.
    """
    if importlib.util.find_spec("ifcopenshell") is None:
        raise InputError(path, "an IFC file", "ifcopenshell", _NEEDS)
    path.open("rb").close()  # what cannot be opened says so itself

    parts = []
    for element in _elements(path, _read_apart(path)):
        if element.kind not in _NO_SURFACE and len(element.faces):
            parts += _parts(path, element)
    parts = [part for part in parts if len(part.triangles)]
    if not parts:
        raise InputError(path, "no element with a shape", "a building", "export it with geometry")
    return sorted(parts, key=lambda part: part.name)


def _read_apart(path: Path) -> bytes:
    """Have another process read a file; return what it answers.

    Raises:
        InputError: The file cannot be read, or ended that process.
    """
    most_bytes = MOST_TIMES * path.stat().st_size + _SPARE
    command = [sys.executable, "-P", ifc_process.__file__, str(path.absolute()), str(most_bytes)]
    ended = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True)
    if ended.returncode == 0:
        return ended.stdout
    if ended.returncode == ifc_process.REFUSED:
        found = f"no IFC: {ended.stdout.decode(errors='replace')[:200]}"
    else:
        found = f"no IFC: ifcopenshell ends at it (status {ended.returncode})"
    raise InputError(path, found, "IFC 2x3 or 4", _EXPORT)


def _elements(path: Path, answer: bytes) -> Iterator[_Element]:
    """Iterate over the elements that the other process found."""
    try:
        with np.load(io.BytesIO(answer), allow_pickle=False) as packed:
            texts, counts, *columns = (packed[f"arr_{number}"] for number in range(len(packed)))
        ends = counts.reshape(-1, 4).cumsum(axis=0)
        for row, (number, kind, name, predefined) in enumerate(json.loads(texts.tobytes())):
            start = ends[row - 1] if row else np.zeros(4, np.int64)
            own = [column[start[k] : ends[row, k]] for k, column in enumerate(columns)]
            yield _Element(int(number), str(kind), str(name), predefined, *own)
    except (ValueError, LookupError, TypeError, OSError, EOFError) as error:
        raise InputError(path, f"no IFC: {error}", "IFC 2x3 or 4", _EXPORT) from error


def _parts(path: Path, element: _Element) -> list[MeshPart]:
    """Return an element as a part; a slab as two, what faces down apart."""
    faces, count = element.faces, len(element.vertices)
    if faces.min() < 0 or faces.max() >= count:
        found = f"#{element.number} with corners {faces.min()} to {faces.max()} of {count}"
        raise InputError(path, found, "a shape", _EXPORT)
    triangles, colours = element.vertices[faces], _colours(element)
    kind, name = element.kind, element.name
    exact = f"{kind}.{element.predefined}" if element.predefined else ""
    labels = tuple(label for label in (name, exact, kind) if label)
    unique = f"{name or kind} #{element.number}"
    if kind != "IfcSlab":
        return [MeshPart(unique, labels, triangles, colours)]

    # the ceiling of the storey below
    with np.errstate(over="ignore", invalid="ignore"):  # corners that are no numbers: refused later
        sides = triangles[:, 1:] - triangles[:, :1]
        normal = np.cross(sides[:, 0], sides[:, 1])
        down = normal[:, 2] < -_DOWN * np.linalg.norm(normal, axis=1)
    under = (name, "IfcSlab.UNDERSIDE", kind)
    return [
        MeshPart(unique, labels, triangles[~down], colours[~down]),
        MeshPart(f"{unique} underside", under, triangles[down], colours[down]),
    ]


def _colours(element: _Element) -> NDArray[np.float32]:
    """Return the (T, 3, 3) colours of the corners: those of the materials, grey without one."""
    num_faces, num_colours = len(element.faces), len(element.palette)
    colours = np.concatenate([255.0 * element.palette, np.full((1, 3), GREY)]).astype(np.float32)
    ids = element.materials
    ids = ids if len(ids) == num_faces else np.full(num_faces, -1)
    ids = np.where((ids >= 0) & (ids < num_colours), ids, -1)
    return np.repeat(colours[ids][:, None], 3, axis=1)
