"""Shapes that furniture is made of: boxes, cushions, bent sheets, tubes, turned things, leaves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.synth.geometry.solids import Item, Part, Triangles, area_of, part_of, surface
from mcpseg_cli.synth.surfaces.materials import Material

Points = NDArray[np.float64]
"""Points in rows, or numbers in general."""

_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], bool)
_QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
_FACES = np.array([face for a, b, c, d in _QUADS for face in ((a, b, c), (a, c, d))])


def boxes(lows: object, highs: object) -> Triangles:
    """Return the 12 N triangles of N upright boxes between corners, (N, 3) each."""
    low = np.asarray(lows, np.float64).reshape(-1, 1, 3)
    high = np.asarray(highs, np.float64).reshape(-1, 1, 3)
    return _faces(np.where(_CORNERS, high, low))


def slanted(bottom: object, top: object, size: Sequence[float]) -> Triangles:
    """Return N bars from one point to another, (N, 3) each: splayed legs.

    ``size`` is that of their rectangular section in x and y.
    """
    first = np.asarray(bottom, np.float64).reshape(-1, 3)
    ends = np.stack([first, np.asarray(top, np.float64).reshape(-1, 3)])
    half = np.array([size[0] / 2, size[1] / 2])
    corners = np.empty((ends.shape[1], 8, 3))
    for row, (right, back, up) in enumerate(_CORNERS):
        corners[:, row] = ends[int(up)]
        corners[:, row, :2] += np.where([right, back], half, -half)
    return _faces(corners)


def lathe(profile: object, sides: int = 12, x: float = 0.0, y: float = 0.0) -> Triangles:
    """Return a turned solid about an upright axis.

    ``profile`` is (K, 2) radius and height, from the bottom up; it faces outwards.
    """
    outline = np.asarray(profile, np.float64)
    radius, height = outline[:, 0], outline[:, 1]
    angle = np.linspace(2 * np.pi, 0, sides + 1)
    ring_x, ring_y = np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))
    rise = np.outer(height, np.ones(sides + 1))
    return surface(np.stack([x + ring_x, y + ring_y, rise], axis=-1))


def rod(
    radius: float, low: float, high: float, x: float = 0.0, y: float = 0.0, sides: int = 8
) -> Triangles:
    """Return an upright cylinder with ends."""
    return lathe([(0, low), (radius, low), (radius, high), (0, high)], sides, x, y)


def cushion(
    low: Sequence[float], high: Sequence[float], round_plan: float = 0.35, round_side: float = 0.4
) -> Triangles:
    """Return a rounded block between two corners.

    How round it is in plan and seen from the side: 0 makes its edges sharp, 1 makes it an
    ellipsoid.
    """
    first, last = np.asarray(low, np.float64), np.asarray(high, np.float64)
    up = np.linspace(-np.pi / 2, np.pi / 2, 8)
    around = np.linspace(2 * np.pi, 0, 21)
    ring, rise = _power(np.cos(up), round_side), _power(np.sin(up), round_side)

    # a ball of half a metre's radius, stretched
    x = np.outer(ring, _power(np.cos(around), round_plan))
    y = np.outer(ring, _power(np.sin(around), round_plan))
    z = np.outer(rise, np.ones(len(around)))
    grid = np.stack([x, y, z], axis=-1)
    return surface((first + last) / 2 + grid * (last - first) / 2)


def slab(outline: Points, low: float, high: float) -> Triangles:
    """Return a convex outline, (K, 2) counter-clockwise, drawn up between two heights."""
    ring = np.concatenate([outline, outline[:1]])
    below = np.column_stack([ring, np.full(len(ring), low)])
    above = np.column_stack([ring, np.full(len(ring), high)])
    side = surface(np.stack([above, below]))

    # fans over the top and under the bottom
    hub, foot = np.tile(above[0], (len(ring) - 3, 1)), np.tile(below[0], (len(ring) - 3, 1))
    lid = np.stack([hub, above[1:-2], above[2:-1]], axis=1)
    floor = np.stack([foot, below[2:-1], below[1:-2]], axis=1)
    return np.concatenate([side, lid, floor])


def rectangle(width: float, depth: float, radius: float = 0.0, steps: int = 3) -> Points:
    """Return the outline of a rectangle about the origin, corners rounded, counter-clockwise."""
    size = np.array([width, depth])
    if radius <= 0:
        outline: Points = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * size / 2
        return outline

    # an arc about the middle of each corner
    middle = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (size / 2 - radius)
    angle = np.linspace(0, np.pi / 2, steps + 1) + (np.pi / 2) * np.arange(4)[:, None]
    arcs = middle[:, None] + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return arcs.reshape(-1, 2)


def ellipse(width: float, depth: float, power: float = 1.0, sides: int = 24) -> Points:
    """Return the outline of an ellipse about the origin; a power below 1 makes it squarer."""
    angle = np.arange(sides) * (2 * np.pi / sides)
    x, y = width / 2 * _power(np.cos(angle), power), depth / 2 * _power(np.sin(angle), power)
    return np.column_stack([x, y])


def shell(grid: Points, thickness: float) -> Triangles:
    """Return a bent sheet: (A, B, 3) points of its middle, given a thickness, with edges."""
    along, across = np.gradient(grid, axis=0), np.gradient(grid, axis=1)
    normal = np.cross(along, across)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
    front, back = grid + normal * (thickness / 2), grid - normal * (thickness / 2)
    edge = surface(np.stack([_border(front), _border(back)]))
    return np.concatenate([surface(front), surface(back[:, ::-1]), edge])


def pipe(path: object, radius: float, sides: int = 6) -> Triangles:
    """Return a round tube along points, (K, 3): frames, cables."""
    line = np.asarray(path, np.float64)
    heading = np.gradient(line, axis=0)
    heading /= np.maximum(np.linalg.norm(heading, axis=1, keepdims=True), 1e-9)

    # a direction across the line, carried along so that the tube does not twist
    side = np.empty_like(line)
    before = np.cross(heading[0], [0.0, 0.0, 1.0] if abs(heading[0, 2]) < 0.9 else [1.0, 0.0, 0.0])
    for row, axis in enumerate(heading):
        before = before - axis * (before @ axis)
        before /= max(float(np.sqrt(before @ before)), 1e-9)
        side[row] = before

    angle = np.linspace(2 * np.pi, 0, sides + 1)[None, :, None]
    ring = np.cos(angle) * side[:, None] + np.sin(angle) * np.cross(heading, side)[:, None]
    return surface(line[:, None] + radius * ring)


def bend(corners: object, radius: float, steps: int = 3) -> Points:
    """Return a path through corners, (K, 3), each cut short by an arc of about ``radius``."""
    line = np.asarray(corners, np.float64)
    path = [line[:1]]
    share = np.linspace(0, 1, steps + 1)[:, None]
    for before, corner, after in zip(line[:-2], line[1:-1], line[2:], strict=True):
        first = corner + _shortened(before - corner, radius)
        last = corner + _shortened(after - corner, radius)
        path.append((1 - share) ** 2 * first + 2 * share * (1 - share) * corner + share**2 * last)
    return np.concatenate([*path, line[-1:]])


def leaves(base: Points, tip: Points, width: float, droop: float = 0.0) -> Triangles:
    """Return N leaves from base to tip, (N, 3) each, arched by ``droop`` of their length."""
    axis = tip - base
    length = np.linalg.norm(axis, axis=1, keepdims=True)
    side = np.cross(axis, [0.0, 0.0, 1.0])
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
    middle = base + 0.55 * axis + [0.0, 0.0, 1.0] * (length * droop)
    left, right = middle - side * width / 2, middle + side * width / 2
    halves = [(base, right, left), (left, right, tip)]
    return np.concatenate([np.stack(half, axis=1) for half in halves])


def lean(triangles: Triangles, angle: float) -> Triangles:
    """Return the triangles turned about the y axis, radians: +x goes down."""
    cosine, sine = np.cos(angle), np.sin(angle)
    moved: Triangles = triangles @ np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]]).T
    return moved


def solid(material: Material, *triangles: Triangles) -> Part:
    """Make one part of shapes in one material, less triangles without area."""
    together = np.concatenate(triangles)
    return part_of(together[area_of(together) > 1e-9], material)


def stand(name: str, parts: Sequence[Part], home: str = "") -> Item:
    """Make an object of parts, shifted so that it stands on z = 0, its back at y = 0, x centred."""
    low = np.min([part.triangles.min(axis=(0, 1)) for part in parts], axis=0)
    high = np.max([part.triangles.max(axis=(0, 1)) for part in parts], axis=0)
    shift = np.array([-(low[0] + high[0]) / 2, -low[1], -low[2]])
    return Item(name, tuple(part.moved(*shift.tolist()) for part in parts), home)


def _faces(corners: Points) -> Triangles:
    """Return the triangles of boxes with corners (N, 8, 3), ordered as _CORNERS."""
    faces: Triangles = corners[:, _FACES].reshape(-1, 3, 3)
    return faces


def _power(values: Points, power: float) -> Points:
    """Raise to a power, keeping the sign."""
    raised: Points = np.sign(values) * np.abs(values) ** power
    return raised


def _shortened(vector: Points, length: float) -> Points:
    """Return the vector cut to a length, at most half of its own."""
    norm = max(float(np.linalg.norm(vector)), 1e-9)
    return vector * (min(length, norm / 2) / norm)


def _border(grid: Points) -> Points:
    """Return the closed line of points around a grid."""
    return np.concatenate([grid[:, 0], grid[-1, 1:], grid[-2::-1, -1], grid[0, -2::-1]])
