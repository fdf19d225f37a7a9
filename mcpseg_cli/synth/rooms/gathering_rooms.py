"""Rooms where people gather: class rooms, cafés, workshops, halls with coats."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import stand
from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.rooms.contents.gathering import ClassRoom, gathering_rooms
from mcpseg_cli.synth.rooms.contents.shared import shared
from mcpseg_cli.synth.rooms.dressing import (
    board,
    bookcases,
    dress_top,
    floor_clutter,
    make_thing,
    wall_clutter,
    wall_shelves,
    windows,
)
from mcpseg_cli.synth.rooms.fitted import cabinets
from mcpseg_cli.synth.rooms.placed import Placed
from mcpseg_cli.synth.rooms.placement import Placement
from mcpseg_cli.synth.rooms.seating import eating_place, pick_chair, seat_at, seats_around
from mcpseg_cli.synth.things.boards import make_board
from mcpseg_cli.synth.things.bookcases import make_bookcase
from mcpseg_cli.synth.things.chairs import make_chair
from mcpseg_cli.synth.things.kitchen_and_washroom import counter_parts
from mcpseg_cli.synth.things.plain_tables import school_desk, work_bench
from mcpseg_cli.synth.things.sofas import make_sofa
from mcpseg_cli.synth.things.tables import make_table

_SIDES = (0, 1, 2, 3)


def furnish_class_room(placement: Placement) -> None:
    """Rows of desks that face a board, the teacher's desk before it, cupboards, bags."""
    holds, area = gathering_rooms().class_room, placement.area
    windows(placement)
    front = _front(placement)
    _teach(placement, holds, front)
    _rows(placement, holds, front)

    # what stands and hangs along the walls
    if placement.has(holds.pin_board):
        board(placement, holds.pin_board.of)
    bookcases(placement, placement.times(holds.bookcases, area), holds.bookcases.of)
    cabinets(placement, placement.several(holds.cabinets, area), shared().bookcases.on_top)
    wall_shelves(placement, holds.wall_shelves, area)
    wall_clutter(placement, holds.on_walls, area)
    floor_clutter(placement, holds.on_floor, area)


def _front(placement: Placement) -> int:
    """Choose the wall that a class looks at: one with few openings, a short one if it can be."""
    openings = [sum(o.side == side for o in placement.room.openings) for side in _SIDES]
    sides = placement.rng.permutation(_SIDES).tolist()
    return int(min(sides, key=lambda side: (openings[side], placement.size[side % 2])))


def _teach(placement: Placement, holds: ClassRoom, front: int) -> None:
    """Hang a board on the front wall, put the teacher's desk before it, and a projector up."""
    style, rng, long = placement.style, placement.rng, float(placement.size[front % 2])
    item = make_board(placement.one_of(holds.boards), style, rng)
    half = float(np.ptp(item.bounds()[:, 0])) / 2
    z = rng.uniform(*holds.board_height)
    for spot in (long / 2, long / 2 + 0.5, long / 2 - 0.5, half + 0.1, long - half - 0.1):
        if placement.put(item, placement.wall_pose(front, spot, 0.002, z)) is not None:
            break
    if placement.chance(holds.projector):
        thing = make_thing(placement, "ceiling projector")
        z = placement.room.ceiling - float(thing.bounds()[1, 2])
        placement.put(thing, placement.wall_pose(front, long / 2, rng.uniform(1.6, 2.4), z))

    # at one side, so that the board is seen
    desk, spots = make_table("desk", style, rng), long * rng.permutation([0.25, 0.75, 0.5])
    poses = [placement.wall_pose(front, spot, holds.teacher, 0.0) for spot in spots.tolist()]
    placed = placement.try_poses(desk, poses)
    if placed is not None:
        chair = pick_chair(placement, holds.teachers_chairs)
        seat_at(placement, placed, chair, 0.0, side=-1.0)
        dress_top(placement, placed, placement.several(holds.on_teachers_desk))


def _rows(placement: Placement, holds: ClassRoom, front: int) -> None:
    """Fill the room with rows of desks, their chairs behind them, all alike."""
    style, rng = placement.style, placement.rng
    long, deep = float(placement.size[front % 2]), float(placement.size[1 - front % 2])
    wide = rng.uniform(*holds.desk_width[int(rng.integers(len(holds.desk_width)))])
    thick, height = rng.uniform(*holds.desk_depth), rng.uniform(*holds.desk_height)
    desk = school_desk(wide, thick, height, style, rng)
    chair = pick_chair(placement, style.chairs)

    # as many beside and behind each other as there is room for
    step, pitch = wide + rng.uniform(*holds.aisle), rng.uniform(*holds.pitch)
    first = rng.uniform(*holds.first_row)
    count = max(int((long - 0.8 - wide) / step) + 1, 1)
    starts = long / 2 + step * (np.arange(count) - (count - 1) / 2)
    for out in np.arange(first, deep - thick - 0.8, pitch).tolist():
        for along in starts.tolist():
            if placement.chance(holds.row):
                pose = placement.wall_pose(front, along, out, 0.0, rng.normal(0, 0.03))
                _school_desk(placement, placement.put(desk, pose), chair, holds)


def _school_desk(placement: Placement, desk: Placed | None, chair: Item, holds: ClassRoom) -> None:
    """Seat one or two at a desk, their things on it."""
    if desk is None:
        return
    places = (0.0,) if desk.size[0] < 1.0 else (-0.3, 0.3)
    for along in places:
        if placement.chance(holds.seat):
            seat_at(placement, desk, chair, along, pull=float(abs(placement.rng.normal(0, 0.1))))
    dress_top(placement, desk, placement.several(holds.on_desks))


def furnish_cafe(placement: Placement) -> None:
    """A bar, shelves and machines, tables with chairs everywhere, sofas at the walls."""
    holds, style, rng = gathering_rooms().cafe, placement.style, placement.rng
    area = placement.area
    windows(placement)
    _bar(placement)
    placement.against_wall(make_thing(placement, placement.one_of(holds.machines)))

    # sofas with a table before them
    for _ in range(placement.times(holds.sofas, area)):
        sofa = make_sofa(placement.count(holds.seats), style, rng)
        placed = placement.against_wall(sofa, gap=0.06, turn=0.01)
        if placed is not None:
            table = make_table(placement.one_of(holds.sofas.of), style, rng)
            x, y = placed.at(0.0, float(placed.size[1]) + 0.35)
            placement.put(table, (x, y, 0.0, placed.yaw))

    places = np.clip(area / holds.area_per_eating_place, 1, holds.most_eating_places)
    for _ in range(int(places)):
        eating_place(placement)
    wall_clutter(placement, holds.on_walls, area)
    floor_clutter(placement, holds.on_floor, area)


def _bar(placement: Placement) -> None:
    """Place a bar before a wall, a way behind it, shelves on the wall and stools before it."""
    holds, style, rng = gathering_rooms().cafe, placement.style, placement.rng
    width = min(rng.uniform(*holds.bar), placement.length - 1.6)
    bar = stand("clutter", counter_parts(width, style, rng), "kitchen")
    poses = []
    for side in rng.permutation(_SIDES).tolist():
        spare = float(placement.size[side % 2]) - width
        if spare > 0:
            along = width / 2 + rng.uniform(0, spare)
            gap = rng.uniform(*holds.behind_bar)
            poses.append(placement.wall_pose(side, along, gap, 0.0))
    placed = placement.try_poses(bar, poses)
    if placed is None:
        return
    dress_top(placement, placed, placement.several(holds.on_bar))

    # behind it, then before it
    for kind in placement.several(holds.shelves_behind):
        placement.against_wall(make_bookcase(kind, style, rng), tries=12)
    if placement.chance(holds.stools):
        stool = make_chair("stool", style, rng)
        for along in np.arange(0.3 - width / 2, width / 2 - 0.2, holds.stool_pitch).tolist():
            seat_at(placement, placed, stool, along, pull=0.1)


def furnish_workshop(placement: Placement) -> None:
    """Work benches along the walls and in the middle, racks, cabinets, tools and material."""
    holds, style, rng = gathering_rooms().workshop, placement.style, placement.rng
    area = placement.area
    windows(placement)
    for _ in range(placement.count(holds.benches)):
        _bench_with_things(placement, at_wall=True)
    if placement.chance(holds.island):
        island = _bench_with_things(placement, at_wall=False)
        if island is not None and placement.chance(holds.stool):
            seats_around(placement, island, make_chair("stool", style, rng), 0.7, ends=False)

    bookcases(placement, placement.times(holds.bookcases, area), holds.bookcases.of)
    cabinets(placement, placement.several(holds.cabinets, area), shared().bookcases.on_top)
    wall_shelves(placement, holds.wall_shelves, area)
    wall_clutter(placement, holds.on_walls, area)
    floor_clutter(placement, holds.on_floor, area)


def _bench_with_things(placement: Placement, *, at_wall: bool) -> Placed | None:
    """Place a work bench with what is worked on; None if there is no room."""
    holds, style, rng = gathering_rooms().workshop, placement.style, placement.rng
    length = rng.uniform(*holds.bench_length)
    size = length, rng.uniform(*holds.bench_depth), rng.uniform(*holds.bench_height)
    bench = work_bench(*size, style, rng)
    if at_wall:
        placed = placement.against_wall(bench, gap=0.05, turn=0.01, tries=12)
    else:
        placed = placement.freely(bench, yaw=placement.square(), margin=0.9, tries=16)
    if placed is not None:
        dress_top(placement, placed, placement.several(holds.on_benches, length))
    return placed


def furnish_cloakroom(placement: Placement) -> None:
    """Coats along the walls, benches under them, lockers, shoes, umbrellas."""
    holds, style, rng = gathering_rooms().cloakroom, placement.style, placement.rng
    around = float(2 * placement.size.sum())
    near = None
    for _ in range(int(rng.poisson(holds.coats_per_metre * around))):
        kind = "coat hooks" if placement.chance(holds.bare_hooks) else "coats"
        item, height = make_thing(placement, kind), shared().heights[kind]
        z = rng.uniform(*height)
        near = placement.against_wall(item, z=z, gap=0.002, near=near, turn=0.0, tries=10)

    # under and beside them
    for kind in placement.several(holds.lockers, around):
        placement.against_wall(make_thing(placement, kind), gap=0.05)
    for _ in range(placement.times(holds.benches, around)):
        placement.against_wall(make_chair("bench", style, rng), gap=0.05)
    wall_clutter(placement, holds.on_walls, around)
    floor_clutter(placement, holds.on_floor, placement.area)
