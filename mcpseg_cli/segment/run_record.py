"""``run.json``: how a run was made, written by every call and read back by the same model."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Self

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    JsonValue,
    ValidationError,
    field_validator,
)

from mcpseg_cli import __version__
from mcpseg_cli.choices import ColourUnit, Frame, OnError, Precision, ScanFormat, UpAxis
from mcpseg_cli.classes import TABLE_EXPECTED, table_problem
from mcpseg_cli.config import RegionGrowingSettings, SegmentSettings
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.intake import Intake
from mcpseg_cli.resumable import printable, write_whole

if TYPE_CHECKING:
    from mcpseg_cli.incremental.segmenter import IncrementalSegmenter

_NAME = "run.json"
_Words = Annotated[str, BeforeValidator(printable)]


@dataclass(frozen=True)
class RunOptions:
    """How a run reads and writes; what decides its labels is in ``SegmentSettings``.

    Attributes:
        frame: Frame of the scans' coordinates.
        format: Ending of the labelled scans, without its dot; None for each scan's own.
        on_error: ``stop`` at a scan that cannot be read, or ``skip`` it.
        offline: Whether all scans are labelled together, when the last is read.
        command: The command line, for the record.
        recording: What was read and how, for the record: a line each.
        topic: The topic of a bag that was chosen.
        pairing: How scans and poses were paired, for the record.
        intake: How coordinates and colours are taken; None: as they are, in ``frame``.
        durable: Whether every scan that is told of survives a power cut, too.
    """

    frame: Frame = "map"
    format: ScanFormat | None = None
    on_error: OnError = "stop"
    offline: bool = False
    command: Sequence[str] = ()
    recording: Sequence[str] = ()
    topic: str | None = None
    pairing: Mapping[str, JsonValue] = field(default_factory=dict)
    intake: Intake | None = None
    durable: bool = False

    @property
    def taken(self) -> Intake:
        """How coordinates and colours are taken."""
        return self.intake or Intake(self.frame)


class RunConfiguration(SegmentSettings):
    """Everything that decides the outputs of a run: only the same continues it.

    Attributes:
        frame: Frame of the scans' coordinates.
        format: Ending of the labelled scans, without its dot; None for each scan's own.
        precision: Arithmetic of context pooling.
        device: Where the network ran.
        weights: Hash of the weights; None without any.
        method: ``region-growing``; None for a network.
        region_growing: Its settings; None for a network.
        offline: Whether all scans were labelled together.
        topic: The topic of a bag that was chosen; None where there was no choice.
        up: Which of the recording's axes points up.
        scale: Metres in a unit of the scans.
        pose_scale: Metres in a unit of the poses; None: as of the scans.
        offset: What is subtracted from coordinates, in the recording's axes and unit.
        colour: Unit of the colours, as the first scans say.
    """

    model_config = ConfigDict(extra="ignore")

    frame: Frame = "map"
    format: ScanFormat | None = None
    precision: Precision = "fp32"
    device: str = "cpu"
    weights: str | None = None
    method: str | None = None
    region_growing: RegionGrowingSettings | None = None
    offline: bool = False
    topic: str | None = None
    up: UpAxis = "z"
    scale: float = 1.0
    pose_scale: float | None = None
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    colour: ColourUnit | None = None

    @classmethod
    def of(cls, segmenter: IncrementalSegmenter, options: RunOptions) -> Self:
        """Collect it."""
        facts = segmenter.settings.model_dump()
        facts |= {"frame": options.frame, "format": options.format}
        facts |= options.taken.as_settings()
        facts |= {"precision": segmenter.precision, "device": segmenter.device}
        facts |= segmenter.method.configuration()
        facts |= {"topic": options.topic} if options.topic else {}
        return cls.model_validate(facts | ({"offline": True} if options.offline else {}))

    @property
    def intake(self) -> Intake:
        """How coordinates and colours were taken."""
        return Intake.of(self.model_dump())

    def as_json(self) -> dict[str, JsonValue]:
        """Give what was set, ready for JSON; what a network has no use for is left out."""
        return self.model_dump(mode="json", exclude_unset=True)


class RunRecord(BaseModel):
    """What ``run.json`` says.

    Attributes:
        mcpseg: Version that wrote it.
        python: Version of Python.
        command: The command line.
        recording: What was read and how: a line each.
        pairing: How scans and poses were paired, and what the pose file was taken for.
        method: The network's architecture, or ``region-growing``.
        configuration: What decided the outputs.
        weights: Name, hash and description of the weights; None without any.
        classes: What ``semantic`` indexes; none for a method that tells objects only, whose points
            all have 255.
    """

    model_config = ConfigDict(frozen=True)

    mcpseg: str = ""
    python: str = ""
    command: tuple[_Words, ...] = ()
    recording: tuple[_Words, ...] = ()
    pairing: dict[str, JsonValue] = {}
    method: str = ""
    configuration: RunConfiguration
    weights: dict[str, JsonValue] | None = None
    classes: tuple[str, ...]

    @field_validator("classes")
    @classmethod
    def _check_classes(cls, classes: tuple[str, ...]) -> tuple[str, ...]:
        """Refuse names that would break the headers of clouds."""
        if problem := table_problem(classes):
            raise ValueError(f"{problem}; expected {TABLE_EXPECTED}")
        return classes

    @classmethod
    def of(cls, segmenter: IncrementalSegmenter, options: RunOptions) -> Self:
        """Describe a run."""
        weights = segmenter.method.weights
        described: dict[str, JsonValue] | None = None
        if weights is not None:
            described = {"name": printable(weights.name), "sha256": weights.sha256}
            described |= weights.info.model_dump(mode="json")
        return cls(
            mcpseg=__version__,
            python=platform.python_version(),
            command=tuple(options.command),
            recording=tuple(options.recording),
            pairing=dict(options.pairing),
            method=segmenter.method.name,
            configuration=RunConfiguration.of(segmenter, options),
            weights=described,
            classes=segmenter.classes,
        )

    @classmethod
    def read(cls, folder: Path) -> Self:
        """Read the record of a run.

        Args:
            folder: The run's.

        Raises:
            InputError: Missing, or not what ``mcpseg segment`` wrote.
            OSError: It cannot be read.
        """
        path, expected = folder / _NAME, "the description of the run"
        remedy = "run 'mcpseg segment' on this folder again, which writes it"
        try:
            return cls.model_validate_json(path.read_bytes())
        except FileNotFoundError as error:
            raise InputError(path, "not there", expected, remedy) from error
        except ValidationError as error:
            problem = error.errors(include_url=False)[0]
            if problem["type"] == "json_invalid":
                raise InputError(path, "not JSON", expected, remedy) from error
            place = ".".join(map(str, problem["loc"])) or "all of it"
            raise InputError(path, f"{place}: {problem['msg']}", expected, remedy) from error

    def write(self, folder: Path) -> None:
        """Write the record into the folder of the run.

        Raises:
            OSError: The disk is full.
        """
        document = self.model_dump(mode="json") | {"configuration": self.configuration.as_json()}
        write_whole(folder / _NAME, json.dumps(document, indent=1) + "\n")
