"""``run.json``: how a run was made, written by every call and read back by the same model."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, JsonValue, ValidationError

from mcpseg_cli.config import Frame, Precision, RegionGrowingSettings, SegmentSettings
from mcpseg_cli.errors import InputError
from mcpseg_cli.resumable import printable

_NAME = "run.json"
_Words = Annotated[str, BeforeValidator(printable)]


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
    """

    model_config = ConfigDict(extra="ignore")

    frame: Frame = "map"
    format: str | None = None
    precision: Precision = "fp32"
    device: str = "cpu"
    weights: str | None = None
    method: str | None = None
    region_growing: RegionGrowingSettings | None = None
    offline: bool = False

    def as_json(self) -> dict[str, JsonValue]:
        """Give what was set, ready for JSON; what a network has no use for is left out."""
        return self.model_dump(mode="json", exclude_unset=True)


class RunRecord(BaseModel):
    """What ``run.json`` says.

    Attributes:
        mcpseg: Version that wrote it.
        python: Version of Python.
        command: The command line.
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
    method: str = ""
    configuration: RunConfiguration
    weights: dict[str, JsonValue] | None = None
    classes: tuple[str, ...]

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
            return cls.model_validate(json.loads(path.read_text(encoding="utf-8")))
        except FileNotFoundError as error:
            raise InputError(path, "not there", expected, remedy) from error
        except ValidationError as error:
            problem = error.errors()[0]
            place = ".".join(map(str, problem["loc"])) or "all of it"
            raise InputError(path, f"{place}: {problem['msg']}", expected, remedy) from error
        except (ValueError, RecursionError) as error:
            raise InputError(path, "not JSON", expected, remedy) from error

    def as_text(self) -> str:
        """Give the text of the file."""
        document = self.model_dump(mode="json")
        return json.dumps(document | {"configuration": self.configuration.as_json()}, indent=1) + "\n"
