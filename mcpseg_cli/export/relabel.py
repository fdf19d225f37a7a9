"""Input scans with the labels of the final map: original points and attributes in their order."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats import write_cloud
from mcpseg_cli.formats.recording import ScanFile, read_scan
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.scan import Labels
from mcpseg_cli.segment.labelled_run import LabelledRun

_UNKNOWN = Labels(np.array([255], np.uint8), np.zeros(1, np.int32), np.zeros(1, np.float32))


def check_scans(run: LabelledRun, scans: Path) -> list[ScanFile]:
    """Find the scans of a run, unchanged, in a folder.

    Args:
        run: The run.
        scans: The folder its scans were read from, or a copy of it.

    Returns:
        The scans that were labelled, in order; those that were skipped are left out.

    Raises:
        InputError: One is missing or not the file that was labelled.
    """
    files = []
    for record in run.scans:
        if record.error is None and not record.is_merged:
            path = scans / record.name
            if not path.is_file():
                expected = f"the scans of {run.folder}"
                raise InputError(path, "no such scan", expected, "name the folder of its input")
            if not record.file.matches(path):
                expected = f"the scan as {run.folder} was made from it"
                raise InputError(path, "changed since it was labelled", expected, "restore it")
            files.append(ScanFile(path, record.pose))
    if not files:
        expected, remedy = "scans of its own", "give the runs that it was merged from"
        raise InputError(run.folder, "a map of merged runs", expected, remedy)
    return files


def relabel_scans(run: LabelledRun, scans: Path, folder: Path) -> Iterator[Path]:
    """Write every input scan with the final map's labels, under its name and in its format.

    Every point in a voxel of the map has that voxel's labels, also where the point was out of range
    in its own scan; points outside the map carry semantic 255, instance 0 and confidence 0.

    Args:
        run: The map; all of it is held, some 70 bytes a voxel.
        scans: The folder its scans were read from.
        folder: Where to write; made if not there.

    Yields:
        Each file written.

    Raises:
        InputError: A scan is missing, changed or damaged.
        OutputError: The folder is that of the input.
        OSError: The disk is full or the folder not writable.
    """
    if folder.resolve() == scans.resolve():
        raise OutputError(
            f"{folder}: holds the input scans; expected another folder; choose another -o"
        )
    sources = check_scans(run, scans)

    # the whole map as a look-up table, and the labels of its voxels
    voxel_size, frame = float(str(run.settings["voxel_size"])), run.settings["frame"]
    voxels, labels = VoxelMap(voxel_size), []
    for part in run.parts():
        voxels.restore(part.xyz, part.rgb)
        labels.append(Labels(part.semantic, part.instance, part.confidence))
    known = _joined([*labels, _UNKNOWN], run.classes)

    # every scan by itself
    folder.mkdir(exist_ok=True)
    for source in sources:
        scan, cloud = read_scan(source, "sensor" if frame == "sensor" else "map", voxel_size)
        ids = voxels.find(scan.xyz)  # -1 finds the last row
        path = folder / source.path.name
        write_cloud(path, cloud.with_labels(_taken(known, ids)))
        yield path


def _joined(labels: list[Labels], classes: tuple[str, ...]) -> Labels:
    return Labels(
        np.concatenate([item.semantic for item in labels]),
        np.concatenate([item.instance for item in labels]),
        np.concatenate([item.confidence for item in labels]),
        classes,
    )


def _taken(labels: Labels, ids: NDArray[np.int32]) -> Labels:
    return Labels(
        labels.semantic[ids], labels.instance[ids], labels.confidence[ids], labels.classes
    )
