"""Recordings for the Rerun viewer, read back with Rerun's own reader."""

import resource
import shutil
import sys
from collections import defaultdict

import numpy as np
import pytest

from mcpseg_cli.errors import OutputError
from mcpseg_cli.export import rerun as module
from mcpseg_cli.export.rerun import write_recording
from mcpseg_cli.export.selection import Selection
from mcpseg_cli.segment.labelled_run import LabelledRun
from tests.commands import segment

pytest.importorskip("rerun", reason="recordings are written by rerun-sdk, the extra 'rerun'")


COLUMNS = ("instance", "labels", "centers", "half_sizes")  # of boxes


def read_recording(path):
    """Return what was logged by entity and component: (scan, values), scan -1 where static."""
    chunk = pytest.importorskip("rerun.chunk", reason="this Rerun reads no recordings")
    logged = defaultdict(list)
    for part in chunk.RrdReader(path).stream().to_chunks():
        batch = part.to_record_batch()
        scans = (
            batch.column("scan").to_pylist()
            if "scan" in batch.schema.names
            else [-1] * batch.num_rows
        )
        for name in batch.schema.names:
            component = name.split(":")[-1]
            for scan, values in zip(scans, batch.column(name).to_pylist(), strict=True):
                if values is not None and component not in ("scan", "RowId"):
                    logged[str(part.entity_path), component].append((scan, values))
    return {key: sorted(rows, key=lambda row: row[0]) for key, rows in logged.items()}


@pytest.fixture
def run(labelled_run):
    with LabelledRun(labelled_run.out) as run:
        yield run


def points_by_scan(logged, component):
    return [
        rows[-1][1]
        for (entity, name), rows in sorted(logged.items())
        if "/map/" in entity and name == component
    ]


def test_every_scan_brings_its_points_with_their_labels(run, tmp_path):
    path, whole = tmp_path / "map.rrd", run.whole()
    assert write_recording(run, path, Selection()) == len(whole)
    logged = read_recording(path)
    for component, expected in (
        ("class_ids", whole.semantic),
        ("instance", whole.instance),
        ("positions", whole.xyz),
    ):
        np.testing.assert_array_equal(np.concatenate(points_by_scan(logged, component)), expected)

    times = [rows[0][0] for (entity, name), rows in sorted(logged.items()) if name == "positions"]
    assert times == np.unique(whole.scan).tolist()


def test_a_box_with_the_name_of_its_class_is_around_every_object(run, tmp_path):
    write_recording(run, tmp_path / "map.rrd", Selection())
    logged = read_recording(tmp_path / "map.rrd")
    found: dict[str, list] = {}
    for (entity, name), rows in logged.items():
        if entity.startswith("/objects/") and name in COLUMNS:
            for _, values in rows:
                found.setdefault(name, []).extend(values)
    objects = {item.id: item for item in run.objects()}
    assert sorted(found["instance"]) == sorted(objects)
    for owner, words, middle, half in zip(
        found["instance"], found["labels"], found["centers"], found["half_sizes"], strict=True
    ):
        assert words == objects[owner].class_name
        np.testing.assert_allclose(middle, objects[owner].obb_centre, atol=1e-3)
        np.testing.assert_allclose(2 * np.array(half), objects[owner].obb_size, atol=1e-3)


def test_what_is_above_the_cut_is_an_entity_that_the_layout_hides(run, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "are_below_ceiling", lambda run, xyz, scan: xyz[:, 2] < 1.0)
    write_recording(run, tmp_path / "map.rrd", Selection())
    logged, whole = read_recording(tmp_path / "map.rrd"), run.whole()
    for place, chosen in (("/map/", whole.xyz[:, 2] < 1.0), ("/above/", whole.xyz[:, 2] >= 1.0)):
        found = [
            np.array(rows[-1][1])
            for (entity, name), rows in sorted(logged.items())
            if entity.startswith(place) and name == "positions"
        ]
        np.testing.assert_array_equal(np.concatenate(found), whole.xyz[chosen])


def test_the_scanner_is_where_the_poses_say(run, tmp_path):
    write_recording(run, tmp_path / "map.rrd", Selection())
    places = read_recording(tmp_path / "map.rrd")["/scanner", "translation"]
    np.testing.assert_allclose(
        np.concatenate([place for _, place in places]), run.poses[:, :3, 3], atol=1e-6
    )
    assert [scan for scan, _ in places] == [0, 1, 2, 3]


def test_other_colours_are_written_where_asked_for(run, tmp_path):
    write_recording(run, tmp_path / "class.rrd", Selection())
    write_recording(run, tmp_path / "rgb.rrd", Selection(), "rgb")
    assert points_by_scan(read_recording(tmp_path / "class.rrd"), "colors") == []
    colours = np.concatenate(points_by_scan(read_recording(tmp_path / "rgb.rrd"), "colors"))
    np.testing.assert_array_equal(colours.astype(np.uint32) >> 24, run.whole().rgb[:, 0])


def test_without_rerun_one_line_says_what_to_install(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(OutputError, match=r"pip install 'mcpseg\[rerun\]'"):
        module.write_recording(run, tmp_path / "map.rrd", Selection())
    assert not list(tmp_path.iterdir())


def label(labelled_run, weights_path, output, *options):
    return segment(labelled_run.recording, output, "-w", weights_path, "-q", *options)


def test_segment_tells_rerun_of_every_scan(labelled_run, weights_path, tmp_path):
    recording = tmp_path / "live.rrd"
    result = label(labelled_run, weights_path, tmp_path / "out", "--rerun", recording)
    assert result.exit_code == 0
    logged = read_recording(recording)
    with LabelledRun(tmp_path / "out") as run:
        whole = run.whole()
    for component, expected in (("class_ids", whole.semantic), ("instance", whole.instance)):
        np.testing.assert_array_equal(np.concatenate(points_by_scan(logged, component)), expected)
    assert len(logged["/scanner", "translation"]) == 4


def test_a_continued_run_shows_what_was_labelled_before(labelled_run, weights_path, tmp_path):
    shutil.copytree(labelled_run.out, tmp_path / "out")
    recording = tmp_path / "again.rrd"
    result = label(labelled_run, weights_path, tmp_path / "out", "--rerun", recording)
    assert result.exit_code == 0
    found = np.concatenate(points_by_scan(read_recording(recording), "positions"))
    with LabelledRun(tmp_path / "out") as run:
        np.testing.assert_array_equal(found, run.whole().xyz)


@pytest.mark.parametrize("target", ["window", "nowhere/map.rrd", "rerun+http://127.0.0.1:1/proxy"])
def test_a_viewer_that_is_none_is_refused_in_one_line(
    labelled_run, weights_path, tmp_path, target, monkeypatch
):
    monkeypatch.setattr("mcpseg_cli.export.live_map._ANSWER_S", 0.5)
    result = label(labelled_run, weights_path, tmp_path / "out", "--rerun", target)
    assert result.exit_code == 1
    assert target in result.stderr
    assert len(result.stderr.splitlines()) == 1


def test_a_viewer_that_is_not_there_leaves_an_earlier_run_as_it_was(
    labelled_run, weights_path, tmp_path
):
    assert label(labelled_run, weights_path, tmp_path / "out").exit_code == 0
    before = (tmp_path / "out/map.ply").read_bytes()
    options = ("--overwrite", "--rerun", "window")
    assert label(labelled_run, weights_path, tmp_path / "out", *options).exit_code == 1
    assert (tmp_path / "out/map.ply").read_bytes() == before


def test_a_recording_that_is_cut_by_a_full_disk_is_refused_and_not_left(run, tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (5000, before[1]))
    try:
        with pytest.raises(OSError, match=r"File too large"):
            write_recording(run, tmp_path / "map.rrd", Selection())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not list(tmp_path.iterdir())
