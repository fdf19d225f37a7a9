"""Expected failures: each is one line: what was found, what was expected and what to do."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

FULL = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)
"""Numbers of an OSError for a disk, file or quota that has no more room."""


class McpsegError(Exception):
    """An expected failure; ``str(error)`` is one complete line for the user."""


class InputError(McpsegError):
    """A file or table that cannot be used as it is.

    Args:
        source: The file (or other origin) at fault.
        found: What is there.
        expected: What should be there.
        remedy: What the user can do.
    """

    def __init__(self, source: Path | str, found: str, expected: str, remedy: str) -> None:
        self.source = str(source)
        super().__init__(" ".join(f"{source}: {found}; expected {expected}; {remedy}".split()))


class NoPointsError(InputError):
    """A cloud without any point."""


class WeightsError(InputError):
    """A weights file that is damaged, foreign or does not fit."""


class StateError(McpsegError):
    """A checkpoint that cannot be continued: in use, foreign, damaged or of other settings."""


class StateInUseError(StateError):
    """A checkpoint that another process is writing."""


class TrainingError(McpsegError):
    """Training that cannot start or go on."""


class OutputError(McpsegError):
    """An output that cannot be written."""


class BelowThresholdError(McpsegError):
    """A figure below what was asked for."""


@contextmanager
def naming(path: Path) -> Iterator[None]:
    """Name the file in an OSError that does not: failed writes say what went wrong, not where."""
    try:
        yield
    except OSError as error:
        if error.filename is None and error.errno is not None:
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise
