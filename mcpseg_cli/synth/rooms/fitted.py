"""What is fitted to walls before furniture comes: runs of doors, wardrobes, curtains, blinds."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.plan import Opening, RoomKind
from mcpseg_cli.synth.rooms.dressing import dress_top
from mcpseg_cli.synth.rooms.placed import Placed
from mcpseg_cli.synth.rooms.placement import Placement
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.things.cabinet_parts import Finish, pick_finish
from mcpseg_cli.synth.things.cabinets import built_in, make_cabinet, sliding_wardrobe, wall_of
from mcpseg_cli.synth.things.curtains import curtain, louvres, panel_blind, pick_cloth

_WITH_RUNS: dict[RoomKind, float] = {
    "bedroom": 0.75, "hallway": 0.7, "study": 0.4, "livingRoom": 0.3, "diningRoom": 0.3,
    "bathroom": 0.15, "office": 0.5, "conferenceRoom": 0.45, "storage": 0.5, "openspace": 0.4,
    "copyRoom": 0.6, "lounge": 0.3, "lobby": 0.3,
    "classRoom": 0.35, "cloakroom": 0.3, "workshop": 0.2,
}  # fmt: skip
"""How often a room has cabinets fitted to a wall in a building full of them."""
_NO_CURTAINS: tuple[RoomKind, ...] = (
    "hallway",
    "bathroom",
    "WC",
    "storage",
    "copyRoom",
    "cloakroom",
    "workshop",
)
_CLEAR = 0.004  # metres between what is fitted and the walls


def fit_walls(placement: Placement) -> None:
    """Hang curtains and fit cabinets as often as the building's style has them; at 0 draw nothing.

    Args:
        placement: The room, with nothing in it yet but what stays free.
    """
    style, kind = placement.style, placement.room.kind
    if style.curtains > 0 and kind not in _NO_CURTAINS and placement.chance(style.curtains):
        _curtains(placement)
    if style.cabinets > 0 and placement.chance(style.cabinets * _WITH_RUNS.get(kind, 0.0)):
        _run(placement)
        if placement.chance(0.15):
            _run(placement)
    if style.cabinets > 0 and style.is_public and kind not in ("hallway", "WC"):
        _loose_cabinets(placement)


def room_finish(placement: Placement) -> Finish:
    """Draw the finish of a cabinet: often the paint of the wall behind it."""
    return pick_finish(placement.style, placement.rng, placement.wall)


def _run(placement: Placement) -> Placed | None:
    """Fit cabinets along a wall: from wall to wall where there is room, or in a corner."""
    rng, room = placement.rng, placement.room
    finish = room_finish(placement)
    if placement.wall is not None and placement.chance(0.3):
        finish = wall_of(finish, placement.wall)
    high = room.ceiling - 0.006
    height = high if placement.chance(0.55) else min(high, rng.uniform(1.95, 2.4))
    depth, slides = rng.uniform(0.36, 0.66), placement.chance(0.25)

    # whole walls, then parts of them; shallower where the room is narrow
    for share in (1.0, 0.75, 0.55, 0.4, 0.28):
        for side in rng.permutation(4).tolist():
            width = share * float(placement.size[side % 2]) - 2 * _CLEAR
            if width < 0.7 or width > 5.5:
                continue
            size = (width, min(depth, 0.35 * float(placement.size[1 - side % 2])), height)
            if slides and width > 1.2:
                item = sliding_wardrobe((size[0], max(size[1], 0.4), height - 0.03), finish, rng)
            else:
                item = built_in(size, finish, rng)
            placed = _at_ends(placement, item, side, width)
            if placed is not None:
                return placed
    return None


def _at_ends(placement: Placement, item: Item, side: int, width: float) -> Placed | None:
    """Place something at the low or the high end of a wall."""
    long, half = float(placement.size[side % 2]), width / 2 + _CLEAR
    spots = [half, long - half] if placement.chance(0.5) else [long - half, half]
    poses = [placement.wall_pose(side, spot, _CLEAR, 0.0) for spot in spots]
    return placement.try_poses(item, poses)


def _loose_cabinets(placement: Placement) -> None:
    """Stand cabinets along the walls of a public room, with things on low ones."""
    style, rng = placement.style, placement.rng
    kinds = ("base cabinet", "sideboard", "tall cabinet", "base cabinet", "wardrobe", "low unit")
    finish = room_finish(placement)
    for _ in range(int(rng.poisson(style.cabinets * min(placement.area / 9, 4)))):
        item = make_cabinet(placement.one_of(kinds), style, rng, finish)
        placed = placement.against_wall(item, gap=0.02, turn=0.0)
        if placed is not None and placed.size[2] < 1.3:
            things = rng.choice(["books", "small carton", "vase", "paper", "printer", "trays"], 3)
            dress_top(placement, placed, things.tolist())


def _curtains(placement: Placement) -> None:
    """Hang curtains or blinds of one kind before the windows, at times before a bare wall."""
    rng, style = placement.rng, placement.style
    cloth, drawn = pick_cloth(style, rng, placement.wall), rng.uniform(0.15, 0.6)
    if placement.chance(0.35):
        drawn = 0.98
    kind = "curtain" if placement.chance(0.7) else placement.one_of(("louvres", "slats", "blind"))
    whole_wall = placement.chance(0.35)
    for side in range(4):
        windows = [o for o in placement.room.openings if o.kind == "window" and o.side == side]
        windows = [o for o in windows if o.glazing != "interior"]
        spans = [_span(placement, o) for o in windows]
        if windows and whole_wall:
            spans.insert(0, (0.02, float(placement.size[side % 2]) - 0.02))
        elif not windows and kind != "slats" and placement.chance(0.06):
            spans = [(0.02, float(placement.size[side % 2]) - 0.02)]
        for start, end in spans:
            item, z = _hung(placement, windows, end - start, kind, cloth, drawn)
            pose = placement.wall_pose(side, (start + end) / 2, 0.002, z)
            placed = placement.put(item, pose, over_windows=True)
            if placed is not None and whole_wall and (start, end) == spans[0]:
                break


def _span(placement: Placement, opening: Opening) -> tuple[float, float]:
    """Return where a curtain before a window begins and ends along its wall."""
    low, long = placement.room.low[opening.side % 2], float(placement.size[opening.side % 2])
    wide = placement.rng.uniform(0.03, 0.35)
    start, end = float(opening.start - low) - wide, float(opening.end - low) + wide
    return max(start, 0.01), min(end, long - 0.01)


def _hung(
    placement: Placement,
    windows: list[Opening],
    width: float,
    kind: str,
    cloth: Material,
    drawn: float,
) -> tuple[Item, float]:
    """Make a curtain or a blind for a stretch of wall, and return how high its lower end hangs."""
    rng, ceiling = placement.rng, placement.room.ceiling
    top = max((o.high for o in windows), default=ceiling - 0.3)
    top = (
        ceiling - 0.01
        if placement.chance(0.3)
        else min(top + rng.uniform(0.06, 0.3), ceiling - 0.01)
    )
    sill = min((o.low for o in windows), default=0.0)
    z = max(sill - rng.uniform(0.02, 0.15), 0.0) if kind in ("slats", "blind") else 0.0
    if sill > 0.5 and kind != "slats" and placement.chance(0.15):
        z = sill - 0.2
    if kind == "curtain":
        return curtain(width, top - z, cloth, placement.style, rng, drawn=drawn), z
    if kind == "louvres":
        return louvres(width, top - z, cloth, rng), z
    return panel_blind(width, top - z, cloth, rng, slats=kind == "slats"), z


def cabinets(
    placement: Placement, kinds: list[str], on_top: tuple[str, ...] = (), near: Placed | None = None
) -> list[Placed]:
    """Stand cabinets of these kinds along the walls, things on those that are low.

    Args:
        placement: The room.
        kinds: What stands there, one after the other.
        on_top: What the things on them are drawn from.
        near: What the first stands beside, if it can.
    """
    found, finish = [], room_finish(placement)
    for kind in kinds:
        if placement.chance(0.3):
            finish = room_finish(placement)
        item = make_cabinet(kind, placement.style, placement.rng, finish)
        placed = placement.against_wall(item, near=near, gap=0.03, tries=10)
        if placed is None:
            continue
        found.append(placed)
        if on_top and placed.size[2] < placement.room.ceiling - 0.4:
            count = int(placement.rng.poisson(1.0 + 2.0 * placed.size[0] * placement.mess()))
            dress_top(placement, placed, placement.rng.choice(np.array(on_top), count).tolist())
    return found
