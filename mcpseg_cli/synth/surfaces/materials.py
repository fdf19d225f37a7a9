"""Materials: how a surface looks before light falls on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Pattern = Literal[
    "plain", "carpet", "wood", "brick", "plaster", "tiles", "acoustic", "concrete", "weave", "stripes", "checks",
    "print", "leather", "metal", "glass", "screen", "foliage", "paper", "book", "whiteboard", "chalkboard",
    "cardboard", "marble",
]  # fmt: skip
Colour = tuple[float, float, float]
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
        glow: Light the surface gives off itself, as a share of white: lamps, screens, panes with the day behind them.
    """

    pattern: Pattern
    base: Colour
    accent: Colour
    scale: float = 0.1
    seed: int = 0
    glow: float = 0.0
