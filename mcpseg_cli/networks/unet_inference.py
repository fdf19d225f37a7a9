"""The sparse U-Net made fast for inference: norms folded away, rows shared among threads.

Threads that meet once a layer, each with rows of its own, stand a busy machine better than
operations that each wait for all cores. How rows are shared depends on their number only, so that
one thread and many give the same answer, bit for bit.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import pairwise

import torch
from torch import Tensor, nn

from mcpseg_cli.choices import Precision
from mcpseg_cli.networks.device import one_thread_per_operation
from mcpseg_cli.networks.sparse import NUM_CHILDREN, Level
from mcpseg_cli.networks.unet import (
    Ascend,
    Block,
    Descend,
    UNet,
    WindowOutput,
    dense,
)

_TILE = 2048  # rows: few enough that two cores share a window, enough that a thread is worth it


class FastUNet:
    """A U-Net that only labels.

    Args:
        network: Trained, in evaluation mode; not changed.
        precision: ``bf16``: the large dense layers compute in bfloat16; or ``fp32``.
        device: Where it runs.
    """

    def __init__(self, network: UNet, precision: Precision, device: torch.device) -> None:
        self._network = fold(network, precision).to(device)
        self._is_on_cpu = device.type == "cpu"
        self._workers = ThreadPoolExecutor(
            torch.get_num_threads(), initializer=torch.set_num_threads, initargs=(1,)
        )

    @torch.inference_mode()
    def __call__(self, inputs: Tensor, levels: Sequence[Level]) -> WindowOutput:
        """Do as the network does; see ``UNet.forward``."""
        if not self._is_on_cpu:
            output: WindowOutput = self._network(inputs, levels)
            return output
        with one_thread_per_operation():
            return self._run(inputs, levels)

    @property
    def affine(self) -> tuple[float, float]:
        """Affinity of equal embeddings, as a logit, and its fall with their squared distance."""
        even, steepness = self._network.affine.detach().cpu()
        return float(even), float(nn.functional.softplus(steepness))

    def _run(self, inputs: Tensor, levels: Sequence[Level]) -> WindowOutput:
        """Run the network stage by stage; each stage shares its rows among the workers."""
        network = self._network
        features = self._share(len(inputs), lambda rows: network.stem(inputs[rows]))

        # from each level to the coarser one
        known = []
        for stack, descend, level in zip(network.down, network.descend, levels, strict=False):
            features = self._look(stack, features, level)
            known.append(features)
            features = self._descend(descend, features, level)
        features = self._look(network.down[-1], features, levels[-1])

        # and back, with what was known on the way
        for number in reversed(range(len(known))):
            features = self._ascend(network.ascend[number], features, known[number], levels[number])
            features = self._look(network.up[number], features, levels[number])

        logits_and_embedding = self._share(
            len(features), lambda rows: torch.cat(network.answer(features[rows]), dim=1)
        )
        num_classes = network.classify.out_features
        return WindowOutput(*logits_and_embedding.tensor_split([num_classes], dim=1))

    def _look(self, stack: nn.Module, features: Tensor, level: Level) -> Tensor:
        for block in stack.children():
            assert isinstance(block, Block)
            features = self._share(len(features), partial(_look_at, block, features, level))
        return features

    def _descend(self, descend: nn.Module, features: Tensor, level: Level) -> Tensor:
        assert isinstance(descend, Descend)
        assert level.children is not None
        children = level.children
        padded = torch.cat([features, features.new_zeros(1, features.shape[1])])
        return self._share(len(children), lambda rows: descend.unite(padded[children[rows]]))

    def _ascend(self, ascend: nn.Module, coarse: Tensor, features: Tensor, level: Level) -> Tensor:
        assert isinstance(ascend, Ascend)
        assert level.parent is not None
        assert level.corner is not None
        place = level.parent * NUM_CHILDREN + level.corner
        answers = self._share(len(coarse), lambda rows: dense(ascend.part, coarse[rows]))
        answers = answers.view(-1, features.shape[1])  # (8·P, F)
        return self._share(
            len(features), lambda rows: ascend.blend(answers[place[rows]], features[rows])
        )

    def _share(self, count: int, work: Callable[[slice], Tensor]) -> Tensor:
        """Let the workers do their parts of so many rows; put the answers together."""
        num_tiles = -(-count // _TILE)
        ends = [count * number // num_tiles for number in range(num_tiles + 1)] if count else [0, 0]
        tiles = [slice(*ends) for ends in pairwise(ends)]
        if len(tiles) == 1:
            return work(tiles[0])

        @torch.inference_mode()
        def part(rows: slice) -> Tensor:
            return work(rows)

        return torch.cat(list(self._workers.map(part, tiles)))


def _look_at(block: Block, features: Tensor, level: Level, rows: slice) -> Tensor:
    """Give some rows' new features."""
    return features[rows] + block.think(block.look.part(features, level, rows.start, rows.stop))


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
