"""Areas: a planned building, furnished and scanned room by room."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.building import Building
from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.natural_order import natural_key
from mcpseg_cli.synthetic.catalogue import style_of
from mcpseg_cli.synthetic.furnish import furnish_room
from mcpseg_cli.synthetic.layout import plan_area
from mcpseg_cli.synthetic.plan import Room
from mcpseg_cli.synthetic.scanner import scan_room
from mcpseg_cli.synthetic.shell import build_shell
from mcpseg_cli.synthetic.styles import Style

MIN_POINTS = 10
"""Objects with fewer points are left out."""


@dataclass(frozen=True)
class RoomCloud:
    """A scanned room, object by object.

    Attributes:
        name: ``office_3`` and the like.
        object_names: ``chair_2`` and the like, in natural order.
        classes: Class of each object.
        xyz: (N, 3) float32 of each object, metres, map frame.
        rgb: (N, 3) uint8 of each object.
    """

    name: str
    object_names: tuple[str, ...]
    classes: tuple[str, ...]
    xyz: tuple[NDArray[np.float32], ...]
    rgb: tuple[NDArray[np.uint8], ...]


def plan_building(number: int | Style, seed: int, num_rooms: int) -> tuple[Style, list[Room], list[list[int]]]:
    """Plan an area: its style, its rooms in natural order, and what the random numbers of each start from.

    Each room can then be made by itself with ``make_room``, in any process. See ``make_area`` for the arguments.
    """
    start = number if isinstance(number, int) else 0
    rng = np.random.default_rng([seed, start])
    style = style_of(number, rng) if isinstance(number, int) else number
    rooms = sorted(plan_area(style, num_rooms, rng), key=lambda room: natural_key(room.name))
    return style, rooms, [[seed, start, index + 1] for index in range(len(rooms))]


def make_area(
    number: int | Style, seed: int, *, num_rooms: int = 16, spacing: float = 0.03, jobs: int = 1
) -> Iterator[RoomCloud]:
    """Make one floor of an office building as a labelled point cloud, room by room.

    Args:
        number: Area number from 1, which decides the style, or a style as it is.
        seed: Same seed, same points, whatever ``jobs`` is.
        num_rooms: Rooms, corridors among them; at least 2.
        spacing: Mean distance of points, metres; 0.01 at the least.
        jobs: Processes to share the rooms among.

    Yields:
        The rooms in natural order of their names.
    """
    style, rooms, seeds = plan_building(number, seed, num_rooms)
    if jobs == 1:
        yield from map(make_room, rooms, repeat(style), repeat(spacing), seeds)
        return
    with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(make_room, rooms, repeat(style), repeat(spacing), seeds)


def make_room(room: Room, style: Style, spacing: float, seed: list[int]) -> RoomCloud:
    """Build, furnish and scan one room.

    Args:
        room: The room, from ``plan_area``.
        style: The building's.
        spacing: Mean distance of points, metres.
        seed: What the room's random numbers start from.

    Returns:
        The room's points.
    """
    rng = np.random.default_rng(seed)
    items = build_shell(room, style, rng) + furnish_room(room, style, rng)
    scan = scan_room(items, room, style, spacing, rng)
    order = np.argsort(scan.item, kind="stable")
    ends = np.cumsum(np.bincount(scan.item, minlength=len(items)))
    counts: dict[str, int] = {}
    found = []
    for number, item in enumerate(items):
        rows = order[ends[number - 1] if number else 0 : ends[number]]
        if len(rows) >= MIN_POINTS:
            counts[item.name] = counts.get(item.name, 0) + 1
            found.append((f"{item.name}_{counts[item.name]}", item.name, scan.xyz[rows], scan.rgb[rows]))
    found.sort(key=lambda entry: natural_key(entry[0]))
    names, classes, xyz, rgb = zip(*found, strict=True)
    return RoomCloud(room.name, names, classes, xyz, rgb)


def make_building(
    number: int | Style, seed: int, *, num_rooms: int = 16, spacing: float = 0.03, jobs: int = 1
) -> Building:
    """Make an area as ``make_area`` does and return it as one building, all in memory."""
    rooms = list(make_area(number, seed, num_rooms=num_rooms, spacing=spacing, jobs=jobs))
    sizes = [[len(points) for points in room.xyz] for room in rooms]
    flat = [size for room in sizes for size in room]
    labels = np.array([S3DIS_CLASSES.index(name) for room in rooms for name in room.classes], np.uint8)
    return Building(
        np.concatenate([points for room in rooms for points in room.xyz]),
        np.concatenate([colours for room in rooms for colours in room.rgb]),
        np.repeat(labels, flat),
        np.repeat(np.arange(1, len(flat) + 1, dtype=np.int32), flat),
        rooms=tuple(room.name for room in rooms),
        room_starts=np.concatenate([[0], np.cumsum([sum(room) for room in sizes])]).astype(np.int64),
        object_names=tuple(f"{room.name}/{name}" for room in rooms for name in room.object_names),
    )
