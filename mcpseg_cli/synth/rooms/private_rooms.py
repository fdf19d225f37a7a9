"""The other rooms of a home: bedroom, study, bathroom, corridor."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.rooms.contents.homes import homes
from mcpseg_cli.synth.rooms.desks import pick_desk, work_place
from mcpseg_cli.synth.rooms.dressing import (
    BASIN,
    OVER_BASINS,
    bookcases,
    dress_top,
    floor_clutter,
    lay_rug,
    make_thing,
    put_at,
    wall_clutter,
    windows,
)
from mcpseg_cli.synth.rooms.fitted import cabinets, fit_walls, room_finish
from mcpseg_cli.synth.rooms.living_rooms import chairs_at_walls, dress_home
from mcpseg_cli.synth.rooms.placed import Placed
from mcpseg_cli.synth.rooms.placement import Placement
from mcpseg_cli.synth.rooms.seating import pick_chair
from mcpseg_cli.synth.things.bookcases import make_bookcase
from mcpseg_cli.synth.things.cabinets import make_cabinet
from mcpseg_cli.synth.things.chairs import make_chair
from mcpseg_cli.synth.things.home_sofas import make_home_sofa
from mcpseg_cli.synth.things.tables import make_table


def furnish_bedroom(placement: Placement) -> None:
    """Beds between small tables with lamps, wardrobes, chests, a desk, chairs, a rug, clothes."""
    holds, style, rng = homes().bedroom, placement.style, placement.rng
    area = placement.area
    windows(placement)
    bed = _bed(placement)
    if bed is not None:
        _beside_bed(placement, bed)

    # a second bed, a desk, seats
    if placement.chance(holds.second_bed):
        _bed(placement)
    if placement.chance(holds.desk):
        desk = pick_desk(placement)
        work_place(placement, desk, pick_chair(placement, holds.desk_chairs), wall=True)
    if placement.chance(holds.armchair):
        design = placement.one_of(homes().home.armchairs)
        placement.against_wall(make_chair(design, style, rng), gap=0.15, turn=0.4)
    chairs_at_walls(placement, holds.chairs_at_walls)
    if placement.chance(holds.sofa):
        placement.against_wall(make_home_sofa(2, style, rng).item, gap=0.08)
    _bedroom_cabinets(placement)
    floor_clutter(placement, holds.on_floor, area)
    dress_home(placement)


def _bedroom_cabinets(placement: Placement) -> None:
    """Stand wardrobes, chests and shelves along the walls."""
    holds, area, on_furniture = homes().bedroom, placement.area, homes().home.on_furniture
    kinds = placement.some_of(holds.wardrobes.of, holds.wardrobes)
    cabinets(placement, kinds, holds.on_wardrobes)
    cabinets(placement, placement.several(holds.cabinets, area), on_furniture)
    count = placement.times(holds.bookcases, area)
    bookcases(placement, count, holds.bookcases.of, on_furniture)


def _bed(placement: Placement) -> Placed | None:
    """Place a bed; another one if the first does not fit."""
    for _ in range(3):
        item = make_thing(placement, placement.one_of(homes().bedroom.beds))
        bed = placement.against_wall(item, gap=0.05, tries=12, over_windows=True)
        if bed is not None:
            return bed
    return None


def _beside_bed(placement: Placement, bed: Placed) -> None:
    """Place small tables at both sides of a bed and a rug before it."""
    holds, rng = homes().bedroom, placement.rng
    finish = room_finish(placement)
    has_cabinets = placement.chance(holds.bedside_cabinets)
    for _ in range(2):
        if has_cabinets:
            item = make_cabinet("bedside cabinet", placement.style, rng, finish)
        else:
            item = make_table("side", placement.style, rng)
        table = placement.against_wall(item, near=bed, tries=0)
        if table is not None:
            if placement.chance(holds.bedside_lamp):
                put_at(placement, table, "table lamp", 0.0, float(table.size[1]) / 2)
            dress_top(placement, table, placement.several(holds.on_bedside))

    if placement.chance(holds.rug):
        spot = bed.at(rng.normal(0, 0.3), float(bed.size[1]) * rng.uniform(0.6, 1.0))
        width = float(bed.size[0]) + rng.uniform(*holds.rug_margin)
        lay_rug(placement, spot, bed.yaw, (width, rng.uniform(*holds.rug_depth)))


def furnish_study(placement: Placement) -> None:
    """A desk, bookcases, often a sofa to sleep on."""
    holds, rng = homes().study, placement.rng
    windows(placement)
    for _ in range(2 if placement.chance(holds.second_desk) else 1):
        desk = pick_desk(placement)
        work_place(placement, desk, pick_chair(placement, holds.chairs), wall=True)
    chairs_at_walls(placement, holds.chairs_at_walls)
    if placement.chance(holds.sofa):
        sofa = make_home_sofa(placement.count(holds.seats), placement.style, rng)
        placement.against_wall(sofa.item, gap=0.08, tries=16)

    kinds = placement.several(holds.cabinets, placement.area)
    cabinets(placement, kinds, homes().home.on_furniture)
    count = placement.times(holds.bookcases, placement.area)
    bookcases(placement, count, holds.bookcases.of, homes().home.on_furniture)
    if placement.chance(holds.rug):
        x, y = placement.middle.tolist()
        size = (rng.uniform(*holds.rug_width), rng.uniform(*holds.rug_depth))
        lay_rug(placement, (x, y), 0.0, size)
    dress_home(placement)


def furnish_bathroom(placement: Placement) -> None:
    """A tub or a shower, a toilet, basins with mirrors, a washing machine, towels, a mat."""
    holds, style, rng = homes().bathroom, placement.style, placement.rng
    tub = make_thing(placement, placement.one_of(holds.tubs))
    tub_placed = placement.against_wall(tub, gap=0.005, turn=0.0, tries=20)
    toilet = make_thing(placement, "toilet")
    placement.against_wall(toilet, gap=0.005, turn=0.0, tries=16)
    _basin(placement)
    for kind in placement.several(holds.on_floor_at_walls, placement.area):
        placement.against_wall(make_thing(placement, kind), gap=0.01, turn=0.0, tries=12)

    # what there is space for
    if placement.chance(holds.washing_machine):
        placement.against_wall(make_thing(placement, "washing machine"))
    if placement.chance(holds.shelf):
        placement.against_wall(make_bookcase("low", style, rng))
    if tub_placed is not None and placement.chance(holds.mat):
        spot = tub_placed.at(0.0, float(tub_placed.size[1]) + 0.35)
        size = (rng.uniform(*holds.mat_width), rng.uniform(*holds.mat_depth))
        lay_rug(placement, spot, tub_placed.yaw, size)
    wall_clutter(placement, holds.on_walls, placement.area)
    floor_clutter(placement, holds.on_floor, placement.area)


def _basin(placement: Placement) -> None:
    """Place a basin or a vanity, a mirror or a cabinet over it."""
    holds, rng = homes().bathroom, placement.rng
    if placement.chance(holds.vanity):
        vanity = make_thing(placement, "vanity")
        placed = placement.against_wall(vanity, gap=0.004, turn=0.0, tries=16)
    else:
        basin = make_thing(placement, "basin")
        placed = placement.against_wall(basin, z=BASIN, gap=0.003, turn=0.0, tries=16)
    if placed is not None:
        kind = placement.one_of(("mirror", "mirror cabinet"))
        high = OVER_BASINS + rng.uniform(0.0, 0.2)
        placement.put(make_thing(placement, kind), (placed.x, placed.y, high, placed.yaw))


def furnish_corridor(placement: Placement) -> None:
    """Coats, shoes, mirrors and pictures along one wall, a runner; a way through stays free."""
    holds, style, rng = homes().corridor, placement.style, placement.rng
    length = placement.length
    placement.keep_passage(holds.passage)
    fit_walls(placement)
    cabinets(placement, placement.several(holds.cabinets, length), homes().home.on_furniture)

    for _ in range(placement.times(holds.bookcases, length)):
        kind = placement.one_of(holds.bookcases.of)
        placement.against_wall(make_bookcase(kind, style, rng))
    for _ in range(placement.times(holds.benches, length)):
        placement.against_wall(make_chair("bench", style, rng))
    wall_clutter(placement, holds.on_walls, length)
    floor_clutter(placement, holds.on_floor, length)

    # a runner in its middle
    if placement.chance(holds.runner):
        x, y = placement.middle.tolist()
        yaw = 0.0 if placement.size[0] > placement.size[1] else np.pi / 2
        size = (
            min(length * 0.6, rng.uniform(*holds.runner_length)),
            rng.uniform(*holds.runner_width),
        )
        lay_rug(placement, (x, y), yaw, size)
