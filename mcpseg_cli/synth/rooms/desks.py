"""Places to work at: a desk, its chair, and what lies on it and stands under it."""

from __future__ import annotations

from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.rooms.contents.shared import shared
from mcpseg_cli.synth.rooms.dressing import dress_top, make_thing, put_at
from mcpseg_cli.synth.rooms.placed import Placed, about_centre
from mcpseg_cli.synth.rooms.placement import Placement
from mcpseg_cli.synth.rooms.seating import seat_at
from mcpseg_cli.synth.things.tables import make_table


def pick_desk(placement: Placement) -> Item:
    """Make a desk of a design in use in the building."""
    usual = [name for name in shared().desk.designs if name in placement.style.tables]
    return make_table(placement.one_of(usual or ["desk"]), placement.style, placement.rng)


def work_place(
    placement: Placement, desk: Item, chair: Item, *, wall: bool, visitor: Item | None = None
) -> Placed | None:
    """Place a desk and what belongs to it.

    Args:
        placement: The room.
        desk: In its own frame.
        chair: What stands before it.
        wall: Whether it stands at a wall if it can, rather than anywhere.
        visitor: A chair behind it.

    Returns:
        The desk; None if it found no place.
    """
    rng = placement.rng
    placed = placement.against_wall(desk, gap=0.2, tries=20) if wall else None
    if placed is None:
        placed = placement.freely(desk, yaw=placement.square(), margin=0.6, tries=14)
    if placed is None:
        return None

    along = rng.normal(0, 0.12) * placed.size[0]
    seat_at(placement, placed, chair, along, pull=float(abs(rng.normal(0, 0.2))))
    if visitor is not None:
        seat_at(placement, placed, visitor, rng.normal(0, 0.2), side=-1.0, pull=0.15)
    dress_desk(placement, placed, computer=shared().desk.computer)
    return placed


def dress_desk(placement: Placement, desk: Placed, *, computer: float) -> None:
    """Put a computer on so many of the desks, and papers, mugs and the like around it."""
    holds, rng = shared().desk, placement.rng
    along = rng.normal(0, 0.12) * float(desk.size[0])
    if rng.random() < computer:
        _put_computer(placement, desk, along)

    dress_top(placement, desk, placement.several(holds.on_top))
    if rng.random() < holds.below.chance:
        stow(placement, desk, placement.one_of(holds.below.of))


def _put_computer(placement: Placement, desk: Placed, along: float) -> None:
    """Put one or two monitors with a keyboard, or a laptop, on a desk."""
    holds, rng, depth = shared().desk, placement.rng, min(float(desk.size[1]), 0.8)
    draw = rng.random()
    has_monitor = draw < holds.two_monitors + holds.one_monitor
    if draw < holds.two_monitors and desk.size[0] > 1.3:
        put_at(placement, desk, "monitor pair", along, 0.2)
    elif has_monitor:
        put_at(placement, desk, "monitor", along, 0.2)
    else:
        put_at(placement, desk, "laptop", along, depth * 0.6)

    if has_monitor:
        put_at(placement, desk, "keyboard", along, depth - rng.uniform(0.16, 0.26))
    if has_monitor and rng.random() < holds.second_laptop:
        beside = along + rng.choice([-1, 1]) * 0.5
        put_at(placement, desk, "laptop", beside, depth * 0.55, rng.normal(0, 0.3))
    if rng.random() < holds.pc_tower:
        stow(placement, desk, "pc tower")


def stow(placement: Placement, desk: Placed, kind: str) -> Placed | None:
    """Place a thing on the floor under a desk."""
    item, rng, poses = make_thing(placement, kind), placement.rng, []
    for _ in range(4):
        along = rng.choice([-1, 1]) * (desk.size[0] / 2 - rng.uniform(0.15, 0.4))
        x, y = desk.at(along, rng.uniform(0.25, 0.6) * min(desk.size[1], 0.8))
        poses.append(about_centre(item, x, y, desk.yaw + rng.normal(0, 0.15)))
    return placement.try_poses(item, poses)
