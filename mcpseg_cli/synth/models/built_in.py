"""Models that are built in: closed doors, windows and radiators, in the map frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mcpseg_cli.synth.building.walls import wall_of
from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.models.stand_in import fitted
from mcpseg_cli.synth.plan import Fixture, Opening, Room
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import Style

_PROUD = 0.02  # how far a door or window stands out of its wall, metres
_WIDEST = 2.2  # window that a model fills, metres
_YAW = (0.0, np.pi / 2, np.pi, -np.pi / 2)  # of what has its back to each wall


def door_model(room: Room, opening: Opening, style: Style, rng: np.random.Generator) -> Item | None:
    """Return a model in place of a closed door, or nothing; see ``stand_in``."""
    if style.models is None or opening.leaf_deg != 0:
        return None
    size = (opening.end - opening.start, opening.high)
    model = fitted("door", "door", style, rng, size)
    return None if model is None else _in_opening(model, room, opening)


def window_model(
    room: Room, opening: Opening, glass: Material, style: Style, seed: int
) -> Item | None:
    """Return a model in place of a window, or nothing; the same seed gives the same design.

    Args:
        room: The room.
        opening: What the model fills.
        glass: What its panes show.
        style: The building's.
        seed: That of the room's windows, which are alike.

    Returns:
        An object of class window in the map frame.
    """
    size = (opening.end - opening.start, opening.high - opening.low)
    if style.models is None or size[0] > _WIDEST or opening.glazing == "interior":
        return None
    model = fitted("window", "window", style, np.random.default_rng(seed), size)
    if model is None:
        return None
    parts = tuple(
        replace(part, material=glass) if part.material.pattern == "glass" else part
        for part in model.parts
    )
    return _in_opening(replace(model, parts=parts), room, opening)


def radiator_model(
    room: Room, fixture: Fixture, style: Style, rng: np.random.Generator
) -> Item | None:
    """Return a model in place of a radiator, or nothing; see ``stand_in``."""
    if style.models is None:
        return None
    low, high = fixture.low, fixture.high
    gaps = (low[1] - room.low[1], room.high[0] - high[0], room.high[1] - high[1])
    side = int(np.argmin([*gaps, low[0] - room.low[0]]))
    axis = side % 2
    model = fitted("clutter", "radiator", style, rng, (high[axis] - low[axis], high[2] - low[2]))
    if model is None:
        return None
    return _at_wall(model, room, side, (low[axis] + high[axis]) / 2, 0.02, float(low[2]))


def _in_opening(model: Item, room: Room, opening: Opening) -> Item:
    """Set a model into an opening, its front a little out of the wall."""
    out = _PROUD - float(model.bounds()[1, 1])
    middle = (opening.start + opening.end) / 2
    return _at_wall(model, room, opening.side, middle, out, opening.low)


def _at_wall(model: Item, room: Room, side: int, along: float, out: float, z: float) -> Item:
    """Put a model's back to a wall, or so far out of it."""
    _, _, place, inwards = wall_of(room, side)
    across = place + inwards * out
    x, y = (along, across) if side % 2 == 0 else (across, along)
    return model.moved(float(x), float(y), z, _YAW[side])
