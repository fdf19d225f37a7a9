"""Input scans with the labels of the final map: original points and attributes in their order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats import write_cloud
from mcpseg_cli.formats.intake import Intake
from mcpseg_cli.formats.recording import (
    ScanFile,
    ScanSource,
    TopicChoice,
    list_recording,
    read_scan,
)
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.resumable import remove_abandoned
from mcpseg_cli.scan import Labels
from mcpseg_cli.segment.labelled_run import LabelledRun
from mcpseg_cli.segment.outputs import labelled_name

_UNKNOWN = Labels(np.array([255], np.uint8), np.zeros(1, np.int32), np.zeros(1, np.float32))


def check_scans(run: LabelledRun, scans: Path) -> Sequence[ScanSource]:
    """Find the scans of a run, unchanged, in their recording.

    Args:
        run: The run.
        scans: The recording its scans were read from, or a copy of it.

    Returns:
        The scans that were labelled, in order; those that were skipped are left out.

    Raises:
        InputError: One is missing or not the file that was labelled.
    """
    used = [record for record in run.scans if record.error is None and not record.is_merged]
    sources = _sources(run, scans, [record.name for record in used])
    found: list[ScanSource] = []
    for record in used:
        source = sources.get(record.name)
        if source is None:
            expected = f"the scans of {run.folder}"
            remedy = "name the folder of its input"
            raise InputError(scans / record.name, "no such scan", expected, remedy)
        if not source.is_still(record.file):
            expected = f"the scan as {run.folder} was made from it"
            raise InputError(source.path, "changed since it was labelled", expected, "restore it")
        found.append(source.with_pose(record.pose))
    if not found:
        expected, remedy = "scans of its own", "give the runs that it was merged from"
        raise InputError(run.folder, "a map of merged runs", expected, remedy)
    return found


def _sources(run: LabelledRun, scans: Path, names: Sequence[str]) -> dict[str, ScanSource]:
    """Find scans by name: files of a folder, else what another recording holds."""
    files = [scans / name for name in names if (scans / name).is_file()]
    if files or not names:
        sources = [ScanFile(path, None, scans) for path in files]
        return {source.name: source for source in sources}
    topic = run.settings.get("topic")
    recording = list_recording(scans, TopicChoice(scans=str(topic) if topic else None))
    return {source.name: source for source in recording}


def relabel_scans(run: LabelledRun, scans: Path, folder: Path) -> Iterator[Path]:
    """Write every input scan with the final map's labels, under its name and in its format.

    Every point in a voxel of the map has that voxel's labels, also where the point was out of range
    in its own scan; points outside the map carry semantic 255, instance 0 and confidence 0.

    Args:
        run: The map; all of it is held, some 70 bytes a voxel.
        scans: The recording its scans were read from.
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
    voxel_size, intake = float(str(run.settings["voxel_size"])), Intake.of(run.settings)
    voxels, labels = VoxelMap(voxel_size), []
    for part in run.parts():
        voxels.restore(part.xyz, part.rgb)
        labels.append(Labels(part.semantic, part.instance, part.confidence))
    known = _joined([*labels, _UNKNOWN], run.classes)

    # every scan by itself
    folder.mkdir(exist_ok=True)
    remove_abandoned(folder)
    for source in sources:
        scan, cloud = read_scan(source, intake, voxel_size)
        ids = voxels.find(scan.xyz)  # -1 finds the last row
        path = folder / labelled_name(source.name, None)
        path.parent.mkdir(parents=True, exist_ok=True)
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
