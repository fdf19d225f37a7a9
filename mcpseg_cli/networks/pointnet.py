"""PointNet (Qi et al. 2017), without input transforms, as the authors compare with it (table I).

Layers as in their program; its widest has 1,024 features, here 256, and those after it half as many
as there, which keeps the parameters in MCPNet's range and a step on a processor short. ReLU follows
every hidden layer.
"""

import torch
from torch import Tensor, nn

from mcpseg_cli.config import NUM_FEATURES
from mcpseg_cli.networks.network import Network, initialise, perceptron

POINT_WIDTHS = (64, 64, 64, 128, 256)  # of every point, before the maximum over the batch
BATCH_WIDTHS = (128, 64)  # of that maximum
JOINT_WIDTHS = (256, 128)  # of every point with that maximum
_DROPOUT = 0.3


class PointFeatures(nn.Module):
    """Features of every point that know the whole batch, which PointNet and SGPN build on."""

    def __init__(self) -> None:
        super().__init__()
        self.each = perceptron(NUM_FEATURES, *POINT_WIDTHS)
        self.whole = perceptron(POINT_WIDTHS[-1], *BATCH_WIDTHS)
        self.joint = perceptron(POINT_WIDTHS[-1] + BATCH_WIDTHS[-1], *JOINT_WIDTHS)

    def forward(self, centre: Tensor) -> Tensor:
        """Turn (..., N, 6) points into (..., N, 128) features."""
        each = self.each(centre)  # (..., N, 256)
        whole = self.whole(each.amax(dim=-2, keepdim=True))  # (..., 1, 64)
        features: Tensor = self.joint(torch.cat([each, whole.expand(*each.shape[:-1], -1)], dim=-1))
        return features


class PointNet(Network):
    """PointNet for the class of every point.

    Args:
        num_classes: C, classes to tell apart.
    """

    def __init__(self, num_classes: int) -> None:
        super().__init__()
        self.features = PointFeatures()
        self.dropout = nn.Dropout(_DROPOUT)
        self.classify = nn.Linear(JOINT_WIDTHS[-1], num_classes)
        self.apply(initialise)

    def label(self, centre: Tensor, pooled: Tensor | None = None) -> tuple[None, Tensor]:
        """Classify points; see ``Network``."""
        return None, self.classify(self.dropout(self.features(centre)))
