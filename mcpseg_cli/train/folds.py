"""Which ray-traced areas to train on, and which to hold out."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ValidationError

from mcpseg_cli.errors import InputError
from mcpseg_cli.resumable import printable

RECORD = "raytrace.json"


@dataclass(frozen=True)
class Area:
    """One ray-traced area.

    Attributes:
        folder: It has scans/, gt/ and poses.csv.
        name: Its path in the data.
        number: At the end of the folder's name; None where there is none.
    """

    folder: Path
    name: str
    number: int | None


@dataclass(frozen=True)
class Fold:
    """What to train on and what to validate on.

    Attributes:
        holdout: Number of the areas held out; None: none.
        training: At least one area.
        validation: Empty where none is held out.
    """

    holdout: int | None
    training: tuple[Area, ...]
    validation: tuple[Area, ...]

    @property
    def label(self) -> str:
        """How files are named after it."""
        return "all" if self.holdout is None else f"holdout{self.holdout}"


def find_areas(data: Path) -> list[Area]:
    """Find the ray-traced areas in a folder and in the folders in it, or the one that it is.

    Args:
        data: What ``mcpseg raytrace`` wrote, or a folder of that.

    Returns:
        Areas in the order of their paths, at least one.

    Raises:
        InputError: There is none, or one has no truth or is not complete.
        OSError: A folder cannot be read.
    """
    expected, remedy = "ray-traced areas", "make them with 'mcpseg raytrace'"
    if not data.is_dir():
        raise InputError(data, "no such folder", expected, f"{remedy}, or give DATA")
    next(data.iterdir(), None)  # a folder that may not be read is an error, not empty
    records = sorted(_records(data))
    if not records:
        raise InputError(data, f"no {RECORD} in it", expected, remedy)

    for record in records:
        _check_area(record)
    folders = [record.parent for record in records]
    return [Area(folder, _name(folder, data), _number(folder)) for folder in folders]


def _records(folder: Path) -> Iterator[Path]:
    """Yield the records in a folder and in the folders in it.

    Links are followed, into no folder twice.
    """
    seen = set()
    for path, names, files in os.walk(folder, followlinks=True):
        if (real := os.path.realpath(path)) in seen:
            names.clear()
            continue
        seen.add(real)
        if RECORD in files:
            yield Path(path, RECORD)


class _Traced(BaseModel):
    """What of a record of ``mcpseg raytrace`` matters here."""

    complete: bool = False


def _check_area(record: Path) -> None:
    """Refuse an area that training cannot use, before hours are spent on the others."""
    area, again = record.parent, "trace the area again"
    try:
        is_complete = _Traced.model_validate_json(record.read_bytes()).complete
    except ValidationError as error:
        expected = "the record of 'mcpseg raytrace'"
        raise InputError(record, "not a JSON record", expected, again) from error
    if not is_complete:
        remedy = "run its 'mcpseg raytrace' command again"
        raise InputError(area, "not traced to the end", "all scans", remedy)

    for name in ("scans", "gt", "poses.csv"):
        if not (area / name).exists():
            raise InputError(area, f"no {name}", "scans/, gt/ and poses.csv", again)


def _name(folder: Path, data: Path) -> str:
    return printable(
        folder.absolute().name if folder == data else folder.relative_to(data).as_posix()
    )


def _number(folder: Path) -> int | None:
    found = re.search(r"(\d+)$", folder.absolute().name)
    return int(found[1]) if found else None


def make_folds(areas: Sequence[Area], holdout: str, data: Path) -> list[Fold]:
    """Split areas into what is trained on and what is held out.

    Args:
        areas: From ``find_areas``.
        holdout: ``6``: all areas of that number; ``1,2,6``: one fold each; ``all``: one for every
            number there is; ``none``: train on everything.
        data: Named in messages.

    Returns:
        At least one fold.

    Raises:
        InputError: A number that no area has, or nothing is left to train on.
    """
    if holdout == "none":
        return [Fold(None, tuple(areas), ())]
    present = sorted({area.number for area in areas if area.number is not None})
    listed = ", ".join(map(str, present))
    known = f"one of {listed}" if present else "areas whose names end in a number"
    try:
        numbers = present if holdout == "all" else [int(word) for word in holdout.split(",")]
    except ValueError as error:
        expected = f"{known}, all or none"
        raise InputError(f"--holdout {holdout}", "not a number", expected, "check it") from error

    # a fold for each number: its areas are held out
    folds = []
    for number in dict.fromkeys(numbers):
        training = tuple(area for area in areas if area.number != number)
        validation = tuple(area for area in areas if area.number == number)
        if not validation:
            raise InputError(data, f"no area of number {number}", known, "choose another --holdout")
        if not training:
            found, remedy = f"only areas of number {number}", "add some, or --holdout none"
            raise InputError(data, found, "others to train on", remedy)
        folds.append(Fold(number, training, validation))

    if not folds:
        remedy = "rename areas, or give --holdout none"
        raise InputError(data, "no area with a number", known, remedy)
    return folds
