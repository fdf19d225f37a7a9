"""The prediction that is scored: the map of a run, or one labelled cloud."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import remap_table
from mcpseg_cli.errors import InputError, NoPointsError
from mcpseg_cli.evaluate.run_folder import RunFolder
from mcpseg_cli.formats import Cloud, read_cloud
from mcpseg_cli.formats.labels import check_classes, confidence_column, point_labels
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

    @property
    def output(self) -> Path:
        """What the user named: the run's folder, or the cloud."""
        return self.folder.path if self.folder else self.source

    @property
    def unit(self) -> str:
        """What its points are, ``voxel`` or ``point``."""
        return "voxel" if self.folder else "point"

    @property
    def voxel_size(self) -> float:
        """Edge of a voxel, metres."""
        return self.folder.configuration.voxel_size if self.folder else _DEFAULT_VOXEL


def read_prediction(output: Path, classes: tuple[str, ...] = ()) -> Prediction:
    """Read what is to be scored.

    Args:
        output: Folder of a run, or a labelled cloud.
        classes: Class table to score it in, matched by name; by default its own. A file without
            class names is taken to have this one.

    Raises:
        InputError: Nothing there, damaged, without labels, or with a class that ``classes`` lacks.
        OSError: It cannot be read.
    """
    # the cloud, and the run it belongs to
    path = _find_cloud(output)
    cloud = _read(path, is_map=output.is_dir())
    _check_extent(cloud.xyz, path)
    folder = RunFolder.read(output) if output.is_dir() else None

    # its classes, in the table asked for
    own, instance = point_labels(cloud, path)
    lookup = _look_up(cloud.classes, classes, path)
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
        return read_cloud(path)
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
