"""Training losses against loops over pairs and triplets."""

import numpy as np
import pytest
import torch
from torch.nn import functional

from mcpseg_cli.train.losses import (
    classification_loss,
    sgpn_confidence_loss,
    sgpn_double_hinge_loss,
    triplet_semihard_loss,
)

LABELS = {
    "a few objects": [0, 0, 1, 1, 1, 2, 2, 0, 3, 3],
    "one point alone": [0, 0, 0, 0, 0, 0, 0, 0, 0, 7],
    "one object only": [4] * 10,
    "all different": list(range(10)),
    "two points": [1, 1],
    "one point": [1],
}


def points(num_points: int, seed: int = 0, dtype: torch.dtype = torch.float64) -> torch.Tensor:
    rng = np.random.default_rng(seed)
    return functional.normalize(torch.from_numpy(rng.normal(size=(num_points, 4))).to(dtype), dim=1)


def with_duplicates(embedding: torch.Tensor) -> torch.Tensor:
    """Positions of a coarse grid, whose distances tie exactly, each taken several times."""
    return (2 * embedding).round() / 2


def slow_distance(a: np.ndarray, b: np.ndarray) -> float:
    return float(((a - b) ** 2).sum())


def slow_triplet_loss(embedding: np.ndarray, labels: list[int], margin: float) -> float:
    losses = []
    for i, anchor in enumerate(embedding):
        negatives = [
            slow_distance(anchor, embedding[k])
            for k in range(len(labels))
            if labels[k] != labels[i]
        ]
        for j, other in enumerate(embedding):
            if i == j or labels[i] != labels[j] or not negatives:
                continue
            positive = slow_distance(anchor, other)
            farther = [negative for negative in negatives if negative > positive]
            losses.append(
                max(0.0, margin + positive - (min(farther) if farther else max(negatives)))
            )
    return float(np.mean(losses)) if losses else 0.0


def slow_hinge_loss(features: np.ndarray, semantic: list[int], instance: list[int]) -> float:
    total = 0.0
    for i in range(len(features)):
        for j in range(len(features)):
            entry = 10 * slow_distance(features[i], features[j])
            if instance[i] == instance[j]:
                total += entry
            elif semantic[i] == semantic[j]:
                total += 10 * max(0.0, 10 - entry)
            else:
                total += max(0.0, 80 - entry)
    return total / len(features) ** 2


@pytest.mark.parametrize("name", LABELS)
@pytest.mark.parametrize("duplicates", [False, True])
@pytest.mark.parametrize("margin", [0.2, 1.0])
def test_the_triplet_loss_equals_a_loop_over_triplets(name, duplicates, margin):
    labels = LABELS[name]
    for seed in range(5):
        embedding = points(len(labels), seed)
        embedding = with_duplicates(embedding) if duplicates else embedding
        loss = triplet_semihard_loss(embedding, torch.tensor(labels), margin)
        assert float(loss) == pytest.approx(
            slow_triplet_loss(embedding.numpy(), labels, margin), abs=1e-12
        )


def test_the_triplet_loss_of_a_large_batch_equals_the_loop():
    labels = np.random.default_rng(0).integers(0, 12, 90)
    embedding = points(90, dtype=torch.float32)
    loss = triplet_semihard_loss(embedding, torch.from_numpy(labels).int())
    assert float(loss) == pytest.approx(
        slow_triplet_loss(embedding.numpy(), labels.tolist(), 1.0), abs=1e-5
    )


@pytest.mark.parametrize("name", ["a few objects", "one point alone"])
def test_the_triplet_loss_has_the_gradient_of_its_value(name):
    labels = torch.tensor(LABELS[name])
    embedding = points(len(labels)).requires_grad_()
    assert torch.autograd.gradcheck(
        lambda vectors: triplet_semihard_loss(vectors, labels), embedding
    )


@pytest.mark.parametrize("name", ["one object only", "all different", "one point"])
def test_batches_without_triplets_leave_the_network_alone(name):
    embedding = points(len(LABELS[name])).requires_grad_()
    loss = triplet_semihard_loss(embedding, torch.tensor(LABELS[name]))
    loss.backward()
    assert loss.item() == 0.0
    assert embedding.grad.abs().sum() == 0.0


def test_points_that_are_all_equal_cost_the_margin():
    embedding = points(1).expand(6, -1).clone().requires_grad_()
    loss = triplet_semihard_loss(embedding, torch.tensor([0, 0, 0, 1, 1, 1]), 0.5)
    loss.backward()
    assert loss.item() == pytest.approx(0.5)
    assert torch.isfinite(embedding.grad).all()


def test_the_order_of_points_does_not_matter_to_any_loss():
    labels, order = torch.tensor(LABELS["a few objects"]), torch.randperm(10)
    embedding, kind = points(10), torch.arange(10) % 3
    for value, shuffled in (
        (
            triplet_semihard_loss(embedding, labels),
            triplet_semihard_loss(embedding[order], labels[order]),
        ),
        (
            sgpn_double_hinge_loss(embedding, kind, labels),
            sgpn_double_hinge_loss(embedding[order], kind[order], labels[order]),
        ),
    ):
        torch.testing.assert_close(value, shuffled)


@pytest.mark.parametrize("weighted", [False, True])
def test_the_class_loss_is_the_mean_over_known_points(weighted):
    logits, semantic = (
        3 * points(10),
        torch.tensor([0, 1, 255, 3, 2, 255, 1, 1, 0, 255], dtype=torch.uint8),
    )
    weights = torch.tensor([1.0, 0.5, 2.0, 0.1], dtype=torch.float64) if weighted else None
    known = semantic != 255
    expected = functional.cross_entropy(logits[known], semantic[known].long(), weights)
    torch.testing.assert_close(classification_loss(logits, semantic, weights), expected)
    several = classification_loss(logits.view(2, 5, 4), semantic.view(2, 5), weights)
    torch.testing.assert_close(several, expected)


def test_a_batch_of_unknown_classes_costs_nothing():
    logits = points(3).requires_grad_()
    loss = classification_loss(logits, torch.full((3,), 255))
    loss.backward()
    assert loss.item() == 0.0
    assert logits.grad.abs().sum() == 0.0


def test_the_class_loss_has_the_gradient_of_its_value():
    semantic = torch.tensor([0, 255, 3, 1])
    weights = torch.tensor([1.0, 0.5, 2.0, 0.1], dtype=torch.float64)
    logits = points(4).requires_grad_()
    assert torch.autograd.gradcheck(
        lambda values: classification_loss(values, semantic, weights), logits
    )


@pytest.mark.parametrize("name", LABELS)
@pytest.mark.parametrize("size", [0.3, 1.0, 3.0])
def test_the_double_hinge_loss_equals_a_loop_over_pairs(name, size):
    instance = LABELS[name]
    semantic = [label // 2 for label in instance]
    features = size * points(len(instance))
    loss = sgpn_double_hinge_loss(features, torch.tensor(semantic), torch.tensor(instance))
    assert float(loss) == pytest.approx(
        slow_hinge_loss(features.numpy(), semantic, instance), rel=1e-9
    )


def test_the_double_hinge_loss_has_the_gradient_of_its_value():
    instance = torch.tensor(LABELS["a few objects"])
    features = (1.1 * points(10)).requires_grad_()
    assert torch.autograd.gradcheck(
        lambda values: sgpn_double_hinge_loss(values, instance // 2, instance), features, atol=1e-4
    )


def test_confidence_is_drawn_to_the_overlap_of_group_and_object():
    features = torch.tensor([[0.0], [0.1], [0.2], [9.0]])
    instance = torch.tensor([1, 1, 2, 2])  # the first three are one group, the last is alone
    overlap = torch.tensor([2 / 3, 2 / 3, 1 / 4, 1 / 2])
    assert sgpn_confidence_loss(overlap, features, instance).item() == pytest.approx(0.0, abs=1e-12)
    assert sgpn_confidence_loss(overlap + 0.5, features, instance).item() == pytest.approx(0.25)
