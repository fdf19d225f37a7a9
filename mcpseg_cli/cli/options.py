"""Options that mean the same, under the same name and letter, in every command."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

if TYPE_CHECKING:
    from pydantic import BaseModel

Settings = TypeVar("Settings", bound="BaseModel")

OutputFolder = Annotated[
    Path, typer.Option("-o", "--output", help="Folder for the results; a run in it is continued.")
]
OutputFile = Annotated[Path, typer.Option("-o", "--output", help="File to write.")]
WeightsName = Annotated[
    str | None,
    typer.Option(
        "-w",
        "--weights",
        help="A .safetensors file, or the name of bundled weights.  [default: the method's]",
    ),
]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of every random choice.")]
Device = Annotated[str, typer.Option("--device", help="Where the network runs: cpu, cuda, …")]
Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON document on stdout and nothing else.")
]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="No progress and no notices.")]
Verbose = Annotated[
    bool, typer.Option("-v", "--verbose", help="Also print the milliseconds of each stage.")
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace what is there.")]
Jobs = Annotated[
    int | None,
    typer.Option("-j", "--jobs", min=1, help="Threads or processes; default: all cores."),
]


def number_of_jobs(jobs: int | None) -> int:
    """Return the given number, or how many cores this process may use."""
    import os

    return jobs or len(os.sched_getaffinity(0))


def settings_of(model: type[Settings], given: Mapping[str, object]) -> Settings:
    """Check the options that make up some settings.

    Args:
        model: The settings.
        given: Values by the name of the setting; None leaves the default.

    Raises:
        typer.BadParameter: One cannot be; names the option.
    """
    from pydantic import ValidationError

    from mcpseg_cli.config import option_of

    try:
        return model.model_validate({name: v for name, v in given.items() if v is not None})
    except ValidationError as error:
        problem = error.errors()[0]
        message = problem["msg"].removeprefix("Value error, ")
        if not problem["loc"]:  # several that do not go together
            words = message.split()
            told = [option_of(word) if word in model.model_fields else word for word in words]
            raise typer.BadParameter(" ".join(told)) from error
        raise typer.BadParameter(f"{option_of(str(problem['loc'][0]))}: {message}") from error
