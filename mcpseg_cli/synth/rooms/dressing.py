"""What makes a room look used: things on tops, on walls, at windows and on the floor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mcpseg_cli.synth.building.rugs import make_rug
from mcpseg_cli.synth.geometry.shapes import boxes, ellipse, rectangle, solid
from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.plan import Opening
from mcpseg_cli.synth.rooms.contents.records import Amount, Several
from mcpseg_cli.synth.rooms.contents.shared import shared
from mcpseg_cli.synth.rooms.placed import Placed, about_centre
from mcpseg_cli.synth.rooms.placement import Placement
from mcpseg_cli.synth.surfaces.styles import paint
from mcpseg_cli.synth.things.boards import STANDING_BOARDS, make_board
from mcpseg_cli.synth.things.bookcases import make_bookcase
from mcpseg_cli.synth.things.clutter import make_clutter

BASIN = 0.66
"""How high a basin hangs, metres."""
OVER_BASINS = 1.15
"""How high a mirror hangs over it."""
OVER_COUNTERS = 1.45
"""How high a cupboard hangs over a counter."""
_AT_WALL = 0.8  # share of what stands on floors that stands at a wall
_HAVE_TOPS = ("low", "cupboard", "open", "glass")  # bookcases that things can stand on


def make_thing(placement: Placement, kind: str) -> Item:
    """Make a thing of class clutter in the building's style."""
    return make_clutter(kind, placement.style, placement.rng)


def put_at(
    placement: Placement, table: Placed, kind: str, along: float, out: float, yaw: float = 0.0
) -> Placed | None:
    """Place a thing on a table at a spot of the table's own frame, with a little play."""
    top, rng = table.top, placement.rng
    if top is None:
        return None
    item, poses = make_thing(placement, kind), []
    for play in (0.02, 0.08, 0.16):
        x, y = table.at(along + rng.normal(0, play), out + rng.normal(0, play / 2))
        turned = table.yaw + yaw + rng.normal(0, 0.08)
        poses.append(about_centre(item, x, y, turned, top[0]))
    return placement.try_poses(item, poses, on=table)


def dress_top(placement: Placement, support: Placed, kinds: Sequence[str]) -> None:
    """Put things on top of a cabinet, a low bookcase, a side board."""
    for kind in kinds:
        placement.on_top(support, make_thing(placement, kind), yaw=0.0, tries=5)


def bookcases(
    placement: Placement,
    count: int,
    kinds: Sequence[str],
    on_top: Sequence[str] | None = None,
) -> None:
    """Place bookcases along walls, mostly side by side and alike, with things on top of them.

    Args:
        placement: The room.
        count: How many.
        kinds: What they are drawn from.
        on_top: What the things on them are drawn from; those of offices by default.
    """
    holds, rng, near = shared().bookcases, placement.rng, None
    kind, form = placement.one_of(kinds), int(rng.integers(1 << 30))
    for _ in range(count):
        if rng.random() < holds.another_kind:
            kind, form, near = placement.one_of(kinds), int(rng.integers(1 << 30)), None
        same_form = form if rng.random() < holds.alike else None
        items = make_bookcase(kind, placement.style, rng, same_form)
        placed = placement.against_wall(items, near=near)
        if placed is None:
            continue

        # things on top, where somebody can reach them
        near, height = placed, placed.size[2]
        if kind in _HAVE_TOPS and height < placement.room.ceiling - 0.5:
            amount = holds.on_low if height < 1.3 else holds.on_high
            dress_top(placement, placed, placement.some_of(on_top or holds.on_top, amount))


def wall_shelves(placement: Placement, amount: Amount, size: float) -> None:
    """Hang shelves with books and things."""
    height = shared().heights["wall shelf"]
    for _ in range(placement.times(amount, size)):
        items = make_bookcase("wall shelf", placement.style, placement.rng)
        placement.against_wall(items, z=placement.rng.uniform(*height), gap=0.002, turn=0.0)


def floor_clutter(placement: Placement, things: Several[str], size: float) -> None:
    """Put things on the floor, mostly along the walls."""
    for kind in placement.several(things, size):
        item = make_thing(placement, kind)
        if placement.chance(_AT_WALL):
            placement.against_wall(item, gap=0.06, turn=0.15, tries=14)
        else:
            placement.freely(item, tries=4)


def wall_clutter(placement: Placement, things: Several[str], size: float) -> None:
    """Hang pictures, clocks, coats and the like on the walls."""
    for kind in placement.several(things, size):
        item, height = make_thing(placement, kind), shared().heights[kind]
        placement.hang(item, placement.rng.uniform(*height), tries=5)


def board(placement: Placement, kinds: Sequence[str]) -> Placed | None:
    """Hang a board on a wall, or place one that stands."""
    kind = placement.one_of(kinds)
    item = make_board(kind, placement.style, placement.rng)
    if kind in STANDING_BOARDS:
        return placement.against_wall(item, gap=0.2, turn=0.2)
    return placement.hang(item, placement.rng.uniform(*shared().heights["board"]), tries=12)


def windows(placement: Placement) -> None:
    """Give windows over a parapet deep sills with things on them, in some of the rooms."""
    if not placement.chance(shared().sills.chance):
        return
    for opening in placement.room.openings:
        has_parapet = 0.5 < opening.low < 1.3 and opening.glazing in ("single", "band")
        if opening.kind == "window" and has_parapet:
            _sill(placement, opening)


def _sill(placement: Placement, opening: Opening) -> None:
    """Lay a deep sill, of class window, with plants and things on it clear of a blind."""
    holds, rng, wide = shared().sills, placement.rng, opening.end - opening.start
    deep = rng.uniform(*holds.depth)
    shape = boxes((-wide / 2, 0, 0), (wide / 2, deep, 0.045))
    item = Item("window", (solid(paint((228, 226, 220), rng, "marble", 0.3), shape),))

    # over the window's own sill
    along = (opening.start + opening.end) / 2 - float(placement.room.low[opening.side % 2])
    pose = placement.wall_pose(opening.side, along, 0.002, opening.low - 0.033)
    sill = placement.put(item, pose, over_windows=True)
    if sill is None or sill.top is None:
        return

    for kind in placement.several(holds.on_top, wide):
        thing = make_thing(placement, kind)
        x, y = sill.at(rng.uniform(-0.5, 0.5) * wide, deep - 0.09)
        turned = about_centre(thing, x, y, sill.yaw + rng.normal(0, 0.2), sill.top[0])
        placement.try_poses(thing, [turned], on=sill, over_windows=True)


def lay_rug(
    placement: Placement, spot: tuple[float, float], yaw: float, size: tuple[float, float]
) -> None:
    """Lay a rug about a spot of the map frame, smaller if it would not fit; none over another."""
    rng, (x, y), room = placement.rng, spot, placement.room
    turn = yaw + (rng.normal(0, 0.25) if placement.chance(0.2) else rng.normal(0, 0.03))
    back = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    draw = rng.random()
    others = [rug.bounds()[:, :2] for rug in placement.rugs]

    for scale in (1.0, 0.85, 0.7, 0.55):
        width, depth = size[0] * scale, size[1] * scale
        if draw < 0.15:
            outline = ellipse(depth, depth)
        else:
            outline = rectangle(width, depth, 0.0 if draw < 0.8 else 0.12)

        # clear of the walls and of other rugs
        corners = outline @ back + [x, y]
        low, high = corners.min(axis=0), corners.max(axis=0)
        is_inside = (low > room.low + 0.03).all() and (high < room.high - 0.03).all()
        if is_inside and not any((low < o[1]).all() and (high > o[0]).all() for o in others):
            placement.rugs.append(make_rug(outline, placement.style, rng).moved(x=x, y=y, yaw=turn))
            return
