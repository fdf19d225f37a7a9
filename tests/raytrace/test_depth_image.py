"""Depth images: where their rays go, what they lose, how they err."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.building import Building
from mcpseg_cli.raytrace.depth_image import (
    IMAGE_SHAPE,
    DepthImage,
    draw_noise,
    find_edges,
    find_lost,
    image_rays,
    shiny_voxels,
)

NUM_PIXELS = IMAGE_SHAPE[0] * IMAGE_SHAPE[1]
PLAIN = DepthImage(
    np.full(NUM_PIXELS, 2.0),
    np.ones(NUM_PIXELS),
    np.full(NUM_PIXELS, 150.0),
    np.zeros(NUM_PIXELS, bool),
)


def share_lost(**change: np.ndarray) -> float:
    return float(find_lost(replace(PLAIN, **change), np.random.default_rng(0)).mean())


@given(st.floats(60.0, 80.0))
@settings(max_examples=20, deadline=None)
def test_rays_fill_the_field_of_view_from_the_upper_left(field_deg):
    rays = image_rays(field_deg)
    azimuth = np.degrees(np.arctan2(rays[:, 1], rays[:, 0]))
    assert azimuth.max() == pytest.approx(-azimuth.min())
    assert azimuth.max() == pytest.approx(field_deg / 2, abs=0.5)
    assert (rays[0, 1:] > 0).all()
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0)


def test_a_bright_wall_in_front_has_no_holes():
    assert share_lost() == 0.0


@pytest.mark.parametrize(
    ("change", "least", "most"),
    [
        ({"brightness": np.full(NUM_PIXELS, 10.0)}, 0.3, 0.6),
        ({"is_shiny": np.ones(NUM_PIXELS, bool)}, 0.5, 0.9),
        ({"cosine": np.full(NUM_PIXELS, 0.1)}, 0.6, 0.95),
        ({"cosine": np.full(NUM_PIXELS, 0.02)}, 1.0, 1.0),
        ({"cosine": np.full(NUM_PIXELS, 0.5)}, 0.0, 0.0),
    ],
)
def test_dark_shiny_and_grazing_surfaces_have_holes(change, least, most):
    assert least <= share_lost(**change) <= most


def test_black_is_lost_more_from_afar():
    black = np.zeros(NUM_PIXELS)
    near = share_lost(brightness=black, depth=np.full(NUM_PIXELS, 1.0))
    far = share_lost(brightness=black, depth=np.full(NUM_PIXELS, 3.5))
    assert near < 0.4 < 0.7 < far


def test_holes_are_patches():
    dark = replace(PLAIN, brightness=np.full(NUM_PIXELS, 10.0))
    lost = find_lost(dark, np.random.default_rng(0)).reshape(IMAGE_SHAPE)
    alike = (lost[:, 1:] == lost[:, :-1]).mean()
    assert alike > lost.mean() ** 2 + (1 - lost.mean()) ** 2 + 0.1


@given(st.floats(0.0, 1.0), st.floats(-1.0, 1.0))
@settings(max_examples=20, deadline=None)
def test_a_plane_has_no_edges_however_slanted(across, down):
    y, x = np.mgrid[-0.5:0.5:120j, -0.5:0.5:160j]
    edge, thin = find_edges(2.0 / (1.0 + 0.9 * across * x + 0.9 * down * y))
    assert not edge.any()
    assert not thin.any()


def test_edges_are_beside_jumps_and_thin_things_have_two():
    depth = np.full(IMAGE_SHAPE, 3.0)
    depth[:, 100:] = 2.0
    depth[:, 50:52] = 2.0
    depth[0:10, 0:20] = np.inf
    edge, thin = find_edges(depth)
    assert np.flatnonzero(edge[60]).tolist() == [49, 50, 51, 52, 99, 100]
    assert np.flatnonzero(thin[60]).tolist() == [50, 51]
    assert not edge[0:10, 0:20].any()


def test_noise_is_standard_normal_and_in_part_smooth():
    noise = draw_noise(np.random.default_rng(0), (600, 600)).reshape(600, 600)
    assert noise.std() == pytest.approx(1.0, abs=0.05)
    beside = np.corrcoef(noise[:, 1:].ravel(), noise[:, :-1].ravel())[0, 1]
    assert beside == pytest.approx(0.5, abs=0.1)


def test_windows_are_shiny_walls_are_not_and_an_object_is_as_a_whole():
    instance = np.repeat(np.arange(1, 401), 5).astype(np.int32)
    names = ("window", "wall", "table", "lamp")
    semantic = np.repeat(np.arange(400) % 4, 5).astype(np.uint8)
    nothing = np.zeros((2000, 3))
    building = Building(
        nothing.astype(np.float32), nothing.astype(np.uint8), semantic, instance, names
    )
    shiny = shiny_voxels(building, np.arange(2000), seed=1).reshape(400, 5)
    assert (shiny == shiny[:, :1]).all()
    shares = [shiny[kind::4].mean() for kind in range(4)]
    assert shares[0] > 0.75
    assert shares[1] == 0.0
    assert 0.05 < shares[2] < 0.3
    assert 0.05 < shares[3] < 0.3
