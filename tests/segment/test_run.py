"""Runs: outputs, resuming, refusing, crashing at every step."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from mcpseg_cli import formats
from mcpseg_cli.config import SegmentSettings
from mcpseg_cli.errors import McpsegError, OutputError, StateError
from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from mcpseg_cli.formats.recording import open_recording
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.weights import load_weights
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.folder import clear_run
from mcpseg_cli.segment.map_ply import LabelledMap
from mcpseg_cli.segment.outputs import Outputs
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions
from tests.commands import outputs_of
from tests.recordings import write_recording


class Interrupted(BaseException):
    """Stands for a process that dies; nothing catches it."""


@pytest.fixture
def recording(make_recording, tmp_path) -> tuple[Path, Path]:
    return make_recording(tmp_path / "input", num_scans=5)


def run_all(
    recording, output: Path, weights_path: Path, *, stop_after=None, settings=None, options=None
) -> SegmentRun:
    weights = load_weights(weights_path)
    segmenter = IncrementalSegmenter(weights, settings, precision="fp32")
    with SegmentRun(open_recording(*recording), output, segmenter, options or RunOptions()) as run:
        for done, _ in enumerate(run.run(), start=1):
            if done == stop_after:
                break
        run.write_objects()
    return run


@pytest.fixture(scope="module")
def whole_outputs(tmp_path_factory, weights_path) -> dict[str, bytes]:
    """The outputs of a run of the recording that nothing interrupted."""
    folder = tmp_path_factory.mktemp("whole")
    run_all(write_recording(folder / "input", num_scans=5), folder / "out", weights_path)
    return outputs_of(folder / "out")


def events_of(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "events.jsonl").read_text().splitlines()]


def test_a_run_writes_every_output(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "events.jsonl", "map.ply", "objects.json", "run.json", "scans", "state.sqlite",
    ]  # fmt: skip
    assert len(list((tmp_path / "out/scans").iterdir())) == 5


def test_the_map_is_one_labelled_point_per_voxel_with_its_class_table(
    recording, tmp_path, weights_path
):
    run = run_all(recording, tmp_path / "out", weights_path)
    cloud = read_cloud(tmp_path / "out/map.ply")
    assert len(cloud) == len(run.segmenter.map)
    assert cloud.classes == run.segmenter.classes
    np.testing.assert_array_equal(cloud.xyz, run.segmenter.map.xyz)
    np.testing.assert_array_equal(cloud.rgb, run.segmenter.map.rgb)
    np.testing.assert_array_equal(cloud.label("instance"), run.segmenter.clusters.instance)
    assert cloud.label("semantic").max() < 13
    assert 0 < cloud.label("confidence").min() <= cloud.label("confidence").max() <= 1


def test_a_labelled_scan_has_every_input_point_in_order_with_the_labels_of_its_voxels(
    recording, tmp_path, weights_path
):
    run = run_all(recording, tmp_path / "out", weights_path)
    before = read_cloud(sorted(recording[0].iterdir())[-1])
    after = read_cloud(sorted((tmp_path / "out/scans").iterdir())[-1])
    np.testing.assert_array_equal(after.xyz, before.xyz)
    np.testing.assert_array_equal(after.rgb, before.rgb)

    # the last scan has the labels of the final map
    voxels = run.segmenter.map.find(after.xyz)
    reached = after.label("semantic") != 255
    assert reached.any()
    np.testing.assert_array_equal(
        after.label("semantic")[reached], run.segmenter.semantic[voxels[reached]]
    )
    np.testing.assert_array_equal(
        after.label("instance")[reached], run.segmenter.clusters.instance[voxels[reached]]
    )


def test_points_out_of_range_carry_no_label(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path, settings=SegmentSettings(local_range=1.0))
    cloud = read_cloud(tmp_path / "out/scans/000000.ply")
    far = np.hypot(cloud.xyz[:, 0], cloud.xyz[:, 1]) >= 1.0
    assert far.any()
    assert set(cloud.label("semantic")[far].tolist()) == {255}
    assert set(cloud.label("instance")[far].tolist()) == {0}
    assert (cloud.label("instance")[~far] > 0).all()


def test_objects_json_counts_every_voxel_once(recording, tmp_path, weights_path):
    run = run_all(recording, tmp_path / "out", weights_path)
    objects = json.loads((tmp_path / "out/objects.json").read_text())
    assert sum(item["num_points"] for item in objects) == len(run.segmenter.map)
    assert len(objects) == run.segmenter.clusters.num_objects


def test_objects_json_is_not_written_again_when_nothing_changed_and_is_when_it_did(
    recording, tmp_path, weights_path
):
    run_all(recording, tmp_path / "out", weights_path, stop_after=3)
    path = tmp_path / "out/objects.json"
    before, status = path.read_bytes(), path.stat()
    assert json.dumps(json.loads(before), indent=1).encode() + b"\n" == before

    # a scan more; nothing new; changed by hand
    run = run_all(recording, tmp_path / "out", weights_path, stop_after=1)
    assert len(run.records) == 4
    assert (path.stat().st_ino, path.read_bytes()) != (status.st_ino, before)
    whole = run_all(recording, tmp_path / "out", weights_path)
    status = path.stat()
    assert run_all(recording, tmp_path / "out", weights_path).pending == []
    assert path.stat().st_ino == status.st_ino
    path.write_text(path.read_text().replace("0.", "1."))
    run_all(recording, tmp_path / "out", weights_path)
    assert len(json.loads(path.read_text())) == whole.segmenter.clusters.num_objects
    assert path.stat().st_ino != status.st_ino


def test_events_tell_counts_merges_and_times_of_every_scan(recording, tmp_path, weights_path):
    run = run_all(recording, tmp_path / "out", weights_path)
    events = events_of(tmp_path / "out")
    assert [event["scan"] for event in events] == [0, 1, 2, 3, 4]
    num_voxels = sum(event["voxels_new"] for event in events)
    assert num_voxels == events[-1]["voxels"] == len(run.segmenter.map)
    assert events[-1]["objects"] == run.segmenter.clusters.num_objects
    stages = ["read", "insert", "floor", "network", "cluster", "commit", "write"]
    assert list(events[0]["ms"]) == stages


@pytest.mark.parametrize("stop_after", [1, 3, 4])
def test_a_resumed_run_equals_an_uninterrupted_one_byte_for_byte(
    recording, whole_outputs, tmp_path, weights_path, stop_after
):
    run_all(recording, tmp_path / "parts", weights_path, stop_after=stop_after)
    resumed = run_all(recording, tmp_path / "parts", weights_path)
    assert resumed.resumed_from == stop_after
    assert outputs_of(tmp_path / "parts") == whole_outputs


@pytest.mark.parametrize(
    ("owner", "name"),
    [
        (State, "commit"), (LabelledMap, "update"), (LabelledMap, "_write"), (formats, "_write"),
        (Path, "replace"), (Outputs, "append_event"), (SegmentRun, "write_objects"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("moment", ["before", "after"])
def test_dying_around_any_step_loses_nothing(
    recording, whole_outputs, tmp_path, weights_path, monkeypatch, owner, name, moment
):
    original, calls = getattr(owner, name), []
    fatal_call = 1 if name == "write_objects" else 3

    def dying(*args, **named):
        calls.append(name)
        if len(calls) == fatal_call and moment == "before":
            raise Interrupted
        result = original(*args, **named)
        if len(calls) == fatal_call:
            raise Interrupted
        return result

    with monkeypatch.context() as patch:
        patch.setattr(owner, name, dying)
        with pytest.raises(Interrupted):
            run_all(recording, tmp_path / "out", weights_path)

    # the same command again
    run_all(recording, tmp_path / "out", weights_path)
    assert outputs_of(tmp_path / "out") == whole_outputs
    assert [event["scan"] for event in events_of(tmp_path / "out")] == [0, 1, 2, 3, 4]


def test_lost_outputs_are_rebuilt_as_they_were(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path)
    before = outputs_of(tmp_path / "out")
    (tmp_path / "out/map.ply").unlink()
    (tmp_path / "out/events.jsonl").unlink()
    shutil.rmtree(tmp_path / "out/scans")
    run_all(recording, tmp_path / "out", weights_path)
    assert outputs_of(tmp_path / "out") == before
    assert [event["scan"] for event in events_of(tmp_path / "out")] == [0, 1, 2, 3, 4]


def test_a_damaged_map_is_mended_on_resume(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path)
    path = tmp_path / "out/map.ply"
    before = path.read_bytes()
    path.write_bytes(before[: len(before) // 2] + b"?" * 40)
    run_all(recording, tmp_path / "out", weights_path)
    assert path.read_bytes() == before


def test_scans_added_later_are_labelled_as_if_they_had_been_there(
    make_recording, tmp_path, weights_path
):
    whole = make_recording(tmp_path / "input", num_scans=5)
    early, late = tmp_path / "early", whole[0]
    early.mkdir()
    for path in sorted(late.iterdir())[:3]:
        shutil.copy2(path, early)
    poses = tmp_path / "early.csv"
    poses.write_text("\n".join(whole[1].read_text().splitlines()[:4]) + "\n")
    run_all((early, poses), tmp_path / "parts", weights_path)
    run_all(whole, tmp_path / "parts", weights_path)
    run_all(whole, tmp_path / "whole", weights_path)
    assert outputs_of(tmp_path / "parts") == outputs_of(tmp_path / "whole")


def test_changed_settings_are_refused_by_name(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path, stop_after=2)
    with pytest.raises(StateError, match=r"--range 2\.0, now 1\.5"):
        run_all(
            recording, tmp_path / "out", weights_path, settings=SegmentSettings(local_range=1.5)
        )


def test_other_weights_are_refused(recording, tmp_path, weights_path):
    from mcpseg_cli.networks.description import WeightsInfo
    from mcpseg_cli.networks.weights import build_network, save_weights

    run_all(recording, tmp_path / "out", weights_path, stop_after=2)
    info = WeightsInfo(architecture="mcpnet", classes=load_weights(weights_path).info.classes)
    save_weights(tmp_path / "other.safetensors", build_network(info), info)
    with pytest.raises(StateError, match="made with --weights"):
        run_all(recording, tmp_path / "out", tmp_path / "other.safetensors")


def test_a_consumed_scan_whose_content_changed_is_refused(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path, stop_after=3)
    scan = sorted(recording[0].iterdir())[1]
    scan.write_bytes(scan.read_bytes()[:-1] + b"\0")
    with pytest.raises(StateError, match=r"000001\.ply: changed since it was consumed"):
        run_all(recording, tmp_path / "out", weights_path)


def test_a_consumed_scan_whose_time_alone_changed_is_accepted(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path, stop_after=3)
    for scan in recording[0].iterdir():
        os.utime(scan, ns=(1, 1))
    assert len(run_all(recording, tmp_path / "out", weights_path).records) == 5


def test_a_consumed_scan_whose_pose_changed_is_refused(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path, stop_after=3)
    lines = recording[1].read_text().splitlines()
    lines[1] = lines[1].replace(",0.500,", ",0.501,")
    recording[1].write_text("\n".join(lines))
    with pytest.raises(StateError, match="000000"):
        run_all(recording, tmp_path / "out", weights_path)


def test_a_scan_that_sorts_before_consumed_ones_is_refused(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path, stop_after=3)
    scans, poses = recording
    shutil.copy(scans / "000004.ply", scans / "000000b.ply")
    poses.write_text(poses.read_text() + "000000b,9,0,0,0.5,0,0,0,1\n")
    with pytest.raises(StateError, match=r"000000b\.ply: stands where 000001\.ply was consumed"):
        run_all(recording, tmp_path / "out", weights_path)


def test_a_consumed_scan_that_is_gone_is_refused(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path)
    scans, poses = recording
    (scans / "000004.ply").unlink()
    poses.write_text("\n".join(poses.read_text().splitlines()[:-1]))
    with pytest.raises(StateError, match="5 scans consumed, 4 given"):
        run_all(recording, tmp_path / "out", weights_path)


def test_a_second_writer_is_refused_while_the_first_runs(recording, tmp_path, weights_path):
    weights = load_weights(weights_path)
    sources = open_recording(*recording)
    with SegmentRun(sources, tmp_path / "out", IncrementalSegmenter(weights), RunOptions()) as run:
        next(iter(run.run()))
        with pytest.raises(StateError, match="another mcpseg is writing there"):
            SegmentRun(sources, tmp_path / "out", IncrementalSegmenter(weights), RunOptions())
        with pytest.raises(StateError, match="in use"):
            clear_run(tmp_path / "out", sources)
    with SegmentRun(sources, tmp_path / "out", IncrementalSegmenter(weights), RunOptions()) as run:
        assert len(run.records) == 1


@pytest.mark.parametrize("content", [b"", b"not a database" * 100])
def test_a_foreign_file_as_checkpoint_is_named(recording, tmp_path, weights_path, content):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/state.sqlite").write_bytes(content)
    if content:
        with pytest.raises(StateError, match=r"state\.sqlite: damaged"):
            run_all(recording, tmp_path / "out", weights_path)
    else:
        assert len(run_all(recording, tmp_path / "out", weights_path).records) == 5


def test_a_cut_checkpoint_is_one_line_not_a_traceback(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path)
    path = tmp_path / "out/state.sqlite"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(McpsegError, match=r"state\.sqlite: damaged"):
        run_all(recording, tmp_path / "out", weights_path)


def test_outputs_without_their_checkpoint_are_not_overwritten(recording, tmp_path, weights_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/map.ply").write_text("mine")
    with pytest.raises(OutputError, match=r"has map\.ply but no state\.sqlite"):
        run_all(recording, tmp_path / "out", weights_path)
    assert (tmp_path / "out/map.ply").read_text() == "mine"


@pytest.mark.parametrize("place", [".", "..", "../.."])
def test_an_output_folder_that_would_mix_results_with_the_scans_is_refused(
    make_recording, tmp_path, weights_path, place
):
    scans, poses = make_recording(tmp_path / "scans/day")
    with pytest.raises(OutputError, match="lies where results go"):
        run_all((scans, poses), scans / place if place != "../.." else tmp_path, weights_path)
    assert len(list(scans.iterdir())) == 4


def test_clearing_a_run_leaves_other_files_alone(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path)
    (tmp_path / "out/notes.txt").write_text("keep")
    (tmp_path / "out/scans/notes.txt").write_text("keep")
    clear_run(tmp_path / "out", [])
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["notes.txt", "scans"]
    assert [path.name for path in (tmp_path / "out/scans").iterdir()] == ["notes.txt"]


def test_scans_of_another_data_set_under_the_same_names_are_never_touched(
    recording, tmp_path, weights_path
):
    (tmp_path / "other/scans").mkdir(parents=True)
    (tmp_path / "other/scans/000000.ply").write_text("keep")
    clear_run(tmp_path / "other", open_recording(*recording))
    with pytest.raises(OutputError, match="has clouds in scans/ but no state"):
        run_all(recording, tmp_path / "other", weights_path)
    assert (tmp_path / "other/scans/000000.ply").read_text() == "keep"


def test_a_skipped_scan_is_recorded_and_stays_skipped(recording, tmp_path, weights_path):
    (recording[0] / "000002.ply").write_bytes(b"ply\nbroken")
    run = run_all(recording, tmp_path / "out", weights_path, options=RunOptions(on_error="skip"))
    assert run.records.skipped == {2: "000002.ply"}
    assert "000002.ply" in events_of(tmp_path / "out")[2]["skipped"]
    again = run_all(recording, tmp_path / "out", weights_path, options=RunOptions(on_error="skip"))
    assert again.pending == []
    assert not (tmp_path / "out/scans/000002.ply").exists()


@pytest.mark.parametrize("suffix", ["ply", "npz", "pcd", "las", "laz"])
def test_labelled_scans_can_be_written_in_any_format(recording, tmp_path, weights_path, suffix):
    run_all(
        recording, tmp_path / "out", weights_path, stop_after=1, options=RunOptions(format=suffix)
    )
    cloud = read_cloud(tmp_path / f"out/scans/000000.{suffix}")
    assert len(cloud) == 800
    assert cloud.label("semantic") is not None


def test_the_same_seed_gives_the_same_map_and_another_seed_another(
    recording, tmp_path, weights_path
):
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        run_all(recording, tmp_path / name, weights_path, settings=SegmentSettings(seed=seed))
    assert outputs_of(tmp_path / "a") == outputs_of(tmp_path / "b")
    assert outputs_of(tmp_path / "a") != outputs_of(tmp_path / "c")


def test_a_scan_wholly_out_of_range_changes_nothing(recording, tmp_path, weights_path):
    lines = recording[1].read_text().splitlines()
    lines[3] = "000002,0.2,500.0,500.0,0.5,0,0,0,1"
    recording[1].write_text("\n".join(lines) + "\n")
    run_all(recording, tmp_path / "out", weights_path)
    assert events_of(tmp_path / "out")[2]["voxels_new"] == 0
    assert set(read_cloud(tmp_path / "out/scans/000002.ply").label("semantic").tolist()) == {255}


def test_a_scan_that_adds_a_single_voxel_is_labelled(recording, tmp_path, weights_path):
    scans, poses = recording
    first = read_cloud(scans / "000000.ply")
    one_more = {name: np.append(column, column[-1:]) for name, column in first.columns.items()}
    one_more["z"][-1] = 1.99
    one_more["y"][-1] = 0.05
    write_cloud(scans / "000000b.ply", Cloud(one_more))
    lines = poses.read_text().splitlines()
    poses.write_text("\n".join([*lines, lines[1].replace("000000", "000000b", 1)]) + "\n")
    run_all(recording, tmp_path / "out", weights_path)
    assert events_of(tmp_path / "out")[1]["voxels_new"] == 1


def test_a_scan_whose_labelled_copy_cannot_be_written_is_not_committed(
    recording, tmp_path, weights_path
):
    xyz, scan = read_cloud(recording[0] / "000002.ply").xyz, recording[0] / "000002.npz"
    np.savez(scan, xyz=xyz, when=np.full(800, "noon"))
    (recording[0] / "000002.ply").unlink()
    with pytest.raises(OutputError, match=r"000002\.ply: attribute when"):
        run_all(recording, tmp_path / "out", weights_path, options=RunOptions(format="ply"))
    assert len(events_of(tmp_path / "out")) == 2

    # without the column that PLY has no room for
    np.savez(scan, xyz=xyz)
    run = run_all(recording, tmp_path / "out", weights_path, options=RunOptions(format="ply"))
    assert (run.resumed_from, len(run.records)) == (2, 5)


def test_objects_are_not_written_from_a_scan_that_was_not_committed(
    recording, tmp_path, weights_path, monkeypatch
):
    sources, segmenter = open_recording(*recording), IncrementalSegmenter.load(str(weights_path))
    with SegmentRun(sources, tmp_path / "out", segmenter, RunOptions()) as run:
        scans = run.run()
        next(scans)
        run.write_objects()
        before = (tmp_path / "out/objects.json").read_bytes()

        # the second scan is in the map, and not in the checkpoint
        with monkeypatch.context() as patch:
            patch.setattr(State, "commit", lambda *_: (_ for _ in ()).throw(OutputError("full")))
            with pytest.raises(OutputError):
                next(scans)
        run.write_objects()
    assert (tmp_path / "out/objects.json").read_bytes() == before


@pytest.mark.parametrize("garbage", [b"\xff\xfe\x00" * 50, b"not json\n" * 9])
def test_a_damaged_events_file_is_rebuilt(recording, tmp_path, weights_path, garbage):
    run_all(recording, tmp_path / "out", weights_path)
    (tmp_path / "out/events.jsonl").write_bytes(garbage)
    run_all(recording, tmp_path / "out", weights_path)
    assert [event["scan"] for event in events_of(tmp_path / "out")] == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("size", [0, 1])
def test_results_beside_an_emptied_checkpoint_are_not_replaced(
    recording, tmp_path, weights_path, size
):
    run_all(recording, tmp_path / "out", weights_path)
    os.truncate(tmp_path / "out/state.sqlite", size)
    before = (tmp_path / "out/map.ply").read_bytes()
    with pytest.raises(OutputError, match=r"has map\.ply"):
        run_all(recording, tmp_path / "out", weights_path)
    assert (tmp_path / "out/map.ply").read_bytes() == before


def test_garbage_behind_an_event_is_noticed(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path)
    path = tmp_path / "out/events.jsonl"
    path.write_text(path.read_text().replace("}\n", "} GARBAGE\n", 1))
    run_all(recording, tmp_path / "out", weights_path)
    assert len(events_of(tmp_path / "out")) == 5


def test_a_cut_labelled_scan_is_written_again(recording, tmp_path, weights_path):
    run_all(recording, tmp_path / "out", weights_path)
    before = outputs_of(tmp_path / "out")
    path = tmp_path / "out/scans/000001.ply"
    path.write_bytes(path.read_bytes()[:100])
    run_all(recording, tmp_path / "out", weights_path)
    assert outputs_of(tmp_path / "out") == before


@pytest.mark.parametrize(
    "statement",
    [
        "DELETE FROM merges",
        "DELETE FROM scans",
        "DELETE FROM scans WHERE number = 1",
        "DELETE FROM configuration",
        "DELETE FROM voxels WHERE first_id > 0",
        "UPDATE configuration SET settings = '{'",
        "UPDATE scans SET error = '' WHERE number = 1",
        "UPDATE scans SET num_voxels = num_voxels + 1 WHERE number = 1",
        "UPDATE scans SET floor = floor + 1e-9 WHERE number = 1",
        "UPDATE scans SET pose = x'00' WHERE number = 1",
        "UPDATE scans SET event = '{}' WHERE number = 1",
        "UPDATE scans SET event = substr(event, 2)",
        "UPDATE voxels SET rgb = x'616263' WHERE first_id = 0",
        "UPDATE voxels SET count = count - 1 WHERE first_id = 0",
        "UPDATE voxels SET instance = zeroblob(length(instance)) WHERE first_id = 0",
        "UPDATE voxels SET xyz = randomblob(length(xyz)) WHERE first_id = 0",
        "UPDATE merges SET pairs = x'ffffffff00000000'",
    ],
)
def test_a_tampered_checkpoint_is_refused(recording, tmp_path, weights_path, statement):
    import sqlite3

    run_all(recording, tmp_path / "out", weights_path)
    with sqlite3.connect(tmp_path / "out/state.sqlite") as database:
        assert database.execute(statement).rowcount > 0
    database.close()
    with pytest.raises(StateError, match=r"state\.sqlite: damaged"):
        run_all(recording, tmp_path / "out", weights_path)
