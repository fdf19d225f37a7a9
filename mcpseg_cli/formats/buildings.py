"""Labelled buildings, from whatever holds one: an S3DIS folder, an HDF5 file, a labelled cloud."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.building import Building
from mcpseg_cli.classes import S3DIS_CLASSES, UNKNOWN
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import CLOUD_SUFFIXES, Cloud, read_cloud
from mcpseg_cli.formats.hdf5 import read_building_h5
from mcpseg_cli.formats.s3dis import Progress, read_area

HDF5_SUFFIXES = (".h5", ".hdf5")
_GREY = 128
_FARTHEST = 16384.0  # metres; float32 steps are 1 mm to here


def read_building(
    path: Path,
    cache: Path | None = None,
    progress: Progress | None = None,
    threads: int = 2,
    *,
    use_cache: bool = True,
) -> tuple[Building, tuple[str, ...]]:
    """Read a labelled building.

    Args:
        path: A folder in the S3DIS layout (``s3dis.read_area``), a .h5 or .hdf5 file
            (``hdf5.read_building_h5``), or one .ply, .las, .laz, .npz or .pcd cloud with
            ``semantic`` (class index, 255 or -1 unknown) and ``instance`` (object id, 0 or less
            none) for every point. A cloud that names no classes has the 13 of S3DIS.
        cache: Folder of the S3DIS cache; the area's own by default.
        progress: Told how far reading S3DIS text has come.
        threads: S3DIS files read at once.
        use_cache: False neither reads nor writes the S3DIS cache.

    Returns:
        The building, and a line for each thing the user should know.

    Raises:
        InputError: Not a labelled building, damaged, or more than 16,384 m from the origin.
        OSError: A file cannot be read.
    """
    notices: tuple[str, ...] = ()
    if path.is_dir():
        building, report = read_area(path, cache, progress, threads, use_cache=use_cache)
        notices = report.notices()
    elif path.suffix.lower() in HDF5_SUFFIXES:
        building = read_building_h5(path)
    elif not path.exists():
        raise InputError(path, "no such file or folder", "a labelled building", "check the path")
    elif path.suffix.lower() in CLOUD_SUFFIXES:
        building, notices = _from_cloud(path, read_cloud(path))
    else:
        endings = ", ".join((*HDF5_SUFFIXES, *CLOUD_SUFFIXES))
        raise InputError(
            path,
            f"a file ending in {path.suffix or 'nothing'!r}",
            f"a folder, {endings}",
            "convert it",
        )
    _check_extent(path, building.xyz)
    return building, notices


def _from_cloud(path: Path, cloud: Cloud) -> tuple[Building, tuple[str, ...]]:
    """Take a labelled cloud for a building without rooms."""
    notices = []
    classes = cloud.classes or S3DIS_CLASSES
    if len(classes) > UNKNOWN:
        raise InputError(path, f"{len(classes)} classes", f"at most {UNKNOWN}", "merge classes")
    semantic = _integers(path, cloud, "semantic")
    if semantic is None:
        remedy = "label it, or name a file that is labelled"
        raise InputError(path, "no attribute semantic", "a class index for every point", remedy)
    semantic = np.where(semantic == -1, UNKNOWN, semantic)
    wrong = (semantic < 0) | ((semantic >= len(classes)) & (semantic != UNKNOWN))
    if wrong.any():
        point = int(wrong.argmax())
        expected = f"0 to {len(classes) - 1}, or {UNKNOWN} for unknown"
        raise InputError(
            path, f"class {semantic[point]} (point {point:,})", expected, "give it its class table"
        )
    instance = _integers(path, cloud, "instance")
    if instance is None:
        notices.append("no attribute instance; every point has object 0 (none)")
        instance = np.zeros(len(cloud), np.int64)
    elif instance.max() > np.iinfo(np.int32).max:
        raise InputError(
            path,
            f"object {instance.max()}",
            f"at most {np.iinfo(np.int32).max}",
            "number objects from 1",
        )
    rgb = cloud.rgb
    if rgb is None:
        notices.append("no colour; every point is grey")
        rgb = np.full((len(cloud), 3), _GREY, np.uint8)
    xyz = cloud.xyz
    _check_extent(path, xyz)
    labels = np.maximum(instance, 0).astype(np.int32)
    return Building(xyz.astype(np.float32), rgb, semantic.astype(np.uint8), labels, classes), tuple(
        notices
    )


def _integers(path: Path, cloud: Cloud, name: str) -> NDArray[np.int64] | None:
    """Return a label attribute as int64, or None if the cloud has none."""
    column = cloud.label(name)
    if column is None:
        return None
    if column.ndim != 1 or column.dtype.kind not in "biuf":
        raise InputError(
            path,
            f"{name} {column.dtype} {column.shape}",
            "an integer for every point",
            "label it again",
        )
    with np.errstate(invalid="ignore"):
        whole = (
            np.ones(len(column), bool) if column.dtype.kind in "bi" else np.abs(column) < 2.0**62
        )
        integers = np.where(whole, column, 0).astype(np.int64)
        whole &= integers == column
    if not whole.all():
        point = int((~whole).argmax())
        raise InputError(
            path,
            f"{name} {column[point]} (point {point:,})",
            "an integer for every point",
            "label it again",
        )
    return integers


def _check_extent(path: Path, xyz: NDArray[np.floating]) -> None:
    """Refuse coordinates that float32 cannot hold to the millimetre."""
    farthest = max(abs(float(xyz.min())), abs(float(xyz.max())))
    if farthest > _FARTHEST:
        raise InputError(
            path,
            f"coordinates up to {farthest:,.0f} m",
            f"a map frame within {_FARTHEST:,.0f} m of its origin",
            "subtract an offset from all points, and check for stray ones",
        )
