"""The one place where expected failures become a line on stderr and exit 1."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperGroup

from mcpseg_cli.errors import FULL, McpsegError

if TYPE_CHECKING:
    from types import FrameType

_NO_KERNEL_CACHE = "cannot cache function"  # in numba's words
_SET_KERNEL_CACHE = (
    "compiled kernels cannot be kept: neither mcpseg's folder nor the home folder is writable; "
    "set NUMBA_CACHE_DIR to a folder that is"
)
_NO_UTF8 = "a path that is no UTF-8; expected one that is, for this kind of file; rename it"
_OUT_OF_MEMORY = (
    "out of memory; expected smaller scans or a smaller range; what is finished is kept"
)
_INTERRUPTED = (
    "interrupted; what is finished is kept; run the same command again, without --overwrite"
)


class OneLineErrors(TyperGroup):
    """A command group that reports expected failures in one line, without a traceback."""

    def invoke(self, ctx: Any) -> Any:
        """Run the chosen command; expected failures end it with exit 1, an interrupt with 130."""
        try:
            with _interrupted_by_sigterm():
                return super().invoke(ctx)
        except McpsegError as error:
            _fail(str(error), 1, error)
        except BrokenPipeError:  # the reader of our stdout has gone
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise typer.Exit(1) from None
        except OSError as error:
            _fail(_explain(error), 1, error)
        except UnicodeEncodeError as error:
            if error.reason != "surrogates not allowed":
                raise
            _fail(_NO_UTF8, 1, error)
        except MemoryError as error:
            _fail(_OUT_OF_MEMORY, 1, error)
        except RuntimeError as error:  # numba has no class of its own for this
            if not str(error).startswith(_NO_KERNEL_CACHE):
                raise
            _fail(_SET_KERNEL_CACHE, 1, error)
        except KeyboardInterrupt as error:
            _fail(_INTERRUPTED, 130, error)


@contextmanager
def _interrupted_by_sigterm() -> Iterator[None]:
    """Have SIGTERM end a command as Ctrl-C does, where the command itself does not wait for it."""
    is_ours = signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
    if not is_ours or threading.current_thread() is not threading.main_thread():
        yield
        return
    owner = os.getpid()

    def interrupt(number: int, frame: FrameType | None) -> None:
        if os.getpid() == owner:
            raise KeyboardInterrupt
        signal.signal(number, signal.SIG_DFL)  # a worker just ends
        os.kill(os.getpid(), number)

    signal.signal(signal.SIGTERM, interrupt)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _explain(error: OSError) -> str:
    """Say what the operating system refused, what was expected and what to do."""
    place = f"{error.filename}: " if error.filename else ""
    if error.errno in FULL:
        advice = (
            "expected room on the disk; make space and run the same command again, "
            "what is finished is kept"
        )
    elif isinstance(error, FileNotFoundError):
        advice = "expected an existing path; check its spelling"
    else:
        advice = "expected a path that can be read or written; check what it is and its permissions"
    return f"{place}{error.strerror or error}; {advice}"


def _fail(line: str, code: int, cause: BaseException) -> None:
    from mcpseg_cli.cli.display import plain

    typer.echo(f"mcpseg: {plain(' '.join(line.split()))}", err=True)
    raise typer.Exit(code) from cause
