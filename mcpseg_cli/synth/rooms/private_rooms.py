"""The other rooms of a home: bedroom, kitchen, study, bathroom, corridor."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import stand
from mcpseg_cli.synth.rooms.dressing import (
    bookcases,
    dress_top,
    floor_clutter,
    put_at,
    wall_clutter,
    windows,
)
from mcpseg_cli.synth.rooms.living_rooms import ON_FURNITURE, dress_home, lay_rug
from mcpseg_cli.synth.rooms.placement import Placed, Placement
from mcpseg_cli.synth.rooms.public_rooms import eating_place, keep_passage
from mcpseg_cli.synth.rooms.work_rooms import pick_chair, pick_desk, work_place
from mcpseg_cli.synth.things.bookcases import make_bookcase
from mcpseg_cli.synth.things.chairs import make_chair
from mcpseg_cli.synth.things.clutter import make_clutter
from mcpseg_cli.synth.things.home_sofas import make_home_sofa
from mcpseg_cli.synth.things.kitchen_and_washroom import counter_parts
from mcpseg_cli.synth.things.tables import make_table

_PASSAGE = 1.0  # metres of a corridor that stay free
_ON_COUNTERS = (
    "coffee machine",
    "microwave",
    "mug",
    "bottle",
    "bowl",
    "vase",
    "small carton",
    "bowl",
    "bottle",
)


def furnish_bedroom(placement: Placement) -> None:
    """A bed between small tables with lamps, wardrobes, a chest, a chair, a rug, clothes."""
    rng, area = placement.rng, float(placement.size.prod())
    windows(placement)
    bed = None
    for _ in range(3):
        if bed is None:
            item = make_clutter("bed", placement.style, rng)
            bed = placement.against_wall(item, gap=0.05, tries=12, over_windows=True)
    if bed is not None:
        for _ in range(2):
            _bedside(placement, bed)
        if placement.chance(0.6):
            x, y = bed.at(rng.normal(0, 0.3), float(bed.size[1]) * rng.uniform(0.6, 1.0))
            lay_rug(
                placement,
                (x, y, bed.yaw),
                (float(bed.size[0]) + rng.uniform(0.6, 1.2), rng.uniform(1.2, 1.8)),
            )
    bookcases(
        placement,
        int(rng.integers(1, 4)),
        ("cupboard",),
        ("small carton", "carton", "small carton"),
    )
    bookcases(placement, placement.times(0.8), ("low", "tv board", "open"), ON_FURNITURE)
    if placement.chance(0.3):
        work_place(
            placement, pick_desk(placement), pick_chair(placement, ("four-leg", "task")), wall=True
        )
    if placement.chance(0.4):
        placement.against_wall(make_chair("armchair", placement.style, rng), gap=0.15, turn=0.4)
    if placement.chance(0.35):
        placement.against_wall(make_home_sofa(2, placement.style, rng).item, gap=0.08)
    floor_clutter(
        placement,
        1.5 * placement.mess(),
        ("clothes", "laundry basket", "clothes", "suitcase", "fan"),
    )
    dress_home(placement, area)


def _bedside(placement: Placement, bed: Placed) -> None:
    """Place a small table beside a bed."""
    table = placement.against_wall(
        make_table("side", placement.style, placement.rng), near=bed, tries=0
    )
    if table is not None:
        if placement.chance(0.7):
            put_at(placement, table, "table lamp", 0.0, float(table.size[1]) / 2)
        dress_top(placement, table, ("books", "mug", "bottle", "paper"), 1.2)


def furnish_kitchen(placement: Placement) -> None:
    """Counters with cupboards over them, a fridge, at times a washing machine, a small table with chairs or stools."""
    rng, style = placement.rng, placement.style
    windows(placement)
    near = None
    for width in (rng.uniform(1.6, 2.8), rng.uniform(0.9, 1.6)):
        item = stand(
            "clutter", counter_parts(min(width, float(placement.size.max()) - 0.9), style, rng)
        )
        near = placement.against_wall(item, gap=0.005, turn=0.0, tries=16, near=near) or near
        if near is not None:
            dress_top(placement, near, _ON_COUNTERS, 3.0 + 3.0 * placement.mess())
            placement.try_poses(
                make_clutter("wall cupboard", style, rng), [(near.x, near.y, 1.45, near.yaw)]
            )
    placement.against_wall(make_clutter("fridge", style, rng), near=near)
    if placement.chance(0.4):
        placement.against_wall(make_clutter("washing machine", style, rng), near=near)
    if placement.chance(0.75):
        eating_place(placement)
    bookcases(placement, placement.times(0.5), ("low", "open", "glass"), ON_FURNITURE)
    wall_clutter(placement, 2.0, ("picture", "clock", "picture"))
    floor_clutter(
        placement,
        1.5 + placement.mess(),
        ("bin", "bin", "carton", "bag", "plant", "laundry basket"),
    )


def furnish_study(placement: Placement) -> None:
    """A desk, bookcases, often a sofa to sleep on."""
    rng, area = placement.rng, float(placement.size.prod())
    windows(placement)
    work_place(
        placement,
        pick_desk(placement),
        pick_chair(placement, ("task", "task", "executive", "four-leg")),
        wall=True,
    )
    if placement.chance(0.75):
        sofa = make_home_sofa(int(rng.integers(2, 4)), placement.style, rng)
        placement.against_wall(sofa.item, gap=0.08, tries=16)
    bookcases(placement, 1 + placement.times(1.2), ("open", "open", "low", "glass"), ON_FURNITURE)
    if placement.chance(0.4):
        middle = (placement.room.low + placement.room.high) / 2
        lay_rug(
            placement,
            (float(middle[0]), float(middle[1]), 0.0),
            (rng.uniform(1.2, 2.0), rng.uniform(1.0, 1.6)),
        )
    dress_home(placement, area)


def furnish_bathroom(placement: Placement) -> None:
    """A tub, a toilet, a basin with a mirror, often a washing machine, laundry, a mat."""
    rng, style = placement.rng, placement.style
    tub = placement.against_wall(
        make_clutter("bath tub", style, rng), gap=0.005, turn=0.0, tries=20
    )
    placement.against_wall(make_clutter("toilet", style, rng), gap=0.005, turn=0.0, tries=16)
    basin = placement.against_wall(
        make_clutter("basin", style, rng), z=0.66, gap=0.003, turn=0.0, tries=16
    )
    if basin is not None:
        placement.try_poses(
            make_clutter("mirror", style, rng), [(basin.x, basin.y, 1.15, basin.yaw)]
        )
    if placement.chance(0.5):
        placement.against_wall(make_clutter("washing machine", style, rng))
    if placement.chance(0.4):
        placement.against_wall(make_bookcase("low", style, rng))
    if tub is not None and placement.chance(0.7):
        x, y = tub.at(0.0, float(tub.size[1]) + 0.35)
        lay_rug(placement, (x, y, tub.yaw), (rng.uniform(0.7, 1.0), rng.uniform(0.45, 0.6)))
    wall_clutter(placement, 1.5, ("towel box", "picture", "coat hooks"))
    floor_clutter(placement, 2.0, ("laundry basket", "bin", "clothes", "plant"))


def furnish_corridor(placement: Placement) -> None:
    """Coats, shoes, mirrors and pictures along one wall, a runner; a way of 1 m through the whole length stays free."""
    rng, length = placement.rng, float(placement.size.max())
    keep_passage(placement, _PASSAGE)
    for _ in range(placement.times(0.15 * length)):
        placement.against_wall(
            make_bookcase(str(rng.choice(["low", "tv board", "open"])), placement.style, rng)
        )
    for _ in range(placement.times(0.08 * length)):
        placement.against_wall(make_chair("bench", placement.style, rng))
    wall_clutter(
        placement,
        0.9 * length,
        ("picture", "picture", "picture", "mirror", "coat hooks", "coat hooks", "clock"),
    )
    kinds = (
        "umbrella stand",
        "plant",
        "bag",
        "backpack",
        "coat stand",
        "carton",
        "suitcase",
        "bicycle",
        "toys",
    )
    floor_clutter(placement, length * (0.15 + 0.2 * placement.mess()), kinds)
    if placement.chance(0.6):
        middle = (placement.room.low + placement.room.high) / 2
        turn = 0.0 if placement.size[0] > placement.size[1] else np.pi / 2
        size = (min(length * 0.6, rng.uniform(1.8, 3.5)), rng.uniform(0.6, 0.8))
        lay_rug(placement, (float(middle[0]), float(middle[1]), turn), size)
