"""Ceilings with their lamps, vents and detectors."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
_HALF_SIZES: dict[LampKind, tuple[float, float]] = {
    "panel": (0.3, 0.3),
    "trough": (0.6, 0.3),
    "strip": (0.65, 0.06),
    "pendant": (0.2, 0.2),
    "globe": (0.16, 0.16),
    "downlight": (0.09, 0.09),
}
"""Half of a lamp's extent along the room and across it, metres."""
_CASING = Material("plain", (222, 220, 214), (200, 198, 192), 0.1, 5)
_VENT = Material("stripes", (206, 206, 202), (110, 110, 110), 0.05, 9)


@dataclass(frozen=True)
class _Lamp:
    """What the lamps of a room have in common: how far they hang down, and what they are of."""

    kind: LampKind
    drop: float
    metal: Material
    shade: Material


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
        items += _vents_and_detectors(room, taken, rng)
    return items


def _face(kind: CeilingKind, style: Style, rng: np.random.Generator) -> Material:
    """Draw the surface of a ceiling."""
    if kind == "acoustic":
        colour = pick_colour(((222, 220, 212), (208, 204, 192)), rng)
        return Material("acoustic", colour, (168, 166, 160), TILE, int(rng.integers(1 << 30)))
    if kind == "concrete":
        colour = pick_colour(((138, 136, 132), (164, 162, 156), (206, 204, 198)), rng)
        return paint(colour, rng, "concrete", 1.5)
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

    # what all of them look like
    metal = pick_metal(style, rng)
    shade = paint(pick_colour(style.accents + style.metal, rng), rng)
    drop = rng.uniform(0.4, 0.9) if room.ceiling > 2.7 else rng.uniform(0.2, 0.35)
    lamp = _Lamp(kind, drop, metal, shade)

    # in rows, where nothing else is under the ceiling
    items = []
    half = _half_size(room, kind)
    for x, y in _rows(room, kind, pitch):
        lit = glow if rng.random() > 0.08 else 0.0
        if not _fits(room, np.array([x, y]), half, taken):
            continue
        parts = _build(lamp, half, Material("plain", colour, colour, 0.1, 0, lit))
        hung = tuple(part.moved(x, y, room.ceiling) for part in parts)
        items.append(Item("clutter", hung, "lamp"))
    return items


def _half_size(room: Room, kind: LampKind) -> NDArray[np.float64]:
    """Return half of a lamp's extent in x and y; long ones lie along the room."""
    long, short = _HALF_SIZES[kind]
    along = int(np.argmax(room.high - room.low))
    return np.array([long, short] if along == 0 else [short, long])


def _rows(room: Room, kind: LampKind, pitch: float) -> list[list[float]]:
    """Return where lamps hang, x and y: evenly spread, those that replace tiles in their raster."""
    size = room.high - room.low
    counts = np.maximum(1, np.round(size / pitch)).astype(int)
    spots = []
    for cell in np.ndindex(*counts):
        spot = room.low + (np.array(cell) + 0.5) * size / counts
        if kind in ("panel", "trough"):
            spot = room.low + np.round((spot - room.low) / TILE) * TILE
        spots.append(spot.tolist())
    return spots


def _fits(
    room: Room,
    spot: NDArray[np.float64],
    half: NDArray[np.float64],
    taken: list[NDArray[np.float64]],
) -> bool:
    """Return whether a lamp is clear of walls and of what is taken, boxes seen from above."""
    low, high = spot - half, spot + half
    if (low < room.low + 0.05).any() or (high > room.high - 0.05).any():
        return False
    return not any((high + 0.05 > t[0]).all() and (low - 0.05 < t[1]).all() for t in taken)


def _build(lamp: _Lamp, half: NDArray[np.float64], bulb: Material) -> list[Part]:
    """Build a lamp that hangs from z = 0."""
    x, y = half.tolist()
    if lamp.kind in ("panel", "trough"):
        return _panel(x, y, 0.012 if lamp.kind == "panel" else 0.05, bulb)
    if lamp.kind == "strip":
        return _strip(x, y, lamp.drop * 0.6, lamp.metal, bulb)
    if lamp.kind == "pendant":
        return _pendant(lamp, bulb)
    if lamp.kind == "globe":
        glass = shifted(ball((0.15, 0.15, 0.12)), z=-0.14)
        return [part_of(cylinder(0.06, -0.03, 0, 10), lamp.metal), part_of(glass, bulb)]
    rim, lens = prism(circle(0.09, 10), -0.012, 0), prism(circle(0.07, 10), -0.014, -0.013)
    return [part_of(rim, _CASING), part_of(lens, bulb)]


def _panel(x: float, y: float, deep: float, bulb: Material) -> list[Part]:
    """Build a lamp in the place of a tile: a frame and what shines in it."""
    rim = 0.025
    frame = [
        box((-x, -y, -deep), (x, -y + rim, 0)),
        box((-x, y - rim, -deep), (x, y, 0)),
        box((-x, -y + rim, -deep), (-x + rim, y - rim, 0)),
        box((x - rim, -y + rim, -deep), (x, y - rim, 0)),
    ]
    lens = quad((-x + rim, y - rim, -deep * 0.6), (2 * (x - rim), 0, 0), (0, -2 * (y - rim), 0))
    return [part_of(solid, _CASING) for solid in frame] + [part_of(lens, bulb)]


def _strip(x: float, y: float, drop: float, metal: Material, bulb: Material) -> list[Part]:
    """Build a fluorescent lamp on two wires."""
    body = box((-x, -y, -drop - 0.06), (x, y, -drop))
    lens = quad((-x, y, -drop - 0.062), (2 * x, 0, 0), (0, -2 * y, 0))
    wires = [
        tube((sx * 0.8, sy * 0.8, -drop), (sx * 0.8, sy * 0.8, 0), 0.004, 4)
        for sx, sy in ((-x, -y), (x, y))
    ]
    return [part_of(body, _CASING), part_of(lens, bulb), *(part_of(wire, metal) for wire in wires)]


def _pendant(lamp: _Lamp, bulb: Material) -> list[Part]:
    """Build a lamp with a conical shade on a cord."""
    rings = []
    for radius, z in ((0.04, -lamp.drop + 0.18), (0.2, -lamp.drop)):
        ring = np.column_stack([circle(radius, 12), np.full(12, z)])
        rings.append(np.concatenate([ring, ring[:1]]))
    shade, cord = surface(np.stack(rings)), tube((0, 0, -lamp.drop + 0.17), (0, 0, 0), 0.005, 4)
    light = ball((0.06, 0.06, 0.06), (0, 0, -lamp.drop + 0.07))
    return [part_of(shade, lamp.shade), part_of(light, bulb), part_of(cord, lamp.metal)]


def _vents_and_detectors(
    room: Room, taken: list[NDArray[np.float64]], rng: np.random.Generator
) -> list[Item]:
    """Put vents, smoke detectors and sprinklers on the ceiling."""
    white = paint((224, 222, 216), rng)
    most = 2 + int(np.prod(room.high - room.low) / 15)
    items = []
    for _ in range(int(rng.integers(1, most + 1))):
        # somewhere where nothing is
        spot = rng.uniform(room.low + 0.4, room.high - 0.4)
        if any((spot + 0.35 > t[0]).all() and (spot - 0.35 < t[1]).all() for t in taken):
            continue
        taken.append(np.stack([spot - 0.3, spot + 0.3]))

        if rng.random() < 0.4:
            solid, face = box((-0.28, -0.28, -0.012), (0.28, 0.28, 0)), _VENT
        elif rng.random() < 0.6:
            solid, face = prism(circle(0.06, 8), -0.05, 0), white
        else:
            solid, face = prism(circle(0.02, 6), -0.07, 0), white
        placed = shifted(solid, float(spot[0]), float(spot[1]), room.ceiling)
        items.append(Item("clutter", (part_of(placed, face),)))
    return items
