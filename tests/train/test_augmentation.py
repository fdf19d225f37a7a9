"""What augmentation changes in a batch, and what it leaves."""

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.spatial import KDTree

from mcpseg_cli.config import AugmentSettings, SampleSettings
from mcpseg_cli.train.augmentation import (
    Cut,
    Scene,
    augment,
    change_colours,
    change_places,
    draw_cut,
    drop_context,
    hue_turn,
    replace_gone,
)
from mcpseg_cli.train.batches import BatchSource
from mcpseg_cli.train.samples import prepare_samples
from tests.areas import CLASSES, write_area

ROBOT = np.array([20.0, -7.0, 1.4])
SHARES = {
    "floor_lost_by": "floor_lost",
    "context_dropout_share": "context_dropout",
    "thinning_share": "thinning",
}
OF_WINDOWS = {
    "right_angle",
    "grid_shift",
    "tilt_deg",
    "holes",
    "hole_radius",
    "no_ceiling",
    "mixed_boxes",
    "mixed_things",
}  # see test_windows.py
OF_BATCHES = [name for name in AugmentSettings.model_fields if name not in OF_WINDOWS]


@pytest.fixture(scope="module")
def area(tmp_path_factory):
    return prepare_samples(
        write_area(tmp_path_factory.mktemp("areas") / "a"), SampleSettings(seen_again=60)
    )


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def only(**parts: float) -> AugmentSettings:
    return AugmentSettings.off().model_copy(update=parts)


def make_scene(count: int = 500) -> Scene:
    rng = np.random.default_rng(1)
    xyz = (ROBOT + rng.uniform(-2, 2, (count, 3))).astype(np.float32)
    return Scene(xyz, rng.integers(30, 226, (count, 3)).astype(np.float32), ROBOT, 0.4)


def around(scene: Scene) -> np.ndarray:
    """Points as the network sees them."""
    return scene.xyz - np.array([*scene.position[:2], scene.floor])


def batches(area, settings: AugmentSettings | None, batch_size: int = 2000, epochs: int = 1):
    source = BatchSource(
        [area],
        CLASSES,
        batch_size=batch_size,
        with_context=True,
        augmentation=settings,
        seed=0,
        samples_per_instance=0,
    )
    return [batch for number in range(epochs) for batch in source.epoch(number)]


def test_all_off_changes_nothing(rng):
    before, after = make_scene(), augment(make_scene(), AugmentSettings.off(), rng)
    for name in ("xyz", "rgb", "position", "floor"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))


def test_the_robots_position_is_not_changed_in_place(rng):
    position = ROBOT.copy()
    augment(replace(make_scene(), position=position), AugmentSettings(), rng)
    np.testing.assert_array_equal(position, ROBOT)


@pytest.mark.parametrize("name", OF_BATCHES)
def test_every_part_alone_changes_what_the_network_sees(area, name):
    largest = {
        "turn_deg": 90.0,
        "floor_lost_by": 0.3,
        "offset": 20.0,
        "hue_deg": 60.0,
        "colour_noise": 10.0,
    }
    value = largest.get(name, 0.5 if "scale" in name or "share" in name else 1.0)
    parts = {name: value} | ({SHARES[name]: 1.0} if name in SHARES else {})
    parts |= {share: 0.5 for share, part in SHARES.items() if part == name}
    changed, unchanged = batches(area, only(**parts)), batches(area, AugmentSettings.off())
    differ = [
        not (
            np.array_equal(left.centre, right.centre)
            and np.array_equal(left.context, right.context)
        )
        for left, right in zip(changed, unchanged, strict=True)
    ]
    assert sum(differ) >= area.num_scans - 2  # a first scan has no earlier ones


def test_a_turn_keeps_distances_from_the_robot_and_heights(rng):
    before, after = make_scene(), change_places(make_scene(), only(turn_deg=180), rng)
    np.testing.assert_allclose(
        np.hypot(*around(after)[:, :2].T), np.hypot(*around(before)[:, :2].T), atol=1e-5
    )
    np.testing.assert_allclose(around(after)[:, 2], around(before)[:, 2], atol=1e-6)


def test_turns_are_of_any_angle(rng):
    point = replace(make_scene(1), xyz=np.array([[21, -7, 1.4]], np.float32))
    turned = np.concatenate(
        [around(change_places(point, only(turn_deg=180), rng)) for _ in range(400)]
    )
    counts, _ = np.histogram(np.arctan2(turned[:, 1], turned[:, 0]), bins=8, range=(-np.pi, np.pi))
    assert counts.min() > 25


def test_a_mirror_swaps_left_and_right(rng):
    before, after = make_scene(), change_places(make_scene(), only(mirror=1), rng)
    np.testing.assert_allclose(around(after), around(before) * [1, -1, 1], atol=1e-5)


def test_scale_is_around_the_robots_foot_and_within_its_bounds(rng):
    for _ in range(20):
        ratio = around(
            change_places(make_scene(), only(scale=0.1, height_scale=0.04), rng)
        ) / around(make_scene())
        assert np.ptp(ratio, axis=0).max() < 0.01
        scale = np.median(ratio, axis=0)
        assert scale[0] == pytest.approx(scale[1], abs=1e-3)
        assert abs(scale[0] - 1) < 0.1001
        assert abs(scale[2] / scale[0] - 1) < 0.0401


def test_jitter_displaces_by_no_more_than_its_standard_deviation_says(rng):
    spread = [
        (change_places(make_scene(), only(jitter=0.02), rng).xyz - make_scene().xyz).std()
        for _ in range(30)
    ]
    assert 0.01 < max(spread) < 0.021
    assert min(spread) < 0.01


def test_an_offset_of_the_robot_moves_every_point_alike(rng):
    moved = around(change_places(make_scene(), only(robot_offset=0.2), rng)) - around(make_scene())
    assert np.ptp(moved, axis=0).max() < 1e-6
    assert 0 < np.abs(moved[0, :2]).max() <= 0.2
    assert moved[0, 2] == 0


def test_the_floor_errs_a_little_always_and_much_sometimes(rng):
    errors = np.array(
        [
            change_places(
                make_scene(5), only(floor_error=0.02, floor_lost=0.1, floor_lost_by=0.3), rng
            ).floor
            - 0.4
            for _ in range(2000)
        ]
    )
    assert abs(errors).max() < 0.4
    assert 0.07 < (abs(errors) > 0.08).mean() < 0.13
    assert np.std(errors[abs(errors) < 0.06]) == pytest.approx(0.02, rel=0.15)


def test_colours_stay_colours(rng):
    for _ in range(50):
        rgb = change_colours(
            make_scene(), AugmentSettings(gain=1, contrast=1, offset=255, colour_noise=99), rng
        ).rgb
        assert rgb.dtype == np.float32
        assert 0 <= rgb.min() <= rgb.max() <= 255


def test_without_colour_points_look_as_those_of_a_scan_without_colour(rng):
    assert (change_colours(make_scene(), AugmentSettings(grey=1), rng).rgb == 128).all()


def test_luminance_leaves_no_hue(rng):
    rgb = change_colours(make_scene(), AugmentSettings(grey=0, luminance=1), rng).rgb
    assert np.ptp(rgb, axis=1).max() == 0
    assert np.ptp(rgb) > 50


def test_a_hue_turn_leaves_greys_and_takes_red_to_green_to_blue():
    np.testing.assert_allclose(hue_turn(77) @ [9, 9, 9], [9, 9, 9], atol=1e-5)
    np.testing.assert_allclose(hue_turn(120) @ [1, 0, 0], [0, 1, 0], atol=1e-6)
    np.testing.assert_allclose(hue_turn(240) @ [1, 0, 0], [0, 0, 1], atol=1e-6)


def test_light_falls_off_to_one_side(rng):
    scene = replace(make_scene(), rgb=np.full((500, 3), 100, np.float32))
    rgb = change_colours(scene, only(light_gradient=0.2), rng).rgb[:, 0]
    design = np.column_stack([around(scene)[:, :2], np.ones(500)])
    slope, residual, *_ = np.linalg.lstsq(design, np.log(rgb), rcond=None)
    assert 0 < np.hypot(*slope[:2]) <= 0.2
    assert residual[0] < 1e-6


def test_a_half_space_is_cut_beyond_its_border():
    cut = Cut(np.array([1.0, 0.0]), 0.5)
    xyz = np.array([[0.4, 9, 0], [0.6, -9, 0], [-5, 0, 0]], np.float32) + ROBOT.astype(np.float32)
    assert cut.removes(xyz, ROBOT).tolist() == [False, True, False]


def test_all_but_a_sector_is_cut():
    cut = Cut(np.array([0.0, 1.0]), None, 45)
    xyz = np.array([[0, 1, 0], [0.9, 1, 0], [1.1, 1, 0], [0, -1, 0]], np.float32) + ROBOT.astype(
        np.float32
    )
    assert cut.removes(xyz, ROBOT).tolist() == [False, False, True, True]


def test_partial_views_are_as_frequent_as_asked_for_and_of_both_kinds(rng):
    cuts = [draw_cut(AugmentSettings(partial_view=0.3), rng) for _ in range(1000)]
    kinds = [cut.distance is None for cut in cuts if cut is not None]
    assert 250 < len(kinds) < 350
    assert 0.4 < np.mean(kinds) < 0.6


def test_beyond_a_cut_are_neither_points_nor_context(area, monkeypatch):
    monkeypatch.setattr(
        "mcpseg_cli.train.batches.draw_cut", lambda settings, rng: Cut(np.array([0.0, 1.0]), 0.3)
    )
    for batch in batches(area, AugmentSettings.off()):
        assert batch.centre[:, 1].max() < 0.3 + 1e-5
        assert (batch.centre[:, None, 1] + batch.context[..., 1]).max() < 0.3 + 1e-5


def test_a_cut_that_leaves_next_to_nothing_is_not_made(area, monkeypatch):
    monkeypatch.setattr(
        "mcpseg_cli.train.batches.draw_cut", lambda settings, rng: Cut(np.array([0.0, 1.0]), -9.0)
    )
    assert all(batch.centre[:, 1].max() > 1 for batch in batches(area, AugmentSettings.off()))


def distinct(area, settings: AugmentSettings) -> float:
    rows = np.concatenate([batch.context for batch in batches(area, settings, epochs=6)])
    return float(np.mean([len(np.unique(row[:, :3], axis=0)) for row in rows[::7]]))


def test_thinning_and_drop_out_leave_fewer_different_context_points(area):
    whole = distinct(area, AugmentSettings.off())
    assert distinct(area, only(thinning=1, thinning_share=0.9)) < 0.8 * whole
    assert distinct(area, only(context_dropout=1, context_dropout_share=0.9)) < 0.8 * whole


def test_context_of_the_same_scan_forgets_earlier_ones(area):
    trees = []
    for number in range(area.num_scans):
        scan = area.scan(number)
        trees.append(KDTree(area.xyz[scan.seen] - np.array([*scan.position[:2], scan.floor])))
    for settings, expected in ((only(same_scan=1), False), (only(), True)):
        remembered = []
        for batch in batches(area, settings):
            places = (batch.centre[:, None, :3] + batch.context[..., :3]).reshape(-1, 3)
            remembered.append(min(tree.query(places)[0].max() for tree in trees) > 1e-4)
        assert any(remembered) == expected


def test_context_turns_with_its_centre(area):
    plain, turned = (
        np.concatenate(
            [
                np.linalg.norm(batch.context[..., :2], axis=2).ravel()
                for batch in batches(area, settings)
            ]
        )
        for settings in (AugmentSettings.off(), only(turn_deg=180, mirror=1))
    )
    np.testing.assert_allclose(
        np.quantile(turned, np.arange(0, 1, 0.1)),
        np.quantile(plain, np.arange(0, 1, 0.1)),
        atol=0.01,
    )


def test_a_voxel_that_is_centre_and_context_is_displaced_once(area):
    for batch in batches(area, only(jitter=0.05, colour_noise=20), 64):
        own = np.linalg.norm(batch.context[..., :3], axis=2).min(axis=1)
        assert (own == 0).mean() > 0.1  # a voxel is a candidate of its own context


@pytest.mark.parametrize("seed", range(5))
def test_gone_context_is_replaced_by_the_rest_of_its_row(seed):
    rng = np.random.default_rng(seed)
    context, centre = rng.integers(0, 40, (30, 8)).astype(np.int32), np.arange(30, dtype=np.int32)
    gone = rng.random(40) < 0.7
    replaced = context.copy()
    replace_gone(replaced, centre, gone)
    for row, before, own in zip(replaced.tolist(), context.tolist(), centre.tolist(), strict=True):
        left = [voxel for voxel in before if not gone[voxel]] or [own]
        turn = iter(left * len(before))
        assert row == [next(turn) if gone[voxel] else voxel for voxel in before]


def test_dropped_context_repeats_the_first_columns(rng):
    context = np.arange(12, dtype=np.int32).reshape(2, 6)
    dropped = drop_context(context, only(context_dropout=1, context_dropout_share=1), rng)
    kept = len(np.unique(dropped[0]))
    np.testing.assert_array_equal(dropped, context[:, np.arange(6) % kept])
    assert kept < 6


@pytest.mark.parametrize(
    "wrong", [{"turn": 3}, {"grey": 1.5}, {"jitter": -1}, {"scale": float("nan")}]
)
def test_settings_out_of_range_are_refused(wrong):
    with pytest.raises(ValidationError):
        AugmentSettings(**wrong)


@pytest.mark.filterwarnings("error")
def test_a_scene_that_was_cut_away_whole_stays_empty_without_a_word(rng):
    scene = make_scene()
    empty = replace(scene, xyz=scene.xyz[:0], rgb=scene.rgb[:0])
    for _ in range(20):
        assert len(augment(empty, AugmentSettings.of_windows(), rng).xyz) == 0
