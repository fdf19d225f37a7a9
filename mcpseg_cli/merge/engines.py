"""Commands of mcpseg that do not wait for each other: on this machine, or on a Dask cluster.

Each is a process of its own. One whose worker is lost ends with it, and is started again on
another, where it goes on from its checkpoint.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass

from mcpseg_cli.errors import McpsegError

_IN_USE = "in use by another mcpseg"
_PATIENCE = 30  # seconds until a process of a lost worker must have ended
_LOST_WORKERS = 10  # that a command may have had before it is given up

Words = tuple[str, ...]


@dataclass(frozen=True)
class Outcome:
    """What became of a command.

    Attributes:
        words: The command.
        status: Its exit status.
        stdout: What it printed.
        stderr: What it told.
    """

    words: Words
    status: int
    stdout: str
    stderr: str

    @property
    def error(self) -> str:
        """The line that says why it failed."""
        lines = [line for line in self.stderr.splitlines() if line.strip()]
        return lines[-1].removeprefix("mcpseg: ") if lines else f"exit status {self.status}"


def run_command(words: Words, threads: int) -> Outcome:
    """Run a command of mcpseg to its end; it is killed if this process is.

    Args:
        words: What follows ``mcpseg``; paths that hold wherever it runs.
        threads: That it may use.
    """
    deadline = time.monotonic() + _PATIENCE
    outcome = _run(words, threads)
    while outcome.status and _IN_USE in outcome.stderr and time.monotonic() < deadline:
        time.sleep(0.5)
        outcome = _run(words, threads)
    return outcome


def _run(words: Words, threads: int) -> Outcome:
    command = [sys.executable, "-m", "mcpseg_cli.cli.guarded", str(threads), *words]
    theirs, ours = os.pipe()
    try:
        process = subprocess.Popen(
            command, stdin=theirs, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        os.close(theirs)
        stdout, stderr = process.communicate()
    finally:
        os.close(ours)
    return Outcome(words, process.returncode, stdout, stderr)


def run_here(commands: Sequence[Words], jobs: int, threads: int) -> Iterator[Outcome]:
    """Run commands on this machine, some at a time.

    Args:
        commands: Any number.
        jobs: How many at a time.
        threads: That each may use.

    Yields:
        What became of each, as they end.
    """
    with ThreadPoolExecutor(jobs) as pool:
        futures = [pool.submit(run_command, each, threads) for each in commands]
        try:
            for future in as_completed(futures):
                yield future.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)  # an interrupt starts no more


def run_on_dask(
    commands: Sequence[Words], scheduler: str, told: Callable[[str], None]
) -> Iterator[Outcome]:
    """Run commands on the workers of a Dask cluster, which must have mcpseg and see the same files.

    Args:
        commands: Any number.
        scheduler: Its address, ``tcp://HOST:PORT``.
        told: Called with what there is to say about the cluster.

    Yields:
        What became of each, as they end.

    Raises:
        McpsegError: dask.distributed is not installed, there is no cluster, or too many workers of
            one command were lost.
    """
    try:
        import distributed
    except ImportError as error:
        raise McpsegError(
            "--engine dask: dask.distributed is not installed; expected the extra mcpseg[dask]; "
            "pip install 'mcpseg[dask]'"
        ) from error
    try:
        client = distributed.Client(scheduler, timeout=10)  # type: ignore[no-untyped-call]
    except (OSError, ValueError) as error:
        raise McpsegError(
            f"--scheduler {scheduler}: no Dask scheduler there; expected tcp://HOST:PORT; "
            "start one with 'dask scheduler'"
        ) from error
    with client:
        told(f"dask: {len(client.scheduler_info()['workers'])} workers, {client.dashboard_link}")
        futures = [
            client.submit(run_command, words, 1, pure=False, retries=_LOST_WORKERS)
            for words in commands
        ]
        ended = distributed.as_completed(futures)  # type: ignore[no-untyped-call]
        for future in ended:
            try:
                yield future.result()
            except distributed.scheduler.KilledWorker as error:
                raise McpsegError(
                    f"dask: {error}; expected workers that stay; see the dashboard"
                ) from error
