"""Saying that kernels are compiled, while they are: numba does so once, in the first run of all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from mcpseg_cli.cli.display import is_terminal, notice

_LINE = "mcpseg: compiling kernels, once; up to a minute"


@contextmanager
def told_of_compiling(*, quiet: bool) -> Iterator[None]:
    """Say in one line on a terminal when the first kernel is compiled in this block.

    Kernels that are found compiled, in the cache beside the package, say nothing.

    Args:
        quiet: Say nothing, as when stderr is not a terminal.
    """
    if quiet or not is_terminal():
        yield
        return

    from numba.core.event import Event, Listener, install_listener

    class Teller(Listener):
        """Hears once that a kernel begins to be compiled."""

        has_told = False

        def on_start(self, event: Event) -> None:
            if not self.has_told:
                self.has_told = True
                notice(_LINE)

        def on_end(self, event: Event) -> None:
            pass

    with install_listener("numba:compile", Teller()):
        yield
