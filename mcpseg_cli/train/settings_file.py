"""Settings files: what ``mcpseg train --config`` takes, and what is written beside the weights."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from mcpseg_cli.config import (
    AugmentSettings,
    CheckpointSettings,
    SampleSettings,
    TrainSettings,
    WindowSettings,
)
from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.class_table import check_class_table

_HEADER = "# mcpseg train --config takes this file.\n"


class SettingsFile(BaseModel):
    """Tables of a settings file; what is left out has its default.

    Attributes:
        train: Network and numbers.
        samples: How scans are replayed.
        augment: How training batches are changed.
        windows: Which windows the U-Net is trained on.
        checkpoint: When checkpoints are written.
        classes: Class by label of the data; None: the data's own classes.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    train: TrainSettings = TrainSettings()
    samples: SampleSettings = SampleSettings()
    augment: AugmentSettings = AugmentSettings()
    windows: WindowSettings = WindowSettings()
    checkpoint: CheckpointSettings = CheckpointSettings()
    classes: dict[str, str] | None = None


def read_settings(path: Path) -> SettingsFile:
    """Read a settings file.

    Args:
        path: TOML with tables ``[train]``, ``[samples]``, ``[augment]``, ``[windows]``,
            ``[checkpoint]`` and ``[classes]``, none of them needed.

    Raises:
        InputError: Not TOML, an unknown table or setting, or a value of another type or size.
        OSError: The file cannot be read.
    """
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(path, str(error), "TOML", "see 'mcpseg train --help'") from error
    try:
        file = SettingsFile.model_validate(document, strict=True)
    except ValidationError as error:
        raise _refusal(path, error.errors()) from error
    if file.classes is None:
        return file
    table = check_class_table(f"{path} [classes]", list(file.classes.items()))
    return file.model_copy(update={"classes": table})


def settings_text(
    train: TrainSettings,
    samples: SampleSettings,
    augment: AugmentSettings,
    windows: WindowSettings,
    classes: Mapping[str, str] | None,
) -> str:
    """Write out every setting of a training, as a settings file that gives the same training."""
    tables: dict[str, Mapping[str, object]] = {
        "train": train.model_dump(),
        "samples": samples.model_dump(),
        "augment": augment.model_dump(),
        **({"windows": windows.model_dump()} if train.architecture == "unet" else {}),
        **({} if classes is None else {"classes": classes}),
    }
    return _HEADER + "".join(
        f"\n[{name}]\n" + "".join(_lines(table)) for name, table in tables.items()
    )


def _lines(table: Mapping[str, object]) -> Iterator[str]:
    """Write keys and values; TOML has nothing that says that a setting is not set."""
    for key, value in table.items():
        name = key if key.isascii() and key.isidentifier() else _scalar(key)
        yield f"# {name} is not set\n" if value is None else f"{name} = {_scalar(value)}\n"


def _scalar(value: object) -> str:
    """Write a text, number or truth value: as in JSON, but letters as they are, DEL escaped."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _refusal(path: Path, problems: list[ErrorDetails]) -> InputError:
    """Say in one line which setting cannot be, and what could."""
    place = problems[0]["loc"][:2]
    table, *key = map(str, place)
    name = " ".join([f"[{table}]", *key])
    if problems[0]["type"] == "extra_forbidden":
        known = [f"[{each}]" for each in SettingsFile.model_fields]
        if key:
            known = list(type(SettingsFile.model_fields[table].default).model_fields)
        expected = f"some of {', '.join(known)}"
        return InputError(path, f"unknown {name}", expected, "check its spelling")

    # a setting that can be this or that has a problem with each
    messages = [problem["msg"] for problem in problems if problem["loc"][:2] == place]
    words = [message.removeprefix("Input should be ") for message in messages]
    expected = " or ".join(words) if key else "a table"
    value = json.dumps(problems[0]["input"], default=str, ensure_ascii=False)
    return InputError(path, f"{name} = {value[:60]}", expected, "correct it, or leave it out")
