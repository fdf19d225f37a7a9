"""Commands of mcpseg in processes forked from this one, which has imported everything already.

A new interpreter imports for two seconds before a command begins; a fork begins at once. It is a
process of its own: with its own session, input and output, memory and signals. This process must
have one thread only, and no database open: neither survives a fork.
"""

from __future__ import annotations

import ctypes
import gc
import json
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from tests.commands import MOST_S

_PR_SET_PDEATHSIG = 1
_STEP_S = 0.002  # between two looks whether a process has ended


class Fork:
    """A function that runs in a process forked from this one; handled like a ``Popen``.

    Args:
        function: Returns the exit status; what it raises is printed, with 70 for a status.
        said: Where its stdout and stderr go.
    """

    def __init__(self, function: Callable[[], int], said: Path) -> None:
        gc.collect()  # the threads of executors that nobody holds
        assert len(list(Path("/proc/self/task").iterdir())) == 1, "threads do not survive a fork"
        sys.stdout.flush()
        sys.stderr.flush()
        self._said = said
        self.returncode: int | None = None
        self.pid = os.fork()
        if self.pid == 0:
            _live(function, said)

    @property
    def said(self) -> str:
        """What it said."""
        return self._said.read_text(errors="replace") if self._said.exists() else ""

    def poll(self) -> int | None:
        """Return its exit status, below 0 for a signal; None while it runs."""
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end, or kill it after ``timeout`` seconds, and return its exit status."""
        deadline = None if timeout is None else time.monotonic() + timeout
        while deadline is not None and self.poll() is None:
            if time.monotonic() > deadline:
                self.kill()
                break
            time.sleep(_STEP_S)
        if self.returncode is None:
            self.returncode = os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])
        return self.returncode

    def kill(self) -> None:
        """End it and what it has started, at once."""
        if self.poll() is not None:
            return
        os.kill(self.pid, signal.SIGKILL)
        with suppress(ProcessLookupError, PermissionError):  # before it had its own session
            os.killpg(self.pid, signal.SIGKILL)


def _live(function: Callable[[], int], said: Path) -> None:
    """Be the new process; never return."""
    status = 70
    try:
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)  # ends with who started it
        os.setsid()
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 1)
        os.dup2(1, 2)
        status = function()
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def run_command(*words: object) -> int:
    """Run a command of mcpseg as ``python -m mcpseg_cli`` does, and return its exit status."""
    from mcpseg_cli.cli import main

    sys.argv = ["mcpseg", *map(str, words)]
    try:
        main()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else int(end.code is not None)
    return 0


@dataclass(frozen=True)
class Ended:
    """How a process ended.

    Attributes:
        status: Its exit status, below 0 for a signal.
        said: Its stdout and stderr.
        answer: What its function returned, as JSON brought it here.
        seconds: How long it took.
    """

    status: int
    said: str
    answer: object = None
    seconds: float = 0.0

    @property
    def fault(self) -> str | None:
        """Say what is wrong: a signal, a traceback, more than a line; None for a refusal."""
        if self.status not in (0, 1) or len(self.said.splitlines()) > self.status:
            return f"status {self.status}: {self.said[-400:]!r}"
        return None


class Asked:
    """A function that runs in a fork, and what it returns.

    Args:
        function: Returns what JSON can hold.
        folder: For what the fork says.
    """

    def __init__(self, function: Callable[[], object], folder: Path) -> None:
        self._path = folder / "answer.json"
        self._path.unlink(missing_ok=True)
        self._began = time.monotonic()

        def answer() -> int:
            self._path.write_text(json.dumps(function()))
            return 0

        self._fork = Fork(answer, folder / "said")

    def ended(self, seconds: float) -> Ended:
        """Wait for its end, or kill it after so many seconds; the status tells."""
        self._fork.wait(seconds)
        found = json.loads(self._path.read_text()) if self._fork.returncode == 0 else None
        took = time.monotonic() - self._began
        return Ended(self._fork.returncode or 0, self._fork.said, found, took)


def run_to_end(words: Sequence[object], folder: Path, *, most_bytes: int | None = None) -> Ended:
    """Run a command of mcpseg in a fork, to its end.

    Args:
        words: The command.
        folder: For what it says.
        most_bytes: No file may grow beyond that, as on a full disk.
    """

    def run() -> int:
        if most_bytes is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, most_bytes))
        return run_command(*words)

    began = time.monotonic()
    fork = Fork(run, folder / "said")
    fork.wait(MOST_S)
    return Ended(fork.returncode or 0, fork.said, None, time.monotonic() - began)
