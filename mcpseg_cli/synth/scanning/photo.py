"""The camera on the tripod: exposure, white balance, noise, panoramas that do not quite fit."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.synth.scanning.sampling import Mesh, Samples
from mcpseg_cli.synth.surfaces.noise import Floats, fbm
from mcpseg_cli.synth.surfaces.styles import Style


def develop(
    mesh: Mesh,
    samples: Samples,
    painted: Floats,
    light: Floats,
    tripod: NDArray[np.int8],
    style: Style,
    rng: np.random.Generator,
) -> NDArray[np.uint8]:
    """Turn painted surfaces under light into the colours of a photo.

    Args:
        mesh: The room.
        samples: The points.
        painted: (N, 3) float32 colour of the surface, 0-255.
        light: (N, 3) float32 light on it, 1 on average.
        tripod: (N,) int8 which camera took it.
        style: The building's; sets the usual exposure.
        rng: Random numbers.

    Returns:
        (N, 3) uint8.
    """
    glow = np.array([part.material.glow for part in mesh.parts], np.float32)[samples.part]
    colour = _exposed(painted, light, glow, style, rng)

    # every view a little brighter or darker, and of another tint
    count = int(tripod.max()) + 1 if len(tripod) else 1
    tint = np.array([0.03, 0.0, -0.08]) * rng.normal(1, 1) + rng.normal(0, 0.02, 3)
    own = rng.normal(0, 0.1, (count, 1)) + rng.normal(0, 0.025, (count, 3))
    per_view = np.exp(tint + own).astype(np.float32)
    seed = np.full(len(colour), int(rng.integers(1 << 31)), np.uint32)
    patches = 0.94 + 0.12 * fbm(samples.xyz, 0.7, seed, 1)
    colour = colour * patches[:, None] * per_view[tripod]

    # highlights wash out softly; colours are pale at times
    knee = colour / (1 + np.maximum(colour - 0.6, 0) * 0.8)
    shown = 255 * np.clip(knee, 0, 1) ** np.float32(1 / 2.2)
    grey = shown.mean(axis=1, keepdims=True)
    shown = grey + (shown - grey) * np.float32(rng.uniform(0.5, 1.0))

    # noise in brightness and in colour
    shown += rng.standard_normal((len(shown), 1), np.float32) * np.float32(rng.uniform(1.5, 6))
    shown += rng.standard_normal(shown.shape, np.float32) * np.float32(rng.uniform(1, 3.5))
    photo: NDArray[np.uint8] = np.clip(shown, 0, 255).astype(np.uint8)
    return photo


def _exposed(
    painted: Floats, light: Floats, glow: Floats, style: Style, rng: np.random.Generator
) -> Floats:
    """Return the (N, 3) light that reaches the film, 0-1 where not too dark or too bright."""
    # cameras squeeze the range between lit and dark places, and take out some of the light's colour
    contrast = np.float32(rng.uniform(0.6, 1.0))
    cast = light.mean(axis=0) / max(float(light.mean()), 1e-6)
    balance = cast ** np.float32(-rng.uniform(*style.white_balance))
    lit = np.maximum(light, 1e-4) ** contrast * balance
    lit += np.minimum(glow, 2.0)[:, None] * np.float32(1.6)
    colour = (painted / 255) ** 2.2 * lit

    # exposed for the middle of the room, in some much too long or too short
    usual = np.median(colour[:: max(1, len(colour) // 20000)].mean(axis=1)) if len(colour) else 1.0
    draw = rng.random()
    exposure = rng.uniform(*style.exposure) * (0.35 if draw < 0.05 else 2.2 if draw < 0.09 else 1.0)
    gain = exposure * rng.uniform(0.17, 0.24) / max(float(usual), 0.02)
    exposed: Floats = colour * np.float32(gain)
    return exposed


def take_from_panorama(
    xyz: Floats,
    rgb: NDArray[np.uint8],
    tripod: NDArray[np.int8],
    tripods: NDArray[np.float64],
    rng: np.random.Generator,
) -> tuple[Floats, NDArray[np.uint8]]:
    """Give points the colour at their place in a panorama that is turned by a little.

    Args:
        xyz: (N, 3) float32, metres, map frame.
        rgb: (N, 3) uint8 right colours.
        tripod: (N,) int8 which camera took each.
        tripods: (T, 3) float64 places of the cameras, metres.
        rng: Random numbers: how far each panorama is off (up to 0.4 degrees), and which points fly.

    Returns:
        Places and colours; near edges colours come from what lies before or behind, and a few
        points hang in between.
    """
    # the pixel of each point, and the one its colour comes from
    width = int(rng.integers(700, 1400))
    pixel = np.radians(360.0 / width)
    ray = xyz - tripods.astype(np.float32)[tripod]
    reach = np.linalg.norm(ray, axis=1) + np.float32(1e-6)
    column = (np.arctan2(ray[:, 1], ray[:, 0]) + np.pi) / pixel
    row = np.arccos(np.clip(ray[:, 2] / reach, -1, 1)) / pixel
    shift = np.clip(rng.normal(0, 0.14, (len(tripods), 2)), -0.4, 0.4) * width / 360
    at_column, at_row = column.astype(np.int32) % width, row.astype(np.int32)
    from_column = (column + shift[tripod, 0]).astype(np.int32) % width
    from_row = np.clip((row + shift[tripod, 1]).astype(np.int32), 0, width // 2)

    # what is nearest there hides what is behind
    nearest = np.full((len(tripods), width // 2 + 1, width), -1, np.int32)
    _nearest(tripod, at_row, at_column, reach, nearest)
    source = nearest[tripod, from_row, from_column]
    source = np.where(source >= 0, source, np.arange(len(source), dtype=np.int32))

    # some points hang in between
    step = np.abs(reach[source] - reach)
    flying = (step > 0.12) & (step < 1.2) & (rng.random(len(step), np.float32) < 0.04)
    moved = xyz.copy()
    share = rng.random(int(flying.sum()), np.float32)[:, None]
    moved[flying] += share * (xyz[source[flying]] - xyz[flying])
    return moved, rgb[source]


@njit(cache=True, nogil=True)
def _nearest(
    tripod: NDArray[np.int8], row: NDArray[np.int32], column: NDArray[np.int32], reach: Floats,
    nearest: NDArray[np.int32],
) -> None:  # fmt: skip
    """Enter the nearest point of every pixel."""
    for point in range(len(row)):
        current = nearest[tripod[point], row[point], column[point]]
        if current < 0 or reach[point] < reach[current]:
            nearest[tripod[point], row[point], column[point]] = point
