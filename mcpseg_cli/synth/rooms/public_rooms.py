"""Rooms people pass through or rest in: lounges, lobbies, hallways, pantries, washrooms."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import stand
from mcpseg_cli.synth.rooms.contents.public import public_rooms
from mcpseg_cli.synth.rooms.dressing import (
    BASIN,
    OVER_BASINS,
    OVER_COUNTERS,
    board,
    bookcases,
    dress_top,
    floor_clutter,
    make_thing,
    wall_clutter,
    windows,
)
from mcpseg_cli.synth.rooms.placed import Placed, about_centre
from mcpseg_cli.synth.rooms.placement import Placement
from mcpseg_cli.synth.rooms.seating import eating_place, meeting_corner, pick_chair, seat_at
from mcpseg_cli.synth.things.bookcases import make_bookcase
from mcpseg_cli.synth.things.boxes_and_bags import tray
from mcpseg_cli.synth.things.chairs import make_chair
from mcpseg_cli.synth.things.kitchen_and_washroom import counter_parts
from mcpseg_cli.synth.things.sofas import make_sofa
from mcpseg_cli.synth.things.tables import make_table


def furnish_lounge(placement: Placement) -> None:
    """Sofas with low tables before them, armchairs, plants, a television, bookcases."""
    holds, rng, area = public_rooms().lounge, placement.rng, placement.area
    windows(placement)
    groups = round(area / holds.area_per_sitting_group)
    for _ in range(int(np.clip(groups, 1, holds.most_sitting_groups))):
        _sitting_group(placement)

    # what stands along the walls
    if placement.chance(holds.television):
        placement.hang(make_thing(placement, "wall tv"), rng.uniform(0.9, 1.3), tries=10)
    for _ in range(placement.count(holds.chairs_at_walls)):
        placement.against_wall(pick_chair(placement, holds.chairs), turn=0.3, gap=0.1)
    bookcases(placement, placement.times(holds.bookcases, area), holds.bookcases.of)

    # tables to talk at, and what lies about
    for _ in range(placement.times(holds.meeting_corners, area)):
        meeting_corner(placement, pick_chair(placement, holds.meeting_corners.of))
    wall_clutter(placement, holds.on_walls, area)
    floor_clutter(placement, holds.on_floor, area)


def _sitting_group(placement: Placement) -> None:
    """Place a sofa, a low table before it and armchairs opposite or beside."""
    holds, style, rng = public_rooms().sitting_group, placement.style, placement.rng
    sofa = make_sofa(placement.count(holds.seats), style, rng)
    if placement.chance(holds.at_wall):
        placed = placement.against_wall(sofa, gap=0.1, turn=0.02)
    else:
        placed = placement.freely(sofa, yaw=placement.square(), margin=0.5)
    if placed is None:
        return

    # the table, as near as it fits
    table, poses = make_table("coffee", style, rng), []
    deep = float(table.bounds()[1, 1])
    for far in (0.35, 0.45, 0.6):
        x, y = placed.at(rng.normal(0, 0.1), placed.size[1] + far + deep / 2)
        poses.append(about_centre(table, x, y, placed.yaw + rng.normal(0, 0.06)))
    low = placement.try_poses(table, poses)
    if low is None:
        return
    dress_top(placement, low, placement.several(holds.on_table))

    # armchairs at its free sides
    chair = make_chair("armchair", style, rng)
    for side in rng.permutation([1.0, 2.0, -2.0])[: placement.count(holds.armchairs)].tolist():
        off = rng.normal(0, 0.1)
        seat_at(placement, low, chair, off, side=side, pull=rng.uniform(0.35, 0.6))


def furnish_lobby(placement: Placement) -> None:
    """A reception desk, sofas and benches, plants, pictures, notice boards."""
    holds, style, rng = public_rooms().lobby, placement.style, placement.rng
    area = placement.area
    windows(placement)

    # somebody at the reception
    if placement.has(holds.reception):
        table = make_table("corner", style, rng)
        desk = placement.freely(table, yaw=placement.square(), margin=0.8)
        if desk is not None:
            seat_at(placement, desk, pick_chair(placement, ("task",)), 0.0)
            dress_top(placement, desk, placement.several(holds.on_reception))

    # places to wait
    for _ in range(int(np.clip(area / holds.area_per_seat, 1, holds.most_seats))):
        if placement.chance(holds.sitting_group):
            _sitting_group(placement)
        else:
            placement.against_wall(make_chair("bench", style, rng), gap=0.08)

    # what hangs and stands along the walls
    if placement.has(holds.board):
        board(placement, holds.board.of)
    bookcases(placement, placement.times(holds.bookcases, area), holds.bookcases.of)
    wall_clutter(placement, holds.on_walls, area)
    floor_clutter(placement, holds.on_floor, area)


def furnish_hallway(placement: Placement) -> None:
    """A few things along one wall; a way through the whole length stays free."""
    holds, style, rng = public_rooms().hallway, placement.style, placement.rng
    length = placement.length
    placement.keep_passage(holds.passage)
    windows(placement)

    for _ in range(placement.times(holds.boards, length)):
        board(placement, holds.boards.of)
    for _ in range(placement.times(holds.benches, length)):
        placement.against_wall(make_chair("bench", style, rng))
    guest = pick_chair(placement, holds.chairs.of)
    for _ in range(placement.times(holds.chairs, length)):
        placement.against_wall(guest, turn=0.1)
    for _ in range(placement.times(holds.bookcases, length)):
        kind = placement.one_of(holds.bookcases.of)
        placement.against_wall(make_bookcase(kind, style, rng))

    wall_clutter(placement, holds.on_walls, length)
    floor_clutter(placement, holds.on_floor, length)


def furnish_pantry(placement: Placement) -> None:
    """A counter with cupboards over it, a fridge, machines, tables with chairs or stools."""
    holds, area = public_rooms().pantry, placement.area
    windows(placement)

    # the counter, a short one where a long one does not fit
    below = _counter(placement)
    top = None
    if below is not None:
        for kind in holds.on_counter:
            placement.on_top(below, make_thing(placement, kind), yaw=0.0)
        over = (below.x, below.y, OVER_COUNTERS, below.yaw)
        top = placement.put(make_thing(placement, "wall cupboard"), over)

    # machines, and places to eat
    placement.against_wall(make_thing(placement, "fridge"), near=below)
    if placement.chance(holds.vending_machine):
        placement.against_wall(make_thing(placement, "vending machine"))
    places = np.clip(area / holds.area_per_eating_place, 1, holds.most_eating_places)
    for _ in range(int(places)):
        eating_place(placement)

    if top is None and placement.chance(holds.cupboard_elsewhere):
        placement.hang(make_thing(placement, "wall cupboard"), OVER_COUNTERS)
    wall_clutter(placement, holds.on_walls, area)
    floor_clutter(placement, holds.on_floor, area)


def _counter(placement: Placement) -> Placed | None:
    """Place a pantry's counter."""
    holds, style, rng = public_rooms().pantry, placement.style, placement.rng
    for width in (rng.uniform(*holds.counter), holds.short_counter):
        parts = counter_parts(min(width, placement.length - 1.0), style, rng)
        counter = stand("clutter", parts, "kitchen")
        placed = placement.against_wall(counter, gap=0.005, turn=0.0, tries=12)
        if placed is not None:
            return placed
    return None


def furnish_washroom(placement: Placement) -> None:
    """Toilets between partitions along one wall, basins with mirrors, dispensers, a bin."""
    holds, style, rng = public_rooms().washroom, placement.style, placement.rng
    _stalls(placement)

    # basins, side by side
    near = None
    basin = make_thing(placement, "basin")
    for _ in range(placement.count(holds.basins)):
        placed = placement.against_wall(basin, z=BASIN, gap=0.003, near=near, turn=0.0, tries=12)
        near = placed or near
        if near is not None and placement.chance(holds.mirror):
            mirror = make_thing(placement, "mirror")
            placement.put(mirror, (near.x, near.y, OVER_BASINS, near.yaw))

    for kind in holds.on_walls:
        placement.hang(make_thing(placement, kind), rng.uniform(1.0, 1.3))
    floor_clutter(placement, holds.on_floor, placement.area)
    if placement.chance(holds.trays):
        placement.against_wall(stand("clutter", tray(style, rng)), gap=0.1)


def _stalls(placement: Placement) -> None:
    """Line up toilets or urinals along a longer wall, the one without windows if there is one."""
    holds, rng, size = public_rooms().washroom, placement.rng, placement.size
    sides = [0, 2] if size[0] >= size[1] else [1, 3]
    glazed = {opening.side for opening in placement.room.openings}
    side = min(rng.permutation(sides).tolist(), key=lambda number: number in glazed)
    deep, length = float(size[1 - side % 2]), float(size[side % 2])

    # what stands in them
    pitch = rng.uniform(*holds.stall_width)
    wall = make_thing(placement, "stall wall")
    bowl = make_thing(placement, "toilet" if placement.chance(holds.toilets) else "urinal")
    z = 0.0 if bowl.bounds()[1, 2] > 0.7 else 0.35

    # walls between toilets where there is space before them
    count = max(int((length - 0.3) / pitch), 1)
    for number in range(min(count, holds.most_stalls)):
        placement.put(bowl, placement.wall_pose(side, 0.1 + (number + 0.5) * pitch, 0.005, z))
        if deep > 2.3 and z == 0.0:
            placement.put(wall, placement.wall_pose(side, 0.1 + (number + 1) * pitch, 0.005, 0.0))
