"""Kitchens of homes: fitted along one wall or more, or furniture put side by side."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import stand
from mcpseg_cli.synth.rooms.contents.homes import homes
from mcpseg_cli.synth.rooms.dressing import (
    OVER_COUNTERS,
    bookcases,
    dress_top,
    floor_clutter,
    make_thing,
    wall_clutter,
    windows,
)
from mcpseg_cli.synth.rooms.fitted import cabinets
from mcpseg_cli.synth.rooms.placed import Placed
from mcpseg_cli.synth.rooms.placement import Placement
from mcpseg_cli.synth.rooms.seating import eating_place
from mcpseg_cli.synth.things.kitchen_and_washroom import counter_parts
from mcpseg_cli.synth.things.kitchen_units import (
    KitchenLook,
    base_run,
    pick_kitchen,
    tall_unit,
    wall_run,
)


def furnish_kitchen(placement: Placement) -> None:
    """Base, wall and tall units, a fridge, a cooker, machines, a place to eat."""
    holds, area = homes().kitchen, placement.area
    windows(placement)
    if placement.chance(holds.fitted):
        _fitted(placement)
    else:
        _counters(placement)
    for _ in range(2):
        if placement.chance(holds.eating_place):
            eating_place(placement)

    cabinets(placement, placement.several(holds.cabinets, area), homes().home.on_furniture)
    count = placement.times(holds.bookcases, area)
    bookcases(placement, count, holds.bookcases.of, homes().home.on_furniture)
    wall_clutter(placement, holds.on_walls, area)
    floor_clutter(placement, holds.on_floor, area)


def fit_kitchenette(placement: Placement) -> None:
    """Fit a short kitchen into a room that is no kitchen."""
    look = pick_kitchen(placement.style, placement.rng, placement.wall)
    _line(placement, look, placement.rng.uniform(1.5, 2.6), hot=True)


def _fitted(placement: Placement) -> None:
    """Fit units along one wall, mostly along a second one too, with tall ones beside them."""
    holds, rng = homes().kitchen, placement.rng
    look = pick_kitchen(placement.style, rng, placement.wall)
    base = _line(placement, look, rng.uniform(2.2, 4.4), hot=True)
    for _ in range(placement.count(holds.tall_units)):
        height = min(rng.uniform(1.9, 2.3), placement.room.ceiling - 0.02)
        item = tall_unit(rng.uniform(0.45, 0.62), height, look, rng)
        near = placement.against_wall(item, gap=0.004, turn=0.0, near=base)
        base = near or base

    # machines that stand free
    free = [("fridge", holds.fridge), ("dishwasher", 0.15)]
    free.append(("washing machine", holds.washing_machine))
    for kind, share in free:
        if placement.chance(share):
            placement.against_wall(make_thing(placement, kind), near=base)
    if placement.chance(holds.second_line):
        _line(placement, look, rng.uniform(1.0, 2.8), hot=False)


def _line(placement: Placement, look: KitchenLook, longest: float, *, hot: bool) -> Placed | None:
    """Fit base units, as long as they go, with wall units over them and things on them."""
    rng = placement.rng
    lows = [o.low for o in placement.room.openings if o.kind == "window"]
    under_sills = min(lows, default=9.0) > 0.8
    for length in np.arange(longest, 0.9, -0.4):
        item, hob = base_run(float(length), look, rng, wet=hot, hot=hot)
        half, poses = float(length) / 2 + 0.004, []
        for side in rng.permutation(4).tolist():
            spare = float(placement.size[side % 2]) - 2 * half
            if spare >= 0:
                spots = [half, half + spare, half + rng.uniform(0, spare)]
                poses += [placement.wall_pose(side, spot, 0.004, 0.0) for spot in spots]
        placed = placement.try_poses(item, poses, over_windows=under_sills)
        if placed is not None:
            _over(placement, placed, look, hob)
            things = placement.several(homes().kitchen.on_counters)
            dress_top(placement, placed, things)
            return placed
    return None


def _over(placement: Placement, base: Placed, look: KitchenLook, hob: float | None) -> None:
    """Hang wall units over base units, and a hood over the hob."""
    holds, rng = homes().kitchen, placement.rng
    half, height = float(base.size[0]) / 2, look.height + rng.uniform(0.45, 0.6)
    spans = [(-half, half)]
    if hob is not None and placement.chance(holds.hood):
        hood = make_thing(placement, "hood")
        x, y = base.at(hob, 0.0)
        if placement.put(hood, (x, y, height + 0.1, base.yaw)) is not None:
            wide = float(np.ptp(hood.bounds()[:, 0])) / 2 + 0.01
            spans = [(-half, hob - wide), (hob + wide, half)]
    if not placement.chance(holds.wall_units):
        return
    for first, last in spans:
        _wall_units(placement, base, look, (first, last), height)


def _wall_units(
    placement: Placement, base: Placed, look: KitchenLook, span: tuple[float, float], height: float
) -> None:
    """Hang wall units over a stretch, in halves where a window is in the way."""
    first, last = span
    if last - first < 0.35:
        return
    item = wall_run(last - first, look, placement.rng)
    x, y = base.at((first + last) / 2, 0.0)
    if placement.put(item, (x, y, height, base.yaw)) is None and last - first > 0.8:
        middle = (first + last) / 2
        for part in ((first, middle), (middle, last)):
            _wall_units(placement, base, look, part, height)


def _counters(placement: Placement) -> None:
    """Place counters, a cooker and a fridge side by side, cupboards over the counters."""
    holds, style, rng = homes().kitchen, placement.style, placement.rng
    near = None
    for width in [rng.uniform(*ends) for ends in holds.counters]:
        parts = counter_parts(min(width, placement.length - 0.9), style, rng)
        item = stand("clutter", parts, "kitchen")
        near = placement.against_wall(item, gap=0.005, turn=0.0, tries=16, near=near) or near
        if near is not None:
            dress_top(placement, near, placement.several(holds.on_counters))
            over = (near.x, near.y, OVER_COUNTERS, near.yaw)
            placement.put(make_thing(placement, "wall cupboard"), over)
    for kind in ("cooker", "fridge", "washing machine"):
        if kind != "washing machine" or placement.chance(holds.washing_machine):
            near = placement.against_wall(make_thing(placement, kind), near=near) or near
