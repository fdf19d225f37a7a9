"""Rooms a household lives in together: living rooms and dining rooms."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.building.rugs import make_rug
from mcpseg_cli.synth.geometry.shapes import ellipse, rectangle, stand
from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.rooms.dressing import (
    bookcases,
    dress_top,
    floor_clutter,
    put_at,
    seat_at,
    seats_around,
    wall_clutter,
    wall_shelves,
    windows,
)
from mcpseg_cli.synth.rooms.placement import Placed, Placement, about_centre
from mcpseg_cli.synth.rooms.work_rooms import pick_chair
from mcpseg_cli.synth.things.bookcases import make_bookcase
from mcpseg_cli.synth.things.chairs import make_chair
from mcpseg_cli.synth.things.clutter import make_clutter
from mcpseg_cli.synth.things.home_sofas import HomeSofa, make_home_sofa
from mcpseg_cli.synth.things.tables import make_table, meeting_parts

ON_FURNITURE = (
    "books",
    "small plant",
    "vase",
    "bowl",
    "candles",
    "figure",
    "table lamp",
    "loudspeaker",
    "small carton",
)
"""What stands on sideboards and shelves of homes."""
_ON_COFFEE_TABLES = (
    "mug",
    "mug",
    "books",
    "paper",
    "bowl",
    "bowl",
    "candles",
    "candles",
    "bottle",
    "small plant",
    "vase",
    "laptop",
)
_ON_DINING_TABLES = (
    "mug",
    "bowl",
    "bowl",
    "bottle",
    "vase",
    "candles",
    "paper",
    "books",
    "laptop",
    "small plant",
)
_ON_HOME_WALLS = ("picture", "picture", "picture", "picture", "clock", "mirror")
_ON_HOME_FLOORS = (
    "plant",
    "plant",
    "plant",
    "cushion",
    "toys",
    "bag",
    "clothes",
    "standard lamp",
    "laundry basket",
    "backpack",
    "carton",
    "umbrella stand",
    "coat stand",
    "bin",
)
_DINING_CHAIRS = ("four-leg", "four-leg", "four-leg", "cantilever", "armchair")


def furnish_living_room(placement: Placement) -> None:
    """Sofas, a low table full of things, armchairs, a rug, a television, lamps, bookcases; with space a meal table."""
    area = float(placement.size.prod())
    windows(placement)
    _sitting_group(placement)
    if area > 14 and placement.chance(0.55):
        dining_group(placement)
    if placement.chance(0.5):
        placement.against_wall(
            make_home_sofa(2, placement.style, placement.rng).item, gap=0.1, tries=12
        )
    kinds = ("low", "open", "glass", "open", "cupboard")
    bookcases(placement, placement.times(0.8 + area / 13), kinds, ON_FURNITURE)
    for _ in range(placement.times(0.7)):
        placement.against_wall(
            make_clutter("standard lamp", placement.style, placement.rng), gap=0.15
        )
    for _ in range(placement.times(0.5)):
        _side_table(placement, None)
    dress_home(placement, area)


def dress_home(placement: Placement, area: float) -> None:
    """Hang pictures and shelves, put plants, toys, clothes and lamps about, more in untidy homes."""
    wall_shelves(placement, 0.4)
    wall_clutter(placement, 2.0 + 0.08 * area, _ON_HOME_WALLS)
    floor_clutter(placement, 2.0 + area * (0.1 + 0.2 * placement.mess()), _ON_HOME_FLOORS)


def _sitting_group(placement: Placement) -> None:
    """Place the sofa, what stands before, beside and opposite it, and the rug under it all."""
    rng = placement.rng
    placed, sofa = _main_sofa(placement)
    if placed is None:
        return
    _television(placement, placed, sofa)
    table = _coffee_table(placement, placed, sofa) if placement.chance(0.92) else None
    if table is not None:
        sides = rng.permutation([1.0, 2.0, -2.0]).tolist()
        if placement.chance(0.8):
            other = make_home_sofa(int(rng.integers(2, 4)), placement.style, rng).item
            _opposite(placement, table, other, sides)
        chair = make_chair("armchair", placement.style, rng)
        for side in sides[: int(rng.integers(0, 4))]:
            seat_at(
                placement, table, chair, rng.normal(0, 0.1), side=side, pull=rng.uniform(0.35, 0.6)
            )
    if placement.chance(0.6):
        _side_table(placement, placed)
    if placement.chance(0.75):
        x, y = placed.at(sofa.middle + rng.normal(0, 0.1), sofa.depth + rng.uniform(0.2, 0.7))
        lay_rug(placement, (x, y, placed.yaw), (rng.uniform(1.6, 2.9), rng.uniform(1.2, 2.1)))


def _main_sofa(placement: Placement) -> tuple[Placed | None, HomeSofa]:
    """Place the largest sofa that fits, mostly at a wall."""
    rng, wide = placement.rng, float(placement.size.min()) > 3.2
    for seats in (int(rng.integers(2, 5)), 3, 2, 2, 2):
        corner = (
            float(rng.choice([-1.0, 1.0])) if wide and seats > 1 and placement.chance(0.5) else 0.0
        )
        sofa = make_home_sofa(seats, placement.style, rng, corner)
        at_wall = placement.chance(0.85)
        square = float(rng.integers(4)) * np.pi / 2
        placed = (
            placement.against_wall(sofa.item, gap=0.1, tries=16)
            if at_wall
            else placement.freely(sofa.item, yaw=square, margin=0.5)
        )
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
        dress_top(placement, low, _ON_COFFEE_TABLES, 2.5 + 6.0 * placement.mess())
    return low


def _opposite(placement: Placement, table: Placed, sofa: Item, sides: list[float]) -> None:
    """Place a second sofa at a side of the low table, or at a wall."""
    rng, poses = placement.rng, []
    depth = float(sofa.bounds()[1, 1])
    for side in sides:
        for far in (rng.uniform(0.3, 0.6), 0.35):
            out = depth / 2 + far
            if abs(side) < 1.5:
                x, y = table.at(0.0, float(table.size[1]) + out)
                face = np.pi
            else:
                x, y = table.at(
                    np.sign(side) * (float(table.size[0]) / 2 + out), float(table.size[1]) / 2
                )
                face = np.pi / 2 * np.sign(side)
            poses.append(about_centre(sofa, x, y, table.yaw + face + rng.normal(0, 0.03)))
    if placement.try_poses(sofa, poses) is None:
        placement.against_wall(sofa, gap=0.1, tries=12)


def _television(placement: Placement, placed: Placed, sofa: HomeSofa) -> None:
    """Place a low board opposite the sofa, a television on it or on the wall over it."""
    rng, room = placement.rng, placement.room
    side = (round(placed.yaw / (np.pi / 2)) + 2) % 4
    spot = placed.at(sofa.middle, 0.0)[side % 2] - float(room.low[side % 2])
    items = make_bookcase("tv board", placement.style, rng)
    steps = (0.0, 0.3, -0.3, 0.7, -0.7, 1.1, -1.1)
    poses = [placement.wall_pose(side, spot + step, rng.uniform(0.02, 0.06), 0.0) for step in steps]
    board = placement.try_poses(items, poses) or placement.against_wall(items, tries=10)
    if board is None:
        return
    if placement.chance(0.6):
        put_at(placement, board, "television", 0.0, float(board.size[1]) * 0.5)
    else:
        x, y = board.at(0.0, 0.0)
        face = (round(board.yaw / (np.pi / 2))) % 4
        along = (x, y)[face % 2] - float(room.low[face % 2])
        screen = make_clutter("wall tv", placement.style, rng)
        placement.put(screen, placement.wall_pose(face, along, 0.002, rng.uniform(0.85, 1.15)))
    dress_top(placement, board, ON_FURNITURE, 1.5 + 3.0 * placement.mess())


def _side_table(placement: Placement, near: Placed | None) -> None:
    """Place a small table at a wall, beside something if there is something, with a lamp on it."""
    table = make_table("side", placement.style, placement.rng)
    placed = placement.against_wall(table, near=near, gap=0.05)
    if placed is not None:
        if placement.chance(0.6):
            put_at(placement, placed, "table lamp", 0.0, float(placed.size[1]) / 2)
        dress_top(
            placement, placed, ("books", "mug", "bowl", "small plant", "candles", "bottle"), 1.0
        )


def lay_rug(
    placement: Placement, pose: tuple[float, float, float], size: tuple[float, float]
) -> None:
    """Lay a rug about a place (x, y, yaw) in the map frame, smaller if it would not fit; none over another."""
    rng, (x, y, yaw) = placement.rng, pose
    turn = yaw + (rng.normal(0, 0.25) if placement.chance(0.2) else rng.normal(0, 0.03))
    draw = rng.random()
    for scale in (1.0, 0.85, 0.7, 0.55):
        width, depth = size[0] * scale, size[1] * scale
        outline = (
            ellipse(depth, depth)
            if draw < 0.15
            else rectangle(width, depth, 0.0 if draw < 0.8 else 0.12)
        )
        corners = outline @ np.array(
            [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
        ) + [x, y]
        low, high = corners.min(axis=0), corners.max(axis=0)
        is_inside = (low > placement.room.low + 0.03).all() and (
            high < placement.room.high - 0.03
        ).all()
        others = [rug.bounds()[:, :2] for rug in placement.rugs]
        if is_inside and not any(
            (low < other[1]).all() and (high > other[0]).all() for other in others
        ):
            placement.rugs.append(make_rug(outline, placement.style, rng).moved(x=x, y=y, yaw=turn))
            return


def furnish_dining_room(placement: Placement) -> None:
    """A meal table with chairs, a sideboard, a glass cabinet, at times a sofa by the wall."""
    area = float(placement.size.prod())
    windows(placement)
    dining_group(placement)
    bookcases(
        placement, 1 + placement.times(0.8), ("low", "low", "glass", "cupboard"), ON_FURNITURE
    )
    if placement.chance(0.4):
        sofa = make_home_sofa(2, placement.style, placement.rng)
        placement.against_wall(sofa.item, gap=0.08, tries=12)
    dress_home(placement, area)


def dining_group(placement: Placement) -> None:
    """Place a meal table with chairs about it, things on it and at times a rug under it."""
    rng, style = placement.rng, placement.style
    is_round = placement.chance(0.3)
    length, depth = rng.uniform(1.1, 2.1), rng.uniform(0.75, 1.0)
    table = (
        make_table("round", style, rng)
        if is_round
        else stand("table", meeting_parts(length, depth, 0.75, style, rng))
    )
    placed = placement.freely(table, yaw=float(rng.integers(4)) * np.pi / 2, margin=0.85, tries=24)
    if placed is None:
        return
    seats_around(placement, placed, pick_chair(placement, _DINING_CHAIRS), 0.62, round_=is_round)
    dress_top(placement, placed, _ON_DINING_TABLES, 2.0 + 4.0 * placement.mess())
    if placement.chance(0.4):
        x, y = placed.at(0.0, float(placed.size[1]) / 2)
        lay_rug(
            placement,
            (x, y, placed.yaw),
            (float(placed.size[0]) + 0.9, float(placed.size[1]) + 0.9),
        )
