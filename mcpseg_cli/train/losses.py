"""What networks are trained to make small (III-D): losses over one batch.

Points whose class is unknown (255) count in no class loss. Points without an object (id 0) would
count as one object in the others: leave them out before.
"""

import torch
from torch import Tensor
from torch.nn import functional

from mcpseg_cli.config import TRIPLET_MARGIN

UNKNOWN_CLASS = 255
_ALPHA = 10.0  # weight of pairs of one class but two objects in SGPN's loss
_MARGINS = (10.0, 80.0)  # K1, K2: how far these are to be apart, and pairs of two classes
_SCALE = 10.0  # from squared distances to the similarity matrix that these numbers are for


def classification_loss(
    logits: Tensor, semantic: Tensor, class_weights: Tensor | None = None
) -> Tensor:
    """Compute the softmax cross-entropy of points whose class is known.

    Args:
        logits: (..., C) float.
        semantic: (...) class index of any integer type, 255 unknown.
        class_weights: (C,) float: what an error on a point of each class costs; None: all the same.

    Returns:
        The mean over the known points, weighted; 0, with gradient 0, where there are none.
    """
    target = semantic.reshape(-1).long()
    flat = logits.reshape(len(target), -1)
    total = functional.cross_entropy(
        flat, target, class_weights, ignore_index=UNKNOWN_CLASS, reduction="sum"
    )
    known = target[target != UNKNOWN_CLASS]
    weight = flat.new_tensor(len(known)) if class_weights is None else class_weights[known].sum()
    return total / weight.clamp(min=torch.finfo(flat.dtype).tiny)


def triplet_semihard_loss(
    embedding: Tensor, labels: Tensor, margin: float = TRIPLET_MARGIN
) -> Tensor:
    """Compute the triplet loss with semi-hard negatives (Schroff et al., FaceNet, 2015; III-C).

    Every ordered pair of two points of one object takes one negative: the nearest point of another
    object that is farther from the first point than the second is; where there is none, the
    farthest point of another object. TensorFlow's ``triplet_semihard_loss``, which the authors
    used, computes the same; but where it divides by zero, or makes up a negative at distance zero
    because all points are one object, this loss is 0.

    Args:
        embedding: (N, E) float, of unit length as networks give it.
        labels: (N,) object id of any integer type.
        margin: alpha, on squared distances.

    Returns:
        The mean over these pairs; 0, with gradient 0, where there are none. Memory grows with N x
        N.
    """
    distance = _squared_distances(embedding)  # (N, N)
    with torch.no_grad():
        positive, is_pair = _positives(labels)
        negative = _semihard_negatives(distance.detach(), labels, positive)
        is_pair &= (labels != labels[0]).any()
    loss = torch.relu(
        margin + distance.gather(1, positive) - distance.gather(1, negative)
    )  # (N, P)
    return (loss * is_pair).sum() / is_pair.sum().clamp(min=1)


def _positives(labels: Tensor) -> tuple[Tensor, Tensor]:
    """List (N, P) int64 the points of each point's object, and which entries are pairs.

    P is the size of the largest object.
    """
    itself = torch.arange(len(labels), device=labels.device)[:, None]
    sorted_labels, order = labels.sort()
    start, end = (
        torch.searchsorted(sorted_labels, labels, right=right)[:, None] for right in (False, True)
    )
    entry = start + torch.arange(int((end - start).max()), device=labels.device)  # (N, P)
    positive = order[entry.clamp(max=len(labels) - 1)]
    return positive, (entry < end) & (positive != itself)


def _semihard_negatives(distance: Tensor, labels: Tensor, positive: Tensor) -> Tensor:
    """Choose (N, P) int64 the negative of every pair; sorted, as there are N x N x N triplets."""
    same = labels[:, None] == labels[None]
    negatives = distance.masked_fill(same, torch.inf)
    index = _argsort(negatives)
    rank = torch.searchsorted(
        negatives.gather(1, index), distance.gather(1, positive), right=True
    )  # first farther one
    num_negatives = (~same).sum(dim=1, keepdim=True)
    return index.gather(1, torch.minimum(rank, num_negatives - 1).clamp(min=0))


def _argsort(rows: Tensor) -> Tensor:
    """Sort each row; on a processor numpy does this several times faster than torch."""
    return (
        torch.from_numpy(rows.numpy().argsort(axis=1))
        if rows.device.type == "cpu"
        else rows.argsort(dim=1)
    )


def sgpn_double_hinge_loss(
    features: Tensor,
    semantic: Tensor,
    instance: Tensor,
    *,
    alpha: float = _ALPHA,
    margins: tuple[float, float] = _MARGINS,
) -> Tensor:
    """Compute SGPN's loss on its similarity matrix (Wang et al. 2018, equations 2, 3).

    The matrix is ten times the squared distances.

    Args:
        features: (N, E) float similarity features, not normalised, from ``SGPN.branches``.
        semantic: (N,) class index.
        instance: (N,) object id.
        alpha: Weight of pairs of one class but two objects.
        margins: K1, least entry for these pairs, and K2, least entry for pairs of two classes.

    Returns:
        The mean over all N x N pairs.
    """
    entry = _SCALE * _squared_distances(features)  # (N, N)
    same_object = instance[:, None] == instance[None]
    same_class = semantic[:, None] == semantic[None]
    near, far = margins
    apart = torch.where(same_class, alpha * torch.relu(near - entry), torch.relu(far - entry))
    return torch.where(same_object, entry, apart).mean()


def sgpn_confidence_loss(
    confidence: Tensor, features: Tensor, instance: Tensor, *, threshold: float = _MARGINS[0]
) -> Tensor:
    """Compute the squared error of SGPN's confidence.

    It expects the overlap (IoU) of each point's group with its object.

    Args:
        confidence: (N,) float from ``SGPN.branches``.
        features: (N, E) float similarity features; no gradient flows to them from here.
        instance: (N,) object id.
        threshold: Points with a smaller entry in a point's row of the similarity matrix are its
            group.

    Returns:
        The mean over the points.
    """
    group = _SCALE * _squared_distances(features.detach()) < threshold  # (N, N)
    same_object = instance[:, None] == instance[None]
    overlap = (group & same_object).sum(dim=1) / (group | same_object).sum(dim=1)
    return (confidence - overlap).square().mean()


def _squared_distances(vectors: Tensor) -> Tensor:
    """(N, N) squared Euclidean distances, never below 0."""
    length = vectors.square().sum(dim=1)
    return (length[:, None] + length[None] - 2 * vectors @ vectors.T).clamp(min=0)
