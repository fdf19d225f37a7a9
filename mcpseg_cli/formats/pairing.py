"""Which pose belongs to which scan: by name, by time, and by order where nothing contradicts it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.poses import Poses
from mcpseg_cli.formats.scan_names import bare_name, match_names, match_numbers, varying_numbers
from mcpseg_cli.formats.time_pairing import choose_reading, in_time, match_times
from mcpseg_cli.formats.time_stamps import Reading, readings

MAX_GAP_S = 0.05
"""Seconds from a scan to the nearest pose: at walking speed, half a voxel."""

_AHEAD = 3  # poses that a growing recording may have before their scans


@dataclass(frozen=True)
class Pairing:
    """The pose of every scan.

    Attributes:
        poses: (S, 4, 4) float64, sensor to map, metres; NaN for a scan without one.
        how: How they were paired, in words.
        unpaired: Why a scan has no pose, by scan.
        awaited: Those of them whose pose could still come.
        surplus: Poses of scans that are not there, as the file calls them.
        order: (S,) scans in the order in which they were taken.
    """

    poses: NDArray[np.float64]
    how: str
    unpaired: dict[int, str] = field(default_factory=dict)
    awaited: frozenset[int] = frozenset()
    surplus: tuple[str, ...] = ()
    order: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, np.intp))


def pair(
    scans: Sequence[str],
    stamps: NDArray[np.float64] | None,
    poses: Poses,
    max_gap: float = MAX_GAP_S,
    *,
    source: Path | str = "poses",
    is_growing: bool = False,
) -> Pairing:
    """Give every scan its pose: names count first, then time stamps, then the order.

    Args:
        scans: File names, in natural order.
        stamps: (S,) seconds at which they were taken, where the recording says so; else names may.
        poses: The poses.
        max_gap: Seconds from a scan to the nearest pose. Between two poses that are near enough,
            the scan's is interpolated.
        source: What the poses are from, for messages.
        is_growing: More scans and poses are to come: what these could change has no pose yet.

    Returns:
        A pose for every scan that has one.

    Raises:
        InputError: Nothing says which pose belongs to which scan, or what does contradicts itself.
    """
    named = match_names(scans, poses.scans) if poses.scans is not None else None
    is_whole = named is not None and bool((named[0] >= 0).all())
    poses, is_by_names = (poses, False) if is_whole else _timed_by_names(poses)
    if named is not None and not is_by_names:
        return _by_rows(scans, poses, *named)
    numbered = _numbered(scans, poses)
    if numbered is not None:
        return _by_rows(scans, poses, numbered, "by number")

    # time, as the recording or the names of its scans have it
    known = [Reading(stamps, "time stamps of the scans")] if stamps is not None else None
    ways = known if known is not None else list(readings([bare_name(scan) for scan in scans]))
    if poses.stamps is not None:
        chosen = choose_reading(ways, poses.stamps, max_gap)
        if chosen is not None:
            return _by_time(chosen, poses, max_gap, source, is_growing=is_growing)
    if named is not None:
        return _by_rows(scans, poses, *named)
    if poses.scans is not None:
        found = f"no pose for scan {scans[0]} (names are like {poses.scans[0]!r})"
        raise InputError(source, found, "a row for every scan", "add it or remove the scan")
    sure = next((way for way in ways if way.is_sure), None)
    return _by_order(scans, sure, poses, max_gap, source, is_growing=is_growing)


# --- names ---


def _timed_by_names(poses: Poses) -> tuple[Poses, bool]:
    """Take the time stamps of poses from their names, where there are no others."""
    if poses.stamps is not None or poses.scans is None:
        return poses, False
    ways = readings([bare_name(name) for name in poses.scans])
    reading = next((way for way in ways if way.is_sure), None)
    return (replace(poses, stamps=reading.stamps), True) if reading else (poses, False)


def _by_rows(scans: Sequence[str], poses: Poses, rows: NDArray[np.intp], told: str) -> Pairing:
    """Pair by the row of each scan, -1 for none."""
    paired = np.full((len(scans), 4, 4), np.nan)
    paired[rows >= 0] = poses.poses[rows[rows >= 0]]
    unpaired = {}
    for scan, row in enumerate(rows.tolist()):
        if row < 0:
            unpaired[scan] = "no row for it"
        elif row in poses.lost:
            unpaired[scan] = poses.lost[row]
    taken = set(rows.tolist())
    names = poses.scans or ()
    surplus = tuple(name for row, name in enumerate(names) if row not in taken)
    missing = frozenset(np.flatnonzero(rows < 0).tolist())
    return Pairing(paired, told, unpaired, missing, surplus, np.arange(len(scans)))


def _numbered(scans: Sequence[str], poses: Poses) -> NDArray[np.intp] | None:
    """Find rows by the numbers of poses, unless those may count something else."""
    if poses.ids is None:
        return None
    rows = match_numbers(scans, [str(number) for number in poses.ids.tolist()])
    if not (rows >= 0).any():
        return None

    # the first scans of many poses: these may be denser
    if len(poses) > len(scans):
        numbers = sorted(int(word) for word in varying_numbers(scans) if word is not None)
        if numbers == list(range(numbers[0], numbers[0] + len(numbers))):
            return None
    return rows


def _by_time(
    reading: Reading, poses: Poses, max_gap: float, source: Path | str, *, is_growing: bool
) -> Pairing:
    """Pair scans with the poses of their moments."""
    match = match_times(reading.stamps, in_time(poses, source), max_gap, is_growing=is_growing)
    between = f" ({match.num_between:,} between two poses)" if match.num_between else ""
    told = f"by time, {reading.told}, within {max_gap:g} s{between}"
    order = np.argsort(reading.stamps, kind="stable")
    return Pairing(match.poses, told, match.unpaired, match.awaited, (), order)


# --- order ---


def _by_order(
    scans: Sequence[str],
    reading: Reading | None,
    poses: Poses,
    max_gap: float,
    source: Path | str,
    *,
    is_growing: bool,
) -> Pairing:
    """Pair the first scan with the first pose, and so on, where nothing speaks against it."""
    # poses that have more moments than there are scans say nothing of which belongs to which
    count, ahead = f"{len(poses):,} poses for {len(scans):,} scans", len(poses) - len(scans)
    is_coming = is_growing and ahead <= _AHEAD
    if ahead and not is_coming:
        remedy = "add a scan column, or call the scans by their time stamps"
        if len(poses) == 1 and (folder := _folder_of_poses(source)):
            remedy = f"give {folder}, if each scan has a file of its own there"
        raise InputError(source, count, "as many, or names or times that tell", remedy)

    # rows in order of time, or of their numbers
    told, rows = "by order", _in_order(poses)
    if not np.array_equal(rows, np.arange(len(poses))):
        if is_growing:
            raise InputError(source, "poses out of order", "the latest last", "give them names")
        told = "by order of time" if poses.stamps is not None else "by order of number"
    order = np.arange(len(scans))
    if reading is not None:
        order = np.argsort(reading.stamps, kind="stable")
        if poses.stamps is not None and len(poses) == len(scans):
            offset = _offset(reading.stamps[order], poses.stamps[rows], max_gap, source)
            told += f", clocks {offset:.6g} s apart"

    num_paired = min(len(scans), len(poses))
    found = np.full(len(scans), -1, np.intp)
    found[order[:num_paired]] = rows[:num_paired]
    told += f" ({num_paired:,} and {num_paired:,})"
    return replace(
        _by_rows(scans, replace(poses, scans=None), found, told), surplus=(), order=order
    )


def _folder_of_poses(source: Path | str) -> Path | None:
    """Return the folder of a pose file that is one of several; None for another one."""
    if isinstance(source, str) or not source.is_file():
        return None
    alike = [path for path in source.parent.iterdir() if path.suffix == source.suffix]
    return source.parent if len(alike) > 1 else None


def _in_order(poses: Poses) -> NDArray[np.intp]:
    """Return the rows in order of their time stamps or numbers, where these all differ."""
    for key in (poses.stamps, poses.ids):
        if key is not None and len(np.unique(key)) == len(key):
            return np.argsort(key, kind="stable")
    return np.arange(len(poses))


def _offset(
    scans: NDArray[np.float64], poses: NDArray[np.float64], max_gap: float, source: Path | str
) -> float:
    """Return the seconds between two clocks that agree otherwise; refuse such that do not."""
    offset = float(np.median(scans - poses))
    worst = np.abs(scans - poses - offset).max()
    if worst > max_gap:
        found = (
            f"time stamps from {poses[0]:.6f} to {poses[-1]:.6f} s for scans from "
            f"{scans[0]:.6f} to {scans[-1]:.6f} s"
        )
        expected = f"poses within {max_gap:g} s of the scans"
        raise InputError(source, found, expected, "give --max-time-gap, or a scan column")
    return offset
