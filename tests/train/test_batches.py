"""Training batches: composition, determinism, and equality with what segmentation sees."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mcpseg_cli.config import AugmentSettings, SampleSettings
from mcpseg_cli.errors import McpsegError
from mcpseg_cli.incremental.context import context_input, network_input
from mcpseg_cli.train.batches import Batch, BatchSource
from mcpseg_cli.train.draws import choose_balanced, number_locally
from mcpseg_cli.train.samples import prepare_samples
from tests.areas import CLASSES, write_area


@pytest.fixture(scope="module")
def areas(tmp_path_factory):
    folder = tmp_path_factory.mktemp("areas")
    settings = SampleSettings(seen_again=60)
    return [
        prepare_samples(write_area(folder / f"Area_{seed}", 4 + seed, seed), settings)
        for seed in (1, 2)
    ]


def source(areas, **changes) -> BatchSource:
    options = {
        "batch_size": 64,
        "with_context": True,
        "augmentation": None,
        "seed": 3,
        "classes": CLASSES,
    }
    return BatchSource(areas, **(options | changes))


def assert_equal(first: Batch, second: Batch) -> None:
    for name in ("centre", "context", "semantic", "instance"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


def looks(area, only_new: bool) -> set[bytes]:
    """Every sample of an area as segmentation computes its input."""
    found = set()
    for number in range(area.num_scans):
        scan = area.scan(number)
        last = scan.num_new if only_new and scan.num_new >= 32 else None
        ids, context = scan.voxel[:last], scan.context[:last]
        centre = network_input(area.xyz[ids], area.rgb[ids], scan.position, scan.floor)
        rows = context_input(ids, context, area.xyz, area.rgb).reshape(len(ids), -1)
        found |= {row.tobytes() for row in np.concatenate([centre, rows], axis=1)}
    return found


def rows_of(batch: Batch) -> set[bytes]:
    rows = np.concatenate([batch.centre, batch.context.reshape(len(batch.centre), -1)], axis=1)
    return {row.tobytes() for row in rows}


@pytest.mark.parametrize("augmentation", [None, AugmentSettings.off()], ids=["none", "off"])
def test_without_augmentation_batches_are_bit_for_bit_what_segmentation_sees(areas, augmentation):
    plain = source(areas[:1], batch_size=2000, samples_per_instance=0, augmentation=augmentation)
    assert set().union(*map(rows_of, plain.epoch(0))) == looks(areas[0], only_new=True)


def test_balanced_batches_draw_from_later_looks_too(areas):
    balanced = source(areas[:1], batch_size=2000, plain_share=0.0)
    assert set().union(*map(rows_of, balanced.epoch(0))) == looks(areas[0], only_new=False)


def test_arrays_have_the_shapes_and_types_of_the_networks(areas):
    batch = next(source(areas, augmentation=AugmentSettings()).epoch(0))
    assert (batch.centre.shape, batch.context.shape) == ((64, 6), (64, 50, 6))
    assert batch.centre.dtype == batch.context.dtype == np.float32
    assert batch.semantic.dtype == batch.instance.dtype == np.int64
    assert batch.semantic.shape == batch.instance.shape == (64,)


def test_without_context_there_is_none(areas):
    batch = next(
        source(areas, batch_size=1024, with_context=False, augmentation=AugmentSettings()).epoch(0)
    )
    assert batch.context is None
    assert batch.centre.shape == (1024, 6)


def test_labels_belong_to_their_points(areas):
    for batch in source(areas, augmentation=None).epoch(0):
        height, side = batch.centre[:, 2], batch.centre[:, 1]
        np.testing.assert_array_equal(batch.instance == 1, batch.semantic == CLASSES.index("floor"))
        assert (abs(height[batch.instance == 1]) < 0.05).all()
        assert (abs(side[batch.instance == 2] + 1.2) < 1e-3).all()
        assert (abs(side[batch.instance == 3] - 1.2) < 1e-3).all()


def test_an_epoch_draws_from_every_scan_once(areas):
    batches = source(areas)
    assert len(batches) == len(list(batches.epoch(0))) == sum(area.num_scans for area in areas)


def test_the_same_seed_gives_the_same_batches(areas):
    first, second = (source(areas, augmentation=AugmentSettings()) for _ in range(2))
    for left, right in zip(first.epoch(5), second.epoch(5), strict=True):
        assert_equal(left, right)


@pytest.mark.parametrize("change", [{"seed": 4}, {"epoch": 6}])
def test_another_seed_or_epoch_gives_others(areas, change):
    first = next(source(areas).epoch(5))
    second = next(source(areas, seed=change.get("seed", 3)).epoch(change.get("epoch", 5)))
    assert not np.array_equal(first.centre, second.centre)


def test_starting_later_continues_exactly(areas):
    batches = source(areas, augmentation=AugmentSettings())
    whole = list(batches.epoch(1))
    for left, right in zip(whole[3:], batches.epoch(1, start=3), strict=True):
        assert_equal(left, right)


def test_ranks_share_the_batches_of_one_process(areas):
    batches = source(areas, augmentation=AugmentSettings())
    whole = list(batches.epoch(1))
    for world in (2, 3, 4):
        parts = [list(batches.epoch(1, rank=rank, world=world)) for rank in range(world)]
        assert [len(part) for part in parts] == [len(whole) // world] * world
        for rank, part in enumerate(parts):
            for left, right in zip(part, whole[rank::world], strict=False):
                assert_equal(left, right)


def test_a_rank_that_starts_later_continues_exactly(areas):
    batches = source(areas)
    whole = list(batches.epoch(1, rank=1, world=2))
    for left, right in zip(whole[2:], batches.epoch(1, rank=1, world=2, start=2), strict=True):
        assert_equal(left, right)


@settings(max_examples=50, deadline=None)
@given(
    sizes=st.lists(st.integers(1, 90), min_size=1, max_size=12),
    count=st.integers(1, 200),
    per_instance=st.integers(1, 32),
    seed=st.integers(0, 1000),
)
def test_balanced_draws_repeat_no_point_unless_there_are_too_few(sizes, count, per_instance, seed):
    instance = np.repeat(np.arange(1, len(sizes) + 1), sizes).astype(np.int32)
    rows = choose_balanced(instance, count, per_instance, np.random.default_rng(seed))
    assert len(rows) == count
    assert len(np.unique(rows)) == min(count, len(instance)) or count > len(instance)
    assert set(rows.tolist()) <= set(range(len(instance)))


def test_balanced_draws_take_small_objects_as_often_as_large_ones():
    instance = np.repeat([1, 2, 3, 4, 5, 6], [4000, 100, 100, 100, 100, 100]).astype(np.int32)
    rng = np.random.default_rng(0)
    drawn = np.concatenate([instance[choose_balanced(instance, 64, 16, rng)] for _ in range(400)])
    shares = np.bincount(drawn, minlength=7)[1:] / len(drawn)
    np.testing.assert_allclose(shares, 1 / 6, atol=0.02)


def test_an_object_gives_at_most_its_share_at_a_time():
    instance = np.repeat([1, 2, 3], 500).astype(np.int32)
    rows = choose_balanced(instance, 64, 16, np.random.default_rng(1))
    assert (np.bincount(instance[rows]) % 16 == 0).all()


def test_plain_batches_keep_the_proportions_of_the_scan(areas):
    counts = np.zeros((2, 5))
    for row, per_instance in enumerate((0, 16)):
        for epoch in range(20):
            for batch in source(areas, samples_per_instance=per_instance, plain_share=0.0).epoch(
                epoch
            ):
                counts[row] += np.bincount(batch.instance, minlength=5)
    floor, balanced_floor = counts[:, 1] / counts.sum(axis=1)
    assert floor > balanced_floor + 0.05


def test_points_without_object_or_class_are_context_only(tmp_path):
    area = prepare_samples(write_area(tmp_path / "a", unlabelled=True), SampleSettings())
    for batch in source([area], augmentation=AugmentSettings()).epoch(0):
        assert (batch.instance > 0).all()
        assert (batch.semantic < len(CLASSES)).all()
    unlabelled = np.flatnonzero((area.instance == 0) | (area.semantic == 255))
    assert np.isin(area.scan(0).context, unlabelled).any()


def test_areas_with_another_class_order_are_matched_by_name(areas, tmp_path):
    order = ("table", "lamp", "wall", "floor")
    turned = prepare_samples(write_area(tmp_path / "a", 5, 1, order), SampleSettings(seen_again=60))
    for left, right in zip(source(areas[:1]).epoch(0), source([turned]).epoch(0), strict=True):
        assert_equal(left, right)


def test_classes_that_the_network_lacks_are_not_drawn(areas):
    batches = source(areas, classes=("table", "wall"))
    assert {int(label) for batch in batches.epoch(0) for label in batch.semantic} == {0, 1}
    assert {int(number) for batch in batches.epoch(0) for number in batch.instance} == {2, 3, 4}


def test_a_class_table_names_labels_by_the_classes_they_mean(areas):
    mapping = {"wall": "building", "floor": "building", "table": "table"}
    batches = source(areas, classes=("table", "building"), mapping=mapping)
    for batch in batches.epoch(0):
        np.testing.assert_array_equal(batch.semantic == 0, batch.instance == 4)
    assert {int(label) for batch in batches.epoch(0) for label in batch.semantic} == {0, 1}


def test_areas_without_a_known_class_are_refused_in_one_line(areas):
    with pytest.raises(McpsegError, match="no scan shows an object of the classes sofa") as caught:
        source(areas, classes=("sofa",))
    assert "\n" not in str(caught.value)


def test_scans_with_too_few_points_are_filled_up(tmp_path):
    area = prepare_samples(write_area(tmp_path / "a", density=0.05), SampleSettings())
    for batch in source([area], batch_size=256, augmentation=AugmentSettings()).epoch(0):
        assert batch.centre.shape == (256, 6)


def test_local_numbers_are_those_of_a_dictionary():
    rng = np.random.default_rng(0)
    for size, top in ((0, 1), (1, 1), (1000, 30), (5000, 2**31 - 1)):
        ids = rng.integers(0, top, size).astype(np.int32)
        unique, number = number_locally(ids)
        places = {voxel: place for place, voxel in enumerate(dict.fromkeys(ids.tolist()))}
        assert unique.tolist() == list(places)
        assert number.tolist() == [places[voxel] for voxel in ids.tolist()]
