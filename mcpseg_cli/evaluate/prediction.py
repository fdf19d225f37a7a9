"""What is scored: the map of a run, or one labelled cloud."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.classes import remap_table
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import read_cloud
from mcpseg_cli.formats.labels import check_classes, confidence_column, point_labels
from mcpseg_cli.formats.recording import MAX_COORDINATE

_DEFAULT_VOXEL = 0.1  # metres; points pair within half a voxel when the map does not say its size


@dataclass(frozen=True)
class Answer:
    """What is scored: the map of a run, or one labelled cloud.

    Attributes:
        source: The file.
        unit: What its points are, ``voxel`` or ``point``.
        xyz: (N, 3) metres, map frame.
        semantic: (N,) uint8 class, 255 unknown.
        instance: (N,) int32 object, 0 none.
        confidence: (N,) float64, if it has one.
        classes: Class table; empty when the file does not say.
        voxel_size: Metres.
    """

    source: Path
    unit: str
    xyz: NDArray[np.floating]
    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]
    confidence: NDArray[np.float64] | None
    classes: tuple[str, ...]
    voxel_size: float

    def classes_in(self, table: tuple[str, ...]) -> NDArray[np.uint8]:
        """Return the (N,) classes in another table, matched by name; a file without table is taken to have this one.

        Raises:
            InputError: The other table lacks a class.
        """
        if not self.classes or self.classes == table:
            check_classes(self.semantic, table, self.source)
            return self.semantic
        if set(self.classes) - set(table):
            found = f"classes {', '.join(self.classes)}"
            raise InputError(
                self.source,
                found,
                f"those of the first run: {', '.join(table)}",
                "score it by itself",
            )
        return remap_table(self.classes, table)[self.semantic]


def read_answer(output: Path) -> Answer:
    """Read what is to be scored.

    Args:
        output: Folder of a run, or a labelled cloud.

    Raises:
        InputError: Nothing there, damaged, or without labels.
        OSError: It cannot be read.
    """
    if not output.exists():
        raise InputError(
            output, "no such file or folder", "a run or a labelled cloud", "check the path"
        )
    path = output / "map.ply" if output.is_dir() else output
    if not path.is_file():
        raise InputError(
            output,
            "no map.ply",
            "a folder that 'mcpseg segment' wrote, or one cloud",
            "check the path",
        )
    cloud = read_cloud(path)
    _check_extent(cloud.xyz, path)
    semantic, instance = point_labels(cloud, path)
    return Answer(
        path,
        "voxel" if output.is_dir() else "point",
        cloud.xyz,
        semantic,
        instance,
        confidence_column(cloud, path),
        cloud.classes,
        _voxel_size(output),
    )


def _check_extent(xyz: NDArray[np.floating], source: Path) -> None:
    """Refuse points so far apart that they cannot be one map in metres."""
    extent = float(np.ptp(xyz.astype(np.float64), axis=0).max())
    if extent > 2 * MAX_COORDINATE:
        found, expected = f"points {extent:.6g} m apart", f"at most {2 * MAX_COORDINATE:.6g} m"
        raise InputError(
            source, found, expected, "check for stray points, or convert millimetres to metres"
        )


def _voxel_size(output: Path) -> float:
    """Read the voxel size of a run."""
    path = output / "run.json"
    if not path.is_file():
        return _DEFAULT_VOXEL
    try:
        size = float(json.loads(path.read_text())["configuration"]["voxel_size"])
        if not 0.0 < size < np.inf:
            raise ValueError(size)
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            path, "no voxel size", "a run.json that mcpseg wrote", "run mcpseg segment again"
        ) from error
    return size
