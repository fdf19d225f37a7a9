"""Reliability: bins over confidence, and how far they are from what is right."""

import numpy as np
import pytest

from mcpseg_cli.reliability import measure_reliability


def slow_error(confidence, is_right, num_bins):
    """The formula of Guo et al. 2017 word by word."""
    total = 0.0
    for m in range(1, num_bins + 1):
        inside = [
            n
            for n, c in enumerate(confidence)
            if (m - 1) / num_bins < c <= m / num_bins or (m == 1 and c == 0)
        ]
        if inside:
            accuracy = sum(bool(is_right[n]) for n in inside) / len(inside)
            mean = sum(float(confidence[n]) for n in inside) / len(inside)
            total += len(inside) / len(confidence) * abs(accuracy - mean)
    return total


@pytest.mark.parametrize("num_bins", [1, 7, 10, 15])
def test_the_error_is_that_of_the_formula(num_bins):
    rng = np.random.default_rng(num_bins)
    confidence = np.concatenate([rng.random(500), [0.0, 1.0]])
    is_right = rng.random(502) < confidence**2
    found = measure_reliability(confidence, is_right, num_bins)
    assert found.expected_error == pytest.approx(slow_error(confidence, is_right, num_bins))
    assert found.count.sum() == 502


def test_perfect_confidence_has_no_error():
    confidence = np.repeat([0.25, 0.5, 1.0], 100)
    is_right = np.concatenate([np.arange(100) < 25, np.arange(100) < 50, np.ones(100, bool)])
    assert measure_reliability(confidence, is_right).expected_error == pytest.approx(0, abs=1e-12)


def test_confidence_that_is_always_wrong_is_all_error():
    found = measure_reliability(np.ones(5, np.float32), np.zeros(5, bool))
    assert found.expected_error == 1.0


def test_two_maps_together_are_as_one():
    rng = np.random.default_rng(3)
    confidence, is_right = rng.random(100), rng.random(100) < 0.5
    parts = [measure_reliability(confidence[p], is_right[p]) for p in (slice(40), slice(40, 100))]
    both, whole = parts[0] + parts[1], measure_reliability(confidence, is_right)
    assert both.expected_error == pytest.approx(whole.expected_error)


def test_nothing_has_no_error():
    nothing = measure_reliability(np.empty(0), np.empty(0, bool))
    assert nothing.expected_error is None
    assert np.isnan(nothing.accuracy).all()
