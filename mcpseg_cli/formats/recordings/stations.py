"""Files of several stations of a scanner, each with its pose: E57 and PTX."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.magic import recognise
from mcpseg_cli.formats.scan_source import ScanSource

_E57_MAGIC = b"ASTM-E57"


def open_stations(path: Path) -> Sequence[ScanSource]:
    """List the stations of a file, in its order.

    Args:
        path: A .e57 or .ptx file.

    Raises:
        InputError: It is damaged, has no station, or pye57 is not installed.
        OSError: It cannot be opened.
    """
    if path.suffix.lower() == ".ptx":
        from mcpseg_cli.formats.recordings.ptx import list_ptx

        return list_ptx(path)
    with path.open("rb") as file:
        if file.read(len(_E57_MAGIC)) != _E57_MAGIC:
            found = f"no E57 by its first bytes{recognise(path, '; ')}"
            raise InputError(path, found, "an E57 file", "export it again")
    try:
        from mcpseg_cli.formats.recordings.e57_stations import list_e57
    except ModuleNotFoundError as error:
        raise InputError(
            path, "E57, which pye57 reads", "pye57", "pip install 'mcpseg[e57]'"
        ) from error
    return list_e57(path)


def station_names(path: Path, titles: Sequence[str]) -> list[str]:
    """Name the stations of a file after it and their titles, or numbers where those are the same.

    Args:
        path: The file; its name alone serves a single station.
        titles: What the file calls them, perhaps nothing.
    """
    if len(titles) == 1:
        return [f"{path.stem}.ply"]
    words = [re.sub(r"[^\w.-]+", "_", title).strip("._") for title in titles]
    if not all(words) or len(set(words)) < len(words):
        words = [f"{number:03d}" for number in range(len(titles))]
    return [f"{path.stem}_{word}.ply" for word in words]
