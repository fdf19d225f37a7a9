"""The prediction that is scored: the map of a run, or one labelled cloud."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import UNKNOWN, remap_table
from mcpseg_cli.errors import InputError, NoPointsError
from mcpseg_cli.evaluate.class_map import ClassMap
from mcpseg_cli.evaluate.run_folder import RunFolder
from mcpseg_cli.formats import Cloud, read_measured
from mcpseg_cli.formats.intake import Intake
from mcpseg_cli.formats.labels import (
    USUAL,
    LabelFields,
    check_classes,
    confidence_column,
    point_labels,
)
from mcpseg_cli.formats.recording import MAX_COORDINATE

_DEFAULT_VOXEL = 0.1  # metres; points pair within half a voxel when the map does not say its size


@dataclass(frozen=True)
class Prediction:
    """What is scored: the map of a run, or one labelled cloud.

    Attributes:
        source: The file.
        folder: The run it belongs to; None for one cloud.
        xyz: (N, 3) metres, map frame.
        semantic: (N,) uint8 class in ``classes``, 255 unknown.
        instance: (N,) int32 object, 0 none.
        confidence: (N,) float64, if it has one.
        classes: Class table that was asked for, else the file's; empty when there is neither.
        is_named: Whether the file names its classes.
        lookup: (256,) uint8 class in ``classes`` for every class of the file.
        labels: Class names of the file.
        unmapped: Those that a class map gives no class, with their points; they are unknown.
    """

    source: Path
    folder: RunFolder | None
    xyz: NDArray[np.floating]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]
    confidence: NDArray[np.float64] | None
    classes: tuple[str, ...]
    is_named: bool
    lookup: NDArray[np.uint8]
    labels: tuple[str, ...]
    unmapped: dict[str, int]

    @property
    def output(self) -> Path:
        """What the user named: the run's folder, or the cloud."""
        return self.folder.path if self.folder else self.source

    @property
    def intake(self) -> Intake:
        """How the recording became this map; as it was, of one cloud."""
        return self.folder.configuration.intake if self.folder else Intake()

    @property
    def unit(self) -> str:
        """What its points are, ``voxel`` or ``point``."""
        return "voxel" if self.folder else "point"

    @property
    def voxel_size(self) -> float:
        """Edge of a voxel, metres."""
        return self.folder.configuration.voxel_size if self.folder else _DEFAULT_VOXEL


def read_prediction(
    output: Path,
    classes: tuple[str, ...] = (),
    class_map: ClassMap | None = None,
    fields: LabelFields = USUAL,
) -> Prediction:
    """Read what is to be scored.

    Args:
        output: Folder of a run, or a labelled cloud.
        classes: Class table to score it in, matched by name; by default its own. A file without
            class names is taken to have this one.
        class_map: What its classes stand for; ``classes`` is that of the map then.
        fields: Which attributes of a cloud are its labels; a map has those of mcpseg.

    Raises:
        InputError: Nothing there, damaged, without labels, with a class that ``classes`` lacks, or
            without any that the map has.
        OSError: It cannot be read.
    """
    # the cloud, and the run it belongs to
    path = _find_cloud(output)
    cloud = _read(path, is_map=output.is_dir())
    _check_extent(cloud.xyz, path)
    folder = RunFolder.read(output) if output.is_dir() else None
    fields = USUAL if folder or cloud.label("semantic") is not None else fields

    # its classes, in the table asked for
    own, instance = point_labels(cloud, path, fields=fields)
    if class_map is not None:
        lookup, classes = _mapped(cloud.classes, class_map, path), class_map.classes
    else:
        lookup = _look_up(cloud.classes, classes, path)
    points = np.bincount(own, minlength=256)
    unmapped = {
        name: int(points[index])
        for index, name in enumerate(cloud.classes)
        if class_map is not None and lookup[index] == UNKNOWN
    }
    if classes:
        check_classes(lookup[own], classes, path)

    return Prediction(
        source=path,
        folder=folder,
        xyz=cloud.xyz,
        semantic=lookup[own],
        instance=instance,
        confidence=confidence_column(cloud, path),
        classes=classes or cloud.classes,
        is_named=bool(cloud.classes),
        lookup=lookup,
        labels=cloud.classes,
        unmapped=unmapped,
    )


def _find_cloud(output: Path) -> Path:
    """Return the cloud to read: a run's map, or what is named."""
    if not output.exists():
        expected = "a run or a labelled cloud"
        raise InputError(output, "no such file or folder", expected, "check the path")
    path = output / "map.ply" if output.is_dir() else output
    if not path.is_file():
        expected = "a folder that 'mcpseg segment' wrote, or one cloud"
        raise InputError(output, "no map.ply", expected, "check the path")
    return path


def _read(path: Path, *, is_map: bool) -> Cloud:
    """Read a cloud; of the map of a run without a voxel, say what that means."""
    try:
        return read_measured(path).measured()
    except NoPointsError as error:
        if not is_map:
            raise
        remedy = "wait for a scan, or see that scans lie within --range of their poses"
        raise InputError(path, "no labelled voxel yet", "a labelled map", remedy) from error


def _check_extent(xyz: NDArray[np.floating], source: Path) -> None:
    """Refuse points so far apart that they cannot be one map in metres."""
    extent = float(np.ptp(xyz.astype(np.float64), axis=0).max())
    if extent > 2 * MAX_COORDINATE:
        found, expected = f"points {extent:.6g} m apart", f"at most {2 * MAX_COORDINATE:.6g} m"
        remedy = "check for stray points, or convert millimetres to metres"
        raise InputError(source, found, expected, remedy)


def _mapped(own: tuple[str, ...], class_map: ClassMap, source: Path) -> NDArray[np.uint8]:
    """Return the (256,) uint8 table from a file's classes to those of a class map."""
    lookup = class_map.look_up(own, source)
    if (lookup == UNKNOWN).all():
        found, expected = f"classes {', '.join(own)}", f"some that {class_map.source} has"
        raise InputError(source, found, expected, "add rows for them")
    return lookup


def _look_up(own: tuple[str, ...], classes: tuple[str, ...], source: Path) -> NDArray[np.uint8]:
    """Return the (256,) uint8 table from a file's classes to those asked for."""
    if not own or not classes or own == classes:
        return np.arange(256, dtype=np.uint8)
    if set(own) - set(classes):
        found, expected = (
            f"classes {', '.join(own)}",
            f"those of the first run: {', '.join(classes)}",
        )
        raise InputError(source, found, expected, "score it by itself")
    return remap_table(own, classes)
