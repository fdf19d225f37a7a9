"""Runs whose labels improve with every look: resumed, rebuilt and read as of any moment."""

import shutil
import sqlite3
from dataclasses import fields
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from mcpseg_cli.config import SegmentSettings
from mcpseg_cli.errors import StateError
from mcpseg_cli.formats import read_cloud
from mcpseg_cli.formats.recording import open_recording
from mcpseg_cli.incremental.evidence import BLOCK, Evidence, Look
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.weights import load_weights
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.database import row_checksum
from mcpseg_cli.segment.labelled_run import LabelledRun
from mcpseg_cli.segment.map_changes import LabelChanges
from mcpseg_cli.segment.past_labels import PastLabels
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions
from tests.commands import outputs_of
from tests.recordings import write_recording
from tests.segment.test_run import events_of, run_all

_NUM_SCANS = 6


class Looked(NamedTuple):
    """A finished run whose labels changed, with what it was made of."""

    recording: tuple[Path, Path]
    weights: Path
    settings: SegmentSettings
    out: Path


@pytest.fixture(
    scope="module", params=["unet", "unet first", "unet paper", "mcpnet fused", "mcpnet graph"]
)
def looked(request, tmp_path_factory, weights_path, unet_path) -> Looked:
    folder = tmp_path_factory.mktemp("looked")
    recording = write_recording(folder / "input", num_scans=_NUM_SCANS)
    weights = weights_path if "mcpnet" in request.param else unet_path
    settings = {
        "unet": SegmentSettings(affinity=0.5),  # random affinities: objects come and go
        "unet first": SegmentSettings(labelling="first"),
        "unet paper": SegmentSettings(clustering="paper"),
        "mcpnet fused": SegmentSettings(labelling="fused"),
        "mcpnet graph": SegmentSettings(clustering="graph"),
    }[request.param]
    run_all(recording, folder / "out", weights, settings=settings)
    return Looked(recording, weights, settings, folder / "out")


def is_graph_of_first_looks(looked: Looked) -> bool:
    """MCPNet's first looks, whose objects come of embeddings alone: no evidence is kept."""
    return looked.settings.clustering == "graph" and looked.settings.labelling is None


def only_first(looked: Looked) -> bool:
    return looked.settings.labelling == "first" or is_graph_of_first_looks(looked)


def go_on(looked: Looked, out: Path, **options) -> SegmentRun:
    return run_all(looked.recording, out, looked.weights, settings=looked.settings, **options)


def without_times(folder: Path) -> list[dict]:
    return [{**event, "ms": None, "warm_up": None} for event in events_of(folder)]


def test_a_run_resumed_before_every_scan_is_one_never_interrupted(looked, tmp_path):
    for _ in range(_NUM_SCANS):
        go_on(looked, tmp_path / "out", stop_after=1)
    assert outputs_of(tmp_path / "out") == outputs_of(looked.out)
    assert without_times(tmp_path / "out") == without_times(looked.out)


def test_a_restored_segmenter_knows_what_the_earlier_one_knew(looked, tmp_path):
    before = go_on(looked, tmp_path / "out", stop_after=4).segmenter
    after = IncrementalSegmenter(load_weights(looked.weights), looked.settings, precision="fp32")
    with SegmentRun(open_recording(*looked.recording), tmp_path / "out", after, RunOptions()):
        pass

    every = np.arange(len(before.map), dtype=np.int32)
    expected = before.evidence_blocks(every)
    assert any(rows.any() for rows in expected.values()) or is_graph_of_first_looks(looked)
    for number, rows in expected.items():
        np.testing.assert_array_equal(after.evidence_blocks(every)[number], rows)
    for field in fields(before.rows()):
        found, known = (getattr(one.rows(), field.name) for one in (after, before))
        np.testing.assert_array_equal(found, known)


def test_lost_outputs_are_rebuilt_with_the_labels_of_their_moment(looked, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(looked.out, out)
    (out / "map.ply").unlink()
    (out / "events.jsonl").unlink()
    shutil.rmtree(out / "scans")
    go_on(looked, out)
    assert outputs_of(out) == outputs_of(looked.out)
    assert without_times(out) == without_times(looked.out)


def test_labels_of_any_moment_are_those_the_segmenter_had(looked, tmp_path):
    sources = open_recording(*looked.recording)
    segmenter = IncrementalSegmenter.load(str(looked.weights), looked.settings)
    with SegmentRun(sources, tmp_path / "out", segmenter, RunOptions()) as run:
        then = [segmenter.labels(np.arange(len(segmenter.map))) for _ in run.run()]

    # in order, then back again
    with State(tmp_path / "out/state.sqlite") as state:
        past = PastLabels(state, segmenter.classes)
        for scan in [*range(_NUM_SCANS), 2, 0, 3]:
            found = past.after(scan, np.arange(len(then[scan].semantic)))
            for name in ("semantic", "instance", "confidence"):
                np.testing.assert_array_equal(getattr(found, name), getattr(then[scan], name))


def test_points_without_a_voxel_have_no_label_at_any_moment(looked, tmp_path):
    shutil.copytree(looked.out, tmp_path / "out")
    with State(tmp_path / "out/state.sqlite") as state:
        labels = PastLabels(state, ("a",)).after(3, np.array([-1, 0], np.int32))
    assert (labels.semantic[0], labels.instance[0], labels.confidence[0]) == (255, 0, 0)


def test_the_map_that_is_read_back_has_the_final_labels(looked):
    cloud = read_cloud(looked.out / "map.ply")
    with LabelledRun(looked.out) as run:
        whole = run.whole()
    for name in ("semantic", "instance", "confidence"):
        np.testing.assert_array_equal(getattr(whole, name), cloud.label(name))


def test_events_count_what_changed(looked, tmp_path):
    shutil.copytree(looked.out, tmp_path / "out")
    events = events_of(looked.out)
    with State(tmp_path / "out/state.sqlite") as state:
        num_changes = sum(map(len, state.label_changes()))
    assert all(event["class_changes"] <= event["label_changes"] for event in events)
    if not only_first(looked):
        assert 0 < num_changes <= sum(event["label_changes"] for event in events)
        assert 0 < sum(event["class_changes"] for event in events) <= num_changes


def test_another_labelling_is_refused_on_resume(looked, tmp_path):
    shutil.copytree(looked.out, tmp_path / "out")
    used, other = ("first", "fused") if only_first(looked) else ("fused", "first")
    settings = looked.settings.model_copy(update={"labelling": other})
    with pytest.raises(StateError, match=f"--labelling {used}, now {other}"):
        run_all(looked.recording, tmp_path / "out", looked.weights, settings=settings)

    # to say what is the default is no difference
    settings = looked.settings.model_copy(update={"labelling": used})
    assert not run_all(
        looked.recording, tmp_path / "out", looked.weights, settings=settings
    ).pending


@pytest.mark.parametrize(
    "statement",
    [
        "DELETE FROM evidence",
        "DELETE FROM evidence WHERE block = 0",
        "DELETE FROM evidence WHERE block = (SELECT max(block) FROM evidence)",
        "UPDATE evidence SET rows = randomblob(length(rows)) WHERE block = 1",
        "INSERT INTO evidence SELECT block + 1000, rows, checksum FROM evidence WHERE block = 0",
        "DELETE FROM changes",
        "DELETE FROM changes WHERE scan = 2",
        "UPDATE changes SET labels = randomblob(length(labels))",
        f"UPDATE changes SET labels = x'78', checksum = {row_checksum('changes', (1, b'x'))} "
        "WHERE scan = 1",
        "UPDATE scans SET num_changes = num_changes + 1 WHERE number = 2",
    ],
)
def test_damaged_evidence_or_changes_are_refused_in_one_line(
    tmp_path, fused_out, short_recording, weights_path, statement
):
    shutil.copytree(fused_out, tmp_path / "out")
    with sqlite3.connect(tmp_path / "out/state.sqlite") as database:
        assert database.execute(statement).rowcount > 0
    database.close()
    settings = SegmentSettings(labelling="fused")
    with pytest.raises(StateError, match=r"state\.sqlite: damaged \(.*--overwrite") as error:
        run_all(short_recording, tmp_path / "out", weights_path, settings=settings)
    assert "\n" not in str(error.value)


@pytest.fixture(scope="module")
def short_recording(tmp_path_factory) -> tuple[Path, Path]:
    return write_recording(tmp_path_factory.mktemp("short"), num_scans=4)


@pytest.fixture(scope="module")
def fused_out(tmp_path_factory, short_recording, weights_path) -> Path:
    out = tmp_path_factory.mktemp("fused") / "out"
    run_all(short_recording, out, weights_path, settings=SegmentSettings(labelling="fused"))
    return out


def test_first_looks_leave_neither_evidence_nor_changes(labelled_run, tmp_path):
    shutil.copytree(labelled_run.out, tmp_path / "out")
    with sqlite3.connect(tmp_path / "out/state.sqlite") as database:
        for table in ("evidence", "changes"):
            assert database.execute(f"SELECT count(*) FROM {table}").fetchone() == (0,)
    database.close()


@pytest.mark.parametrize("version", [1, 2, 3])
def test_a_checkpoint_of_an_older_version_is_refused_with_what_to_do(
    version, labelled_run, tmp_path, short_recording, weights_path
):
    shutil.copytree(labelled_run.out, tmp_path / "out")
    with sqlite3.connect(tmp_path / "out/state.sqlite") as database:
        database.execute(f"PRAGMA user_version = {version}")
    database.close()
    expected = f"version {version}; expected version 4; use the mcpseg it was made with"
    with pytest.raises(StateError, match=expected):
        run_all(short_recording, tmp_path / "out", weights_path)
    with pytest.raises(StateError, match=expected), LabelledRun(tmp_path / "out"):
        pass


def test_an_offline_run_of_the_room_network_is_read_back(tmp_path, short_recording, unet_path):
    from mcpseg_cli.segment.offline_run import label_offline

    for expected in (4, 0):
        segmenter = IncrementalSegmenter.load(str(unet_path))
        sources, options = open_recording(*short_recording), RunOptions(offline=True)
        with SegmentRun(sources, tmp_path / "out", segmenter, options) as run:
            assert len(list(label_offline(run))) == expected
            assert len(segmenter.rows()) == len(segmenter.map)


def test_a_scan_that_cannot_be_read_leaves_evidence_as_it_is(tmp_path, unet_path):
    recording = write_recording(tmp_path / "input", num_scans=4)
    (recording[0] / "000002.ply").write_bytes(b"ply\nbroken")
    options = RunOptions(on_error="skip")
    run_all(recording, tmp_path / "whole", unet_path, options=options)
    for _ in range(4):
        run_all(recording, tmp_path / "out", unet_path, options=options, stop_after=1)
    assert outputs_of(tmp_path / "out") == outputs_of(tmp_path / "whole")


@pytest.mark.parametrize("count", [1, 2, 1000])
def test_label_changes_come_back_as_they_were_packed(count):
    rng = np.random.default_rng(count)
    ids = np.sort(rng.choice(10_000_000, count, replace=False)).astype(np.int32)
    semantic = rng.integers(0, 256, count).astype(np.uint8)
    confidence = (rng.integers(0, 101, count) / np.float32(100)).astype(np.float32)
    found = LabelChanges.unpacked(LabelChanges(ids, semantic, confidence).packed())
    np.testing.assert_array_equal(found.ids, ids)
    np.testing.assert_array_equal(found.semantic, semantic)
    np.testing.assert_array_equal(found.confidence, confidence)


@pytest.mark.parametrize("count", [1, BLOCK - 1, BLOCK, 5 * BLOCK + 3])
def test_evidence_comes_back_from_its_blocks(count):
    rng = np.random.default_rng(count)
    evidence, again, ids = Evidence(13), Evidence(13), np.arange(count, dtype=np.int32)
    evidence.extend(count)
    evidence.count_looks(ids)
    probability = rng.dirichlet(np.ones(13), count).astype(np.float32)
    affinity = rng.random((count, 13), np.float32)
    evidence.add(Look(ids, probability, rng.random(count, np.float32), affinity))

    blocks = evidence.blocks(ids[::-1])
    assert list(blocks) == list(range(-(-count // BLOCK)))
    for rows in blocks.values():
        again.restore(rows)
    np.testing.assert_array_equal(again.rows(0, count), evidence.rows(0, count))


def test_only_the_blocks_of_given_voxels_are_copied():
    evidence = Evidence(2)
    evidence.extend(4 * BLOCK)
    ids = np.array([3 * BLOCK, 5, 3 * BLOCK + 1], np.int32)
    assert list(evidence.blocks(ids)) == [0, 3]
    assert evidence.blocks(ids[:0]) == {}
