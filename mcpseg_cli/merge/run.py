"""A run of ``mcpseg merge``: maps of one frame become one map, in the folder of a run.

Voxels go to their columns on the disk; column by column their evidence is added and their graph
linked as far as a column alone decides it; what is left of the graph is linked as a whole; then the
columns are labelled and written. So memory holds one column, and the clusters of all.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli import __version__
from mcpseg_cli.config import EMBEDDING
from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.incremental.evidence import Evidence
from mcpseg_cli.incremental.inventory import list_by_batches
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.incremental.uniting import unite
from mcpseg_cli.merge.agreement import check_agreement, settings_from
from mcpseg_cli.merge.building_graph import BuildingGraph, Objects
from mcpseg_cli.merge.part import PartMap, names_of
from mcpseg_cli.merge.spool import Column, Spool
from mcpseg_cli.merge.united_column import EvidenceBlocks, UnitedColumn
from mcpseg_cli.resumable import exclusive
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.folder import clear_run, kept_state, prepare_empty
from mcpseg_cli.segment.map_ply import LabelledMap
from mcpseg_cli.segment.outputs import Outputs
from mcpseg_cli.segment.run_record import RunOptions

Told = Callable[[str, int, int], None]
_SCRATCH = ".merge.part"
_FILES = ("map.ply", "events.jsonl", "objects.json", "run.json", "state.sqlite")


@dataclass(frozen=True)
class Merged:
    """What a merge made.

    Attributes:
        parts: Names of the maps in it.
        empty: Folders of those left out: they have no voxel.
        scans: Scans in all.
        voxels_of_parts: Sum over the parts.
        voxels: Of the merged map.
        objects: Of the merged map.
        is_new: Whether anything was done: the folder had just this already.
    """

    parts: list[str]
    empty: list[Path]
    scans: int
    voxels_of_parts: int
    voxels: int
    objects: int
    is_new: bool


def open_parts(
    folders: Sequence[Path], transforms: dict[Path, NDArray[np.float64]]
) -> tuple[list[PartMap], list[Path]]:
    """Read what maps say of themselves, and see that they can be merged.

    Args:
        folders: Theirs, in any order.
        transforms: (4, 4) float64 by folder, for maps of another frame.

    Returns:
        Those that have a voxel, by name, and the folders of those that have none.

    Raises:
        McpsegError: They cannot be merged; says which and why.
    """
    for folder in transforms:
        if folder not in folders:
            expected = f"one of {', '.join(map(str, folders))}"
            raise InputError(f"--transform {folder}", "no map to merge", expected, "check it")
    opened = [
        PartMap.open(folder, name, transforms.get(folder))
        for folder, name in zip(folders, names_of(list(folders)), strict=True)
    ]
    parts = sorted((part for part in opened if part.num_voxels), key=lambda part: part.name)
    empty = [part.folder for part in opened if not part.num_voxels]
    if not parts:
        found, expected = "nothing but empty maps", "a map with a voxel"
        raise InputError(", ".join(map(str, folders)), found, expected, "wait for a scan")
    check_agreement(parts)
    return parts, empty


def merge_runs(
    folders: Sequence[Path],
    output: Path,
    transforms: dict[Path, NDArray[np.float64]],
    *,
    overwrite: bool = False,
    command: Sequence[str] = (),
    told: Told = lambda *_: None,
) -> Merged:
    """Merge maps; the folder of the result appears when it is complete.

    Args:
        folders: Of the maps, in any order.
        output: Folder of the merged run.
        transforms: See ``open_parts``.
        overwrite: Delete the run that is there.
        command: The command line, for the record.
        told: Called again and again: what is being done, how much is done, of how much.

    Raises:
        McpsegError: They cannot be merged, or the folder cannot be written.
        OSError: The disk is full.
    """
    parts, empty = open_parts(folders, transforms)
    if output.resolve() in {part.folder.resolve() for part in parts}:
        raise OutputError(f"{output}: one of the maps; expected another folder; choose another -o")
    with exclusive(output):
        known = _kept(output, parts)
        if known is not None:
            return _summary(parts, empty, *known, is_new=False)
        if overwrite:
            clear_run(output, [])
        prepare_empty(output)

        scratch = output / _SCRATCH
        shutil.rmtree(scratch, ignore_errors=True)
        try:
            merge = _Merge(parts, scratch, told)
            merge.write(command)
            (output / "scans").mkdir(exist_ok=True)
            for name in _FILES:
                (scratch / name).replace(output / name)
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
        return _summary(parts, empty, merge.num_voxels, merge.num_objects, is_new=True)


def _summary(
    parts: list[PartMap], empty: list[Path], voxels: int, objects: int, *, is_new: bool
) -> Merged:
    names, scans = [part.name for part in parts], sum(len(part.scans) for part in parts)
    before = sum(part.num_voxels for part in parts)
    return Merged(names, empty, scans, before, voxels, objects, is_new)


def _kept(output: Path, parts: list[PartMap]) -> tuple[int, int] | None:
    """Count voxels and objects of a folder that has just this merge; None for any other."""
    with kept_state(output) as state:
        if state is None:
            return None
        is_same = state.sources.parts() == [part.facts for part in parts]
        if not is_same or not all(scan.is_merged for scan in state.scans()):
            return None
        instance = state.instance_after(1 << 60)
        return len(instance), len(np.unique(instance[instance > 0]))


class _Merge:
    """The steps, which leave the files of the run in a folder."""

    def __init__(self, parts: list[PartMap], folder: Path, told: Told) -> None:
        self._parts, self._folder, self._told = parts, folder, told
        self._settings = settings_from(parts)
        configuration = self._settings.record.configuration
        self._intake = configuration.intake
        self._is_first = configuration.labelling == "first"
        self._classes = self._settings.record.classes
        self._graph = BuildingGraph(
            len(self._classes),
            threshold=configuration.affinity,
            least=configuration.object_voxels,
        )
        (folder / "columns").mkdir(parents=True)
        self._columns: list[Column] = []
        self.num_voxels = self.num_objects = 0

    def write(self, command: Sequence[str]) -> None:
        """Do all of it."""
        self._unite(self._spool())
        objects = self._graph.objects(lambda column: UnitedColumn.read_clusters(self._path(column)))
        self.num_objects = objects.count
        sizes = self._label(objects)
        self._describe(sizes, command)

    def _path(self, column: Column, what: str = "united") -> Path:
        return self._folder / "columns" / f"{column[0]}_{column[1]}.{what}"

    def _spool(self) -> Spool:
        """Send all voxels to their columns."""
        spool, done = Spool(self._folder / "columns"), 0
        total = sum(part.num_voxels for part in self._parts)
        for number, part in enumerate(self._parts):
            for rows in part.voxels(number):
                spool.add(rows)
                done += len(rows)
                self._told("read", done, total)
        return spool

    def _unite(self, spool: Spool) -> None:
        """Add the evidence about every voxel; cluster what a column decides alone."""
        self._columns = spool.columns
        for number, column in enumerate(self._columns, start=1):
            rows = spool.read(column)
            spool.remove(column)
            united = unite(rows, column)
            cluster = self._graph.add(column, rows, united)
            UnitedColumn.of(rows, united, cluster).write(self._path(column))
            self.num_voxels += united.num_inside
            self._told("unite", number, len(self._columns))

    def _label(self, objects: Objects) -> NDArray[np.int64]:
        """Label the voxels and write them; return (O,) int64 sizes of the objects."""
        sizes = np.zeros(objects.count + 1, np.int64)
        with (
            State(self._folder / "state.sqlite") as state,
            LabelledMap(self._folder / "map.ply", self._classes, self._intake.offset) as ply,
        ):
            self._begin(state)
            blocks = EvidenceBlocks()
            for start, column, rows, united in self._labelled(objects):
                evidence = blocks.add(united.evidence, is_last=column == self._columns[-1])
                state.add_voxels(start, rows, evidence, united.sources())
                ply.append(rows)
                sizes += np.bincount(rows.instance, minlength=len(sizes))
            ply.finish()
        return sizes

    def _labelled(self, objects: Objects) -> Iterator[tuple[int, Column, MapRows, UnitedColumn]]:
        """Label column after column; gives the id of the first voxel of each."""
        start = 0
        for number, column in enumerate(self._columns, start=1):
            united = UnitedColumn.read(self._path(column))
            instance = objects.owner[united.cluster + self._graph.first(column)]
            known = Evidence(len(self._classes))
            known.restore(united.evidence)
            prior = None if self._is_first else objects.shares[instance]
            semantic, confidence = known.labels(np.arange(len(united), dtype=np.int32), prior)

            embedding = np.zeros((len(united), EMBEDDING), np.int16)
            embedding[:, : united.embedding.shape[1]] = united.embedding
            rows = MapRows(
                united.xyz, united.rgb, semantic, confidence, instance.astype(np.int32), embedding
            )
            with self._path(column, "labelled").open("wb") as file:
                for values in (rows.xyz, rows.rgb, semantic, confidence, rows.instance):
                    np.save(file, values, allow_pickle=False)
            yield start, column, rows, united
            self._path(column).unlink()
            start += len(united)
            self._told("label", number, len(self._columns))

    def _begin(self, state: State) -> None:
        """Write what is known before the voxels."""
        first = 0
        records = []
        for part in self._parts:
            records += part.moved_scans(first, self.num_voxels)
            first += len(part.scans)
        state.set_configuration(self._settings.configuration)
        state.sources.write_parts([part.facts for part in self._parts])
        state.add_scans(records)

    def _describe(self, sizes: NDArray[np.int64], command: Sequence[str]) -> None:
        """Write what people and programs read."""
        objects = list_by_batches(self._pieces, sizes, self._classes)
        with (
            State(self._folder / "state.sqlite") as state,
            Outputs(self._folder, self._classes, RunOptions(intake=self._intake)) as outputs,
        ):
            outputs.reconcile_events([record.event for record in state.scans()])
            parts = state.sources.of_objects(state.first_instance())
            outputs.write_objects(objects, parts)
        record = self._settings.record
        record.model_copy(update={"mcpseg": __version__, "command": tuple(command)}).write(
            self._folder
        )

    def _pieces(self, first: int, last: int) -> Iterator[MapRows]:
        """Read the labelled columns that have an object of a range."""
        for column in self._columns:
            with self._path(column, "labelled").open("rb") as file:
                loaded = [np.load(file, allow_pickle=False) for _ in range(5)]
            xyz, rgb, semantic, confidence, instance = loaded
            nothing = np.empty((len(xyz), 0), np.int16)
            yield MapRows(xyz, rgb, semantic, confidence, instance, nothing)
