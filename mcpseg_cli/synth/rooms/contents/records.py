"""What the tables of rooms are made of: means that grow with the room, chances, names of things."""

from __future__ import annotations

from collections.abc import Collection
from typing import Annotated, Generic, TypeVar

from pydantic import AfterValidator, Field

from mcpseg_cli.synth.things.boards import BOARD_KINDS
from mcpseg_cli.synth.things.bookcases import BOOKCASE_KINDS
from mcpseg_cli.synth.things.cabinets import CABINET_KINDS
from mcpseg_cli.synth.things.chairs import CHAIR_DESIGNS
from mcpseg_cli.synth.things.clutter import CLUTTER_KINDS
from mcpseg_cli.synth.things.tables import TABLE_DESIGNS
from mcpseg_cli.synth.toml_tables import OneOrMore, Record, Share

Kind = TypeVar("Kind")
NotNegative = Annotated[float, Field(ge=0)]


def known(kinds: Collection[str]) -> AfterValidator:
    """Return what refuses names that are not among the kinds."""

    def check(name: str) -> str:
        if name not in kinds:
            raise ValueError(f"one of {', '.join(sorted(kinds))}")
        return name

    return AfterValidator(check)


Clutter = Annotated[str, known(CLUTTER_KINDS)]
Bookcase = Annotated[str, known(BOOKCASE_KINDS)]
Board = Annotated[str, known(BOARD_KINDS)]
Cabinet = Annotated[str, known(CABINET_KINDS)]
Chair = Annotated[str, known(CHAIR_DESIGNS)]
Table = Annotated[str, known(TABLE_DESIGNS)]
Count = Annotated[int, Field(ge=0, le=100)]
Area = Annotated[float, Field(gt=0)]
"""Square metres."""


class Amount(Record):
    """How many there are on average; the keys that are there add up.

    Attributes:
        mean: So many anywhere.
        per_metre: So many for each square metre of floor, or metre of a corridor or table.
        one_in: One for every so many of them; None for none.
        untidy: So many more in the untidiest building.
        untidy_per_metre: So many more there for each square metre.
    """

    mean: NotNegative = 0.0
    per_metre: NotNegative = 0.0
    one_in: Area | None = None
    untidy: NotNegative = 0.0
    untidy_per_metre: NotNegative = 0.0

    def on_average(self, size: float, mess: float) -> float:
        """Return the mean for a size, square metres or metres, and an untidiness, 0-1."""
        anywhere = self.mean + self.untidy * mess
        spread = size * (self.per_metre + self.untidy_per_metre * mess)
        return anywhere + spread + (size / self.one_in if self.one_in is not None else 0.0)


class Several(Amount, Generic[Kind]):
    """How many, and of what.

    Attributes:
        of: What they are drawn from.
    """

    of: OneOrMore[Kind]


class Chance(Record):
    """How often there is such a thing.

    Attributes:
        chance: In so many of the rooms.
        over: Only in rooms of more square metres.
    """

    chance: Share
    over: NotNegative = 0.0


class Sometimes(Chance, Generic[Kind]):
    """How often there is such a thing, and what it is.

    Attributes:
        of: What it is drawn from.
    """

    of: OneOrMore[Kind]
