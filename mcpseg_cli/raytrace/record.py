"""``raytrace.json``: what virtual scans were made from, and what was seen when all were made."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from mcpseg_cli.config import RaytraceSettings
from mcpseg_cli.errors import OutputError

RECORD = "raytrace.json"
_IDENTITY = {"format", "building", "settings", "suffix", "waypoints"}


class _Record(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class RouteRecord(_Record):
    """What is known of a route.

    Attributes:
        waypoints: How many were driven past.
        waypoints_skipped: (x, y) of those that are not on free floor, metres, map frame.
        length_m: Metres driven.
        free_area_m2: Floor that the robot can stand on, square metres.
        unreachable_rooms: Rooms the robot does not get into.
        hardly_reached_rooms: Rooms of whose free floor it gets to less than half, with the share.
    """

    waypoints: int
    waypoints_skipped: list[tuple[float, float]] = []
    length_m: float
    free_area_m2: float
    unreachable_rooms: list[str] = []
    hardly_reached_rooms: dict[str, float] = {}


class ObjectRecord(_Record):
    """How many voxels of an object of the building were seen."""

    id: int
    name: str
    voxels_seen: int


class _Begun(_Record):
    """What is known when a run begins.

    Attributes:
        mcpseg: Version that made it.
        source: What the building is called.
        format: Of the folder; another number is another run.
        building: Hash of all points and labels.
        settings: Scanner and route.
        suffix: Ending of the cloud files.
        waypoints: Which waypoints, see ``Waypoints.identity``.
        route: Where the robot drives.
        blind_positions: Places on the route that see nothing; they have no scan.
        poses: Hash of ``poses.csv``.
    """

    mcpseg: str
    source: str
    format: int
    building: str
    settings: RaytraceSettings
    suffix: str
    waypoints: str
    route: RouteRecord
    blind_positions: int
    poses: str

    def identity(self) -> dict[str, object]:
        """Return what tells this run from others: only the same is continued."""
        return self.model_dump(include=_IDENTITY)


class BegunRecord(_Begun):
    """The record of a run that has scans to make."""

    complete: Literal[False] = False


class FinishedRecord(_Begun):
    """The record of a run that has made all its scans.

    Attributes:
        classes: Class table of the building.
        scans: How many.
        points: In all scans.
        voxels: Of the building.
        voxels_seen: Those that some scan has a point of.
        voxels_seen_by_class: The same by class.
        objects_seen: Objects that some scan has a point of.
        objects: The objects of the building, if it names them.
    """

    complete: Literal[True] = True
    classes: list[str]
    scans: int
    points: int
    voxels: int
    voxels_seen: int
    voxels_seen_by_class: dict[str, int]
    objects_seen: int
    objects: list[ObjectRecord]


RunRecord = BegunRecord | FinishedRecord
BEGUN = set(_Begun.model_fields)
"""What a finished record takes over from the one it finishes."""
REPORTED = {"source", "scans", "points", "voxels", "voxels_seen", "objects_seen", "route"}
"""What a report takes over from a finished record."""
_ANY_RECORD = TypeAdapter[RunRecord](Annotated[RunRecord, Field(discriminator="complete")])


class RaytraceReport(BaseModel):
    """What there is to say about a finished run.

    Attributes:
        source: What the building is called.
        scans: How many.
        points: In all scans.
        voxels: Of the building.
        voxels_seen: Those that some scan has a point of.
        objects_seen: Objects that some scan has a point of.
        route: Where the robot drove.
        building_points: Points of the building.
        objects: Objects of the building.
        output: Folder of the scans.
        seconds: Time it took.
        peak_memory_mb: Most memory in use.
    """

    source: str
    scans: int
    points: int
    voxels: int
    voxels_seen: int
    objects_seen: int
    route: RouteRecord
    building_points: int
    objects: int
    output: str
    seconds: float
    peak_memory_mb: float


def record_text(record: RunRecord) -> str:
    """Return the text of ``raytrace.json``; bytes of names that are no UTF-8 survive in it."""
    return json.dumps(record.model_dump(mode="json"), indent=1) + "\n"


def read_record(folder: Path) -> RunRecord | None:
    """Read the record of a folder; None where there is none.

    Raises:
        OutputError: The file is no record.
        OSError: It cannot be read.
    """
    path = folder / RECORD
    if not path.is_file():
        return None
    try:
        return _ANY_RECORD.validate_python(json.loads(path.read_text(encoding="utf-8")))
    except (ValueError, RecursionError) as error:
        raise OutputError(
            f"{path}: not the record of a run; expected one; choose another -o, or move it away"
        ) from error
