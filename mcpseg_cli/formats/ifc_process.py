"""What reads an IFC, in a process of its own: damaged ones may end ifcopenshell where it stands.

``python -P ifc_process.py FILE MOST_BYTES`` writes the elements to stdout as an NPZ of plain
arrays, or ends with status 3 and says what is wrong. Imports nothing of mcpseg: it starts at once.
"""

from __future__ import annotations

import io
import json
import os
import sys
from collections.abc import Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

REFUSED = 3
"""Exit status of a process that says on stdout what is wrong with the file."""


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


def main(path: str, most_bytes: int) -> int:
    """Read a file with bounded memory; return the exit status."""
    answer = os.dup(1)  # libraries may write to stdout
    os.dup2(2, 1)
    _bound_memory(most_bytes)
    status = 0
    try:
        data = _packed(list(_elements(path)))
    except Exception as error:
        said = " ".join(str(error).split()) or type(error).__name__
        status, data = REFUSED, said.encode(errors="replace")
    with open(answer, "wb") as file:  # noqa: PTH123
        file.write(data)
    return status


def _bound_memory(most_bytes: int) -> None:
    """Have no more memory than that, where the system can see to it."""
    if sys.platform != "win32":
        import resource

        _, most = resource.getrlimit(resource.RLIMIT_DATA)
        bound = most_bytes if most == resource.RLIM_INFINITY else min(most, most_bytes)
        resource.setrlimit(resource.RLIMIT_DATA, (bound, most))


def _elements(path: str) -> Iterator[tuple[list[object], list[NDArray[np.generic]]]]:
    """Give id, type, name and predefined kind of each element with a shape, and its arrays."""
    import ifcopenshell
    import ifcopenshell.geom

    model = ifcopenshell.open(path)
    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    iterator = ifcopenshell.geom.iterator(settings, model, 1)
    going = iterator.initialize()
    while going:
        shape: Shape = iterator.get()
        predefined = getattr(model.by_id(shape.id), "PredefinedType", None)
        texts = [shape.id, shape.type, shape.name or "", predefined and str(predefined)]
        yield texts, _arrays(shape.geometry)
        going = iterator.next()


def _arrays(geometry: Geometry) -> list[NDArray[np.generic]]:
    """Return corners, triangles, colours 0 to 1, and which colour each triangle has."""
    tints = [material.diffuse for material in geometry.materials]
    palette = [(tint.r(), tint.g(), tint.b()) for tint in tints]
    return [
        np.array(geometry.verts, np.float64).reshape(-1, 3),
        np.array(geometry.faces, np.int64).reshape(-1, 3),
        np.array(palette, np.float64).reshape(-1, 3),
        np.array(geometry.material_ids, np.int64),
    ]


def _packed(elements: list[tuple[list[object], list[NDArray[np.generic]]]]) -> bytes:
    """Pack all elements one after another, with how many rows each has of each array."""
    texts = np.frombuffer(json.dumps([text for text, _ in elements]).encode(), np.uint8)
    columns = list(zip(*(arrays for _, arrays in elements), strict=True))
    counts = np.array([[len(array) for array in arrays] for _, arrays in elements], np.int64)
    file = io.BytesIO()
    np.savez(file, texts, counts, *(np.concatenate(column) for column in columns))
    return file.getvalue()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2])))
