"""The folder of a run: what may be written into it, and what may be deleted from it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mcpseg_cli.config import Frame, RegionGrowingSettings, SegmentSettings
from mcpseg_cli.errors import OutputError, StateError, StateInUseError
from mcpseg_cli.formats import CLOUD_SUFFIXES
from mcpseg_cli.formats.recording import ScanFile
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.weights import Weights
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


def check_folders(recording: list[ScanFile], output: Path) -> None:
    """Refuse an output folder in which results would lie among the input, or that is none.

    Raises:
        OutputError: Says which.
    """
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


def check_outputs(output: Path) -> None:
    """Refuse a folder that has files under the names of results, but no checkpoint to say that they are.

    Raises:
        OutputError: Names them.
    """
    state = output / "state.sqlite"
    if state.exists() and state.stat().st_size >= _SMALLEST_DATABASE:
        return
    present = [name for name in _OUTPUTS if (output / name).exists() and (name != state.name)]
    if any(path.suffix.lower() in CLOUD_SUFFIXES for path in (output / "scans").glob("*")):
        present.append("clouds in scans/")
    if present:
        remedy = "give --overwrite" if (output / "run.json").exists() else "move them away"
        raise OutputError(
            f"{output}: has {', '.join(present)} but no state.sqlite, or an empty one; "
            f"expected an empty folder or a run; choose another -o, or {remedy}"
        )


_FIRST_TOLD = ("method", "offline", "weights")  # other differences follow from these


FLAGS = {
    "local_range": "--range",
    "weights": "--weights",
}  # settings whose option is not called like them


@dataclass(frozen=True)
class RunOptions:
    """How a run reads and writes; what decides its labels is in ``SegmentSettings``.

    Attributes:
        frame: Frame of the scans' coordinates.
        format: Ending of the labelled scans, without its dot; None for each scan's own.
        on_error: ``stop`` at a scan that cannot be read, or ``skip`` it.
        offline: Whether all scans are labelled together, when the last is read.
        command: The command line, for the record.
    """

    frame: Frame = "map"
    format: str | None = None
    on_error: str = "stop"
    offline: bool = False
    command: Sequence[str] = ()


def configuration_of(
    method: Weights | RegionGrowingSettings, segmenter: IncrementalSegmenter, options: RunOptions
) -> dict[str, object]:
    """Collect everything that decides the outputs."""
    settings: SegmentSettings = segmenter.settings
    if isinstance(method, Weights):
        what: dict[str, object] = {"weights": method.sha256}
    else:
        what = {"weights": None, "method": "region-growing", "region_growing": method.model_dump()}
    return {
        **settings.model_dump(mode="json"),
        "frame": options.frame,
        "format": options.format,
        "precision": segmenter.precision,
        "device": segmenter.device,
        **what,
        **({"offline": True} if options.offline else {}),
    }


def short(value: object) -> str:
    """Shorten a value for a message."""
    return "(none)" if value is None else str(value)[:16]
