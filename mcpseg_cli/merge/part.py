"""A map that is to be merged: what it was made with and of, and its voxels as they are now."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError, StateError
from mcpseg_cli.formats.recording import MAX_COORDINATE
from mcpseg_cli.grid import voxel_of
from mcpseg_cli.incremental.evidence import BLOCK
from mcpseg_cli.incremental.map_rows import COLUMNS, MapRows
from mcpseg_cli.incremental.uniting import FORWARD, PartVoxels, move_evidence
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.scan import to_map_frame
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.events import MergedEvent
from mcpseg_cli.segment.run_record import RunRecord
from mcpseg_cli.segment.scan_record import ScanRecord
from mcpseg_cli.segment.sources import Part

_CHUNK = 1 << 16  # voxels read at a time: whole blocks of evidence
_EXPECTED = "the folder of a run of 'mcpseg segment' or 'mcpseg merge'"


@dataclass(frozen=True)
class PartMap:
    """A map on the disk.

    Attributes:
        folder: Its run's.
        name: What the merged map calls it.
        transform: (4, 4) float64 from its frame into that of the merged map; None: the same.
        record: What its run.json says.
        configuration: What its checkpoint was made with; nothing for one without scans.
        scans: Those that it has points of, in order.
        num_voxels: In it.
    """

    folder: Path
    name: str
    transform: NDArray[np.float64] | None
    record: RunRecord
    configuration: dict[str, object]
    scans: list[ScanRecord]
    num_voxels: int

    @classmethod
    def open(cls, folder: Path, name: str, transform: NDArray[np.float64] | None) -> PartMap:
        """Read all but the voxels.

        Raises:
            InputError: Not the folder of a run.
            StateError: The run is in progress, or its checkpoint damaged.
        """
        if not (folder / "state.sqlite").is_file():
            raise InputError(folder, "no state.sqlite", _EXPECTED, "check the path")
        record = RunRecord.read(folder)
        with State(folder / "state.sqlite") as state:
            configuration, records = state.configuration() or {}, state.scans()
        num_voxels = records[-1].num_voxels if records else 0
        scans = [each for each in records if each.error is None and each.num_points]
        return cls(folder, name, transform, record, configuration, scans, num_voxels)

    @property
    def facts(self) -> Part:
        """What the merged map keeps of it."""
        digest = hashlib.sha256("".join(sorted(each.file.sha256 for each in self.scans)).encode())
        numbers = None if self.transform is None else tuple(self.transform.ravel().tolist())
        return Part(self.name, digest.hexdigest(), len(self.scans), self.num_voxels, numbers)

    def moved_scans(self, first: int, num_voxels: int) -> list[ScanRecord]:
        """Describe its scans as those of the merged map.

        Args:
            first: Number of the first.
            num_voxels: Voxels of the merged map.
        """
        moved = []
        for number, scan in enumerate(self.scans, start=first):
            name, pose, floor = f"{self.name}/{scan.name}", scan.pose, scan.floor
            if self.transform is not None:
                if floor is not None:
                    floor = float(self.transform[2] @ [*pose[:2, 3], floor, 1.0])
                pose = self.transform @ pose
            event = MergedEvent(number, name, scan.num_points, self.name)
            moved.append(
                replace(
                    scan, name=name, pose=pose, floor=floor, num_voxels=num_voxels, event=event,
                    output_size=0,
                )
            )  # fmt: skip
        return moved

    def voxels(self, number: int) -> Iterator[PartVoxels]:
        """Iterate over its voxels, many at a time, in the frame of the merged map.

        Args:
            number: What ``PartVoxels.part`` calls it.

        Raises:
            StateError: Damaged, or without evidence.
            InputError: The transform takes voxels too far out.
        """
        path = self.folder / "state.sqlite"
        with State(path) as state:
            instance = state.instance_after(1 << 60)
            pieces = self._pieces(state)
            if self.transform is not None:
                pieces = self._moved(list(pieces))
            start = 0
            for voxel, rows, evidence in pieces:
                owner = instance[start : start + len(rows)]
                part = np.full(len(rows), number, np.int32)
                embedding = _trimmed(rows.embedding)
                yield PartVoxels(voxel, part, rows.xyz, rows.rgb, embedding, evidence, owner)
                start += len(rows)

    def _pieces(
        self, state: State
    ) -> Iterator[tuple[NDArray[np.int32], MapRows, NDArray[np.uint16]]]:
        """Read voxels, rows and evidence side by side."""
        evidence = state.evidence()
        width = len(self.record.classes) + 2 * len(FORWARD) + 1
        for rows in _even_pieces(state.first_rows()):
            blocks = list(islice(evidence, -(-len(rows) // BLOCK)))
            known = np.concatenate(blocks) if blocks else np.empty((0, 0), np.uint16)
            if known.shape != (len(rows), width):
                raise StateError(
                    f"{state.path}: no evidence about all voxels; expected that of {width:,} "
                    "columns; segment the recording again"
                )
            yield voxel_of(rows.xyz, self.record.configuration.voxel_size), rows, known

    def _moved(
        self, pieces: list[tuple[NDArray[np.int32], MapRows, NDArray[np.uint16]]]
    ) -> Iterator[tuple[NDArray[np.int32], MapRows, NDArray[np.uint16]]]:
        """Move the whole map; who is next to whom afterwards, all voxels decide."""
        assert self.transform is not None
        size = self.record.configuration.voxel_size
        before = VoxelMap(size)
        for _, rows, _ in pieces:
            before.restore(rows.xyz, rows.rgb)
        xyz = to_map_frame(before.xyz, self.transform)
        if not np.abs(xyz).max(initial=0) < MAX_COORDINATE:
            found = f"voxels at {np.abs(xyz).max():.6g} m after the transform"
            expected = f"less than {MAX_COORDINATE:.6g} m"
            raise InputError(self.folder, found, expected, "check the transform")

        voxel = voxel_of(xyz, size)
        neighbours = before.neighbours(np.arange(len(before), dtype=np.int32))
        evidence = np.concatenate([known for _, _, known in pieces])
        evidence = move_evidence(voxel, neighbours, evidence)
        start = 0
        for _, rows, _ in pieces:
            part = slice(start, start + len(rows))
            yield voxel[part], replace(rows, xyz=xyz[part]), evidence[part]
            start += len(rows)


def _even_pieces(parts: Iterator[MapRows]) -> Iterator[MapRows]:
    """Cut rows into pieces of one length; the last may be shorter."""
    waiting: list[MapRows] = []
    count = 0
    for part in parts:
        waiting.append(part)
        count += len(part)
        if count < _CHUNK:
            continue
        joined = _joined(waiting)
        whole = count - count % _CHUNK
        yield from (joined.part(slice(at, at + _CHUNK)) for at in range(0, whole, _CHUNK))
        waiting, count = [joined.part(slice(whole, count))], count - whole
    if count:
        yield _joined(waiting)


def _joined(parts: list[MapRows]) -> MapRows:
    return MapRows(*(np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS))


def _trimmed(embedding: NDArray[np.int16]) -> NDArray[np.int16]:
    """Leave out the last columns where they are zero: networks use as many as they need."""
    used = np.flatnonzero(embedding.any(axis=0))
    return embedding[:, : used[-1] + 1 if len(used) else 0]


def names_of(folders: list[Path]) -> list[str]:
    """Name maps by their folders, and by the folders around these where two have the same."""
    words = [folder.resolve().parts for folder in folders]
    for length in range(1, max(map(len, words)) + 1):
        names = ["/".join(each[-length:]) for each in words]
        if len(set(names)) == len(set(words)):
            break
    return names
