"""A batch's tensors as one piece of memory: one message between processes, one copy to a device."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import torch
from torch import Tensor

_ALIGNED = 64  # bytes: every tensor begins at a multiple


@dataclass(frozen=True)
class Packed:
    """Some tensors, one after the other.

    Attributes:
        buffer: (B,) uint8.
        layout: Kind and shape of each; None where there is no tensor.
    """

    buffer: Tensor
    layout: tuple[tuple[torch.dtype, tuple[int, ...]] | None, ...]

    def pin_memory(self) -> Packed:
        """Copy to memory that devices read by themselves; torch's loader calls it."""
        return Packed(self.buffer.pin_memory(), self.layout)


def pack(tensors: Iterable[Tensor | None]) -> Packed:
    """Copy tensors, on the processor, into one."""
    kept = list(tensors)
    layout = tuple(None if each is None else (each.dtype, tuple(each.shape)) for each in kept)
    there = [each for each in kept if each is not None]
    buffer = torch.empty(sum(_room(each.nbytes) for each in there), dtype=torch.uint8)
    start = 0
    for each in there:
        flat = each.contiguous().view(-1).view(torch.uint8)
        buffer[start : start + each.nbytes] = flat
        start += _room(each.nbytes)
    return Packed(buffer, layout)


def unpack(packed: Packed, device: torch.device) -> list[Tensor | None]:
    """Move packed tensors to a device, in one copy; what is given views its memory."""
    buffer = packed.buffer.to(device, non_blocking=True)
    tensors: list[Tensor | None] = []
    start = 0
    for facts in packed.layout:
        if facts is None:
            tensors.append(None)
            continue
        dtype, shape = facts
        size = torch.Size(shape).numel() * dtype.itemsize
        tensors.append(buffer[start : start + size].view(dtype).view(shape))
        start += _room(size)
    return tensors


def _room(num_bytes: int) -> int:
    """Round up to where the next tensor may begin."""
    return -(-num_bytes // _ALIGNED) * _ALIGNED
