"""Numbers that people edit: TOML tables beside the code, read and checked."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from mcpseg_cli.errors import InputError

Table = TypeVar("Table", bound="Record")


class Record(BaseModel):
    """A table, or a part of one: every key has to be there, and no other."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def _rising(ends: tuple[float, float]) -> tuple[float, float]:
    """Refuse a range whose ends are in the wrong order."""
    if ends[0] > ends[1]:
        raise ValueError("the lowest first, then the highest")
    return ends


Choice = TypeVar("Choice")
Number = TypeVar("Number", bound=float)
OneOrMore = Annotated[tuple[Choice, ...], Field(min_length=1)]
"""What is drawn from, with even chances: what is in it twice is drawn twice as often."""
Range = Annotated[tuple[Number, Number], AfterValidator(_rising)]
"""Lowest and highest; what lies between is drawn with even chances."""
Share = Annotated[float, Field(ge=0, le=1)]
"""How often, or how much of all: 0 never, 1 always."""
Weight = Annotated[float, Field(gt=0)]
"""How often in proportion to the others."""
Metres = Annotated[float, Field(gt=0, le=100)]


def read_table(path: Path, model: type[Table]) -> Table:
    """Read a TOML file.

    Args:
        path: The file.
        model: What it holds.

    Raises:
        InputError: The file is no TOML, or a key is missing, unknown or out of range; it is named.
    """
    remedy = "correct it, or install mcpseg again"
    try:
        return model.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except tomllib.TOMLDecodeError as error:
        raise InputError(path, f"no TOML: {error}", "a table", remedy) from error
    except ValidationError as error:
        found, expected = _first_problem(error)
        raise InputError(path, found, expected, remedy) from error


def _first_problem(error: ValidationError) -> tuple[str, str]:
    """Return what was found and what was expected, with the key at fault."""
    problem = error.errors()[0]
    key = ".".join(str(step) for step in problem["loc"])
    if problem["type"] == "missing":
        return f"no key {key}", "every key of this table"
    if problem["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"unknown key {key}", "no other keys than the records in the code have"
    wanted = problem["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
    return f"{key} = {problem['input']!r}", wanted
