"""Doors as seen from inside a room: frames and leaves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.synth.building.walls import leaf_line, on_wall, wall_of
from mcpseg_cli.synth.geometry.solids import Item, Part, box, part_of, quad, tube
from mcpseg_cli.synth.models.built_in import door_model
from mcpseg_cli.synth.plan import Opening, Room
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import (
    DoorKind,
    Style,
    paint,
    pick_colour,
    pick_metal,
    pick_wood,
)

_CASING = 0.06  # width of what covers the gap between frame and wall, metres
_HALF = 0.02  # half of a leaf's thickness
_KICK = 0.25  # height of the plate at its foot


def build_doors(room: Room, style: Style, rng: np.random.Generator) -> list[Item]:
    """Build the doors of a room: the frame, and the leaf where it hangs on this side.

    Args:
        room: The room.
        style: The building's.
        rng: Random numbers.

    Returns:
        An object ``door`` for each opening of that kind, in the map frame.
    """
    kind = style.doors[int(rng.integers(len(style.doors)))]
    face, trim = _materials(kind, style, rng)
    doors = []
    for opening in room.openings:
        if opening.kind != "door":
            continue
        model = door_model(room, opening, style, rng)
        if model is not None:
            doors.append(model)
        else:
            frame = _frame(room, opening, trim)
            doors.append(Item("door", (*frame, *_leaves(room, opening, kind, face, style, rng))))
    return doors


def _materials(kind: DoorKind, style: Style, rng: np.random.Generator) -> tuple[Material, Material]:
    """Draw the surfaces of leaf and frame."""
    if kind == "steel":
        steel = paint(pick_colour(style.accents, rng), rng, "plain")
        return steel, replace(steel, seed=steel.seed + 1)
    if kind == "painted":
        colour = pick_colour(style.accents if rng.random() < 0.5 else ((226, 224, 216),), rng)
        return paint(colour, rng), paint((220, 218, 210) if rng.random() < 0.6 else colour, rng)

    # wood, its frame painted or of the same
    wood = pick_wood(style, rng)
    if rng.random() < 0.5:
        return wood, paint(pick_colour(((70, 66, 62), (222, 220, 212), (120, 118, 114)), rng), rng)
    return wood, replace(wood, seed=wood.seed + 1)


def _frame(room: Room, opening: Opening, trim: Material) -> list[Part]:
    """Line an opening: jambs and head, and the casing around them on the wall."""
    a, b, top, deep = opening.start, opening.end, opening.high, -opening.depth
    low, high = room.reach_of(opening.side)
    left, right = max(a - _CASING, low), min(b + _CASING, high)
    boxes = [
        box((a, deep, 0), (a + 0.04, 0.014, top)),
        box((b - 0.04, deep, 0), (b, 0.014, top)),
        box((a + 0.04, deep, top - 0.04), (b - 0.04, 0.014, top)),
        box((left, 0, 0), (a, 0.014, top)),
        box((b, 0, 0), (right, 0.014, top)),
        box((left, 0, top), (right, 0.014, min(top + _CASING, room.ceiling))),
    ]
    return [part_of(on_wall(solid, room, opening.side), trim) for solid in boxes]


def _leaves(
    room: Room,
    opening: Opening,
    kind: DoorKind,
    face: Material,
    style: Style,
    rng: np.random.Generator,
) -> list[Part]:
    """Hang the leaf, or both of a double door."""
    if opening.leaf_deg < 0:
        return []
    lines = leaf_line(room, opening) or _closed_lines(room, opening)
    metal = pick_metal(style, rng)
    _, _, _, inwards = wall_of(room, opening.side)

    parts = []
    for hinge, far in lines:
        along = far - hinge
        length, yaw = float(np.linalg.norm(along)), float(np.arctan2(along[1], along[0]))

        # handles on both faces, or on the one that a closed door shows
        turned = inwards * float(np.cos(yaw) if opening.side % 2 == 0 else -np.sin(yaw))
        faces = (-1.0, 1.0) if opening.leaf_deg > 0 else (float(np.sign(turned)),)
        leaf = _leaf(length, opening.high - 0.045, kind, (face, metal), faces, rng)
        parts += [part.moved(x=float(hinge[0]), y=float(hinge[1]), yaw=yaw) for part in leaf]
    return parts


def _closed_lines(
    room: Room, opening: Opening
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return hinge and far edge of the leaves of a closed door, in the middle of its wall."""
    _, _, place, inwards = wall_of(room, opening.side)
    a, b, middle = opening.start + 0.04, opening.end - 0.04, (opening.start + opening.end) / 2
    single = (b, a) if opening.hinge_at_end else (a, b)
    spans = [(a, middle - 0.004), (b, middle + 0.004)] if opening.is_double else [single]

    across = place - inwards * (opening.depth - 0.02)
    order = -1 if opening.side % 2 else 1
    return [
        (np.array([first, across][::order]), np.array([last, across][::order]))
        for first, last in spans
    ]


def _leaf(
    length: float,
    top: float,
    kind: DoorKind,
    materials: tuple[Material, Material],
    handles: tuple[float, ...],
    rng: np.random.Generator,
) -> list[Part]:
    """Build a leaf from its hinge along +x, 4 cm thick, with handles on some faces (+1, -1)."""
    face, metal = materials
    glass = Material("glass", (90, 102, 106), (150, 164, 168), 0.5, face.seed)
    if kind == "glazed":
        parts = _glazed(length, top, rng.uniform(0.08, 0.14), face, glass)
    else:
        parts = [part_of(box((0, -_HALF, 0.01), (length, _HALF, top)), face)]

    # panels, or at times a narrow pane
    if kind == "panelled":
        raised = replace(face, seed=face.seed + 2)
        for z0, z1 in ((0.2, 0.9), (1.1, top - 0.2)):
            parts.append(part_of(box((0.13, -0.028, z0), (length - 0.13, 0.028, z1)), raised))
    elif kind != "glazed" and length > 0.6 and rng.random() < 0.35:
        x0, z0 = length - rng.uniform(0.3, 0.4), rng.uniform(0.9, 1.2)
        parts.append(part_of(box((x0, -0.023, z0), (x0 + 0.15, 0.023, top - 0.2)), glass))

    if rng.random() < 0.3:
        parts.append(part_of(box((0.03, -0.023, 0.03), (length - 0.03, 0.023, _KICK)), metal))
    return parts + [part for side in handles for part in _handle(length - 0.07, side, metal)]


def _glazed(length: float, top: float, stile: float, face: Material, glass: Material) -> list[Part]:
    """Build a leaf that is a pane in a frame."""
    frame = [
        box((0, -_HALF, 0.01), (stile, _HALF, top)),
        box((length - stile, -_HALF, 0.01), (length, _HALF, top)),
        box((stile, -_HALF, 0.01), (length - stile, _HALF, _KICK)),
        box((stile, -_HALF, top - stile), (length - stile, _HALF, top)),
    ]
    pane = quad((stile, 0, _KICK), (length - 2 * stile, 0, 0), (0, 0, top - stile - _KICK))
    return [part_of(solid, face) for solid in frame] + [part_of(pane, glass)]


def _handle(x: float, side: float, metal: Material) -> list[Part]:
    """Build plate, neck and lever of a handle on the face at +y or -y."""
    y = side * _HALF
    out = y + side * 0.05
    plate = box((x - 0.02, min(y, y * 1.4), 0.94), (x + 0.02, max(y, y * 1.4), 1.14))
    neck = tube((x, y, 1.05), (x, out, 1.05), 0.01)
    lever = tube((x + 0.01, out, 1.05), (x - 0.12, out, 1.05), 0.011)
    return [part_of(solid, metal) for solid in (plate, neck, lever)]
