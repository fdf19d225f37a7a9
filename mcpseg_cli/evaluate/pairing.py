"""Pairing: which true point each scored point is compared with."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN, remap_table
from mcpseg_cli.errors import InputError
from mcpseg_cli.evaluate.class_map import ClassMap
from mcpseg_cli.evaluate.nearest_points import NearestPoints
from mcpseg_cli.evaluate.truth import NO_ROOM, Truth, TruthPart
from mcpseg_cli.formats.labels import check_classes

_SAME = 1e-3  # metres; clouds whose points lie this close in order are the same (LAS rounds)


@dataclass(frozen=True)
class PairedTruth:
    """The truth about N scored points.

    Attributes:
        semantic: (N,) uint8 true class in ``classes``; 255 unknown or uncovered.
        instance: (N,) int32 true object, 0 none or uncovered.
        room: (N,) int32 room, -1 none or uncovered.
        covered: (N,) bool whether there is a true point.
        by_point: Both clouds are the same, point for point; else the nearest true point within
            reach was taken.
        reach: Metres within which true points were sought.
        truth_points: True points read; of several scans, every look counts.
        truth_uncovered: Of those, how many have no scored point within reach.
        classes: The class table asked for, else the first that the truth has; empty where it has
            none.
        is_named: Whether all the truth names its classes.
        highest_class: Highest true class read before there was a table; -1 for none.
        other_classes: True classes that the table lacks, with their points as read; they are
            unknown.
        labels: True classes, as the truth names them.
    """

    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]
    room: NDArray[np.int32]
    covered: NDArray[np.bool_]
    by_point: bool
    reach: float
    truth_points: int
    truth_uncovered: int
    classes: tuple[str, ...]
    is_named: bool
    highest_class: int
    other_classes: dict[str, int]
    labels: tuple[str, ...]


def pair_with_truth(
    xyz: NDArray[np.floating],
    truth: Truth,
    classes: tuple[str, ...],
    reach: float,
    told: Callable[[int], None] = lambda _: None,
    *,
    class_map: ClassMap | None = None,
) -> PairedTruth:
    """Find the truth about every point: that of the same point of the same cloud, else the nearest.

    Args:
        xyz: (N, 3) scored points, metres, map frame.
        truth: Read once, part by part; memory does not grow with it.
        classes: Class table of the result; those of the truth are matched by name, or taken to be
            these. Without any, the first table that the truth names is taken.
        reach: Metres within which a true point is sought, where the clouds are not the same.
        told: Called after every part with how many have been read.
        class_map: What the classes of the truth stand for; ``classes`` is that of the map then.

    Returns:
        The truth about the points; of points equally near, the first is taken.

    Raises:
        InputError: The truth is damaged, has no labels, classes beyond the table, or no class of
            the table.
    """
    nearest, matching = NearestPoints(xyz, reach), _ClassMatching(classes, class_map)
    semantic, instance = np.full(len(xyz), UNKNOWN, np.uint8), np.zeros(len(xyz), np.int32)
    room, covered = np.full(len(xyz), NO_ROOM, np.int32), np.zeros(len(xyz), bool)
    truth_points = num_near = 0
    by_point = False

    for number, part in enumerate(truth.parts(), start=1):
        # to which points it comes nearest, and with which of its own
        by_point = len(truth.paths) == 1 and _are_same(part.xyz, xyz)
        ids, rows, near = _same_points(xyz) if by_point else nearest.offer(part.xyz)

        # what it says about them
        semantic[ids] = matching.look_up(part)[part.semantic[rows]]
        instance[ids], room[ids] = part.instance[rows], part.room[rows]
        covered[ids] = True

        truth_points, num_near = truth_points + len(part.xyz), num_near + near
        told(number)

    matching.check(truth)
    return PairedTruth(
        semantic, instance, room, covered, by_point, reach, truth_points, truth_points - num_near,
        matching.classes, matching.is_named, matching.highest_class, matching.others,
        tuple(matching.labels),
    )  # fmt: skip


class _ClassMatching:
    """Matches the classes of the truth with a table, by name; without one, takes its first.

    Args:
        classes: The table; may be empty.
        class_map: What stands for its classes; None for their own names.
    """

    def __init__(self, classes: tuple[str, ...], class_map: ClassMap | None) -> None:
        self.classes = classes
        self.labels: dict[str, None] = {}
        self._class_map = class_map
        self.is_named = True
        self.highest_class = -1
        self.others: dict[str, int] = {}
        self._is_matched = False

    def look_up(self, part: TruthPart) -> NDArray[np.uint8]:
        """Return the (256,) table of a part's classes; count its points of classes that lack.

        Raises:
            InputError: The part has numbers beyond the table, or any for a class map, instead of
                names.
        """
        self.labels |= dict.fromkeys(part.classes)
        self.is_named &= bool(part.classes)
        self.classes = self.classes or part.classes
        counts = np.bincount(part.semantic, minlength=256)

        # no names anywhere so far: equal numbers are equal classes
        if not self.classes:
            highest = int(np.flatnonzero(counts[:UNKNOWN]).max(initial=-1))
            self.highest_class = max(self.highest_class, highest)
            return np.arange(256, dtype=np.uint8)

        if not part.classes and self._class_map is None:
            check_classes(part.semantic, self.classes, part.source)

        # by name; what the table lacks is unknown
        if self._class_map is not None:
            table = self._class_map.look_up(part.classes, part.source)
        else:
            table = remap_table(part.classes or self.classes, self.classes)
        self._is_matched |= bool((table != UNKNOWN).any())
        for index, name in enumerate(part.classes):
            if table[index] == UNKNOWN:
                self.others[name] = self.others.get(name, 0) + int(counts[index])
        return table

    def check(self, truth: Truth) -> None:
        """Refuse truth that has no class of the table, or numbers beyond it."""
        if self.classes and self.highest_class >= len(self.classes):
            found, expected = f"class {self.highest_class}", f"0 to {len(self.classes) - 1}"
            raise InputError(truth.source, found, expected, "give all parts their class table")
        if self.classes and not self._is_matched:
            found, expected = f"classes {_few(self.others)}", f"some of {_few(self.classes)}"
            raise InputError(truth.source, found, expected, "rename the classes of one of them")


def _few(names: tuple[str, ...] | dict[str, int]) -> str:
    """List up to five names."""
    return ", ".join(list(names)[:5]) + (", …" if len(names) > 5 else "")


def _are_same(first: NDArray[np.floating], second: NDArray[np.floating]) -> bool:
    """Tell whether two clouds hold the same points in the same order."""
    return len(first) == len(second) and bool((np.abs(first - second) <= _SAME).all())


def _same_points(
    xyz: NDArray[np.floating],
) -> tuple[NDArray[np.int32], NDArray[np.int64], int]:
    """Pair every point with the one of its own number, as ``NearestPoints.offer`` would say it."""
    return np.arange(len(xyz), dtype=np.int32), np.arange(len(xyz)), len(xyz)
