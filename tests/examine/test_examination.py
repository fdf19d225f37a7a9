"""What recordings are: frame, unit, upwards and place, as their scans and poses show it."""

from dataclasses import replace

import numpy as np
import pytest

from mcpseg_cli.examine.coincidence import compare_scans
from mcpseg_cli.examine.examination import Examination, examine
from mcpseg_cli.examine.look import glance_at, spread
from mcpseg_cli.examine.objections import doubts, objections
from mcpseg_cli.examine.structure import find_room, flat_axis, turning_axis
from mcpseg_cli.examine.units import find_unit
from mcpseg_cli.formats.intake import Intake
from mcpseg_cli.formats.recording import open_recording
from tests.recordings import write_recording
from tests.walks import WALK, WAYS, write_walk


def look(scans, poses, asked="map") -> Examination:
    recording = open_recording(scans, poses, asked, any_distance=True)
    glances = glance_at(recording, range(min(5, len(recording))))
    return examine(glances, np.stack([source.pose for source in recording]), asked)


@pytest.mark.parametrize(
    ("way", "unit", "up"),
    [
        ("metres", "metres", "z"),
        ("millimetres", "millimetres", "z"),
        ("centimetres", "centimetres", "z"),
        ("feet", "feet", "z"),
        ("y up", "metres", "y"),
        ("y down", "metres", "-y"),
        ("georeferenced", "metres", "z"),
    ],
)
def test_unit_and_upwards_of_a_walk_are_found(tmp_path, way, unit, up):
    found = look(*write_walk(tmp_path, WAYS[way]))
    assert (found.unit.name, found.up, found.frame) == (unit, up, "map")
    assert found.room.below == pytest.approx(0.96, abs=0.03)
    assert found.room.height == pytest.approx(3.24, abs=0.05)
    assert found.pose_scale is None


def test_georeferenced_recordings_get_a_round_offset(tmp_path):
    found = look(*write_walk(tmp_path, WAYS["georeferenced"]))
    assert found.offset == (500_000.0, 5_400_000.0, 0.0)
    against, remedies = objections(found, Intake(), ())
    assert (len(against), remedies) == (1, ["--offset auto"])


def test_scans_in_the_sensors_frame_are_known_by_what_coincides(tmp_path):
    walk = write_walk(tmp_path, WAYS["metres"], in_sensor_frame=True)
    for asked in ("map", "sensor"):
        found = look(*walk, asked)
        assert found.frame == "sensor"
    against, remedies = objections(found, Intake("map"), ())
    assert "scans coincide by the poses (89% of their points, not as they are" in against[0]
    assert remedies == ["--frame sensor"]
    assert objections(found, Intake("sensor"), ()) == ([], [])


@pytest.mark.parametrize("in_sensor_frame", [False, True])
def test_scans_in_millimetres_with_poses_in_metres_are_found(tmp_path, in_sensor_frame):
    walk = write_walk(
        tmp_path,
        WAYS["millimetres"],
        pose_way=WAYS["metres"],
        in_sensor_frame=in_sensor_frame,
    )
    found = look(*walk, "sensor" if in_sensor_frame else "map")
    assert (found.unit.scale, found.pose_scale) == (0.001, pytest.approx(1.0))
    asked = Intake("sensor" if in_sensor_frame else "map")
    assert objections(found, asked, ())[1] == ["--scale 0.001,1"]


def test_poses_from_the_map_to_the_sensor_are_found():
    recording = open_recording(WALK / "scans", WALK / "poses.csv")[:5]
    poses = [source.pose for source in recording]
    seen = [
        (glance.xyz - pose[:3, 3]) @ pose[:3, :3]
        for glance, pose in zip(glance_at(recording, range(5)), poses, strict=True)
    ]
    found = compare_scans(seen, [np.linalg.inv(pose) for pose in poses])
    assert found.best == "by the inverse poses"


def test_poses_of_a_camera_with_scans_of_a_lidar_are_found(tmp_path):
    scans, poses = write_walk(tmp_path, WAYS["metres"], in_sensor_frame=True)
    recording = open_recording(scans, poses)
    to_camera = np.eye(4)
    to_camera[:3, :3] = [[0, -1, 0], [0, 0, -1], [1, 0, 0]]
    of_camera = np.stack([to_camera @ one.pose @ np.linalg.inv(to_camera) for one in recording])
    rows = [" ".join(f"{value:.9f}" for value in pose[:3].ravel()) for pose in of_camera]
    (tmp_path / "kitti.txt").write_text("\n".join(rows) + "\n")
    found = look(scans, tmp_path / "kitti.txt", "sensor")
    against, remedies = objections(found, Intake("sensor"), ())
    assert "scans of a lidar, x forwards, with poses of a camera" in against[0]
    assert remedies == ["the poses of the lidar (a calib.txt leads from one to the other)"]


def test_what_is_said_is_not_objected_to(tmp_path):
    found = look(*write_walk(tmp_path, lambda xyz: WAYS["y up"](xyz) * 1000))
    assert objections(found, Intake(), ())[1] == ["--scale 0.001", "--up y"]
    assert objections(found, Intake(up="y", scale=0.001), {"up", "scale"}) == ([], [])


def test_poses_of_other_scans_raise_doubts(tmp_path):
    scans, poses = write_walk(tmp_path, WAYS["metres"], in_sensor_frame=True)
    header, *rows = poses.read_text().splitlines()
    names = [row.partition(",")[0] for row in rows]
    moved = [row.partition(",")[2] for row in (*rows[3:], *rows[:3])]
    lines = [f"{name},{place}" for name, place in zip(names, moved, strict=True)]
    poses.write_text("\n".join([header, *lines]) + "\n")
    found = look(scans, poses, "sensor")
    assert found.frame is None
    assert "are scans and poses paired right" in doubts(found, Intake("sensor"))


@pytest.mark.parametrize("colour", [True, False])
def test_nothing_is_found_against_a_corridor_that_looks_the_same_everywhere(tmp_path, colour):
    found = look(*write_recording(tmp_path, 6, colour=colour))
    assert objections(found, Intake(), ()) == ([], [])
    assert doubts(found, Intake()) is None


@pytest.mark.parametrize("asked", ["map", "sensor"])
def test_nothing_is_found_against_a_robot_that_stands_still(asked):
    recording = open_recording(WALK / "scans", WALK / "poses.csv")
    rng = np.random.default_rng(0)
    first = recording[0]
    (glance,) = glance_at(recording, [0])
    glances, poses = [], []
    for _ in range(5):
        pose = np.eye(4)
        pose[:3, 3] = first.pose[:3, 3] + rng.normal(0, 0.001, 3)
        xyz = glance.xyz + rng.normal(0, 0.003, glance.xyz.shape)
        xyz = xyz - pose[:3, 3] if asked == "sensor" else xyz
        glances.append(replace(glance, xyz=xyz, pose=pose))
        poses.append(pose)
    found = examine(glances, np.stack(poses), asked)
    assert objections(found, Intake(asked), ()) == ([], [])
    assert doubts(found, Intake(asked)) is None


@pytest.mark.parametrize("name", ["hololens_walk", "laser_sensor_frame"])
def test_real_recordings_are_what_they_are(shared_folder, name):
    folder = shared_folder / "real" / name
    poses = next(
        folder / file for file in ("poses.csv", "poses_kitti.txt") if (folder / file).exists()
    )
    found = look(folder / "scans", poses)
    assert found.frame == ("map" if name == "hololens_walk" else "sensor")
    assert (found.unit.name, found.offset) == ("metres", (0.0, 0.0, 0.0))
    assert found.up in ("z", None)


def test_floor_and_ceiling_are_the_outermost_layers():
    rng = np.random.default_rng(0)
    walls = rng.uniform([-2, -2, -1], [2, 2, 1.6], (4000, 3))
    floor = rng.uniform([-2, -2, -1.01], [2, 2, -0.99], (2000, 3))
    ceiling = rng.uniform([-2, -2, 1.59], [2, 2, 1.61], (2000, 3))
    room = find_room(np.concatenate([walls, floor, ceiling]), np.array([0.0, 0, 1]))
    assert room.below == pytest.approx(1.0, abs=0.03)
    assert room.above == pytest.approx(1.6, abs=0.03)
    assert find_unit(room, 2.0).name == "metres"
    assert find_room(walls[:0], np.array([0.0, 0, 1])).height is None


def test_a_way_in_a_plane_says_which_axis_is_vertical():
    angle = np.linspace(0, 6, 40)
    way = np.stack([3 * np.cos(angle), 0.02 * angle, 2 * np.sin(angle)], axis=1)
    assert flat_axis(way, 2.0) == 1
    assert flat_axis(way * 0.01, 2.0) is None  # it hardly moves
    assert flat_axis(way[:, [0, 1, 1]], 2.0) is None  # along a line
    turns = np.stack([np.eye(3)[[0, 1, 2]] for _ in angle])
    assert turning_axis(turns) is None
    turns[:, 0, 0] = turns[:, 2, 2] = np.cos(angle)
    turns[:, 0, 2], turns[:, 2, 0] = np.sin(angle), -np.sin(angle)
    assert turning_axis(turns) == 1


def test_scans_all_over_a_recording_are_looked_at():
    assert spread(3, 12) == [0, 1, 2]
    assert spread(100, 12)[:5] == [0, 1, 2, 3, 4]
    assert spread(100, 12)[-1] == 99
    assert len(spread(100, 12)) == 11
    assert spread(0, 12) == []
