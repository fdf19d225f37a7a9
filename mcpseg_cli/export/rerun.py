"""A labelled map for the Rerun viewer (an extra: ``mcpseg[rerun]``): scans on a timeline.

Points, path, scanner, and boxes around objects; a layout that opens on the map and on the scanner.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import ColourBy
from mcpseg_cli.classes import UNKNOWN
from mcpseg_cli.errors import OutputError, naming
from mcpseg_cli.export.colours import class_palette, colouring
from mcpseg_cli.export.floors import are_below_ceiling
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.incremental.objects import MapObject, list_objects
from mcpseg_cli.resumable import write_whole
from mcpseg_cli.segment.labelled_run import LabelledRun

if TYPE_CHECKING:
    from rerun import AnyValues, RecordingStream
    from rerun.blueprint import Blueprint

TIMELINE = "scan"
_APPLICATION = "mcpseg"
_CUT = ("writer", "flush", "RRD")  # in Rerun's words, of a file that could not be written
_WRITTEN_S = 60.0  # for what is left of a recording to be on the disk
_POINT_RADIUS = 0.6  # of a voxel: surfaces look closed


@dataclass(frozen=True)
class LabelledPoints:
    """Points with labels, in the same order.

    Attributes:
        xyz: (N, 3) float32, metres, map frame.
        semantic: (N,) uint8 class index.
        instance: (N,) int32 object id.
        confidence: (N,) float32 in 0-1.
        rgb: (N, 3) uint8; None colours by class, which the viewer's legend switches.
    """

    xyz: NDArray[np.float32]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]
    confidence: NDArray[np.float32]
    rgb: NDArray[np.uint8] | None = None

    def select(self, rows: slice | NDArray[np.intp]) -> LabelledPoints:
        """Return some of the points."""
        rgb = None if self.rgb is None else self.rgb[rows]
        return LabelledPoints(
            self.xyz[rows], self.semantic[rows], self.instance[rows], self.confidence[rows], rgb
        )


class RerunLog:
    """A map told to Rerun scan by scan.

    Each scan's new points are an entity of their own, so that the map grows.

    Args:
        stream: Where it goes.
        classes: Names that ``semantic`` indexes.
        voxel_size: Metres.
    """

    def __init__(
        self, stream: RecordingStream, classes: tuple[str, ...], voxel_size: float
    ) -> None:
        import rerun

        self._rerun = rerun
        self._stream = stream
        self._radius = _POINT_RADIUS * voxel_size
        self._last_place: NDArray[np.float64] | None = None

        # what holds at all times
        palette = class_palette(classes).tolist()
        names = [(index, name, tuple(palette[index])) for index, name in enumerate(classes)]
        stream.log("/", rerun.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        for place in ("map", "above", "objects"):
            stream.log(place, rerun.AnnotationContext(names), static=True)
        stream.log("scanner", rerun.TransformAxes3D(0.5), static=True)
        stream.send_blueprint(_layout())

    def add_scan(
        self,
        number: int,
        pose: NDArray[np.float64],
        points: LabelledPoints,
        above: LabelledPoints | None = None,
    ) -> None:
        """Tell of one scan: where the scanner was, and the points first seen from there.

        Args:
            number: Of the scan, from 0; the time.
            pose: (4, 4) sensor to map, metres; NaN for a scan that had none.
            points: May be none.
            above: More of them, which the layout hides at first: the ceiling.
        """
        self._stream.set_time(TIMELINE, sequence=number)
        if np.isfinite(pose).all():
            self._add_step(number, pose)
        self._add_points(_entity(number), points)
        if above is not None:
            self._add_points(f"above/{number:06d}", above)

    def _add_step(self, number: int, pose: NDArray[np.float64]) -> None:
        """Tell where the scanner is, and the step that took it there."""
        rerun = self._rerun
        self._stream.log("scanner", rerun.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        if self._last_place is not None:
            step = np.stack([self._last_place, pose[:3, 3]])
            line = rerun.LineStrips3D([step], colors=[0xFF7A1AFF])
            self._stream.log(f"path/{number:06d}", line)
        self._last_place = pose[:3, 3].copy()

    def add_objects(self, number: int, objects: Sequence[MapObject], classes: list[int]) -> None:
        """Tell of the objects that a scan saw first: a box with the name of its class around each.

        Args:
            number: Of the scan, from 0; the time.
            objects: May be none.
            classes: Class index of each.
        """
        if not objects:
            return
        rerun = self._rerun
        turns = [
            rerun.RotationAxisAngle(axis=(0, 0, 1), degrees=item.obb_yaw_deg) for item in objects
        ]
        boxes = rerun.Boxes3D(
            centers=[item.obb_centre for item in objects],
            sizes=[item.obb_size for item in objects],
            rotation_axis_angles=turns,
            labels=[item.class_name for item in objects],
            class_ids=classes,
            show_labels=True,
        )
        about = rerun.AnyValues(
            instance=[item.id for item in objects],
            confidence=[item.confidence for item in objects],
        )
        self._stream.set_time(TIMELINE, sequence=number)
        self._stream.log(f"objects/{number:06d}", boxes, about)

    def relabel(self, number: int, points: LabelledPoints) -> None:
        """Tell the labels that the points of an earlier scan have from now on.

        Args:
            number: Of the scan that first saw them.
            points: All of that scan, in the order they were added.
        """
        classes = self._rerun.Points3D.from_fields(class_ids=points.semantic)
        self._stream.log(_entity(number), classes, self._labels(points))

    def _add_points(self, entity: str, points: LabelledPoints) -> None:
        """Tell of points at the time that is set, if there are any."""
        if len(points.xyz):
            cloud = self._rerun.Points3D(
                points.xyz, radii=self._radius, class_ids=points.semantic, colors=points.rgb
            )
            self._stream.log(entity, cloud, self._labels(points))

    def _labels(self, points: LabelledPoints) -> AnyValues:
        """Give what the viewer shows for the point under the cursor only."""
        return self._rerun.AnyValues(instance=points.instance, confidence=points.confidence)


def open_stream() -> RecordingStream:
    """Start a recording that goes nowhere yet.

    Raises:
        OutputError: Rerun is not installed.
    """
    try:
        import rerun
    except ImportError as error:
        raise OutputError(
            "Rerun is not installed; expected the extra 'rerun'; run: pip install 'mcpseg[rerun]'"
        ) from error
    return rerun.RecordingStream(_APPLICATION)


def write_recording(
    run: LabelledRun, path: Path, selection: Selection, colour_by: ColourBy = "class"
) -> int:
    """Write the chosen voxels as a recording for the Rerun viewer, with the labels they have now.

    Args:
        run: The map.
        path: The .rrd file; replaced if there, when complete.
        selection: Which voxels.
        colour_by: What colours say.

    Returns:
        How many points there are.

    Raises:
        InputError: Nothing is chosen.
        OutputError: Rerun is not installed.
        OSError: The file cannot be written.
    """
    stream = open_stream()
    points, scan = _gather(run, selection, colour_by)
    made = stream.memory_recording()

    # the points are in the order of their scans
    log = RerunLog(stream, run.classes, run.voxel_size)
    bounds = np.searchsorted(scan, np.arange(len(run.scans) + 1))
    stays = are_below_ceiling(run, points.xyz, scan)
    objects = _objects_by_scan(run, points, scan)
    for number, record in enumerate(run.scans):
        own = np.arange(bounds[number], bounds[number + 1])
        low, high = (points.select(own[stays[own] == is_low]) for is_low in (True, False))
        log.add_scan(number, record.pose, low, high)
        log.add_objects(number, *objects[number])

    # Rerun itself goes on over a full disk, and may wait for ever for its end
    stream.flush()
    write_whole(path, made.drain_as_bytes())
    return len(scan)


@contextmanager
def recording_file(stream: RecordingStream, path: Path, name: Path) -> Iterator[None]:
    """Have a stream written into a file, and see in the end that all of it is there.

    Rerun itself goes on over a full disk, and says nothing.

    Args:
        stream: It goes nowhere else.
        path: The .rrd file; replaced if there.
        name: What errors call it.

    Raises:
        OutputError: Not all of it could be written.
        OSError: The file cannot be opened.
    """
    from rerun.chunk import RrdReader
    from rerun.error_utils import RerunWarning

    with naming(path):
        path.write_bytes(b"")  # fails as a file should; Rerun's own words say less
    stream.save(path)
    try:
        yield
        stream.flush()
        stream.disconnect()
        with warnings.catch_warnings(action="error"):  # without its last part it is readable
            RrdReader(path)
    except (RuntimeError, RerunWarning) as error:
        if isinstance(error, RuntimeError) and not any(word in str(error) for word in _CUT):
            raise
        raise OutputError(
            f"{name}: could not be written to its end; expected room on the disk; "
            "make space and run the same command again"
        ) from error
    finally:
        stream.disconnect()


def _leave() -> None:
    """End the process though Rerun waits for what it could not write."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(1)


def _gather(
    run: LabelledRun, selection: Selection, colour_by: ColourBy
) -> tuple[LabelledPoints, NDArray[np.int32]]:
    """Take the chosen voxels and the scans that first saw them."""
    colour = None if colour_by == "class" else colouring(run, colour_by)
    rows = []
    for part in selection.parts(run):
        rgb = colour(part) if colour else part.rgb
        rows.append((part.xyz, part.semantic, part.instance, part.confidence, rgb, part.scan))

    xyz, semantic, instance, confidence, rgb, scan = map(np.concatenate, zip(*rows, strict=True))
    return LabelledPoints(xyz, semantic, instance, confidence, rgb if colour else None), scan


def _objects_by_scan(
    run: LabelledRun, points: LabelledPoints, scan: NDArray[np.int32]
) -> list[tuple[list[MapObject], list[int]]]:
    """List for each scan the objects that it saw first, and their classes."""
    rows = MapRows(
        points.xyz, np.zeros((len(scan), 3), np.uint8), points.semantic, points.confidence,
        points.instance, np.empty((len(scan), 0), np.int16),
    )  # fmt: skip
    ids, first = np.unique(points.instance, return_index=True)
    seen = dict(zip(ids.tolist(), scan[first].tolist(), strict=True))

    # class indices; a map without classes has none
    number = {name: index for index, name in reversed(list(enumerate(run.classes)))}
    objects: list[tuple[list[MapObject], list[int]]] = [([], []) for _ in run.scans]
    for item in list_objects(rows, run.classes):
        items, classes = objects[seen[item.id]]
        items.append(item)
        classes.append(number.get(item.class_name, UNKNOWN))
    return objects


def _layout() -> Blueprint:
    """Open on the map, without its ceiling, and beside it on what goes on around the scanner."""
    import rerun.blueprint as layout

    shown = ["+ /**", "- /above/**"]
    follow = layout.EyeControls3D(tracking_entity="/scanner")
    return layout.Blueprint(
        layout.Horizontal(
            layout.Spatial3DView(origin="/", contents=shown, name="map"),
            layout.Spatial3DView(origin="/", contents=shown, name="scanner", eye_controls=follow),
            column_shares=[3, 2],
        ),
        layout.TimePanel(timeline=TIMELINE, state="collapsed"),
        layout.BlueprintPanel(state="collapsed"),
        layout.SelectionPanel(state="collapsed"),
    )


def _entity(number: int) -> str:
    """Name the entity of the points that a scan saw first."""
    return f"map/{number:06d}"
