"""Names that a person would call the same: paths, endings, case, zeros in front of numbers."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from decimal import Decimal, InvalidOperation

import numpy as np
from numpy.typing import NDArray

_ENDINGS = re.compile(r"(?:\.[A-Za-z][A-Za-z0-9]{0,9})+$")


def match_names(scans: Sequence[str], rows: Sequence[str]) -> tuple[NDArray[np.intp], str] | None:
    """Find the row of every scan by name.

    Names are compared as they are, then without paths, case and endings. Only where none is the
    same so, numbers count: without zeros before and behind, or alone where all else is the same in
    all names; and only where one side has them all, for another count is off by one.

    Args:
        scans: File names.
        rows: Names by row, each another.

    Returns:
        (S,) row of each scan, -1 where it has none, and what was the same, in words; None where no
        scan has a row.
    """
    found = np.full(len(scans), -1, np.intp)
    for left, right in ((_as_is, _as_is), (_stem, _as_is), (_base, _base), (bare_name, bare_name)):
        if (found < 0).any():
            _match_more(found, [left(scan) for scan in scans], [right(row) for row in rows])
    if (found >= 0).any():
        return found, "by name"
    for key, told in ((_without_zeros, "by name, but for zeros"), (_decimal, "by number in names")):
        found = _match_all([key(scan) for scan in scans], [key(row) for row in rows])
        if (found >= 0).any():
            return found, told
    found = match_numbers(scans, rows)
    return (found, "by number in names") if (found >= 0).any() else None


def match_numbers(scans: Sequence[str], rows: Sequence[str]) -> NDArray[np.intp]:
    """Find rows by the one number that differs in names that are otherwise alike; all or nothing.

    Returns:
        (S,) row of each scan, -1 where it has none.
    """
    return _match_all(varying_numbers(scans), varying_numbers(rows))


def varying_numbers(names: Sequence[str]) -> list[str | None]:
    """Return the number that differs from name to name; None for all where that is not one."""
    parts = [re.split(r"(\d+)", bare_name(name)) for name in names]
    if len({tuple(part[::2]) for part in parts}) != 1 or len(parts[0]) < 3:
        return [None] * len(names)
    columns = list(zip(*(part[1::2] for part in parts), strict=True))
    varying = [column for column in columns if len(set(column)) > 1] or columns[-1:]
    return [str(int(word)) for word in varying[0]] if len(varying) == 1 else [None] * len(names)


def _match_more(
    found: NDArray[np.intp], scans: Sequence[str | None], rows: Sequence[str | None]
) -> None:
    """Add rows of the same key to scans that have none yet; what several have tells nothing."""
    taken = set(found.tolist())
    free = {row: key for row, key in enumerate(rows) if row not in taken and key is not None}
    counts = Counter(free.values())
    by_key = {key: row for row, key in free.items() if counts[key] == 1}
    waiting = {place: key for place, key in enumerate(scans) if found[place] < 0}
    wanted = Counter(waiting.values())
    for place, key in waiting.items():
        if key is not None and wanted[key] == 1 and key in by_key:
            found[place] = by_key[key]


def _match_all(scans: Sequence[str | None], rows: Sequence[str | None]) -> NDArray[np.intp]:
    """Find rows by key where every scan has one, or every row a scan."""
    found = np.full(len(scans), -1, np.intp)
    _match_more(found, scans, rows)
    is_whole = (found >= 0).all() or (found >= 0).sum() == len(rows)
    return found if is_whole else np.full(len(scans), -1, np.intp)


def _as_is(name: str) -> str:
    return name


def _stem(name: str) -> str:
    return name.rpartition(".")[0] or name


def _base(name: str) -> str:
    """Drop the folders of either system, case, and the ways to write one letter."""
    return unicodedata.normalize("NFC", re.split(r"[\\/]", name.strip())[-1]).casefold()


def bare_name(name: str) -> str:
    """Return a name without folders, case and endings."""
    return _ENDINGS.sub("", _base(name))


def _without_zeros(name: str) -> str:
    return re.sub(r"(?<![\d.])0+(?=\d)", "", bare_name(name))


def _decimal(name: str) -> str | None:
    text = bare_name(name)
    if not re.fullmatch(r"\d+(?:\.\d+)?", text):
        return None
    try:
        return str(Decimal(text).normalize())
    except InvalidOperation:
        return None
