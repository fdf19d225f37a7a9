"""Records of ``public.toml``: what rooms hold that people pass through or rest in."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from mcpseg_cli.synth.rooms.contents.records import (
    Amount,
    Area,
    Board,
    Bookcase,
    Chair,
    Chance,
    Clutter,
    Count,
    Several,
    Sometimes,
)
from mcpseg_cli.synth.rooms.contents.shared import OnWall
from mcpseg_cli.synth.toml_tables import Metres, OneOrMore, Range, Record, Share, read_table


class Lounge(Record):
    """Sofas about low tables, more chairs, a television."""

    area_per_sitting_group: Area
    most_sitting_groups: Count
    television: Share
    chairs: OneOrMore[Chair]
    chairs_at_walls: Range[Count]
    bookcases: Several[Bookcase]
    meeting_corners: Several[Chair]
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class SittingGroup(Record):
    """A sofa, a low table before it, armchairs about it."""

    seats: Range[Count]
    at_wall: Share
    armchairs: Range[Count]
    on_table: Several[Clutter]


class Lobby(Record):
    """A reception desk, sitting groups and benches."""

    reception: Chance
    on_reception: Several[Clutter]
    area_per_seat: Area
    most_seats: Count
    sitting_group: Share
    board: Sometimes[Board]
    bookcases: Several[Bookcase]
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class Hallway(Record):
    """A few things along one wall; amounts are for each metre of length."""

    passage: Metres
    boards: Several[Board]
    benches: Amount
    chairs: Several[Chair]
    bookcases: Several[Bookcase]
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class Pantry(Record):
    """A counter, a fridge, machines, places to eat."""

    counter: Range[Metres]
    short_counter: Metres
    on_counter: OneOrMore[Clutter]
    vending_machine: Share
    area_per_eating_place: Area
    most_eating_places: Count
    cupboard_elsewhere: Share
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class Washroom(Record):
    """Stalls along one wall, basins with mirrors."""

    stall_width: Range[Metres]
    most_stalls: Count
    toilets: Share
    basins: Range[Count]
    mirror: Share
    on_walls: OneOrMore[Clutter]
    on_floor: Several[Clutter]
    trays: Share


class PublicRooms(Record):
    """The whole file."""

    lounge: Lounge
    sitting_group: SittingGroup
    lobby: Lobby
    hallway: Hallway
    pantry: Pantry
    washroom: Washroom


@cache
def public_rooms() -> PublicRooms:
    """Read ``public.toml``."""
    return read_table(Path(__file__).with_suffix(".toml"), PublicRooms)
