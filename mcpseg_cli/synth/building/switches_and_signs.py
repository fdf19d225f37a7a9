"""Small things on walls: switches, sockets, conduits, in public buildings signs too."""

from __future__ import annotations

import numpy as np

from mcpseg_cli.synth.building.walls import Span, free_stretches, on_wall
from mcpseg_cli.synth.geometry.solids import Item, box, circle, part_of, prism, shifted, tube
from mcpseg_cli.synth.plan import Opening, Room
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import Style, paint

_EXIT_SIGN = Material("print", (40, 140, 84), (230, 240, 232), 0.1, 1, 0.25)


def build_switches_and_signs(room: Room, style: Style, rng: np.random.Generator) -> list[Item]:
    """Put switches, sockets and conduits on the walls, in public corridors signs and more.

    Args:
        room: The room.
        style: The building's.
        rng: Random numbers.

    Returns:
        Objects of class clutter, in the map frame.
    """
    items = []
    is_public_hall = room.kind == "hallway" and style.is_public
    white, grey = paint((228, 226, 218), rng), paint((150, 150, 148), rng, "metal")
    for side in range(4):
        free = [s for s in free_stretches(room, side, 0.12, 0.0, 1.6) if s[1] - s[0] > 0.5]
        items += _sockets(room, side, free, white, rng)
        for door in [o for o in room.openings if o.kind == "door" and o.side == side]:
            items += _beside_door(room, door, free, white, is_public_hall=is_public_hall)
            if is_public_hall and rng.random() < 0.15 and door.high + 0.35 < room.ceiling:
                items.append(_sign(room, door))

        # an extinguisher or a conduit on some walls
        if is_public_hall and free and rng.random() < 0.4:
            a, b = free[int(rng.integers(len(free)))]
            items.append(_extinguisher(room, side, rng.uniform(a + 0.1, b - 0.1), rng))
        if free and rng.random() < 0.1:
            a, b = free[int(rng.integers(len(free)))]
            x = rng.uniform(a, b)
            pipe = tube((x, 0.016, 0.0), (x, 0.016, room.ceiling), rng.uniform(0.01, 0.016))
            items.append(Item("clutter", (part_of(on_wall(pipe, room, side), grey),)))
    return items


def _sockets(
    room: Room, side: int, free: list[Span], white: Material, rng: np.random.Generator
) -> list[Item]:
    """Put sockets near the floor, about one for 3 m of free wall."""
    items = []
    for a, b in free:
        count = int(rng.integers(0, 1 + int((b - a) / 1.5)))
        for x in rng.uniform(a + 0.05, b - 0.1, count).tolist():
            plate = box((x, 0, 0.24), (x + rng.uniform(0.08, 0.24), 0.011, 0.32))
            items.append(Item("clutter", (part_of(on_wall(plate, room, side), white),)))
    return items


def _beside_door(
    room: Room, door: Opening, free: list[Span], white: Material, *, is_public_hall: bool
) -> list[Item]:
    """Put a switch (inside) or a name plate (in public corridors) beside a door."""
    for x in (door.end + 0.14, door.start - 0.22):
        if any(a <= x and x + 0.14 <= b for a, b in free):
            wide, low, high = (0.14, 1.45, 1.6) if is_public_hall else (0.08, 1.05, 1.13)
            plate = on_wall(box((x, 0, low), (x + wide, 0.011, high)), room, door.side)
            name = Material("paper", (214, 214, 210), (60, 60, 66), 0.1, white.seed)
            return [Item("clutter", (part_of(plate, name if is_public_hall else white),))]
    return []


def _sign(room: Room, door: Opening) -> Item:
    """Hang a sign that glows over a door."""
    x, z = (door.start + door.end) / 2, door.high
    sign = on_wall(box((x - 0.15, 0, z + 0.1), (x + 0.15, 0.03, z + 0.26)), room, door.side)
    return Item("clutter", (part_of(sign, _EXIT_SIGN),))


def _extinguisher(room: Room, side: int, x: float, rng: np.random.Generator) -> Item:
    """Hang a fire extinguisher."""
    red = paint((186, 34, 30), rng)
    tank = shifted(prism(circle(0.075, 10), 0.5, 0.95), x, 0.085)
    neck = shifted(prism(circle(0.03, 6), 0.95, 1.05), x, 0.085)
    bracket = box((x - 0.03, 0, 0.7), (x + 0.03, 0.02, 0.8))
    parts = (
        part_of(on_wall(tank, room, side), red),
        part_of(on_wall(neck, room, side), paint((30, 30, 32), rng)),
        part_of(on_wall(bracket, room, side), paint((90, 90, 90), rng)),
    )
    return Item("clutter", parts)
