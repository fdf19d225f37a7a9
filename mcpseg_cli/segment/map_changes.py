"""What a scan changed of what was known before, as the checkpoint keeps it."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.incremental.evidence import HUNDREDTHS
from mcpseg_cli.incremental.regrouping import Moves

_ROW = 6  # bytes of a changed label: 4 of its id, class, confidence
_MOVE = 8  # bytes of a moved voxel: 4 of its id, 4 of its object


@dataclass(frozen=True)
class LabelChanges:
    """Labels that voxels have from some scan on, until another changes them.

    Attributes:
        ids: (Q,) int32 voxels, ascending.
        semantic: (Q,) uint8 class index.
        confidence: (Q,) float32 in 0-1, in hundredths.
    """

    ids: NDArray[np.int32]
    semantic: NDArray[np.uint8]
    confidence: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.ids)

    def are_within(self, num_voxels: int) -> bool:
        """Tell whether the voxels are in order, none twice, and of a map of so many."""
        return are_within(self.ids, num_voxels)

    def packed(self) -> bytes:
        """Compress: the steps from id to id are small, and labels repeat."""
        hundredths = np.round(self.confidence * HUNDREDTHS).astype(np.uint8)
        columns = (_planes(_steps(self.ids)), self.semantic.tobytes(), hundredths.tobytes())
        return zlib.compress(b"".join(columns), 1)

    @classmethod
    def unpacked(cls, data: bytes) -> LabelChanges:
        """Read what ``packed`` gave.

        Raises:
            ValueError: It is something else.
        """
        columns = _columns(data, _ROW)
        confidence = columns[5].astype(np.float32) / np.float32(HUNDREDTHS)
        ids = np.cumsum(_numbers(columns[:4]), dtype=np.int32)
        return cls(ids, columns[4], confidence)

    def apply(self, semantic: NDArray[np.uint8], confidence: NDArray[np.float32]) -> None:
        """Change the labels of a map: (V,) each, in place."""
        semantic[self.ids], confidence[self.ids] = self.semantic, self.confidence


def packed_moves(moves: Moves) -> bytes:
    """Compress voxels and the objects they went to."""
    return zlib.compress(_planes(_steps(moves.ids)) + _planes(moves.instance), 1)


def unpacked_moves(data: bytes) -> Moves:
    """Read what ``packed_moves`` gave.

    Raises:
        ValueError: It is something else.
    """
    columns = _columns(data, _MOVE)
    ids = np.cumsum(_numbers(columns[:4]), dtype=np.int32)
    return Moves(ids, _numbers(columns[4:]).astype(np.int32))


def are_within(ids: NDArray[np.int32], num_voxels: int) -> bool:
    """Tell whether voxels are in order, none twice, and of a map of so many."""
    return bool((np.diff(ids, prepend=np.int32(-1), append=num_voxels) > 0).all())


def _steps(ids: NDArray[np.int32]) -> NDArray[np.int32]:
    return np.diff(ids, prepend=np.int32(0))


def _planes(numbers: NDArray[np.int32]) -> bytes:
    """Put bytes of one weight together: nearly all of the higher ones are 0."""
    return numbers.astype("<u4").view(np.uint8).reshape(-1, 4).T.tobytes()


def _columns(data: bytes, count: int) -> NDArray[np.uint8]:
    try:
        raw = zlib.decompress(data)
    except zlib.error as error:
        raise ValueError(str(error)) from error
    return np.frombuffer(raw, np.uint8).reshape(count, -1)


def _numbers(planes: NDArray[np.uint8]) -> NDArray[np.uint32]:
    numbers: NDArray[np.uint32] = np.ascontiguousarray(planes.T).view("<u4")[:, 0]
    return numbers


@dataclass(frozen=True)
class MapChanges:
    """All that a scan changed, beside the voxels that it added.

    Attributes:
        merges: (P, 2) int32 objects that merged: old id, surviving id.
        moves: Voxels known before that went to another object otherwise.
        labels: Those of voxels known before.
        evidence: Rows of whole blocks by number, see ``Evidence.blocks``; none for methods whose
            first looks count alone.
    """

    merges: NDArray[np.int32]
    moves: Moves
    labels: LabelChanges
    evidence: Mapping[int, NDArray[np.uint16]]

    @classmethod
    def none(cls) -> MapChanges:
        """Return those of a scan that changed nothing."""
        nobody = np.empty(0, np.int32)
        labels = LabelChanges(nobody, np.empty(0, np.uint8), np.empty(0, np.float32))
        return cls(np.empty((0, 2), np.int32), Moves(nobody, nobody), labels, {})
