"""PTX: stations one after another as text, each with its size, its pose and its grid of points."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Frame
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.cloud import Cloud, checked
from mcpseg_cli.formats.fingerprint import Fingerprint
from mcpseg_cli.formats.magic import recognise
from mcpseg_cli.formats.recordings.stations import station_names
from mcpseg_cli.formats.rigid import check_rotations
from mcpseg_cli.formats.scan_source import Placeable
from mcpseg_cli.formats.text_cloud import parse_numbers

_COLUMNS = {
    3: ("x", "y", "z"),
    4: ("x", "y", "z", "intensity"),
    7: ("x", "y", "z", "intensity", "red", "green", "blue"),
}
_BRIGHTEST = 255
_WHOLE = "a whole PTX file: columns, rows, position, axes, 4 x 4 matrix, points"


@dataclass(frozen=True)
class PtxStation(Placeable):
    """One station of a PTX file.

    Attributes:
        name: The file's name, and its number where there are several.
        path: The file.
        pose: (4, 4) float64, sensor to map, of its header.
        begin: Where its points begin, bytes.
        end: Where they end, bytes.
        lost: Why it has no pose, where it is known.
    """

    name: str
    path: Path
    pose: NDArray[np.float64] | None
    begin: int
    end: int

    stamp: float | None = None
    frame: Frame | None = "sensor"
    lost: str = ""

    def read(self) -> Cloud:
        """Read its points; those without a return, which are written as zeros, are dropped."""
        table = parse_numbers(self.path, self._content().decode("ascii", "replace").splitlines())
        names = _COLUMNS.get(table.shape[1])
        if names is None:
            found, expected = f"{table.shape[1]} numbers a point", "3, 4 or 7"
            raise InputError(self.path, found, expected, "export it as PTX again")
        table = table[(table[:, :3] != 0).any(axis=1)]
        colours = table[:, 4:]
        if not ((colours >= 0) & (colours <= _BRIGHTEST)).all():
            raise InputError(self.path, "colours beyond a byte", "0 to 255", "export it again")
        columns: dict[str, NDArray[np.generic]] = {
            name: table[:, place].astype(np.uint8 if place > 3 else np.float64)
            for place, name in enumerate(names)
        }
        return checked(self.path, Cloud(columns))

    def fingerprint(self) -> Fingerprint:
        """Take the fingerprint of its lines."""
        return Fingerprint.of_part(self.path, [self._content()])

    def is_still(self, kept: Fingerprint) -> bool:
        """Tell whether its lines are still what they were."""
        return kept.is_untouched(self.path) or self.fingerprint().sha256 == kept.sha256

    def _content(self) -> bytes:
        with self.path.open("rb") as file:
            file.seek(self.begin)
            return file.read(self.end - self.begin)


def list_ptx(path: Path) -> list[PtxStation]:
    """List the stations of a PTX file.

    Args:
        path: The file; gone through once for where its stations begin.

    Raises:
        InputError: It is cut short, or a header is none.
        OSError: It cannot be opened.
    """
    found: list[tuple[NDArray[np.float64], int, int]] = []
    with path.open("rb") as file:
        while first := file.readline().strip():
            found.append(_skip_station(path, file, first))
    if not found:
        raise InputError(path, "no station", _WHOLE, "export it again")
    names = station_names(path, [""] * len(found))
    return [PtxStation(name, path, *one) for name, one in zip(names, found, strict=True)]


def _skip_station(path: Path, file: BinaryIO, first: bytes) -> tuple[NDArray[np.float64], int, int]:
    """Read the header of a station and pass over its points; return pose, begin and end."""
    try:
        num_points = int(first) * int(file.readline())
        rows = [[float(word) for word in file.readline().split()] for _ in range(8)]
        pose = np.array(rows[4:], np.float64).T  # points are rows there
        if [len(row) for row in rows] != [3] * 4 + [4] * 4:
            raise ValueError("other numbers than 3 and 4 a line")
    except ValueError as error:
        found = f"no header of a station ({error}){recognise(path, '; ')}"
        raise InputError(path, found, _WHOLE, "export again") from error
    check_rotations(path, pose[None], lambda _: "a station's matrix")

    begin = file.tell()
    for number in range(num_points):
        if not file.readline().strip():
            missing = f"{num_points:,} points promised, {number:,} found"
            raise InputError(path, missing, _WHOLE, "the file is cut short; copy it again")
    return pose, begin, file.tell()
