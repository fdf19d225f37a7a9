"""Solids that buildings and furniture are made of: triangles with a material and their box."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.skins import Skin

Triangles = NDArray[np.float64]
"""(F, 3, 3) corners of triangles, metres."""


@dataclass(frozen=True)
class Part:
    """One solid of an object, in one material.

    Attributes:
        triangles: (F, 3, 3) float64, metres, in the frame it has been moved to.
        material: What its surface looks like.
        low: (3,) lowest corner of its box in its own frame, metres; the box is what collisions are
            checked with.
        high: (3,) highest corner.
        origin: (3,) where its own frame lies, metres.
        yaw: How its own frame is turned about z, radians.
        skin: A picture on its triangles, whose colours the material's pattern then varies; None for
            the material's own colours.
    """

    triangles: Triangles
    material: Material
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    origin: NDArray[np.float64]
    yaw: float = 0.0
    skin: Skin | None = None

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> Part:
        """Return the part turned about the z axis of the frame it stands in, then shifted."""
        turn = _turn(yaw)
        shift = np.array([x, y, z])
        triangles, origin = self.triangles @ turn.T + shift, turn @ self.origin + shift
        return replace(self, triangles=triangles, origin=origin, yaw=self.yaw + yaw)


@dataclass(frozen=True)
class Item:
    """One object: its class and the parts it is made of.

    Attributes:
        name: Class, one of the 13 of S3DIS.
        parts: At least one part.
        home: Finer class, one of ``HOME_CLASSES``; empty where it is the same.
    """

    name: str
    parts: tuple[Part, ...]
    home: str = ""

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, yaw: float = 0.0) -> Item:
        """Return the object turned about the z axis of the frame it stands in, then shifted."""
        return replace(self, parts=tuple(part.moved(x, y, z, yaw) for part in self.parts))

    def bounds(self) -> NDArray[np.float64]:
        """Return the (2, 3) lowest and highest corner of all parts, metres."""
        corners = np.concatenate([part.triangles.reshape(-1, 3) for part in self.parts])
        return np.stack([corners.min(axis=0), corners.max(axis=0)])


def part_of(triangles: Triangles, material: Material) -> Part:
    """Make a part from triangles in its own frame."""
    corners = triangles.reshape(-1, 3)
    return Part(triangles, material, corners.min(axis=0), corners.max(axis=0), np.zeros(3))


def box(low: Sequence[float], high: Sequence[float]) -> Triangles:
    """Return the 12 triangles of an upright box, facing outwards."""
    xs, ys, zs = ((low[axis], high[axis]) for axis in range(3))
    corners = np.array([[x, y, z] for x in xs for y in ys for z in zs])
    quads = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return np.array([corners[list(face)] for face in faces], np.float64)


def quad(corner: Sequence[float], along: Sequence[float], up: Sequence[float]) -> Triangles:
    """Return the two triangles of a parallelogram; it faces ``along`` x ``up``."""
    start, first, second = (np.asarray(vector, np.float64) for vector in (corner, along, up))
    far = start + first + second
    return np.array([[start, start + first, far], [start, far, start + second]])


def prism(outline: NDArray[np.float64], low: float, high: float) -> Triangles:
    """Return a convex outline, (K, 2) counter-clockwise, drawn up from ``low`` to ``high``."""
    return frustum(outline, outline, low, high)


def frustum(
    bottom: NDArray[np.float64], top: NDArray[np.float64], low: float, high: float
) -> Triangles:
    """Return the solid between two convex outlines, (K, 2) counter-clockwise each, with ends."""
    below = np.column_stack([bottom, np.full(len(bottom), low)])
    above = np.column_stack([top, np.full(len(top), high)])
    faces = [[below[0], below[k + 1], below[k]] for k in range(1, len(below) - 1)]
    faces += [[above[0], above[k], above[k + 1]] for k in range(1, len(above) - 1)]
    for k in range(len(below)):
        after = (k + 1) % len(below)
        faces += [[below[k], below[after], above[after]], [below[k], above[after], above[k]]]
    return np.array(faces, np.float64)


def circle(radius: float, sides: int = 12, x: float = 0.0, y: float = 0.0) -> NDArray[np.float64]:
    """Return the (sides, 2) corners of a regular polygon, counter-clockwise."""
    angle = np.arange(sides) * (2 * np.pi / sides)
    return np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)])


def cylinder(radius: float, low: float, high: float, sides: int = 12) -> Triangles:
    """Return an upright cylinder about the z axis."""
    return prism(circle(radius, sides), low, high)


def ball(radii: Sequence[float], centre: Sequence[float] = (0, 0, 0), rings: int = 6) -> Triangles:
    """Return an ellipsoid of ``rings`` x ``2 rings`` faces."""
    polar = np.linspace(0, np.pi, rings + 1)
    around = np.linspace(0, 2 * np.pi, 2 * rings + 1)
    x, y = np.outer(np.sin(polar), np.cos(around)), np.outer(np.sin(polar), np.sin(around))
    z = np.outer(np.cos(polar), np.ones(len(around)))
    grid = np.stack([x, y, z], axis=-1)
    return surface(grid * np.asarray(radii, np.float64) + np.asarray(centre, np.float64))


def surface(grid: NDArray[np.float64]) -> Triangles:
    """Return the triangles over a grid of points, (A, B, 3): cushions, curtains, anything bent."""
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    halves: Triangles = np.stack([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)])
    return halves.reshape(-1, 3, 3)


def tube(start: Sequence[float], end: Sequence[float], radius: float, sides: int = 6) -> Triangles:
    """Return a round bar between two points, without ends."""
    first, last = np.asarray(start, np.float64), np.asarray(end, np.float64)
    axis = (last - first) / max(float(np.linalg.norm(last - first)), 1e-9)
    side = np.cross(axis, [0.0, 0.0, 1.0] if abs(axis[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    angle = np.linspace(0, 2 * np.pi, sides + 1)[:, None]
    ring = radius * (np.cos(angle) * side + np.sin(angle) * np.cross(axis, side))
    return surface(np.stack([last + ring, first + ring]))


def shifted(triangles: Triangles, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Triangles:
    """Return the triangles moved."""
    moved: Triangles = triangles + np.array([x, y, z])
    return moved


def turned(triangles: Triangles, yaw: float) -> Triangles:
    """Return the triangles turned about the z axis, radians."""
    moved: Triangles = triangles @ _turn(yaw).T
    return moved


def tilted(triangles: Triangles, pitch: float) -> Triangles:
    """Return the triangles turned about the x axis, radians: +y goes up."""
    cosine, sine = np.cos(pitch), np.sin(pitch)
    moved: Triangles = triangles @ np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]]).T
    return moved


def area_of(triangles: Triangles) -> NDArray[np.float64]:
    """Return the (F,) areas of triangles, square metres."""
    sides = triangles[:, 1:] - triangles[:, :1]
    areas: NDArray[np.float64] = 0.5 * np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return areas


def _turn(yaw: float) -> NDArray[np.float64]:
    """Return the (3, 3) rotation about z."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
