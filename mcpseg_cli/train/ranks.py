"""Several processes that train one network, each on its share of the batches (torchrun)."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import torch
from torch import Tensor, distributed, nn

from mcpseg_cli.errors import TrainingError

_LOST = "gloo"  # in the words of what connects processes without NCCL


@dataclass(frozen=True)
class Ranks:
    """This process among those that train together.

    Attributes:
        rank: Which one it is; only 0 writes and prints.
        world: How many there are.
        local: Which one it is on this machine: which of several devices is its own.
    """

    rank: int = 0
    world: int = 1
    local: int = 0

    def sum(self, tensor: Tensor) -> Tensor:
        """Sum a tensor over all processes, in place; all must call it."""
        if self.world > 1:
            distributed.all_reduce(tensor)
        return tensor

    def any(self, claim: bool, device: torch.device) -> bool:
        """Tell whether a claim is true in any process; all must call it."""
        if self.world == 1:
            return claim
        return bool(self.sum(torch.tensor(float(claim), device=device)) > 0)

    def average_gradients(self, parameters: Sequence[nn.Parameter]) -> None:
        """Replace every gradient by its mean over all processes, in one message."""
        if self.world == 1:
            return
        gradients = [
            torch.zeros_like(each) if each.grad is None else each.grad for each in parameters
        ]
        flat = self.sum(torch.cat([gradient.flatten() for gradient in gradients])) / self.world
        parts = torch.split(flat, [each.numel() for each in parameters])
        for parameter, part in zip(parameters, parts, strict=True):
            parameter.grad = part.view_as(parameter)

    def wait(self) -> None:
        """Wait until all processes are here."""
        if self.world > 1:
            distributed.barrier()


@contextmanager
def joined(ranks: Ranks, device: torch.device) -> Iterator[None]:
    """Connect the processes while the context lasts; torchrun's environment says how.

    Raises:
        TrainingError: Another process has failed.
    """
    if ranks.world == 1:
        yield
        return
    if device.type == "cuda":
        torch.cuda.set_device(device)
    backend = "nccl" if device.type == "cuda" else "gloo"
    distributed.init_process_group(backend, rank=ranks.rank, world_size=ranks.world)
    try:
        yield
    except RuntimeError as error:
        if not isinstance(error, distributed.DistError) and _LOST not in str(error).lower():
            raise
        raise TrainingError(
            f"process {ranks.rank} of {ranks.world}: another process has ended; expected all to go "
            "on; see what that one says, then run the same command with --resume"
        ) from error
    finally:
        distributed.destroy_process_group()
