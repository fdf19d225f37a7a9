"""A run scan by scan: times, how steady its labels are, and how good the map so far was."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.errors import InputError, OutputError, StateError
from mcpseg_cli.evaluate.label_stability import LabelHistory, Stability
from mcpseg_cli.evaluate.prediction import Prediction
from mcpseg_cli.evaluate.run_folder import RunFolder
from mcpseg_cli.evaluate.score_curve import CurveRecorder, ScoreCurve
from mcpseg_cli.formats import read_measured
from mcpseg_cli.formats.labels import point_labels
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.events import ScanEvent
from mcpseg_cli.segment.labelled_run import LabelledRun

# metres; the coordinates of other formats are rounded to this when written as LAS
_LAS_ROUNDING = 1e-4


@dataclass(frozen=True)
class ScanByScan:
    """What the scans of a run tell.

    Attributes:
        scans: Scans in events.jsonl.
        skipped: Of these, how many could not be read.
        latency: Milliseconds per scan; None where they were not kept.
        stability: Changes of labels; None if the labelled scans are not there.
        curve: Scores of the map so far; None if the labelled scans are not there.
        missing: Why these two are not there; empty if they are.
    """

    scans: int
    skipped: int
    latency: Latency | None
    stability: Stability | None = None
    curve: ScoreCurve | None = None
    missing: str = ""

    def document(self) -> dict[str, object]:
        """Give every metric by name."""
        return {
            "scans": self.scans,
            "skipped": self.skipped,
            "ms_per_scan": asdict(self.latency) if self.latency else None,
            "stability": asdict(self.stability) if self.stability else None,
            "over_scans": self.curve.document() if self.curve else None,
        }


@dataclass(frozen=True)
class Latency:
    """Milliseconds per scan, reading and writing included.

    The first scan of every start waits for kernels and libraries, and is none of these unless there
    is no other.

    Attributes:
        p50: Median.
        p95: 95th percentile.
        max: The slowest.
        warm_up: The slowest of the first scans; None where none is left out.
    """

    p50: float
    p95: float
    max: float
    warm_up: float | None = None

    @classmethod
    def of(cls, ms: Sequence[float], warm_up: Sequence[float] = ()) -> Self | None:
        """Summarise milliseconds, those of first scans apart; None where there are none at all."""
        counted = ms or warm_up
        if not counted:
            return None
        p50, p95, highest = np.percentile(counted, [50, 95, 100]).tolist()
        return cls(p50, p95, highest, max(warm_up) if ms and warm_up else None)

    def text(self) -> str:
        """Write it for reading."""
        text = f"{self.p50:.1f} median, {self.p95:.1f} p95, {self.max:.1f} max"
        if self.warm_up is None:
            return text
        return f"{text}; the first, {self.warm_up:,.0f}, is not counted"


def follow_scans(
    final: Prediction,
    true_semantic: NDArray[np.uint8],
    num_classes: int,
    told: Callable[[int, int], None] = lambda *_: None,
) -> ScanByScan | None:
    """Read the labelled scans of a run, one in memory at a time.

    Args:
        final: Its map.
        true_semantic: (V,) uint8 true class of each voxel in the table of ``final``, 255 unknown.
        num_classes: C, of that table.
        told: Called after every scan with how many are done and how many there are.

    Returns:
        What there is to tell; None without events.jsonl, and for one cloud.

    Raises:
        InputError: A labelled scan is damaged, or the checkpoint has no pose for it.
    """
    folder = final.folder
    if folder is None or folder.events is None:
        return None

    # what the events tell by themselves
    skipped = sum(event.skipped for event in folder.events)
    scans = ScanByScan(len(folder.events), skipped, measure_latency(folder.events))

    # the map's voxels, and the scans that saw them
    xyz = final.xyz.astype(np.float32, copy=False)
    voxels = VoxelMap(final.voxel_size)
    voxels.insert(xyz, np.zeros((len(xyz), 3), np.uint8))
    files = folder.labelled_scans()
    if not files:  # all scans are of maps that were merged
        return scans
    if problem := _find_problem(folder.path, files, final, voxels):
        return replace(scans, missing=f"{problem}; stability is not measured")
    try:
        poses = _poses(folder)
        changes = _label_changes(folder, final.lookup, len(xyz))
    except (StateError, OutputError) as error:
        return replace(scans, missing=f"{error}; stability is not measured")

    # their labels at each look, against the look before and the truth
    history, recorder = LabelHistory(true_semantic), CurveRecorder(true_semantic, num_classes)
    looks = _looks(folder, final.lookup, poses, voxels)
    for number, (ids, semantic, instance) in enumerate(looks, start=1):
        history.look(ids, semantic, instance)
        if changed := changes.get(number - 1):
            recorder.change(*changed)
        recorder.look(ids, semantic)
        told(number, len(files))
    stability = history.finish(final.semantic, final.instance)
    return replace(scans, stability=stability, curve=recorder.curve())


def measure_latency(events: Sequence[ScanEvent]) -> Latency | None:
    """Summarise the milliseconds of the scans that have them; None if none has."""
    timed = [event for event in events if event.ms is not None and not event.skipped]
    first = [event.ms for event in timed if event.ms is not None and event.is_first]
    others = [event.ms for event in timed if event.ms is not None and not event.is_first]
    return Latency.of(others, first)


def _find_problem(folder: Path, files: list[Path], final: Prediction, voxels: VoxelMap) -> str:
    """Say what keeps voxels from being followed; empty if nothing does."""
    missing = sum(not file.is_file() for file in files)
    if missing or not files:
        return f"{missing:,} of {len(files):,} labelled scans are missing in {folder / 'scans'}"
    if len(voxels) != len(final.xyz):
        return f"{final.source} has several points in a voxel"
    return ""


def _poses(folder: RunFolder) -> list[NDArray[np.float64] | None]:
    """Return the pose of every scan that was read; None where labelled scans are in the map frame.

    Raises:
        StateError: The checkpoint, which has them, is in use or damaged.
    """
    names = [event.name for event in folder.events or () if not event.skipped]
    if folder.configuration.frame != "sensor":
        return [None] * len(names)
    with State(folder.state_path) as state:
        poses = {record.name: record.pose for record in state.scans()}
    try:
        return [poses[name] for name in names]
    except KeyError as error:
        found, expected = f"no pose for {error.args[0]}", "every scan of events.jsonl"
        raise InputError(folder.state_path, found, expected, "run segment again") from error


def _label_changes(
    folder: RunFolder, lookup: NDArray[np.uint8], num_voxels: int
) -> dict[int, tuple[NDArray[np.int32], NDArray[np.uint8]]]:
    """Give the voxels whose labels scans changed, in sight or not, by number of the labelled scan.

    Raises:
        StateError: The checkpoint, which logs them, is damaged.
        OutputError: There is no room for a copy of it.
    """
    if not folder.state_path.is_file():
        return {}
    read = [number for number, event in enumerate(folder.events or ()) if not event.skipped]
    found = {}
    with LabelledRun(folder.path) as run:
        for labelled, number in enumerate(read):
            for changes in run.label_changes(number):
                usable = changes.ids < num_voxels
                found[labelled] = changes.ids[usable], lookup[changes.semantic[usable]]
    return found


def _looks(
    folder: RunFolder,
    lookup: NDArray[np.uint8],
    poses: list[NDArray[np.float64] | None],
    voxels: VoxelMap,
) -> Iterator[tuple[NDArray[np.int32], NDArray[np.uint8], NDArray[np.int32]]]:
    """Give the voxels that each scan labelled, with their labels as known then."""
    intake = folder.configuration.intake
    is_rounded = folder.configuration.format in ("las", "laz")
    for path, pose in zip(folder.labelled_scans(), poses, strict=True):
        # a labelled scan has its own frame, as its input had
        cloud = read_measured(path).measured()
        own, instance = point_labels(cloud, path)
        semantic = lookup[own]
        xyz = intake.place_points(cloud.xyz, pose)

        # the first labelled point of every voxel
        ids = voxels.find(xyz)
        usable = (ids >= 0) & ((semantic != UNKNOWN) | (instance > 0))
        labelled = np.flatnonzero(usable)
        if is_rounded:
            labelled = labelled[_is_inside(xyz[labelled], voxels.voxel_size)]
        _, first = np.unique(ids[labelled], return_index=True)
        rows = labelled[first]
        yield ids[rows], semantic[rows], instance[rows]


def _is_inside(xyz: NDArray[np.float32], voxel_size: float) -> NDArray[np.bool_]:
    """Tell which points are so far inside their voxel that rounding cannot move them out; (N,)."""
    place = xyz.astype(np.float64) / voxel_size + 0.5
    far = np.abs(place - np.rint(place)) > _LAS_ROUNDING / voxel_size
    inside: NDArray[np.bool_] = np.logical_and.reduce(far, axis=1)
    return inside
