"""Records of ``shared.toml``: what rooms of several kinds hold."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator

from mcpseg_cli.synth.rooms.contents.records import (
    Amount,
    Chair,
    Chance,
    Clutter,
    Several,
    Sometimes,
    Table,
)
from mcpseg_cli.synth.toml_tables import Metres, OneOrMore, Range, Record, Share, read_table


class Chairs(Record):
    """Which chairs there are, and how often a seat has one."""

    usual: Share
    at_sides: Share
    at_ends: Share
    in_rings: Share


class Desk(Record):
    """Which desks there are, what lies on them and stands under them."""

    designs: OneOrMore[Table]
    computer: Share
    two_monitors: Share
    one_monitor: Share
    second_laptop: Share
    pc_tower: Share
    on_top: Several[Clutter]
    below: Sometimes[Clutter]


class Bookcases(Record):
    """How bookcases of one room differ, and what stands on top of them."""

    another_kind: Share
    alike: Share
    on_low: Amount
    on_high: Amount
    on_top: OneOrMore[Clutter]


class Sills(Record):
    """How often windows have deep sills, how deep, and what stands on them."""

    chance: Share
    depth: Range[Metres]
    on_top: Several[Clutter]


class MeetingCorner(Record):
    """A table to talk at."""

    oblong: Chance
    length: Range[Metres]
    depth: Range[Metres]
    tables: OneOrMore[Table]
    on_top: Several[Clutter]


class EatingPlace(Record):
    """A table to eat at."""

    oblong: Share
    length: Range[Metres]
    depth: Range[Metres]
    tables: OneOrMore[Table]
    chairs: OneOrMore[Chair]
    on_top: Several[Clutter]


class Shared(Record):
    """The whole file; heights are those of the lowest edge of what hangs on walls."""

    chairs: Chairs
    desk: Desk
    bookcases: Bookcases
    sills: Sills
    heights: dict[str, Range[Metres]]
    meeting_corner: MeetingCorner
    eating_place: EatingPlace


@cache
def shared() -> Shared:
    """Read ``shared.toml``."""
    return read_table(Path(__file__).with_suffix(".toml"), Shared)


def _has_a_height(kind: str) -> str:
    """Refuse what no height is given for."""
    if kind not in shared().heights:
        raise ValueError("a thing with an entry in heights of shared.toml")
    return kind


OnWall = Annotated[Clutter, AfterValidator(_has_a_height)]
"""What can hang on a wall."""
