"""Recordings other than a folder of clouds: one module a container, each gives scans in order."""

from __future__ import annotations

from pathlib import Path

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import CLOUD_SUFFIXES
from mcpseg_cli.formats.magic import recognise
from mcpseg_cli.formats.scan_files import STATION_SUFFIXES
from mcpseg_cli.formats.scan_source import Recording, TopicChoice

_BAG_SUFFIXES = (".bag", ".mcap", ".db3")


def open_container(
    path: Path, topics: TopicChoice, *, has_pose_file: bool = False
) -> Recording | None:
    """Open a recording by what it is: a bag, a file of stations, a folder of depth images.

    Args:
        path: What the user named.
        topics: Which topics of a bag to take.
        has_pose_file: Whether poses are given beside it: then a folder with clouds in it is one of
            clouds, whatever else there is.

    Returns:
        Its scans; None for a folder that is none of these.

    Raises:
        InputError: A file of another kind, or a recording that is damaged or has to be chosen from.
        OSError: A file cannot be opened.
    """
    if path.is_file():
        return _open_file(path, topics)
    if not path.is_dir() or (has_pose_file and _has_clouds(path)):
        return None
    if bags := _bags_of(path):
        return _open_bags(path, bags, topics)
    from mcpseg_cli.formats.recordings.rgbd import open_rgbd

    return open_rgbd(path)


def _open_file(path: Path, topics: TopicChoice) -> Recording:
    suffix = path.suffix.lower()
    if suffix in STATION_SUFFIXES:
        from mcpseg_cli.formats.recordings.stations import open_stations

        kind = suffix.lstrip(".").upper()
        return Recording(path, f"{kind} file", tuple(open_stations(path)))
    if suffix in _BAG_SUFFIXES:
        return _open_bags(path, [path], topics)
    expected = (
        f"a folder of scans, or a file ending in {', '.join((*STATION_SUFFIXES, *_BAG_SUFFIXES))}"
    )
    remedy = "name the folder that it lies in"
    raise InputError(path, f"a file{recognise(path, '; ')}", expected, remedy)


def _has_clouds(path: Path) -> bool:
    return any(file.suffix.lower() in CLOUD_SUFFIXES for file in path.iterdir())


def _bags_of(path: Path) -> list[Path]:
    """List the bag files of a folder, in order."""
    return sorted(file for file in path.iterdir() if file.suffix.lower() in _BAG_SUFFIXES)


def _open_bags(path: Path, files: list[Path], topics: TopicChoice) -> Recording:
    try:
        from mcpseg_cli.formats.recordings.bag import open_bag
    except ModuleNotFoundError as error:
        found = f"a bag, which {error.name} reads"
        raise InputError(path, found, "it installed", "pip install 'mcpseg[ros]'") from error
    return open_bag(path, files, topics)
