"""Materials: how a surface looks before light falls on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import ConfigDict, Field

Pattern = Literal[
    "plain", "carpet", "wood", "brick", "plaster", "tiles", "acoustic", "concrete", "weave",
    "stripes", "checks", "print", "leather", "metal", "glass", "screen", "foliage", "paper", "book",
    "whiteboard", "chalkboard", "cardboard", "marble",
]  # fmt: skip
"""What is painted: ``textures.py`` has a painter for each."""
Channel = Annotated[float, Field(ge=0, le=255)]
Colour = tuple[Channel, Channel, Channel]
"""Red, green, blue, 0-255."""


@dataclass(frozen=True)
class Material:
    """A surface's pattern and colours.

    Attributes:
        pattern: What is painted.
        base: Main colour.
        accent: Second colour: grain, mortar, stripes, ink.
        scale: Size of the pattern's repeat, metres.
        seed: Tells two surfaces of one material apart.
        glow: Light the surface gives off itself, as a share of white: lamps, screens, panes with
            the day behind them.
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")  # where it is read from a table

    pattern: Pattern
    base: Colour
    accent: Colour
    scale: Annotated[float, Field(gt=0)] = 0.1
    seed: int = 0
    glow: float = 0.0


def kelvin_colour(kelvin: float) -> Colour:
    """Return a lamp's colour at 2000-10000 K, its brightest channel 255; a fit by eye."""
    share = float(np.clip((kelvin - 2000) / 4500, 0, 1.6))
    red = 255.0 if share < 1 else 255 - 60 * (share - 1)
    return red, min(150 + 105 * share**0.6, 250.0), min(60 + 190 * share**0.9, 255.0)
