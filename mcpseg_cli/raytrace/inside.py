"""What is to be seen inside a mesh: floor plans are made of it, as of a scanned building.

A mesh has undersides of floors, feet of walls and roofs, which nobody inside ever sees, and which a
floor plan would take for the floor.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.building import Building
from mcpseg_cli.raytrace.rays import ScanPattern
from mcpseg_cli.raytrace.triangles import TriangleScene

_FLAT = 0.7  # of a normal that points up, from which a triangle can be stood on
_EYE = 1.0  # metres over it
_HEADROOM, _CEILING = 1.4, 12.0  # metres up to what must be free, and to what makes it a room
_SPACING = (0.8, 0.8, 0.4)  # metres between places that are looked from
_MOST_PLACES = 4000
_REACH = 15.0  # metres
_LIFT = 0.01  # metres, off the triangle a ray starts from


def look_around_inside(scene: TriangleScene, building: Building) -> NDArray[np.float32]:
    """Look around from places in the rooms of a mesh.

    Args:
        scene: Its triangles.
        building: One with a mesh.

    Returns:
        (N, 3) float32 what is in sight, metres, map frame; all points of the building where nobody
        can stand. Triangles that face up and have a ceiling are stood on; where there are none,
        those without a ceiling, or of either side, are.
    """
    facing = _facing_up(building)
    flat = building.xyz[np.abs(facing) > _FLAT]
    upper = building.xyz[facing > _FLAT]
    for points, highest in ((upper, _CEILING), (flat, _CEILING), (upper, np.inf), (flat, np.inf)):
        places = _places(scene, points, highest)
        if len(places):
            rays = ScanPattern(3.0, 3.0).directions()
            return np.concatenate([_look(scene, place, rays) for place in places])
    return building.xyz


def _facing_up(building: Building) -> NDArray[np.float64]:
    """Return how far up the triangle of each point faces, (N,) from -1 to 1."""
    assert building.mesh is not None
    corners = building.mesh.triangles.astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    up = normal[:, 2] / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)

    # points lie triangle after triangle
    counts = np.diff(building.mesh.points, append=len(building))
    facing: NDArray[np.float64] = np.repeat(up, counts)
    return facing


def _places(
    scene: TriangleScene, points: NDArray[np.float32], highest: float
) -> NDArray[np.float64]:
    """Return (P, 3) places at eye height over points with headroom, few enough."""
    spacing = np.array(_SPACING)
    while True:
        _, first = np.unique(np.floor(points / spacing).astype(np.int64), axis=0, return_index=True)
        if len(first) <= _MOST_PLACES:
            break
        spacing[:2] *= 1.5
    feet = points[np.sort(first)].astype(np.float64)

    # something overhead, but not at once
    up = np.broadcast_to([0.0, 0.0, 1.0], feet.shape)
    room = scene.measure(feet + _LIFT * up, up)
    return feet[(room >= _HEADROOM) & (room <= highest)] + _EYE * up[:1]


def _look(
    scene: TriangleScene, place: NDArray[np.float64], rays: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return the (N, 3) float32 ends of rays from one place."""
    distance = scene.measure(np.broadcast_to(place, rays.shape), rays)
    seen = distance <= _REACH
    ends: NDArray[np.float32] = (place + rays[seen] * distance[seen, None]).astype(np.float32)
    return ends
