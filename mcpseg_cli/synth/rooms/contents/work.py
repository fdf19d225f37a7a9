"""Records of ``work.toml``: what rooms hold that people work in."""

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
    Table,
)
from mcpseg_cli.synth.rooms.contents.shared import OnWall
from mcpseg_cli.synth.toml_tables import Metres, OneOrMore, Range, Record, Share, read_table


class Office(Record):
    """Desks for one or several, bookcases, a board, at times a meeting table or a sofa."""

    area_per_desk: Range[Area]
    most_desks: Count
    swivel_chairs: OneOrMore[Chair]
    swivel: Share
    plain_chairs: OneOrMore[Chair]
    visitors: OneOrMore[Chair]
    visitors_at_walls: Range[Count]
    another_chair: Share
    another_desk: Share
    desk_at_wall: Share
    board: Sometimes[Board]
    meeting_corner: Chance
    second_meeting_corner: Chance
    sofa: Chance
    sofa_seats: Range[Count]
    small: Area
    first_bookcases_if_small: Range[Count]
    first_bookcases: Range[Count]
    bookcases: Several[Bookcase]


class OfficeClutter(Record):
    """What stands, lies and hangs about in offices."""

    along_walls: Several[Clutter]
    on_filing_cabinets: Amount
    wall_shelves: Amount
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class OpenPlan(Record):
    """Blocks of four desks with aisles between them."""

    area_per_bookcase: Area
    bookcases: OneOrMore[Bookcase]
    desks: OneOrMore[Table]
    aisle_along: Range[Metres]
    aisle_across: Range[Metres]
    block: Share
    screen: Share
    screen_height: Range[Metres]
    computer: Share
    board: Sometimes[Board]
    meeting_corners: Amount
    guests_at_walls: Range[Count]
    clutter: Share


class MeetingRoom(Record):
    """A long table with chairs all round."""

    space_at_ends: Range[Metres]
    space_at_sides: Range[Metres]
    length: Range[Metres]
    depth: Range[Metres]
    height: Range[Metres]
    chair_pitch: Range[Metres]
    chairs: OneOrMore[Chair]
    chairs_at_walls: Amount
    television: Share
    projector: Share
    board: Sometimes[Board]
    standing_board: Sometimes[Board]
    bookcases: Several[Bookcase]
    on_table: Several[Clutter]
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class CopyRoom(Record):
    """Copiers, shelves, a table."""

    copiers: Range[Count]
    bookcases: Several[Bookcase]
    board: Sometimes[Board]
    on_table: Several[Clutter]
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class Storage(Record):
    """Racks, boxes, things put away."""

    table: Sometimes[Table]
    chair_stacks: Amount
    chairs_in_stack: Range[Count]
    area_per_bookcase: Area
    bookcases: OneOrMore[Bookcase]
    wall_shelves: Amount
    on_table: Several[Clutter]
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class WorkRooms(Record):
    """The whole file."""

    office: Office
    office_clutter: OfficeClutter
    open_plan: OpenPlan
    meeting_room: MeetingRoom
    copy_room: CopyRoom
    storage: Storage


@cache
def work_rooms() -> WorkRooms:
    """Read ``work.toml``."""
    return read_table(Path(__file__).with_suffix(".toml"), WorkRooms)
