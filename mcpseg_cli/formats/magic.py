"""What a file is by how it begins, for messages about files that are something else."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path

_BEGINNINGS = (
    (b"ply", "PLY"),
    (b"LASF", "LAS or LAZ"),
    (b"ASTM-E57", "E57"),
    (b"#ROSBAG V2.0", "a ROS 1 bag"),
    (b"\x89MCAP", "MCAP"),
    (b"SQLite format 3", "SQLite, as ROS 2 bags are"),
    (b"\x89HDF", "HDF5"),
    (b"# .PCD", "PCD"),
    (b"VERSION", "PCD"),
    (b"PK\x03\x04", "a ZIP or NPZ archive"),
    (b"\x93NUMPY", "a single numpy array (.npy)"),
    (b"\x1f\x8b", "compressed by gzip"),
    (b"(\xb5/\xfd", "compressed by zstd"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"glTF", "a glTF model"),
    (b"version https://git-lfs", "a pointer of Git LFS; fetch the file itself"),
    (b"<", "XML or a web page"),
)
_LONGEST = 32


def recognise(path: Path, before: str = "") -> str:
    """Say what a file is by its first bytes.

    Args:
        path: The file; need not exist.
        before: What to put in front.

    Returns:
        ``it is E57``; nothing where it is not known.
    """
    try:
        with path.open("rb") as file:
            head = file.read(_LONGEST)
    except OSError:
        return ""
    for beginning, kind in _BEGINNINGS:
        if head.startswith(beginning):
            return f"{before}it is {kind}"
    return ""


def saw(names: Iterable[str], wanted: Iterable[str]) -> str:
    """List the names that a file has, and the nearest to those that it lacks.

    Args:
        names: What is there.
        wanted: What was looked for.
    """
    there = list(names)
    listed = ", ".join(there[:12]) + (", …" if len(there) > 12 else "")
    lowered = {name.lower(): name for name in reversed(there)}
    for name in wanted:
        near = get_close_matches(name.lower(), list(lowered), n=1)
        near = near or [other for other in lowered if name.lower() in other]
        if near:
            return f"{listed}; nearest is {lowered[near[0]]}"
    return listed or "none"
