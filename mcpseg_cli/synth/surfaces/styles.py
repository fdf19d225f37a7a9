"""Styles: what furniture and surfaces of one building have in common, as S3DIS's areas differ."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, Field

from mcpseg_cli.synth.models.library import Models
from mcpseg_cli.synth.plan import CeilingKind, RoomKind
from mcpseg_cli.synth.surfaces.materials import Colour, Material, Pattern
from mcpseg_cli.synth.toml_tables import Metres, OneOrMore, Range, Record, Share, Weight

LampKind = Literal["panel", "strip", "pendant", "downlight", "globe", "trough"]
DoorKind = Literal["wood", "painted", "steel", "glazed", "panelled"]
Glazing = Literal["single", "band", "full"]
Shade = Literal["none", "slats", "roller", "curtain"]
CorridorShape = Literal["straight", "L", "U", "T", "loop"]
Kelvin = Annotated[float, Field(ge=1000, le=20000)]
Light = Annotated[float, Field(ge=0, le=10)]
"""Brightness, 1 as usual."""


def _all_in_all(shares: dict[Shade, float]) -> dict[Shade, float]:
    """Refuse shares that do not add up to 1."""
    if abs(sum(shares.values()) - 1) > 1e-9:
        raise ValueError("shares that add up to 1")
    return shares


class Style(Record):
    """Colours and habits of one building: a file of ``synth/styles/``; every key has to be there.

    Lists are drawn from with even chances: what is in one twice is drawn twice as often. Colours
    are red, green and blue, 0-255.

    Attributes:
        name: What the style is called.
        wood: Colours of wood.
        upholstery: Colours of seats and sofas.
        metal: Colours of metal frames.
        plastic: Colours of plastic shells and casings.
        fabric: Patterns that seats and sofas come in.
        table_tops: Patterns of table tops.
        chairs: Chair designs in use, by name; ``things/chairs.py`` has them.
        tables: Table designs in use; ``things/tables.py`` has them.
        tidiness: 0 for rooms full of clutter to 1 for bare ones.
        walls: Paint of walls.
        accents: Paint of feature walls, of painted doors and of steel.
        wall_patterns: Surfaces of walls; the first is the usual one.
        feature_walls: Share of walls in an accent colour or pattern.
        floors: Floors of rooms; the first is the usual one.
        hall_floors: Floors of corridors, WCs and storage rooms.
        ceilings: Kinds of ceiling.
        height: Lowest and highest ceiling, metres.
        depth: How deep rooms are, lowest and highest, metres.
        hall_width: How wide corridors are, lowest and highest, metres.
        corridors: Shapes of the corridor network.
        required: Kinds of room that every building of eight rooms or more has.
        doors: Kinds of door leaf.
        glazing: Kinds of window to the street.
        shades: How often windows have nothing before them, slats, a roller blind and curtains.
        glass_walls: Share of rooms with glass to the corridor.
        beams: Share of rooms with beams.
        columns: Share of rooms with columns.
        ducts: Share of rooms with open ducts and pipes where the ceiling is not suspended.
        cabinets: How many cabinets are fitted to walls or stand at them; 0 for none beside those
            that rooms have anyway.
        curtains: Share of rooms with curtains down to the floor, or blinds before the wall.
        is_public: Whether there are signs, extinguishers, vents and sprinklers.
        lamps: Kinds of lamp.
        lamp_pitch: How far lamps of one ceiling are apart, lowest and highest, metres; downlights
            hang closer.
        lamps_off: Share of rooms whose ceiling lamps are off.
        kelvin: Colour temperature of lamps, lowest and highest.
        daylight: How much light comes through windows, lowest and highest; 1 is as much as from the
            lamps.
        exposure: Exposure of the camera, lowest and highest; 1 is right.
        white_balance: How much of the colour of the light the camera takes out, lowest and highest;
            1 is all of it.
        kinds: How often each kind of room occurs.
        hall_seed: What the floor, walls and ceiling that all corridors share are drawn from; drawn
            with the building, in no file.
        models: Meshes that stand in for some of the things; None for none. In no file.
    """

    name: str
    wood: OneOrMore[Colour]
    upholstery: OneOrMore[Colour]
    metal: OneOrMore[Colour]
    plastic: OneOrMore[Colour]
    fabric: OneOrMore[Pattern]
    table_tops: OneOrMore[Pattern]
    chairs: OneOrMore[str]
    tables: OneOrMore[str]
    tidiness: Share

    walls: OneOrMore[Colour]
    accents: OneOrMore[Colour]
    wall_patterns: OneOrMore[Pattern]
    feature_walls: Share
    floors: OneOrMore[Material]
    hall_floors: OneOrMore[Material]
    ceilings: OneOrMore[CeilingKind]

    height: Range[Metres]
    depth: Range[Metres]
    hall_width: Range[Metres]
    corridors: OneOrMore[CorridorShape]
    required: tuple[RoomKind, ...]
    doors: OneOrMore[DoorKind]
    glazing: OneOrMore[Glazing]
    shades: Annotated[dict[Shade, Share], AfterValidator(_all_in_all)]
    glass_walls: Share
    beams: Share
    columns: Share
    ducts: Share
    cabinets: Share
    curtains: Share
    is_public: bool

    lamps: OneOrMore[LampKind]
    lamp_pitch: Range[Metres]
    lamps_off: Share
    kelvin: Range[Kelvin]
    daylight: Range[Light]
    exposure: Range[Light]
    white_balance: Range[Share]
    kinds: Annotated[dict[RoomKind, Weight], Field(min_length=1)]
    hall_seed: int = 0
    models: Models | None = None


def pick_colour(
    colours: tuple[Colour, ...], rng: np.random.Generator, spread: float = 10.0
) -> Colour:
    """Return one of the colours, varied.

    Args:
        colours: Those to choose from.
        rng: Random numbers.
        spread: Standard deviation of its brightness; that of its hue is a third of it.
    """
    chosen = np.array(colours[rng.integers(len(colours))])
    varied = chosen + rng.normal(0, spread) + rng.normal(0, spread / 3, 3)
    red, green, blue = np.clip(varied, 4, 251).tolist()
    return red, green, blue


def pick_wood(style: Style, rng: np.random.Generator) -> Material:
    """Return a wood of the building."""
    return _with_accent("wood", pick_colour(style.wood, rng), 0.72, rng.uniform(0.05, 0.12), rng)


def pick_fabric(style: Style, rng: np.random.Generator) -> Material:
    """Return an upholstery of the building."""
    pattern = style.fabric[rng.integers(len(style.fabric))]
    colour, factor = pick_colour(style.upholstery, rng), rng.uniform(0.5, 1.6)
    return _with_accent(pattern, colour, factor, rng.uniform(0.02, 0.2), rng)


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
