"""Rooms a household lives in together: living rooms and dining rooms."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import stand
from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.rooms.contents.homes import homes
from mcpseg_cli.synth.rooms.contents.records import Amount
from mcpseg_cli.synth.rooms.dressing import (
    bookcases,
    dress_top,
    floor_clutter,
    lay_rug,
    make_thing,
    put_at,
    wall_clutter,
    wall_shelves,
    windows,
)
from mcpseg_cli.synth.rooms.fitted import cabinets, room_finish
from mcpseg_cli.synth.rooms.kitchens import fit_kitchenette
from mcpseg_cli.synth.rooms.placed import Placed, about_centre
from mcpseg_cli.synth.rooms.placement import Placement
from mcpseg_cli.synth.rooms.seating import pick_chair, seat_at, seats_around, seats_in_ring
from mcpseg_cli.synth.things.bookcases import make_bookcase
from mcpseg_cli.synth.things.cabinets import make_cabinet
from mcpseg_cli.synth.things.chairs import make_chair
from mcpseg_cli.synth.things.home_sofas import HomeSofa, make_home_sofa
from mcpseg_cli.synth.things.tables import make_table, meeting_parts


def furnish_living_room(placement: Placement) -> None:
    """Sofas, a low table full of things, a television, lamps, bookcases; at times a meal table."""
    holds, style, rng = homes().living_room, placement.style, placement.rng
    area, on_furniture = placement.area, homes().home.on_furniture
    windows(placement)
    _sitting_group(placement)
    if placement.has(holds.dining_group):
        dining_group(placement)
    if placement.has(holds.kitchenette):
        fit_kitchenette(placement)

    # what stands along the walls
    if placement.chance(holds.sofa_at_wall):
        placement.against_wall(make_home_sofa(2, style, rng).item, gap=0.1, tries=12)
    chairs_at_walls(placement, holds.chairs_at_walls)
    cabinets(placement, placement.several(holds.cabinets, area), on_furniture)
    count = placement.times(holds.bookcases, area)
    bookcases(placement, count, holds.bookcases.of, on_furniture)
    for _ in range(placement.times(holds.standard_lamps, area)):
        placement.against_wall(make_thing(placement, "standard lamp"), gap=0.15)
    for _ in range(placement.times(holds.side_tables, area)):
        _side_table(placement, None)
    dress_home(placement)


def chairs_at_walls(placement: Placement, amount: Amount) -> None:
    """Stand chairs of a household about: dining chairs, easy chairs, a desk chair."""
    for _ in range(placement.times(amount, placement.area)):
        design = placement.one_of(homes().home.chairs)
        item = make_chair(design, placement.style, placement.rng)
        if placement.chance(0.7):
            placement.against_wall(item, gap=0.1, turn=0.3, tries=10)
        else:
            placement.freely(item)


def dress_home(placement: Placement) -> None:
    """Hang pictures and shelves, put plants, toys, clothes and lamps about."""
    holds, area = homes().home, placement.area
    wall_shelves(placement, holds.wall_shelves, area)
    wall_clutter(placement, holds.on_walls, area)
    floor_clutter(placement, holds.on_floor, area)


def _sitting_group(placement: Placement) -> None:
    """Place the sofa, what stands before, beside and opposite it, and the rug under it all."""
    holds, rng = homes().sitting_group, placement.rng
    placed, sofa = _main_sofa(placement)
    if placed is None:
        return
    _television(placement, placed, sofa)
    has_table = placement.chance(holds.coffee_table)
    table = _coffee_table(placement, placed, sofa) if has_table else None
    if table is not None:
        _seats_about(placement, table)

    if placement.chance(holds.side_table):
        _side_table(placement, placed)
    if placement.chance(holds.rug):
        spot = placed.at(sofa.middle + rng.normal(0, 0.1), sofa.depth + rng.uniform(0.2, 0.7))
        size = (rng.uniform(*holds.rug_width), rng.uniform(*holds.rug_depth))
        lay_rug(placement, spot, placed.yaw, size)


def _main_sofa(placement: Placement) -> tuple[Placed | None, HomeSofa]:
    """Place the largest sofa that fits, mostly at a wall."""
    holds, rng = homes().sitting_group, placement.rng
    wide = float(placement.size.min()) > holds.wide
    for seats in (placement.count(holds.seats), 3, 2, 2, 2):
        has_corner = wide and seats > 1 and placement.chance(holds.corner)
        corner = float(rng.choice([-1.0, 1.0])) if has_corner else 0.0
        sofa = make_home_sofa(seats, placement.style, rng, corner)
        at_wall, square = placement.chance(holds.at_wall), placement.square()
        if at_wall:
            placed = placement.against_wall(sofa.item, gap=0.1, tries=16)
        else:
            placed = placement.freely(sofa.item, yaw=square, margin=0.5)
        if placed is not None:
            return placed, sofa
    return None, sofa


def _coffee_table(placement: Placement, placed: Placed, sofa: HomeSofa) -> Placed | None:
    """Place a low table before a sofa, with things on it."""
    rng, poses = placement.rng, []
    table = make_table("coffee", placement.style, rng)
    for far in (rng.uniform(0.25, 0.5), 0.35, 0.5, 0.2):
        out = sofa.depth + far + float(table.bounds()[1, 1]) / 2
        x, y = placed.at(sofa.middle + rng.normal(0, 0.1), out)
        poses.append(about_centre(table, x, y, placed.yaw + rng.normal(0, 0.05)))
    low = placement.try_poses(table, poses)
    if low is not None:
        dress_top(placement, low, placement.several(homes().sitting_group.on_coffee_table))
    return low


def _seats_about(placement: Placement, table: Placed) -> None:
    """Place a second sofa and armchairs at the free sides of the low table."""
    holds, style, rng = homes().sitting_group, placement.style, placement.rng
    sides = rng.permutation([1.0, 2.0, -2.0]).tolist()
    if placement.chance(holds.second_sofa):
        other = make_home_sofa(placement.count(holds.seats_of_second), style, rng).item
        _opposite(placement, table, other, sides)
    chair = make_chair(placement.one_of(homes().home.armchairs), style, rng)
    for side in sides[: placement.count(holds.armchairs)]:
        off = rng.normal(0, 0.1)
        seat_at(placement, table, chair, off, side=side, pull=rng.uniform(0.35, 0.6))


def _opposite(placement: Placement, table: Placed, sofa: Item, sides: list[float]) -> None:
    """Place a second sofa at a side of the low table, or at a wall."""
    rng, poses = placement.rng, []
    width, deep, depth = float(table.size[0]), float(table.size[1]), float(sofa.bounds()[1, 1])
    for side in sides:
        for far in (rng.uniform(0.3, 0.6), 0.35):
            out = depth / 2 + far
            if abs(side) < 1.5:
                x, y = table.at(0.0, deep + out)
                face = np.pi
            else:
                x, y = table.at(np.sign(side) * (width / 2 + out), deep / 2)
                face = np.pi / 2 * np.sign(side)
            poses.append(about_centre(sofa, x, y, table.yaw + face + rng.normal(0, 0.03)))
    if placement.try_poses(sofa, poses) is None:
        placement.against_wall(sofa, gap=0.1, tries=12)


def _television(placement: Placement, placed: Placed, sofa: HomeSofa) -> None:
    """Place a low board opposite the sofa, a television on it or on the wall over it."""
    holds, rng, room = homes().sitting_group, placement.rng, placement.room

    # the wall the sofa looks at, as near to its middle as it fits
    side = (round(placed.yaw / (np.pi / 2)) + 2) % 4
    spot = placed.at(sofa.middle, 0.0)[side % 2] - float(room.low[side % 2])
    if placement.chance(holds.low_unit):
        items = [make_cabinet("low unit", placement.style, rng, room_finish(placement))]
    else:
        items = make_bookcase("tv board", placement.style, rng)
    steps = (0.0, 0.3, -0.3, 0.7, -0.7, 1.1, -1.1)
    poses = [placement.wall_pose(side, spot + step, rng.uniform(0.02, 0.06), 0.0) for step in steps]
    board = placement.try_poses(items, poses) or placement.against_wall(items, tries=10)
    if board is None:
        return

    if placement.chance(holds.television_on_board):
        put_at(placement, board, "television", 0.0, float(board.size[1]) * 0.5)
    else:
        x, y = board.at(0.0, 0.0)
        face = (round(board.yaw / (np.pi / 2))) % 4
        along = (x, y)[face % 2] - float(room.low[face % 2])
        screen = make_thing(placement, "wall tv")
        placement.put(screen, placement.wall_pose(face, along, 0.002, rng.uniform(0.85, 1.15)))
    kinds = placement.some_of(homes().home.on_furniture, holds.on_tv_board)
    dress_top(placement, board, kinds)


def _side_table(placement: Placement, near: Placed | None) -> None:
    """Place a small table at a wall, beside something if there is something, with a lamp on it."""
    holds = homes().side_table
    table = make_table("side", placement.style, placement.rng)
    placed = placement.against_wall(table, near=near, gap=0.05)
    if placed is not None:
        if placement.chance(holds.lamp):
            put_at(placement, placed, "table lamp", 0.0, float(placed.size[1]) / 2)
        dress_top(placement, placed, placement.several(holds.on_top))


def furnish_dining_room(placement: Placement) -> None:
    """A meal table with chairs, a sideboard, a glass cabinet, at times a sofa by the wall."""
    holds, area = homes().dining_room, placement.area
    windows(placement)
    dining_group(placement)
    if placement.has(holds.kitchenette):
        fit_kitchenette(placement)

    chairs_at_walls(placement, holds.chairs_at_walls)
    kinds = placement.several(holds.cabinets, area)
    cabinets(placement, kinds, homes().home.on_furniture)
    count = placement.times(holds.bookcases, area)
    bookcases(placement, count, holds.bookcases.of, homes().home.on_furniture)
    if placement.chance(holds.sofa):
        sofa = make_home_sofa(2, placement.style, placement.rng)
        placement.against_wall(sofa.item, gap=0.08, tries=12)
    dress_home(placement)


def dining_group(placement: Placement) -> None:
    """Place a meal table with chairs about it, things on it and at times a rug under it."""
    holds, style, rng = homes().dining_group, placement.style, placement.rng
    is_round = placement.chance(holds.round)
    length, depth = rng.uniform(*holds.length), rng.uniform(*holds.depth)
    if is_round:
        table = make_table("round", style, rng)
    else:
        table = stand("table", meeting_parts(length, depth, 0.75, style, rng))
    placed = placement.freely(table, yaw=placement.square(), margin=0.85, tries=24)
    if placed is None:
        return

    seats = seats_in_ring if is_round else seats_around
    seats(placement, placed, pick_chair(placement, holds.chairs), 0.62)
    dress_top(placement, placed, placement.several(holds.on_table))
    if placement.chance(holds.rug):
        width, deep = float(placed.size[0]), float(placed.size[1])
        size = (width + holds.rug_margin, deep + holds.rug_margin)
        lay_rug(placement, placed.at(0.0, deep / 2), placed.yaw, size)
