"""Colours, the renderer and pictures of maps."""

import numpy as np
import pytest

from mcpseg_cli.classes import HOME_CLASSES, S3DIS_CLASSES
from mcpseg_cli.errors import InputError
from mcpseg_cli.export import picture
from mcpseg_cli.export.colours import (
    COLOUR_BY,
    UNKNOWN_COLOUR,
    EmbeddingColours,
    class_palette,
    colouring,
    confidence_colours,
    instance_colours,
)
from mcpseg_cli.export.legend import scale_entry
from mcpseg_cli.export.picture import write_picture, write_turntable
from mcpseg_cli.export.raster import Camera, draw_points, shade
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.export.views import PictureSettings
from mcpseg_cli.segment.labelled_run import LabelledRun

WHITE = (255, 255, 255)


@pytest.fixture
def run(labelled_run, monkeypatch):
    monkeypatch.setattr(picture, "_SIZE", 400)  # smaller is quicker
    monkeypatch.setattr(picture, "_TURNTABLE_SIZE", 120)
    with LabelledRun(labelled_run.out) as run:
        yield run


def distances(colours):
    """(N, N) distances between colours."""
    return np.linalg.norm(colours[:, None].astype(float) - colours[None], axis=2)


@pytest.mark.parametrize(
    "classes",
    [S3DIS_CLASSES, HOME_CLASSES, ("pipe", "valve", "floor", "pump", "tank", "stairs", "rail")],
)
def test_classes_are_told_apart_whatever_they_are_called(classes):
    palette = class_palette(classes)
    apart = distances(palette[: len(classes)]) + 1e9 * np.eye(len(classes))
    assert apart.min() > 25
    assert (palette[255] == UNKNOWN_COLOUR).all()


def test_the_next_objects_have_colours_far_from_one_another():
    apart = distances(instance_colours(np.arange(1, 500)))
    for step in range(1, 5):
        assert np.median(np.diagonal(apart, step)) > 80
        assert np.diagonal(apart, step).min() > 25


def test_an_object_has_its_colour_in_any_company():
    alone = instance_colours(np.array([7]))
    in_company = instance_colours(np.array([0, 3, 7, 7, 9000]))
    assert (in_company[2] == alone[0]).all()
    assert (in_company[3] == alone[0]).all()
    assert (in_company[0] == UNKNOWN_COLOUR).all()


def test_confidence_runs_from_dark_to_light():
    colours = confidence_colours(np.linspace(0, 1, 50, dtype=np.float32))
    assert (np.diff(colours.astype(int).sum(axis=1)) > 0).all()


def test_embedding_colours_follow_the_widest_spread():
    rng = np.random.default_rng(0)
    group = rng.integers(0, 2, 400)
    embedding = rng.normal(0, 0.01, (400, 50)).astype(np.float32)
    embedding[:, 11] += np.where(group, 0.9, -0.9)
    red = EmbeddingColours.fit(embedding)(embedding)[:, 0]
    assert red[group == 1].min() > 240
    assert red[group == 0].max() < 15


@pytest.mark.parametrize("by", COLOUR_BY)
def test_every_colouring_gives_a_colour_for_every_voxel(run, by):
    whole = run.whole()
    colours = colouring(run, by)(whole)
    assert (colours.shape, colours.dtype) == ((len(whole), 3), np.uint8)
    assert len(np.unique(colours, axis=0)) > 1


def draw_slowly(place, depth, radius, rgb, shape, bulge):
    """Draw discs pixel by pixel over the whole picture."""
    image, nearest = np.full((*shape, 3), 255, np.uint8), np.full(shape, np.inf, np.float32)
    middle_x, middle_y = np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5)
    for (x, y), z, r, colour in zip(place, depth.astype(np.float32), radius, rgb, strict=True):
        if np.isnan(x):
            continue
        share = ((middle_x - x) ** 2 + (middle_y - y) ** 2) / (r * r)
        own = (np.abs(middle_x - x) <= 0.5) & (np.abs(middle_y - y) <= 0.5)
        here = (z + bulge * share).astype(np.float32)
        wins = ((share <= 1) | own) & (here < nearest)
        nearest[wins], image[wins] = here[wins], colour
    return image, nearest


def test_discs_are_drawn_as_the_slow_way_draws_them():
    rng = np.random.default_rng(3)
    place, depth = rng.uniform(-5, 45, (300, 2)), rng.uniform(1, 9, 300)
    radius = rng.uniform(0.2, 4.0, 300)
    place[:3] = np.nan
    rgb = rng.integers(0, 255, (300, 3)).astype(np.uint8)
    image, nearest = draw_points(place, depth, radius, rgb, (30, 40), 0.2)
    expected_image, expected_nearest = draw_slowly(place, depth, radius, rgb, (30, 40), 0.2)
    np.testing.assert_allclose(nearest, expected_nearest, rtol=1e-6)
    assert (image == expected_image).all(axis=2).mean() > 0.999


def test_the_camera_from_above_keeps_the_map_upright():
    camera = Camera.aslant(np.array([1.0, 2.0, 0.0]), 0.0, 90.0)
    plane, depth, size = camera.project(np.array([[3.0, 5.0, 0.0], [1.0, 2.0, 4.0]]))
    np.testing.assert_allclose(plane, [[2, 3], [0, 0]], atol=1e-12)
    np.testing.assert_allclose(depth, [0, -4], atol=1e-12)
    np.testing.assert_array_equal(size, 1.0)


def test_in_perspective_the_nearer_is_larger_and_what_is_behind_the_eye_is_not_seen():
    camera = Camera.aslant(np.zeros(3), 0.0, 0.0, distance=10.0)  # looks along y from y = -10
    plane, depth, size = camera.project(
        np.array([[1.0, 0, 0], [1.0, -5, 0], [1.0, 10, 0], [1.0, -11, 0]])
    )
    np.testing.assert_allclose(depth, [10, 5, 20, -1])
    np.testing.assert_allclose(size[:3], [1, 2, 0.5])
    np.testing.assert_allclose(plane[:3, 0], [1, 2, 0.5])
    assert np.isnan(plane[3]).all()


def shade_slowly(image, depth, reaches):
    """Sum up how far every pixel lies behind shifted copies of the depth."""
    reach = max(reaches)
    padded, behind = np.pad(depth, reach, mode="edge"), np.zeros(depth.shape)
    for step in reaches:
        for down, across in ((y, x) for y in (-1, 0, 1) for x in (-1, 0, 1)):
            top, left = reach + step * down, reach + step * across
            near = padded[top : top + len(depth), left : left + depth.shape[1]]
            with np.errstate(invalid="ignore"):
                behind += np.nan_to_num(np.clip(depth - near, 0.0, 0.6), nan=0.0)
    behind[~np.isfinite(depth)] = 0.0
    return (image * np.exp(-2.5 * behind / (8 * len(reaches)))[:, :, None]).astype(np.uint8)


def test_shading_is_that_of_the_slow_way():
    rng = np.random.default_rng(4)
    depth = rng.uniform(1, 3, (30, 40)).astype(np.float32)
    depth[rng.random((30, 40)) < 0.3] = np.inf
    image = rng.integers(0, 255, (30, 40, 3)).astype(np.uint8)
    found, expected = (way(image, depth, (1, 3, 7)).astype(int) for way in (shade, shade_slowly))
    assert np.abs(found - expected).max() <= 1


def test_shading_darkens_behind_a_step_and_nothing_else():
    depth = np.full((20, 30), 5.0, np.float32)
    depth[:, 15:] = 4.0
    depth[:5] = np.inf
    shaded = shade(np.full((20, 30, 3), 200, np.uint8), depth, (2, 4))
    assert (shaded[10:, :8] == 200).all()
    assert (shaded[10:, 14] < 160).all()
    assert (shaded[10:, 16:] == 200).all()
    assert (shaded[:5] == 200).all()


def picture_of(run, path, selection=Selection(), **settings):  # noqa: B008
    from PIL import Image

    write_picture(run, path, selection, PictureSettings(**settings))
    with Image.open(path) as file:
        return np.asarray(file.convert("RGB"))


@pytest.mark.parametrize("view", ["top", "cut", "perspective"])
def test_a_picture_shows_the_classes_that_its_legend_names(run, tmp_path, view):
    drawn = picture_of(run, tmp_path / "map.png", view=view)
    colours = np.unique(drawn.reshape(-1, 3), axis=0)
    present = np.unique(run.whole().semantic)
    for colour in class_palette(run.classes)[present]:
        assert (colours == colour).all(axis=1).any()
    assert (drawn == WHITE).all(axis=2).mean() < 0.9


def test_the_same_run_gives_the_same_picture(run, tmp_path):
    first, second = (picture_of(run, tmp_path / "map.png", colour_by="instance") for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_what_is_above_the_cut_is_left_out(run, tmp_path):
    counts = [
        write_picture(run, tmp_path / "map.png", Selection(), PictureSettings(cut=cut))
        for cut in (0.2, 1.0, np.inf)
    ]
    heights = run.whole().xyz[:, 2]
    assert counts[0] < counts[1] < counts[2] == len(run)
    assert counts[1] == pytest.approx((heights < 1.0).sum(), rel=0.03)  # floor at 0, but for noise


def test_nothing_under_the_cut_is_one_line_and_leaves_no_file(run, tmp_path):
    with pytest.raises(InputError, match="nothing in the map"):
        write_picture(run, tmp_path / "map.png", Selection(), PictureSettings(cut=-5.0))
    assert not list(tmp_path.iterdir())


def test_a_turntable_turns(run, tmp_path):
    from PIL import Image

    selection = Selection(box=(-0.5, -2, 0, 0.5, 2, 1))
    write_turntable(run, tmp_path / "map.gif", selection, PictureSettings())
    with Image.open(tmp_path / "map.gif") as file:
        assert file.n_frames == 48
        frames = []
        for number in (0, 12):
            file.seek(number)
            frames.append(np.asarray(file.convert("RGB")).astype(int))
    assert (np.abs(frames[0] - frames[1]).sum(axis=2) > 60).mean() > 0.02


@pytest.mark.parametrize("width", [120, 1600])
@pytest.mark.parametrize("pixels", [0.31, 7.0, 160.0, 4000.0])
def test_a_scale_is_a_round_number_of_metres_and_as_long_as_it_says(width, pixels):
    entry = scale_entry(width, pixels)
    metres = float(entry.name.removesuffix(" m"))
    assert float(f"{metres:.0e}"[0]) in (1, 2, 5)
    assert entry.length == round(metres * pixels)
    assert 0.06 * width - 1 <= entry.length <= 0.16 * width + 1


def test_the_scale_is_that_of_the_map(run, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(
        picture, "scale_entry", lambda *size: asked.append(size) or scale_entry(*size)
    )
    drawn = picture_of(run, tmp_path / "map.png", view="top")
    [(width, metre)] = asked
    assert width == drawn.shape[1]

    # the corridor is drawn as wide as it is, and a voxel's disc on either side
    is_drawn = (drawn[: int(0.8 * len(drawn))] != 255).any(axis=2).any(axis=0)
    columns = np.flatnonzero(is_drawn)
    across = np.ptp(run.whole().xyz[:, 0]) + 2 * run.voxel_size
    assert np.ptp(columns) / metre == pytest.approx(across, rel=0.05)


def test_pictures_of_one_voxel_do_not_fail(run, tmp_path):
    x, y, z = run.whole().xyz[0].tolist()
    selection = Selection(box=(x, y, z, x, y, z))
    for view in ("top", "cut", "perspective"):
        assert picture_of(run, tmp_path / "map.png", selection, view=view).size
