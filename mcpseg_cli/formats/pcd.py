"""PCD (the Point Cloud Library's format) through Open3D: ascii, binary and compressed.

Open3D only warns about damaged files, so the header is checked here first.
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats.cloud import Cloud

_MAX_HEADER = 1 << 14
_ENCODINGS = ("ascii", "binary", "binary_compressed")
_SPLIT = {
    "positions": ("x", "y", "z"),
    "colors": ("red", "green", "blue"),
    "normals": ("normal_x", "normal_y", "normal_z"),
}


def read_pcd(path: Path) -> Cloud:
    """Read a PCD file with all its fields.

    Args:
        path: The file.

    Returns:
        Its points; packed ``rgb`` becomes ``red``, ``green`` and ``blue``.

    Raises:
        InputError: A damaged header, missing coordinates or fewer points than promised.
    """
    promised = _check_header(path)
    import open3d as o3d

    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        cloud = o3d.t.io.read_point_cloud(str(path), format="pcd")
    found = len(cloud.point.positions) if "positions" in cloud.point else 0
    if found != promised:
        raise InputError(
            path,
            f"{promised:,} points promised, {found:,} readable",
            "all of them",
            "the file is damaged; copy it again",
        )
    columns: dict[str, NDArray[np.generic]] = {}
    for name in sorted(cloud.point, key=lambda name: (name != "positions", name != "colors", name)):
        array: NDArray[np.generic] = cloud.point[name].numpy()
        parts = _SPLIT.get(name, ())
        if len(parts) == array.shape[1]:
            columns |= {part: array[:, column].copy() for column, part in enumerate(parts)}
        elif array.shape[1] == 1:
            columns[name] = array[:, 0].copy()
    return Cloud(columns)


def write_pcd(path: Path, cloud: Cloud, *, encoding: str = "binary") -> None:
    """Write a cloud as PCD.

    Args:
        path: Where; its name must end in ``.pcd``.
        cloud: The points; every attribute becomes a field.
        encoding: ``ascii``, ``binary`` or ``binary_compressed``.

    Raises:
        OutputError: The file cannot be written.
    """
    import open3d as o3d

    columns = dict(cloud.columns)
    target = o3d.t.geometry.PointCloud()
    for name, parts in _SPLIT.items():
        if all(part in columns for part in parts):
            joined = np.stack([columns.pop(part) for part in parts], axis=1)
            target.point[name] = o3d.core.Tensor(joined.astype(_storable(joined.dtype)))
    for name, column in columns.items():
        target.point[name] = o3d.core.Tensor(np.ascontiguousarray(column.astype(_storable(column.dtype))[:, None]))
    options = {"write_ascii": encoding == "ascii", "compressed": encoding == "binary_compressed"}
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        if not o3d.t.io.write_point_cloud(str(path), target, **options):
            raise OutputError(f"{path}: cannot be written; free space or choose another folder")


def _storable(dtype: np.dtype[np.generic]) -> np.dtype[np.generic]:
    return np.dtype(np.uint8) if dtype == np.bool_ else dtype.newbyteorder("=")


def _check_header(path: Path) -> int:
    """Return how many points the header promises, having checked that the rest of the file can hold them."""
    data = path.read_bytes()
    match = re.search(rb"^DATA\s+(\S+)[^\n]*\n", data[:_MAX_HEADER], re.MULTILINE)
    if match is None:
        raise InputError(path, "no DATA line", "a PCD header", "the file is cut short or not PCD; copy it again")
    lines = data[: match.start()].decode("latin-1").splitlines()
    header = {words[0]: words[1:] for words in map(str.split, lines) if words and not words[0].startswith("#")}
    encoding = match.group(1).decode("latin-1")
    if encoding not in _ENCODINGS:
        raise InputError(path, f"DATA {encoding}", f"one of {', '.join(_ENCODINGS)}", "convert the file")
    try:
        fields, sizes = header["FIELDS"], [int(size) for size in header["SIZE"]]
        counts = [int(count) for count in header.get("COUNT", ["1"] * len(fields))]
        points = int(header["POINTS"][0])
        if not len(fields) == len(sizes) == len(counts) == len(header["TYPE"]) or min([points, *sizes, *counts]) < 0:
            raise ValueError("counts")
    except (KeyError, ValueError, IndexError) as error:
        raise InputError(
            path, "a header that does not add up", "FIELDS, SIZE, TYPE, COUNT and POINTS", "export it again"
        ) from error
    missing = [axis for axis in "xyz" if axis not in fields]
    if missing:
        raise InputError(path, f"no field {', '.join(missing)}", "x, y and z", "export the cloud with coordinates")
    stride = sum(size * count for size, count in zip(sizes, counts, strict=True))
    found = _available(data[match.end() :], encoding, stride)
    if found < points:
        raise InputError(
            path, f"{points:,} points promised, {found:,} found", f"{points:,}", "the file is cut short; copy it again"
        )
    return points


def _available(body: bytes, encoding: str, stride: int) -> int:
    """Count the points a file's body has room for."""
    if encoding == "ascii":
        return sum(1 for line in body.split(b"\n") if line.strip())
    if encoding == "binary":
        return len(body) // max(stride, 1)
    compressed, size = np.frombuffer(body[:8].ljust(8, b"\0"), "<u4")
    return int(size) // max(stride, 1) if len(body) - 8 >= compressed else 0
