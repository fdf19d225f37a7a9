"""A labelled map as a cloud in parts, for any of the cloud formats."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import ColourBy
from mcpseg_cli.export.colours import colouring
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.formats import Cloud, write_parts
from mcpseg_cli.formats.intake import Intake
from mcpseg_cli.segment.labelled_run import LabelledRun, MapPart

_COLOURS = ("red", "green", "blue")
# CloudCompare loads PLY properties of this prefix as scalar fields, others only when asked to
_SCALAR = "scalar_"


class MapCloud:
    """The chosen voxels of a run as cloud parts; nothing but one part is ever held.

    Args:
        run: The map.
        selection: Which of its voxels.
        colour_by: What colours say.
        label_prefix: In front of ``semantic``, ``instance`` and ``confidence``.

    Raises:
        InputError: Nothing is chosen.
    """

    def __init__(
        self,
        run: LabelledRun,
        selection: Selection,
        colour_by: ColourBy = "rgb",
        label_prefix: str = "",
    ) -> None:
        self._run = run
        self._selection = selection
        self._colour = colouring(run, colour_by)
        self._prefix = label_prefix
        selection.check(run)
        if len(self) == 0:
            raise selection.nothing_chosen(run)

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Cloud]:
        for part in self._chosen():
            cloud = as_cloud(part, self._colour, self._run.classes, self._prefix)
            yield in_recording(cloud, self._run.intake)

    @cached_property
    def _count(self) -> int:
        return len(self._run) if self._selection.is_everything else sum(map(len, self._chosen()))

    def _chosen(self) -> Iterator[MapPart]:
        """Iterate over what is chosen of each part, where that is anything."""
        for part in self._run.parts():
            if self._selection.is_everything:
                yield part
            elif (chosen := self._selection.mask(part, self._run.classes)).any():
                yield part.select(chosen)


def as_cloud(
    part: MapPart,
    colour: Callable[[MapPart], NDArray[np.uint8]],
    classes: tuple[str, ...],
    label_prefix: str = "",
) -> Cloud:
    """Make a cloud of some voxels, with the attributes of map.ply.

    Args:
        part: The voxels.
        colour: From ``colours.colouring``.
        classes: Names that ``semantic`` indexes.
        label_prefix: In front of ``semantic``, ``instance`` and ``confidence``.
    """
    rgb = colour(part)
    columns: dict[str, NDArray[np.generic]] = {
        axis: part.xyz[:, place] for place, axis in enumerate("xyz")
    }
    columns |= {name: rgb[:, place] for place, name in enumerate(_COLOURS)}
    columns[f"{label_prefix}semantic"] = part.semantic
    columns[f"{label_prefix}instance"] = part.instance
    columns[f"{label_prefix}confidence"] = part.confidence
    return Cloud(columns, classes)


def in_recording(cloud: Cloud, intake: Intake) -> Cloud:
    """Return a cloud of the map where the recording has it: in its axes, unit and offset.

    Args:
        cloud: In the map's frame.
        intake: How the recording was taken; where it was as it is, the cloud is returned.
    """
    if intake.is_plain:
        return cloud
    xyz = intake.to_recording(cloud.xyz)
    return replace(cloud, columns=cloud.columns | dict(zip("xyz", xyz.T, strict=True)))


def label_prefix_for(path: Path) -> str:
    """Return what stands before the names of labels in a file of this ending."""
    return _SCALAR if path.suffix.lower() == ".ply" else ""


def write_map(
    run: LabelledRun, path: Path, selection: Selection, colour_by: ColourBy = "rgb"
) -> int:
    """Write the chosen voxels as a cloud file, part by part.

    Args:
        run: The map.
        path: A .ply, .las, .laz, .pcd, .npz, .h5 or .e57 file; replaced if there.
        selection: Which voxels.
        colour_by: What their colours say.

    Returns:
        How many points there are.

    Raises:
        InputError: Nothing is chosen.
        OutputError: The format needs a package that is not installed.
        OSError: The disk is full or the folder not writable.
    """
    cloud = MapCloud(run, selection, colour_by, label_prefix_for(path))
    write_parts(path, cloud)
    return len(cloud)
