"""Pairing: which true point each scored point is compared with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN, remap_table
from mcpseg_cli.errors import InputError
from mcpseg_cli.evaluate.truth import NO_ROOM, Truth, TruthPart
from mcpseg_cli.formats.labels import check_classes
from mcpseg_cli.incremental.voxel_map import VoxelMap

_SAME = 1e-3  # metres; clouds whose points lie this close in order are the same (LAS rounds)
_SLACK = 1e-6  # metres; what float32 coordinates may lose
_CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)


@dataclass(frozen=True)
class PairedTruth:
    """The truth about N scored points.

    Attributes:
        semantic: (N,) uint8 true class in the table of the scored points; 255 unknown or uncovered.
        instance: (N,) int32 true object, 0 none or uncovered.
        room: (N,) int32 room, -1 none or uncovered.
        covered: (N,) bool whether there is a true point.
        by_point: Both clouds are the same, point for point; else the nearest true point within
            reach was taken.
        reach: Metres within which true points were sought.
        truth_points: True points read; of several scans, every look counts.
        truth_uncovered: Of those, how many have no scored point within reach.
        is_named: Whether all the truth names its classes.
        other_classes: True classes that the table lacks, with their points as read; they are
            unknown.
    """

    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]
    room: NDArray[np.int32]
    covered: NDArray[np.bool_]
    by_point: bool
    reach: float
    truth_points: int
    truth_uncovered: int
    is_named: bool
    other_classes: dict[str, int]


def pair_with_truth(
    xyz: NDArray[np.floating],
    truth: Truth,
    classes: tuple[str, ...],
    reach: float,
    told: Callable[[int], None] = lambda _: None,
) -> PairedTruth:
    """Find the truth about every point: by point where both clouds are the same, else the nearest within reach.

    Args:
        xyz: (N, 3) scored points, metres, map frame.
        truth: Read part by part; memory does not grow with it.
        classes: Class table of the result; those of the truth are matched by name, or taken to be
            these.
        reach: Metres.
        told: Called after every part with how many have been read.

    Returns:
        The truth about the points; of points equally near, the first is taken.

    Raises:
        InputError: The truth is damaged, has no labels, classes beyond the table, or no class of
            the table.
    """
    nearest = NearestPoints(xyz, reach)
    semantic, instance = np.full(len(xyz), UNKNOWN, np.uint8), np.zeros(len(xyz), np.int32)
    room, covered = np.full(len(xyz), NO_ROOM, np.int32), np.zeros(len(xyz), bool)
    truth_points = uncovered = 0
    others: dict[str, int] = {}
    matched = by_point = False
    is_named = True
    for number, part in enumerate(truth.parts(), start=1):
        is_named &= bool(part.classes)
        table = _table_of(part, classes, others)
        matched |= bool((table != UNKNOWN).any())
        by_point = len(truth.paths) == 1 and _are_same(part.xyz, xyz)
        if by_point:
            ids, rows = np.arange(len(xyz), dtype=np.int32), np.arange(len(xyz))
        else:
            ids, rows, num_near = nearest.offer(part.xyz)
            uncovered += len(part.xyz) - num_near
        semantic[ids], instance[ids] = table[part.semantic[rows]], part.instance[rows]
        room[ids], covered[ids] = part.room[rows], True
        truth_points += len(part.xyz)
        told(number)
    if not matched:
        found = f"classes {_few(others)}"
        raise InputError(
            truth.source, found, f"some of {_few(classes)}", "rename the classes of one of them"
        )
    return PairedTruth(
        semantic,
        instance,
        room,
        covered,
        by_point,
        reach,
        truth_points,
        uncovered,
        is_named,
        others,
    )


def _table_of(
    part: TruthPart, classes: tuple[str, ...], others: dict[str, int]
) -> NDArray[np.uint8]:
    """Return the look-up table of a part's classes; count its points of classes that are not in the result's."""
    if not part.classes:
        check_classes(part.semantic, classes, part.source)
    table = remap_table(part.classes or classes, classes)
    counts = np.bincount(part.semantic, minlength=256)
    for index, name in enumerate(part.classes):
        if table[index] == UNKNOWN:
            others[name] = others.get(name, 0) + int(counts[index])
    return table


def _few(names: tuple[str, ...] | dict[str, int]) -> str:
    """List up to five names."""
    return ", ".join(list(names)[:5]) + (", …" if len(names) > 5 else "")


def _are_same(first: NDArray[np.floating], second: NDArray[np.floating]) -> bool:
    """Tell whether two clouds hold the same points in the same order."""
    return len(first) == len(second) and bool((np.abs(first - second) <= _SAME).all())


class NearestPoints:
    """For every point of a cloud, the nearest of others that are offered bit by bit.

    Args:
        xyz: (N, 3) the cloud, metres; at least one point.
        reach: Metres beyond which nothing is near.
    """

    def __init__(self, xyz: NDArray[np.floating], reach: float) -> None:
        self._origin = xyz.min(axis=0).astype(np.float64)
        self._xyz = xyz - self._origin
        self._reach = reach + _SLACK
        self._low, self._high = -self._reach, self._xyz.max(axis=0) + self._reach
        self._cells = VoxelMap(
            2.01 * self._reach
        )  # a cube around an offered point touches two cells along each axis
        cell = self._cells.insert(self._xyz.astype(np.float32), np.zeros((len(xyz), 3), np.uint8))
        self._members = np.argsort(cell, kind="stable").astype(np.int32)
        self._starts = np.append(0, np.cumsum(np.bincount(cell)))
        self._best = np.full(len(xyz), np.inf)  # squared metres
        self._row = np.full(len(xyz), -1, np.int64)

    def offer(self, xyz: NDArray[np.floating]) -> tuple[NDArray[np.int32], NDArray[np.int64], int]:
        """Offer points.

        Args:
            xyz: (M, 3) metres.

        Returns:
            (Q,) int32 points of the cloud to which one of these is nearer than all offered before,
            (Q,) int64 the row of that one, and how many of the M are within reach of the cloud.
        """
        offered = xyz - self._origin
        rows = np.flatnonzero(((offered >= self._low) & (offered <= self._high)).all(axis=1))
        offered = offered[rows]
        corners = [
            self._cells.find((offered + 1.002 * self._reach * way).astype(np.float32))
            for way in _CORNERS
        ]
        grid = (np.stack(corners), self._starts, self._members)
        ids, num_near = _offer_points(
            offered, self._xyz, self._reach**2, grid, self._best, self._row
        )
        found = rows[self._row[ids]]
        self._row[ids] = -1
        return ids, found, num_near


@njit(cache=True)
def _offer_points(
    offered: NDArray[np.float64],
    xyz: NDArray[np.float64],
    limit: float,
    grid: tuple[NDArray[np.int32], NDArray[np.int64], NDArray[np.int32]],
    best: NDArray[np.float64],
    row: NDArray[np.int64],
) -> tuple[NDArray[np.int32], int]:
    """Update ``best`` and ``row`` of the points near offered ones; grid is (8, M) cells, their starts and members."""
    cells, starts, members = grid
    ids = []
    num_near = 0
    for i in range(offered.shape[0]):
        is_near = False
        for corner in range(8):
            cell = cells[corner, i]
            if cell < 0 or (corner > 0 and cell == cells[corner - 1, i]):
                continue
            for point in members[starts[cell] : starts[cell + 1]]:
                distance = 0.0
                for axis in range(3):
                    distance += (offered[i, axis] - xyz[point, axis]) ** 2
                is_near |= distance <= limit
                if distance <= limit and distance < best[point]:
                    if row[point] < 0:
                        ids.append(point)
                    best[point], row[point] = distance, i
        num_near += is_near
    return np.array(ids, np.int32), num_near
