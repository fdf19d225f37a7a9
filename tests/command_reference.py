"""docs/commands.md, made from the commands themselves: ``python -m tests.command_reference``."""

import inspect
import re
from pathlib import Path
from typing import Literal, get_args, get_origin, get_type_hints

from typer.models import ArgumentInfo

from mcpseg_cli.cli import app

PAGE = Path(__file__).parents[1] / "docs" / "commands.md"
BEGIN, END = "<!-- commands: python -m tests.command_reference -->\n", "<!-- end of commands -->\n"


def reference() -> str:
    """List every command with its arguments and options."""
    return "\n".join(
        describe(command.name, command.callback) for command in app.registered_commands
    )


def describe(name, function) -> str:
    """Describe one command under its own heading."""
    summary = inspect.getdoc(function).splitlines()[0]
    hints = get_type_hints(function, include_extras=True)
    parameters = inspect.signature(function).parameters.values()
    rows = [
        describe_parameter(parameter.name, parameter.default, hints[parameter.name])
        for parameter in parameters
        if get_args(hints[parameter.name])  # else what typer hands over
    ]
    table = "\n".join(["| | |", "|---|---|", *rows])
    return f"## mcpseg {name}\n\n{summary}\n\n{table}\n"


def describe_parameter(name, default, hint) -> str:
    """Describe an argument or option in a row."""
    kind, info = get_args(hint)[:2]
    text = info.help or ""
    if isinstance(info, ArgumentInfo):
        return f"| `{tidy(info.metavar or name.upper())}` | {tidy(text)} |"
    named = [*([info.default] if isinstance(info.default, str) else []), *(info.param_decls or [])]
    words = ", ".join(named or ["--" + name.replace("_", "-")])
    if kind is not bool:
        words += f" {info.metavar or '|'.join(choices(kind)) or placeholder(kind)}"
        if default not in (None, inspect.Parameter.empty) and "[default" not in text:
            text += f" [default: {default}]"
    return f"| `{tidy(words)}` | {tidy(text)} |"


def placeholder(kind) -> str:
    """Name the kind of value of an option that does not name it."""
    kinds = {kind, *get_args(kind)}
    return (
        "PATH" if Path in kinds else "N" if int in kinds else "NUMBER" if float in kinds else "TEXT"
    )


def choices(kind) -> list[str]:
    """Give the values of an option that takes one of a few."""
    kinds = [kind, *get_args(kind)]
    return [value for kind in kinds if get_origin(kind) is Literal for value in get_args(kind)]


def tidy(text: str) -> str:
    """Make a line of a table cell."""
    return re.sub(r"\s+", " ", text).strip().replace("|", "\\|")


def with_reference(page: str) -> str:
    """Put the reference into the page's text."""
    before, rest = page.split(BEGIN)
    return before + BEGIN + "\n" + reference() + "\n" + rest[rest.index(END) :]


if __name__ == "__main__":
    PAGE.write_text(with_reference(PAGE.read_text()))
