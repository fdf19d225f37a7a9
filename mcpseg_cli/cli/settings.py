"""From the options of a command to settings: a value that cannot be is named by its option."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, TypeVar

import typer

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

SettingsT = TypeVar("SettingsT", bound="BaseModel")


def settings_of(
    model: type[SettingsT],
    given: Mapping[str, object],
    *,
    before: Mapping[str, object] | None = None,
) -> SettingsT:
    """Make settings of what was given on the command line.

    Args:
        model: Which settings.
        given: Value by setting; None: not given.
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
        raise typer.BadParameter(_explain(error, set(given))) from error


def _explain(error: ValidationError, settings: set[str]) -> str:
    """Say what is wrong with an option, or with several together, by their names."""
    from mcpseg_cli.config import option_of

    problem = error.errors()[0]
    message = problem["msg"].removeprefix("Value error, ")
    if problem["loc"]:
        return f"{option_of(str(problem['loc'][0]))}: {message}"
    words = message.split()
    return " ".join(option_of(word) if word in settings else word for word in words)
