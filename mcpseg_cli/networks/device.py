"""Where networks run."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import torch

from mcpseg_cli.choices import Precision
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


def resolve_precision(precision: Precision, device: str = "cpu") -> Precision:
    """Replace ``auto`` by what this machine does best: bf16 where it is native, else fp32."""
    if precision != "auto":
        return precision
    return "bf16" if device == "cpu" and _cpu_has_bf16() else "fp32"


def _cpu_has_bf16() -> bool:
    """Tell, by what Linux reports, if the processor multiplies bfloat16 (AMX or AVX512-BF16)."""
    try:
        flags = Path("/proc/cpuinfo").read_text().split()
    except OSError:
        return False
    return "avx512_bf16" in flags or "amx_bf16" in flags
