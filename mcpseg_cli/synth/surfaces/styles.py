"""Styles: what the furniture and surfaces of one building have in common, as S3DIS's six areas differ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mcpseg_cli.synth.plan import CeilingKind, RoomKind
from mcpseg_cli.synth.surfaces.materials import Colour, Material, Pattern

LampKind = Literal["panel", "strip", "pendant", "downlight", "globe", "trough"]
DoorKind = Literal["wood", "painted", "steel", "glazed", "panelled"]
Glazing = Literal["single", "band", "full"]
CorridorShape = Literal["straight", "L", "U", "T", "loop"]


@dataclass(frozen=True)
class Style:
    """Colours and habits of one building.

    Attributes:
        name: What the style is called.
        wood: Colours of wood.
        upholstery: Colours of seats and sofas.
        metal: Colours of metal frames.
        plastic: Colours of plastic shells and casings.
        fabric: Patterns that seats and sofas come in.
        table_tops: Patterns of table tops.
        chairs: Chair designs in use, by name; the catalogue of chairs knows them.
        tables: Table designs in use.
        tidiness: 0 for rooms full of clutter to 1 for bare ones.
        walls: Paint of walls.
        accents: Paint of feature walls, of painted doors and of steel.
        wall_patterns: Surfaces of walls; the first is the usual one.
        floors: Floors of rooms.
        hall_floors: Floors of corridors, WCs and storage rooms.
        ceilings: Kinds of ceiling.
        lamps: Kinds of lamp.
        glazing: Kinds of window to the street.
        doors: Kinds of door leaf.
        height: Lowest and highest ceiling, metres.
        glass_walls: Share of rooms with glass to the corridor.
        beams: Share of rooms with beams.
        columns: Share of rooms with columns.
        ducts: Share of rooms with open ducts and pipes where the ceiling is not suspended.
        feature_walls: Share of walls in an accent colour or pattern.
        kelvin: Colour temperature of lamps, lowest and highest.
        daylight: How much light comes through windows, lowest and highest; 1 is as much as from the
            lamps.
        exposure: Exposure of the camera, lowest and highest; 1 is right.
        kinds: How often each kind of room occurs.
        corridors: Shapes of the corridor network.
        required: Kinds of room that every building of eight rooms or more has.
        depth: How deep rooms are, lowest and highest, metres.
        hall_width: How wide corridors are, lowest and highest, metres.
        lamp_pitch: How far lamps of one ceiling are apart, lowest and highest, metres; downlights
            hang closer.
        lamps_off: Share of rooms whose ceiling lamps are off.
        shades: How often windows have nothing before them, slats, a roller blind and curtains.
        white_balance: How much of the colour of the light the camera takes out, lowest and highest;
            1 is all of it.
        is_public: Whether there are signs, extinguishers, vents and sprinklers.
        hall_seed: What the floor, walls and ceiling that all corridors share are drawn from.
    """

    name: str
    wood: tuple[Colour, ...]
    upholstery: tuple[Colour, ...]
    metal: tuple[Colour, ...]
    plastic: tuple[Colour, ...]
    fabric: tuple[Pattern, ...]
    table_tops: tuple[Pattern, ...]
    chairs: tuple[str, ...]
    tables: tuple[str, ...]
    tidiness: float
    walls: tuple[Colour, ...] = ((214, 210, 198),)
    accents: tuple[Colour, ...] = ((90, 110, 130),)
    wall_patterns: tuple[Pattern, ...] = ("plaster",)
    floors: tuple[Material, ...] = (Material("carpet", (110, 108, 105), (85, 84, 84), 0.5),)
    hall_floors: tuple[Material, ...] = (Material("tiles", (170, 165, 155), (120, 115, 108), 0.4),)
    ceilings: tuple[CeilingKind, ...] = ("acoustic",)
    lamps: tuple[LampKind, ...] = ("panel",)
    glazing: tuple[Glazing, ...] = ("single",)
    doors: tuple[DoorKind, ...] = ("wood",)
    height: tuple[float, float] = (2.6, 2.9)
    glass_walls: float = 0.1
    beams: float = 0.3
    columns: float = 0.3
    ducts: float = 0.5
    feature_walls: float = 0.15
    kelvin: tuple[float, float] = (3000.0, 5000.0)
    daylight: tuple[float, float] = (0.1, 0.8)
    exposure: tuple[float, float] = (0.7, 1.2)
    kinds: tuple[tuple[RoomKind, float], ...] = (("office", 1.0),)
    corridors: tuple[CorridorShape, ...] = ("straight", "L", "U", "T", "loop")
    required: tuple[RoomKind, ...] = ("office", "conferenceRoom", "lounge", "storage", "openspace")
    depth: tuple[float, float] = (4.2, 6.6)
    hall_width: tuple[float, float] = (1.7, 2.7)
    lamp_pitch: tuple[float, float] = (1.8, 3.2)
    lamps_off: float = 0.1
    shades: tuple[float, float, float, float] = (0.35, 0.3, 0.2, 0.15)
    white_balance: tuple[float, float] = (0.4, 0.95)
    is_public: bool = True
    hall_seed: int = 0


def pick_colour(
    colours: tuple[Colour, ...], rng: np.random.Generator, spread: float = 10.0
) -> Colour:
    """Return one of the colours, varied by a normal of ``spread`` in brightness and a third of it in hue."""
    base = (
        np.array(colours[rng.integers(len(colours))])
        + rng.normal(0, spread)
        + rng.normal(0, spread / 3, 3)
    )
    red, green, blue = np.clip(base, 4, 251).tolist()
    return red, green, blue


def pick_wood(style: Style, rng: np.random.Generator) -> Material:
    """Return a wood of the building."""
    return _with_accent("wood", pick_colour(style.wood, rng), 0.72, rng.uniform(0.05, 0.12), rng)


def pick_fabric(style: Style, rng: np.random.Generator) -> Material:
    """Return an upholstery of the building."""
    pattern = style.fabric[rng.integers(len(style.fabric))]
    return _with_accent(
        pattern,
        pick_colour(style.upholstery, rng),
        rng.uniform(0.5, 1.6),
        rng.uniform(0.02, 0.2),
        rng,
    )


def pick_metal(style: Style, rng: np.random.Generator) -> Material:
    """Return a metal of the building."""
    return _with_accent("metal", pick_colour(style.metal, rng), 1.2, 0.1, rng)


def pick_plastic(style: Style, rng: np.random.Generator) -> Material:
    """Return a plastic of the building."""
    return _with_accent("plain", pick_colour(style.plastic, rng), 0.9, 0.1, rng)


def pick_table_top(style: Style, rng: np.random.Generator) -> Material:
    """Return the surface of a table top."""
    pattern = style.table_tops[rng.integers(len(style.table_tops))]
    colours = style.wood if pattern == "wood" else style.plastic
    return _with_accent(pattern, pick_colour(colours, rng), 0.8, rng.uniform(0.05, 0.15), rng)


def paint(
    colour: Colour, rng: np.random.Generator, pattern: Pattern = "plain", scale: float = 0.1
) -> Material:
    """Return a surface of a given colour, slightly varied."""
    return _with_accent(pattern, pick_colour((colour,), rng, 6.0), 0.75, scale, rng)


def _with_accent(
    pattern: Pattern, base: Colour, factor: float, scale: float, rng: np.random.Generator
) -> Material:
    """Make a material whose second colour is the first, darkened or lightened."""
    red, green, blue = np.clip(np.array(base) * factor, 0, 255).tolist()
    return Material(pattern, base, (red, green, blue), scale, int(rng.integers(1 << 30)))
