"""Furnish rooms: what stands, lies and hangs in them, by what they are used for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mcpseg_cli.errors import InputError
from mcpseg_cli.synth.geometry.solids import Item
from mcpseg_cli.synth.models.library import TABLE, Models
from mcpseg_cli.synth.plan import Room, RoomKind
from mcpseg_cli.synth.rooms import (
    gathering_rooms,
    kitchens,
    living_rooms,
    private_rooms,
    public_rooms,
    work_rooms,
)
from mcpseg_cli.synth.rooms.contents import gathering, homes, public, shared, work
from mcpseg_cli.synth.rooms.fitted import fit_walls
from mcpseg_cli.synth.rooms.placement import Placement
from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.styles import Style
from mcpseg_cli.synth.things.boards import BOARD_KINDS
from mcpseg_cli.synth.things.bookcases import BOOKCASE_KINDS
from mcpseg_cli.synth.things.chairs import CHAIR_DESIGNS
from mcpseg_cli.synth.things.clutter import CLUTTER_KINDS
from mcpseg_cli.synth.things.tables import TABLE_DESIGNS

_ROOMS: dict[RoomKind, Callable[[Placement], None]] = {
    "hallway": public_rooms.furnish_hallway,
    "office": work_rooms.furnish_office,
    "conferenceRoom": work_rooms.furnish_meeting_room,
    "lounge": public_rooms.furnish_lounge,
    "storage": work_rooms.furnish_storage,
    "openspace": work_rooms.furnish_open_plan,
    "lobby": public_rooms.furnish_lobby,
    "pantry": public_rooms.furnish_pantry,
    "copyRoom": work_rooms.furnish_copy_room,
    "WC": public_rooms.furnish_washroom,
    "livingRoom": living_rooms.furnish_living_room,
    "diningRoom": living_rooms.furnish_dining_room,
    "kitchen": kitchens.furnish_kitchen,
    "bedroom": private_rooms.furnish_bedroom,
    "study": private_rooms.furnish_study,
    "bathroom": private_rooms.furnish_bathroom,
    "classRoom": gathering_rooms.furnish_class_room,
    "cafe": gathering_rooms.furnish_cafe,
    "workshop": gathering_rooms.furnish_workshop,
    "cloakroom": gathering_rooms.furnish_cloakroom,
}

KINDS: dict[str, tuple[str, ...]] = {
    "chair": tuple(CHAIR_DESIGNS),
    "table": (*TABLE_DESIGNS, "meeting"),
    "sofa": ("sofa", "corner sofa"),
    "bookcase": tuple(BOOKCASE_KINDS),
    "board": tuple(BOARD_KINDS),
    "door": ("door",),
    "window": ("window",),
    "clutter": (*CLUTTER_KINDS, "radiator"),
}
"""What models may stand for, by class."""


def check_contents(models: Models | None = None) -> None:
    """Read what rooms hold, so that a damaged table is named before any work starts.

    Args:
        models: Models that stand for things; those have to be known.

    Raises:
        InputError: A table is damaged.
    """
    for read in (shared.shared, work.work_rooms, public.public_rooms, homes.homes):
        read()
    gathering.gathering_rooms()
    if models is not None:
        _check_kinds(models)


def _check_kinds(models: Models) -> None:
    """Refuse models that stand for what there is not."""
    for model in models.models:
        known = KINDS[model.class_name]
        for kind in set(model.stands_for) - set(known):
            found = f"{model.model}: stands for {kind!r}"
            expected = f"one of {', '.join(sorted(known))}"
            raise InputError(models.folder / TABLE, found, expected, "mend the row")


def furnish_room(
    room: Room, style: Style, rng: np.random.Generator, wall: Material | None = None
) -> list[Item]:
    """Furnish a room.

    Nothing meets anything else or what is taken. Everything stands on the floor or on something,
    hangs on a wall or hangs from the ceiling. Doors stay free, and a robot 0.52 m wide can get from
    every door to nearly all the floor that is left.

    Args:
        room: The room; its kind decides what comes in.
        style: Colours and habits of the building.
        rng: Decides everything else; the same state gives the same furniture.
        wall: Surface of the walls, which some cabinets share; None if it is not known.

    Returns:
        The objects in the map frame, floor at z = 0; empty if nothing fits. Window sills are of
        class window, rugs of class floor: ``lay_rugs`` lays them on the room's.
    """
    placement = Placement(room, style, rng, wall)
    if room.kind == "hallway" and not style.is_public:
        private_rooms.furnish_corridor(placement)
    elif room.kind == "hallway":
        _ROOMS[room.kind](placement)
        fit_walls(placement)
    else:
        fit_walls(placement)
        _ROOMS[room.kind](placement)
    return placement.items
