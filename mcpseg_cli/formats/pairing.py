"""Which pose belongs to which scan: by name, by time, and by order where nothing contradicts it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.poses import Poses
from mcpseg_cli.formats.scan_names import match_names, match_numbers, varying_numbers
from mcpseg_cli.formats.time_stamps import Reading, readings

MAX_GAP_S = 0.05
"""Seconds from a scan to the nearest pose: at walking speed, half a voxel."""

_SAME_S = 1e-4  # seconds that rounding may make of one moment
_AHEAD = 3  # poses that a growing recording may have before their scans


@dataclass(frozen=True)
class Pairing:
    """The pose of every scan.

    Attributes:
        poses: (S, 4, 4) float64, sensor to map, metres; NaN for a scan without one.
        how: How they were paired, in words.
        unpaired: Why a scan has no pose, by scan.
        surplus: Poses of scans that are not there, as the file calls them.
        order: (S,) scans in the order in which they were taken.
    """

    poses: NDArray[np.float64]
    how: str
    unpaired: dict[int, str] = field(default_factory=dict)
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
    if named is not None:
        return _by_rows(scans, poses, *named)
    numbered = _numbered(scans, poses)
    if numbered is not None:
        return _by_rows(scans, poses, numbered, "by number")

    # time, as the recording or the names of its scans have it
    known = [Reading(stamps, "time stamps of the scans")] if stamps is not None else None
    ways = known if known is not None else list(readings([_stem(scan) for scan in scans]))
    if poses.stamps is not None:
        chosen = _choose(ways, poses.stamps, max_gap)
        if chosen is not None:
            return _by_time(chosen, poses, max_gap, source, is_growing=is_growing)
    if poses.scans is not None:
        found = f"no pose for scan {scans[0]} (names are like {poses.scans[0]!r})"
        raise InputError(source, found, "a row for every scan", "add it or remove the scan")
    sure = next((way for way in ways if way.is_sure), None)
    return _by_order(scans, sure, poses, max_gap, source, is_growing=is_growing)


def _stem(name: str) -> str:
    return Path(name).stem


# --- names ---


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
    left = [row for row in range(len(poses)) if row not in taken]
    names: Sequence[object] = (
        poses.scans
        if poses.scans is not None
        else poses.ids.tolist()
        if poses.ids is not None
        else []
    )  # noqa: E501
    surplus = tuple(str(names[row]) for row in left)
    return Pairing(paired, told, unpaired, surplus, np.arange(len(scans)))


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


# --- time ---


def _choose(ways: Sequence[Reading], stamps: NDArray[np.float64], max_gap: float) -> Reading | None:
    """Choose the way to read the scans' time stamps that the poses' confirm; None if none."""
    known = np.sort(stamps)
    shares = [np.abs(_nearest(known, way.stamps) - way.stamps) for way in ways]

    # counters are time stamps only where each hits a pose's
    sure = []
    for way, gaps in zip(ways, shares, strict=True):
        if way.is_sure:
            sure.append((way, gaps))
        elif (gaps <= max(_SAME_S, way.unit / 2)).all() and _is_no_counter(way, known):
            sure.append((way, gaps))
    exact = [((gaps <= _SAME_S).mean(), way) for way, gaps in sure]
    best = max((share for share, _ in exact), default=0.0)
    if best >= 0.5:
        return next(way for share, way in exact if share == best)
    near = [((gaps <= max_gap).mean(), way) for way, gaps in sure]
    half = next((way for share, way in near if share >= 0.5), None)
    best = max((share for share, _ in near), default=0.0)
    return half or next((way for share, way in near if share == best and share > 0), None)


def _is_no_counter(way: Reading, known: NDArray[np.float64]) -> bool:
    """Tell time stamps from numbers 0, 1, 2 …, which hit poses that are dense enough."""
    steps = np.diff(np.sort(way.stamps))
    is_counter = len(steps) == 0 or bool(np.allclose(steps, way.unit))
    are_whole = bool((known == np.round(known)).all())
    return (way.unit == 1.0 and are_whole) if is_counter or way.unit == 1.0 else True


def _nearest(known: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the nearest of (P,) sorted values to each of (S,) times."""
    after = np.searchsorted(known, times).clip(0, len(known) - 1)
    before = (after - 1).clip(0)
    nearer = np.abs(known[before] - times) <= np.abs(known[after] - times)
    nearest: NDArray[np.float64] = np.where(nearer, known[before], known[after])
    return nearest


def _by_time(
    reading: Reading, poses: Poses, max_gap: float, source: Path | str, *, is_growing: bool
) -> Pairing:
    """Pair scans with the poses before and after them; each on its own, whatever comes later."""
    poses = _in_time(poses, source)
    known = poses.stamps
    assert known is not None
    times = reading.stamps
    paired = np.full((len(times), 4, 4), np.nan)
    unpaired = {}
    num_between = 0
    for scan, time in enumerate(times.tolist()):
        after = int(np.searchsorted(known, time))
        near = [row for row in (after - 1, after) if 0 <= row < len(known)]
        nearest = min(near, key=lambda row: abs(known[row] - time))
        gap = abs(known[nearest] - time)
        if gap > _SAME_S and after == len(known) and is_growing:
            unpaired[scan] = "the poses have not come so far"
        elif gap > max_gap:
            unpaired[scan] = f"the nearest is {gap:.3g} s away"
        elif nearest in poses.lost:
            unpaired[scan] = poses.lost[nearest]
        elif gap > _SAME_S and _can_interpolate(near, time, poses, max_gap):
            paired[scan] = _between(poses, near[0], time)
            num_between += 1
        else:
            paired[scan] = poses.poses[nearest]
    told = f"by time, {reading.told}, within {max_gap:g} s"
    told += f" ({num_between:,} between two poses)" if num_between else ""
    order = np.argsort(times, kind="stable")
    return Pairing(paired, told, unpaired, (), order)


def _in_time(poses: Poses, source: Path | str) -> Poses:
    """Sort poses by time; two of one moment must not differ."""
    assert poses.stamps is not None
    poses = poses.select(np.argsort(poses.stamps, kind="stable"))
    stamps = poses.stamps
    assert stamps is not None
    again = np.flatnonzero(np.diff(stamps) == 0) + 1
    differ = [row for row in again if not np.array_equal(poses.poses[row], poses.poses[row - 1])]
    if differ:
        found = f"poses that differ at the same time, {stamps[differ[0]]:.6f} s"
        remedy = "write time stamps with all their digits, or remove all but one"
        raise InputError(source, found, "one pose a moment", remedy)
    return poses.select(np.setdiff1d(np.arange(len(poses)), again)) if len(again) else poses


def _can_interpolate(near: list[int], time: float, poses: Poses, max_gap: float) -> bool:
    """Tell whether there is a pose on either side, near enough."""
    stamps = poses.stamps
    assert stamps is not None
    return len(near) == 2 and all(
        abs(stamps[row] - time) <= 2 * max_gap and row not in poses.lost for row in near
    )


def _between(poses: Poses, before: int, time: float) -> NDArray[np.float64]:
    """Interpolate between a pose and the next: positions along the line, turns about one axis."""
    assert poses.stamps is not None
    first, second = poses.poses[before], poses.poses[before + 1]
    start, end = poses.stamps[before], poses.stamps[before + 1]
    share = (time - start) / (end - start)
    turn = Rotation.from_matrix(first[:3, :3].T @ second[:3, :3]).as_rotvec()
    pose = np.eye(4)
    pose[:3, :3] = first[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
    pose[:3, 3] = (1 - share) * first[:3, 3] + share * second[:3, 3]
    return pose


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
