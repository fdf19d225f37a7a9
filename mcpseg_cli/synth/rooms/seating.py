"""Chairs at tables, and the small tables people sit at."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mcpseg_cli.synth.geometry.shapes import stand
from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.rooms.contents.shared import shared
from mcpseg_cli.synth.rooms.dressing import dress_top
from mcpseg_cli.synth.rooms.placed import Placed, about_centre
from mcpseg_cli.synth.rooms.placement import Placement
from mcpseg_cli.synth.things.chairs import make_chair
from mcpseg_cli.synth.things.tables import make_table, meeting_parts

_TABLE = 0.74  # height of tables that are made to measure, metres


def pick_chair(placement: Placement, designs: Sequence[str]) -> Item:
    """Make a chair of one of the designs, those in use in the building preferred."""
    usual = [design for design in designs if design in placement.style.chairs]
    choice = usual if usual and placement.chance(shared().chairs.usual) else designs
    design = choice[int(placement.rng.integers(len(choice)))]
    return make_chair(design, placement.style, placement.rng)


def seat_at(
    placement: Placement,
    table: Placed,
    chair: Item,
    along: float,
    *,
    side: float = 1.0,
    pull: float = 0.0,
) -> Placed | None:
    """Place a chair at a table, facing it, pushed under as far as it goes.

    Args:
        placement: The room.
        table: What it stands at.
        chair: In its own frame.
        along: Where along the table's width, metres from its middle.
        side: 1 for its front, -1 for its back, 2 for the end at +x, -2 for the end at -x.
        pull: How far it is pulled away from the table, metres.
    """
    rng, depth, poses = placement.rng, float(chair.bounds()[1, 1]), []
    width, deep = float(table.size[0]), float(table.size[1])
    turn = rng.normal(0, 0.25) if rng.random() < 0.7 else rng.normal(0, 0.9)

    # how far under the table, and how far along it from the place it should have
    reaches = [(rng.uniform(0.1, 0.3), 0.0), (0.2, 0.0), (0.08, 0.25), (0.08, -0.25)]
    reaches += [(-0.1, 0.0), (-0.2, 0.2)]
    for under, step in reaches:
        out = depth / 2 - under + (pull if step == 0.0 else 0.0)
        if abs(side) < 1.5:
            x, y = table.at(along + step + rng.normal(0, 0.05), deep + out if side > 0 else -out)
            face = np.pi if side > 0 else 0.0
        else:
            x, y = table.at(np.sign(side) * (width / 2 + out), deep / 2 + along)
            face = np.pi / 2 * np.sign(side)
        poses.append(about_centre(chair, x, y, table.yaw + face + turn))
    return placement.try_poses(chair, poses)


def seats_around(
    placement: Placement, table: Placed, chair: Item, pitch: float, *, ends: bool = True
) -> None:
    """Place chairs on both long sides of a table and at its ends; some are missing or pulled out.

    Args:
        placement: The room.
        table: What they stand at.
        chair: In its own frame.
        pitch: Space for each, metres.
        ends: Whether there are some at the ends.
    """
    rng, seats = placement.rng, shared().chairs
    width = float(table.size[0])
    count = max(int((width - 0.2) / pitch), 1)

    # along both long sides, each about the middle of its space
    for side in (1.0, -1.0):
        for number in range(count):
            if rng.random() < seats.at_sides:
                spread = (number - (count - 1) / 2) * (width - 0.2) / count
                pull = float(abs(rng.normal(0, 0.12)))
                seat_at(placement, table, chair, spread, side=side, pull=pull)
    for side in (2.0, -2.0):
        if ends and rng.random() < seats.at_ends:
            seat_at(placement, table, chair, 0.0, side=side)


def seats_in_ring(placement: Placement, table: Placed, chair: Item, pitch: float) -> None:
    """Place chairs about a round table; some are missing."""
    rng = placement.rng
    width, deep = float(table.size[0]), float(table.size[1])
    count = max(int(np.pi * width / pitch / 1.1), 2)

    for angle in rng.uniform(0, 6.28) + np.arange(count) * (2 * np.pi / count):
        turn, poses = table.yaw + angle + np.pi / 2 + rng.normal(0, 0.25), []
        for far in (rng.uniform(-0.05, 0.25), 0.1, 0.25, 0.4):
            reach = width / 2 + far
            x, y = table.at(np.cos(angle) * reach, deep / 2 + np.sin(angle) * reach)
            poses.append(about_centre(chair, x, y, turn))
        if rng.random() < shared().chairs.in_rings:
            placement.try_poses(chair, poses)


def meeting_corner(placement: Placement, chair: Item) -> None:
    """Place a small table with two to four chairs, in large rooms also a long one."""
    corner, style, rng = shared().meeting_corner, placement.style, placement.rng
    is_long = placement.has(corner.oblong)
    if is_long:
        length, depth = rng.uniform(*corner.length), rng.uniform(*corner.depth)
        table = stand("table", meeting_parts(length, depth, _TABLE, style, rng))
    else:
        table = make_table(placement.one_of(corner.tables), style, rng)

    placed = placement.freely(table, margin=0.75, tries=20, yaw=placement.square())
    if placed is None:
        return
    if is_long:
        seats_around(placement, placed, chair, 0.65)
    else:
        seats_in_ring(placement, placed, chair, 0.65)
    dress_top(placement, placed, placement.several(corner.on_top))


def eating_place(placement: Placement) -> None:
    """Place a small table with chairs, or a high one with stools."""
    place, style, rng = shared().eating_place, placement.style, placement.rng
    if placement.chance(place.oblong):
        length, depth = rng.uniform(*place.length), rng.uniform(*place.depth)
        table = stand("table", meeting_parts(length, depth, _TABLE, style, rng))
    else:
        table = make_table(placement.one_of(place.tables), style, rng)
    placed = placement.freely(table, yaw=placement.square(), margin=0.4)
    if placed is None:
        return

    # stools at high tables, a ring of chairs about those as deep as wide
    is_high = placed.size[2] > 0.9
    chair = make_chair("stool", style, rng) if is_high else pick_chair(placement, place.chairs)
    if abs(placed.size[0] - placed.size[1]) < 0.05:
        seats_in_ring(placement, placed, chair, 0.65)
    else:
        seats_around(placement, placed, chair, 0.65, ends=False)
    dress_top(placement, placed, placement.several(place.on_top))
