"""Areas: a planned building, furnished and scanned room by room."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import repeat, starmap
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.building import Building
from mcpseg_cli.choices import SynthClasses
from mcpseg_cli.classes import HOME_CLASSES, S3DIS_CLASSES
from mcpseg_cli.errors import OutputError
from mcpseg_cli.formats.natural_order import natural_key
from mcpseg_cli.synth.building.layout import plan_area
from mcpseg_cli.synth.building.rugs import lay_rugs
from mcpseg_cli.synth.building.shell import build_shell
from mcpseg_cli.synth.models.library import Models
from mcpseg_cli.synth.plan import Room
from mcpseg_cli.synth.rooms.furnish import check_contents, furnish_room
from mcpseg_cli.synth.scanning.scanner import scan_room
from mcpseg_cli.synth.surfaces.catalogue import style_of
from mcpseg_cli.synth.surfaces.styles import Style

Result = TypeVar("Result")

CLASSES_OF: dict[SynthClasses, tuple[str, ...]] = {"s3dis": S3DIS_CLASSES, "home": HOME_CLASSES}
"""The class tables that objects can be named by."""
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


def plan_building(
    number: int,
    seed: int,
    num_rooms: int,
    style: int | Style | None = None,
    models: Models | None = None,
) -> tuple[Style, list[Room], list[list[int]]]:
    """Plan an area; each room can then be made by itself, in any process.

    See ``make_area`` for the arguments.

    Returns:
        The building's style, its rooms in natural order, and what the random numbers of each start
        from.

    Raises:
        InputError: No floor plan with so many rooms was found, or a table of styles or rooms is
            damaged.
    """
    check_contents(models)
    rng = np.random.default_rng([seed, number])
    drawn = style_of(style if isinstance(style, int) else number, rng)
    chosen = style if isinstance(style, Style) else drawn
    rooms = sorted(plan_area(chosen, num_rooms, rng), key=lambda room: natural_key(room.name))
    if models is not None:
        chosen = chosen.model_copy(update={"models": models})
    return chosen, rooms, [[seed, number, index + 1] for index in range(len(rooms))]


def make_area(
    number: int,
    seed: int,
    *,
    num_rooms: int = 16,
    spacing: float = 0.03,
    style: int | Style | None = None,
    models: Models | None = None,
    classes: SynthClasses = "s3dis",
    jobs: int = 1,
) -> Iterator[RoomCloud]:
    """Make one floor of an office building or of homes as a labelled point cloud, room by room.

    Args:
        number: Area number from 1; areas of one seed differ by it.
        seed: Same seed, same points, whatever ``jobs`` is.
        num_rooms: Rooms, corridors among them; at least 2.
        spacing: There is one point in each square of this edge, metres; 0.008 at the least.
        style: Style, or number of one; that of the area's number by default.
        models: Meshes that stand in for some of the things, from ``read_models``; None for none.
        classes: What names the objects, one of ``CLASSES_OF``; their points are the same.
        jobs: Processes to share the rooms among; more than one need a main module that can be
            imported.

    Yields:
        The rooms in natural order of their names.

    Raises:
        InputError: No floor plan with so many rooms was found.
        OutputError: A worker process was killed.
    """
    chosen, rooms, seeds = plan_building(number, seed, num_rooms, style, models)
    tasks = zip(rooms, repeat(chosen), repeat(spacing), seeds, repeat(classes), strict=False)
    yield from map_rooms(make_room, tasks, jobs)


def map_rooms(
    function: Callable[..., Result], tasks: Iterable[tuple[object, ...]], jobs: int
) -> Iterator[Result]:
    """Call a function for every task, in ``jobs`` processes.

    Args:
        function: One of the top level of a module.
        tasks: Its arguments.
        jobs: Processes; 1 for none but this one.

    Yields:
        The results in order.

    Raises:
        OutputError: A worker process was killed.
    """
    if jobs == 1:
        yield from starmap(function, tasks)
        return

    # all at once, so that no process waits for another
    context = multiprocessing.get_context("spawn")  # forking a process with threads may hang
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_end_with_parent)
    try:
        with _workers_ignore_interrupts():
            futures = [pool.submit(function, *task) for task in tasks]
        for future in futures:
            yield future.result()
    except BrokenProcessPool as error:
        raise OutputError(
            "a worker process was killed, perhaps for its memory; expected it to finish its room; "
            "run the same command again with fewer --jobs, finished rooms are kept"
        ) from error
    finally:
        pool.shutdown(cancel_futures=True)


@contextmanager
def _workers_ignore_interrupts() -> Iterator[None]:
    """Let processes that are started here leave Ctrl-C to this one."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _end_with_parent() -> None:
    """Let a worker process end when the command is killed, instead of writing on."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def make_room(
    room: Room, style: Style, spacing: float, seed: list[int], classes: SynthClasses = "s3dis"
) -> RoomCloud:
    """Build, furnish and scan one room.

    Args:
        room: The room, from ``plan_area``.
        style: The building's.
        spacing: Mean distance of points, metres.
        seed: What the room's random numbers start from.
        classes: What names its objects.

    Returns:
        The room's points.
    """
    rng = np.random.default_rng(seed)
    shell = build_shell(room, style, rng)
    wall = next(item.parts[0].material for item in shell if item.name == "wall")
    items = lay_rugs(shell + furnish_room(room, style, rng, wall))
    scan = scan_room(items, room, style, spacing, rng)

    # object by object; a rug is one where it has a class
    names = [item.home or item.name if classes == "home" else item.name for item in items]
    first = names.index("floor") if "floor" in names else 0
    objects = np.array([first if name == "floor" else own for own, name in enumerate(names)])
    of = objects[scan.item]
    order = np.argsort(of, kind="stable")
    ends = np.cumsum(np.bincount(of, minlength=len(items)))[:-1]

    # numbered within their class
    counts: dict[str, int] = {}
    found = []
    for class_name, rows in zip(names, np.split(order, ends), strict=True):
        if len(rows) >= MIN_POINTS:
            counts[class_name] = counts.get(class_name, 0) + 1
            name = f"{class_name}_{counts[class_name]}"
            found.append((name, class_name, scan.xyz[rows], scan.rgb[rows]))

    found.sort(key=lambda entry: natural_key(entry[0]))
    object_names, class_names, xyz, rgb = zip(*found, strict=True)
    return RoomCloud(room.name, object_names, class_names, xyz, rgb)


def make_building(
    number: int,
    seed: int,
    *,
    num_rooms: int = 16,
    spacing: float = 0.03,
    style: int | Style | None = None,
    models: Models | None = None,
    classes: SynthClasses = "s3dis",
    jobs: int = 1,
) -> Building:
    """Make an area as ``make_area`` does and return it as one building, all in memory."""
    rooms = list(
        make_area(
            number,
            seed,
            num_rooms=num_rooms,
            spacing=spacing,
            style=style,
            models=models,
            classes=classes,
            jobs=jobs,
        )
    )
    sizes = [[len(points) for points in room.xyz] for room in rooms]
    flat = [size for room in sizes for size in room]

    # labels of the objects, then of their points
    table = CLASSES_OF[classes]
    labels = [table.index(name) for room in rooms for name in room.classes]
    semantic = np.repeat(np.array(labels, np.uint8), flat)
    instance = np.repeat(np.arange(1, len(flat) + 1, dtype=np.int32), flat)
    starts = np.concatenate([[0], np.cumsum([sum(room) for room in sizes])])
    return Building(
        np.concatenate([points for room in rooms for points in room.xyz]),
        np.concatenate([colours for room in rooms for colours in room.rgb]),
        semantic,
        instance,
        table,
        rooms=tuple(room.name for room in rooms),
        room_starts=starts.astype(np.int64),
        object_names=tuple(f"{room.name}/{name}" for room in rooms for name in room.object_names),
    )
