"""Virtual scans of one building in a folder: written once, continued after an interruption."""

from __future__ import annotations

import hashlib
import json
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
from mcpseg_cli.formats import CLOUD_SUFFIXES, PARTIAL, write_cloud
from mcpseg_cli.formats.poses import PoseTable, read_poses
from mcpseg_cli.formats.whole import write_whole
from mcpseg_cli.raytrace.scanner import POSE_COLUMNS, VirtualScanner, poses_table

_FORMAT = 1  # of the folder; another number is another run
_IDENTITY = ("format", "building", "settings", "suffix", "waypoints")


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
    """One scan of a run: its name, its points, and whether it was there before."""

    name: str
    num_points: int
    was_there: bool


class RaytraceRun:
    """The scans of one building in one folder.

    Args:
        folder: Where ``scans/``, ``gt/``, ``poses.csv`` and ``raytrace.json`` go; made if missing.
        building: At least one point.
        request: What to do.
        overwrite: Delete an earlier run first.

    Raises:
        InputError: The building is too large for the voxel size.
        OutputError: The folder holds another run, or files that no run made.
    """

    def __init__(self, folder: Path, building: Building, request: RaytraceRequest, *, overwrite: bool = False) -> None:
        self.folder = folder
        self.request = request
        self._identity = {
            "format": _FORMAT,
            "building": building_hash(building),
            "settings": request.settings.model_dump(),
            "suffix": request.suffix,
            "waypoints": request.waypoints,
        }
        if overwrite:
            _clear(folder)
        self.record = _read_record(folder)
        _check_folder(folder, self.record, self._identity)
        self.scanner = VirtualScanner(building, request.settings)
        self.poses: PoseTable | None = None
        if self.record is not None and (folder / "poses.csv").exists():
            self.poses = read_poses(folder / "poses.csv")
        self._seen = np.zeros(len(self.scanner.grid), bool)

    @property
    def is_complete(self) -> bool:
        """True when an earlier call made every scan, and all are still there."""
        if self.record is None or not self.record.get("complete") or self.poses is None or self.poses.scans is None:
            return False
        return all(path.exists() for name in self.poses.scans for path in self._files(name))

    def start(self, poses: NDArray[np.float64], route: dict[str, object]) -> None:
        """Record where to scan from; needed once, unless the folder says it already.

        Args:
            poses: (S, 4, 4) float64, sensor to map, turned about z only.
            route: What to record about the route.

        Raises:
            OSError: The folder cannot be written.
        """
        for name in ("scans", "gt"):
            (self.folder / name).mkdir(parents=True, exist_ok=True)
        self.record = {"mcpseg": __version__, "source": self.request.source, **self._identity, "route": route}
        self._write_record({"complete": False})
        write_whole(self.folder / "poses.csv", poses_table(poses))
        self.poses = read_poses(self.folder / "poses.csv")

    def run(self, jobs: int, should_stop: Callable[[], bool] = lambda: False) -> Iterator[WrittenScan]:
        """Make the scans that are missing, several at once.

        Args:
            jobs: Threads.
            should_stop: Asked before each scan; True ends the run early.

        Yields:
            Each scan once its files are complete, in order, also those that were there.

        Raises:
            OSError: The disk is full or the folder not writable; finished scans are kept.
        """
        assert self.poses is not None
        assert self.poses.scans is not None
        for leftover in [path for name in ("scans", "gt") for path in (self.folder / name).glob(f".*{PARTIAL}.*")]:
            leftover.unlink(missing_ok=True)
        names = self.poses.scans
        empty: list[str] = []
        num_points = 0
        with ThreadPoolExecutor(jobs) as pool:
            for start in range(0, len(names), 8 * jobs):  # a few ahead, not the whole building
                few = slice(start, start + 8 * jobs)
                for scan, voxels in pool.map(self._make, names[few], self.poses.poses[few, :3, 3]):
                    self._seen[voxels] = True
                    num_points += scan.num_points
                    if scan.num_points == 0:
                        empty.append(scan.name)
                    yield scan
                if should_stop():
                    return
        self._finish(num_points, empty)

    def _files(self, name: str) -> list[Path]:
        """Return the files of one scan in the order of writing: a scan is never without its truth."""
        return [self.folder / part / f"{name}{self.request.suffix}" for part in ("gt", "scans")]

    def _make(self, name: str, position: NDArray[np.float64]) -> tuple[WrittenScan, NDArray[np.int32]]:
        """Scan from one place and write what is not there yet."""
        scan = self.scanner.scan(int(name), position)
        files = self._files(name)
        was_there = all(path.exists() for path in files)
        if len(scan.points) and not was_there:
            cloud, truth = self.scanner.clouds(scan)
            write_cloud(files[0], truth)
            write_cloud(files[1], cloud)
        return WrittenScan(name, len(scan.points), was_there), scan.voxels

    def _finish(self, num_points: int, empty: list[str]) -> None:
        """Leave scans that saw nothing out of the poses, and record the run as complete."""
        assert self.poses is not None
        if empty:
            lines = (self.folder / "poses.csv").read_text().splitlines()
            kept = [line for line in lines[1:] if line.partition(",")[0] not in set(empty)]
            if not kept:
                raise OutputError(
                    f"{self.folder}: no scan sees anything; expected a longer --range or another --height"
                )
            write_whole(self.folder / "poses.csv", "\n".join([POSE_COLUMNS, *kept]) + "\n")
        building, grid = self.scanner.building, self.scanner.grid
        seen = grid.points[self._seen]
        per_class = np.bincount(building.semantic[seen], minlength=256)
        per_object = np.bincount(building.instance[seen], minlength=len(building.object_names) + 1)
        self._write_record({
            "complete": True,
            "classes": list(building.classes),
            "scans": len(self.poses) - len(empty),
            "empty_scans": empty,
            "points": num_points,
            "voxels": len(grid),
            "voxels_seen": len(seen),
            "voxels_seen_by_class": {name: int(per_class[index]) for index, name in enumerate(building.classes)},
            "objects_seen": int((per_object[1:] > 0).sum()),
            "objects": [
                {"id": number, "name": name, "voxels_seen": int(per_object[number])}
                for number, name in enumerate(building.object_names, start=1)
            ],
        })  # fmt: skip

    def _write_record(self, facts: dict[str, object]) -> None:
        """Write raytrace.json."""
        assert self.record is not None
        self.record |= facts
        write_whole(self.folder / "raytrace.json", json.dumps(self.record, indent=1) + "\n")


def building_hash(building: Building) -> str:
    """Return a hash of every point and label of a building."""
    digest = hashlib.blake2b(digest_size=16)
    for column in (building.xyz, building.rgb, building.semantic, building.instance):
        digest.update(np.ascontiguousarray(column).data)
    digest.update(",".join(building.classes).encode())
    return digest.hexdigest()


def _read_record(folder: Path) -> dict[str, object] | None:
    """Read raytrace.json, written before anything else; None where there is none."""
    path = folder / "raytrace.json"
    if not path.is_file():
        return None
    try:
        record = json.loads(path.read_text())
    except ValueError:
        record = None
    if not isinstance(record, dict) or any(key not in record for key in _IDENTITY):
        raise OutputError(f"{path}: not the record of a run; expected one; give --overwrite or choose another -o")
    return record


def _check_folder(folder: Path, record: dict[str, object] | None, identity: dict[str, object]) -> None:
    """Refuse a folder that holds another run, or clouds that no run made."""
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
    changed = [key for key in _IDENTITY if record[key] != identity[key]]
    if changed:
        raise OutputError(
            f"{folder}: holds scans made with another {', '.join(_differences(record, identity, changed))}; "
            "expected the same; choose another -o or give --overwrite"
        )


def _differences(record: dict[str, object], identity: dict[str, object], changed: list[str]) -> list[str]:
    """Name what differs, settings one by one."""
    names = []
    for key in changed:
        before, now = record[key], identity[key]
        if key == "settings" and isinstance(before, dict) and isinstance(now, dict):
            names += [f"{name} ({before.get(name)}, not {now[name]})" for name in now if before.get(name) != now[name]]
        else:
            names.append(key)
    return names


def _clear(folder: Path) -> None:
    """Delete the files of a run, and only those: nothing without a raytrace.json."""
    if not (folder / "raytrace.json").is_file():
        return
    for path in [path for name in ("scans", "gt") for path in _clouds(folder / name)]:
        if path.stem.isdigit():
            path.unlink()
    for name in ("poses.csv", "raytrace.json"):
        (folder / name).unlink(missing_ok=True)


def _clouds(folder: Path) -> list[Path]:
    """List the cloud files of a folder, which need not exist."""
    return [path for path in folder.glob("*") if path.suffix.lower() in CLOUD_SUFFIXES and path.name[0] != "."]
