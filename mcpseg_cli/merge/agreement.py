"""Which maps can be merged: of one network, one voxel size, evidence that adds, every scan once."""

from __future__ import annotations

from mcpseg_cli.errors import McpsegError
from mcpseg_cli.merge.part import PartMap
from mcpseg_cli.resumable import check_same

_DECISIVE = (
    "voxel_size", "weights", "method", "labelling", "clustering", "affinity", "object_voxels",
    "offset", "up", "scale", "pose_scale",
)  # fmt: skip


def check_agreement(parts: list[PartMap]) -> None:
    """Refuse maps that cannot be one.

    Args:
        parts: Those with a voxel.

    Raises:
        McpsegError: A map has no evidence that could be added.
        StateError: Two were made otherwise.
    """
    for part in parts:
        _check_evidence(part)
    for part in parts[1:]:
        kept, asked = (
            {name: each.configuration.get(name) for name in _DECISIVE} for each in (parts[0], part)
        )
        first, remedy = parts[0].folder, "segment both recordings with the same"
        check_same(first, kept, asked, remedy=f"{part.folder} is otherwise; {remedy}")
        check_same(
            first, {"classes": list(parts[0].record.classes)},
            {"classes": list(part.record.classes)}, remedy=f"{part.folder} has others",
            names={"classes": "class table"},
        )  # fmt: skip
    _check_scans(parts)


def _check_evidence(part: PartMap) -> None:
    """Refuse methods whose maps do not add."""
    found, expected = "", "a map of the U-Net with --clustering graph, whose evidence adds"
    if part.configuration.get("offline"):
        found = "labelled offline, which keeps no evidence"
    elif part.record.method != "unet":
        found = f"labelled by {part.record.method}, which keeps a first embedding, no affinities"
    elif part.configuration.get("clustering") != "graph":
        found = "objects of --clustering paper, where one edge decides and nothing is added"
    if found:
        raise McpsegError(
            f"{part.folder}: {found}; expected {expected}; segment the recording with it"
        )


def _check_scans(parts: list[PartMap]) -> None:
    """Refuse what would be counted twice."""
    known: dict[str, tuple[PartMap, str]] = {}
    for part in parts:
        for scan in part.scans:
            other, name = known.setdefault(scan.file.sha256, (part, scan.name))
            if other is not part:
                raise McpsegError(
                    f"{part.folder}: scan {scan.name} is {name} of {other.folder}; "
                    "expected every scan in one map; leave one of the two out"
                )


def settings_from(parts: list[PartMap]) -> PartMap:
    """Choose the map whose other settings the merged one continues with: that of most voxels."""
    return max(reversed(parts), key=lambda part: part.num_voxels)
