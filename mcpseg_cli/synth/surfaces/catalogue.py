"""The buildings to choose from: six styles of office, homes, and how more are drawn.

Their colours and numbers are the tables of ``synth/styles/``.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np

from mcpseg_cli.synth.surfaces.materials import Colour, Material
from mcpseg_cli.synth.surfaces.styles import Style
from mcpseg_cli.synth.toml_tables import read_table

_STYLES = Path(__file__).parents[1] / "styles"
Choice = TypeVar("Choice")


@cache
def styles() -> tuple[Style, ...]:
    """Return the styles in the order of their files: those of offices, then that of homes.

    Raises:
        InputError: A file is damaged.
    """
    return tuple(read_table(path, Style) for path in sorted(_STYLES.glob("*.toml")))


def style_of(number: int, rng: np.random.Generator) -> Style:
    """Draw the style of area ``number`` (from 1), its colours and habits varied.

    Areas 1-6 are the offices in turn and area 7 is homes, with a few of its floors, paints and
    covers. From area 8 on, the surfaces of one office meet the furniture of another, so that no two
    areas are alike.
    """
    *offices, homes = styles()
    style = homes if number == len(styles()) else offices[(number - 1) % len(offices)]
    if number == len(styles()):
        style = _some_of(style, rng)
    elif number > len(styles()):
        style = _crossed(style, offices[int(rng.integers(len(offices)))])
    return _varied(style, rng)


def _some_of(style: Style, rng: np.random.Generator) -> Style:
    """Return the style with a few of its colours and floors."""
    chosen = {
        "wood": _some(style.wood, 3, rng),
        "upholstery": _some(style.upholstery, 6, rng),
        "walls": _some(style.walls, 3, rng),
        "floors": _some(style.floors, 3, rng),
        "hall_floors": _some(style.hall_floors, 2, rng),
    }
    return style.model_copy(update=chosen)


def _crossed(style: Style, other: Style) -> Style:
    """Return the style with the furniture of another in its rooms."""
    taken = {name: getattr(other, name) for name in ("wood", "upholstery", "fabric")}
    shared = ("chairs", "tables", "doors", "floors")
    both = {name: getattr(style, name) + getattr(other, name) for name in shared}
    return style.model_copy(update=taken | both)


def _varied(style: Style, rng: np.random.Generator) -> Style:
    """Return the style with its colours and habits varied."""
    # each palette as a whole, and the colours in it
    colours = {
        name: _vary(getattr(style, name), rng)
        for name in ("wood", "upholstery", "plastic", "walls", "accents")
    }
    floors = {
        name: tuple(_vary_material(floor, rng) for floor in getattr(style, name))
        for name in ("floors", "hall_floors")
    }

    habits = {
        "tidiness": float(np.clip(style.tidiness + rng.normal(0, 0.12), 0, 1)),
        "beams": float(np.clip(style.beams + rng.normal(0, 0.1), 0.1, 1)),
        "columns": float(np.clip(style.columns + rng.normal(0, 0.1), 0.1, 1)),
        "glass_walls": float(np.clip(style.glass_walls + rng.normal(0, 0.08), 0, 1)),
    }
    seed = int(rng.integers(1 << 31))
    return style.model_copy(update={**colours, **floors, **habits, "hall_seed": seed})


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
