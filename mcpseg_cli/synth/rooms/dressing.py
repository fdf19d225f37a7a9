"""What makes a room look used: chairs at tables, things on tops, on walls, at windows and on the floor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mcpseg_cli.synth.geometry.shapes import boxes, solid
from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.plan import Opening
from mcpseg_cli.synth.rooms.placement import Placed, Placement, about_centre
from mcpseg_cli.synth.surfaces.styles import paint
from mcpseg_cli.synth.things.boards import make_board
from mcpseg_cli.synth.things.bookcases import make_bookcase
from mcpseg_cli.synth.things.clutter import make_clutter

_ON_DESKS = (
    "mug",
    "paper",
    "books",
    "pen pot",
    "telephone",
    "small plant",
    "desk lamp",
    "trays",
    "bottle",
    "figure",
    "paper",
    "loudspeaker",
    "printer",
)
_OFFICE_WALLS = ("picture", "picture", "picture", "clock", "coat hooks", "wall box", "cable run")
_ON_CABINETS = (
    "small carton",
    "small carton",
    "small carton",
    "small plant",
    "books",
    "vase",
    "trays",
    "printer",
    "figure",
    "paper",
    "loudspeaker",
    "bottle",
)
_ON_FLOOR = (
    "carton",
    "carton",
    "carton pile",
    "carton pile",
    "backpack",
    "bag",
    "bin",
    "suitcase",
    "cables",
    "fan",
    "drawer unit",
    "pc tower",
    "cushion",
    "leaning board",
)
_ON_SILLS = ("small plant", "books", "vase", "figure", "mug", "bottle", "small plant")
_ON_WALLS = {
    "picture": (1.1, 1.6),
    "clock": (1.9, 2.3),
    "coat hooks": (0.6, 0.8),
    "wall box": (1.0, 1.6),
    "cable run": (0.02, 0.3),
    "mirror": (0.9, 1.2),
    "towel box": (1.0, 1.3),
}


def seat_at(
    placement: Placement,
    table: Placed,
    chair: Item,
    along: float,
    *,
    side: float = 1.0,
    pull: float = 0.0,
) -> Placed | None:
    """Place a chair at a table, facing it, pushed under as far as it goes.

    Args:
        placement: The room.
        table: What it stands at.
        chair: In its own frame.
        along: Where along the table's width, metres from its middle.
        side: 1 for its front, -1 for its back, 2 for the end at +x, -2 for the end at -x.
        pull: How far it is pulled away from the table, metres.
    """
    rng, depth, poses = placement.rng, float(chair.bounds()[1, 1]), []
    width, deep = float(table.size[0]), float(table.size[1])
    turn = rng.normal(0, 0.25) if rng.random() < 0.7 else rng.normal(0, 0.9)
    for under, step in (
        (rng.uniform(0.1, 0.3), 0.0),
        (0.2, 0.0),
        (0.08, 0.25),
        (0.08, -0.25),
        (-0.1, 0.0),
        (-0.2, 0.2),
    ):
        out = depth / 2 - under + (pull if step == 0.0 else 0.0)
        if abs(side) < 1.5:
            x, y = table.at(along + step + rng.normal(0, 0.05), deep + out if side > 0 else -out)
            face = np.pi if side > 0 else 0.0
        else:
            x, y = table.at(np.sign(side) * (width / 2 + out), deep / 2 + along)
            face = np.pi / 2 * np.sign(side)
        poses.append(about_centre(chair, x, y, table.yaw + face + turn))
    return placement.try_poses(chair, poses)


def seats_around(
    placement: Placement,
    table: Placed,
    chair: Item,
    pitch: float,
    *,
    ends: bool = True,
    round_: bool = False,
) -> None:
    """Place chairs on both long sides of a table and at its ends, or in a ring; some are missing, some pulled out."""
    rng = placement.rng
    width, deep = float(table.size[0]), float(table.size[1])
    if round_:
        count = max(int(np.pi * width / pitch / 1.1), 2)
        for angle in rng.uniform(0, 6.28) + np.arange(count) * (2 * np.pi / count):
            turn, poses = table.yaw + angle + np.pi / 2 + rng.normal(0, 0.25), []
            for far in (rng.uniform(-0.05, 0.25), 0.1, 0.25, 0.4):
                reach = width / 2 + far
                poses.append(
                    about_centre(
                        chair,
                        *table.at(np.cos(angle) * reach, deep / 2 + np.sin(angle) * reach),
                        turn,
                    )
                )
            if rng.random() < 0.95:
                placement.try_poses(chair, poses)
        return
    count = max(int((width - 0.2) / pitch), 1)
    for side in (1.0, -1.0):
        for number in range(count):
            if rng.random() < 0.96:
                spread = (number - (count - 1) / 2) * (width - 0.2) / count
                seat_at(
                    placement, table, chair, spread, side=side, pull=float(abs(rng.normal(0, 0.12)))
                )
    for side in (2.0, -2.0):
        if ends and rng.random() < 0.8:
            seat_at(placement, table, chair, 0.0, side=side)


def put_at(
    placement: Placement, table: Placed, kind: str, along: float, out: float, yaw: float = 0.0
) -> Placed | None:
    """Place a thing on a table at a spot of the table's own frame, with a little play."""
    top = table.top
    if top is None:
        return None
    item = make_clutter(kind, placement.style, placement.rng)
    poses = []
    for play in (0.02, 0.08, 0.16):
        x, y = table.at(
            along + placement.rng.normal(0, play), out + placement.rng.normal(0, play / 2)
        )
        poses.append(
            about_centre(item, x, y, table.yaw + yaw + placement.rng.normal(0, 0.08), top[0])
        )
    return placement.try_poses(item, poses, on=table)


def dress_desk(placement: Placement, desk: Placed, *, computer: float = 0.85) -> None:
    """Put a computer on a desk and papers, mugs and the like around it, more in untidy buildings."""
    rng, width, depth = placement.rng, float(desk.size[0]), min(float(desk.size[1]), 0.8)
    along = rng.normal(0, 0.12) * width
    if rng.random() < computer:
        draw = rng.random()
        if draw < 0.3 and width > 1.3:
            put_at(placement, desk, "monitor pair", along, 0.2)
        elif draw < 0.8:
            put_at(placement, desk, "monitor", along, 0.2)
        else:
            put_at(placement, desk, "laptop", along, depth * 0.6)
        if draw < 0.8:
            put_at(placement, desk, "keyboard", along, depth - rng.uniform(0.16, 0.26), np.pi * 0)
        if draw < 0.8 and rng.random() < 0.3:
            put_at(
                placement,
                desk,
                "laptop",
                along + rng.choice([-1, 1]) * 0.5,
                depth * 0.55,
                rng.normal(0, 0.3),
            )
        if rng.random() < 0.5:
            stow(placement, desk, "pc tower")
    for kind in rng.choice(_ON_DESKS, placement.times(4.0 + 9.0 * placement.mess())):
        placement.on_top(desk, make_clutter(str(kind), placement.style, rng), yaw=0.0, tries=5)
    if rng.random() < 0.5:
        stow(
            placement,
            desk,
            str(rng.choice(["drawer unit", "bin", "backpack", "cables", "bag", "carton"])),
        )


def stow(placement: Placement, desk: Placed, kind: str) -> Placed | None:
    """Place a thing on the floor under a desk."""
    item, rng = make_clutter(kind, placement.style, placement.rng), placement.rng
    poses = []
    for _ in range(4):
        x, y = desk.at(
            rng.choice([-1, 1]) * (desk.size[0] / 2 - rng.uniform(0.15, 0.4)),
            rng.uniform(0.25, 0.6) * min(desk.size[1], 0.8),
        )
        poses.append(about_centre(item, x, y, desk.yaw + rng.normal(0, 0.15)))
    return placement.try_poses(item, poses)


def dress_top(
    placement: Placement, support: Placed, kinds: Sequence[str] = _ON_CABINETS, mean: float = 2.0
) -> None:
    """Put things on top of a cabinet, a low bookcase, a side board."""
    for kind in placement.rng.choice(np.array(kinds), placement.times(mean)):
        placement.on_top(
            support, make_clutter(str(kind), placement.style, placement.rng), yaw=0.0, tries=5
        )


def bookcases(
    placement: Placement, count: int, kinds: Sequence[str], on_top: Sequence[str] = _ON_CABINETS
) -> None:
    """Place bookcases along walls, mostly side by side and alike, with things on top of them."""
    rng, near = placement.rng, None
    kind, form = str(rng.choice(np.array(kinds))), int(rng.integers(1 << 30))
    for _ in range(count):
        if rng.random() < 0.35:
            kind, form, near = str(rng.choice(np.array(kinds))), int(rng.integers(1 << 30)), None
        items = make_bookcase(kind, placement.style, rng, form if rng.random() < 0.8 else None)
        placed = placement.against_wall(items, near=near)
        if placed is None:
            continue
        near = placed
        if placed.size[2] < placement.room.ceiling - 0.5 and kind in (
            "low",
            "cupboard",
            "open",
            "glass",
        ):
            dress_top(
                placement,
                placed,
                on_top,
                mean=3.0 if placed.size[2] < 1.3 else 2.5 * placement.mess() + 0.3,
            )


def wall_shelves(placement: Placement, mean: float) -> None:
    """Hang shelves with books and things."""
    for _ in range(placement.times(mean)):
        items = make_bookcase("wall shelf", placement.style, placement.rng)
        placement.against_wall(items, z=placement.rng.uniform(1.15, 1.6), gap=0.002, turn=0.0)


def floor_clutter(placement: Placement, mean: float, kinds: Sequence[str] = _ON_FLOOR) -> None:
    """Put things on the floor, mostly along the walls."""
    for kind in placement.rng.choice(np.array(kinds), placement.times(mean)):
        item = make_clutter(str(kind), placement.style, placement.rng)
        if placement.chance(0.8):
            placement.against_wall(item, gap=0.06, turn=0.15, tries=14)
        else:
            placement.freely(item, tries=4)


def wall_clutter(placement: Placement, mean: float, kinds: Sequence[str] = _OFFICE_WALLS) -> None:
    """Hang pictures, clocks, coats and the like on the walls."""
    for kind in placement.rng.choice(np.array(kinds), placement.times(mean)):
        low, high = _ON_WALLS[str(kind)]
        placement.hang(
            make_clutter(str(kind), placement.style, placement.rng),
            placement.rng.uniform(low, high),
            tries=5,
        )


def board(
    placement: Placement,
    kinds: Sequence[str] = ("whiteboard", "whiteboard", "pin board", "chalkboard"),
) -> Placed | None:
    """Hang a board on a wall, or place one that stands."""
    kind = str(placement.rng.choice(np.array(kinds)))
    item = make_board(kind, placement.style, placement.rng)
    if kind in ("flip chart", "mobile"):
        return placement.against_wall(item, gap=0.2, turn=0.2)
    return placement.hang(item, placement.rng.uniform(0.75, 1.05), tries=12)


def windows(placement: Placement) -> None:
    """Give windows over a parapet deep sills with things on them, in half of the rooms; blinds come with the window."""
    if not placement.chance(0.5):
        return
    for opening in placement.room.openings:
        if (
            opening.kind == "window"
            and 0.5 < opening.low < 1.3
            and opening.glazing in ("single", "band")
        ):
            _sill(placement, opening)


def _sill(placement: Placement, opening: Opening) -> None:
    """Lay a deep sill, of class window, over the window's own, with plants and things on it clear of a blind."""
    rng, wide = placement.rng, opening.end - opening.start
    deep = rng.uniform(0.2, 0.32)
    shape = boxes((-wide / 2, 0, 0), (wide / 2, deep, 0.045))
    item = Item("window", (solid(paint((228, 226, 220), rng, "marble", 0.3), shape),))
    along = (opening.start + opening.end) / 2 - float(placement.room.low[opening.side % 2])
    pose = placement.wall_pose(opening.side, along, 0.002, opening.low - 0.033)
    sill = placement.put(item, pose, over_windows=True)
    if sill is None or sill.top is None:
        return
    for kind in rng.choice(_ON_SILLS, placement.times(1 + wide * placement.mess())):
        thing = make_clutter(str(kind), placement.style, rng)
        x, y = sill.at(rng.uniform(-0.5, 0.5) * wide, deep - 0.09)
        turned = about_centre(thing, x, y, sill.yaw + rng.normal(0, 0.2), sill.top[0])
        placement.try_poses(thing, [turned], on=sill, over_windows=True)
