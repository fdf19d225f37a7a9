"""A sparse U-Net that sees the room: every voxel of a window judged with all of it as context.

MCPNet judges a voxel by 50 random neighbours within 0.35 m. Here five levels of voxels, each twice
as wide as the one before, carry what is seen up to voxels of 1.6 m and back. The shape is
Ronneberger et al.'s U-Net (2015), the blocks are Liu et al.'s (A ConvNet for the 2020s, 2022), made
sparse: looking around costs one product for each neighbour there is, thinking is dense.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional

from mcpseg_cli.networks.description import TRAITS
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.sparse import NUM_CHILDREN, DepthwiseConv, Level
from mcpseg_cli.networks.stencil import NUM_FORWARD

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

    traits = TRAITS["unet"]

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

        return self.answer(features)

    def answer(self, features: Tensor) -> WindowOutput:
        """Say what (V, F) features of the finest level mean."""
        hidden = functional.relu(self.hidden(functional.relu(self.norm(features))))
        embedding = functional.normalize(self.embed(hidden).float(), dim=1, eps=1e-6)
        return WindowOutput(self.classify(hidden).float(), embedding)

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
        return features + self.think(self.look(features, level))

    def think(self, seen: Tensor) -> Tensor:
        """Give (V, F) float32 what to add to voxels that saw (V, F)."""
        return dense(self.narrow, functional.relu(dense(self.widen, self.norm(seen)))).float()


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
        return self.unite(padded[level.children])

    def unite(self, parts: Tensor) -> Tensor:
        """Give (P, G) float32 features of voxels with (P, 8, F) parts."""
        return functional.relu(self.norm(dense(self.join, parts.flatten(1)).float()))


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
        answers = dense(self.part, coarse).view(-1, features.shape[1])  # (8·P, F)
        return self.blend(answers[level.parent * NUM_CHILDREN + level.corner], features)

    def blend(self, own: Tensor, features: Tensor) -> Tensor:
        """Mix (V, F) answers from above with (V, F) what was known; (V, F) float32."""
        heard = functional.relu(self.norm(own.float()))
        return dense(self.mix, torch.cat([heard, features], dim=1)).float()


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


def dense(layer: nn.Linear, features: Tensor) -> Tensor:
    """Apply a dense layer in the precision of its weights."""
    answer: Tensor = layer(features.to(layer.weight.dtype))
    return answer
