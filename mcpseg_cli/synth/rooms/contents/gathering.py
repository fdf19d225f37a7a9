"""Records of ``gathering.toml``: class rooms, cafés, workshops, halls with coats."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from mcpseg_cli.synth.rooms.contents.records import (
    Amount,
    Area,
    Board,
    Bookcase,
    Cabinet,
    Chair,
    Clutter,
    Count,
    NotNegative,
    Several,
    Sometimes,
    Table,
)
from mcpseg_cli.synth.rooms.contents.shared import OnWall
from mcpseg_cli.synth.toml_tables import Metres, OneOrMore, Range, Record, Share, read_table


class ClassRoom(Record):
    """Rows of desks that face a board, the teacher's desk before it."""

    boards: OneOrMore[Board]
    board_height: Range[Metres]
    projector: Share
    teacher: Metres
    first_row: Range[Metres]
    pitch: Range[Metres]
    desk_width: OneOrMore[Range[Metres]]
    desk_depth: Range[Metres]
    desk_height: Range[Metres]
    aisle: Range[Metres]
    row: Share
    seat: Share
    teachers_chairs: OneOrMore[Chair]
    bookcases: Several[Bookcase]
    cabinets: Several[Cabinet]
    wall_shelves: Amount
    pin_board: Sometimes[Board]
    on_walls: Several[OnWall]
    on_teachers_desk: Several[Clutter]
    on_desks: Several[Clutter]
    on_floor: Several[Clutter]


class Cafe(Record):
    """A bar with stools, shelves behind it, tables with chairs, sofas along the walls."""

    bar: Range[Metres]
    behind_bar: Range[Metres]
    stools: Share
    stool_pitch: Metres
    shelves_behind: Several[Bookcase]
    machines: OneOrMore[Clutter]
    sofas: Several[Table]
    seats: Range[Count]
    area_per_eating_place: Area
    most_eating_places: Count
    on_bar: Several[Clutter]
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class Workshop(Record):
    """Work benches along the walls and in the middle, racks, cabinets, what is worked on."""

    benches: Range[Count]
    bench_length: Range[Metres]
    bench_depth: Range[Metres]
    bench_height: Range[Metres]
    island: Share
    stool: Share
    bookcases: Several[Bookcase]
    cabinets: Several[Cabinet]
    wall_shelves: Amount
    on_benches: Several[Clutter]
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class Cloakroom(Record):
    """Coats along the walls, benches under them, lockers, shoes."""

    coats_per_metre: NotNegative
    bare_hooks: Share
    benches: Amount
    lockers: Several[Clutter]
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class GatheringRooms(Record):
    """The whole file."""

    class_room: ClassRoom
    cafe: Cafe
    workshop: Workshop
    cloakroom: Cloakroom


@cache
def gathering_rooms() -> GatheringRooms:
    """Read ``gathering.toml``."""
    return read_table(Path(__file__).with_suffix(".toml"), GatheringRooms)
