"""Rooms people pass through or rest in: lounges, lobbies, hallways, pantries, washrooms."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.shapes import stand
from mcpseg_cli.synth.rooms.dressing import (
    board,
    bookcases,
    dress_top,
    floor_clutter,
    seat_at,
    seats_around,
    wall_clutter,
    windows,
)
from mcpseg_cli.synth.rooms.placement import Placed, Placement, about_centre
from mcpseg_cli.synth.rooms.work_rooms import meeting_corner, pick_chair
from mcpseg_cli.synth.things.bookcases import make_bookcase
from mcpseg_cli.synth.things.boxes_and_bags import tray
from mcpseg_cli.synth.things.chairs import make_chair
from mcpseg_cli.synth.things.clutter import make_clutter
from mcpseg_cli.synth.things.kitchen_and_washroom import counter_parts
from mcpseg_cli.synth.things.sofas import make_sofa
from mcpseg_cli.synth.things.tables import make_table, meeting_parts

_ON_TABLES = ("books", "mug", "paper", "small plant", "bottle", "vase", "laptop")
_PASSAGE = 1.15  # metres of a hallway that stay free


def furnish_lounge(placement: Placement) -> None:
    """Sofas with low tables before them, armchairs, plants, a television, bookcases."""
    rng, area = placement.rng, float(placement.size.prod())
    windows(placement)
    for _ in range(int(np.clip(round(area / 12), 1, 4))):
        _sitting_group(placement)
    if placement.chance(0.6):
        placement.hang(
            make_clutter("wall tv", placement.style, rng), rng.uniform(0.9, 1.3), tries=10
        )
    for _ in range(int(rng.integers(1, 4))):
        placement.against_wall(
            pick_chair(placement, ("four-leg", "cantilever", "armchair")), turn=0.3, gap=0.1
        )
    bookcases(placement, placement.times(0.8 + area / 22), ("low", "open", "glass"))
    for _ in range(placement.times(area / 22)):
        meeting_corner(placement, pick_chair(placement, ("four-leg", "cantilever", "stool")))
    wall_clutter(placement, 2 + area * 0.1, ("picture", "picture", "picture", "clock"))
    floor_clutter(
        placement,
        2 + area * 0.12,
        (
            "plant",
            "plant",
            "floor lamp",
            "cushion",
            "bin",
            "bag",
            "coat stand",
            "water cooler",
            "fan",
            "carton",
        ),
    )


def _sitting_group(placement: Placement) -> None:
    """Place a sofa, a low table before it and armchairs opposite or beside."""
    rng = placement.rng
    sofa = make_sofa(int(rng.integers(1, 4)), placement.style, rng)
    placed = (
        placement.against_wall(sofa, gap=0.1, turn=0.02)
        if placement.chance(0.75)
        else placement.freely(sofa, yaw=float(rng.integers(4)) * np.pi / 2, margin=0.5)
    )
    if placed is None:
        return
    table = make_table("coffee", placement.style, rng)
    poses = []
    for far in (0.35, 0.45, 0.6):
        x, y = placed.at(rng.normal(0, 0.1), placed.size[1] + far + float(table.bounds()[1, 1]) / 2)
        poses.append(about_centre(table, x, y, placed.yaw + rng.normal(0, 0.06)))
    low = placement.try_poses(table, poses)
    if low is None:
        return
    dress_top(placement, low, _ON_TABLES, 2 + 2 * placement.mess())
    chair = make_chair("armchair", placement.style, rng)
    for side in rng.permutation([1.0, 2.0, -2.0])[: int(rng.integers(1, 4))]:
        seat_at(
            placement, low, chair, rng.normal(0, 0.1), side=float(side), pull=rng.uniform(0.35, 0.6)
        )


def furnish_lobby(placement: Placement) -> None:
    """A reception desk, sofas and benches, plants, pictures, notice boards."""
    rng, area = placement.rng, float(placement.size.prod())
    windows(placement)
    if area > 15 and placement.chance(0.6):
        desk = placement.freely(
            make_table("corner", placement.style, rng),
            yaw=float(rng.integers(4)) * np.pi / 2,
            margin=0.8,
        )
        if desk is not None:
            seat_at(placement, desk, pick_chair(placement, ("task",)), 0.0)
            dress_top(
                placement,
                desk,
                ("monitor", "keyboard", "telephone", "paper", "small plant", "pen pot"),
                5,
            )
    for _ in range(int(np.clip(area / 14, 1, 5))):
        if placement.chance(0.5):
            _sitting_group(placement)
        else:
            placement.against_wall(make_chair("bench", placement.style, rng), gap=0.08)
    if placement.chance(0.5):
        board(placement, ("pin board", "pin board", "whiteboard"))
    bookcases(placement, placement.times(0.5), ("low", "glass"))
    wall_clutter(placement, 2 + area * 0.06, ("picture", "picture", "clock", "wall box"))
    floor_clutter(
        placement,
        2 + area * 0.06,
        (
            "plant",
            "plant",
            "bin",
            "umbrella stand",
            "coat stand",
            "water cooler",
            "vending machine",
            "floor lamp",
            "tv stand",
        ),
    )


def furnish_hallway(placement: Placement) -> None:
    """A few things along one wall; a way of 1.15 m through the whole length stays free."""
    rng, length = placement.rng, float(placement.size.max())
    keep_passage(placement, _PASSAGE)
    windows(placement)
    for _ in range(placement.times(0.09 * length)):
        board(placement, ("pin board", "pin board", "whiteboard"))
    for _ in range(placement.times(0.17 * length)):
        placement.against_wall(make_chair("bench", placement.style, rng))
    guest = pick_chair(placement, ("four-leg", "cantilever", "folding"))
    for _ in range(placement.times(0.22 * length)):
        placement.against_wall(guest, turn=0.1)
    for _ in range(placement.times(0.1 * length)):
        placement.against_wall(
            make_bookcase(
                str(rng.choice(["low", "open", "glass", "cupboard"])), placement.style, rng
            )
        )
    wall_clutter(
        placement, 0.8 * length, ("picture", "picture", "picture", "wall box", "cable run", "clock")
    )
    floor_clutter(
        placement,
        length * (0.15 + 0.3 * placement.mess()),
        (
            "bin",
            "plant",
            "lockers",
            "water cooler",
            "carton",
            "carton pile",
            "filing cabinet",
            "umbrella stand",
            "bicycle",
            "copier",
            "leaning board",
            "vending machine",
            "trolley",
        ),
    )


def keep_passage(placement: Placement, width: float) -> None:
    """Keep a way of a width free along a corridor, nearer to one of its walls."""
    along = int(np.argmax(placement.size))
    low, high = np.append(placement.room.low, 0.0), np.append(placement.room.high, 2.1)
    spare, flat = max(float(placement.size[1 - along]) - width, 0.0), 0.12
    rich = placement.chance(0.5)  # which wall has furniture
    low[1 - along] += min(flat, spare / 2) if rich else spare - min(flat, spare / 2)
    high[1 - along] = low[1 - along] + width
    placement.keep_free(low.tolist(), high.tolist())


def furnish_pantry(placement: Placement) -> None:
    """A counter with cupboards over it, a fridge, machines, tables with chairs or stools."""
    rng = placement.rng
    windows(placement)
    top, below = None, None
    length = float(placement.size.max())
    for width in (rng.uniform(1.6, 3.0), 1.2):
        if below is None:
            below = placement.against_wall(
                stand("clutter", counter_parts(min(width, length - 1.0), placement.style, rng)),
                gap=0.005,
                turn=0.0,
                tries=12,
            )
    if below is not None:
        for kind in ("coffee machine", "microwave", "mug", "mug", "bottle", "vase"):
            placement.on_top(below, make_clutter(kind, placement.style, rng), yaw=0.0)
        top = placement.try_poses(
            make_clutter("wall cupboard", placement.style, rng),
            [(below.x, below.y, 1.45, below.yaw)],
        )
    placement.against_wall(make_clutter("fridge", placement.style, rng), near=below)
    if placement.chance(0.4):
        placement.against_wall(make_clutter("vending machine", placement.style, rng))
    for _ in range(int(np.clip(placement.size.prod() / 6, 1, 5))):
        eating_place(placement)
    if top is None and placement.chance(0.5):
        placement.hang(make_clutter("wall cupboard", placement.style, rng), 1.45)
    wall_clutter(placement, 3.0, ("picture", "clock", "towel box", "wall box", "picture"))
    floor_clutter(
        placement,
        2.5 + 2 * placement.mess(),
        ("bin", "bin", "water cooler", "plant", "carton", "carton pile", "trolley"),
    )


def eating_place(placement: Placement) -> None:
    """Place a small table with chairs, or a high one with stools."""
    rng = placement.rng
    if placement.chance(0.4):
        table = stand(
            "table",
            meeting_parts(
                rng.uniform(1.1, 2.0), rng.uniform(0.7, 0.95), 0.74, placement.style, rng
            ),
        )
    else:
        table = make_table(str(rng.choice(["round", "pedestal", "trestle"])), placement.style, rng)
    placed: Placed | None = placement.freely(
        table, yaw=float(rng.integers(4)) * np.pi / 2, margin=0.4
    )
    if placed is None:
        return
    chair = (
        make_chair("stool", placement.style, rng)
        if placed.size[2] > 0.9
        else pick_chair(placement, ("four-leg", "cantilever", "folding", "stool"))
    )
    seats_around(
        placement,
        placed,
        chair,
        0.65,
        ends=False,
        round_=bool(abs(placed.size[0] - placed.size[1]) < 0.05),
    )
    dress_top(placement, placed, ("mug", "bottle", "paper", "vase", "books"), 2.0)


def furnish_washroom(placement: Placement) -> None:
    """Toilets between partitions along one wall, basins with mirrors, dispensers, a bin."""
    rng = placement.rng
    sides = [0, 2] if placement.size[0] >= placement.size[1] else [1, 3]
    glazed = {opening.side for opening in placement.room.openings}
    side = min(rng.permutation(sides).tolist(), key=lambda number: number in glazed)
    deep = float(placement.size[1 - side % 2])
    pitch, length = rng.uniform(0.95, 1.1), float(placement.size[side % 2])
    wall = make_clutter("stall wall", placement.style, rng)
    bowl = make_clutter("toilet" if placement.chance(0.8) else "urinal", placement.style, rng)
    z = 0.0 if bowl.bounds()[1, 2] > 0.7 else 0.35
    count = max(int((length - 0.3) / pitch), 1)
    for number in range(min(count, 5)):
        placement.put(bowl, placement.wall_pose(side, 0.1 + (number + 0.5) * pitch, 0.005, z))
        if deep > 2.3 and z == 0.0:
            placement.put(wall, placement.wall_pose(side, 0.1 + (number + 1) * pitch, 0.005, 0.0))
    near = None
    basin = make_clutter("basin", placement.style, rng)
    for _ in range(int(rng.integers(1, 4))):
        near = (
            placement.against_wall(basin, z=0.66, gap=0.003, near=near, turn=0.0, tries=12) or near
        )
        if near is not None and placement.chance(0.8):
            placement.try_poses(
                make_clutter("mirror", placement.style, rng), [(near.x, near.y, 1.15, near.yaw)]
            )
    for kind in ("towel box", "towel box", "wall box"):
        placement.hang(make_clutter(kind, placement.style, rng), rng.uniform(1.0, 1.3))
    floor_clutter(placement, 2.0, ("bin", "bin", "trolley", "carton"))
    if placement.chance(0.3):
        placement.against_wall(stand("clutter", tray(placement.style, rng)), gap=0.1)
