"""PointNet++ with single-scale grouping (Qi et al. 2017, NIPS), for classes of points (table I).

Levels, radii and layers as in the MCPNet authors' program, each layer half as wide as there. That
program gives the layers relative positions only; here every point also has its six features, colour
and height over the floor among them. Where it takes the first points by index, here the nearest are
taken: the order of points does not matter.
"""

import torch
from torch import Tensor, nn

from mcpseg_cli.config import NUM_FEATURES
from mcpseg_cli.networks.network import Network, initialise, perceptron

_XYZ = 3
_LEVELS = (  # points kept, radius in metres, widths
    (1024, 0.1, (16, 16, 32)),
    (256, 0.2, (32, 32, 64)),
    (64, 0.4, (64, 64, 128)),
    (16, 0.8, (128, 128, 256)),
)
# widths of the way back, to each level from the next
_UPWARD = ((64, 64, 64), (128, 64), (128, 128), (128, 128))
_NEIGHBOURS = 32  # most points that a group has
_HIDDEN = 64


class PointNet2(Network):
    """PointNet++: groups of groups of points, then back to every point.

    Args:
        num_classes: C, classes to tell apart.
    """

    def __init__(self, num_classes: int) -> None:
        super().__init__()

        # to coarser levels
        widths = [NUM_FEATURES, *[level[-1] for *_, level in _LEVELS]]
        self.abstract = nn.ModuleList(
            perceptron(_XYZ + width, *level)
            for width, (*_, level) in zip(widths, _LEVELS, strict=False)
        )

        # and back: what comes from the level below joins the level's own
        coarse = [*[level[-1] for level in _UPWARD[1:]], widths[-1]]
        self.propagate = nn.ModuleList(
            perceptron(below + own, *level)
            for below, own, level in zip(coarse, widths, _UPWARD, strict=False)
        )

        # class of every point
        self.classify = nn.Sequential(
            nn.Linear(_UPWARD[0][-1], _HIDDEN), nn.ReLU(), nn.Linear(_HIDDEN, num_classes)
        )
        self.apply(initialise)

    def label(self, centre: Tensor, pooled: Tensor | None = None) -> tuple[None, Tensor]:
        """Classify points; see ``Network``."""
        points = centre.reshape(-1, *centre.shape[-2:])  # (B, N, 6)

        # groups of groups of points
        levels = [(points[..., :_XYZ].detach().contiguous(), points)]
        for layers, (count, radius, _) in zip(self.abstract, _LEVELS, strict=True):
            xyz, features = levels[-1]
            kept = gather(xyz, farthest_points(xyz, count))
            group = ball(xyz, kept, radius)  # (B, M, K)
            offset = gather(xyz, group) - kept[:, :, None]
            each = layers(torch.cat([offset, gather(features, group)], dim=-1))  # (B, M, K, F)
            levels.append((kept, each.amax(dim=2)))

        # back to every point
        coarse_xyz, features = levels.pop()
        for layers in reversed(self.propagate):
            xyz, own = levels.pop()
            features = layers(torch.cat([interpolate(xyz, coarse_xyz, features), own], dim=-1))
            coarse_xyz = xyz

        logits: Tensor = self.classify(features)
        return None, logits.view(*centre.shape[:-1], -1)


def farthest_points(xyz: Tensor, count: int) -> Tensor:
    """Choose points that cover all others: each is the farthest from those before.

    The first is the farthest from the origin.

    Args:
        xyz: (B, N, 3), metres.
        count: How many; all points where there are no more.

    Returns:
        (B, min(count, N)) int64 indices; in order where all are chosen.
    """
    if count >= xyz.shape[1]:
        return torch.arange(xyz.shape[1], device=xyz.device).expand(len(xyz), -1)

    rows = torch.arange(len(xyz), device=xyz.device)
    chosen = torch.empty(len(xyz), count, dtype=torch.int64, device=xyz.device)
    distance = xyz.new_full(xyz.shape[:2], torch.inf)  # to the nearest point chosen
    farthest = xyz.square().sum(dim=-1).argmax(dim=-1)  # (B,)

    # one after another
    for i in range(count):
        chosen[:, i] = farthest
        step = (xyz - xyz[rows, farthest][:, None]).square().sum(dim=-1)
        distance = torch.minimum(distance, step)
        farthest = distance.argmax(dim=-1)
    return chosen


def ball(xyz: Tensor, centres: Tensor, radius: float) -> Tensor:
    """Find the points around each centre, the nearest 32 where there are more.

    Args:
        xyz: (B, N, 3), metres.
        centres: (B, M, 3): some of them.
        radius: Metres.

    Returns:
        (B, M, min(32, N)) int64 indices; the nearest point stands for those that are too far.
    """
    most = min(_NEIGHBOURS, xyz.shape[1])
    distance, index = _distance(centres, xyz).topk(most, dim=-1, largest=False)
    return torch.where(distance <= radius, index, index[..., :1])


def interpolate(xyz: Tensor, coarse_xyz: Tensor, features: Tensor) -> Tensor:
    """Average the features of the three nearest coarse points by inverse squared distance.

    Args:
        xyz: (B, N, 3), metres.
        coarse_xyz: (B, M, 3), metres.
        features: (B, M, F) of the coarse points.

    Returns:
        (B, N, F).
    """
    most = min(3, coarse_xyz.shape[1])
    distance, index = _distance(xyz, coarse_xyz).topk(most, dim=-1, largest=False)
    weight = 1 / distance.square().clamp(min=1e-10)
    weight = weight / weight.sum(dim=-1, keepdim=True)  # (B, N, 3)
    return (gather(features, index) * weight[..., None]).sum(dim=2)


def gather(features: Tensor, index: Tensor) -> Tensor:
    """Take rows of each batch.

    Args:
        features: (B, N, F).
        index: (B, ...) int64.

    Returns:
        (B, ..., F).
    """
    start = torch.arange(len(features), device=index.device) * features.shape[1]
    flat = index + start.view(-1, *[1] * (index.dim() - 1))
    rows = features.reshape(-1, features.shape[-1]).index_select(0, flat.flatten())
    return rows.view(*index.shape, -1)


def _distance(a: Tensor, b: Tensor) -> Tensor:
    """(B, M, N) distances, from differences: by matrix products they are off by 0.1 mm and more."""
    return torch.cdist(a, b, compute_mode="donot_use_mm_for_euclid_dist")
