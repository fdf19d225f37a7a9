"""OBJ files regrouped for trimesh, which tells their materials apart but mixes up their objects."""

from __future__ import annotations

from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from trimesh.resolvers import FilePathResolver

_MATERIALS = "regrouped.mtl"


def regroup_obj(path: Path) -> tuple[StringIO, FilePathResolver, dict[str, tuple[str, ...]]]:
    """Give every pair of object and material a material of its own.

    Args:
        path: The OBJ file. Its objects are the names behind ``o``, or behind ``g`` where there is
            no ``o``.

    Returns:
        The text with other materials, what finds these and the pictures, and for each new material
        the names of its object and of the material it had.

    Raises:
        OSError: It cannot be read.
    """
    from trimesh.resolvers import FilePathResolver

    lines = path.read_text(encoding="utf-8", errors="replace").replace("\\\n", " ").splitlines()
    keyword = "o" if any(line.startswith("o ") for line in lines) else "g"
    libraries = [line[7:].strip() for line in lines if line.startswith("mtllib ")]

    # a new material before the first face of each pair
    text, pairs = [f"mtllib {_MATERIALS}"], dict[tuple[str, str], str]()
    name, material, current = path.stem, "", ""
    for line in lines:
        word, _, rest = line.strip().partition(" ")
        if word == keyword:
            name = rest.strip() or path.stem
        elif word == "usemtl":
            material = rest.strip()
        if word in ("o", "g", "usemtl", "mtllib"):
            continue
        if word == "f":
            group = pairs.setdefault((name, material), f"group_{len(pairs)}")
            if group != current:
                text.append(f"usemtl {group}")
                current = group
        text.append(line)

    known = _read_materials([path.parent / library for library in libraries])
    copies = [
        "\n".join([f"newmtl {group}", *known.get(material, ())])
        for (_, material), group in pairs.items()
    ]

    class Resolver(FilePathResolver):
        """Finds the new materials, and pictures beside the file."""

        def get(self, name: str) -> bytes:
            if name == _MATERIALS:
                return ("\n".join(copies) + "\n").encode()
            found: bytes = super().get(name)
            return found

    names = {group: tuple(filter(None, pair)) for pair, group in pairs.items()}
    return StringIO("\n".join(text) + "\n"), Resolver(str(path)), names


def _read_materials(libraries: list[Path]) -> dict[str, list[str]]:
    """Return the lines of each material; libraries that are not there have none."""
    materials: dict[str, list[str]] = {}
    lines: list[str] = []
    for library in libraries:
        if not library.is_file():
            continue
        for line in library.read_text(encoding="utf-8", errors="replace").splitlines():
            word, _, rest = line.strip().partition(" ")
            if word == "newmtl":
                lines = materials.setdefault(rest.strip(), [])
            else:
                lines.append(line)
    return materials
