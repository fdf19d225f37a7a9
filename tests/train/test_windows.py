"""Windows of the growing map to train on: what is in them, in which order, how they are changed."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.config import WINDOW_SAMPLES, AugmentSettings, SampleSettings, WindowSettings
from mcpseg_cli.errors import McpsegError
from mcpseg_cli.networks.unet import NUM_LEVELS, forward_pairs
from mcpseg_cli.train.augmentation import Scene, change_places
from mcpseg_cli.train.replay import Replay
from mcpseg_cli.train.samples import AreaSamples, prepare_samples
from mcpseg_cli.train.window_objective import affinity_loss
from mcpseg_cli.train.windows import WindowSource, _lay, _leave, _see, _voxelise
from tests.areas import CLASSES, write_area

SAMPLES = SampleSettings.model_validate(WINDOW_SAMPLES)
OFF = AugmentSettings.off()


@pytest.fixture(scope="module")
def area(tmp_path_factory) -> AreaSamples:
    folder = write_area(tmp_path_factory.mktemp("areas") / "a", 6, unlabelled=True, density=3.0)
    return prepare_samples(folder, SAMPLES)


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def make_source(areas, augmentation=None, seed=0, size=2, classes=CLASSES, **windows):
    return WindowSource(
        areas,
        classes,
        windows_per_batch=size,
        settings=WindowSettings(**windows),
        augmentation=augmentation,
        seed=seed,
    )


def assert_same(one, other) -> None:
    for name in ("inputs", "semantic", "instance"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for left, right in zip(one.levels, other.levels, strict=True):
        assert torch.equal(left.neighbours, right.neighbours)


# samples without context


def test_samples_without_context_hold_what_each_scan_sees_and_are_mapped(tmp_path):
    folder = write_area(tmp_path / "a", 4)
    samples, replay = prepare_samples(folder, SAMPLES), Replay(folder, SAMPLES)
    scans = list(replay.run())
    assert isinstance(samples.seen, np.memmap)
    assert isinstance(samples.xyz, np.memmap)
    for number, scan in enumerate(scans):
        seen = samples.seen[slice(*samples.seen_starts[number : number + 2])]
        np.testing.assert_array_equal(seen, scan.seen)
        np.testing.assert_array_equal(samples.position[number], scan.position)
        assert samples.floor[number] == scan.floor
    for name in ("semantic", "instance"):
        np.testing.assert_array_equal(getattr(samples, name), getattr(replay, name))
    np.testing.assert_array_equal(samples.xyz, replay.map.xyz)
    assert samples.num_samples == len(samples.seen)


def test_samples_without_context_are_made_once(tmp_path):
    folder = write_area(tmp_path / "a", 3)
    before = prepare_samples(folder, SAMPLES).path.stat()
    after = prepare_samples(folder, SAMPLES).path.stat()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)


@pytest.mark.parametrize("name", ["seen", "xyz", "instance"])
def test_damaged_samples_without_context_are_made_anew(name, tmp_path):
    samples = prepare_samples(write_area(tmp_path / "a", 3), SAMPLES)
    whole, offset = samples.path.read_bytes(), getattr(samples, name).offset
    samples.path.write_bytes(whole[:offset] + b"\xff" + whole[offset + 1 :])
    prepare_samples(tmp_path / "a", SAMPLES)
    assert samples.path.read_bytes()[offset] == whole[offset]


# which points are in a window


def slow_see(area: AreaSamples, first: int, last: int, reach: float) -> dict[int, int]:
    """Points near scan ``last``, and how many of the scans saw each within reach."""
    looks: dict[int, int] = {}
    for scan in range(first, last + 1):
        for i in area.seen[area.seen_starts[scan] : area.seen_starts[scan + 1]].tolist():
            if np.hypot(*(area.xyz[i, :2] - area.position[scan, :2])) < reach:
                looks[i] = looks.get(i, 0) + 1
    place = area.position[last, :2]
    return {i: n for i, n in sorted(looks.items()) if np.hypot(*(area.xyz[i, :2] - place)) < reach}


@pytest.mark.parametrize(("first", "last"), [(0, 0), (0, 5), (2, 4), (5, 5)])
@pytest.mark.parametrize("reach", [0.4, 1.1, 1.73, 6.0])
def test_a_window_is_what_scans_in_a_row_saw_within_reach(area, first, last, reach):
    ids, looks = _see(area, first, last, reach)
    assert dict(zip(ids.tolist(), looks.tolist(), strict=True)) == slow_see(
        area, first, last, reach
    )


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), count=st.integers(1, 3000), spread=st.floats(0.2, 6))
def test_a_voxel_has_one_point_and_the_nearest_voxels_stay(seed, count, spread):
    rng = np.random.default_rng(seed)
    xyz = (rng.normal(size=(count, 3)) * spread).astype(np.float32)
    looks = rng.integers(1, 9, count).astype(np.uint8)
    rows, voxel, most = _voxelise(xyz, looks, WindowSettings(most_voxels=500))

    # the first of each voxel, and the most looks of any
    founder: dict[tuple[int, ...], int] = {}
    largest: dict[tuple[int, ...], int] = {}
    for i, each in enumerate(np.floor(xyz.astype(np.float64) / 0.1 + 0.5).astype(int).tolist()):
        founder.setdefault(tuple(each), i)
        largest[tuple(each)] = max(largest.get(tuple(each), 0), int(looks[i]))
    assert len(rows) == min(len(founder), 500)
    kept = [tuple(each) for each in voxel.tolist()]
    assert kept == sorted(set(kept))
    assert rows.tolist() == [founder[each] for each in kept]
    assert most.tolist() == [largest[each] for each in kept]

    # none left out is nearer than one kept
    left = np.setdiff1d(list(founder.values()), rows)
    away = np.hypot(*xyz[:, :2].T)
    assert not len(left) or away[left].min() >= away[rows].max() - 1e-5


def test_classes_are_matched_by_name_and_objects_are_the_areas(area):
    shuffled = ("lamp", "table", "floor")  # no wall
    one = next(make_source([area], size=1).epoch(0))
    other = next(make_source([area], size=1, classes=shuffled).epoch(0))
    expected = np.array([2, 255, 1, 0, *[255] * 252])[one.semantic]
    np.testing.assert_array_equal(other.semantic, expected)
    np.testing.assert_array_equal(other.instance > 0, one.instance > 0)
    assert {0, 1, 2, 255} == set(np.unique(one.semantic))


def test_a_young_map_shows_no_more_than_an_old_one(area):
    young = make_source([area], size=1, young=1.0, most_scans=1, shortest_range=5.0)
    old = make_source([area], size=1, young=0.0, shortest_range=5.0)
    pairs = list(zip(young.epoch(0), old.epoch(0), strict=True))
    assert all(len(a.semantic) <= len(b.semantic) for a, b in pairs)
    assert any(len(a.semantic) < len(b.semantic) for a, b in pairs)
    looked_once = np.float32(np.log1p(1) / 2 - 0.5)
    for batch, _ in pairs:
        np.testing.assert_allclose(batch.inputs[:, 9], looked_once, atol=1e-6)


# batches


def test_two_windows_of_a_batch_share_no_object_and_are_not_neighbours(area):
    source = make_source([area], size=3, shortest_range=5.0)
    for batch in source.epoch(0):
        sizes = [len(level) for level in batch.levels]
        assert len(batch.levels) == NUM_LEVELS
        assert sizes == sorted(sizes, reverse=True)

        # connected windows: at the coarsest level each is a few voxels near each other
        window = component(batch.levels)
        assert len(np.unique(window)) >= 3
        one, other = forward_pairs(batch.levels[0].neighbours)
        assert (window[one] == window[other]).all()
        for number in np.unique(batch.instance[batch.instance > 0]):
            assert len(np.unique(window[batch.instance == number])) == 1


def component(levels) -> np.ndarray:
    """Number the windows of a batch: what neighbours of any level join, from the finest voxels."""
    ancestor = np.arange(len(levels[0]))
    for level in levels[:-1]:
        ancestor = level.parent.numpy()[ancestor]
    table = levels[-1].neighbours.numpy()
    number = np.arange(len(table))
    for _ in range(len(table)):
        number = np.minimum.reduce(
            [number, *(np.where(k >= 0, number[k], number) for k in table.T)]
        )
    return number[ancestor]


def test_batches_depend_on_seed_epoch_and_place_only(area):
    source = make_source([area], AugmentSettings.of_windows(), seed=4)
    whole = list(source.epoch(1))
    assert len(whole) == len(source) == 3
    for one, other in zip(
        whole, make_source([area], AugmentSettings.of_windows(), seed=4).epoch(1), strict=True
    ):
        assert_same(one, other)
    for start in (1, 2, 3):
        rest = list(source.epoch(1, start=start))
        assert len(rest) == 3 - start
        for one, other in zip(whole[start:], rest, strict=True):
            assert_same(one, other)
    assert_same(next(source.epoch(1, rank=1, world=2)), whole[1])


@pytest.mark.parametrize(("seed", "epoch"), [(0, 1), (1, 0)])
def test_another_seed_or_epoch_draws_otherwise(area, seed, epoch):
    one = next(make_source([area]).epoch(0))
    other = next(make_source([area], seed=seed).epoch(epoch))
    assert not np.array_equal(one.inputs, other.inputs)


def test_every_scan_is_the_last_of_a_window_once_an_epoch(area, monkeypatch):
    source, drawn = make_source([area], size=2), []
    monkeypatch.setattr(
        "mcpseg_cli.train.windows._see",
        lambda area, first, last, reach: drawn.append(last) or _see(area, first, last, reach),
    )
    list(source.epoch(0))
    assert sorted(drawn) == list(range(6))


def test_too_few_scans_for_a_batch_are_refused(area):
    with pytest.raises(McpsegError, match="too few scans for a batch of windows"):
        make_source([area], size=7)


# augmentation


def make_scene(count: int = 4000) -> Scene:
    rng = np.random.default_rng(1)
    xyz = rng.uniform([-3, -3, 0], [3, 3, 2.8], (count, 3)).astype(np.float32)
    return Scene(xyz, np.full((count, 3), 99, np.float32), np.array([0.0, 0, 1.2]), 0.0)


def only(**parts: float) -> AugmentSettings:
    return OFF.model_copy(update=parts)


def test_without_augmentation_windows_are_as_the_robot_saw_them(area):
    settings = {"shortest_range": 5.0, "young": 0.0}
    plain, off = (
        next(make_source([area], each, size=1, **settings).epoch(0)) for each in (None, OFF)
    )
    assert_points_of(plain, area)
    assert_points_of(off, area)


def assert_points_of(batch, area: AreaSamples) -> None:
    """Every voxel's colour is one that the area has, and its height, too."""
    known = {tuple(rgb) for rgb in area.rgb.tolist()}
    colours = np.round((batch.inputs[:, :3] + 0.5) * 255).astype(int)
    assert {tuple(rgb) for rgb in colours.tolist()} <= known
    heights = 2 * (batch.inputs[:, 3] + 0.5)
    places = np.sort(area.xyz[:, 2] - area.floor.min())
    nearest = np.abs(places[np.searchsorted(places, heights).clip(1, len(places) - 1)] - heights)
    before = np.abs(places[np.searchsorted(places, heights).clip(1) - 1] - heights)
    assert np.minimum(nearest, before).max() < 0.02  # the floor of another scan


def test_holes_are_balls_within_which_nothing_is_left(rng):
    scene = make_scene()
    kept = _leave(scene, only(holes=1.0, hole_radius=0.8), rng)
    gone = np.setdiff1d(np.arange(len(scene.xyz)), kept)
    assert 0 < len(gone) < len(scene.xyz)

    # every point that is gone lies within 0.8 m of another that has nothing left around it
    for i in gone[::20]:
        away = np.linalg.norm(scene.xyz - scene.xyz[i], axis=1)
        centres = np.flatnonzero(away < 0.8)
        rims = [np.linalg.norm(scene.xyz[kept] - scene.xyz[c], axis=1).min() for c in centres]
        assert max(rims) >= 0.14


def test_without_a_ceiling_all_above_some_height_is_gone(rng):
    scene = make_scene()
    kept = _leave(scene, only(no_ceiling=1.0), rng)
    top = scene.xyz[kept, 2].max()
    assert 1.2 - 0.01 < top < 2.6
    np.testing.assert_array_equal(kept, np.flatnonzero(scene.xyz[:, 2] <= top))


def test_nothing_is_left_out_where_all_is_off(rng):
    scene = make_scene(700)
    np.testing.assert_array_equal(_leave(scene, OFF, rng), np.arange(700))


def test_a_scene_of_which_too_little_would_be_left_stays_whole(rng):
    scene = make_scene(520)
    for _ in range(20):
        kept = _leave(scene, only(no_ceiling=1.0, thinning=1.0, thinning_share=0.9), rng)
        assert len(kept) == 520 or len(kept) >= 500


def test_right_angles_turn_axes_into_axes():
    scene, angles = make_scene(50), set()
    for seed in range(30):
        turned = change_places(
            scene, only(turn_deg=180.0, right_angle=1.0), np.random.default_rng(seed)
        )
        turn = np.linalg.lstsq(scene.xyz[:, :2], turned.xyz[:, :2], rcond=None)[0]
        np.testing.assert_allclose(np.abs(turn).max(axis=0), 1, atol=1e-5)
        np.testing.assert_allclose(np.abs(turn).min(axis=0), 0, atol=1e-5)
        angles.add(round(np.degrees(np.arctan2(turn[0, 1], turn[0, 0]))) % 360)
    assert angles == {0, 90, 180, 270}


def test_a_window_is_shifted_with_its_floor_by_up_to_a_part_of_a_voxel():
    scene, shifts = make_scene(50), []
    for seed in range(40):
        settings, rng = only(grid_shift=0.5), np.random.default_rng(seed)
        laid = _lay(scene, settings, WindowSettings(voxel_size=0.1), rng)
        moved = laid.xyz - scene.xyz
        np.testing.assert_allclose(moved, np.broadcast_to(moved[0], moved.shape), atol=1e-5)
        assert laid.floor - scene.floor == pytest.approx(moved[0, 2], abs=1e-5)
        shifts.append(moved[0])
    assert np.abs(shifts).max() <= 0.0501
    assert np.abs(shifts).max(axis=0).min() > 0.03  # along all axes


def test_a_tilted_window_stays_where_the_robot_stands_and_keeps_its_plan(rng):
    scene = make_scene(200)
    laid = _lay(scene, only(tilt_deg=2.0), WindowSettings(), rng)
    np.testing.assert_array_equal(laid.xyz[:, :2], scene.xyz[:, :2])
    away = scene.xyz[:, :2] - scene.position[:2]
    rise = laid.xyz[:, 2] - scene.xyz[:, 2]
    slope, residual, *_ = np.linalg.lstsq(away, rise, rcond=None)  # through the robot's foot
    assert 0 < np.abs(slope).max() < np.tan(np.radians(10))
    assert residual.max(initial=0) < 1e-6


def test_augmented_windows_are_other_windows(area):
    plain, changed = (
        next(make_source([area], each, size=1).epoch(0))
        for each in (OFF, AugmentSettings.of_windows())
    )
    assert plain.inputs.shape[1] == changed.inputs.shape[1] == 14
    assert not np.array_equal(plain.inputs, changed.inputs)
    assert np.isfinite(changed.inputs).all()


# the loss of affinities


def test_rare_pairs_of_two_objects_weigh_more():
    rng = np.random.default_rng(0)
    affinity, same = rng.normal(size=300), rng.random(300) < 0.9
    share = same.mean()
    errors = [np.log1p(np.exp(-a if s else a)) for a, s in zip(affinity, same, strict=True)]
    weights = [(1 / share if s else 1 / (1 - share)) ** 0.5 for s in same]
    loss = affinity_loss(torch.tensor(affinity).float(), torch.tensor(same))
    assert loss.item() == pytest.approx(np.average(errors, weights=weights), rel=1e-5)


@pytest.mark.parametrize("count", [0, 5])
def test_pairs_of_one_kind_or_none_have_a_loss_that_is_a_number(count):
    affinity = torch.ones(count, requires_grad=True)
    loss = affinity_loss(affinity, torch.ones(count, dtype=torch.bool))
    loss.backward()
    assert torch.isfinite(loss)
    assert torch.isfinite(affinity.grad).all()
