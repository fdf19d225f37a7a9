"""Doors and windows as seen from inside a room: frames, leaves, panes, sills, blinds and curtains."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.synth.building.fittings import leaf_line, wall_of
from mcpseg_cli.synth.geometry.solids import (
    Item,
    Part,
    Triangles,
    box,
    part_of,
    quad,
    surface,
    tube,
)
from mcpseg_cli.synth.plan import Opening, Room
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import (
    DoorKind,
    Shade,
    Style,
    paint,
    pick_colour,
    pick_metal,
    pick_wood,
)


def on_wall(triangles: Triangles, room: Room, side: int) -> Triangles:
    """Move triangles from the frame of a wall (along it, out of it into the room, up) to the map frame."""
    _, _, place, inwards = wall_of(room, side)
    moved = triangles.copy()
    if side % 2 == 0:
        moved[..., 1] = place + inwards * triangles[..., 1]
    else:
        moved[..., 0] = place + inwards * triangles[..., 1]
        moved[..., 1] = triangles[..., 0]
    is_mirrored = side in (2, 3)
    return moved[:, ::-1] if is_mirrored else moved


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
    face, trim = _door_materials(kind, style, rng)
    return [
        Item(
            "door",
            tuple(_frame(room, opening, trim) + _leaves(room, opening, kind, face, style, rng)),
        )
        for opening in room.openings
        if opening.kind == "door"
    ]


def _door_materials(
    kind: DoorKind, style: Style, rng: np.random.Generator
) -> tuple[Material, Material]:
    """Draw the surfaces of leaf and frame."""
    if kind == "steel":
        steel = paint(pick_colour(style.accents, rng), rng, "plain")
        return steel, replace(steel, seed=steel.seed + 1)
    if kind == "painted":
        colour = pick_colour(style.accents if rng.random() < 0.5 else ((226, 224, 216),), rng)
        return paint(colour, rng), paint((220, 218, 210) if rng.random() < 0.6 else colour, rng)
    wood = pick_wood(style, rng)
    if rng.random() < 0.5:
        return wood, paint(pick_colour(((70, 66, 62), (222, 220, 212), (120, 118, 114)), rng), rng)
    return wood, replace(wood, seed=wood.seed + 1)


def _frame(room: Room, opening: Opening, trim: Material) -> list[Part]:
    """Line an opening: jambs and head, and the casing around them on the wall."""
    a, b, top, deep = opening.start, opening.end, opening.high, -opening.depth
    low, high = room.reach_of(opening.side)
    left, right = max(a - 0.06, low), min(b + 0.06, high)
    boxes = [
        box((a, deep, 0), (a + 0.04, 0.014, top)),
        box((b - 0.04, deep, 0), (b, 0.014, top)),
        box((a + 0.04, deep, top - 0.04), (b - 0.04, 0.014, top)),
        box((left, 0, 0), (a, 0.014, top)),
        box((b, 0, 0), (right, 0.014, top)),
        box((left, 0, top), (right, 0.014, min(top + 0.06, room.ceiling))),
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
    parts = []
    for hinge, far in lines:
        along = far - hinge
        yaw = float(np.arctan2(along[1], along[0]))
        _, _, _, inwards = wall_of(room, opening.side)
        turned = inwards * float(np.cos(yaw) if opening.side % 2 == 0 else -np.sin(yaw))
        faces = (-1.0, 1.0) if opening.leaf_deg > 0 else (float(np.sign(turned)),)
        leaf = _leaf(
            float(np.linalg.norm(along)), opening.high - 0.045, kind, (face, metal), faces, rng
        )
        parts += [part.moved(x=float(hinge[0]), y=float(hinge[1]), yaw=yaw) for part in leaf]
    return parts


def _closed_lines(
    room: Room, opening: Opening
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return hinge and far edge of the leaves of a closed door, which stands in the middle of its wall."""
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
    """Build a leaf from its hinge along +x, 4 cm thick, with handles on the faces (+1, -1) given."""
    face, metal = materials
    glass = Material("glass", (90, 102, 106), (150, 164, 168), 0.5, face.seed)
    parts = []
    if kind == "glazed":
        stile = rng.uniform(0.08, 0.14)
        solids = [
            box((0, -0.02, 0.01), (stile, 0.02, top)),
            box((length - stile, -0.02, 0.01), (length, 0.02, top)),
            box((stile, -0.02, 0.01), (length - stile, 0.02, 0.25)),
            box((stile, -0.02, top - stile), (length - stile, 0.02, top)),
        ]
        parts = [part_of(solid, face) for solid in solids]
        parts.append(
            part_of(
                quad((stile, 0, 0.25), (length - 2 * stile, 0, 0), (0, 0, top - stile - 0.25)),
                glass,
            )
        )
    else:
        parts = [part_of(box((0, -0.02, 0.01), (length, 0.02, top)), face)]
    if kind == "panelled":
        for z0, z1 in ((0.2, 0.9), (1.1, top - 0.2)):
            parts.append(
                part_of(
                    box((0.13, -0.028, z0), (length - 0.13, 0.028, z1)),
                    replace(face, seed=face.seed + 2),
                )
            )
    elif kind != "glazed" and length > 0.6 and rng.random() < 0.35:
        x0 = length - rng.uniform(0.3, 0.4)
        parts.append(
            part_of(box((x0, -0.023, rng.uniform(0.9, 1.2)), (x0 + 0.15, 0.023, top - 0.2)), glass)
        )
    if rng.random() < 0.3:
        parts.append(part_of(box((0.03, -0.023, 0.03), (length - 0.03, 0.023, 0.25)), metal))
    for face_y in handles:
        x, y = length - 0.07, face_y * 0.02
        parts.append(
            part_of(
                box((x - 0.02, min(y, y * 1.4), 0.94), (x + 0.02, max(y, y * 1.4), 1.14)), metal
            )
        )
        parts.append(part_of(tube((x, y, 1.05), (x, y + face_y * 0.05, 1.05), 0.01), metal))
        parts.append(
            part_of(
                tube(
                    (x + 0.01, y + face_y * 0.05, 1.05), (x - 0.12, y + face_y * 0.05, 1.05), 0.011
                ),
                metal,
            )
        )
    return parts


def build_windows(
    room: Room, style: Style, daylight: float, rng: np.random.Generator
) -> list[Item]:
    """Build the windows of a room, with what hangs before them.

    Args:
        room: The room.
        style: The building's.
        daylight: How bright it is outside; 1 is as bright as white paper under the lamps.
        rng: Random numbers.

    Returns:
        A ``window`` for each opening of that kind and ``clutter`` for blinds and curtains, in the
        map frame.
    """
    colour = pick_colour(((228, 226, 220), (70, 72, 74), (150, 152, 154), (110, 84, 60)), rng)
    trim = paint(colour, rng, "plain" if rng.random() < 0.7 else "metal")
    shades, shares = list(style.shades), list(style.shades.values())
    shade = shades[int(rng.choice(len(shades), p=shares))]
    cloth = paint(
        pick_colour(style.walls + style.accents, rng),
        rng,
        "weave" if shade == "curtain" else "plain",
    )
    glass = _glass(daylight, rng)
    items = []
    for opening in room.openings:
        if opening.kind != "window":
            continue
        items.append(_window(room, opening, trim, glass, rng))
        if shade != "none" and opening.glazing != "interior":
            items.append(_shade(room, opening, shade, cloth, rng))
    return items


def _glass(daylight: float, rng: np.random.Generator) -> Material:
    """Draw what panes to the street show: too bright an outside in a third of the rooms, else a dark bluish one."""
    shift = rng.normal(0, 12) + rng.normal(0, 5, 3)
    if rng.random() < 1 / 3:
        red, green, blue = np.clip(np.array([188, 206, 226]) + shift, 90, 255).tolist()
        return Material("glass", (red, green, blue), (214, 222, 226), 0.6, glow=daylight)
    red, green, blue = np.clip(np.array([84, 98, 114]) + shift, 30, 160).tolist()
    return Material(
        "glass", (red, green, blue), (red + 60, green + 64, blue + 66), 0.6, glow=0.35 * daylight
    )


def _window(
    room: Room, opening: Opening, trim: Material, outside: Material, rng: np.random.Generator
) -> Item:
    """Build frame, mullions, panes and sill of one window."""
    a, b, low, high = opening.start, opening.end, opening.low, opening.high
    is_inside = opening.glazing == "interior"
    back, front = -opening.depth, -opening.depth + (0.03 if is_inside else 0.06)
    rim = rng.uniform(0.035, 0.07)
    bars = [
        ((a, low), (a + rim, high)),
        ((b - rim, low), (b, high)),
        ((a + rim, low), (b - rim, low + rim)),
        ((a + rim, high - rim), (b - rim, high)),
    ]
    count = max(1, round((b - a) / rng.uniform(0.7, 1.5)))
    edges = np.linspace(a + rim, b - rim, count + 1)
    bars += [((x - rim / 2, low + rim), (x + rim / 2, high - rim)) for x in edges[1:-1].tolist()]
    if high - low > 1.0 and rng.random() < 0.5:
        z = low + (high - low) * rng.uniform(0.25, 0.75)
        step = rim / 2 + 0.001
        bars += [
            ((x0 + step, z - rim / 2), (x1 - step, z + rim / 2))
            for x0, x1 in itertools.pairwise(edges)
        ]
    parts = [
        part_of(on_wall(box((p[0], back, p[1]), (q[0], front, q[1])), room, opening.side), trim)
        for p, q in bars
    ]
    inside = Material("glass", (96, 106, 110), (158, 168, 172), 0.6)
    glass = replace(inside if is_inside else outside, seed=int(rng.integers(1 << 30)))
    plane = (back + front) / 2
    pane = quad((b - rim, plane, low + rim), (a - b + 2 * rim, 0, 0), (0, 0, high - low - 2 * rim))
    parts.append(part_of(on_wall(pane, room, opening.side), glass))
    if opening.glazing in ("single", "band"):
        out = rng.uniform(0.01, 0.06)
        sill = box((a, front, low - 0.03), (b, out, low + 0.004))
        parts.append(part_of(on_wall(sill, room, opening.side), replace(trim, seed=trim.seed + 1)))
    return Item("window", tuple(parts))


def _shade(
    room: Room, opening: Opening, shade: Shade, cloth: Material, rng: np.random.Generator
) -> Item:
    """Hang a blind or a curtain before a window."""
    a, b, low, high = opening.start + 0.03, opening.end - 0.03, opening.low, opening.high
    out = 0.09 - opening.depth if opening.depth > 0.13 else 0.03
    if shade == "curtain":
        out, low = (0.05, max(low - 0.1, 0.03)) if opening.glazing != "full" else (0.05, 0.03)
        width = (b - a) * rng.uniform(0.12, 0.4)
        spans = [(a, a + width), (b - width, b)]
    else:
        low = high - (high - low) * float(np.clip(rng.beta(0.8, 0.8), 0.1, 0.97))
        spans = [(a, b)]
    parts = [
        part_of(
            on_wall(box((a, out - 0.02, high - 0.05), (b, out + 0.03, high)), room, opening.side),
            cloth,
        )
    ]
    for first, last in spans:
        along = np.linspace(
            first, last, max(int((last - first) / 0.03), 2) if shade == "curtain" else 2
        )
        up = np.linspace(
            low, high - 0.05, max(int((high - low) / 0.025), 3) if shade == "slats" else 2
        )
        x, z = np.meshgrid(along, up, indexing="ij")
        y = np.full(x.shape, out)
        if shade == "curtain":
            y = y + 0.03 * np.sin(x * 2 * np.pi / 0.14) + 0.01 * np.sin(7 * x)
        elif shade == "slats":
            y = y + 0.014 * np.where(np.arange(len(up)) % 2, 1, -1)
        parts.append(
            part_of(on_wall(surface(np.stack([x, y, z], axis=-1)), room, opening.side), cloth)
        )
    return Item("clutter", tuple(parts))
