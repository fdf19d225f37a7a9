"""The floor plan of a building: rooms along corridors, with their doors, windows and columns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

RoomKind = Literal[
    "hallway", "office", "conferenceRoom", "lounge", "storage", "openspace", "lobby", "pantry",
    "copyRoom", "WC", "livingRoom", "diningRoom", "kitchen", "bedroom", "study", "bathroom",
    "classRoom", "cafe", "workshop", "cloakroom",
]  # fmt: skip
"""Names as S3DIS uses them, those of homes, then of schools; a room is called ``kind_number``."""
CeilingKind = Literal["acoustic", "plaster", "concrete", "boards"]
DOUBLE_DOOR_WIDTH = 1.3
"""Wider doors have two leaves, metres."""


@dataclass(frozen=True)
class Opening:
    """A door, window or passage in one wall of a room.

    Attributes:
        kind: What fills it.
        side: Wall: 0 at low y, 1 at high x, 2 at high y, 3 at low x.
        start: Where it begins along the wall (x on sides 0 and 2, y on 1 and 3), metres, map frame.
        end: Where it ends.
        low: Height of its lower edge over the floor, metres.
        high: Height of its upper edge.
        leaf_deg: How far a door's leaf stands open into this room; 0 closed, -1 no leaf on this
            side.
        hinge_at_end: Whether the leaf hangs at ``end``.
        depth: How deep the reveal is on this room's side (half the wall), metres.
        glazing: What a window is: single panes over a sill, a band, glass from the floor up, or
            glass to a corridor.
        is_dummy: Whether a door leads nowhere: shafts, cupboards, stairs that were not scanned.
    """

    kind: Literal["door", "window", "passage"]
    side: int
    start: float
    end: float
    low: float
    high: float
    leaf_deg: float = -1.0
    hinge_at_end: bool = False
    depth: float = 0.08
    glazing: Literal["single", "band", "full", "interior"] = "single"
    is_dummy: bool = False

    @property
    def is_double(self) -> bool:
        """Whether a door is so wide that it has two leaves."""
        return self.end - self.start > DOUBLE_DOOR_WIDTH


@dataclass(frozen=True)
class Fixture:
    """Something built in that takes up room.

    Attributes:
        kind: What it is; a shaft is a piece of wall boxed out into the room.
        low: (3,) lowest corner, metres, map frame.
        high: (3,) highest corner.
    """

    kind: Literal["column", "round column", "beam", "radiator", "shaft", "duct", "pipe"]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


@dataclass(frozen=True)
class Room:
    """One room: an upright box with openings.

    Attributes:
        name: ``office_3`` and the like.
        kind: What it is used for.
        low: (2,) lowest x and y of its inside, metres, map frame.
        high: (2,) highest x and y.
        ceiling: Height of the ceiling over the floor (z = 0), metres.
        openings: Doors, windows and passages.
        taken: Boxes, (2, 3) lowest and highest corner each, that furniture keeps clear of: columns,
            pipes, open door leaves and where they swing, the way through doors.
        fixtures: Columns, beams, radiators and the like; those that reach down are in ``taken``.
        exterior: Sides with nothing but the street behind them.
        ceiling_kind: What the ceiling is made of; acoustic tiles are a suspended ceiling.
    """

    name: str
    kind: RoomKind
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    ceiling: float
    openings: tuple[Opening, ...] = ()
    taken: tuple[NDArray[np.float64], ...] = field(default=())
    fixtures: tuple[Fixture, ...] = ()
    exterior: tuple[int, ...] = ()
    ceiling_kind: CeilingKind = "plaster"

    def reach_of(self, side: int) -> tuple[float, float]:
        """Return where the wall on a side begins and ends, metres."""
        axis = side % 2
        return float(self.low[axis]), float(self.high[axis])
