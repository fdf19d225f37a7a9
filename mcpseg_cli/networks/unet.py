"""A sparse U-Net that sees the room: every voxel of a window judged with all of it as context.

MCPNet judges a voxel by 50 random neighbours within 0.35 m. Here five levels of voxels, each twice
as wide as the one before, carry what is seen up to voxels of 1.6 m and back. The shape is
Ronneberger et al.'s U-Net (2015), the blocks are Liu et al.'s (A ConvNet for the 2020s, 2022), made
sparse: looking around costs one product for each neighbour there is, thinking is dense.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.sparse import NUM_CHILDREN, NUM_FORWARD, DepthwiseConv, Level

NUM_INPUTS = 14  # of each voxel: see ``incremental.window``
WIDTHS = (32, 64, 96, 128, 160)  # features, from the finest level to the coarsest
BLOCKS_DOWN = (2, 2, 2, 2, 1)
BLOCKS_UP = (2, 1, 1, 1)
NUM_LEVELS = len(WIDTHS)
EMBEDDING = 16
_EXPANSION = 2  # features inside a block, as a multiple
_HIDDEN = 64
_MOMENTUM = 0.02  # of running statistics: windows differ much
_START = 0.3  # of its part that a fresh block adds: deep stacks begin near the identity


class WindowOutput(NamedTuple):
    """What the network says about a window.

    Attributes:
        logits: (V, C) float32 class logits.
        embedding: (V, E) float32 of unit length; near for voxels of one object.
    """

    logits: Tensor
    embedding: Tensor


class UNet(Network):
    """The network.

    Args:
        num_classes: C, classes to tell apart.
    """

    sees_windows = True
    has_embedding = True
    batch_size = 2  # windows

    def __init__(self, num_classes: int) -> None:
        super().__init__()
        finest = WIDTHS[0]
        self.stem = nn.Linear(NUM_INPUTS, finest)
        self.down = nn.ModuleList(map(Stack, WIDTHS, BLOCKS_DOWN))
        self.descend = nn.ModuleList(Descend(*pair) for pair in pairwise(WIDTHS))
        self.ascend = nn.ModuleList(Ascend(coarse, fine) for fine, coarse in pairwise(WIDTHS))
        self.up = nn.ModuleList(map(Stack, WIDTHS[:-1], BLOCKS_UP))

        self.norm = nn.BatchNorm1d(finest, momentum=_MOMENTUM)
        self.hidden = nn.Linear(finest, _HIDDEN)
        self.classify = nn.Linear(_HIDDEN, num_classes)
        self.embed = nn.Linear(_HIDDEN, EMBEDDING)
        self.affine = nn.Parameter(torch.tensor([3.0, 4.0]))  # of affinity in squared distance

    def forward(  # type: ignore[override]  # windows, not batches of points
        self, inputs: Tensor, levels: Sequence[Level]
    ) -> WindowOutput:
        """Classify and embed the voxels of a window, or of several that are far apart.

        Args:
            inputs: (V, 14) float32 from ``incremental.window.window_input``.
            levels: Five, from ``sparse.make_levels``.
        """
        features = self.stem(inputs).float()

        # from each level to the coarser one
        known = []
        for stack, descend, level in zip(self.down, self.descend, levels, strict=False):
            features = stack(features, level)
            known.append(features)
            features = descend(features, level)
        features = self.down[-1](features, levels[-1])

        # and back, with what was known on the way
        for number in reversed(range(len(known))):
            features = self.ascend[number](features, known[number], levels[number])
            features = self.up[number](features, levels[number])

        hidden = functional.relu(self.hidden(functional.relu(self.norm(features))))
        embedding = functional.normalize(self.embed(hidden).float(), dim=1, eps=1e-6)
        return WindowOutput(self.classify(hidden).float(), embedding)

    def even_similarity(self) -> float:
        """Return the cosine similarity at which two objects are as likely as one."""
        even, steepness = self.affine.detach()[0], functional.softplus(self.affine.detach()[1])
        return float((1 - even / (2 * steepness)).clamp(-1, 1))

    def affinity(self, embedding: Tensor, other: Tensor) -> Tensor:
        """Compute how likely pairs of voxels are of one object, as a logit.

        Args:
            embedding: (P, E) float32 of unit length.
            other: (P, E) float32, the other of each pair.

        Returns:
            (P,) float32: falls with the squared distance, as steeply as was learned.
        """
        distance = (embedding - other).square().sum(dim=1)
        return self.affine[0] - functional.softplus(self.affine[1]) * distance


class Block(nn.Module):
    """Look around, then think: two dense layers on what each voxel saw, added to what it knew.

    Args:
        width: F, features.
    """

    def __init__(self, width: int) -> None:
        super().__init__()
        self.look = DepthwiseConv(width)
        self.norm = nn.BatchNorm1d(width, momentum=_MOMENTUM)
        self.widen = nn.Linear(width, _EXPANSION * width)
        self.narrow = nn.Linear(_EXPANSION * width, width)
        for layer in (self.widen, self.narrow):
            nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
        with torch.no_grad():
            self.narrow.weight *= _START

    def forward(self, features: Tensor, level: Level) -> Tensor:
        """Give (V, F) float32 new features of (V, F)."""
        seen = self.norm(self.look(features, level))
        change = _dense(self.narrow, functional.relu(_dense(self.widen, seen)))
        return features + change.float()


class Stack(nn.ModuleList):
    """Blocks one after the other at one level.

    Args:
        width: F, features.
        count: How many.
    """

    def __init__(self, width: int, count: int) -> None:
        super().__init__(Block(width) for _ in range(count))

    def forward(self, features: Tensor, level: Level) -> Tensor:
        """Give (V, F) float32 new features of (V, F)."""
        for block in self:
            features = block(features, level)
        return features


class Descend(nn.Module):
    """To voxels twice as wide: one dense layer on the eight parts of each.

    Args:
        width: F, features of a part.
        coarse_width: G, features of the whole.
    """

    def __init__(self, width: int, coarse_width: int) -> None:
        super().__init__()
        self.join = nn.Linear(NUM_CHILDREN * width, coarse_width, bias=False)
        self.norm = nn.BatchNorm1d(coarse_width, momentum=_MOMENTUM)
        nn.init.normal_(self.join.weight, std=(4 / (NUM_CHILDREN * width)) ** 0.5)  # half are empty

    def forward(self, features: Tensor, level: Level) -> Tensor:
        """Give (P, G) float32 features of the coarser level's voxels."""
        assert level.children is not None
        padded = torch.cat([features, features.new_zeros(1, features.shape[1])])
        parts = padded[level.children].flatten(1)  # (P, 8·F)
        return functional.relu(self.norm(_dense(self.join, parts).float()))


class Ascend(nn.Module):
    """Back to the parts: each takes its own of eight answers, mixed with what it knew before.

    Args:
        coarse_width: G, features of the whole.
        width: F, features of a part.
    """

    def __init__(self, coarse_width: int, width: int) -> None:
        super().__init__()
        self.part = nn.Linear(coarse_width, NUM_CHILDREN * width, bias=False)
        self.norm = nn.BatchNorm1d(width, momentum=_MOMENTUM)
        self.mix = nn.Linear(2 * width, width)

    def forward(self, coarse: Tensor, features: Tensor, level: Level) -> Tensor:
        """Give (V, F) float32 features of the finer level's voxels, of (P, G) and (V, F)."""
        assert level.parent is not None
        assert level.corner is not None
        answers = _dense(self.part, coarse).view(-1, features.shape[1])  # (8·P, F)
        own = answers[level.parent * NUM_CHILDREN + level.corner].float()
        mixed = _dense(self.mix, torch.cat([functional.relu(self.norm(own)), features], dim=1))
        return mixed.float()


def forward_pairs(neighbours: Tensor) -> tuple[Tensor, Tensor]:
    """List each pair of neighbouring voxels once.

    Args:
        neighbours: (V, 27) int32 rows, -1 for none.

    Returns:
        Two (P,) int64: rows of the one and the other voxel of each pair.
    """
    ahead = neighbours[:, -NUM_FORWARD:]
    row, column = torch.nonzero(ahead >= 0, as_tuple=True)
    return row, ahead[row, column].long()


def _dense(layer: nn.Linear, features: Tensor) -> Tensor:
    """Apply a dense layer in the precision of its weights."""
    answer: Tensor = layer(features.to(layer.weight.dtype))
    return answer


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
