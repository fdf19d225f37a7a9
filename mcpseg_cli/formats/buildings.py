"""Labelled buildings, from whatever holds one: an S3DIS folder, an HDF5 file, a labelled cloud."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.building import Building
from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import CLOUD_SUFFIXES, Cloud, read_cloud
from mcpseg_cli.formats.hdf5 import read_building_h5
from mcpseg_cli.formats.labels import point_labels
from mcpseg_cli.formats.mesh_building import MeshOptions, read_mesh_building
from mcpseg_cli.formats.meshes import MESH_SUFFIXES, is_mesh
from mcpseg_cli.formats.s3dis import Progress, read_area
from mcpseg_cli.scan import GREY

HDF5_SUFFIXES = (".h5", ".hdf5")
_FARTHEST = 16384.0  # metres; float32 steps are 1 mm to here


def read_building(
    path: Path,
    cache: Path | None = None,
    progress: Progress | None = None,
    threads: int = 2,
    *,
    use_cache: bool = True,
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
        building, notices = _from_cloud(path, read_cloud(path))
    else:
        found = f"a file ending in {path.suffix or 'nothing'!r}"
        meshes = MESH_SUFFIXES if mesh else ()
        known = dict.fromkeys((*HDF5_SUFFIXES, *CLOUD_SUFFIXES, *meshes))
        expected = f"a folder, {', '.join(known)}"
        raise InputError(path, found, expected, "convert it")

    _check_extent(path, building.xyz)
    return building, notices


def _from_cloud(path: Path, cloud: Cloud) -> tuple[Building, tuple[str, ...]]:
    """Take a labelled cloud for a building without rooms."""
    # labels, of which object ids may be missing
    notices = []
    classes = cloud.classes or S3DIS_CLASSES
    labelled = cloud
    if cloud.label("instance") is None:
        notices.append("no attribute instance; every point has object 0 (none)")
        none = np.zeros(len(cloud), np.int32)
        labelled = replace(cloud, columns=cloud.columns | {"instance": none})
    semantic, instance = point_labels(labelled, path, classes)

    # what else a building has
    rgb = cloud.rgb
    if rgb is None:
        notices.append("no colour; every point is grey")
        rgb = np.full((len(cloud), 3), GREY, np.uint8)
    xyz = cloud.xyz
    _check_extent(path, xyz)
    return Building(xyz.astype(np.float32), rgb, semantic, instance, classes), tuple(notices)


def _check_extent(path: Path, xyz: NDArray[np.floating]) -> None:
    """Refuse coordinates that float32 cannot hold to the millimetre."""
    farthest = max(abs(float(xyz.min())), abs(float(xyz.max())))
    if farthest > _FARTHEST:
        found = f"coordinates up to {farthest:,.0f} m"
        expected = f"a map frame within {_FARTHEST:,.0f} m of its origin"
        remedy = "subtract an offset from all points, and check for stray ones"
        raise InputError(path, found, expected, remedy)
