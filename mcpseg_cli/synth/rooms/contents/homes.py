"""Records of ``homes.toml``: what rooms of homes hold."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from mcpseg_cli.synth.rooms.contents.records import (
    Amount,
    Bookcase,
    Cabinet,
    Chair,
    Chance,
    Clutter,
    Count,
    Several,
)
from mcpseg_cli.synth.rooms.contents.shared import OnWall
from mcpseg_cli.synth.toml_tables import Metres, OneOrMore, Range, Record, Share, read_table


class Home(Record):
    """What hangs, stands and lies about in any room of a home."""

    wall_shelves: Amount
    chairs: OneOrMore[Chair]
    armchairs: OneOrMore[Chair]
    on_furniture: OneOrMore[Clutter]
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class LivingRoom(Record):
    """A sitting group and what stands about it."""

    dining_group: Chance
    kitchenette: Chance
    sofa_at_wall: Share
    chairs_at_walls: Amount
    cabinets: Several[Cabinet]
    bookcases: Several[Bookcase]
    standard_lamps: Amount
    side_tables: Amount


class SittingGroup(Record):
    """Sofas and armchairs about a low table, a television, a rug."""

    seats: Range[Count]
    wide: Metres
    corner: Share
    at_wall: Share
    coffee_table: Share
    on_coffee_table: Several[Clutter]
    second_sofa: Share
    seats_of_second: Range[Count]
    armchairs: Range[Count]
    side_table: Share
    rug: Share
    rug_width: Range[Metres]
    rug_depth: Range[Metres]
    low_unit: Share
    television_on_board: Share
    on_tv_board: Amount


class SideTable(Record):
    """A small table with a lamp."""

    lamp: Share
    on_top: Several[Clutter]


class DiningGroup(Record):
    """A meal table with chairs."""

    round: Share
    length: Range[Metres]
    depth: Range[Metres]
    chairs: OneOrMore[Chair]
    rug: Share
    rug_margin: Metres
    on_table: Several[Clutter]


class DiningRoom(Record):
    """What stands beside the meal table."""

    kitchenette: Chance
    chairs_at_walls: Amount
    cabinets: Several[Cabinet]
    bookcases: Several[Bookcase]
    sofa: Share


class Bedroom(Record):
    """The bed and what stands beside it."""

    beds: OneOrMore[Clutter]
    second_bed: Share
    bedside_cabinets: Share
    chairs_at_walls: Amount
    cabinets: Several[Cabinet]
    rug: Share
    rug_margin: Range[Metres]
    rug_depth: Range[Metres]
    bedside_lamp: Share
    on_bedside: Several[Clutter]
    wardrobes: Several[Cabinet]
    on_wardrobes: OneOrMore[Clutter]
    bookcases: Several[Bookcase]
    desk: Share
    desk_chairs: OneOrMore[Chair]
    armchair: Share
    sofa: Share
    on_floor: Several[Clutter]


class Kitchen(Record):
    """Fitted units, or counters one after the other with their lengths, and a place to eat."""

    fitted: Share
    tall_units: Range[Count]
    fridge: Share
    second_line: Share
    wall_units: Share
    hood: Share
    cabinets: Several[Cabinet]
    counters: OneOrMore[Range[Metres]]
    on_counters: Several[Clutter]
    washing_machine: Share
    eating_place: Share
    bookcases: Several[Bookcase]
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class Study(Record):
    """Desks with their chairs, a sofa, bookcases, a rug."""

    second_desk: Share
    chairs_at_walls: Amount
    cabinets: Several[Cabinet]
    chairs: OneOrMore[Chair]
    sofa: Share
    seats: Range[Count]
    bookcases: Several[Bookcase]
    rug: Share
    rug_width: Range[Metres]
    rug_depth: Range[Metres]


class Bathroom(Record):
    """What there is besides a toilet."""

    tubs: OneOrMore[Clutter]
    vanity: Share
    on_floor_at_walls: Several[Clutter]
    washing_machine: Share
    shelf: Share
    mat: Share
    mat_width: Range[Metres]
    mat_depth: Range[Metres]
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class Corridor(Record):
    """Things along one wall; amounts are for each metre of length."""

    passage: Metres
    cabinets: Several[Cabinet]
    bookcases: Several[Bookcase]
    benches: Amount
    runner: Share
    runner_length: Range[Metres]
    runner_width: Range[Metres]
    on_walls: Several[OnWall]
    on_floor: Several[Clutter]


class Homes(Record):
    """The whole file."""

    home: Home
    living_room: LivingRoom
    sitting_group: SittingGroup
    side_table: SideTable
    dining_group: DiningGroup
    dining_room: DiningRoom
    bedroom: Bedroom
    kitchen: Kitchen
    study: Study
    bathroom: Bathroom
    corridor: Corridor


@cache
def homes() -> Homes:
    """Read ``homes.toml``."""
    return read_table(Path(__file__).with_suffix(".toml"), Homes)
