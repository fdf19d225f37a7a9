"""Painting: every pattern, and the noise under it."""

import numpy as np
import pytest

from mcpseg_cli.synth.surfaces.materials import Material
from mcpseg_cli.synth.surfaces.noise import fbm, hash01
from mcpseg_cli.synth.surfaces.textures import PATTERNS, paint_points


def paint(pattern, seed=1, count=2000, scale=0.3):
    rng = np.random.default_rng(0)
    xyz = rng.uniform(-1, 1, (count, 3)).astype(np.float32)
    normals = np.tile(np.float32([0, 0, 1]), (count, 1))
    return paint_points(
        Material(pattern, (150, 110, 70), (70, 60, 40), scale, seed), xyz, normals, rng
    )


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_pattern_gives_colours_in_range_that_vary(pattern):
    colour = paint(pattern)
    assert colour.dtype == np.float32
    assert 0 <= colour.min() <= colour.max() <= 255
    assert colour.std(axis=0).min() > 1


@pytest.mark.parametrize("pattern", PATTERNS)
def test_the_same_seed_paints_the_same_and_another_does_not(pattern):
    assert np.array_equal(paint(pattern), paint(pattern))
    assert not np.array_equal(paint(pattern), paint(pattern, seed=2))


@pytest.mark.parametrize("pattern", PATTERNS)
def test_nothing_to_paint_is_no_error(pattern):
    none = np.zeros((0, 3), np.float32)
    assert paint_points(
        Material(pattern, (1, 2, 3), (4, 5, 6)), none, none, np.random.default_rng(0)
    ).shape == (0, 3)


def test_tiles_have_grout_along_their_edges():
    place = np.linspace(0.01, 1.19, 600, dtype=np.float32)
    xyz = np.column_stack([place, np.full_like(place, 0.15), np.zeros_like(place)])
    normals = np.tile(np.float32([0, 0, 1]), (len(place), 1))
    tiles, rng = Material("tiles", (200, 200, 200), (20, 20, 20), 0.3), np.random.default_rng(0)
    colour = paint_points(tiles, xyz, normals, rng)

    dark = np.flatnonzero(colour[:, 0] < 80)
    assert len(dark)
    assert (np.abs(place[dark] / 0.3 - np.round(place[dark] / 0.3)) < 0.02).all()


def test_noise_is_the_same_as_its_slow_twin():
    xyz = np.random.default_rng(3).uniform(-4, 4, (60, 3)).astype(np.float32)
    seed = np.full(60, 9, np.uint32)
    fast = fbm(xyz, 1.7, seed, 2)
    slow = [
        sum(slow_noise(point * np.float32(1.7) * 2.03**k, 9 + k) * 0.5**k for k in range(2)) / 1.5
        for point in xyz
    ]
    assert np.allclose(fast, slow, atol=1e-4)


def test_noise_spreads_around_a_half():
    values = fbm(
        np.random.default_rng(4).uniform(-50, 50, (5000, 3)).astype(np.float32),
        1.0,
        np.zeros(5000, np.uint32),
        3,
    )
    assert 0 <= values.min() < 0.3 < 0.7 < values.max() <= 1
    assert values.mean() == pytest.approx(0.5, abs=0.03)


def test_cells_get_even_random_numbers():
    cells = np.arange(20_000, dtype=np.int32)
    values = hash01(cells % 100, cells // 100, np.full(20_000, 3, np.uint32))
    assert np.abs(np.histogram(values, 10, (0, 1))[0] / 2000 - 1).max() < 0.1


def slow_lattice(x, y, z, seed):
    mask = 0xFFFFFFFF
    h = ((x * 0x8DA6B343) & mask) ^ ((y * 0xD8163841) & mask) ^ ((z * 0xCB1AB31F) & mask)
    h ^= (seed * 0x9E3779B1) & mask
    h = ((h ^ (h >> 16)) * 0x85EBCA6B) & mask
    h = ((h ^ (h >> 13)) * 0xC2B2AE35) & mask
    h ^= h >> 16
    return (h >> 8) / 16777216


def slow_noise(point, seed):
    cell = np.floor(point).astype(int)
    share = (point - cell) ** 2 * (3 - 2 * (point - cell))
    total = 0.0
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod([s if c else 1 - s for s, c in zip(share, corner, strict=True)])
        total += weight * slow_lattice(*(int(v) for v in cell + corner), seed)
    return total
