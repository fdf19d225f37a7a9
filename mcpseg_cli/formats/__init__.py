"""Point-cloud and pose files: one module per format, dispatched by the file's ending."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats.cloud import Cloud, checked, mark_valid
from mcpseg_cli.formats.parts import CloudParts, OnePart
from mcpseg_cli.formats.steady import steady_file
from mcpseg_cli.resumable import whole_file
from mcpseg_cli.scan import Labels

CLOUD_SUFFIXES = (".ply", ".las", ".laz", ".npz", ".pcd")
READ_ONLY_SUFFIXES = (".bin", ".xyz", ".pts", ".asc", ".txt")


def read_cloud(path: Path) -> Cloud:
    """Read a point cloud file of any supported format.

    Args:
        path: A .ply, .las, .laz, .npz or .pcd file; a .bin of KITTI or nuScenes, or text: .xyz,
            .pts, .asc or .txt.

    Returns:
        At least one point, with finite coordinates and every attribute of the file.

    Raises:
        InputError: The file is damaged, empty, of another format, or has NaN coordinates.
        OSError: The file cannot be opened.
    """
    return checked(path, _read(path))


def read_measured(path: Path) -> Cloud:
    """Read a point cloud file as a sensor left it, with pixels that saw nothing.

    Args:
        path: As for ``read_cloud``.

    Returns:
        All points; ``valid`` tells which are measured: finite, and neither withheld nor noise.

    Raises:
        InputError: As for ``read_cloud``, but for NaN coordinates; no point is measured.
        OSError: The file cannot be opened.
    """
    return mark_valid(path, _read(path))


def _read(path: Path) -> Cloud:
    """Read a file by its ending."""
    suffix = path.suffix.lower()
    if suffix == ".ply":
        from mcpseg_cli.formats.ply import read_ply as read
    elif suffix == ".npz":
        from mcpseg_cli.formats.npz import read_npz as read
    elif suffix in (".las", ".laz"):
        from mcpseg_cli.formats.las import read_las as read
    elif suffix == ".pcd":
        from mcpseg_cli.formats.pcd import read_pcd as read
    elif suffix == ".bin":
        from mcpseg_cli.formats.lidar_bin import read_bin as read
    elif suffix in READ_ONLY_SUFFIXES:
        from mcpseg_cli.formats.text_cloud import read_text as read
    else:
        from mcpseg_cli.formats.magic import recognise

        found = f"a file ending in {suffix or 'nothing'!r}{recognise(path, ', ')}"
        expected = ", ".join((*CLOUD_SUFFIXES, *READ_ONLY_SUFFIXES))
        raise InputError(path, found, expected, "convert it")
    return read(path)


def write_cloud(path: Path, cloud: Cloud) -> None:
    """Write a point cloud file; it appears under its name only when complete.

    Args:
        path: A .ply, .las, .laz, .npz or .pcd file; its folder must exist; replaced if there.
        cloud: The points with every attribute to write.

    Raises:
        OutputError: The format is not supported, or has no room for an attribute.
        OSError: The disk is full or the folder not writable; nothing is left under ``path``'s name.
    """
    with whole_cloud(path, cloud):
        pass


def write_parts(path: Path, parts: CloudParts) -> None:
    """Write a point cloud file part by part, so that memory does not grow with the cloud.

    Args:
        path: As for ``write_cloud``, or a .h5 or .e57 file.
        parts: The points with every attribute to write.

    Raises:
        OutputError: As for ``write_cloud``; pye57 is not installed, or cannot write.
        OSError: As for ``write_cloud``.
    """
    if path.suffix.lower() == ".h5":
        from mcpseg_cli.formats.cloud_h5 import write_cloud_h5

        with steady_file(path) as file:
            write_cloud_h5(file, parts)
    else:
        with whole_file(path) as partial:
            _write(path, partial, parts)


@contextmanager
def whole_cloud(path: Path, cloud: Cloud, *, is_durable: bool = False) -> Iterator[Path]:
    """Write a point cloud file that gets its name when the block ends without an error.

    Args:
        path: As for ``write_cloud``.
        cloud: As for ``write_cloud``.
        is_durable: As for ``whole_file``.

    Yields:
        The complete file under its temporary name.

    Raises:
        OutputError: As for ``write_cloud``.
        OSError: As for ``write_cloud``; nothing is left behind.
    """
    suffix = path.suffix.lower()
    if suffix not in CLOUD_SUFFIXES:
        raise OutputError(
            f"{path}: cannot write {suffix or 'nothing'!r}; "
            f"expected {', '.join(CLOUD_SUFFIXES)}; rename it"
        )
    with whole_file(path, is_one_of_many=True, is_durable=is_durable) as partial:
        _write(path, partial, OnePart(cloud))
        yield partial


def _write(path: Path, partial: Path, parts: CloudParts) -> None:
    """Write parts under a temporary name; errors name the file."""
    try:
        if path.suffix.lower() == ".e57":
            _write_e57(partial, parts)
        else:
            _write_stream(partial, parts)
    except OutputError as error:
        raise OutputError(f"{path}: {error}") from error


def _write_e57(path: Path, parts: CloudParts) -> None:
    try:
        from mcpseg_cli.formats.e57 import write_e57
    except ModuleNotFoundError as error:
        raise OutputError(
            "needs pye57; expected it installed; pip install 'mcpseg[e57]'"
        ) from error
    write_e57(path, parts)


def _write_stream(path: Path, parts: CloudParts) -> None:
    """Write one of the formats; all go through a Python file, so that a full disk is an OSError."""
    suffix = path.suffix.lower()
    with path.open("wb") as file:
        if suffix == ".ply":
            from mcpseg_cli.formats.ply import write_ply

            write_ply(file, parts)
        elif suffix == ".npz":
            from mcpseg_cli.formats.npz import write_npz

            write_npz(file, parts)
        elif suffix == ".pcd":
            from mcpseg_cli.formats.pcd import write_pcd

            write_pcd(file, parts)
        else:
            from mcpseg_cli.formats.las import write_las

            write_las(file, parts, compress=suffix == ".laz")


__all__ = [
    "CLOUD_SUFFIXES",
    "READ_ONLY_SUFFIXES",
    "Cloud",
    "CloudParts",
    "Labels",
    "read_cloud",
    "read_measured",
    "whole_cloud",
    "write_cloud",
    "write_parts",
]
