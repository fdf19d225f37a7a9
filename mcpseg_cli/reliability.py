"""Whether confidence is what it says: shares of right labels by confidence (Guo et al. 2017)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

NUM_BINS = 15
"""Bins of the expected calibration error, as in the paper."""


@dataclass(frozen=True)
class Reliability:
    """What is in each of B bins of equal width over confidence, those of 0 first.

    Attributes:
        count: (B,) int64 labels.
        right: (B,) int64 those of them that are right.
        confidence: (B,) float64 sum of their confidences.
    """

    count: NDArray[np.int64]
    right: NDArray[np.int64]
    confidence: NDArray[np.float64]

    def __add__(self, other: Reliability) -> Reliability:
        """Take the labels of both together."""
        return Reliability(
            self.count + other.count, self.right + other.right, self.confidence + other.confidence
        )

    @property
    def accuracy(self) -> NDArray[np.float64]:
        """(B,) share of right labels; NaN in an empty bin."""
        return self._mean(self.right)

    @property
    def mean_confidence(self) -> NDArray[np.float64]:
        """(B,) mean confidence; NaN in an empty bin."""
        return self._mean(self.confidence)

    @property
    def expected_error(self) -> float | None:
        """Expected calibration error (Guo et al. 2017, equation 5); None without a label.

        The mean over labels of how far the accuracy in their bin is from the mean confidence there.
        """
        total = int(self.count.sum())
        return float(np.abs(self.right - self.confidence).sum()) / total if total else None

    def _mean(self, sums: NDArray[np.generic]) -> NDArray[np.float64]:
        """Give (B,) means, NaN in an empty bin."""
        empty = np.full(len(self.count), np.nan)
        mean: NDArray[np.float64] = np.divide(sums, self.count, out=empty, where=self.count > 0)
        return mean


def measure_reliability(
    confidence: NDArray[np.floating], is_right: NDArray[np.bool_], num_bins: int = NUM_BINS
) -> Reliability:
    """Sort labels into bins by confidence.

    Args:
        confidence: (N,) in 0-1; a bin holds its upper border, the first also 0.
        is_right: (N,) whether each label is right.
        num_bins: B.

    Returns:
        The bins; all empty without labels.
    """
    confidence = np.clip(confidence.astype(np.float64), 0, 1)
    number = np.clip(np.ceil(confidence * num_bins).astype(np.int64) - 1, 0, num_bins - 1)
    return Reliability(
        np.bincount(number, minlength=num_bins),
        np.bincount(number[is_right], minlength=num_bins),
        np.bincount(number, confidence, num_bins).astype(np.float64),
    )
