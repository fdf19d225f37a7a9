"""The buildings to choose from: six styles of office that differ as S3DIS's areas do, homes, and how more are drawn."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from mcpseg_cli.synth.surfaces.materials import Colour, Material
from mcpseg_cli.synth.surfaces.styles import Style

Choice = TypeVar("Choice")

_CHROME: tuple[Colour, ...] = ((176, 178, 180), (120, 122, 126), (48, 48, 50))
_DARK: tuple[Colour, ...] = ((38, 38, 40), (60, 60, 64), (92, 92, 96))
_LIGHT: tuple[Colour, ...] = ((228, 226, 220), (205, 202, 194), (70, 70, 74))
_OAK: tuple[Colour, ...] = ((176, 134, 88), (152, 108, 66), (190, 156, 112))
_BEECH: tuple[Colour, ...] = ((205, 172, 126), (218, 192, 152), (180, 140, 96))
_WALNUT: tuple[Colour, ...] = ((98, 66, 44), (78, 52, 38), (126, 84, 54))

MODERN = Style(
    "modern",
    (*_BEECH, (232, 230, 224)),
    ((44, 46, 52), (70, 88, 110), (130, 132, 130), (160, 60, 50)),
    _CHROME,
    _LIGHT,
    ("weave", "plain", "carpet"),
    ("plain", "wood"),
    ("task", "cantilever", "four-leg", "stool"),
    ("desk", "conference", "standing", "coffee", "corner"),
    0.55,
    walls=((226, 225, 220), (210, 212, 212), (232, 228, 216)),
    accents=((64, 96, 128), (150, 170, 80), (196, 96, 48)),
    wall_patterns=("plaster", "plaster", "plain"),
    floors=(
        Material("carpet", (106, 108, 112), (76, 78, 84), 0.5),
        Material("carpet", (84, 92, 104), (60, 64, 76), 0.6),
        Material("stripes", (98, 98, 100), (72, 74, 80), 0.25),
    ),
    hall_floors=(
        Material("tiles", (178, 176, 170), (130, 128, 124), 0.6),
        Material("carpet", (96, 96, 98), (70, 70, 76), 0.5),
    ),
    ceilings=("acoustic", "acoustic", "plaster"),
    lamps=("panel", "panel", "downlight", "trough"),
    glazing=("band", "full", "band"),
    doors=("wood", "glazed", "painted"),
    height=(2.6, 3.0),
    glass_walls=0.35,
    beams=0.3,
    columns=0.35,
    ducts=0.2,
    kelvin=(3600, 5200),
    daylight=(0.3, 1.2),
    exposure=(0.95, 1.15),
    kinds=(
        ("office", 22),
        ("conferenceRoom", 4),
        ("openspace", 3),
        ("lounge", 2),
        ("copyRoom", 1),
        ("storage", 1),
        ("pantry", 1),
        ("WC", 1),
    ),
)
BRICK = Style(
    "brick",
    _OAK + _WALNUT,
    ((92, 56, 40), (58, 74, 60), (120, 96, 70), (40, 40, 44)),
    _DARK,
    (*_DARK, (150, 40, 34)),
    ("leather", "weave", "checks"),
    ("wood",),
    ("four-leg", "armchair", "stool", "bench", "executive"),
    ("desk", "trestle", "round", "coffee", "pedestal"),
    0.35,
    walls=((222, 212, 192), (206, 196, 178), (236, 230, 218)),
    accents=((146, 84, 62), (128, 74, 58), (70, 84, 76)),
    wall_patterns=("plaster", "brick", "plaster"),
    floors=(
        Material("wood", (150, 106, 66), (108, 72, 42), 0.12),
        Material("wood", (118, 80, 50), (82, 54, 34), 0.1),
    ),
    hall_floors=(
        Material("wood", (130, 92, 58), (92, 62, 40), 0.12),
        Material("concrete", (140, 136, 130), (104, 100, 96), 1.0),
    ),
    ceilings=("plaster", "concrete", "boards"),
    lamps=("pendant", "globe", "strip"),
    glazing=("single", "single", "band"),
    doors=("panelled", "wood", "painted"),
    height=(2.9, 3.5),
    glass_walls=0.1,
    beams=0.6,
    columns=0.4,
    ducts=0.6,
    feature_walls=0.3,
    kelvin=(2700, 3400),
    daylight=(0.2, 1.0),
    exposure=(0.8, 0.96),
    kinds=(
        ("office", 18),
        ("conferenceRoom", 3),
        ("lounge", 3),
        ("openspace", 3),
        ("storage", 2),
        ("pantry", 1),
        ("WC", 1),
    ),
)
LAB = Style(
    "lab",
    _BEECH,
    ((40, 42, 46), (60, 70, 96), (110, 40, 40)),
    (*_CHROME, (150, 150, 146)),
    _LIGHT + _DARK,
    ("plain", "weave"),
    ("plain", "metal", "wood"),
    ("stool", "task", "folding", "four-leg"),
    ("desk", "standing", "corner", "trestle"),
    0.2,
    walls=((206, 208, 204), (196, 196, 190), (216, 216, 212)),
    accents=((60, 90, 120), (170, 150, 60), (110, 112, 110)),
    wall_patterns=("plaster", "concrete", "plain"),
    floors=(
        Material("marble", (164, 162, 152), (138, 138, 130), 0.5),
        Material("concrete", (132, 132, 128), (104, 104, 102), 1.2),
    ),
    hall_floors=(
        Material("concrete", (142, 142, 138), (112, 112, 110), 1.2),
        Material("tiles", (158, 156, 148), (128, 126, 120), 0.3),
    ),
    ceilings=("concrete", "concrete", "acoustic"),
    lamps=("strip", "strip", "panel"),
    glazing=("band", "single"),
    doors=("steel", "wood", "painted"),
    height=(2.8, 3.4),
    glass_walls=0.15,
    beams=0.7,
    columns=0.6,
    ducts=0.85,
    kelvin=(3800, 5600),
    daylight=(0.1, 0.6),
    exposure=(0.8, 0.96),
    kinds=(
        ("office", 20),
        ("openspace", 4),
        ("storage", 4),
        ("conferenceRoom", 2),
        ("lounge", 1),
        ("copyRoom", 1),
        ("pantry", 1),
        ("WC", 1),
    ),
)
COWORKING = Style(
    "coworking",
    _OAK + _BEECH,
    ((186, 120, 52), (54, 92, 92), (150, 70, 60), (170, 160, 140)),
    (*_DARK, (196, 160, 90)),
    ((236, 232, 222), (206, 110, 60), (70, 120, 110), (40, 40, 42)),
    ("weave", "stripes", "print", "leather"),
    ("wood", "marble", "plain"),
    ("armchair", "four-leg", "stool", "bench", "task", "cantilever"),
    ("round", "coffee", "pedestal", "trestle", "desk", "standing"),
    0.45,
    walls=((234, 226, 210), (214, 200, 178), (190, 198, 190)),
    accents=((46, 86, 84), (176, 92, 58), (212, 166, 70), (84, 96, 70)),
    wall_patterns=("plaster", "plain", "wood"),
    floors=(
        Material("wood", (184, 148, 104), (146, 110, 72), 0.16),
        Material("carpet", (120, 112, 98), (90, 82, 72), 0.4),
        Material("print", (128, 116, 104), (92, 84, 80), 0.8),
    ),
    hall_floors=(
        Material("wood", (176, 142, 100), (138, 104, 70), 0.16),
        Material("concrete", (150, 146, 140), (118, 114, 110), 1.0),
    ),
    ceilings=("concrete", "boards", "plaster"),
    lamps=("pendant", "globe", "trough", "downlight"),
    glazing=("full", "band"),
    doors=("glazed", "wood", "painted"),
    height=(2.8, 3.4),
    glass_walls=0.45,
    beams=0.45,
    columns=0.5,
    ducts=0.7,
    feature_walls=0.35,
    kelvin=(2700, 3600),
    daylight=(0.4, 1.4),
    exposure=(0.92, 1.1),
    kinds=(
        ("office", 9),
        ("openspace", 6),
        ("lounge", 5),
        ("conferenceRoom", 4),
        ("pantry", 2),
        ("storage", 1),
        ("copyRoom", 1),
        ("WC", 1),
    ),
)
SEVENTIES = Style(
    "seventies",
    _WALNUT + _OAK,
    ((120, 84, 40), (96, 50, 36), (70, 78, 50), (60, 58, 56)),
    _CHROME,
    ((190, 176, 148), (120, 100, 76), (50, 48, 46)),
    ("weave", "checks", "leather", "stripes"),
    ("wood", "plain"),
    ("task", "executive", "four-leg", "folding", "cantilever"),
    ("desk", "conference", "corner", "round", "coffee"),
    0.25,
    walls=((206, 194, 164), (214, 206, 184), (188, 180, 160)),
    accents=((150, 110, 60), (110, 116, 80), (134, 84, 60)),
    wall_patterns=("plaster", "print", "wood"),
    floors=(
        Material("carpet", (104, 88, 70), (78, 64, 52), 0.4),
        Material("tiles", (150, 140, 118), (118, 110, 94), 0.3),
        Material("carpet", (84, 90, 76), (62, 66, 58), 0.4),
    ),
    hall_floors=(
        Material("tiles", (146, 138, 120), (112, 104, 92), 0.3),
        Material("marble", (150, 140, 124), (120, 108, 94), 0.4),
    ),
    ceilings=("acoustic", "acoustic", "plaster"),
    lamps=("panel", "strip", "trough"),
    glazing=("single", "band"),
    doors=("wood", "wood", "panelled"),
    height=(2.5, 2.8),
    glass_walls=0.05,
    beams=0.35,
    columns=0.3,
    ducts=0.2,
    feature_walls=0.25,
    kelvin=(3000, 4600),
    daylight=(0.05, 0.5),
    exposure=(0.74, 0.88),
    kinds=(
        ("office", 31),
        ("conferenceRoom", 2),
        ("storage", 2),
        ("lounge", 1),
        ("openspace", 1),
        ("copyRoom", 1),
        ("pantry", 1),
        ("WC", 1),
    ),
)
WHITE = Style(
    "white",
    ((236, 232, 224), (214, 196, 166), (60, 56, 54)),
    ((30, 32, 36), (176, 176, 174), (140, 30, 36), (50, 70, 120)),
    (*_CHROME, (230, 230, 228)),
    ((238, 238, 236), (222, 222, 220), (40, 40, 42)),
    ("plain", "leather", "weave"),
    ("plain", "marble", "wood"),
    ("cantilever", "four-leg", "folding", "stool", "task", "bench"),
    ("conference", "round", "desk", "pedestal", "standing"),
    0.75,
    walls=((238, 238, 234), (232, 230, 228), (224, 226, 228)),
    accents=((160, 160, 158), (50, 54, 60), (150, 40, 44)),
    wall_patterns=("plaster", "plain", "concrete"),
    floors=(
        Material("marble", (198, 194, 186), (160, 156, 150), 0.8),
        Material("concrete", (168, 168, 166), (140, 140, 140), 1.4),
        Material("wood", (206, 182, 146), (176, 150, 112), 0.14),
    ),
    hall_floors=(
        Material("marble", (190, 186, 178), (150, 146, 140), 0.8),
        Material("tiles", (196, 194, 190), (150, 148, 146), 0.6),
    ),
    ceilings=("plaster", "plaster", "acoustic"),
    lamps=("downlight", "trough", "globe", "strip"),
    glazing=("full", "single", "band"),
    doors=("painted", "glazed", "steel"),
    height=(2.7, 3.4),
    glass_walls=0.3,
    beams=0.4,
    columns=0.45,
    ducts=0.2,
    feature_walls=0.12,
    kelvin=(3400, 6000),
    daylight=(0.3, 1.3),
    exposure=(1.0, 1.2),
    kinds=(
        ("office", 12),
        ("conferenceRoom", 5),
        ("lounge", 3),
        ("openspace", 3),
        ("storage", 2),
        ("pantry", 1),
        ("copyRoom", 1),
        ("WC", 1),
        ("lobby", 1),
    ),
)
HOMES = Style(
    "homes",
    _OAK + _WALNUT + (*_BEECH, (232, 230, 224), (52, 42, 38), (44, 42, 42)),
    (
        (46, 44, 46),
        (62, 60, 62),
        (96, 94, 92),
        (138, 132, 124),
        (176, 164, 146),
        (206, 196, 178),
        (70, 52, 42),
        (104, 76, 56),
        (38, 46, 66),
        (54, 72, 92),
        (34, 62, 56),
        (84, 92, 62),
        (104, 36, 40),
        (134, 70, 48),
        (172, 124, 52),
        (112, 72, 92),
    ),
    (*_DARK, (176, 178, 180), (168, 134, 76)),
    ((228, 226, 220), (70, 70, 74), (40, 40, 42), (150, 60, 50)),
    ("weave", "weave", "plain", "leather", "checks", "stripes", "print"),
    ("wood", "wood", "plain", "marble"),
    ("four-leg", "armchair", "cantilever", "stool"),
    ("round", "coffee", "trestle"),
    0.35,
    walls=(
        (226, 218, 202),
        (212, 200, 178),
        (196, 184, 166),
        (232, 228, 220),
        (176, 172, 160),
        (188, 176, 150),
    ),
    accents=((128, 62, 50), (62, 84, 78), (70, 78, 98), (150, 118, 78), (96, 84, 72), (58, 60, 64)),
    wall_patterns=("plaster", "print", "plain", "wood", "brick"),
    floors=(
        Material("wood", (104, 66, 42), (70, 44, 28), 0.11),
        Material("wood", (74, 50, 36), (50, 34, 26), 0.13),
        Material("wood", (150, 104, 62), (110, 72, 40), 0.1),
        Material("wood", (126, 82, 50), (88, 56, 34), 0.14),
        Material("wood", (184, 146, 100), (146, 108, 70), 0.16),
        Material("carpet", (138, 122, 100), (110, 96, 78), 0.4),
    ),
    hall_floors=(
        Material("wood", (112, 74, 48), (78, 50, 32), 0.12),
        Material("tiles", (150, 138, 120), (108, 100, 90), 0.33),
        Material("tiles", (112, 106, 98), (80, 76, 72), 0.45),
        Material("tiles", (186, 178, 164), (132, 126, 118), 0.3),
    ),
    ceilings=("plaster", "plaster", "boards"),
    lamps=("pendant", "globe", "pendant", "downlight"),
    glazing=("single", "single", "single", "full"),
    doors=("panelled", "wood", "painted"),
    height=(2.4, 2.9),
    glass_walls=0.0,
    beams=0.1,
    columns=0.1,
    ducts=0.0,
    feature_walls=0.18,
    kelvin=(2100, 3200),
    daylight=(0.0, 0.5),
    exposure=(0.4, 0.95),
    kinds=(
        ("livingRoom", 10),
        ("bedroom", 3),
        ("diningRoom", 2),
        ("kitchen", 1),
        ("study", 2),
        ("bathroom", 1),
    ),
    required=("livingRoom", "bedroom", "kitchen", "diningRoom", "livingRoom", "bathroom"),
    depth=(3.1, 4.7),
    hall_width=(1.3, 1.9),
    lamp_pitch=(3.0, 5.5),
    lamps_off=0.35,
    shades=(0.2, 0.1, 0.15, 0.55),
    white_balance=(0.1, 0.75),
    is_public=False,
)
OFFICES: tuple[Style, ...] = (MODERN, BRICK, LAB, COWORKING, SEVENTIES, WHITE)
STYLES: tuple[Style, ...] = (*OFFICES, HOMES)


def style_of(number: int, rng: np.random.Generator) -> Style:
    """Draw the style of area ``number`` (from 1), its colours and habits varied.

    Areas 1-6 are ``OFFICES`` in turn and area 7 is ``HOMES``, with a few of its floors, paints and
    covers. From area 8 on, the surfaces of one office meet the furniture of another, so that no two
    areas are alike.
    """
    style = HOMES if number == len(STYLES) else OFFICES[(number - 1) % len(OFFICES)]
    if number == len(STYLES):
        style = replace(
            style, wood=_some(style.wood, 3, rng), upholstery=_some(style.upholstery, 6, rng),
            walls=_some(style.walls, 3, rng), floors=_some(style.floors, 3, rng),
            hall_floors=_some(style.hall_floors, 2, rng),
        )  # fmt: skip
    elif number > len(STYLES):
        other = OFFICES[int(rng.integers(len(OFFICES)))]
        style = replace(
            style,
            wood=other.wood,
            upholstery=other.upholstery,
            fabric=other.fabric,
            chairs=style.chairs + other.chairs,
            tables=style.tables + other.tables,
            doors=style.doors + other.doors,
            floors=style.floors + other.floors,
        )
    return replace(
        style,
        wood=_vary(style.wood, rng),
        upholstery=_vary(style.upholstery, rng),
        plastic=_vary(style.plastic, rng),
        walls=_vary(style.walls, rng),
        accents=_vary(style.accents, rng),
        floors=tuple(_vary_material(floor, rng) for floor in style.floors),
        hall_floors=tuple(_vary_material(floor, rng) for floor in style.hall_floors),
        tidiness=float(np.clip(style.tidiness + rng.normal(0, 0.12), 0, 1)),
        beams=float(np.clip(style.beams + rng.normal(0, 0.1), 0.1, 1)),
        columns=float(np.clip(style.columns + rng.normal(0, 0.1), 0.1, 1)),
        glass_walls=float(np.clip(style.glass_walls + rng.normal(0, 0.08), 0, 1)),
        hall_seed=int(rng.integers(1 << 31)),
    )


def _some(choices: tuple[Choice, ...], count: int, rng: np.random.Generator) -> tuple[Choice, ...]:
    """Return so many of the choices in random order."""
    return tuple(choices[index] for index in rng.permutation(len(choices))[:count])


def _vary(colours: tuple[Colour, ...], rng: np.random.Generator) -> tuple[Colour, ...]:
    """Shift all colours of a palette together, and each a little by itself."""
    shift = rng.normal(0, 3, 3) + rng.normal(0, 9)
    own = rng.normal(0, 2.5, (len(colours), 3)) + rng.normal(0, 6, (len(colours), 1))
    varied = np.clip(np.array(colours) + shift + own, 4, 250)
    return tuple((red, green, blue) for red, green, blue in varied.tolist())


def _vary_material(material: Material, rng: np.random.Generator) -> Material:
    """Shift the colours of a material."""
    base, accent = _vary((material.base, material.accent), rng)
    return replace(
        material, base=base, accent=accent, scale=material.scale * rng.uniform(0.8, 1.25)
    )
