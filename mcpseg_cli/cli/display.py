"""What people see: results as a table on stdout, notices and progress on stderr."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from contextlib import AbstractContextManager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table


def notice(line: str, *, quiet: bool = False) -> None:
    """Print one line on stderr unless ``quiet``."""
    if not quiet:
        Console(stderr=True).print(line, markup=False, highlight=False, soft_wrap=True)


def progress_bar(*, quiet: bool) -> Progress:
    """Make a progress bar on stderr; it shows nothing when ``quiet`` or when stderr is not a terminal.

    Returns:
        A context manager; its tasks have a field ``state`` for the text behind the bar.
    """
    console = Console(stderr=True)
    return Progress(
        TextColumn("segment"),
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
        sys.stdout.write("".join(f"{name:<{width}}  {value}\n" for name, value in pairs))
        return
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_column(style="bold")
    table.add_column(overflow="fold")
    for name, value in rows:
        table.add_row(name, value)
    console.print(table, markup=False, highlight=False)


__all__ = ["AbstractContextManager", "notice", "print_table", "progress_bar"]
