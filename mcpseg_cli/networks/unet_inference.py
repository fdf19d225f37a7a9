"""The sparse U-Net made fast for inference: norms folded away, tiles shared among threads.

On a processor the network is run tile by tile: what a block computes of a few hundred rows stays
near the core that computes it, in memory that was there before. Every dense layer is one product
with the weights it needs; numba gathers what goes into it.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from functools import partial
from typing import cast

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from mcpseg_cli.choices import Precision
from mcpseg_cli.networks.device import one_thread_per_operation
from mcpseg_cli.networks.gathering import (
    Pairs,
    gather_children,
    gather_parents,
    look_around,
    pair_up,
    scale_to_unit_length,
)
from mcpseg_cli.networks.sparse import Level
from mcpseg_cli.networks.tiles import Scratch, Workers, height_of
from mcpseg_cli.networks.unet import (
    Ascend,
    Block,
    Descend,
    Stack,
    UNet,
    WindowOutput,
)

_Matrix = NDArray[np.float32]


class FastUNet:
    """A U-Net that only labels.

    Args:
        network: Trained, in evaluation mode; not changed.
        precision: ``bf16``: the large dense layers compute in bfloat16; or ``fp32``.
        device: Where it runs.
    """

    def __init__(self, network: UNet, precision: Precision, device: torch.device) -> None:
        self._network = fold(network, precision).to(device)
        self._tiled = TiledUNet(self._network) if device.type == "cpu" else None

    @torch.inference_mode()
    def __call__(self, inputs: Tensor, levels: Sequence[Level]) -> WindowOutput:
        """Do as the network does; see ``UNet.forward``."""
        if self._tiled is None:
            output: WindowOutput = self._network(inputs, levels)
            return output
        with one_thread_per_operation():
            return self._tiled(inputs, levels)

    @property
    def affine(self) -> tuple[float, float]:
        """Affinity of equal embeddings, as a logit, and its fall with their squared distance."""
        even, steepness = self._network.affine.detach().cpu()
        return float(even), float(nn.functional.softplus(steepness))


class TiledUNet:
    """A folded U-Net on a processor.

    Args:
        network: From ``fold``.
    """

    def __init__(self, network: UNet) -> None:
        self._stem = _Product(network.stem)
        self._down = [_looks(stack) for stack in network.down]
        self._descend = [_Product(cast(Descend, each).join) for each in network.descend]
        ascend = [cast(Ascend, each) for each in network.ascend]
        self._ascend = [(_Product(each.part), _Product(each.mix)) for each in ascend]
        self._up = [_looks(stack) for stack in network.up]

        self._norm = _scale_and_shift(network.norm)
        self._hidden = _Product(network.hidden)
        self._answer = _Product(network.classify, network.embed)
        self._num_classes = network.classify.out_features
        self._workers = Workers()

    def __call__(self, inputs: Tensor, levels: Sequence[Level]) -> WindowOutput:
        """Do as the network does; see ``UNet.forward``."""
        pairs = [pair_up(level.neighbours.numpy()) for level in levels]
        features = torch.empty(len(inputs), self._stem.width)
        self._workers.share(len(inputs), partial(_apply, self._stem, inputs, features))

        # from each level to the coarser one
        known = []
        for number, descend in enumerate(self._descend):
            features = self._look(self._down[number], features, pairs[number])
            known.append(features)
            features = self._go_down(descend, features, levels[number])
        features = self._look(self._down[-1], features, pairs[-1])

        # and back, with what was known on the way
        for number in reversed(range(len(known))):
            features = self._go_up(number, features, known[number], levels[number])
            features = self._look(self._up[number], features, pairs[number])

        return self._say(features)

    def _look(self, blocks: Sequence[_Look], features: Tensor, pairs: Pairs) -> Tensor:
        """Let blocks look and think, one after the other."""
        for block in blocks:
            thought = torch.empty_like(features)
            self._workers.share(len(features), partial(block, features, pairs, thought))
            features = thought
        return features

    def _go_down(self, join: _Product, features: Tensor, level: Level) -> Tensor:
        """Give the features of the coarser level."""
        assert level.children is not None
        known, children = features.numpy(), level.children.numpy()
        coarse = torch.empty(len(children), join.width)

        def work(scratch: Scratch, rows: slice) -> None:
            parts = scratch.matrix("seen", height_of(rows.stop - rows.start), join.depth)
            gather_children(known, children, parts.numpy(), rows.start, rows.stop)
            united = join(scratch, "answer", parts)[: rows.stop - rows.start]
            coarse[rows] = united.relu_()

        self._workers.share(len(children), work)
        return coarse

    def _go_up(self, number: int, coarse: Tensor, features: Tensor, level: Level) -> Tensor:
        """Give the features of the finer level: what the coarser one says, and what was known."""
        assert level.parent is not None
        assert level.corner is not None
        part, mix = self._ascend[number]
        answers = torch.empty(len(coarse), part.width)
        self._workers.share(len(coarse), partial(_apply, part, coarse, answers))

        tables = answers.numpy(), features.numpy(), level.parent.numpy(), level.corner.numpy()
        fine = torch.empty_like(features)

        def work(scratch: Scratch, rows: slice) -> None:
            both = scratch.matrix("seen", height_of(rows.stop - rows.start), mix.depth)
            gather_parents(*tables, both.numpy(), rows.start, rows.stop)
            fine[rows] = mix(scratch, "answer", both)[: rows.stop - rows.start]

        self._workers.share(len(features), work)
        return fine

    def _say(self, features: Tensor) -> WindowOutput:
        """Say what features of the finest level mean."""
        logits = torch.empty(len(features), self._num_classes)
        embedding = torch.empty(len(features), self._answer.width - self._num_classes)
        scale, shift = self._norm

        def work(scratch: Scratch, rows: slice) -> None:
            count = rows.stop - rows.start
            seen = scratch.matrix("seen", height_of(count), len(scale))
            torch.addcmul(shift, features[rows], scale, out=seen[:count]).relu_()
            hidden = self._hidden(scratch, "hidden of all", seen).relu_()
            answer = self._answer(scratch, "answer of all", hidden)[:count]
            logits[rows] = answer[:, : self._num_classes]
            embedding[rows] = answer[:, self._num_classes :]
            scale_to_unit_length(embedding[rows].numpy())

        self._workers.share(len(features), work)
        return WindowOutput(logits, embedding)


class _Product:
    """Dense layers on the same rows, as one product.

    Attributes:
        depth: Features that go in.
        width: Features that come out.
    """

    def __init__(self, *layers: nn.Linear) -> None:
        self._weight = torch.cat([layer.weight.detach() for layer in layers]).T
        self._bias = torch.cat([layer.bias.detach() for layer in layers])
        self.depth, self.width = self._weight.shape

    def __call__(self, scratch: Scratch, name: str, features: Tensor) -> Tensor:
        """Give (N, width) in the precision of the weights, in a block of a name."""
        weight = self._weight
        if features.dtype != weight.dtype:
            lowered = scratch.matrix("lowered", len(features), self.depth, weight.dtype)
            features = lowered.copy_(features)
        answer = scratch.matrix(name, features.shape[0], self.width, weight.dtype)
        return torch.addmm(self._bias, features, weight, out=answer)


class _Look:
    """A block: what goes around a voxel, and what it makes of it."""

    def __init__(self, block: Block) -> None:
        weight = block.look.weight.detach().numpy()
        self._around = np.concatenate([weight, np.zeros_like(weight[:1])])
        self._widen, self._narrow = _Product(block.widen), _Product(block.narrow)

    def __call__(
        self, features: Tensor, pairs: Pairs, thought: Tensor, scratch: Scratch, rows: slice
    ) -> None:
        """Fill some rows of ``thought`` with new features."""
        count = rows.stop - rows.start
        seen = scratch.matrix("seen", height_of(count), features.shape[1])
        around = self._around
        look_around(features.numpy(), *pairs, around, seen.numpy(), rows.start, rows.stop)
        hidden = self._widen(scratch, "hidden", seen).relu_()
        answer = self._narrow(scratch, "answer", hidden)
        torch.add(features[rows], answer[:count], out=thought[rows])


def _looks(stack: nn.Module) -> list[_Look]:
    """Make the blocks of a stack ready."""
    assert isinstance(stack, Stack)
    return [_Look(block) for block in stack.children() if isinstance(block, Block)]


def _apply(
    layer: _Product, features: Tensor, answers: Tensor, scratch: Scratch, rows: slice
) -> None:
    """Fill some rows of ``answers`` with what a dense layer gives of them."""
    count = rows.stop - rows.start
    seen = scratch.matrix("seen", height_of(count), layer.depth)
    seen[:count] = features[rows]
    answers[rows] = layer(scratch, "whole answer", seen)[:count]


def fold(network: UNet, precision: str) -> UNet:
    """Make a network for inference only: norms become part of the dense layers beside them.

    Args:
        network: Trained, in evaluation mode; not changed.
        precision: ``bf16``: the large dense layers compute in bfloat16; or ``fp32``.

    Returns:
        A copy that says the same, up to rounding.
    """
    folded = copy.deepcopy(network)
    for module in folded.modules():
        if isinstance(module, Block):
            _fold_before(module.norm, module.widen)
        elif isinstance(module, Descend | Ascend):
            _fold_after(module.join if isinstance(module, Descend) else module.part, module.norm)
        if isinstance(module, Block | Descend | Ascend):
            setattr(module, "norm", nn.Identity())  # noqa: B010
            if precision == "bf16":
                for layer in module.children():
                    if isinstance(layer, nn.Linear):
                        layer.to(torch.bfloat16)
    return folded


def _scale_and_shift(norm: nn.BatchNorm1d) -> tuple[Tensor, Tensor]:
    """Give the factor and the summand that a norm is at inference."""
    assert norm.running_mean is not None
    assert norm.running_var is not None
    scale = norm.weight / (norm.running_var + norm.eps).sqrt()
    return scale.detach(), (norm.bias - norm.running_mean * scale).detach()


@torch.no_grad()
def _fold_before(norm: nn.BatchNorm1d, layer: nn.Linear) -> None:
    """Let a layer do what the norm before it does."""
    scale, shift = _scale_and_shift(norm)
    layer.bias.add_(layer.weight @ shift)
    layer.weight.mul_(scale)


@torch.no_grad()
def _fold_after(layer: nn.Linear, norm: nn.BatchNorm1d) -> None:
    """Let a layer do what the norm after it does, to each of its answers."""
    scale, shift = _scale_and_shift(norm)
    answers = layer.out_features // len(scale)
    layer.weight.mul_(scale.repeat(answers)[:, None])
    layer.bias = nn.Parameter(shift.repeat(answers))
