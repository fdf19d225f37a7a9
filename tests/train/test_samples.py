"""Replay of ray-traced areas and the files their samples are kept in."""

import multiprocessing
import os
import pickle
import resource
from concurrent.futures import ThreadPoolExecutor

import h5py
import numpy as np
import pytest

from mcpseg_cli.config import AugmentSettings, SampleSettings, SegmentSettings
from mcpseg_cli.errors import InputError, OutputError
from mcpseg_cli.formats import read_cloud
from mcpseg_cli.formats.recording import read_scan
from mcpseg_cli.incremental.context import context_input, network_input
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.train.fold_data import DataSettings, prepare
from mcpseg_cli.train.folds import find_areas
from mcpseg_cli.train.replay import Replay, founding_points, list_scans
from mcpseg_cli.train.samples import AreaSamples, prepare_samples
from tests.areas import CLASSES, write_area
from tests.commands import MOST_S

SETTINGS = SampleSettings(seen_again=40)


@pytest.fixture
def area(tmp_path):
    return write_area(tmp_path / "area")


def contents(samples: AreaSamples) -> list[np.ndarray]:
    scans = [samples.scan(number) for number in range(samples.num_scans)]
    arrays = [
        np.concatenate([getattr(scan, name) for scan in scans])
        for name in ("voxel", "context", "seen")
    ]
    facts = np.array([[scan.num_new, scan.floor, *scan.position] for scan in scans])
    return [*arrays, facts, samples.xyz, samples.rgb, samples.semantic, samples.instance]


def assert_same(first: AreaSamples, second: AreaSamples) -> None:
    for left, right in zip(contents(first), contents(second), strict=True):
        np.testing.assert_array_equal(left, right)


class Spy:
    """Notes what a segmenter gives its network, by voxel."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.centre: list[np.ndarray] = []
        self.context: dict[int, np.ndarray] = {}
        monkeypatch.setattr("mcpseg_cli.incremental.classification.network_input", self.note_centre)
        monkeypatch.setattr(
            "mcpseg_cli.incremental.classification.context_input", self.note_context
        )

    def note_centre(self, *arguments: object) -> np.ndarray:
        self.centre.append(network_input(*arguments))
        return self.centre[-1]

    def note_context(self, ids: np.ndarray, *arguments: object) -> np.ndarray:
        rows = context_input(ids, *arguments)
        self.context |= dict(zip(ids.tolist(), rows, strict=True))
        return rows


@pytest.mark.parametrize("colour", [True, False])
@pytest.mark.parametrize("floor", ["map", "scan-min", 0.25])
def test_new_voxels_look_to_training_exactly_as_they_do_to_segmentation(
    tmp_path, weights_path, monkeypatch, floor, colour
):
    area = write_area(tmp_path / "area", num_scans=3, colour=colour)
    samples = prepare_samples(area, SETTINGS.model_copy(update={"floor": floor}))
    spy = Spy(monkeypatch)
    segmenter = IncrementalSegmenter.load(str(weights_path), SegmentSettings(floor=floor))
    for number, source in enumerate(list_scans(area)):
        spy.centre.clear()
        segmenter.register_scan(read_scan(source, "map", 0.1)[0])
        scan = samples.scan(number)
        new, context = scan.voxel[: scan.num_new], scan.context[: scan.num_new]
        centre = network_input(samples.xyz[new], samples.rgb[new], scan.position, scan.floor)
        np.testing.assert_array_equal(centre, np.concatenate(spy.centre))
        rows = context_input(new, context, samples.xyz, samples.rgb)
        np.testing.assert_array_equal(
            rows, np.stack([spy.context[voxel] for voxel in new.tolist()])
        )


def test_a_voxel_has_the_label_of_the_point_that_founded_it(area):
    samples = prepare_samples(area, SETTINGS)
    truth = {}
    for source in list_scans(area):
        cloud = read_cloud(area / "gt" / source.path.name)
        labels = zip(
            cloud.columns["semantic"].tolist(), cloud.columns["instance"].tolist(), strict=True
        )
        truth |= dict(zip(map(tuple, cloud.xyz.tolist()), labels, strict=True))
    found = zip(
        samples.xyz.tolist(), samples.semantic.tolist(), samples.instance.tolist(), strict=True
    )
    assert all(truth[tuple(xyz)] == (semantic, instance) for xyz, semantic, instance in found)


def test_every_voxel_is_new_once_and_some_are_looked_at_again(area):
    samples = prepare_samples(area, SETTINGS)
    scans = [samples.scan(number) for number in range(samples.num_scans)]
    new = np.concatenate([scan.voxel[: scan.num_new] for scan in scans])
    assert sorted(new.tolist()) == list(range(len(samples.xyz)))
    assert [len(scan.voxel) - scan.num_new for scan in scans] == [0, 40, 40, 40, 40]
    for scan in scans:
        assert len(np.unique(scan.voxel)) == len(scan.voxel)
        assert np.isin(scan.voxel, scan.seen).all()


def test_context_comes_from_this_and_earlier_scans_only(area):
    samples = prepare_samples(area, SETTINGS)
    seen_before = 0
    for number in range(samples.num_scans):
        scan = samples.scan(number)
        seen_before += scan.num_new
        assert scan.context.max() < seen_before
    assert (~np.isin(scan.context, scan.seen)).any()


@pytest.mark.parametrize("seed", range(3))
def test_founding_points_are_the_first_of_each_new_voxel(seed):
    rng = np.random.default_rng(seed)
    voxel_map = VoxelMap(0.5)
    for _ in range(3):
        xyz, first_new = rng.uniform(0, 3, (200, 3)).astype(np.float32), len(voxel_map)
        ids = voxel_map.insert(xyz, np.zeros((200, 3), np.uint8))
        founders = founding_points(ids, first_new)
        expected = [ids.tolist().index(voxel) for voxel in range(first_new, len(voxel_map))]
        assert founders.tolist() == expected


def test_no_points_found_nothing():
    assert len(founding_points(np.empty(0, np.int32), 7)) == 0


def test_a_valid_file_is_used_again(area):
    prepare_samples(area, SETTINGS)
    before = (area / "samples.h5").stat().st_mtime_ns
    calls = []
    prepare_samples(area, SETTINGS, progress=lambda *done: calls.append(done))
    assert (area / "samples.h5").stat().st_mtime_ns == before
    assert calls == []


def test_progress_is_told_scan_by_scan(area):
    calls = []
    prepare_samples(area, SETTINGS, progress=lambda *done: calls.append(done))
    assert calls == [(number, 5) for number in range(1, 6)]


def touch(area):
    os.utime(area / "gt" / "000002.ply", (1, 1))


def edit_poses(area):
    text = (area / "poses.csv").read_text()
    (area / "poses.csv").write_text(text.replace("0.800000", "0.900000", 1))


def edit_record(area):
    (area / "raytrace.json").write_text("{}")


@pytest.mark.parametrize("change", [touch, edit_poses, edit_record])
def test_a_changed_area_is_replayed_again(area, change):
    prepare_samples(area, SETTINGS)
    change(area)
    calls = []
    prepare_samples(area, SETTINGS, progress=lambda *done: calls.append(done))
    assert len(calls) == 5


def test_changed_settings_give_other_samples(area):
    prepare_samples(area, SETTINGS)
    coarse = prepare_samples(
        area, SETTINGS.model_copy(update={"context_window": "coarse", "num_context": 20})
    )
    assert coarse.scan(0).context.shape[1] == 20


def test_the_same_area_gives_the_same_samples(area, tmp_path):
    assert_same(
        prepare_samples(area, SETTINGS), prepare_samples(area, SETTINGS, tmp_path / "again.h5")
    )


def test_blocks_do_not_change_the_samples(area, tmp_path, monkeypatch):
    whole = prepare_samples(area, SETTINGS)
    monkeypatch.setattr("mcpseg_cli.train.samples._BLOCK", 100)
    assert_same(whole, prepare_samples(area, SETTINGS, tmp_path / "again.h5"))


def test_a_cut_or_changed_file_is_made_again(area, tmp_path):
    path = tmp_path / "samples.h5"
    whole = prepare_samples(area, SETTINGS)
    content = (area / "samples.h5").read_bytes()
    rng = np.random.default_rng(0)
    for place in rng.integers(0, len(content), 12).tolist():
        damaged = bytearray(content)
        damaged[place] ^= 0x55
        for bad in (content[:place], bytes(damaged)):
            path.write_bytes(bad if bad[:8] == content[:8] else b"")
            assert_same(prepare_samples(area, SETTINGS, path), whole)


@pytest.mark.parametrize("table", ["context", "seen"])
def test_a_table_that_is_lost_after_the_file_was_checked_is_told_in_one_line(area, table, tmp_path):
    prepare_samples(area, SETTINGS, tmp_path / "samples.h5")
    with h5py.File(tmp_path / "samples.h5", "r+") as file:
        del file[table]
    samples = AreaSamples(tmp_path / "samples.h5")
    with pytest.raises(InputError, match=f"{table} that cannot be read"):
        samples.scan(0)


def test_a_file_in_which_a_class_has_another_name_is_made_again(area, tmp_path):
    path = tmp_path / "samples.h5"
    whole = prepare_samples(area, SETTINGS, path).classes
    with h5py.File(path, "r+") as file:
        text = file.attrs["classes"].decode()
        file.attrs["classes"] = np.bytes_(text.replace(whole[0], whole[0][::-1]).encode())
    assert prepare_samples(area, SETTINGS, path).classes == whole


def test_an_area_that_changes_while_it_is_prepared_is_refused(area, tmp_path):
    def touch(done, total):
        (area / "poses.csv").write_text((area / "poses.csv").read_text() + "\n")

    with pytest.raises(InputError, match="changed while its samples were prepared"):
        prepare_samples(area, SETTINGS, tmp_path / "samples.h5", touch)


@pytest.mark.parametrize("content", [b"ply\n", b"my thesis"])
def test_a_file_of_something_else_is_not_replaced(area, tmp_path, content):
    (tmp_path / "a.h5").write_bytes(content)
    with pytest.raises(OutputError, match=r"a\.h5: not a file of training samples"):
        prepare_samples(area, SETTINGS, tmp_path / "a.h5")
    assert (tmp_path / "a.h5").read_bytes() == content


def test_hdf5_of_something_else_is_not_replaced(area, tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["points"] = np.zeros(3)
    with pytest.raises(OutputError, match="HDF5 of something else"):
        prepare_samples(area, SETTINGS, tmp_path / "a.h5")


def test_a_full_disk_is_an_error_that_leaves_nothing(area, tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
    try:
        with pytest.raises(OSError, match=r"samples\.h5"):
            prepare_samples(area, SETTINGS, tmp_path / "samples.h5")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [path.name for path in tmp_path.iterdir()] == ["area"]


def other_points(area):
    (area / "gt" / "000001.ply").write_bytes((area / "gt" / "000002.ply").read_bytes())


def no_labels(area):
    (area / "gt" / "000001.ply").write_bytes((area / "scans" / "000001.ply").read_bytes())


def no_truth(area):
    (area / "gt" / "000001.ply").unlink()


def no_poses(area):
    (area / "poses.csv").unlink()


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (other_points, r"gt/000001\.ply: other points than the scan's"),
        (no_labels, r"gt/000001\.ply: no semantic, instance or class table"),
        (no_truth, r"no gt/000001\.ply"),
        (no_poses, r"no poses\.csv"),
    ],
)
def test_an_area_that_does_not_fit_together_is_refused_in_one_line(area, damage, says):
    damage(area)
    with pytest.raises(InputError, match=says) as caught:
        prepare_samples(area, SETTINGS)
    assert "\n" not in str(caught.value)
    assert not list(area.glob("*samples*"))


def test_scans_far_from_every_pose_are_refused(area):
    (area / "poses.csv").write_text(
        (area / "poses.csv").read_text().replace(",0.000000,", ",50.0,")
    )
    with pytest.raises(InputError, match="no point near the robot"):
        prepare_samples(area, SETTINGS)


def digest(samples: AreaSamples) -> int:
    return int(samples.scan(2).context.astype(np.int64).sum())


def send_digest(samples: AreaSamples, queue) -> None:
    queue.put(digest(samples))


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_other_processes_read_the_same(area, method):
    samples = prepare_samples(area, SETTINGS)
    expected = digest(samples)
    processes = multiprocessing.get_context(method)
    queue = processes.Queue()
    child = processes.Process(target=send_digest, args=(samples, queue))
    child.start()
    assert queue.get(timeout=MOST_S) == expected
    child.join()


def test_threads_read_the_same(area):
    samples = prepare_samples(area, SETTINGS)
    expected = digest(samples)
    with ThreadPoolExecutor(4) as pool:
        assert set(pool.map(digest, [samples] * 40)) == {expected}


def test_a_pickled_area_is_its_file(area):
    samples = prepare_samples(area, SETTINGS)
    sent = pickle.dumps(samples)
    assert len(sent) < 1000
    assert_same(pickle.loads(sent), samples)


def test_an_area_says_what_it_is(area):
    samples = prepare_samples(area, SETTINGS)
    replay = Replay(area, SETTINGS)
    assert samples.num_samples == sum(len(scan.voxel) for scan in replay.run())
    assert (samples.name, samples.classes, samples.num_scans) == ("area", CLASSES, 5)


def test_a_cache_keeps_areas_apart_whose_names_differ_in_a_slash_only(tmp_path):
    for seed, name in enumerate(("x/Area_1", "x-Area_1")):
        write_area(tmp_path / "data" / name, num_scans=1 + seed, seed=seed, density=0.1)
    areas = find_areas(tmp_path / "data")
    settings = DataSettings(SETTINGS, AugmentSettings.off(), cache=tmp_path / "cache")
    prepared = prepare(areas, settings, lambda *_: None)
    num_scans = {area.name: AreaSamples(prepared[area].path).num_scans for area in areas}
    assert num_scans == {"x/Area_1": 1, "x-Area_1": 2}
    files = sorted((tmp_path / "cache").glob("*.h5"))
    assert len(files) == 2
    prepare(areas, settings, lambda *_: None)
    assert sorted((tmp_path / "cache").glob("*.h5")) == files
