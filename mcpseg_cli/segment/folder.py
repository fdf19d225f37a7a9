"""The folder of a run: what may be written into it, and what may be deleted from it."""

from pathlib import Path

from mcpseg_cli.errors import OutputError, StateError, StateInUseError
from mcpseg_cli.formats import CLOUD_SUFFIXES
from mcpseg_cli.formats.recording import ScanFile
from mcpseg_cli.segment.checkpoint import State

_SMALLEST_DATABASE = 512  # bytes, of SQLite's smallest page
_OUTPUTS = (
    "map.ply",
    "events.jsonl",
    "objects.json",
    "run.json",
    "state.sqlite",
    "state.sqlite-wal",
)


def prepare_folder(output: Path, recording: list[ScanFile], *, overwrite: bool) -> None:
    """Make the folder of a run, or see that a run may be continued in it.

    Args:
        output: The folder.
        recording: The scans that are about to be labelled.
        overwrite: Delete the run that is there.

    Raises:
        OutputError: Results would lie among the input, or the folder has files of no run.
        StateError: Another process is writing there.
        OSError: The folder cannot be made.
    """
    _check_place(output, recording)
    if overwrite:
        clear_run(output, recording)
    _check_content(output)
    (output / "scans").mkdir(parents=True, exist_ok=True)


def prepare_empty(output: Path) -> None:
    """Make the folder of a run that is made at once, or see that it has no files of a run.

    Raises:
        OutputError: It has.
        OSError: The folder cannot be made.
    """
    if (output / "state.sqlite").exists():
        raise OutputError(
            f"{output}: has a run; expected an empty folder; choose another -o, or give --overwrite"
        )
    _check_content(output)
    output.mkdir(parents=True, exist_ok=True)


def _check_place(output: Path, recording: list[ScanFile]) -> None:
    """Refuse an output folder in which results would lie among the input, or that is none."""
    scans = recording[0].path.parent.resolve()
    own = (output.resolve(), (output / "scans").resolve())
    if scans in own or own[1] in scans.parents:
        raise OutputError(
            f"{output}: the input {recording[0].path.parent} lies where results go; "
            "expected a folder of its own; choose another -o"
        )
    if output.exists() and not output.is_dir():
        raise OutputError(f"{output}: a file; expected a folder; choose another -o")


def clear_run(output: Path, recording: list[ScanFile]) -> None:
    """Delete the files of a run, and only those: other files, also in its scans/, stay.

    Args:
        output: Folder of the run; nothing happens where neither its checkpoint nor its run.json
            shows that one was.
        recording: The scans that are about to be labelled; their earlier labelled copies are
            deleted.

    Raises:
        StateError: Another process is writing there.
    """
    if not any((output / name).is_file() for name in ("state.sqlite", "run.json")):
        return

    # the checkpoint knows which labelled scans are the run's
    stems = {source.path.stem for source in recording}
    if (output / "state.sqlite").is_file():
        try:
            with State(output / "state.sqlite") as state:
                stems |= {Path(record.name).stem for record in state.scans()}
        except StateInUseError:
            raise
        except StateError:
            pass  # damaged: its names are not needed to delete it

    for name in _OUTPUTS:
        (output / name).unlink(missing_ok=True)
    for path in (output / "scans").glob("*"):
        if path.stem in stems and path.suffix.lower() in CLOUD_SUFFIXES:
            path.unlink()


def _check_content(output: Path) -> None:
    """Refuse files under the names of results without the checkpoint that says that they are."""
    state = output / "state.sqlite"
    if state.exists() and state.stat().st_size >= _SMALLEST_DATABASE:
        return
    present = [name for name in _OUTPUTS if (output / name).exists() and (name != state.name)]
    if any(path.suffix.lower() in CLOUD_SUFFIXES for path in (output / "scans").glob("*")):
        present.append("clouds in scans/")

    # a run.json shows that a run was here, which may be deleted
    if present:
        remedy = "give --overwrite" if (output / "run.json").exists() else "move them away"
        raise OutputError(
            f"{output}: has {', '.join(present)} but no state.sqlite, or an empty one; "
            f"expected an empty folder or a run; choose another -o, or {remedy}"
        )
