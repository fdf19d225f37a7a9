"""Points on surfaces: the triangles of a room in one mesh, and an even sample of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.synth.geometry.solids import Item, Part, area_of
from mcpseg_cli.synth.surfaces.noise import Floats
from mcpseg_cli.synth.surfaces.skins import barycentric
from mcpseg_cli.synth.surfaces.textures import PATTERNS, Surface, paint_surface

_STEPS = (0.7548776662466927, 0.5698402909980532, 0.7320508075688772)
"""Steps of a low-discrepancy sequence: R2 for places, the root of 3 for ranks."""
_ON_GLASS = 0.75  # of the points elsewhere; patches of it are lost later


@dataclass(frozen=True)
class Mesh:
    """All triangles of a room and the parts they belong to.

    Attributes:
        triangles: (F, 3, 3) float64, metres, map frame.
        normals: (F, 3) float64 unit vectors.
        part: (F,) int32 part of each triangle.
        own: (F,) int32 number of each triangle in its part.
        item: (P,) int32 object of each part.
        parts: The parts.
        is_closed: (P,) whether a part is a solid whose inside cannot be seen.
        is_glass: (P,) whether one can look through it.
    """

    triangles: NDArray[np.float64]
    normals: NDArray[np.float64]
    part: NDArray[np.int32]
    own: NDArray[np.int32]
    item: NDArray[np.int32]
    parts: tuple[Part, ...]
    is_closed: NDArray[np.bool_]
    is_glass: NDArray[np.bool_]


@dataclass(frozen=True)
class Samples:
    """Points on a mesh.

    Attributes:
        xyz: (N, 3) float32, metres, map frame.
        normals: (N, 3) float32 unit vectors.
        part: (N,) int32 part of the mesh.
        rank: (N,) float32, 0-1; those below any share of 1 are that share of the points, evenly
            spread.
        face: (N,) int32 triangle of the mesh.
    """

    xyz: Floats
    normals: Floats
    part: NDArray[np.int32]
    rank: Floats
    face: NDArray[np.int32]

    def chosen(self, which: NDArray[np.int64] | NDArray[np.bool_]) -> Samples:
        """Return some of the points."""
        xyz, normals, part = self.xyz[which], self.normals[which], self.part[which]
        return Samples(xyz, normals, part, self.rank[which], self.face[which])


def mesh_of(items: list[Item]) -> Mesh:
    """Put the triangles of all objects into one mesh; triangles without area are dropped."""
    parts = tuple(part for item in items for part in item.parts)
    item = np.repeat(np.arange(len(items), dtype=np.int32), [len(entry.parts) for entry in items])
    triangles = np.concatenate([part.triangles for part in parts])
    sizes = [len(entry.triangles) for entry in parts]
    part = np.repeat(np.arange(len(parts), dtype=np.int32), sizes)
    own = np.concatenate([np.arange(size, dtype=np.int32) for size in sizes])

    # normals as long as the area
    sides = triangles[:, 1:] - triangles[:, :1]
    areas = 0.5 * np.cross(sides[:, 0], sides[:, 1])
    size = np.linalg.norm(areas, axis=1)
    keep = size > 1e-9
    normals = areas[keep] / size[keep, None]

    # of a closed part the normals cancel each other out
    total = np.stack([np.bincount(part, areas[:, axis], len(parts)) for axis in range(3)], axis=1)
    is_closed = np.linalg.norm(total, axis=1) < 0.02 * np.bincount(part, size, len(parts))
    is_glass = np.array([entry.material.pattern == "glass" for entry in parts])
    kept = (triangles[keep], normals, part[keep], own[keep])
    return Mesh(*kept, item, parts, is_closed, is_glass)


def sample_mesh(mesh: Mesh, spacing: float, rng: np.random.Generator) -> Samples:
    """Spread points evenly over the surfaces: one for each square of ``spacing``, fewer on glass.

    Each triangle has its own stretch of a low-discrepancy sequence over its parallelogram, of which
    half falls into the triangle, so that there are no clumps and holes.
    """
    # how many each parallelogram gets, and which term of its sequence each of them is
    share = np.where(mesh.is_glass[mesh.part], _ON_GLASS, 1.0)
    expected = area_of(mesh.triangles) / spacing**2 * share
    counts = np.floor(2 * expected + rng.random(len(expected))).astype(np.int64)
    face = np.repeat(np.arange(len(counts)), counts)
    term = np.arange(len(face)) - (np.cumsum(counts) - counts)[face]
    start = rng.random((3, len(counts)))

    # shaken by up to a fifth of the spacing: rows of a lattice would show
    reach = np.linalg.norm(mesh.triangles[:, 1:] - mesh.triangles[:, :1], axis=2).T
    shake = np.minimum(0.2 * spacing / reach, 0.25)
    places = []
    for k in range(2):
        off = shake[k][face] * (rng.random(len(face), np.float32) * 2 - 1)
        places.append((start[k][face] + term * _STEPS[k] + off) % 1.0)
    first, second = places

    # those in the triangle
    kept = np.flatnonzero(first + second <= 1)
    face, first, second = face[kept], first[kept], second[kept]
    rank = ((start[2][face] + term[kept] * _STEPS[2]) % 1.0).astype(np.float32)
    corners = mesh.triangles[:, 0].astype(np.float32)
    sides = (mesh.triangles[:, 1:] - mesh.triangles[:, :1]).astype(np.float32)
    along, up = first.astype(np.float32)[:, None], second.astype(np.float32)[:, None]
    xyz = corners[face] + along * sides[face, 0] + up * sides[face, 1]
    normals = mesh.normals.astype(np.float32)[face]
    return Samples(xyz, normals, mesh.part[face], rank, face.astype(np.int32))


def paint_samples(mesh: Mesh, samples: Samples, rng: np.random.Generator) -> Floats:
    """Paint points with the materials of their parts, as under even white light.

    Args:
        mesh: The room.
        samples: The points.
        rng: Random numbers, for grain finer than the points.

    Returns:
        (N, 3) float32 colours, 0-255.
    """
    materials = [part.material for part in mesh.parts]
    base = np.array([material.base for material in materials], np.float32)[samples.part]
    accent = np.array([material.accent for material in materials], np.float32)[samples.part]
    _lay_skins(mesh, samples, base, accent)
    scale = np.array([material.scale for material in materials], np.float32)
    seed = np.array([(m.seed * 31 + k) & 0xFFFFFFFF for k, m in enumerate(materials)], np.uint32)

    # in the frame of their part
    grain = np.array([np.argmax(part.high - part.low) for part in mesh.parts], np.int8)
    middle = np.array([(part.low + part.high) / 2 for part in mesh.parts], np.float32)
    origin = np.array([part.origin for part in mesh.parts], np.float32)
    yaw = np.array([part.yaw for part in mesh.parts], np.float32)
    cosine, sine = np.cos(yaw)[samples.part], np.sin(yaw)[samples.part]
    xyz = _turned_back(samples.xyz - origin[samples.part], cosine, sine)
    normals = _turned_back(samples.normals, cosine, sine)

    # all points of one pattern at once
    pattern = np.array([PATTERNS.index(m.pattern) for m in materials], np.int8)[samples.part]
    colour = np.empty_like(xyz)
    for number, name in enumerate(PATTERNS):
        rows = np.flatnonzero(pattern == number)
        if len(rows):
            p, spots, faces = samples.part[rows], xyz[rows], normals[rows]
            surface = Surface(
                spots, faces, base[rows], accent[rows], scale[p], seed[p], grain[p], middle[p]
            )
            colour[rows] = paint_surface(name, surface, rng)
    return colour


def _lay_skins(mesh: Mesh, samples: Samples, base: Floats, accent: Floats) -> None:
    """Fill in the colours, (N, 3), of points on parts that have a skin."""
    has_skin = np.array([part.skin is not None for part in mesh.parts])
    rows = np.flatnonzero(has_skin[samples.part])
    if not len(rows):
        return
    face = samples.face[rows]
    weights = barycentric(samples.xyz[rows], mesh.triangles[face])

    # part by part; the second colour is as much darker as that of the material
    rows = rows[order := np.argsort(samples.part[rows], kind="stable")]
    face, weights = face[order], weights[order]
    parts, starts = np.unique(samples.part[rows], return_index=True)
    for number, span in zip(
        parts.tolist(), np.split(np.arange(len(rows)), starts[1:]), strict=True
    ):
        part = mesh.parts[number]
        assert part.skin is not None
        shown = part.skin.colours(mesh.own[face[span]], weights[span])
        darker = sum(part.material.accent) / max(sum(part.material.base), 1.0)
        base[rows[span]], accent[rows[span]] = shown, shown * np.float32(darker)


def _turned_back(vectors: Floats, cosine: Floats, sine: Floats) -> Floats:
    """Turn vectors from the map frame into the frames of their parts."""
    x, y = vectors[:, 0], vectors[:, 1]
    return np.column_stack([x * cosine + y * sine, y * cosine - x * sine, vectors[:, 2]])
