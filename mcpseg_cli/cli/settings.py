"""From the options of a command to settings: a value that cannot be is named by its option."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeVar

import typer

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

SettingsT = TypeVar("SettingsT", bound="BaseModel")


def settings_of(
    model: type[SettingsT],
    given: Mapping[str, object],
    options: Mapping[str, str] | None = None,
    *,
    before: Mapping[str, object] | None = None,
) -> SettingsT:
    """Make settings of what was given on the command line.

    Args:
        model: Which settings.
        given: Value by setting; None: not given.
        options: Option of each setting that is not called like it.
        before: Valid values from elsewhere, which options win over.

    Returns:
        Settings; what is neither given nor from elsewhere has its default.

    Raises:
        typer.BadParameter: An option has a value that it cannot have.
    """
    from pydantic import ValidationError

    chosen = {name: value for name, value in given.items() if value is not None}
    try:
        return model.model_validate({**(before or {}), **chosen})
    except ValidationError as error:
        names = {name: "--" + name.replace("_", "-") for name in given} | dict(options or {})
        raise typer.BadParameter(_explain(error, names)) from error


def _explain(error: ValidationError, options: Mapping[str, str]) -> str:
    """Say what is wrong with an option, or with several together, by their names."""
    problem = error.errors()[0]
    message = problem["msg"].removeprefix("Value error, ")
    if problem["loc"]:
        return f"{options[str(problem['loc'][0])]}: {message}"
    return re.sub(r"\w+", lambda word: options.get(word[0], word[0]), message)
