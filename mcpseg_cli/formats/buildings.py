"""Labelled buildings, from whatever holds one: an S3DIS folder, an HDF5 file, a labelled cloud."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.building import Building
from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import CLOUD_SUFFIXES, Cloud, read_measured
from mcpseg_cli.formats.hdf5 import read_building_h5
from mcpseg_cli.formats.labels import USUAL, LabelFields, find_label, point_labels
from mcpseg_cli.formats.mesh_building import MeshOptions, read_mesh_building
from mcpseg_cli.formats.meshes import MESH_SUFFIXES, is_mesh
from mcpseg_cli.formats.s3dis import Progress, read_area
from mcpseg_cli.scan import GREY

HDF5_SUFFIXES = (".h5", ".hdf5")
_HIGHEST = 150.0  # metres
_SOME_FLOOR = 100  # points of the floor that say how it lies
_STANDING = 5.0  # times as high as thick: a floor that stands upright
_FARTHEST = 16384.0  # metres; float32 steps are 1 mm to here


def read_building(
    path: Path,
    cache: Path | None = None,
    progress: Progress | None = None,
    threads: int = 2,
    *,
    use_cache: bool = True,
    fields: LabelFields = USUAL,
    mesh: MeshOptions | None = None,
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
        fields: Which attributes of a cloud are its labels.
        mesh: How to take meshes (``read_mesh_building``); None: they are no buildings.

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
    elif mesh is not None and is_mesh(path):
        building, notices = read_mesh_building(path, mesh)
    elif path.suffix.lower() in CLOUD_SUFFIXES:
        building, notices = _from_cloud(path, read_measured(path), fields)
    else:
        found = f"a file ending in {path.suffix or 'nothing'!r}"
        meshes = MESH_SUFFIXES if mesh else ()
        known = dict.fromkeys((*HDF5_SUFFIXES, *CLOUD_SUFFIXES, *meshes))
        expected = f"a folder, {', '.join(known)}"
        raise InputError(path, found, expected, "convert it")

    _check_extent(path, building.xyz)
    return building, notices


def _from_cloud(path: Path, cloud: Cloud, fields: LabelFields) -> tuple[Building, tuple[str, ...]]:
    """Take a labelled cloud for a building without rooms."""
    # points that are none
    notices = []
    if cloud.valid is not None:
        count = f"{int((~cloud.valid).sum()):,} points"
        notices.append(f"{count} without coordinates, withheld or of noise are left out")
        cloud = cloud.measured()

    # labels, of which object ids may be missing
    classes = cloud.classes or S3DIS_CLASSES
    labelled = cloud
    if find_label(cloud, "instance", path, fields.instance) is None:
        notices.append("no attribute instance; every point has object 0 (none)")
        none = np.zeros(len(cloud), np.int32)
        labelled = replace(cloud, columns=cloud.columns | {"instance": none})
    semantic, instance = point_labels(labelled, path, classes, fields)

    # what else a building has
    rgb = cloud.rgb
    if rgb is None:
        notices.append("no colour; every point is grey")
        rgb = np.full((len(cloud), 3), GREY, np.uint8)
    xyz = cloud.xyz
    _check_extent(path, xyz)
    _check_upright(path, xyz, semantic, classes)
    return Building(xyz.astype(np.float32), rgb, semantic, instance, classes), tuple(notices)


def _check_upright(
    path: Path, xyz: NDArray[np.floating], semantic: NDArray[np.uint8], classes: tuple[str, ...]
) -> None:
    """Refuse buildings that are too high for metres, or whose floor stands upright."""
    low, high = np.quantile(xyz.astype(np.float64), [0.01, 0.99], axis=0)
    height = float(high[2] - low[2])
    if height > _HIGHEST:
        found, expected = f"a building {height:,.0f} m high", f"metres, {_HIGHEST:g} at most"
        raise InputError(path, found, expected, "convert millimetres or centimetres to metres")

    floor = xyz[semantic == classes.index("floor")] if "floor" in classes else xyz[:0]
    if len(floor) < _SOME_FLOOR:
        return
    extent = np.ptp(np.quantile(floor.astype(np.float64), [0.1, 0.9], axis=0), axis=0)
    if extent[2] > _STANDING * max(extent.min(), 0.1) and extent[2] > _STANDING / 2:
        found = (
            f"a floor that lies flat in {'xyz'[int(extent.argmin())]} and {extent[2]:.1f} m high"
        )
        raise InputError(path, found, "z up", "turn the building so that z points up")


def _check_extent(path: Path, xyz: NDArray[np.floating]) -> None:
    """Refuse coordinates that float32 cannot hold to the millimetre."""
    farthest = max(abs(float(xyz.min())), abs(float(xyz.max())))
    if farthest > _FARTHEST:
        found = f"coordinates up to {farthest:,.0f} m"
        expected = f"a map frame within {_FARTHEST:,.0f} m of its origin"
        remedy = "subtract an offset from all points, and check for stray ones"
        raise InputError(path, found, expected, remedy)
