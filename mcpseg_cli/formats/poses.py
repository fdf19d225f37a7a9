"""Poses: where the sensor was, as read from any pose file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError


@dataclass(frozen=True)
class Poses:
    """Where the sensor was, row by row.

    Attributes:
        poses: (P, 4, 4) float64, sensor to map, metres; NaN in rows without a pose.
        scans: Names of scans or of files of the same moment by row, or None.
        stamps: (P,) float64 seconds, from any origin, or None.
        ids: (P,) int64 numbers that count something: scans perhaps, or the tool's own nodes; None.
        has_rotation: False when the file gave positions only.
        lost: Why a row has no pose, by row.
        columns: How the file was understood, in words.
    """

    poses: NDArray[np.float64]
    scans: tuple[str, ...] | None = None
    stamps: NDArray[np.float64] | None = None
    ids: NDArray[np.int64] | None = None
    has_rotation: bool = True
    lost: Mapping[int, str] = field(default_factory=dict)
    columns: str = ""

    def __len__(self) -> int:
        return len(self.poses)

    def select(self, rows: NDArray[np.intp]) -> Poses:
        """Return some rows, in the order given."""
        lost = {new: self.lost[old] for new, old in enumerate(rows.tolist()) if old in self.lost}
        scans = None if self.scans is None else tuple(self.scans[row] for row in rows)
        stamps = None if self.stamps is None else self.stamps[rows]
        ids = None if self.ids is None else self.ids[rows]
        return Poses(self.poses[rows], scans, stamps, ids, self.has_rotation, lost, self.columns)


def read_poses(path: Path, scans: Path | None = None, *, is_growing: bool = False) -> Poses:
    """Read a pose file, whose kind is told by what is in it.

    Args:
        path: A table (CSV with a header, TUM, EuRoC, KITTI, RTAB-Map, NavVis, 4 x 4 matrices a
            row), 4 x 4 blocks (Open3D ``.log``), COLMAP's ``images.txt``, g2o, JSON (Record3D,
            ARKit, Polycam, ``transforms.json``), a ``.npy`` array, or a folder with a file a pose.
        scans: Folder of the scans; a KITTI ``calib.txt`` may lie beside it.
        is_growing: Another program is writing the file; a line that has no end yet is left out.

    Returns:
        At least one row with a pose.

    Raises:
        InputError: Names the line and column at fault.
        OSError: The file cannot be opened.
    """
    poses = _read(path, is_growing=is_growing)
    if len(poses.lost) == len(poses):
        found = f"{len(poses):,} rows without a pose ({next(iter(poses.lost.values()))})"
        raise InputError(path, found, "numbers", "export it again with tracking")

    # poses of a camera become those of the lidar that it is calibrated to
    if poses.columns.startswith("KITTI"):
        from mcpseg_cli.formats.pose_files.kitti import to_lidar

        return to_lidar(poses, path, scans)
    return poses


def _read(path: Path, *, is_growing: bool) -> Poses:
    """Read a file of one of the kinds."""
    from mcpseg_cli.formats.pose_files import blocks, graphs, json_poses, table, text

    if path.is_dir():
        return blocks.read_folder(path)
    if path.suffix.lower() == ".npy":
        return blocks.read_array(path)
    if path.name.lower() == "images.bin":
        remedy = "convert it: colmap model_converter --output_type TXT"
        raise InputError(path, "COLMAP's binary images", "its images.txt", remedy)

    content = text.read_text(path)
    if is_growing and not content.endswith("\n"):
        content = content[: content.rfind("\n") + 1]
    if content.lstrip()[:1] in ("{", "["):
        return json_poses.read_json(path, content)

    data, comments = text.split_comments(content)
    if not data:
        remedy = "give a CSV, TUM or KITTI pose file"
        raise InputError(path, "no poses", "a line for each scan", remedy)
    if graphs.is_g2o(data):
        return graphs.read_g2o(path, data)
    if graphs.is_colmap(comments, data):
        return graphs.read_colmap(path, content)
    if blocks.are_blocks(data):
        return blocks.read_blocks(path, data)
    return table.read_table(path, data, comments)
