"""Skins: pictures on triangles, as the meshes of models bring them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.synth.surfaces.noise import Floats


@dataclass(frozen=True)
class Skin:
    """A picture on the triangles of one part.

    Attributes:
        image: (H, W, 3) uint8, its first row at the top; repeats in both directions.
        uv: (F, 3, 2) float32 place of each corner in it, 0-1 from the lower left.
        tint: Factors of red, green and blue.
    """

    image: NDArray[np.uint8]
    uv: Floats
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)

    def colours(self, face: NDArray[np.int32], weights: Floats) -> Floats:
        """Return the (N, 3) float32 colours, 0-255, of points.

        Args:
            face: (N,) int32 triangle of each point.
            weights: (N, 3) float32 barycentric coordinates in it.
        """
        place = np.einsum("nk,nkc->nc", weights, self.uv[face])
        height, width = self.image.shape[:2]
        column = (np.floor(place[:, 0] * width).astype(np.int64)) % width
        row = (np.floor((1 - place[:, 1]) * height).astype(np.int64)) % height
        shown = self.image[row, column].astype(np.float32) * np.array(self.tint, np.float32)
        colours: Floats = np.clip(shown, 0, 255)
        return colours


def barycentric(xyz: Floats, triangles: NDArray[np.float64]) -> Floats:
    """Return the (N, 3) weights of the corners of triangles, (N, 3, 3), at points on them."""
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    step = xyz - triangles[:, 0]
    a, b = (first * first).sum(axis=1), (first * second).sum(axis=1)
    c, d = (second * second).sum(axis=1), (step * first).sum(axis=1)
    e = (step * second).sum(axis=1)
    scale = np.maximum(a * c - b * b, 1e-18)
    v, w = (c * d - b * e) / scale, (a * e - b * d) / scale
    weights: Floats = np.clip(np.column_stack([1 - v - w, v, w]), 0, 1).astype(np.float32)
    return weights
