"""Windows mixed with others: what is exchanged, what is added, and what stays."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.train.augmentation import Scene
from mcpseg_cli.train.mixing import (
    LabelledScene,
    add_things,
    exchange_box,
    standing_things,
)

SEEDS = st.integers(0, 2**32 - 1)


def make_window(xyz, *, floor=0.0, robot=(0.0, 0.0), semantic=1, instance=1) -> LabelledScene:
    xyz = np.asarray(xyz, np.float32).reshape(-1, 3)
    count = len(xyz)
    scene = Scene(xyz, np.full((count, 3), 90, np.float32), np.array([*robot, 1.0]), floor)
    return LabelledScene(
        scene,
        np.ones(count, np.uint8),
        np.full(count, semantic, np.uint8),
        np.full(count, instance, np.int32),
    )


def box_of_points(lowest, highest, count=200, seed=0):
    return np.random.default_rng(seed).uniform(lowest, highest, (count, 3))


def floor_of_points(half=3.0, count=2000, height=0.0):
    return box_of_points((-half, -half, height), (half, half, height + 0.01), count)


def together(*windows) -> LabelledScene:
    scene = windows[0].scene
    xyz, rgb = (
        np.concatenate([getattr(each.scene, name) for each in windows]) for name in ("xyz", "rgb")
    )
    return LabelledScene(
        Scene(xyz, rgb, scene.position, scene.floor),
        *(
            np.concatenate([getattr(each, name) for each in windows])
            for name in ("looks", "semantic", "instance")
        ),
    )


@settings(deadline=None, max_examples=30)
@given(seed=SEEDS)
def test_a_box_holds_the_other_windows_points_only_and_around_it_nothing_changes(seed):
    mine = make_window(box_of_points((-3, -3, 0), (3, 3, 2), 800), semantic=1)
    its = make_window(box_of_points((-3, -3, 0), (3, 3, 2), 800, seed=1), semantic=2)
    mixed = exchange_box(mine, its, np.random.default_rng(seed))
    taken = mixed.scene.xyz[mixed.semantic == 2]
    assert len(taken) > 0
    lowest, highest = taken[:, :2].min(axis=0), taken[:, :2].max(axis=0)
    kept = mixed.scene.xyz[mixed.semantic == 1]
    assert not ((kept[:, :2] >= lowest) & (kept[:, :2] <= highest)).all(axis=1).any()
    assert len(np.unique(np.concatenate([kept, mine.scene.xyz]), axis=0)) == len(mine.scene.xyz)


def test_a_part_keeps_its_place_about_the_robot_and_its_height_over_the_floor():
    mine = make_window(floor_of_points(), robot=(10, 20), floor=1.0)
    its = make_window(
        box_of_points((4.9, 4.9, 5.5), (5.1, 5.1, 5.6)), robot=(5, 4), floor=5.0, semantic=2
    )
    mixed = exchange_box(mine, its, np.random.default_rng(0))
    middle = mixed.scene.xyz[mixed.semantic == 2].mean(axis=0)
    np.testing.assert_allclose(middle, (10, 21, 1.55), atol=0.05)


@pytest.mark.parametrize("mix", [exchange_box, add_things])
@settings(deadline=None, max_examples=20)
@given(seed=SEEDS)
def test_no_object_of_another_window_has_the_number_of_one_of_the_windows(mix, seed):
    mine = make_window(floor_of_points(), semantic=1, instance=5)
    its = make_window(box_of_points((-1, -1, 0), (0, 0, 1)), semantic=2, instance=5)
    mixed = mix(mine, its, np.random.default_rng(seed))
    numbers = [set(mixed.instance[mixed.semantic == kind].tolist()) for kind in (1, 2)]
    assert not numbers[0] & numbers[1]


def test_points_of_no_object_stay_without_one():
    mine, its = (
        make_window(floor_of_points()),
        make_window(floor_of_points(), semantic=2, instance=0),
    )
    mixed = exchange_box(mine, its, np.random.default_rng(0))
    assert set(mixed.instance[mixed.semantic == 2].tolist()) == {0}


@pytest.mark.parametrize(
    ("lowest", "highest", "count"),
    [
        ((0, 0, 0.5), (1, 1, 1), 0),  # hangs
        ((0, 0, 0), (3, 1, 1), 0),  # too long
        ((0, 0, 0), (1, 1, 0.1), 0),  # flat, as a rug
        ((0, 0, 0), (1, 1, 1), 1),
    ],
)
def test_things_stand_on_the_floor_and_are_no_part_of_the_building(lowest, highest, count):
    window = make_window(box_of_points(lowest, highest))
    assert len(standing_things(window)) == count


@settings(deadline=None, max_examples=30)
@given(seed=SEEDS)
def test_a_thing_is_added_whole_and_keeps_its_shape(seed):
    shape = box_of_points((0, 0, 0), (0.6, 0.4, 1))
    mine = make_window(floor_of_points(height=2.0), floor=2.0)
    its = make_window(shape, semantic=2, robot=(1, 1))
    added = add_things(mine, its, np.random.default_rng(seed))
    placed = added.scene.xyz[added.semantic == 2]
    assert len(added.scene.xyz) == len(mine.scene.xyz) + len(shape)
    np.testing.assert_allclose(placed[:, 2], shape[:, 2] + 2, atol=1e-5)
    apart = [np.linalg.norm(each[1:] - each[:-1], axis=1) for each in (placed, shape)]
    np.testing.assert_allclose(*apart, atol=1e-4)


def test_a_thing_stands_on_no_other():
    full = make_window(box_of_points((-3, -3, 0), (3, 3, 1.5), 20000))
    room = together(make_window(floor_of_points()), full)
    its = make_window(box_of_points((0, 0, 0), (1, 1, 1)), semantic=2)
    for seed in range(10):
        mixed = add_things(room, its, np.random.default_rng(seed))
        assert len(mixed.scene.xyz) == len(room.scene.xyz)


def test_a_window_without_points_gives_nothing():
    mine, nothing = make_window(floor_of_points()), make_window([])
    assert exchange_box(mine, nothing, np.random.default_rng(0)) is mine
    assert add_things(mine, nothing, np.random.default_rng(0)) is mine
