"""Virtual scans of one building in a folder: written once, continued after an interruption."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
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
from mcpseg_cli.formats.poses import PoseTable, read_poses
from mcpseg_cli.raytrace.scanner import VirtualScanner, poses_table
from mcpseg_cli.resumable import check_same, remove_leftovers, write_whole

_FORMAT = 1  # of the folder; another number is another run
_IDENTITY = ("format", "building", "settings", "suffix", "waypoints")
_NAMES = {"format": "version of the folder", "building": "building", "suffix": "--format"}


@dataclass(frozen=True)
class RaytraceRequest:
    """What a run is to do; a folder is continued only by the same request.

    Attributes:
        source: What the building is called in the record.
        settings: Scanner and route.
        suffix: Ending of the cloud files.
        waypoints: Where the waypoints come from and what they are, or ``"automatic"``.
    """

    source: str
    settings: RaytraceSettings
    suffix: str
    waypoints: str


@dataclass(frozen=True)
class WrittenScan:
    """One scan of a run: its name and its points."""

    name: str
    num_points: int


class RaytraceRun:
    """The scans of one building in one folder, which the caller holds against other processes (``lock.exclusive``).

    Args:
        folder: Where ``scans/``, ``gt/``, ``poses.csv`` and ``raytrace.json`` go.
        building: At least one point.
        request: What to do.
        overwrite: Replace an earlier run; it is deleted when ``start`` is called, not before.

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
            "waypoints": request.waypoints,
        }
        self.record = _read_record(folder)
        _check_folder(folder, self.record, None if overwrite else self._identity)
        self.poses = (
            None if overwrite or self.record is None else _read_own_poses(folder, self.record)
        )
        self.scanner = VirtualScanner(building, request.settings)
        self._seen = np.zeros(len(self.scanner.grid), bool)

    @property
    def is_complete(self) -> bool:
        """True when an earlier call made every scan, and all are still there."""
        if self.record is None or not self.record.get("complete") or self.poses is None:
            return False
        return all(self._is_there(name) for name in self.poses.scans or ())

    def start(self, poses: NDArray[np.float64], route: dict[str, object]) -> None:
        """Record where to scan from; needed unless the folder says it already. Places that see nothing are left out.

        Args:
            poses: (S, 4, 4) float64, sensor to map, turned about z only.
            route: What to record about the route.

        Raises:
            OutputError: Nothing is seen from anywhere.
            OSError: The folder cannot be written.
        """
        sees = np.array([self.scanner.sees_anything(pose[:3, 3]) for pose in poses], bool)
        if not sees.any():
            raise OutputError(
                f"{self.folder}: nothing can be seen; expected another --range, --height or --v-min"
            )
        _clear(self.folder, self.record)
        for name in ("scans", "gt"):
            (self.folder / name).mkdir(parents=True, exist_ok=True)
        text = poses_table(poses[sees])
        self.record = {
            "mcpseg": __version__,
            "source": self.request.source,
            **self._identity,
            "route": route,
        }
        self._write_record(
            {
                "blind_positions": int((~sees).sum()),
                "poses": _hash(text.encode()),
                "complete": False,
            }
        )
        write_whole(self.folder / "poses.csv", text)
        self.poses = read_poses(self.folder / "poses.csv")

    def run(self, jobs: int) -> Iterator[WrittenScan]:
        """Make the scans that are missing, several at once.

        Args:
            jobs: Threads.

        Yields:
            Each scan once its files are complete, in order, also those that were there.

        Raises:
            OSError: The disk is full or the folder not writable; finished scans are kept.
        """
        assert self.poses is not None
        for folder in (self.folder, self.folder / "scans", self.folder / "gt"):
            remove_leftovers(folder)
        names = self.poses.scans or ()
        num_points = 0
        with ThreadPoolExecutor(jobs) as pool:
            for start in range(0, len(names), 8 * jobs):  # a few ahead, not the whole building
                few = slice(start, start + 8 * jobs)
                for scan, voxels in pool.map(self._make, names[few], self.poses.poses[few, :3, 3]):
                    self._seen[voxels] = True
                    num_points += scan.num_points
                    yield scan
        self._finish(num_points)

    def _files(self, name: str) -> list[Path]:
        """Return the files of one scan in the order of writing: a scan is never without its truth."""
        return [self.folder / part / f"{name}{self.request.suffix}" for part in ("gt", "scans")]

    def _is_there(self, name: str) -> bool:
        """Tell whether a scan has been written; a power cut may leave files without content."""
        return all(path.is_file() and path.stat().st_size > 0 for path in self._files(name))

    def _make(
        self, name: str, position: NDArray[np.float64]
    ) -> tuple[WrittenScan, NDArray[np.int32]]:
        """Scan from one place and write what is not there yet."""
        scan = self.scanner.scan(int(name), position)
        if not self._is_there(name):
            for path, cloud in zip(
                self._files(name), reversed(self.scanner.clouds(scan)), strict=True
            ):
                write_cloud(path, cloud)
        return WrittenScan(name, len(scan.points)), scan.voxels

    def _finish(self, num_points: int) -> None:
        """Record the run as complete, with what was seen."""
        assert self.poses is not None
        building, grid = self.scanner.building, self.scanner.grid
        seen = grid.points[self._seen]
        per_class = np.bincount(building.semantic[seen], minlength=256)
        ids, counts = np.unique(building.instance[seen], return_counts=True)
        per_object = dict(zip(ids.tolist(), counts.tolist(), strict=True))
        self._write_record(
            {
                "complete": True,
                "classes": list(building.classes),
                "scans": len(self.poses),
                "points": num_points,
                "voxels": len(grid),
                "voxels_seen": len(seen),
                "voxels_seen_by_class": {
                    name: int(per_class[index]) for index, name in enumerate(building.classes)
                },
                "objects_seen": int((ids > 0).sum()),
                "objects": [
                    {"id": number, "name": name, "voxels_seen": per_object.get(number, 0)}
                    for number, name in enumerate(building.object_names, start=1)
                ],
            }
        )

    def _write_record(self, facts: dict[str, object]) -> None:
        """Write raytrace.json."""
        assert self.record is not None
        self.record |= facts
        write_whole(self.folder / "raytrace.json", json.dumps(self.record, indent=1) + "\n")


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


def _read_record(folder: Path) -> dict[str, object] | None:
    """Read raytrace.json, written before anything else; None where there is none."""
    path = folder / "raytrace.json"
    if not path.is_file():
        return None
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError):
        record = None
    if not isinstance(record, dict) or any(
        key not in record for key in (*_IDENTITY, "route", "poses", "complete")
    ):
        raise OutputError(
            f"{path}: not the record of a run; expected one; choose another -o, or move it away"
        )
    return record


def _read_own_poses(folder: Path, record: dict[str, object]) -> PoseTable | None:
    """Read poses.csv if it is what the run wrote; None asks for it to be planned anew."""
    path = folder / "poses.csv"
    return (
        read_poses(path) if path.is_file() and _hash(path.read_bytes()) == record["poses"] else None
    )


def _check_folder(
    folder: Path, record: dict[str, object] | None, identity: dict[str, object] | None
) -> None:
    """Refuse a folder that holds clouds that no run made, or another run unless there is nothing to compare it with."""
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder}: a file; expected a folder; choose another -o")
    if record is None:
        present = ["poses.csv"] if (folder / "poses.csv").exists() else []
        present += [f"clouds in {name}/" for name in ("scans", "gt") if _clouds(folder / name)]
        if present:
            raise OutputError(
                f"{folder}: has {', '.join(present)} but no raytrace.json; expected an empty folder or a run; "
                "choose another -o, or move them away"
            )
        return
    if identity is not None:
        kept = {key: record[key] for key in _IDENTITY}
        remedy = "choose another -o or give --overwrite"
        check_same(folder / "raytrace.json", kept, identity, remedy=remedy, names=_NAMES)


def _clear(folder: Path, record: dict[str, object] | None) -> None:
    """Delete the files of a run, and only those: nothing without its record."""
    if record is None:
        return
    for path in [path for name in ("scans", "gt") for path in _clouds(folder / name)]:
        if path.stem.isdigit() and path.suffix == record["suffix"]:
            path.unlink()
    for name in ("poses.csv", "raytrace.json"):
        (folder / name).unlink(missing_ok=True)


def _clouds(folder: Path) -> list[Path]:
    """List the cloud files of a folder, which need not exist."""
    return [
        path
        for path in folder.glob("*")
        if path.suffix.lower() in CLOUD_SUFFIXES and path.name[0] != "."
    ]
