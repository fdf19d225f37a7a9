"""The files of one training: weights, card, record, settings, and a checkpoint until it is done."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from mcpseg_cli.config import AugmentSettings, SampleSettings, TrainSettings, WindowSettings
from mcpseg_cli.errors import OutputError, StateError
from mcpseg_cli.train.calibration import Calibration
from mcpseg_cli.train.progress import EpochReport
from mcpseg_cli.train.scores import Scores

_RESULTS = ("safetensors", "md", "json", "toml")


class AreaFacts(BaseModel):
    """What an area was when it was trained on.

    Attributes:
        name: Its path in the data.
        scans: Their number.
        samples: Their number.
        fingerprint: Hash of scans, truth and settings, hex.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str
    scans: int
    samples: int
    fingerprint: str


class TrainIdentity(BaseModel):
    """What must be the same for a training to go on.

    Attributes:
        settings: Network and numbers.
        samples: How scans are replayed.
        augmentation: How training batches are changed.
        windows: Which windows a network is trained on that sees whole ones.
        classes: What is trained.
        class_table: Class by label of the data; None: the data's own classes.
        training_areas: What is trained on.
        validation_areas: What is held out.
        init: Hash of the weights to start from; None: none.
        processes: How many share the work.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    settings: TrainSettings
    samples: SampleSettings
    augmentation: AugmentSettings
    windows: WindowSettings = WindowSettings()
    classes: tuple[str, ...]
    class_table: dict[str, str] | None
    training_areas: tuple[AreaFacts, ...]
    validation_areas: tuple[AreaFacts, ...]
    init: str | None
    processes: int


class TrainRecord(BaseModel):
    """All there is to say about trained weights; NAME.json.

    Attributes:
        format: Of the file.
        mcpseg: Version that trained.
        torch: Version it trained with.
        complete: Whether training came to its end.
        name: What the files are called before their endings.
        sha256: Hash of the weights file, hex; None before the first epoch is done.
        bytes: Its size.
        architecture: Which network.
        classes: What is trained.
        new_classes: Those that the weights to start from did not know; None: there were none.
        init_name: Name of those weights.
        holdout: Number of the areas held out; None: none.
        epochs: How many are done.
        best_epoch: The one whose weights these are; 0: none yet.
        train: Scores of its training batches.
        validation: Scores of the held-out batches after it.
        calibration: How well its confidence tells what is right; None: not fitted.
        seconds: What all epochs took.
        device: Where it trained.
        command: The command line.
        curves: Report of every epoch.
        identity: What must be the same for a training to go on.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[1] = 1
    mcpseg: str
    torch: str
    complete: bool
    name: str
    sha256: str | None
    bytes: int
    architecture: str
    classes: tuple[str, ...]
    new_classes: tuple[str, ...] | None
    init_name: str | None
    holdout: int | None
    epochs: int
    best_epoch: int
    train: Scores | None
    validation: Scores | None
    calibration: Calibration | None = None
    seconds: float
    device: str
    command: str
    curves: tuple[EpochReport, ...]
    identity: TrainIdentity


@dataclass(frozen=True)
class TrainFiles:
    """The files of one training.

    Attributes:
        folder: Where they are.
        name: What they are called before their endings.
    """

    folder: Path
    name: str

    def path(self, ending: str) -> Path:
        """Return the path of the file with an ending, such as ``safetensors`` or ``checkpoint``."""
        return self.folder / f"{self.name}.{ending}"

    def check(self, *, resume: bool, overwrite: bool) -> None:
        """Make the folder; refuse to write over results or over a training that was interrupted.

        Raises:
            OutputError: Something is there; says what, and how to go on.
            OSError: The folder cannot be made.
        """
        if self.folder.exists() and not self.folder.is_dir():
            raise OutputError(f"{self.folder}: a file; expected a folder; choose another -o")
        self.folder.mkdir(parents=True, exist_ok=True)
        if overwrite or resume:
            return

        # asked for neither: nothing may be there
        if self.path("checkpoint").exists():
            raise OutputError(
                f"{self.path('checkpoint')}: a training that was not finished; expected none; "
                "give --resume to continue it or --overwrite to start anew"
            )
        present = [self.path(ending) for ending in _RESULTS if self.path(ending).exists()]
        if present:
            raise OutputError(
                f"{present[0]}: is there; expected a new name; "
                "choose another -o or --name, or give --overwrite"
            )

    def clear(self) -> None:
        """Delete what an earlier training left."""
        for ending in ("checkpoint", *_RESULTS):
            self.path(ending).unlink(missing_ok=True)

    def read_record(self) -> TrainRecord | None:
        """Read the record of a training that is complete; None where there is none.

        Raises:
            StateError: It is damaged, or of something else.
        """
        path = self.path("json")
        if not path.is_file():
            return None
        try:
            record = TrainRecord.model_validate_json(path.read_bytes())
        except ValidationError as error:
            raise StateError(
                f"{path}: not a record of training by this version, or damaged; expected one; "
                "give --overwrite, or choose another -o or --name"
            ) from error
        return record if record.complete else None
