"""Time stamps in names of scans, in any usual spelling, and their units."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

_EPOCHS = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))  # numbers that large have this unit
_EARLIEST, _LATEST = 1e8, 4e9  # seconds: 1973 to 2096
_LONGEST = 30 * 86400.0  # seconds that a recording may take
_SECOND_DIGITS = 10  # of the seconds of today
_FLOAT_DIGITS = 7  # behind the point of such seconds, as a float has them
_SAME_UNIT = 1e-6  # seconds
_SURE_DIGITS = 3  # behind the point: no version, no counter
_DATE = re.compile(
    r"(?P<y>(?:19|20)\d\d)[-_.]?(?P<mo>\d\d)[-_.]?(?P<d>\d\d)[-_.Tt ]?(?P<h>\d\d)[-_.:h]?"
    r"(?P<mi>\d\d)[-_.:m]?(?P<s>\d\d)(?:[-_.,](?P<f>\d{1,9}))?(?!\d)"
)


@dataclass(frozen=True)
class Reading:
    """One way to read time stamps in names.

    Attributes:
        stamps: (S,) float64 seconds.
        told: What was read, in words.
        is_sure: The numbers can hardly be anything else; others may be counters.
        unit: Seconds of the last digit of numbers that are not sure.
    """

    stamps: NDArray[np.float64]
    told: str
    is_sure: bool = True
    unit: float = 0.0


def in_seconds(values: NDArray[np.float64], unit: float | None = None) -> NDArray[np.float64]:
    """Turn time stamps into seconds: of a unit that is stated, else of that of their size."""
    largest = np.abs(values).max(initial=0.0)
    guessed = next((unit for limit, unit in _EPOCHS if largest >= limit), 1.0)
    return values * (unit or guessed)


def readings(stems: Sequence[str]) -> Iterator[Reading]:
    """Read the time stamps of scans in every way that makes sense, the likeliest first.

    Args:
        stems: Names of the scans, without their endings.
    """
    seen: set[bytes] = set()
    for reading in _all_readings(stems):
        span = np.ptp(reading.stamps) if len(reading.stamps) else 0.0
        is_distinct = len(np.unique(reading.stamps)) == len(reading.stamps)
        key = reading.stamps.tobytes()
        if is_distinct and span < _LONGEST and key not in seen:
            seen.add(key)
            yield reading


def _all_readings(stems: Sequence[str]) -> Iterator[Reading]:
    if not stems:
        return
    dates = [_DATE.search(stem) for stem in stems]
    if all(dates):
        yield from _of_dates([found for found in dates if found])

    # numbers at the same place of every name
    numbers = [re.findall(r"\d+(?:\.\d+)?", stem) for stem in stems]
    if len({len(row) for row in numbers}) == 1:
        for column in zip(*numbers, strict=True):
            yield from _of_numbers(column)

    # two whole numbers side by side: seconds and their fractions
    whole = [re.findall(r"\d+", stem) for stem in stems]
    if len({len(row) for row in whole}) == 1:
        columns = list(zip(*whole, strict=True))
        for seconds, fractions in pairwise(columns):
            if all(len(word) == _SECOND_DIGITS for word in seconds):
                yield from _of_pairs(seconds, fractions)


def _of_dates(found: Sequence[re.Match[str]]) -> Iterator[Reading]:
    """Read dates with times, in UTC."""
    stamps = []
    for match in found:
        year, month, day, hour, minute, second = (
            int(match[part]) for part in ("y", "mo", "d", "h", "mi", "s")
        )
        try:
            moment = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
        except ValueError:
            return
        stamps.append(moment.timestamp() + float(f"0.{match['f'] or 0}"))
    yield Reading(np.array(stamps), "dates in names")


def _of_numbers(words: Sequence[str]) -> Iterator[Reading]:
    """Read one number a name: seconds, or thousandths, millionths … of them, or both in one."""
    values = np.array([float(word) for word in words])
    if any("." in word for word in words):
        values = in_seconds(values)
    lengths = {len(word) for word in words}
    if all("." in word for word in words):
        parts = [word.split(".") for word in words]
        fractions = [fraction for _, fraction in parts]
        digits = max(map(len, fractions))
        is_sure = _is_epoch(values) or digits >= _SURE_DIGITS
        decimal = Reading(values, "seconds in names", is_sure, 10.0**-digits)
        if _is_epoch(values) and _may_lack_zeros(fractions):
            padded = _joined([part for part, _ in parts], fractions, 1e-9)
            is_long = max(map(len, fractions)) > _FLOAT_DIGITS
            yield from (padded, decimal) if is_long else (decimal, padded)
        else:
            yield decimal
        return

    # whole numbers, or some that lost the zeros behind the point
    if any("." in word for word in words):
        yield Reading(values, "seconds in names", _is_epoch(values), _SAME_UNIT)
        return
    for unit, called in ((1.0, "seconds"), (1e-3, "ms"), (1e-6, "us"), (1e-9, "ns")):
        is_sure = _is_epoch(values * unit) and len(lengths) == 1
        if is_sure or values.max() * unit < _EARLIEST:
            yield Reading(values * unit, f"{called} in names", is_sure, unit)
    if min(lengths) > _SECOND_DIGITS and max(lengths) <= _SECOND_DIGITS + 9:
        seconds, rest = zip(
            *((word[:_SECOND_DIGITS], word[_SECOND_DIGITS:]) for word in words), strict=True
        )
        if _is_epoch(np.array(seconds, float)):
            yield _joined(seconds, rest, 1e-9)


def _of_pairs(seconds: Sequence[str], fractions: Sequence[str]) -> Iterator[Reading]:
    """Read seconds and, beside them, a decimal fraction or a count of ns, us or ms."""
    whole = np.array(seconds, float)
    if not _is_epoch(whole) or max(map(len, fractions)) > 9:
        return
    decimal = whole + np.array([float(f"0.{word}") for word in fractions])
    counted = [
        _joined(seconds, fractions, unit)
        for unit, digits in ((1e-9, 9), (1e-6, 6), (1e-3, 3))
        if max(map(len, fractions)) <= digits
    ]
    if len({len(word) for word in fractions}) == 1:
        yield Reading(decimal, "seconds and their fractions in names")
    else:
        yield from counted
        yield Reading(decimal, "seconds and their fractions in names")


def _joined(seconds: Sequence[str], counts: Sequence[str], unit: float) -> Reading:
    """Read seconds, and a count of smaller units without the zeros before it."""
    stamps = np.array(seconds, float) + unit * np.array(counts, float)
    called = {1e-9: "nanoseconds", 1e-6: "microseconds", 1e-3: "milliseconds"}[unit]
    return Reading(stamps, f"seconds and {called} in names")


def _may_lack_zeros(fractions: Sequence[str]) -> bool:
    """Tell whether fractions could be counts whose zeros in front were dropped."""
    is_even = len({len(word) for word in fractions}) == 1
    return not is_even and not any(word[0] == "0" and len(word) > 1 for word in fractions)


def _is_epoch(seconds: NDArray[np.float64]) -> bool:
    return bool(((seconds > _EARLIEST) & (seconds < _LATEST)).all())
