"""What people see: results as a table on stdout, notices and progress on stderr."""

from __future__ import annotations

from collections.abc import Iterable

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Column, Table
from rich.text import Text

_LONGEST = 1000  # letters of a line: what is longer is shortened in its middle
_LAST = 300  # of these, how many are of its end, where the remedy is
_WIDE = 120  # columns of a terminal that has room for everything
_WIDE_BAR, _NARROW_BAR = 40, 10
_COUNT_AND_TIME = 13 + 7 + 4  # columns of "123456/654321", "0:12:34" and what parts all of them


def plain(text: str, longest: int = _LONGEST) -> str:
    r"""Write text that may come from files for a terminal: in one line, no letter obeyed.

    Control characters, line breaks and what turns the direction of text appear as ``\x1b``.
    """
    if not text.isprintable():
        from mcpseg_cli.resumable import printable

        text = "".join(
            letter if letter.isprintable() else letter.encode("unicode_escape").decode()
            for letter in printable(text)
        )
    if len(text) > longest:
        text = f"{text[: longest - _LAST]} … {text[-_LAST:]}"
    return text


def is_terminal() -> bool:
    """Tell whether somebody looks at stderr while a command works."""
    return Console(stderr=True).is_terminal


def notice(line: str, *, quiet: bool = False, console: Console | None = None) -> None:
    """Print one line on stderr unless ``quiet``; beside a progress bar, through its ``console``."""
    if not quiet:
        target = console or Console(stderr=True)
        target.print(plain(line), markup=False, highlight=False, emoji=False, soft_wrap=True)


def progress_bar(title: str, *, quiet: bool) -> Progress:
    """Make a progress bar on stderr.

    Args:
        title: What is being done.
        quiet: Show nothing, as when stderr is not a terminal.

    Returns:
        A context manager; its tasks have a field ``state`` for the text behind the bar, which is
        cut where the terminal is too narrow for it: bar, count and time left stay.
    """
    console = Console(stderr=True)
    bar = _WIDE_BAR if console.width >= _WIDE else _NARROW_BAR
    rest = console.width - len(title) - bar - _COUNT_AND_TIME
    state = Column(no_wrap=True, overflow="ellipsis", max_width=max(rest, 1))
    return Progress(
        TextColumn(plain(title).replace("{", "{{").replace("}", "}}"), markup=False),
        BarColumn(bar),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[state]}", markup=False, table_column=state),
        console=console,
        disable=quiet or not console.is_terminal,
        transient=True,
    )


def print_table(rows: Iterable[tuple[str, str]]) -> None:
    """Print names and values on stdout: a table on a terminal, plain aligned text otherwise."""
    rows = [(plain(name), plain(value)) for name, value in rows]
    console = Console(soft_wrap=True)
    if not console.is_terminal:
        width = max(len(name) for name, _ in rows)
        typer.echo("".join(f"{name:<{width}}  {value}\n" for name, value in rows), nl=False)
        return

    # values fold in their own column
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold")
    table.add_column(overflow="fold")
    for name, value in rows:
        table.add_row(Text(name), Text(value))
    console.print(table, markup=False, highlight=False, emoji=False)
