"""Points to pixels without a graphics card: a camera, discs with a depth buffer, and shading."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numba import njit
from numpy.typing import NDArray

_NEAREST = 0.05  # metres in front of a perspective camera from which on points are drawn
_STEP_LIMIT = 0.6  # metres of depth beyond which an edge gets no darker
_DARKNESS = 2.5  # per metre of depth to the neighbours


@dataclass(frozen=True)
class Camera:
    """A view of the map.

    Attributes:
        centre: (3,) float64, metres, map frame: what lies in the middle of the picture.
        right: (3,) unit vector that points right in the picture.
        up: (3,) unit vector that points up in it.
        distance: Metres from the eye to ``centre``; None for parallel rays.
    """

    centre: NDArray[np.float64]
    right: NDArray[np.float64]
    up: NDArray[np.float64]
    distance: float | None = None

    @classmethod
    def aslant(
        cls,
        centre: NDArray[np.float64],
        yaw_deg: float,
        pitch_deg: float,
        distance: float | None = None,
    ) -> Camera:
        """Look at ``centre`` from above.

        Args:
            centre: (3,) float64, metres.
            yaw_deg: Turn of the view to the left of the y axis, about z.
            pitch_deg: How steeply to look down; at 90 y is up in the picture for a yaw of 0.
            distance: See the class.
        """
        yaw, pitch = np.deg2rad((yaw_deg, pitch_deg))
        right = np.array([np.cos(yaw), np.sin(yaw), 0.0])
        ahead = np.array(
            [-np.sin(yaw) * np.cos(pitch), np.cos(yaw) * np.cos(pitch), -np.sin(pitch)]
        )
        return cls(centre, right, np.cross(right, ahead), distance)

    def project(
        self, xyz: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Place points in the picture.

        Args:
            xyz: (N, 3) metres, map frame.

        Returns:
            (N, 2) right and up, metres at ``centre``; NaN for points behind the eye.
            (N,) depth, metres away from the eye; from ``centre`` for parallel rays.
            (N,) how large things look there, 1 at ``centre``.
        """
        offset = xyz - self.centre
        depth: NDArray[np.float64] = offset @ np.cross(self.up, self.right)
        plane = np.stack([offset @ self.right, offset @ self.up], axis=1)
        if self.distance is None:
            return plane, depth, np.ones(len(depth))
        depth = depth + self.distance
        size = np.divide(
            self.distance, depth, where=depth > _NEAREST, out=np.full(len(depth), np.nan)
        )
        return plane * size[:, None], depth, size


def draw_points(
    place: NDArray[np.float64],
    depth: NDArray[np.float64],
    radius: NDArray[np.float64],
    rgb: NDArray[np.uint8],
    shape: tuple[int, int],
    bulge: float,
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """Draw points as bulging discs; the nearer hides the farther, and neighbours meet halfway.

    Args:
        place: (N, 2) column and row of each centre, pixels from the picture's upper left corner.
        depth: (N,) distance from the eye.
        radius: (N,) pixels.
        rgb: (N, 3) uint8.
        shape: Rows and columns of the picture.
        bulge: How much nearer than its rim the middle of a disc is, in the unit of ``depth``.

    Returns:
        (rows, columns, 3) uint8, white where no point is, and (rows, columns) float32 depth,
        infinite there.
    """
    image = np.full((*shape, 3), 255, np.uint8)
    nearest = np.full(shape, np.inf, np.float32)
    seen = np.isfinite(place).all(axis=1)
    _draw_discs(
        place[seen], depth[seen].astype(np.float32), radius[seen], rgb[seen], bulge, image, nearest
    )
    return image, nearest


@njit(cache=True)
def _draw_discs(
    place: NDArray[np.float64],
    depth: NDArray[np.float32],
    radius: NDArray[np.float64],
    rgb: NDArray[np.uint8],
    bulge: float,
    image: NDArray[np.uint8],
    nearest: NDArray[np.float32],
) -> None:
    """Go through all pixels of all discs.

    A disc covers the pixels whose middle it covers, and the one that its own middle is in.
    """
    for i in range(place.shape[0]):
        x, y, r = place[i, 0], place[i, 1], radius[i]
        own_row, own_column = int(np.floor(y)), int(np.floor(x))
        if not (-r <= x < image.shape[1] + r and -r <= y < image.shape[0] + r):
            continue

        # only the pixels around it
        for row in range(max(0, int(y - r)), min(image.shape[0], int(y + r) + 1)):
            for column in range(max(0, int(x - r)), min(image.shape[1], int(x + r) + 1)):
                across, down = column + 0.5 - x, row + 0.5 - y
                share = (across * across + down * down) / (r * r)
                is_covered = share <= 1.0 or (row == own_row and column == own_column)
                here = np.float32(depth[i] + bulge * share)
                if is_covered and here < nearest[row, column]:
                    nearest[row, column] = here
                    image[row, column] = rgb[i]


def shade(
    image: NDArray[np.uint8], depth: NDArray[np.float32], reaches: Sequence[int]
) -> NDArray[np.uint8]:
    """Darken what lies behind its surroundings in the picture (after Boucheny 2009).

    Args:
        image: (rows, columns, 3) uint8.
        depth: (rows, columns) float32, metres, infinite where nothing is.
        reaches: Pixels to the neighbours that are looked at.

    Returns:
        (rows, columns, 3) uint8, a new array, in which shapes stand out.
    """
    ways = [way for way in product((-1, 0, 1), repeat=2) if way != (0, 0)]
    offsets = np.array([(reach * y, reach * x) for reach in reaches for y, x in ways])

    light = np.ones(depth.shape, np.float32)
    _shade(depth, offsets, light)
    shaded: NDArray[np.float32] = image * light[:, :, None]
    return shaded.astype(np.uint8)


@njit(cache=True)
def _shade(
    depth: NDArray[np.float32], offsets: NDArray[np.int64], light: NDArray[np.float32]
) -> None:
    """Give every pixel's share of light, by how far it lies behind neighbours at these offsets."""
    for row in range(depth.shape[0]):
        for column in range(depth.shape[1]):
            if not np.isfinite(depth[row, column]):
                continue
            behind = 0.0
            for k in range(offsets.shape[0]):
                y = min(max(row + offsets[k, 0], 0), depth.shape[0] - 1)
                x = min(max(column + offsets[k, 1], 0), depth.shape[1] - 1)
                behind += min(max(depth[row, column] - depth[y, x], 0.0), _STEP_LIMIT)
            light[row, column] = np.exp(-_DARKNESS * behind / offsets.shape[0])
