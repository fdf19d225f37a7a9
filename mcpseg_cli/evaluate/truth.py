"""Ground truth, part by part: a folder of labelled scans, one cloud, or a building with rooms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError

from mcpseg_cli.building import Building
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import CLOUD_SUFFIXES, read_measured
from mcpseg_cli.formats.buildings import HDF5_SUFFIXES, read_building
from mcpseg_cli.formats.intake import Intake
from mcpseg_cli.formats.labels import USUAL, LabelFields, point_labels
from mcpseg_cli.formats.recording import list_clouds
from mcpseg_cli.formats.s3dis import Progress

NO_ROOM = -1
_AS_IT_IS = Intake()
_MOST_OBJECTS = 1 << 24  # their rooms are looked up in a table
_SLICE = 1 << 20  # points of a building that make a part


class _NamedObject(BaseModel):
    """An object of a recording's building."""

    id: Annotated[int, Field(le=_MOST_OBJECTS)]
    name: str


class _Recording(BaseModel):
    """What raytrace.json says of the building; all else in it is passed over."""

    objects: list[_NamedObject] = []


@dataclass(frozen=True)
class TruthPart:
    """Some true points.

    Attributes:
        source: The file they come from.
        xyz: (N, 3) float32 or float64, metres, map frame.
        semantic: (N,) uint8 index into ``classes``, 255 unknown.
        instance: (N,) int32 object id, 0 none; of one object in all parts.
        room: (N,) int32 number of the room, -1 for none.
        classes: Class names; empty when the file does not say.
    """

    source: Path
    xyz: NDArray[np.floating]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]
    room: NDArray[np.int32]
    classes: tuple[str, ...]


@dataclass(frozen=True)
class Truth:
    """Ground truth that is read a part at a time; see ``open_truth``.

    Attributes:
        source: What the user named.
        rooms: Names of rooms; empty when they are not known.
        notices: Lines the user should know.
        paths: Clouds to read; empty for a building.
        building: The building, if it is one.
        room_of_object: (highest id + 1,) int32 room of each object in the clouds, -1 for none.
        intake: How the recording became the map: truth is in the recording's coordinates.
        fields: Which attributes of the clouds are their labels.
    """

    source: Path
    rooms: tuple[str, ...] = ()
    notices: tuple[str, ...] = ()
    paths: tuple[Path, ...] = ()
    building: Building | None = None
    room_of_object: NDArray[np.int32] | None = None
    intake: Intake = _AS_IT_IS
    fields: LabelFields = USUAL

    def __len__(self) -> int:
        """Return how many parts there are."""
        return len(self.paths) if self.building is None else -(-len(self.building) // _SLICE)

    def parts(self) -> Iterator[TruthPart]:
        """Iterate over the parts, one in memory at a time (a building is there as a whole).

        Raises:
            InputError: A cloud is damaged, has no labels, or classes beyond its table.
        """
        if self.building is not None:
            for part in _slices(self.source, self.building):
                yield replace(part, xyz=self._placed(part.xyz))
        for path in self.paths:
            cloud = read_measured(path).measured()
            semantic, instance = point_labels(cloud, path, fields=self.fields)
            room = _look_up(self.room_of_object, instance)
            yield TruthPart(path, self._placed(cloud.xyz), semantic, instance, room, cloud.classes)

    def _placed(self, xyz: NDArray[np.floating]) -> NDArray[np.floating]:
        """Move true points to where the map has them."""
        return xyz if self.intake.is_plain else self.intake.place_points(xyz)


def open_truth(
    path: Path,
    progress: Progress | None = None,
    intake: Intake = _AS_IT_IS,
    fields: LabelFields = USUAL,
) -> Truth:
    """Find out what ground truth is and which rooms it names; clouds are not read yet.

    Args:
        path: A folder of labelled clouds (with ``raytrace.json`` beside it, the rooms are known),
            one labelled cloud, an HDF5 building, or an area or room in the S3DIS layout.
        progress: Told how far reading S3DIS text has come.
        intake: How the recording became the map it is compared with.
        fields: Which attributes are the labels.

    Raises:
        InputError: Nothing there, or none of these.
        OSError: It cannot be read.
    """
    # what cannot be ground truth
    if not path.exists():
        raise InputError(path, "no such file or folder", "ground truth", "check the path")
    if path.is_dir() and not any(path.iterdir()):
        expected = "labelled clouds or an S3DIS area"
        raise InputError(path, "an empty folder", expected, "check the path")
    if (path / "raytrace.json").is_file():
        raise InputError(path, "a recording", "its ground truth", f"name {path / 'gt'}")

    # clouds, whose objects a record may give rooms; a building; one cloud
    if path.is_dir() and _has_clouds(path):
        rooms, room_of_object = _rooms_of_recording(path.absolute().parent / "raytrace.json")
        clouds = tuple(list_clouds(path))
        return Truth(path, rooms, (), clouds, None, room_of_object, intake, fields)
    if path.is_dir() or path.suffix.lower() in HDF5_SUFFIXES:
        building, notices = read_building(path, progress=progress)
        return Truth(path, building.rooms, notices, building=building, intake=intake)
    return Truth(path, paths=(path,), intake=intake, fields=fields)


def _has_clouds(folder: Path) -> bool:
    """Tell whether clouds lie in a folder itself."""
    return any(
        path.suffix.lower() in CLOUD_SUFFIXES and path.name[0] != "." for path in folder.iterdir()
    )


def _rooms_of_recording(record: Path) -> tuple[tuple[str, ...], NDArray[np.int32] | None]:
    """Read from raytrace.json, if there is one, which room each object is in."""
    if not record.is_file():
        return (), None
    try:
        objects = _Recording.model_validate_json(record.read_bytes()).objects
    except ValidationError as error:
        expected = "a record of mcpseg raytrace"
        raise InputError(record, "no list of objects", expected, "run it again") from error

    # an object's name begins with its room's: office_1/chair_2
    room_names = {
        item.id: item.name.rpartition("/")[0]
        for item in objects
        if item.id > 0 and "/" in item.name
    }
    rooms = tuple(dict.fromkeys(room_names.values()))
    if not rooms:
        return (), None

    room_of_object = np.full(max(room_names) + 1, NO_ROOM, np.int32)
    room_of_object[list(room_names)] = [rooms.index(name) for name in room_names.values()]
    return rooms, room_of_object


def _look_up(
    room_of_object: NDArray[np.int32] | None, instance: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Return the (N,) room of each point's object."""
    if room_of_object is None:
        return np.full(len(instance), NO_ROOM, np.int32)
    known = instance < len(room_of_object)
    return np.where(known, room_of_object[np.where(known, instance, 0)], np.int32(NO_ROOM))


def _slices(source: Path, building: Building) -> Iterator[TruthPart]:
    """Cut a building into parts."""
    room = building.room_of() if building.rooms else np.full(len(building), NO_ROOM, np.int32)
    for start in range(0, len(building), _SLICE):
        part = slice(start, start + _SLICE)
        labels = building.semantic[part], building.instance[part], room[part]
        yield TruthPart(source, building.xyz[part], *labels, building.classes)
