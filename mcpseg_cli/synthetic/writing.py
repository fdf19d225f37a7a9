"""Synthetic areas on disk: room folders in the S3DIS layout, continued when cut short."""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from pathlib import Path

from mcpseg_cli.errors import OutputError
from mcpseg_cli.formats.s3dis import write_room
from mcpseg_cli.formats.whole import write_whole
from mcpseg_cli.synthetic.area import make_room, plan_building
from mcpseg_cli.synthetic.plan import Room
from mcpseg_cli.synthetic.styles import Style

_VERSION = 1  # of the generator; raise it when the same seed comes to give another building
RECORD = "synth.json"


@dataclass(frozen=True)
class SynthRequest:
    """What to build.

    Attributes:
        number: Number of the area from 1, which decides its style.
        seed: Decides everything else.
        num_rooms: Rooms, corridors among them.
        spacing: Mean distance of points, metres.
    """

    number: int
    seed: int
    num_rooms: int
    spacing: float


@dataclass(frozen=True)
class RoomCounts:
    """What is in a written room.

    Attributes:
        name: ``office_3`` and the like.
        points: Points by class.
        objects: Objects by class.
    """

    name: str
    points: dict[str, int]
    objects: dict[str, int]


def write_area(
    folder: Path, request: SynthRequest, jobs: int, *, overwrite: bool = False
) -> tuple[int, Iterator[RoomCounts]]:
    """Build an area and write it room by room; rooms that an earlier, interrupted call wrote are kept.

    Args:
        folder: ``OUT/Area_1`` and the like, made if not there; gets a folder for each room and ``synth.json``.
        request: What to build.
        jobs: Processes that build rooms at once; the result does not depend on it.
        overwrite: Delete an area that was made before.

    Returns:
        How many rooms there will be, and an iterator that writes them; each appears under its name when complete.

    Raises:
        OutputError: The folder holds another area, or files that were not made here.
        OSError: The disk is full or the folder not writable; finished rooms are kept.
    """
    style, rooms, seeds = plan_building(request.number, request.seed, request.num_rooms)
    identity = {"version": _VERSION, **asdict(request)}
    _prepare(folder, identity, overwrite=overwrite)
    return len(rooms), _write(folder, identity, style, rooms, seeds, request.spacing, jobs)


def _write(
    folder: Path,
    identity: dict[str, object],
    style: Style,
    rooms: list[Room],
    seeds: list[list[int]],
    spacing: float,
    jobs: int,
) -> Iterator[RoomCounts]:
    """Write the rooms that are missing and count all."""
    known = _read_record(folder).get("rooms", {})
    done: dict[str, dict[str, dict[str, int]]] = {}
    todo = [(folder, room, style, spacing, seed) for room, seed in zip(rooms, seeds, strict=True)]
    todo = [job for job in todo if job[1].name not in known or not (folder / job[1].name).is_dir()]
    for room in rooms:
        if all(room.name != job[1].name for job in todo):
            done[room.name] = known[room.name]
            yield RoomCounts(room.name, **known[room.name])
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_end_with_parent) as pool:
        results = pool.map(_write_one, todo) if jobs > 1 else map(_write_one, todo)
        try:
            for counts in results:
                done[counts.name] = {"points": counts.points, "objects": counts.objects}
                record = {**identity, "style": style.name, "rooms": done}
                write_whole(folder / RECORD, json.dumps(record, indent=1) + "\n")
                yield counts
        except BrokenProcessPool as error:
            raise OutputError(
                f"{folder}: a worker process was killed, perhaps for its memory; expected it to finish its room; "
                "run the same command again with fewer --jobs, finished rooms are kept"
            ) from error


def _write_one(job: tuple[Path, Room, Style, float, list[int]]) -> RoomCounts:
    """Build one room and write it."""
    folder, room, style, spacing, seed = job
    cloud = make_room(room, style, spacing, seed)
    shutil.rmtree(folder / room.name, ignore_errors=True)  # written, but not recorded: written again
    write_room(folder, room.name, zip(cloud.classes, cloud.xyz, cloud.rgb, strict=True))
    points: dict[str, int] = {}
    objects: dict[str, int] = {}
    for name, xyz in zip(cloud.classes, cloud.xyz, strict=True):
        points[name] = points.get(name, 0) + len(xyz)
        objects[name] = objects.get(name, 0) + 1
    return RoomCounts(room.name, points, objects)


def _end_with_parent() -> None:
    """Let a worker process end when the command is killed, instead of writing on."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def _prepare(folder: Path, identity: dict[str, object], *, overwrite: bool) -> None:
    """Make the folder ready: empty, or the beginning of the same area."""
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder}: a file; expected a folder; name another")
    record = _read_record(folder)
    if overwrite and record:
        for name in record.get("rooms", {}):
            shutil.rmtree(folder / name, ignore_errors=True)
        (folder / RECORD).unlink()
        record = {}
    if record:
        changed = [key for key, value in identity.items() if record.get(key) != value]
        if changed:
            raise OutputError(
                f"{folder}: holds an area made with another {', '.join(changed)}; expected the same; "
                "name another folder or give --overwrite"
            )
        return
    if folder.exists() and any(path.name[0] != "." for path in folder.iterdir()):
        raise OutputError(f"{folder}: not empty and not made by mcpseg synth; expected a new folder; name another")
    folder.mkdir(parents=True, exist_ok=True)
    write_whole(folder / RECORD, json.dumps({**identity, "rooms": {}}, indent=1) + "\n")


def _read_record(folder: Path) -> dict[str, dict[str, dict[str, dict[str, int]]]]:
    """Read synth.json; empty where there is none or it makes no sense."""
    try:
        record = json.loads((folder / RECORD).read_text())
    except (FileNotFoundError, ValueError):
        return {}
    return record if isinstance(record, dict) else {}
