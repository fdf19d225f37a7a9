"""Virtual scans of one building in a folder: written once, continued after an interruption."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli import __version__
from mcpseg_cli.building import Building
from mcpseg_cli.config import RaytraceSettings
from mcpseg_cli.errors import OutputError
from mcpseg_cli.formats import CLOUD_SUFFIXES, write_cloud
from mcpseg_cli.formats.poses import read_poses
from mcpseg_cli.raytrace.carrying import carry
from mcpseg_cli.raytrace.drive import Progress, Waypoints, plan_drive
from mcpseg_cli.raytrace.record import (
    BEGUN,
    RECORD,
    REPORTED,
    BegunRecord,
    FinishedRecord,
    ObjectRecord,
    RaytraceReport,
    RouteRecord,
    RunRecord,
    read_record,
    record_text,
)
from mcpseg_cli.raytrace.route_plot import plot_route
from mcpseg_cli.raytrace.scanner import VirtualScan, VirtualScanner, poses_table, scan_name
from mcpseg_cli.raytrace.sensors import SensorInBuilding
from mcpseg_cli.resumable import check_same, remove_leftovers, write_whole

_FORMAT = 1  # of the folder; another number is another run
_FEW_POINTS = 4.0  # a voxel; with fewer, a surface has voxels without any
_NAMES = {"format": "version of the folder", "building": "building", "suffix": "--format"}


@dataclass(frozen=True)
class RaytraceRequest:
    """What a run is to do; a folder is continued only by the same request.

    Attributes:
        source: What the building is called in the record.
        settings: Scanner and route.
        suffix: Ending of the cloud files.
        waypoints: Where the robot is to go.
    """

    source: str
    settings: RaytraceSettings
    suffix: str
    waypoints: Waypoints


@dataclass(frozen=True)
class WrittenScan:
    """One scan of a run: its name and its points."""

    name: str
    num_points: int


class RaytraceRun:
    """The scans of one building in one folder: ``plan`` first, then ``run``.

    The caller holds the folder against other processes (``resumable.exclusive``).

    Attributes:
        folder: Where the run is.
        request: What to do.
        record: ``raytrace.json``; None where there is none yet.
        poses: (S, 4, 4) float64 to scan from, as poses.csv has them; None until planned.
        scanner: The building and what scans it.

    Args:
        folder: Where ``scans/``, ``gt/``, ``poses.csv`` and ``raytrace.json`` go.
        building: At least one point.
        request: What to do.
        overwrite: Replace an earlier run; it is deleted when the new one is planned, not before.

    Raises:
        InputError: The building is too large for the voxel size.
        StateError: The folder holds the scans of another request.
        OutputError: It holds files that no run made.
    """

    def __init__(
        self, folder: Path, building: Building, request: RaytraceRequest, *, overwrite: bool = False
    ) -> None:
        self.folder = folder
        self.request = request
        self._identity = {
            "format": _FORMAT,
            "building": building_hash(building),
            "settings": request.settings.model_dump(),
            "suffix": request.suffix,
            "waypoints": request.waypoints.identity,
        }

        # what an earlier call has left, if it was the same request
        self.record = read_record(folder)
        earlier = None if self.record is None else self.record.identity()
        _check_folder(folder, earlier, None if overwrite else self._identity)
        self.poses: NDArray[np.float64] | None = None
        if self.record is not None and not overwrite:
            self.poses = _read_own_poses(folder, self.record.poses)

        self.scanner = VirtualScanner(building, request.settings)
        is_sphere = request.settings.sensor == "sphere"
        self._sensor = None if is_sphere else SensorInBuilding(self.scanner)
        self._seen = np.zeros(len(self.scanner.grid), bool)

    @property
    def num_scans(self) -> int:
        """Scans of the whole run; 0 until planned."""
        return 0 if self.poses is None else len(self.poses)

    @property
    def is_complete(self) -> bool:
        """True when an earlier call made every scan, and all are still there."""
        if not isinstance(self.record, FinishedRecord) or self.poses is None:
            return False
        return all(self._is_there(number) for number in range(self.num_scans))

    def plan(
        self,
        *,
        threads: int = 1,
        picture: Path | None = None,
        progress: Progress | None = None,
        notify: Callable[[str], None] = lambda line: None,
    ) -> None:
        """Plan where to scan from, unless an earlier call did.

        Args:
            threads: Threads to look around with.
            picture: PNG file of floor plan and route, which are planned again for it.
            progress: Called with how many of how many places have been looked from.
            notify: Called with each line that the user should know.

        Raises:
            InputError: No floor to stand on, or no waypoint on it.
            OutputError: Nothing is seen from anywhere; no matplotlib for the picture.
            OSError: The folder or the picture cannot be written.
        """
        share = len(self.scanner.building) / len(self.scanner.grid)
        if share < _FEW_POINTS and self.scanner.triangles is None:
            remedy = f"give a --voxel-size above {self.request.settings.voxel_size:g}"
            notify(f"only {share:.1f} points a voxel: rays may pass through walls; {remedy}")
        if self.poses is not None and picture is None:
            return

        # floor plan, waypoints, route
        drive = plan_drive(self.scanner, self.request.waypoints, threads=threads, progress=progress)
        for line in drive.notices():
            notify(line)

        # the picture first: without it nothing is begun
        if picture is not None:
            plot_route(picture, drive.plan, drive.route, self.scanner.building)
        if self.poses is None:
            self.start(carry(drive.route.poses, self.request.settings), drive.record())

    def start(self, poses: NDArray[np.float64], route: RouteRecord) -> None:
        """Record where to scan from, replacing an earlier run.

        Args:
            poses: (S, 4, 4) float64, sensor to map; those that see nothing are left out.
            route: What to record about the route.

        Raises:
            OutputError: Nothing is seen from anywhere.
            OSError: The folder cannot be written.
        """
        sees = np.array([self._sees_anything(pose) for pose in poses], bool)
        if not sees.any():
            raise OutputError(
                f"{self.folder}: nothing can be seen; expected another --range, --height or --v-min"
            )

        # an earlier run goes when there is something to replace it with
        _clear(self.folder, self.record)
        for name in ("scans", "gt"):
            (self.folder / name).mkdir(parents=True, exist_ok=True)

        # the record comes first: without it no file is taken for ours
        text = poses_table(poses[sees])
        self._write_record(
            BegunRecord.model_validate(
                {
                    "mcpseg": __version__,
                    "source": self.request.source,
                    **self._identity,
                    "route": route,
                    "blind_positions": int((~sees).sum()),
                    "poses": _hash(text.encode()),
                }
            )
        )
        write_whole(self.folder / "poses.csv", text)
        self.poses = read_poses(self.folder / "poses.csv").poses  # rounded, as it will be read

    def run(self, jobs: int) -> Iterator[WrittenScan]:
        """Make the scans that are missing, several at once.

        Args:
            jobs: Threads.

        Yields:
            Each scan once its files are complete, in order, also those that were there.

        Raises:
            OSError: The disk is full or the folder not writable; finished scans are kept.
        """
        # what a killed call was writing
        assert self.poses is not None, "plan first"
        for folder in (self.folder, self.folder / "scans", self.folder / "gt"):
            remove_leftovers(folder)

        # a few scans ahead, not the whole building
        num_points = 0
        numbers, ahead = range(self.num_scans), 8 * jobs
        with ThreadPoolExecutor(jobs) as pool:
            for start in range(0, len(numbers), ahead):
                for scan, voxels in pool.map(self._make, numbers[start : start + ahead]):
                    self._seen[voxels] = True
                    num_points += scan.num_points
                    yield scan
        self._finish(num_points)

    def report(self, seconds: float, peak_memory_mb: float) -> RaytraceReport:
        """Say what a finished run made, in how much time and memory."""
        building, record = self.scanner.building, self.record
        assert isinstance(record, FinishedRecord), "not all scans are made"
        objects = len(building.object_names) or int((np.unique(building.instance) > 0).sum())
        return RaytraceReport(
            **record.model_dump(include=REPORTED),
            building_points=len(building),
            objects=objects,
            output=str(self.folder),
            seconds=round(seconds, 2),
            peak_memory_mb=round(peak_memory_mb, 1),
        )

    def _files(self, number: int) -> list[Path]:
        """Return the files of a scan in the order of writing: a scan is never without its truth."""
        name = f"{scan_name(number)}{self.request.suffix}"
        return [self.folder / part / name for part in ("gt", "scans")]

    def _is_there(self, number: int) -> bool:
        """Tell whether a scan has been written; a power cut may leave files without content."""
        return all(path.is_file() and path.stat().st_size > 0 for path in self._files(number))

    def _make(self, number: int) -> tuple[WrittenScan, NDArray[np.int32]]:
        """Make one scan and write what is not there yet."""
        scan = self._scan(number)
        if not self._is_there(number):
            clouds = reversed(self.scanner.clouds(scan))
            for path, cloud in zip(self._files(number), clouds, strict=True):
                write_cloud(path, cloud)
        return WrittenScan(scan_name(number), len(scan.points)), scan.voxels

    def _scan(self, number: int) -> VirtualScan:
        """Make one scan from its pose."""
        assert self.poses is not None
        if self._sensor is None:
            return self.scanner.scan(number, self.poses[number, :3, 3])
        return self._sensor.scan(number, self.poses[number])

    def _sees_anything(self, pose: NDArray[np.float64]) -> bool:
        """Tell whether a scan from a pose would have points."""
        if self._sensor is None:
            return self.scanner.sees_anything(pose[:3, 3])
        return self._sensor.sees_anything(pose)

    def _finish(self, num_points: int) -> None:
        """Record the run as complete, with what was seen."""
        assert self.record is not None
        building, grid = self.scanner.building, self.scanner.grid

        # classes and objects of the voxels that were seen
        seen = grid.points[self._seen]
        per_class = np.bincount(building.semantic[seen], minlength=256).tolist()
        ids, counts = np.unique(building.instance[seen], return_counts=True)
        per_object = dict(zip(ids.tolist(), counts.tolist(), strict=True))

        self._write_record(
            FinishedRecord(
                **self.record.model_dump(include=BEGUN),
                classes=list(building.classes),
                scans=self.num_scans,
                points=num_points,
                voxels=len(grid),
                voxels_seen=len(seen),
                voxels_seen_by_class=dict(zip(building.classes, per_class, strict=False)),
                objects_seen=int((ids > 0).sum()),
                objects=[
                    ObjectRecord(id=number, name=name, voxels_seen=per_object.get(number, 0))
                    for number, name in enumerate(building.object_names, start=1)
                ],
            )
        )

    def _write_record(self, record: RunRecord) -> None:
        """Write raytrace.json."""
        self.record = record
        write_whole(self.folder / RECORD, record_text(record))


def building_hash(building: Building) -> str:
    """Return a hash of every point and label of a building."""
    columns = (building.xyz, building.rgb, building.semantic, building.instance)
    return _hash(
        *(np.ascontiguousarray(column).data for column in columns),
        ",".join(building.classes).encode(),
    )


def _hash(*parts: bytes | memoryview) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for part in parts:
        digest.update(part)
    return digest.hexdigest()


def _read_own_poses(folder: Path, poses: str) -> NDArray[np.float64] | None:
    """Read the poses from poses.csv if it has this hash; None asks for it to be planned anew."""
    path = folder / "poses.csv"
    if not path.is_file() or _hash(path.read_bytes()) != poses:
        return None
    return read_poses(path).poses


def _check_folder(
    folder: Path, record: dict[str, object] | None, identity: dict[str, object] | None
) -> None:
    """Refuse a folder with clouds that no run made, or another run unless it is replaced."""
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder}: a file; expected a folder; choose another -o")
    for path in (folder / "scans", folder / "gt"):
        if path.is_symlink():
            raise OutputError(
                f"{path}: a link to {path.readlink()}; expected the run's own folder, which is "
                "written over; remove the link, or choose another -o"
            )
    if record is None:
        present = ["poses.csv"] if (folder / "poses.csv").exists() else []
        present += [f"clouds in {name}/" for name in ("scans", "gt") if _clouds(folder / name)]
        if present:
            raise OutputError(
                f"{folder}: has {', '.join(present)} but no {RECORD}; "
                "expected an empty folder or a run; choose another -o, or move them away"
            )
        return
    if identity is not None:
        remedy = "choose another -o or give --overwrite"
        check_same(folder / RECORD, record, identity, remedy=remedy, names=_NAMES)


def _clear(folder: Path, record: RunRecord | None) -> None:
    """Delete the files of a run, and only those: nothing without its record."""
    if record is None:
        return
    for path in [path for name in ("scans", "gt") for path in _clouds(folder / name)]:
        if path.stem.isdigit() and path.suffix == record.suffix:
            path.unlink()
    for name in ("poses.csv", RECORD):
        (folder / name).unlink(missing_ok=True)


def _clouds(folder: Path) -> list[Path]:
    """List the cloud files of a folder, which need not exist."""
    return [
        path
        for path in folder.glob("*")
        if path.suffix.lower() in CLOUD_SUFFIXES and path.name[0] != "."
    ]
