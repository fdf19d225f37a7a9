"""A run followed scan by scan: how long each took, how steady its labels are, how good the map so far was."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.errors import InputError, OutputError, StateError
from mcpseg_cli.evaluate.label_stability import LabelHistory, Stability
from mcpseg_cli.evaluate.score_curve import CurveRecorder, ScoreCurve
from mcpseg_cli.formats import Cloud, read_cloud
from mcpseg_cli.formats.labels import point_labels
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.scan import to_map_frame
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.events import ScanEvent, read_events

_LAS_ROUNDING = (
    1e-4  # metres; the coordinates of other formats are rounded to this when written as LAS
)


@dataclass(frozen=True)
class FollowedRun:
    """What the scans of a run tell.

    Attributes:
        scans: Scans in events.jsonl.
        skipped: Of these, how many could not be read.
        latency: Milliseconds per scan; None where they were not kept.
        stability: Changes of labels; None if the labelled scans are not there.
        curve: Scores of the map so far; None if the labelled scans are not there.
    """

    scans: int
    skipped: int
    latency: Latency | None
    stability: Stability | None
    curve: ScoreCurve | None

    def document(self) -> dict[str, object]:
        """Give every figure by name."""
        return {
            "scans": self.scans,
            "skipped": self.skipped,
            "ms_per_scan": asdict(self.latency) if self.latency else None,
            "stability": asdict(self.stability) if self.stability else None,
            "over_scans": self.curve.document() if self.curve else None,
        }


@dataclass(frozen=True)
class RunMap:
    """The final map of a run.

    Attributes:
        xyz: (V, 3) float32 metres, map frame.
        semantic: (V,) uint8 class, 255 unknown.
        instance: (V,) int32 object, 0 none.
        voxel_size: Metres.
    """

    xyz: NDArray[np.float32]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]
    voxel_size: float


def follow_run(
    output: Path,
    final: RunMap,
    true_semantic: NDArray[np.uint8],
    num_classes: int,
    told: Callable[[int, int], None] = lambda *_: None,
) -> tuple[FollowedRun | None, str]:
    """Read the events and labelled scans of a run, one scan in memory at a time.

    Args:
        output: Folder of the run.
        final: Its map.
        true_semantic: (V,) uint8 true class of each voxel, 255 unknown.
        num_classes: C, the run's.
        told: Called after every scan with how many are done and how many there are.

    Returns:
        What there is to tell, and why something is missing (empty if nothing is). None without
        events.jsonl.

    Raises:
        InputError: events.jsonl or a labelled scan is damaged.
    """
    path = output / "events.jsonl"
    if not path.is_file():
        return (
            None,
            f"{path} is not there; times, stability and the curve over scans are not measured",
        )
    events = read_events(path)
    skipped = sum(event.skipped for event in events)
    followed = FollowedRun(len(events), skipped, measure_latency(events), None, None)
    files = _labelled_scans(output, events)
    voxels = VoxelMap(final.voxel_size)
    voxels.insert(final.xyz, np.zeros((len(final.xyz), 3), np.uint8))
    missing = sum(not file.is_file() for file in files)
    if missing or not files:
        reason = f"{missing:,} of {len(files):,} labelled scans are missing in {output / 'scans'}"
        return followed, f"{reason}; stability is not measured"
    if len(voxels) != len(final.xyz):
        return (
            followed,
            f"{output / 'map.ply'} has several points in a voxel; stability is not measured",
        )
    try:
        poses = _poses(output, events)
    except (StateError, OutputError) as error:
        return followed, f"{error}; stability is not measured"
    history, recorder = LabelHistory(true_semantic), CurveRecorder(true_semantic, num_classes)
    for number, (ids, semantic, instance) in enumerate(
        _looks(output, files, poses, voxels), start=1
    ):
        history.look(ids, semantic, instance)
        recorder.look(ids, semantic)
        told(number, len(files))
    return replace(
        followed, stability=history.finish(final.semantic, final.instance), curve=recorder.curve()
    ), ""


def _labelled_scans(output: Path, events: list[ScanEvent]) -> list[Path]:
    """List where the labelled copy of every scan that was read should be."""
    ending = _configuration(output).get("format")
    paths = [output / "scans" / event.name for event in events if not event.skipped]
    return [path.with_suffix(f".{ending}") for path in paths] if ending else paths


def _looks(
    output: Path, files: list[Path], poses: list[NDArray[np.float64]] | None, voxels: VoxelMap
) -> Iterator[tuple[NDArray[np.int32], NDArray[np.uint8], NDArray[np.int32]]]:
    """Give the voxels that each scan labelled, with their labels as known then."""
    is_rounded = _configuration(output).get("format") in ("las", "laz")
    for number, path in enumerate(files):
        cloud = read_cloud(path)
        semantic, instance = point_labels(cloud, path)
        xyz = _in_map(cloud, poses[number] if poses else None)
        ids = voxels.find(xyz)
        usable = (ids >= 0) & ((semantic != UNKNOWN) | (instance > 0))
        if is_rounded:
            usable &= _is_inside(xyz, voxels.voxel_size)
        labelled = np.flatnonzero(usable)
        _, first = np.unique(ids[labelled], return_index=True)
        rows = labelled[first]
        yield ids[rows], semantic[rows], instance[rows]


def _is_inside(xyz: NDArray[np.float32], voxel_size: float) -> NDArray[np.bool_]:
    """Tell which points are so far from the border of their voxel that rounding has not moved them across; (N,)."""
    place = xyz.astype(np.float64) / voxel_size + 0.5
    far = np.abs(place - np.rint(place)) > _LAS_ROUNDING / voxel_size
    inside: NDArray[np.bool_] = np.logical_and.reduce(far, axis=1)
    return inside


def _in_map(cloud: Cloud, pose: NDArray[np.float64] | None) -> NDArray[np.float32]:
    """Return the (N, 3) float32 points in the map frame; a labelled scan has its own frame, as its input had."""
    return (
        cloud.xyz.astype(np.float32, copy=False) if pose is None else to_map_frame(cloud.xyz, pose)
    )


def _poses(output: Path, events: list[ScanEvent]) -> list[NDArray[np.float64]] | None:
    """Return the poses of the scans that were read if the scans are in the sensor's frame; they are in the checkpoint.

    Raises:
        StateError: The checkpoint is in use or damaged.
    """
    if _configuration(output).get("frame") != "sensor":
        return None
    with State(output / "state.sqlite") as state:
        records = {record.name: record.pose for record in state.scans()}
    try:
        return [records[event.name] for event in events if not event.skipped]
    except KeyError as error:
        found = f"no pose for {error.args[0]}"
        raise InputError(
            output / "state.sqlite", found, "every scan of events.jsonl", "run segment again"
        ) from error


def _configuration(output: Path) -> dict[str, object]:
    """Read the configuration from run.json."""
    path = output / "run.json"
    try:
        configuration = json.loads(path.read_text())["configuration"]
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            path, "no configuration", "a run.json that mcpseg wrote", "run mcpseg segment again"
        ) from error
    return dict(configuration)


@dataclass(frozen=True)
class Latency:
    """Milliseconds per scan, reading and writing included.

    Attributes:
        p50: Median.
        p95: 95th percentile.
        max: The slowest.
    """

    p50: float
    p95: float
    max: float


def measure_latency(events: list[ScanEvent]) -> Latency | None:
    """Summarise the milliseconds of the scans that have them; None if none has."""
    ms = [event.ms for event in events if event.ms is not None and not event.skipped]
    if not ms:
        return None
    p50, p95, highest = np.percentile(ms, [50, 95, 100])
    return Latency(float(p50), float(p95), float(highest))
