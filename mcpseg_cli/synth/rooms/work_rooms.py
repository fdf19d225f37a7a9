"""Rooms people work in: offices, open-plan ones, meeting rooms, copy rooms, storage."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import Points, stand
from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.rooms.contents.shared import shared
from mcpseg_cli.synth.rooms.contents.work import OpenPlan, work_rooms
from mcpseg_cli.synth.rooms.desks import dress_desk, pick_desk, work_place
from mcpseg_cli.synth.rooms.dressing import (
    board,
    bookcases,
    dress_top,
    floor_clutter,
    make_thing,
    put_at,
    wall_clutter,
    wall_shelves,
    windows,
)
from mcpseg_cli.synth.rooms.placed import Placed, about_centre
from mcpseg_cli.synth.rooms.placement import Placement
from mcpseg_cli.synth.rooms.seating import meeting_corner, pick_chair, seat_at, seats_around
from mcpseg_cli.synth.things.boards import make_board
from mcpseg_cli.synth.things.chairs import make_chair
from mcpseg_cli.synth.things.office_equipment import partition_parts
from mcpseg_cli.synth.things.sofas import make_sofa
from mcpseg_cli.synth.things.tables import make_table, meeting_parts


def furnish_office(placement: Placement) -> None:
    """Desks at walls and windows, bookcases, a board, visitors, at times a meeting table."""
    holds, rng, area = work_rooms().office, placement.rng, placement.area
    windows(placement)

    # what most of its furniture looks like
    desks = int(np.clip(round(area / rng.uniform(*holds.area_per_desk)), 1, holds.most_desks))
    swivels = placement.chance(holds.swivel)
    chair = pick_chair(placement, holds.swivel_chairs if swivels else holds.plain_chairs)
    desk = pick_desk(placement)
    visitor = pick_chair(placement, holds.visitors)

    # bookcases come first: they need walls
    is_small = area < holds.small
    first = holds.first_bookcases_if_small if is_small else holds.first_bookcases
    bookcases(placement, placement.count(first), holds.bookcases.of)
    if placement.has(holds.meeting_corner):
        meeting_corner(placement, visitor)

    # desks, mostly alike
    for _ in range(desks):
        if placement.chance(holds.another_chair):
            chair = pick_chair(placement, holds.swivel_chairs)
        if placement.chance(holds.another_desk):
            desk = pick_desk(placement)
        at_wall = placement.chance(holds.desk_at_wall)
        work_place(placement, desk, chair, wall=at_wall, visitor=visitor)

    # what there is space for
    for _ in range(placement.count(holds.visitors_at_walls)):
        placement.against_wall(visitor, turn=0.3, gap=0.1, tries=12)
    if placement.has(holds.board):
        board(placement, holds.board.of)
    if placement.has(holds.second_meeting_corner):
        meeting_corner(placement, visitor)
    if placement.has(holds.sofa):
        sofa = make_sofa(placement.count(holds.sofa_seats), placement.style, rng)
        placement.against_wall(sofa, gap=0.06)
    bookcases(placement, placement.times(holds.bookcases, area), holds.bookcases.of)
    office_clutter(placement, area)


def office_clutter(placement: Placement, area: float) -> None:
    """Place what stands, lies and hangs about in an office, more in untidy buildings."""
    holds = work_rooms().office_clutter
    for kind in placement.several(holds.along_walls, area):
        placed = placement.against_wall(make_thing(placement, kind), gap=0.05, turn=0.03)
        if placed is not None and placed.size[2] < 1.5 and kind == "filing cabinet":
            on_top = shared().bookcases.on_top
            dress_top(placement, placed, placement.some_of(on_top, holds.on_filing_cabinets))

    wall_shelves(placement, holds.wall_shelves, area)
    wall_clutter(placement, holds.on_walls, area)
    floor_clutter(placement, holds.on_floor, area)


def furnish_open_plan(placement: Placement) -> None:
    """Blocks of desks back to back with screens between them, cupboards along the walls."""
    holds, area = work_rooms().open_plan, placement.area
    windows(placement)
    bookcases(placement, int(area / holds.area_per_bookcase), holds.bookcases)

    _desk_blocks(placement, holds)

    if placement.has(holds.board):
        board(placement, holds.board.of)
    guest = pick_chair(placement, work_rooms().office.visitors)
    for _ in range(1 + placement.times(holds.meeting_corners, area)):
        meeting_corner(placement, guest)
    for _ in range(placement.count(holds.guests_at_walls)):
        placement.against_wall(guest, turn=0.3, gap=0.1)
    office_clutter(placement, area * holds.clutter)


def _desk_blocks(placement: Placement, holds: OpenPlan) -> None:
    """Fill an open-plan office with blocks of four desks, aisles between them."""
    style, rng, size = placement.style, placement.rng, placement.size
    along = 0 if size[0] >= size[1] else 1

    # all blocks are alike
    desk = make_table(placement.one_of(holds.desks), style, rng)
    chair = pick_chair(placement, work_rooms().office.swivel_chairs)
    width = desk.bounds()[1, 0] * 2
    screen = stand("clutter", partition_parts(width, rng.uniform(*holds.screen_height), style, rng))

    # where they stand, from the room's corner
    wide, deep = float(np.ptp(desk.bounds()[:, 0])) + 0.03, float(desk.bounds()[1, 1])
    step_along = 2 * wide + rng.uniform(*holds.aisle_along)
    step_across = 2 * deep + rng.uniform(*holds.aisle_across)
    starts = _spread(0.8 + wide, float(size[along]) - wide - 0.8, step_along)
    rows = _spread(1.0 + deep, float(size[1 - along]) - deep - 1.0, step_across)
    for start in starts:
        for row in rows:
            if placement.chance(holds.block):
                spot = np.array([start, row] if along == 0 else [row, start])
                _desk_block(placement, spot, along, (desk, chair, screen), holds)


def _spread(first: float, last: float, step: float) -> Points:
    """Return places from first to last, at least a step apart; the middle if there is no room."""
    if last <= first:
        return np.array([(first + last) / 2])
    return np.linspace(first, last, 1 + int((last - first) / step))


def _desk_block(
    placement: Placement,
    spot: Points,
    along: int,
    pieces: tuple[Item, Item, Item],
    holds: OpenPlan,
) -> None:
    """Place four desks, two by two, back to back about a spot given from the room's corner."""
    (desk, chair, screen), rng = pieces, placement.rng
    turn = 0.0 if along == 0 else np.pi / 2
    cosine, sine = np.cos(turn), np.sin(turn)
    x0, y0 = (placement.room.low + spot).tolist()

    # a screen where the desks meet
    wide = float(np.ptp(desk.bounds()[:, 0])) + rng.uniform(0.005, 0.03)
    if placement.chance(holds.screen):
        placement.put(screen, about_centre(screen, x0, y0, turn))
    gap = rng.uniform(0.15, 0.19)

    # two desks on either side of it
    for side in (1, -1):
        for number in (-0.5, 0.5):
            x, y = number * wide, side * gap
            spot_x, spot_y = x0 + cosine * x - sine * y, y0 + sine * x + cosine * y
            yaw = turn + (0.0 if side > 0 else np.pi)
            placed = placement.put(desk, (float(spot_x), float(spot_y), 0.0, yaw))
            if placed is None:
                continue
            off = rng.normal(0, 0.1)
            seat_at(placement, placed, chair, off, pull=float(abs(rng.normal(0, 0.2))))
            dress_desk(placement, placed, computer=holds.computer)


def furnish_meeting_room(placement: Placement) -> None:
    """A long table with chairs all round, a board or screen, a television, a side board."""
    holds, style, rng = work_rooms().meeting_room, placement.style, placement.rng
    windows(placement)
    placed, length = _meeting_table(placement)

    # what hangs on the walls
    if placement.has(holds.board):
        board(placement, holds.board.of)
    if placement.chance(holds.television):
        placement.hang(make_thing(placement, "wall tv"), rng.uniform(0.9, 1.2), tries=12)

    # chairs and things at the table
    chair = pick_chair(placement, holds.chairs)
    if placed is not None:
        seats_around(placement, placed, chair, rng.uniform(*holds.chair_pitch))
        dress_top(placement, placed, placement.several(holds.on_table, length))
        _projector(placement, holds.projector)

    # what stands along the walls
    bookcases(placement, placement.times(holds.bookcases), holds.bookcases.of)
    if placement.has(holds.standing_board):
        kind = placement.one_of(holds.standing_board.of)
        placement.against_wall(make_board(kind, style, rng), gap=0.3, turn=0.4)
    for _ in range(placement.times(holds.chairs_at_walls)):
        placement.against_wall(chair, turn=0.2, gap=0.1)
    wall_clutter(placement, holds.on_walls, placement.area)
    floor_clutter(placement, holds.on_floor, placement.area)


def _meeting_table(placement: Placement) -> tuple[Placed | None, float]:
    """Place a table that fills the middle of a room; return it and its length."""
    holds, style, rng = work_rooms().meeting_room, placement.style, placement.rng
    size, along = placement.size, int(np.argmax(placement.size))
    length = float(np.clip(size[along] - rng.uniform(*holds.space_at_ends), *holds.length))
    depth = float(np.clip(size[1 - along] - rng.uniform(*holds.space_at_sides), *holds.depth))
    parts = meeting_parts(length, depth, rng.uniform(*holds.height), style, rng)
    table = stand("table", parts)

    # near the middle, along the room
    turn, poses = 0.0 if along == 0 else np.pi / 2, []
    for play in (0.05, 0.15, 0.3, 0.3):
        x, y = (placement.middle + rng.normal(0, play, 2)).tolist()
        poses.append(about_centre(table, x, y, turn + rng.normal(0, 0.02)))
    return placement.try_poses(table, poses), length


def _projector(placement: Placement, share: float) -> None:
    """Hang a projector from the ceiling over the table, in so many of the rooms."""
    if placement.chance(share):
        item = make_thing(placement, "ceiling projector")
        z = placement.room.ceiling - float(item.bounds()[1, 2])
        x, y = (placement.middle + placement.rng.normal(0, 0.5, 2)).tolist()
        placement.put(item, (x, y, z, placement.square()))


def furnish_copy_room(placement: Placement) -> None:
    """Copiers, shelves with paper, a table, boxes."""
    holds, style, rng = work_rooms().copy_room, placement.style, placement.rng
    windows(placement)
    for _ in range(placement.count(holds.copiers)):
        placement.against_wall(make_thing(placement, "copier"), gap=0.08)
    table = placement.against_wall(make_table("desk", style, rng))
    if table is not None:
        put_at(placement, table, "printer", 0.2, 0.35)
        dress_top(placement, table, placement.several(holds.on_table))

    bookcases(placement, placement.times(holds.bookcases), holds.bookcases.of)
    if placement.has(holds.board):
        board(placement, holds.board.of)
    wall_clutter(placement, holds.on_walls, placement.area)
    floor_clutter(placement, holds.on_floor, placement.area)


def furnish_storage(placement: Placement) -> None:
    """Racks along the walls, boxes, ladders, trolleys, stacked chairs, things put away."""
    holds, style, rng = work_rooms().storage, placement.style, placement.rng
    if placement.has(holds.table):
        table = make_table(placement.one_of(holds.table.of), style, rng)
        placed = placement.against_wall(table)
        if placed is not None:
            dress_top(placement, placed, placement.several(holds.on_table))
    for _ in range(placement.times(holds.chair_stacks)):
        _stack(placement, make_chair("four-leg", style, rng))

    count = int(1 + placement.area / holds.area_per_bookcase)
    bookcases(placement, count, holds.bookcases)
    floor_clutter(placement, holds.on_floor, placement.area)
    wall_shelves(placement, holds.wall_shelves, placement.area)
    wall_clutter(placement, holds.on_walls, placement.area)


def _stack(placement: Placement, chair: Item) -> None:
    """Stack some chairs, each a little higher and further forward than the one below."""
    count = placement.count(work_rooms().storage.chairs_in_stack)
    items = [chair.moved(y=0.035 * row, z=0.085 * row) for row in range(count)]
    parts = tuple(part for item in items for part in item.parts)
    placement.against_wall([Item("chair", parts)], gap=0.1, turn=0.2)
