"""Reading the folder of a run: what it holds, while it is written too, and what is no run."""

import shutil
import sqlite3

import numpy as np
import pytest

from mcpseg_cli.errors import InputError, OutputError, StateError
from mcpseg_cli.formats import read_cloud
from mcpseg_cli.segment import labelled_run as module
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.labelled_run import LabelledRun


def contents(folder):
    return {
        path.name: (path.read_bytes(), path.stat().st_mtime_ns)
        for path in folder.iterdir()
        if path.is_file()
    }


def test_it_holds_what_map_ply_holds(labelled_run):
    cloud = read_cloud(labelled_run.out / "map.ply")
    with LabelledRun(labelled_run.out) as run:
        whole = run.whole()
        assert (len(run), run.classes) == (len(cloud), cloud.classes)
    np.testing.assert_array_equal(whole.xyz, cloud.xyz)
    np.testing.assert_array_equal(whole.rgb, cloud.rgb)
    for name in ("semantic", "instance", "confidence"):
        np.testing.assert_array_equal(getattr(whole, name), cloud.label(name))


def test_embeddings_are_of_unit_length(labelled_run):
    with LabelledRun(labelled_run.out) as run:
        length = np.linalg.norm(run.whole().embedding, axis=1)
    np.testing.assert_allclose(length, 1.0, atol=1e-3)


def test_every_voxel_knows_the_scan_that_saw_it_first(labelled_run):
    with LabelledRun(labelled_run.out) as run:
        counts = np.bincount(run.whole().scan, minlength=4)
        expected = np.diff([0, *(record.num_voxels for record in run.scans)])
    np.testing.assert_array_equal(counts, expected)


@pytest.mark.parametrize("part_rows", [1, 100, 1 << 16])
def test_parts_of_any_size_make_the_same_whole(labelled_run, monkeypatch, part_rows):
    with LabelledRun(labelled_run.out) as run:
        expected = run.whole()
        monkeypatch.setattr(module, "_PART_ROWS", part_rows)
        sizes = [len(part) for part in run.parts()]
        found = run.whole()
    assert max(sizes) < part_rows + max(np.bincount(expected.scan))
    np.testing.assert_array_equal(found.ids, np.arange(len(expected)))
    np.testing.assert_array_equal(found.instance, expected.instance)


def test_objects_are_those_of_objects_json(labelled_run):
    import json
    from dataclasses import asdict

    with LabelledRun(labelled_run.out) as run:
        found = json.loads(json.dumps([asdict(item) for item in run.objects()]))
    assert found == json.loads((labelled_run.out / "objects.json").read_text())


def test_progress_ends_at_the_number_of_voxels(labelled_run):
    calls = []
    with LabelledRun(labelled_run.out, lambda *progress: calls.append(progress)) as run:
        run.whole()
        assert calls[-1] == (len(run), len(run))


def test_a_run_that_is_being_written_is_read_without_touching_it(labelled_run, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(labelled_run.out, out)
    with State(out / "state.sqlite") as state:  # holds the lock, as segment does
        # what is new lies in the log only
        state.set_configuration({**state.configuration(), "frame": "later"})
        before = contents(out)
        assert before["state.sqlite-wal"][0]

        with LabelledRun(out) as run:
            assert run.settings["frame"] == "later"
            assert len(run.whole()) == len(run)
        assert contents(out) == before


def test_a_log_that_starts_again_meanwhile_is_copied_again(labelled_run, tmp_path, monkeypatch):
    out = tmp_path / "out"
    shutil.copytree(labelled_run.out, out)
    copied = []

    with State(out / "state.sqlite") as state:

        def copy_and_write(source, target):
            copied.append(source.name)
            target.write_bytes(source.read_bytes())
            # between the database and its log
            if len(copied) == 1:
                state.set_configuration({"first": 1})
                state._database.connection.execute("PRAGMA wal_checkpoint(TRUNCATE)")
                state.set_configuration({"second": 2})

        monkeypatch.setattr(module.shutil, "copyfile", copy_and_write)
        with LabelledRun(out) as run:
            assert run.settings == {"second": 2}
    assert copied.count("state.sqlite") == 2


def test_a_log_that_never_rests_is_one_line(labelled_run, monkeypatch):
    salts = iter(range(10_000))
    monkeypatch.setattr(module, "_identity", lambda log: next(salts).to_bytes(4))
    with pytest.raises(StateError, match=r"changes too fast to be copied.*try again later"):
        LabelledRun(labelled_run.out)


def test_no_room_for_the_copy_is_one_line_about_the_folder_of_temporary_files(
    labelled_run, monkeypatch
):
    def fail(source, target):
        raise OSError(28, "No space left on device", str(source))

    monkeypatch.setattr(module.shutil, "copyfile", fail)
    with pytest.raises(OutputError, match=r"No space left on device.*set TMPDIR"):
        LabelledRun(labelled_run.out)


@pytest.mark.parametrize(
    ("make", "found"),
    [
        (lambda out: shutil.rmtree(out), "no such folder"),
        (lambda out: (out / "state.sqlite").unlink(), "no state.sqlite"),
        (lambda out: (out / "run.json").unlink(), "run.json: not there"),
        (lambda out: (out / "run.json").write_text("{"), "run.json: not JSON"),
        (lambda out: (out / "run.json").write_text("[1]"), "run.json: all of it: "),
        (lambda out: (out / "state.sqlite").write_bytes(b"x" * 9999), "damaged"),
        (lambda out: sqlite3.connect(out / "state.sqlite").execute("DROP TABLE voxels"), "damaged"),
    ],
)
def test_what_is_no_run_is_one_line(labelled_run, tmp_path, make, found):
    out = tmp_path / "out"
    shutil.copytree(labelled_run.out, out)
    make(out)
    with pytest.raises((InputError, StateError), match=found) as error, LabelledRun(out) as run:
        run.whole()
    assert "\n" not in str(error.value)
    assert str(out) in str(error.value)


def test_a_run_without_a_voxel_is_one_line(tmp_path):
    (tmp_path / "run.json").write_text('{"configuration": {}, "classes": ["wall"]}')
    State(tmp_path / "state.sqlite").close()
    with pytest.raises(InputError, match="without any labelled voxel"):
        LabelledRun(tmp_path)
