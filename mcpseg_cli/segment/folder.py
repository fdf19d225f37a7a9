"""The folder of a run: what may be written into it, and what may be deleted from it."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePath

from mcpseg_cli.errors import OutputError, StateError, StateInUseError
from mcpseg_cli.formats import CLOUD_SUFFIXES
from mcpseg_cli.formats.scan_source import ScanSource
from mcpseg_cli.resumable import exclusive, is_leftover
from mcpseg_cli.segment.checkpoint import State

_SMALLEST_DATABASE = 512  # bytes, of SQLite's smallest page
_STATE = "state.sqlite"
_FILES = ("map.ply", "events.jsonl", "objects.json", "run.json", "state.sqlite-wal")
_WRITTEN_IN_PLACE = ("map.ply", "events.jsonl", "state.sqlite", "state.sqlite-wal")


@contextmanager
def held_folder(
    output: Path, recording: Sequence[ScanSource], *, overwrite: bool
) -> Iterator[None]:
    """Hold the folder of a run against other processes, after a look at what is there.

    Args:
        output: The folder; made if not there.
        recording: The scans that are about to be labelled.
        overwrite: Delete the run that is there.

    Raises:
        OutputError: Results would lie among the input, the folder has files of no run, or a link
            leads out of it; nothing is deleted then.
        StateError: Another process is writing there.
        OSError: The folder cannot be made.
    """
    _check_place(output, recording)
    with exclusive(output):
        _check_links(output)
        if overwrite:
            clear_run(output, recording)
        _check_content(output)
        (output / "scans").mkdir(exist_ok=True)
        yield


@contextmanager
def kept_state(output: Path) -> Iterator[State | None]:
    """Open the checkpoint of a folder for a look; None where there is no run.

    Args:
        output: The folder.

    Raises:
        StateError: The checkpoint there is in use or damaged.
    """
    path = output / _STATE
    if not path.is_file() or not path.stat().st_size:
        yield None
        return
    with State(path) as state:
        yield state


def prepare_empty(output: Path) -> None:
    """Make the folder of a run that is made at once, or see that it has no files of a run.

    Raises:
        OutputError: It has, or a link leads out of it.
        OSError: The folder cannot be made.
    """
    if (output / _STATE).exists():
        raise OutputError(
            f"{output}: has a run; expected an empty folder; choose another -o, or give --overwrite"
        )
    _check_links(output)
    _check_content(output)
    output.mkdir(parents=True, exist_ok=True)


def _check_place(output: Path, recording: Sequence[ScanSource]) -> None:
    """Refuse an output folder in which results would lie among the input, or that is none."""
    own = (output.resolve(), (output / "scans").resolve())
    for folder in dict.fromkeys(source.path.parent for source in recording):
        scans = folder.resolve()
        if scans in own or own[1] in scans.parents:
            raise OutputError(
                f"{output}: the input {folder} lies where results go; "
                "expected a folder of its own; choose another -o"
            )
    if output.exists() and not output.is_dir():
        raise OutputError(f"{output}: a file; expected a folder; choose another -o")


def _check_links(output: Path) -> None:
    """Refuse names of results that stand for files elsewhere, which would be written over."""
    scans = output / "scans"
    for path in [*(output / name for name in ("scans", _STATE, *_FILES)), *_linked_folders(scans)]:
        if path.is_symlink():
            raise OutputError(
                f"{path}: a link to {path.readlink()}; expected the run's own, "
                "which is written over; remove the link, or choose another -o"
            )
    for path in [output / name for name in _WRITTEN_IN_PLACE]:
        if path.is_file() and path.stat().st_nlink > 1:
            raise OutputError(
                f"{path}: has another name elsewhere (a hard link); expected the run's own, "
                "which is written over; put a copy in its place, or choose another -o"
            )


def _linked_folders(folder: Path) -> Iterator[Path]:
    """Find links in a folder, and in those in it, that stand for folders."""
    if folder.is_symlink() or not folder.is_dir():
        return
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_symlink() and entry.is_dir():
                yield Path(entry.path)
            elif entry.is_dir(follow_symlinks=False):
                yield from _linked_folders(Path(entry.path))


def clear_run(output: Path, recording: Sequence[ScanSource]) -> None:
    """Delete the files of a run, and only those: other files stay.

    The checkpoint goes last: killed before, the same call can do it again.

    Args:
        output: Folder of the run; nothing happens where neither its checkpoint nor its run.json
            shows that one was.
        recording: The scans that are about to be labelled; where the checkpoint cannot be read,
            their labelled copies are taken for the run's.

    Raises:
        StateError: Another process is writing there.
        OutputError: Clouds that are not the run's lie in its scans/; nothing is deleted.
    """
    if not any((output / name).is_file() for name in (_STATE, "run.json")):
        return

    # look first
    stems = _stems_of_run(output)
    if stems is None:
        stems = {_stem(source.name) for source in recording}
    scans = output / "scans"
    clouds = _clouds(scans)
    names = [path.relative_to(scans).as_posix() for path in clouds]
    if foreign := [name for name in names if _stem(name) not in stems]:
        raise OutputError(
            f"{scans}: has {foreign[0]}, which is none of the run's; "
            "expected nothing else there; move it away, or choose another -o"
        )

    for path in [*clouds, *_leftovers(scans)]:
        path.unlink()
    for name in (*_FILES, _STATE):
        (output / name).unlink(missing_ok=True)


def _stems_of_run(output: Path) -> set[str] | None:
    """Name the scans that a checkpoint knows; None without one that can be read."""
    if not (output / _STATE).is_file():
        return None
    try:
        with State(output / _STATE) as state:
            return {_stem(record.name) for record in state.scans()}
    except StateInUseError:
        raise
    except StateError:
        return None  # damaged


def _stem(name: str) -> str:
    """Return the name of a scan without its ending."""
    return str(PurePath(name).with_suffix(""))


def _clouds(folder: Path) -> list[Path]:
    """List the labelled scans in a folder and those in it, which need not exist."""
    return [
        path
        for path in folder.rglob("*")
        if path.suffix.lower() in CLOUD_SUFFIXES and not is_leftover(path.name)
    ]


def _leftovers(folder: Path) -> list[Path]:
    """List what a killed run left incomplete in a folder and those in it."""
    return [path for path in folder.rglob(".*") if is_leftover(path.name) and path.is_file()]


def _check_content(output: Path) -> None:
    """Refuse files under the names of results without the checkpoint that says that they are."""
    state = output / _STATE
    if state.exists() and state.stat().st_size >= _SMALLEST_DATABASE:
        return
    present = [name for name in _FILES if (output / name).exists()]
    if _clouds(output / "scans"):
        present.append("clouds in scans/")

    # a run.json shows that a run was here, which may be deleted
    if present:
        remedy = "give --overwrite" if (output / "run.json").exists() else "move them away"
        raise OutputError(
            f"{output}: has {', '.join(present)} but no state.sqlite, or an empty one; "
            f"expected an empty folder or a run; choose another -o, or {remedy}"
        )
