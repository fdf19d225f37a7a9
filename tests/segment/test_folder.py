"""The folder of a run: what --overwrite may delete, and when; links that lead out of it."""

import os
import shutil
from pathlib import Path

import pytest

from mcpseg_cli.errors import OutputError, StateError, StateInUseError
from mcpseg_cli.formats.recording import open_recording
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.weights import load_weights
from mcpseg_cli.segment import folder as module
from mcpseg_cli.segment.checkpoint import State
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions
from tests.commands import outputs_of


class Killed(BaseException):
    """Stands for a process that dies; nothing catches it."""


@pytest.fixture
def out(labelled_run, tmp_path) -> Path:
    return Path(shutil.copytree(labelled_run.out, tmp_path / "out"))


def open_run(folders, out: Path, weights_path: Path, *, overwrite: bool = True) -> SegmentRun:
    segmenter = IncrementalSegmenter(load_weights(weights_path))
    recording = open_recording(*folders.recording)
    return SegmentRun(recording, out, segmenter, RunOptions(), overwrite=overwrite)


def files_in(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_a_cloud_of_the_user_s_among_the_labelled_scans_is_told_before_anything_is_deleted(
    labelled_run, out, weights_path
):
    (out / "scans/mine.ply").write_text("keep")
    before = files_in(out)
    with pytest.raises(OutputError, match=r"has mine\.ply, which is none of the run's"):
        open_run(labelled_run, out, weights_path)
    assert files_in(out) == before


@pytest.mark.parametrize("name", [".000001.123-456.part.ply", "part/.a.123-456.part.laz"])
def test_what_a_killed_run_left_incomplete_does_not_hinder_overwriting(
    labelled_run, out, weights_path, name
):
    (out / "scans/part").mkdir()
    (out / "scans" / name).write_text("half a sc")
    with open_run(labelled_run, out, weights_path) as run:
        list(run.run())
        run.write_objects()
    assert not (out / "scans" / name).exists()
    assert (out / "map.ply").read_bytes() == (labelled_run.out / "map.ply").read_bytes()


def test_overwriting_cut_short_at_any_deletion_is_done_by_the_same_command(
    labelled_run, out, weights_path, tmp_path, monkeypatch
):
    original, unlink = files_in(out), Path.unlink
    places = [*sorted((out / "scans").iterdir()), *(out / name for name in module._FILES)]
    for fatal in [*places, out / "state.sqlite"]:

        def dying(path, missing_ok=False, fatal=fatal):
            if path == fatal:
                raise Killed
            unlink(path, missing_ok=missing_ok)

        with monkeypatch.context() as patch:
            patch.setattr(Path, "unlink", dying)
            with pytest.raises(Killed):
                open_run(labelled_run, out, weights_path)

        with open_run(labelled_run, out, weights_path) as run:
            assert run.resumed_from == 0
            list(run.run())
            run.write_objects()
        assert outputs_of(out) == outputs_of(labelled_run.out)
    assert files_in(out).keys() == original.keys()


def test_the_folder_is_held_from_before_the_first_deletion_to_the_end_of_the_run(
    labelled_run, out, weights_path, monkeypatch
):
    clear, seen = module.clear_run, []

    def clear_while_another_starts(*args):
        clear(*args)
        with pytest.raises(StateInUseError, match=rf"process {os.getpid()}"):
            open_run(labelled_run, out, weights_path)
        seen.append("refused")

    monkeypatch.setattr(module, "clear_run", clear_while_another_starts)
    with open_run(labelled_run, out, weights_path):
        monkeypatch.undo()
        with pytest.raises(StateError):
            open_run(labelled_run, out, weights_path)
    assert seen == ["refused"]
    assert not (out / ".mcpseg.lock").exists()


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize(
    "name", ["scans", "map.ply", "events.jsonl", "objects.json", "run.json", "state.sqlite"]
)
def test_a_link_for_a_result_is_refused_and_what_it_points_to_stays(
    labelled_run, out, weights_path, tmp_path, name, overwrite
):
    elsewhere = tmp_path / "elsewhere"
    (out / name).rename(elsewhere)
    (out / name).symlink_to(elsewhere)
    before = files_in(elsewhere) if name == "scans" else elsewhere.read_bytes()
    with pytest.raises(OutputError, match=f"{name}: a link to "):
        open_run(labelled_run, out, weights_path, overwrite=overwrite)
    assert (files_in(elsewhere) if name == "scans" else elsewhere.read_bytes()) == before


@pytest.mark.parametrize("name", ["map.ply", "events.jsonl", "state.sqlite"])
def test_a_copy_of_the_folder_by_hard_links_is_not_written_over(
    labelled_run, out, weights_path, tmp_path, name
):
    (tmp_path / "backup").hardlink_to(out / name)
    with pytest.raises(OutputError, match=f"{name}: has another name elsewhere"):
        open_run(labelled_run, out, weights_path, overwrite=False)


def test_a_dangling_link_is_refused_too(labelled_run, tmp_path, weights_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out/map.ply").symlink_to(tmp_path / "nowhere")
    with pytest.raises(OutputError, match="a link to "):
        open_run(labelled_run, tmp_path / "out", weights_path, overwrite=False)
    assert not (tmp_path / "nowhere").exists()


def test_a_labelled_scan_that_is_a_link_is_replaced_not_followed(
    labelled_run, out, weights_path, tmp_path
):
    users = tmp_path / "users.ply"
    users.write_text("keep")
    (out / "scans/000001.ply").unlink()
    (out / "scans/000001.ply").symlink_to(users)
    with open_run(labelled_run, out, weights_path, overwrite=False):
        pass
    assert users.read_text() == "keep"
    assert outputs_of(out) == outputs_of(labelled_run.out)


def test_a_damaged_checkpoint_can_be_started_over(labelled_run, out, weights_path):
    (out / "state.sqlite").write_bytes(b"not a database" * 100)
    with pytest.raises(StateError, match="damaged"), State(out / "state.sqlite"):
        pass
    with open_run(labelled_run, out, weights_path) as run:
        assert len(list(run.run())) == 4
