"""Fixtures of a plan, built: columns, beams, shafts, radiators, ducts and pipes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mcpseg_cli.synth.geometry.solids import Item, Part, box, circle, part_of, prism, tube
from mcpseg_cli.synth.models.built_in import radiator_model
from mcpseg_cli.synth.plan import Fixture, Room
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import Style, paint, pick_colour, pick_metal, pick_wood


@dataclass(frozen=True)
class Finish:
    """What the walls of a room have in common.

    Attributes:
        wall: Their usual surface.
        trim: That of the skirting.
        skirting: Height of it, metres; 0 for none.
    """

    wall: Material
    trim: Material
    skirting: float


def build_fixtures(
    room: Room, finish: Finish, style: Style, rng: np.random.Generator
) -> list[Item]:
    """Build columns, beams, shafts, radiators, ducts and pipes.

    Args:
        room: The room; its fixtures are built.
        finish: What its walls look like.
        style: The building's.
        rng: Random numbers.

    Returns:
        An object for each fixture, in the map frame.
    """
    # concrete, plastered like the walls, or in a colour of their own
    plain = replace(finish.wall, seed=finish.wall.seed + 3)
    grey = paint(pick_colour(((150, 148, 142), (172, 168, 160)), rng), rng, "concrete", 1.0)
    column, beam = grey, grey
    if rng.random() >= 0.4:
        column = plain if rng.random() < 0.7 else paint(pick_colour(style.accents, rng), rng)
    if rng.random() >= 0.35:
        beam = plain if rng.random() < 0.75 else pick_wood(style, rng)

    items = []
    for fixture in room.fixtures:
        low, high = fixture.low.tolist(), fixture.high.tolist()
        if fixture.kind == "beam":
            items.append(Item("beam", (part_of(box(low, high), beam),)))
        elif fixture.kind in ("column", "round column"):
            items.append(Item("column", tuple(_column(fixture, column, finish))))
        elif fixture.kind == "shaft":
            items.append(Item("wall", (part_of(box(low, high), plain),)))
        elif fixture.kind == "radiator":
            model = radiator_model(room, fixture, style, rng)
            items.append(model or _radiator(fixture, rng))
        else:
            items.append(_duct(room, fixture, style, rng))
    return items


def _column(fixture: Fixture, face: Material, finish: Finish) -> list[Part]:
    """Build a column, with a skirting around its foot if the room has one."""
    low, high = fixture.low, fixture.high
    if fixture.kind == "round column":
        x, y = ((low + high) / 2)[:2].tolist()
        radius = float(high[0] - low[0]) / 2
        return [part_of(prism(circle(radius, 20, x, y), float(low[2]), float(high[2])), face)]

    parts = [part_of(box(low.tolist(), high.tolist()), face)]
    if finish.skirting:
        edge = np.array([0.012, 0.012, 0.0])
        last = (*(high + edge)[:2].tolist(), finish.skirting)
        parts.append(part_of(box((low - edge).tolist(), last), finish.trim))
    return parts


def _radiator(fixture: Fixture, rng: np.random.Generator) -> Item:
    """Build a radiator with its feed pipes."""
    white = paint((226, 224, 216), rng, "stripes", rng.uniform(0.03, 0.07))
    low, high = fixture.low, fixture.high
    along = int(np.argmax((high - low)[:2]))
    parts = [part_of(box(low.tolist(), high.tolist()), white)]
    for share in (0.06, 0.94):
        foot = (low + high) / 2
        foot[along] = low[along] + share * (high - low)[along]
        x, y = foot[0], foot[1]
        parts.append(part_of(tube((x, y, 0.0), (x, y, float(low[2])), 0.012), white))
    return Item("clutter", tuple(parts))


def _duct(room: Room, fixture: Fixture, style: Style, rng: np.random.Generator) -> Item:
    """Run a duct (round or square) or a pipe along the ceiling on hangers."""
    low, high = fixture.low, fixture.high
    along = int(np.argmax((high - low)[:2]))
    middle, size = (low + high) / 2, float(high[2] - low[2])
    if rng.random() < 0.6:
        metal = pick_metal(style, rng)
    else:
        metal = paint(pick_colour(style.walls + style.accents, rng), rng)

    # square or round
    if fixture.kind == "duct" and rng.random() < 0.5:
        solid = box(low.tolist(), high.tolist())
    else:
        first, last = middle.copy(), middle.copy()
        first[along], last[along] = low[along], high[along]
        solid = tube(first.tolist(), last.tolist(), size / 2, 14 if size > 0.15 else 8)
    parts = [part_of(solid, metal)]

    for place in np.arange(low[along] + 0.5, high[along], 2.0).tolist():
        hanger = middle.copy()
        hanger[along] = place
        x, y = float(hanger[0]), float(hanger[1])
        rod = tube((x, y, float(high[2]) - 0.01), (x, y, room.ceiling), 0.006, 4)
        parts.append(part_of(rod, metal))
    return Item("clutter", tuple(parts))
