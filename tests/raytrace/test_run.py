"""Runs of the virtual scanner as Python calls them: planned inside, recorded by one model."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mcpseg_cli.building import Building
from mcpseg_cli.config import RaytraceSettings
from mcpseg_cli.errors import OutputError
from mcpseg_cli.formats.poses import read_poses
from mcpseg_cli.raytrace.drive import Waypoints
from mcpseg_cli.raytrace.record import BegunRecord, FinishedRecord, read_record, record_text
from mcpseg_cli.raytrace.run import RaytraceRequest, RaytraceRun
from mcpseg_cli.raytrace.scanner import poses_table
from tests.worlds import three_rooms

SETTINGS = RaytraceSettings(step=1.0, horizontal_deg=6.0, vertical_deg=6.0)


@pytest.fixture(scope="module")
def building() -> Building:
    xyz = three_rooms()
    labels = np.zeros(len(xyz), np.uint8), np.ones(len(xyz), np.int32)
    starts, names = np.array([0, len(xyz)]), ("floor_1/wall_1",)
    rgb = np.zeros((len(xyz), 3), np.uint8)
    return Building(xyz, rgb, *labels, rooms=("floor_1",), room_starts=starts, object_names=names)


def run_in(folder, building, places=None) -> RaytraceRun:
    waypoints = Waypoints() if places is None else Waypoints(folder / "spots.txt", places)
    return RaytraceRun(folder, building, RaytraceRequest("here", SETTINGS, ".ply", waypoints))


def test_a_run_plans_by_itself_and_says_what_it_noticed(building, tmp_path):
    run, lines, looked = run_in(tmp_path / "out", building), [], []
    run.plan(progress=lambda done, total: looked.append((done, total)), notify=lines.append)
    assert lines == ["only 1.6 points a voxel: rays may pass through walls; "
                     "give a --voxel-size above 0.1"]  # fmt: skip
    assert looked == [(number, looked[-1][1]) for number in range(1, len(looked) + 1)]
    assert len(list(run.run(1))) == run.num_scans > 3
    assert run.is_complete
    assert run.report(1.234, 5.67).seconds == 1.23


def test_a_planned_run_is_not_planned_again_but_for_a_picture(building, tmp_path):
    places = np.array([[1.0, 1.0], [6.0, 3.0], [50.0, 50.0]])
    run_in(tmp_path / "out", building, places).plan()
    before = (tmp_path / "out/poses.csv").stat().st_mtime_ns
    again, lines = run_in(tmp_path / "out", building, places), []
    again.plan(notify=lines.append)
    assert not any("skipped" in line for line in lines)
    again.plan(picture=tmp_path / "route.png", notify=lines.append)
    assert lines[-1] == "waypoints not on free floor, skipped: (50.00, 50.00)"
    assert (tmp_path / "route.png").is_file()
    assert (tmp_path / "out/poses.csv").stat().st_mtime_ns == before


def test_a_continued_run_scans_from_the_very_places_of_the_first(building, tmp_path):
    first = run_in(tmp_path / "out", building)
    first.plan()
    again = run_in(tmp_path / "out", building)
    np.testing.assert_array_equal(again.poses, first.poses)


def test_poses_are_read_back_as_they_were_written(tmp_path):
    rng = np.random.default_rng(0)
    poses = np.tile(np.eye(4), (500, 1, 1))
    poses[:, :3, :3] = Rotation.random(500, random_state=0).as_matrix()
    poses[:250, :3, :3] = Rotation.from_euler("z", rng.uniform(-4, 4, (250, 1))).as_matrix()
    poses[:, :3, 3] = rng.normal(0, 100, (500, 3))
    (tmp_path / "poses.csv").write_text(poses_table(poses))
    np.testing.assert_allclose(read_poses(tmp_path / "poses.csv").poses, poses, atol=1e-6)


def test_records_are_read_back_as_they_were_written(building, tmp_path):
    run = run_in(tmp_path, building)
    run.plan()
    assert isinstance(run.record, BegunRecord)
    assert read_record(tmp_path) == run.record
    list(run.run(1))
    assert isinstance(run.record, FinishedRecord)
    assert read_record(tmp_path) == run.record
    assert run.record.objects[0].name == "floor_1/wall_1"


def test_names_that_are_no_utf_8_survive_in_the_record(building, tmp_path):
    run = run_in(tmp_path, building)
    run.plan()
    odd = run.record.model_copy(update={"source": "b\udcffd"})
    (tmp_path / "raytrace.json").write_text(record_text(odd))
    assert read_record(tmp_path) == odd


@pytest.mark.parametrize(
    "change",
    [
        {"unknown": 1},
        {"complete": "perhaps"},
        {"complete": True},  # without what was seen
        {"route": {}},
        {"settings": {"reach": -1.0}},
        {"blind_positions": "many"},
    ],
)
def test_a_record_with_other_content_is_refused_in_one_line(building, tmp_path, change):
    run = run_in(tmp_path, building)
    run.plan()
    text = json.dumps(json.loads(record_text(run.record)) | change)
    (tmp_path / "raytrace.json").write_text(text)
    with pytest.raises(OutputError, match="not the record of a run") as caught:
        run_in(tmp_path, building)
    assert "\n" not in str(caught.value)
