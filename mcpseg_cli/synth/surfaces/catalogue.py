"""The buildings to choose from: styles of offices and of homes, and how more are drawn.

Their colours and numbers are the tables of ``synth/styles/``.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np

from mcpseg_cli.formats.natural_order import natural_key
from mcpseg_cli.synth.surfaces.materials import Colour, Material
from mcpseg_cli.synth.surfaces.styles import Style
from mcpseg_cli.synth.toml_tables import read_table

_STYLES = Path(__file__).parents[1] / "styles"
_OFFICES = 6  # the first styles, which areas without a style of their own are crossed from
Choice = TypeVar("Choice")


@cache
def numbered_styles() -> dict[int, Style]:
    """Return the styles by the numbers that their files' names begin with, in rising order.

    Raises:
        InputError: A file is damaged.
    """
    paths = sorted(_STYLES.glob("*.toml"), key=lambda path: natural_key(path.name))
    return {int(path.name.split("_")[0]): read_table(path, Style) for path in paths}


@cache
def styles() -> tuple[Style, ...]:
    """Return the styles in the order of their numbers: six of offices, homes, then some of each.

    Raises:
        InputError: A file is damaged.
    """
    return tuple(numbered_styles().values())


def style_of(number: int, rng: np.random.Generator) -> Style:
    """Draw the style of area ``number`` (from 1), its colours and habits varied.

    Areas 1-6 are the offices in turn; area 7 is homes, 16 offices full of joinery, 17 flats and
    27 houses, with a few of their floors, paints and covers. The surfaces of any other office meet
    the furniture of another, so that no two areas are alike.
    """
    numbered = numbered_styles()
    offices = [numbered[first] for first in range(1, _OFFICES + 1)]
    style = numbered.get(number, offices[(number - 1) % _OFFICES])
    if number > _OFFICES and number in numbered:
        style = _some_of(style, rng)
    elif number > _OFFICES:
        style = _crossed(style, offices[int(rng.integers(_OFFICES))])
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
