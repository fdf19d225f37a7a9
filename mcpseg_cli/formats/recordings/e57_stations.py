"""E57 (ASTM E2807) through pye57: each station is a scan, with its own pose."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pye57 import E57, ScanHeader, libe57

from mcpseg_cli.choices import Frame
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.claims import check_claim
from mcpseg_cli.formats.cloud import Cloud, checked
from mcpseg_cli.formats.fingerprint import Fingerprint
from mcpseg_cli.formats.recordings.stations import station_names
from mcpseg_cli.formats.rigid import from_quaternion
from mcpseg_cli.formats.scan_source import Placeable

_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_COLOUR = ("colorRed", "colorGreen", "colorBlue")
_INVALID = ("cartesianInvalidState", "sphericalInvalidState")
_BYTES = {**dict.fromkeys(_INVALID, 1), "intensity": 4}  # of a point; of all others 8 at most


@dataclass(frozen=True)
class E57Station(Placeable):
    """One station of an E57 file.

    Attributes:
        name: The file's name and the station's.
        path: The file.
        pose: (4, 4) float64, sensor to map; None where the station has none.
        number: Its place in the file.
        stamp: When it began, seconds of GPS time.
        frame: ``sensor`` for stations with a pose, which their points are to be moved by.
        lost: Why it has no pose, where it is known.
    """

    name: str
    path: Path
    pose: NDArray[np.float64] | None
    number: int
    stamp: float | None
    frame: Frame | None
    lost: str = ""

    def read(self) -> Cloud:
        """Read its points; those without a valid return are dropped."""
        with _opened(self.path) as file:
            header = file.get_header(self.number)
            columns = _read_columns(self.path, header, file)
            limits = _colour_limits(header)
        return checked(self.path, Cloud(_as_cloud(self.path, columns, limits)))

    def fingerprint(self) -> Fingerprint:
        """Take the fingerprint of its points."""
        with _opened(self.path) as file:
            columns = _read_columns(self.path, file.get_header(self.number), file)
        content = [part for name in sorted(columns) for part in (name.encode(), columns[name].data)]
        return Fingerprint.of_part(self.path, content)

    def is_still(self, kept: Fingerprint) -> bool:
        """Tell whether its points are still what they were."""
        return kept.is_untouched(self.path) or self.fingerprint().sha256 == kept.sha256


def list_e57(path: Path) -> list[E57Station]:
    """List the stations of an E57 file.

    Args:
        path: The file.

    Raises:
        InputError: It is damaged, has no station, or a pose that is none.
    """
    with _opened(path) as file:
        headers = [file.get_header(number) for number in range(file.scan_count)]
        titles = [_text(header, "name") for header in headers]
        poses = [_pose(path, header) for header in headers]
        stamps = [_stamp(header) for header in headers]
    if not headers:
        raise InputError(path, "no scan", "an E57 file of one station or more", "export it again")

    names = station_names(path, titles)
    return [
        E57Station(names[n], path, poses[n], n, stamps[n], None if poses[n] is None else "sensor")
        for n in range(len(headers))
    ]


@contextmanager
def _opened(path: Path) -> Iterator[E57]:
    """Open a file; what libE57 says of damage becomes one line."""
    try:
        with E57(str(path)) as file:
            yield file
    except libe57.E57Exception as error:
        found = f"libE57: {' '.join(str(error).partition('****')[0].split())[:120]}"
        raise InputError(path, found, "a whole E57 file", "export or copy it again") from error


def _text(header: ScanHeader, name: str) -> str:
    return str(header[name].value()) if header.node.isDefined(name) else ""


def _pose(path: Path, header: ScanHeader) -> NDArray[np.float64] | None:
    """Return where a station stands."""
    if not header.has_pose():
        return None
    pose = np.eye(4)
    node = header.node["pose"]
    if node.isDefined("translation"):
        pose[:3, 3] = [node["translation"][axis].value() for axis in "xyz"]
    if node.isDefined("rotation"):
        quaternion = [float(node["rotation"][part].value()) for part in "xyzw"]
        return from_quaternion(path, pose[:3, 3].tolist(), quaternion, "a station")
    return pose


def _stamp(header: ScanHeader) -> float | None:
    """Return when a station began; None where nothing was written there."""
    if not header.node.isDefined("acquisitionStart"):
        return None
    return float(header.acquisitionStart_dateTimeValue) or None


def _colour_limits(header: ScanHeader) -> tuple[float, float] | None:
    """Return the least and largest value of a colour; None where the file does not say."""
    if not header.node.isDefined("colorLimits"):
        return None
    limits = header.node["colorLimits"]
    low, high = limits["colorRedMinimum"].value(), limits["colorRedMaximum"].value()
    return (float(low), float(high)) if high > low else None


def _read_columns(path: Path, header: ScanHeader, file: E57) -> dict[str, NDArray[np.generic]]:
    """Read what is known of the attributes of all points, by name."""
    buffers, columns = libe57.VectorSourceDestBuffer(), {}
    prototype = libe57.StructureNode(header.points.prototype())
    wanted = (*_CARTESIAN, *_SPHERICAL, *_COLOUR, *_INVALID, "intensity")
    names = [name for name in wanted if name in header.point_fields]
    claim = f"{header.point_count:,} points"
    check_claim(path, claim, header.point_count * sum(_BYTES.get(name, 8) for name in names))
    for name in names:
        columns[name] = np.empty(header.point_count, _type_of(prototype, name))
        buffers.append(
            libe57.SourceDestBuffer(
                file.image_file, name, columns[name], header.point_count, True, True
            )
        )
    reader = header.points.reader(buffers)
    reader.read()
    reader.close()
    return columns


def _type_of(prototype: libe57.StructureNode, name: str) -> type[np.generic]:
    """Return the type that an attribute is read as."""
    node = prototype[name]
    if name in _INVALID:
        return np.int8
    is_single = isinstance(node, libe57.FloatNode) and node.precision() == libe57.E57_SINGLE
    return np.float32 if is_single or name == "intensity" else np.float64


def _as_cloud(
    path: Path, columns: dict[str, NDArray[np.generic]], limits: tuple[float, float] | None
) -> dict[str, NDArray[np.generic]]:
    """Make attributes of a cloud from those of E57."""
    num_points = len(next(iter(columns.values()), ()))
    valid = np.ones(num_points, bool)
    for name in set(_INVALID) & set(columns):
        valid &= columns[name] == 0
    known = {name: column[valid] for name, column in columns.items()}

    if set(_CARTESIAN) <= set(known):
        cloud = {axis: known[name] for axis, name in zip("xyz", _CARTESIAN, strict=True)}
    elif set(_SPHERICAL) <= set(known):
        with np.errstate(over="ignore", invalid="ignore"):  # what is no number is no point
            reach, azimuth, elevation = (known[name].astype(np.float64) for name in _SPHERICAL)
            across = reach * np.cos(elevation)
            x, y = across * np.cos(azimuth), across * np.sin(azimuth)
            cloud = {"x": x, "y": y, "z": reach * np.sin(elevation)}
    else:
        found, expected = f"points of {', '.join(columns)[:80]}", "cartesian or spherical points"
        raise InputError(path, found, expected, "export it again")

    if set(_COLOUR) <= set(known):
        low, high = limits or (0.0, 255.0)
        for name, source in zip(("red", "green", "blue"), _COLOUR, strict=True):
            with np.errstate(over="ignore", invalid="ignore"):
                share = (known[source].astype(np.float64) - low) / (high - low)
            if np.isnan(share).any():
                raise InputError(path, f"{source} that is no number", "colours", "export it again")
            cloud[name] = np.clip(np.rint(255 * share), 0, 255).astype(np.uint8)
    if "intensity" in known:
        cloud["intensity"] = known["intensity"]
    return cloud
