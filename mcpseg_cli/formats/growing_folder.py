"""A folder of scans and a pose file that another program is still writing."""

from __future__ import annotations

import fcntl
import os
import signal
from collections.abc import Iterable, Sequence
from pathlib import Path
from time import monotonic, perf_counter, time_ns

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Frame
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.pairing import MAX_GAP_S
from mcpseg_cli.formats.recording import Recording, pair_with
from mcpseg_cli.formats.scan_files import ScanFile, list_clouds
from mcpseg_cli.formats.scan_source import ScanSource

_QUIET_S = 0.15  # a file that has not changed for so long may be complete
_UNCOUNTED_QUIET_S = 1.0  # the same of formats that do not say how many points there are
_COUNTED = (".ply", ".las", ".laz", ".npz", ".pcd", ".e57")
_GIVEN_UP_S = 5.0  # what cannot be read after so long stays so
_OVERTAKEN_S = 10.0  # a pose whose successors have been there for so long does not come
_REST = 3.0  # times as long as pairing took, it is not done again: it takes longer and longer
_SETTLED_NS = 100_000_000  # after which a folder's time shows every change since

_Status = tuple[int, int]  # bytes, time of the last change


class GrowingFolder:
    """Hands out scans in order, each when it is complete and its pose is known.

    A scan is complete when its size and time have not changed from look to look, no program has it
    open for writing, and it can be read whole; the last is for the caller to try.

    Args:
        directory: Folder of scans; may not be there yet.
        poses_path: Pose file; may not be there yet.
        frame: Frame of the scans' coordinates.
        max_gap: Seconds from a scan to the nearest pose, where they pair by time.
        consumed: File names of scans that were taken before, in order; they are handed out first.

    Attributes:
        given: The scans that were taken, in order.
        paired: How all that is there pairs; None before the first scan and pose.
        problem: Why nothing can be handed out, if so.
        changed: When something was last seen to change, on the monotonic clock.
    """

    def __init__(
        self,
        directory: Path,
        poses_path: Path,
        frame: Frame = "map",
        max_gap: float = MAX_GAP_S,
        consumed: Sequence[str] = (),
    ) -> None:
        self.directory, self.poses_path = directory, poses_path
        self.given: list[ScanSource] = []
        self.paired: Recording | None = None
        self.problem: InputError | None = None
        self.changed = monotonic()
        self._frame, self._max_gap = frame, max_gap
        self._consumed = frozenset(consumed)
        self._seen: dict[Path, tuple[_Status, float]] = {}
        self._pose_status: frozenset[tuple[str, _Status]] = frozenset()
        self._overtaken: dict[str, float] = {}
        self._taken: set[Path] = set()
        self._paths: list[Path] = []
        self._listed: dict[Path, _Status] = {}
        self._is_stale, self._next_pairing = False, 0.0

    @property
    def num_waiting(self) -> int:
        """Count the scans that are there, complete or not, and were not taken yet."""
        return len(self._seen) - len(self.given)

    def look(self, *, is_over: bool = False) -> list[ScanSource]:
        """Return the scans whose turn it is, in order.

        Args:
            is_over: Nothing more is to come: what is there is complete, what is not there is
                missing.

        Raises:
            InputError: A scan or pose that was taken has changed; at the end also whatever keeps
                the scans from being paired.
            OSError: A file cannot be read.
        """
        self._is_stale |= self._has_changed()
        if is_over or (self._is_stale and monotonic() >= self._next_pairing):
            self._pair(is_over=is_over)
        if is_over and self.problem is not None:
            raise self.problem
        if self.paired is None or self.problem is not None:
            return []
        ready = []
        for place in range(len(self.given), len(self.paired.scans)):
            source = self.paired.scans[place]
            is_here = source.name not in self.paired.awaited or self._is_overtaken(place)
            if not is_over and not (is_here and self._is_complete(source)):
                break
            ready.append(source)
        return ready

    def take(self, source: ScanSource) -> None:
        """Note that a scan was taken."""
        self.given.append(source)
        self._taken.add(source.path)
        self.changed = monotonic()

    def may_change(self, source: ScanSource) -> bool:
        """Tell whether a scan that cannot be read may only be incomplete."""
        since = self._seen[source.path][1]
        return self.is_other_now(source) or monotonic() - since < _GIVEN_UP_S

    def is_other_now(self, source: ScanSource) -> bool:
        """Tell whether a file is no longer what it was at the last look."""
        try:
            return _status(source.path) != self._seen[source.path][0]
        except FileNotFoundError:
            return True

    def _list(self) -> list[Path]:
        """List the scans, unless the folders are as they were, and were so for a moment before."""
        if self._listed and _status_of_folders(self._listed) == self._listed:
            return self._paths
        before = _status_of_folders(_folders_below(self.directory))
        self._paths = list_clouds(self.directory)
        if any(path.parent == self.directory for path in self._paths):  # others do not count then
            before = {self.directory: before[self.directory]}
        is_settled = all(time_ns() - status[1] > _SETTLED_NS for status in before.values())
        self._listed = before if is_settled else {}
        return self._paths

    def _has_changed(self) -> bool:
        """Look at all files that were not taken yet; tell whether any is new or another."""
        now, has_changed = monotonic(), False
        try:
            paths = self._list()
        except InputError as error:
            self.problem, paths = error, []
        for path in paths:
            if path in self._taken:
                continue
            try:
                status = _status(path)
            except FileNotFoundError:  # renamed since
                continue
            known = self._seen.get(path)
            if known is None or known[0] != status:
                self._seen[path] = status, now
                has_changed = True

        status_of_poses = _status_of_all(self.poses_path)
        if status_of_poses != self._pose_status:
            self._pose_status, has_changed = status_of_poses, True
        if has_changed:
            self.changed = now
        return has_changed

    def _pair(self, *, is_over: bool) -> None:
        """Pair what is there; what is wrong may come right while the recording grows."""
        started = perf_counter()
        self._pair_now(is_over=is_over)
        self._is_stale = False
        self._next_pairing = monotonic() + _REST * (perf_counter() - started)

    def _pair_now(self, *, is_over: bool) -> None:
        try:
            paths = list_clouds(self.directory) if is_over else self._list()
            scans = tuple(ScanFile(path, None, self.directory) for path in paths)
            paired = pair_with(
                Recording(self.directory, "growing folder of scans", scans),
                self.poses_path, self._frame, self._max_gap,
                is_growing=not is_over, any_distance=True,
            )  # fmt: skip
        except InputError as error:
            self.problem = error
            return
        except FileNotFoundError as error:
            found, remedy = "no such file", "check the path"
            self.problem = InputError(error.filename or "", found, "poses of the scans", remedy)
            return
        self.problem, self.paired = None, paired
        self._check_taken(paired)

    def _check_taken(self, scans: Sequence[ScanSource]) -> None:
        """See that scans that were taken are what and where they were."""
        remedy = "end it, and label all again with --overwrite"
        for place, before in enumerate(self.given):
            if place >= len(scans) or scans[place].path != before.path:
                found = f"{before.name} is gone, or others have come before it"
                raise InputError(self.directory, found, "new scans after the labelled ones", remedy)
            if (
                scans[place].pose is None and before.pose is not None
            ):  # the file is perhaps just being written
                found = f"no pose for {before.name}, which is labelled"
                self.problem = InputError(self.poses_path, found, "poses that stay", remedy)
            elif before.pose is not None and not _is_same(scans[place].pose, before.pose):
                found = f"the pose of {before.name} has changed since it was labelled"
                raise InputError(self.poses_path, found, "poses that stay", remedy)

    def _is_complete(self, source: ScanSource) -> bool:
        """Tell whether a file seems to be complete."""
        if source.name in self._consumed:
            return True
        if source.path not in self._seen:
            return False
        quiet = _QUIET_S if source.path.suffix.lower() in _COUNTED else _UNCOUNTED_QUIET_S
        is_quiet = monotonic() - self._seen[source.path][1] >= quiet
        return is_quiet and not is_being_written(source.path)

    def _is_overtaken(self, place: int) -> bool:
        """Tell whether a scan waits in vain: poses of later ones have been there for long."""
        assert self.paired is not None
        name = self.paired.scans[place].name
        if name in self._consumed:
            return True
        if all(scan.pose is None for scan in self.paired.scans[place + 1 :]):
            return False
        return monotonic() - self._overtaken.setdefault(name, monotonic()) > _OVERTAKEN_S


def is_being_written(path: Path) -> bool:
    """Tell whether a program has a file open for writing, as far as the system says.

    Linux grants a lease for reading only on files that nobody writes. It grants none at all on
    files of others and on some network drives.
    """
    try:
        with path.open("rb") as file:
            fcntl.fcntl(file, fcntl.F_SETSIG, signal.SIGURG)  # not the one that ends programs
            fcntl.fcntl(file, fcntl.F_SETLEASE, fcntl.F_RDLCK)
            fcntl.fcntl(file, fcntl.F_SETLEASE, fcntl.F_UNLCK)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def _is_same(pose: NDArray[np.float64] | None, before: NDArray[np.float64]) -> bool:
    return pose is not None and np.array_equal(pose, before)


def _status(path: Path) -> _Status:
    status = path.stat()
    return status.st_size, status.st_mtime_ns


def _folders_below(directory: Path) -> list[Path]:
    """List a folder and all those in it."""
    return [Path(folder) for folder, _, _ in os.walk(directory)]


def _status_of_folders(folders: Iterable[Path]) -> dict[Path, _Status]:
    """Return the status of each folder that is there."""
    found = {}
    for folder in folders:
        try:
            found[folder] = _status(folder)
        except FileNotFoundError:
            continue
    return found


def _status_of_all(path: Path) -> frozenset[tuple[str, _Status]]:
    """Return the status of a file, or of all files in a folder; nothing where there is none."""
    try:
        if not path.is_dir():
            return frozenset([(path.name, _status(path))])
        with os.scandir(path) as entries:
            found = [(entry.name, entry.stat()) for entry in entries]
    except FileNotFoundError:
        return frozenset()
    return frozenset((name, (status.st_size, status.st_mtime_ns)) for name, status in found)
