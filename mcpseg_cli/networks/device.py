"""Where networks run."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from mcpseg_cli.errors import McpsegError


def use_threads(count: int) -> None:
    """Let torch use so many threads; where others want the cores too, one is often the fastest."""
    torch.set_num_threads(count)


def find_device(name: str) -> torch.device:
    """Find the device that torch calls so.

    Raises:
        McpsegError: There is none here.
    """
    try:
        probe = torch.zeros(1, device=name)
        probe.cpu()
        return probe.device
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        raise McpsegError(
            f"--device {name}: not available here; expected cpu or a device torch knows; use cpu"
        ) from error


@contextmanager
def one_thread_per_operation() -> Iterator[None]:
    """Keep torch from splitting operations among cores: the workers share whole tiles instead."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
