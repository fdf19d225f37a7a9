"""Walls of a room as lines: where they run, what is free along them, what doors need."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.synth.geometry.solids import Triangles
from mcpseg_cli.synth.plan import Opening, Room

Corners = NDArray[np.float64]
"""(2, 3) lowest and highest corner of a box, metres, map frame."""
Span = tuple[float, float]
"""From where to where, metres."""


def wall_of(room: Room, side: int) -> tuple[float, float, float, float]:
    """Return where a wall begins, ends and stands across, and which way is inwards (+1, -1)."""
    start, end = room.reach_of(side)
    across = 1 - side % 2
    inwards = 1.0 if side in (0, 3) else -1.0
    place = room.low[across] if inwards > 0 else room.high[across]
    return start, end, float(place), inwards


def at_wall(room: Room, side: int, along: Span, out: Span, up: Span) -> Corners:
    """Return the box at a wall: a stretch along it, distances from it into the room, heights."""
    _, _, place, inwards = wall_of(room, side)
    near, far = sorted((place + inwards * out[0], place + inwards * out[1]))
    if side % 2 == 0:
        return np.array([[along[0], near, up[0]], [along[1], far, up[1]]])
    return np.array([[near, along[0], up[0]], [far, along[1], up[1]]])


def meets(low: NDArray[np.float64], high: NDArray[np.float64], box: Corners) -> bool:
    """Return whether what lies between two corners reaches into a box."""
    return bool((low < box[1]).all() and (high > box[0]).all())


def free_stretches(
    room: Room, side: int, margin: float = 0.15, low: float = 0.0, high: float = 9.0
) -> list[Span]:
    """Return the stretches of a wall without openings between two heights or things before it."""
    start, end, _, _ = wall_of(room, side)
    axis = side % 2

    # openings, and columns or shafts
    openings = [o for o in room.openings if o.side == side and o.low < high and o.high > low]
    blocked = [(o.start - margin, o.end + margin) for o in openings]
    up = (low + 0.01, min(high, room.ceiling) - 0.01)
    strip = at_wall(room, side, (start, end), (0, 0.35), up)
    blocked += [
        (float(f.low[axis]) - margin, float(f.high[axis]) + margin)
        for f in room.fixtures
        if f.kind not in ("beam", "duct") and meets(f.low, f.high, strip)
    ]

    # what is left between them
    stretches = []
    cursor = start + margin
    for first, last in sorted(blocked):
        if first > cursor:
            stretches.append((cursor, float(first)))
        cursor = max(cursor, float(last))
    if end - margin > cursor:
        stretches.append((cursor, end - margin))
    return stretches


def leaf_line(
    room: Room, opening: Opening
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return hinge and far edge, (2,) each in the map frame, of every open leaf in this room."""
    if opening.kind != "door" or opening.leaf_deg <= 0:
        return []
    _, _, place, inwards = wall_of(room, opening.side)
    width = opening.end - opening.start
    length = (width / 2 if opening.is_double else width) - 0.09
    angle, base = np.radians(opening.leaf_deg), place + inwards * 0.05

    lines = []
    for at_end in (False, True) if opening.is_double else (opening.hinge_at_end,):
        hinge = opening.end - 0.05 if at_end else opening.start + 0.05
        along = (-1.0 if at_end else 1.0) * np.cos(angle) * length
        out = inwards * np.sin(angle) * length
        first, last = (hinge, base), (hinge + along, base + out)
        if opening.side % 2:
            first, last = first[::-1], last[::-1]
        lines.append((np.array(first), np.array(last)))
    return lines


def kept_clear(room: Room, opening: Opening) -> list[Corners]:
    """Return the boxes that must stay free: the way through a door and its open leaves."""
    if opening.kind == "window":
        return []
    boxes = [at_wall(room, opening.side, (opening.start, opening.end), (0.0, 0.9), (0.0, 2.2))]
    for first, last in leaf_line(room, opening):
        low, high = np.minimum(first, last) - 0.06, np.maximum(first, last) + 0.06
        boxes.append(np.array([[*low, 0.0], [*high, opening.high]]))
    return boxes


def on_wall(triangles: Triangles, room: Room, side: int) -> Triangles:
    """Move triangles from the frame of a wall to the map frame.

    In the frame of a wall x runs along it, y out of it into the room, z up.
    """
    _, _, place, inwards = wall_of(room, side)
    moved = triangles.copy()
    if side % 2 == 0:
        moved[..., 1] = place + inwards * triangles[..., 1]
    else:
        moved[..., 0] = place + inwards * triangles[..., 1]
        moved[..., 1] = triangles[..., 0]
    is_mirrored = side in (2, 3)
    return moved[:, ::-1] if is_mirrored else moved
