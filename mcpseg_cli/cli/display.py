"""What people see: results as a table on stdout, notices and progress on stderr."""

from __future__ import annotations

from collections.abc import Iterable

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text


def notice(line: str, *, quiet: bool = False, console: Console | None = None) -> None:
    """Print one line on stderr unless ``quiet``; beside a progress bar, through its ``console``."""
    if not quiet:
        target = console or Console(stderr=True)
        target.print(line, markup=False, highlight=False, emoji=False, soft_wrap=True)


def progress_bar(title: str, *, quiet: bool) -> Progress:
    """Make a progress bar on stderr.

    Args:
        title: What is being done.
        quiet: Show nothing, as when stderr is not a terminal.

    Returns:
        A context manager; its tasks have a field ``state`` for the text behind the bar.
    """
    console = Console(stderr=True)
    return Progress(
        TextColumn(title.replace("{", "{{").replace("}", "}}"), markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[state]}", markup=False),
        console=console,
        disable=quiet or not console.is_terminal,
        transient=True,
    )


def print_table(rows: Iterable[tuple[str, str]]) -> None:
    """Print names and values on stdout: a table on a terminal, plain aligned text otherwise."""
    console = Console(soft_wrap=True)
    if not console.is_terminal:
        pairs = list(rows)
        width = max(len(name) for name, _ in pairs)
        typer.echo("".join(f"{name:<{width}}  {value}\n" for name, value in pairs), nl=False)
        return

    # values fold in their own column
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold")
    table.add_column(overflow="fold")
    for name, value in rows:
        table.add_row(Text(name), Text(value))
    console.print(table, markup=False, highlight=False, emoji=False)
