"""Synthetic areas on disk: room folders in the S3DIS layout, continued when cut short."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mcpseg_cli.choices import SynthClasses
from mcpseg_cli.classes import HOME_CLASSES
from mcpseg_cli.errors import OutputError
from mcpseg_cli.formats.s3dis import write_room
from mcpseg_cli.formats.s3dis_classes import CLASSES
from mcpseg_cli.formats.s3dis_files import ANNOTATIONS
from mcpseg_cli.resumable import check_same, partial_folder, write_whole
from mcpseg_cli.synth.area import CLASSES_OF, make_room, map_rooms, plan_building
from mcpseg_cli.synth.models.library import Models
from mcpseg_cli.synth.plan import Room
from mcpseg_cli.synth.surfaces.styles import Style

_VERSIONS = {False: 1, True: 2}
"""Of the generator, for styles without and with fitted cabinets; raise one when the same seed comes
to give another building."""
RECORD = "synth.json"
_NAMES = {
    "version": "version of the generator",
    "number": "number of the area",
    "models": "hash of the models",
}

RoomName = Annotated[str, Field(pattern=r"^[A-Za-z]+_\d+$")]
"""``office_3`` and the like: no path that leads out of the area."""
_ClassCounts = dict[Annotated[str, Field(pattern=f"^({'|'.join(HOME_CLASSES)})$")], int]


class SynthRequest(BaseModel):
    """What to build.

    Attributes:
        number: Number of the area from 1; areas of one seed differ by it.
        seed: Decides everything else.
        num_rooms: Rooms, corridors among them.
        spacing: There is one point in each square of this edge, metres.
        style: Number of the style.
        models: Hash of the table of models in use; None for none.
        classes: What names the objects.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    number: int
    seed: int
    num_rooms: int
    spacing: float
    style: int
    models: str | None = None
    classes: SynthClasses = Field("s3dis", exclude_if=lambda classes: classes == "s3dis")


class RoomCounts(BaseModel):
    """What is in a written room.

    Attributes:
        name: Name of the room.
        points: Points by class.
        objects: Objects by class.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: RoomName
    points: _ClassCounts
    objects: _ClassCounts


class _Record(BaseModel):
    """``synth.json``: what was asked for, the rooms that are planned and those that are written.

    Attributes:
        version: Of the generator.
        request: What was asked for.
        style_name: What its style is called.
        planned: All rooms.
        rooms: Those that are written.
    """

    model_config = ConfigDict(extra="forbid")

    version: int
    request: SynthRequest
    style_name: str
    planned: list[RoomName]
    rooms: list[RoomCounts] = []

    def own(self, folder: Path) -> list[Path]:
        """Return the folders of the area's rooms, and those of half-written ones."""
        rooms = [folder / name for name in self.planned]
        return rooms + [partial_folder(room) for room in rooms]


def write_area(
    folder: Path,
    request: SynthRequest,
    jobs: int,
    *,
    models: Models | None = None,
    overwrite: bool = False,
) -> tuple[int, Iterator[RoomCounts]]:
    """Build an area and write it room by room; rooms that an interrupted call wrote are kept.

    Args:
        folder: ``OUT/Area_1`` and the like, made if not there; gets a folder for each room,
            ``synth.json`` and, for classes that are not S3DIS's, ``classes.txt``. The caller holds
            it against other processes (``resumable.exclusive``).
        request: What to build.
        jobs: Processes that build rooms at once; the result does not depend on it.
        models: Meshes that furnish it; ``request.models`` is their ``digest``.
        overwrite: Delete an area that was made before; other files in the folder stay.

    Returns:
        How many rooms there will be, and an iterator that writes them; each appears under its name
        when complete.

    Raises:
        InputError: No floor plan with so many rooms was found.
        StateError: The folder holds another area.
        OutputError: It holds rooms that were not made here.
        OSError: The disk is full or the folder not writable; finished rooms are kept.
    """
    number, seed = request.number, request.seed
    style, rooms, seeds = plan_building(number, seed, request.num_rooms, request.style, models)
    planned = [room.name for room in rooms]
    version = _VERSIONS[style.cabinets > 0]
    record = _Record(version=version, request=request, style_name=style.name, planned=planned)

    # what an earlier call has left is continued, replaced or refused
    earlier = _read_record(folder)
    _check(folder, earlier, None if overwrite else record)
    if overwrite and earlier is not None:
        for path in earlier.own(folder):
            shutil.rmtree(path, ignore_errors=True)
    elif earlier is not None:
        record = earlier

    _write_record(folder, record)
    if request.classes == "s3dis":  # of one that was replaced
        (folder / CLASSES).unlink(missing_ok=True)
    else:
        write_whole(folder / CLASSES, "\n".join(CLASSES_OF[request.classes]) + "\n")
    return len(rooms), _write(folder, record, style, rooms, seeds, jobs)


def _write(
    folder: Path,
    record: _Record,
    style: Style,
    rooms: list[Room],
    seeds: list[list[int]],
    jobs: int,
) -> Iterator[RoomCounts]:
    """Write the rooms that are missing and count all."""
    # rooms of an earlier call, unless someone took their files away
    is_there = {
        room.name for room in record.rooms if any((folder / room.name / ANNOTATIONS).glob("*.txt"))
    }
    record.rooms = [room for room in record.rooms if room.name in is_there]
    yield from record.rooms

    # the others
    todo = [
        (folder, room, style, record.request.spacing, seed, record.request.classes)
        for room, seed in zip(rooms, seeds, strict=True)
        if room.name not in is_there
    ]
    for counts in map_rooms(write_one, todo, jobs):
        record.rooms.append(counts)
        _write_record(folder, record)
        yield counts


def write_one(
    folder: Path,
    room: Room,
    style: Style,
    spacing: float,
    seed: list[int],
    classes: SynthClasses = "s3dis",
) -> RoomCounts:
    """Build one room and write it, again where it is there but not recorded."""
    cloud = make_room(room, style, spacing, seed, classes)
    shutil.rmtree(folder / room.name, ignore_errors=True)
    write_room(folder, room.name, zip(cloud.classes, cloud.xyz, cloud.rgb, strict=True))

    points: dict[str, int] = {}
    objects: dict[str, int] = {}
    for name, xyz in zip(cloud.classes, cloud.xyz, strict=True):
        points[name] = points.get(name, 0) + len(xyz)
        objects[name] = objects.get(name, 0) + 1
    return RoomCounts(name=room.name, points=points, objects=objects)


def _check(folder: Path, earlier: _Record | None, record: _Record | None) -> None:
    """Refuse a folder with rooms that were not made here, or another area unless it is replaced."""
    if earlier is None:
        present = sorted(path.name for path in folder.iterdir() if path.name[0] != ".")
        if present:
            found = f"{', '.join(present)[:120]} but no {RECORD}"
            raise OutputError(f"{folder}: has {found}; expected a new folder; name another")
        return

    if record is not None:
        both = (earlier, record)
        kept, asked = (each.model_dump(include={"version", "request"}) for each in both)
        remedy = "name another folder or give --overwrite"
        check_same(folder / RECORD, kept, asked, remedy=remedy, names=_NAMES)


def _write_record(folder: Path, record: _Record) -> None:
    """Write synth.json."""
    write_whole(folder / RECORD, record.model_dump_json(indent=1) + "\n")


def _read_record(folder: Path) -> _Record | None:
    """Read synth.json; None where there is none."""
    path = folder / RECORD
    if not path.is_file():
        return None
    try:
        return _Record.model_validate_json(path.read_bytes())
    except ValidationError as error:
        found, remedy = "not what mcpseg synth wrote", "remove the area, or name another folder"
        raise OutputError(f"{path}: {found}; expected its record; {remedy}") from error
