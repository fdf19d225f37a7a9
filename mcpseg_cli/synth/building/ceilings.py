"""Ceilings with their lamps, vents and detectors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.synth.geometry.solids import (
    Item,
    Part,
    ball,
    box,
    circle,
    cylinder,
    part_of,
    prism,
    quad,
    shifted,
    surface,
    tube,
)
from mcpseg_cli.synth.plan import CeilingKind, Room
from mcpseg_cli.synth.surfaces.materials import Material, kelvin_colour
from mcpseg_cli.synth.surfaces.styles import (
    LampKind,
    Style,
    paint,
    pick_colour,
    pick_metal,
    pick_wood,
)

TILE = 0.6
"""Edge of a suspended ceiling's tile, metres."""


def build_ceiling(
    room: Room, style: Style, rng: np.random.Generator, finish: np.random.Generator
) -> list[Item]:
    """Build the ceiling of a room and what hangs from it.

    Args:
        room: The room.
        style: The building's.
        rng: Random numbers.
        finish: Those that the surface and the kind of lamp are drawn from.

    Returns:
        One ``ceiling`` and ``clutter`` for lamps (the burning ones glow), in public buildings also
        for vents and detectors, in the map frame.
    """
    (x0, y0), (x1, y1) = room.low, room.high
    sheet = quad((x0, y1, room.ceiling), (x1 - x0, 0, 0), (0, y0 - y1, 0))
    items = [Item("ceiling", (part_of(sheet, _face(room.ceiling_kind, style, finish)),))]
    taken = [np.stack([f.low[:2], f.high[:2]]) for f in room.fixtures]
    items += _lamps(room, style, taken, rng, finish)
    if style.is_public:
        items += _small(room, taken, rng)
    return items


def _face(kind: CeilingKind, style: Style, rng: np.random.Generator) -> Material:
    """Draw the surface of a ceiling."""
    if kind == "acoustic":
        return Material(
            "acoustic",
            pick_colour(((222, 220, 212), (208, 204, 192)), rng),
            (168, 166, 160),
            TILE,
            int(rng.integers(1 << 30)),
        )
    if kind == "concrete":
        return paint(
            pick_colour(((138, 136, 132), (164, 162, 156), (206, 204, 198)), rng),
            rng,
            "concrete",
            1.5,
        )
    if kind == "boards":
        return replace(pick_wood(style, rng), scale=rng.uniform(0.08, 0.16))
    return paint(pick_colour(((232, 230, 224), (216, 212, 200)), rng), rng, "plaster", 0.8)


def _lamps(
    room: Room,
    style: Style,
    taken: list[NDArray[np.float64]],
    rng: np.random.Generator,
    finish: np.random.Generator,
) -> list[Item]:
    """Hang lamps in rows; a room may have them all off, and single ones fail."""
    kind = style.lamps[int(finish.integers(len(style.lamps)))]
    colour = kelvin_colour(finish.uniform(*style.kelvin))
    glow = 0.0 if rng.random() < style.lamps_off else rng.uniform(0.8, 2.5)
    pitch = rng.uniform(*style.lamp_pitch) if kind != "downlight" else rng.uniform(1.2, 1.8)
    size = room.high - room.low
    counts = np.maximum(1, np.round(size / pitch)).astype(int)
    metal = pick_metal(style, rng)
    shade = paint(pick_colour(style.accents + style.metal, rng), rng)
    drop = rng.uniform(0.4, 0.9) if room.ceiling > 2.7 else rng.uniform(0.2, 0.35)
    items = []
    for i in range(counts[0]):
        for j in range(counts[1]):
            spot = room.low + (np.array([i, j]) + 0.5) * size / counts
            if kind in ("panel", "trough"):
                spot = room.low + np.round((spot - room.low) / TILE) * TILE
            lit = glow if rng.random() > 0.08 else 0.0
            along = int(np.argmax(size))
            half = _half_size(kind, along)
            if (spot - half < room.low + 0.05).any() or (spot + half > room.high - 0.05).any():
                continue
            if any(
                (spot + half + 0.05 > t[0]).all() and (spot - half - 0.05 < t[1]).all()
                for t in taken
            ):
                continue
            bulb = Material("plain", colour, colour, 0.1, 0, lit)
            parts = _lamp(kind, half, drop, metal, shade, bulb)
            items.append(
                Item(
                    "clutter",
                    tuple(p.moved(float(spot[0]), float(spot[1]), room.ceiling) for p in parts),
                )
            )
    return items


def _half_size(kind: LampKind, along: int) -> NDArray[np.float64]:
    """Return half of a lamp's extent in x and y."""
    long, short = {
        "panel": (0.3, 0.3),
        "trough": (0.6, 0.3),
        "strip": (0.65, 0.06),
        "pendant": (0.2, 0.2),
        "globe": (0.16, 0.16),
        "downlight": (0.09, 0.09),
    }[kind]
    return np.array([long, short] if along == 0 else [short, long])


def _lamp(
    kind: LampKind,
    half: NDArray[np.float64],
    drop: float,
    metal: Material,
    shade: Material,
    bulb: Material,
) -> list[Part]:
    """Build a lamp that hangs from z = 0."""
    x, y = half.tolist()
    white = Material("plain", (222, 220, 214), (200, 198, 192), 0.1, 5)
    if kind in ("panel", "trough"):
        rim, deep = 0.025, 0.012 if kind == "panel" else 0.05
        frame = [
            box((-x, -y, -deep), (x, -y + rim, 0)),
            box((-x, y - rim, -deep), (x, y, 0)),
            box((-x, -y + rim, -deep), (-x + rim, y - rim, 0)),
            box((x - rim, -y + rim, -deep), (x, y - rim, 0)),
        ]
        lens = quad((-x + rim, y - rim, -deep * 0.6), (2 * (x - rim), 0, 0), (0, -2 * (y - rim), 0))
        return [part_of(solid, white) for solid in frame] + [part_of(lens, bulb)]
    if kind == "strip":
        body = box((-x, -y, -drop * 0.6 - 0.06), (x, y, -drop * 0.6))
        lens = quad((-x, y, -drop * 0.6 - 0.062), (2 * x, 0, 0), (0, -2 * y, 0))
        wires = [
            tube(
                (sx * x * 0.8, sy * y * 0.8, -drop * 0.6), (sx * x * 0.8, sy * y * 0.8, 0), 0.004, 4
            )
            for sx, sy in ((-1, -1), (1, 1))
        ]
        return [
            part_of(body, white),
            part_of(lens, bulb),
            *(part_of(wire, metal) for wire in wires),
        ]
    if kind == "pendant":
        cone = np.stack([circle(0.04, 12), circle(0.2, 12)])
        ring = [
            np.column_stack([outline, np.full(12, z)])
            for outline, z in zip(cone, (-drop + 0.18, -drop), strict=True)
        ]
        closed = [np.concatenate([r, r[:1]]) for r in ring]
        return [
            part_of(surface(np.stack(closed)), shade),
            part_of(ball((0.06, 0.06, 0.06), (0, 0, -drop + 0.07)), bulb),
            part_of(tube((0, 0, -drop + 0.17), (0, 0, 0), 0.005, 4), metal),
        ]
    if kind == "globe":
        return [
            part_of(cylinder(0.06, -0.03, 0, 10), metal),
            part_of(shifted(ball((0.15, 0.15, 0.12)), z=-0.14), bulb),
        ]
    return [
        part_of(prism(circle(0.09, 10), -0.012, 0), white),
        part_of(np.ascontiguousarray(prism(circle(0.07, 10), -0.014, -0.013)), bulb),
    ]


def _small(room: Room, taken: list[NDArray[np.float64]], rng: np.random.Generator) -> list[Item]:
    """Put vents, smoke detectors and sprinklers on the ceiling."""
    white = paint((224, 222, 216), rng)
    vent = Material("stripes", (206, 206, 202), (110, 110, 110), 0.05, 9)
    items = []
    for _ in range(int(rng.integers(1, 3 + int(np.prod(room.high - room.low) / 15)))):
        spot = rng.uniform(room.low + 0.4, room.high - 0.4)
        if any((spot + 0.35 > t[0]).all() and (spot - 0.35 < t[1]).all() for t in taken):
            continue
        taken.append(np.stack([spot - 0.3, spot + 0.3]))
        if rng.random() < 0.4:
            solid, face = box((-0.28, -0.28, -0.012), (0.28, 0.28, 0)), vent
        elif rng.random() < 0.6:
            solid, face = prism(circle(0.06, 8), -0.05, 0), white
        else:
            solid, face = prism(circle(0.02, 6), -0.07, 0), white
        items.append(
            Item(
                "clutter",
                (part_of(shifted(solid, float(spot[0]), float(spot[1]), room.ceiling), face),),
            )
        )
    return items
