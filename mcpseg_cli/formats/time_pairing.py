"""Poses of the moments at which scans were taken: nearest, or between two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.poses import Poses
from mcpseg_cli.formats.rigid import between
from mcpseg_cli.formats.time_stamps import Reading

_SAME_S = 1e-4  # seconds that rounding may make of one moment


@dataclass(frozen=True)
class TimeMatch:
    """Poses by time.

    Attributes:
        poses: (S, 4, 4) float64; NaN for a scan without one.
        unpaired: Why a scan has no pose, by scan.
        awaited: Those of them whose pose could still come.
        num_between: How many are interpolated.
    """

    poses: NDArray[np.float64]
    unpaired: dict[int, str]
    awaited: frozenset[int]
    num_between: int


def choose_reading(
    ways: Sequence[Reading], stamps: NDArray[np.float64], max_gap: float
) -> Reading | None:
    """Choose the way to read the scans' time stamps that those of the poses confirm.

    Args:
        ways: Readings, the likeliest first.
        stamps: (P,) seconds of the poses.
        max_gap: Seconds from a scan to the nearest pose.

    Returns:
        The first that most scans agree with; None where no scan does.
    """
    known = np.sort(stamps)
    shares = [np.abs(_nearest(known, way.stamps) - way.stamps) for way in ways]

    # counters are time stamps only where each hits a pose's
    sure = []
    for way, gaps in zip(ways, shares, strict=True):
        hits_all = (gaps <= max(_SAME_S, way.unit / 2)).all()
        if way.is_sure or (hits_all and _is_no_counter(way, known)):
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


def match_times(
    times: NDArray[np.float64], poses: Poses, max_gap: float, *, is_growing: bool = False
) -> TimeMatch:
    """Give each moment its pose; none depends on the others, nor on poses that come later.

    Args:
        times: (S,) seconds.
        poses: In order of time, no two of one moment.
        max_gap: Seconds to the nearest pose; two that lie on either side, no farther than twice
            that, are interpolated.
        is_growing: Later poses are to come.
    """
    known = poses.stamps
    assert known is not None
    paired = np.full((len(times), 4, 4), np.nan)
    unpaired, awaited, num_between = {}, set(), 0
    for scan, time in enumerate(times.tolist()):
        after = int(np.searchsorted(known, time))
        near = [row for row in (after - 1, after) if 0 <= row < len(known)]
        nearest = min(near, key=lambda row: abs(known[row] - time))
        gap = abs(known[nearest] - time)
        if gap > _SAME_S and after == len(known) and is_growing:
            unpaired[scan] = "the poses have not come so far"
            awaited.add(scan)
        elif gap > max_gap:
            unpaired[scan] = f"the nearest is {gap:.3g} s away"
        elif nearest in poses.lost:
            unpaired[scan] = poses.lost[nearest]
        elif gap > _SAME_S and _can_interpolate(near, time, poses, max_gap):
            paired[scan] = _between(poses, near[0], time)
            num_between += 1
        else:
            paired[scan] = poses.poses[nearest]
    return TimeMatch(paired, unpaired, frozenset(awaited), num_between)


def in_time(poses: Poses, source: Path | str) -> Poses:
    """Sort poses by time.

    Raises:
        InputError: Two of one moment differ.
    """
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
    """Interpolate between a pose and the next."""
    assert poses.stamps is not None
    first, second = poses.poses[before], poses.poses[before + 1]
    start, end = poses.stamps[before], poses.stamps[before + 1]
    return between(first, second, (time - start) / (end - start))
