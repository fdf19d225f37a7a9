"""Coordinates of recordings in other units, axes and places become metres of the map."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats import Cloud
from mcpseg_cli.formats.cloud import mark_valid
from mcpseg_cli.formats.intake import Intake, take_points
from mcpseg_cli.scan import Labels

POSE = np.array([[0.0, -1, 0, 3], [1, 0, 0, 4], [0, 0, 1, 1.5], [0, 0, 0, 1]])
AXES = ("z", "-z", "y", "-y", "x", "-x")
FAR = (500_000.0, 5_400_000.0, 300.0)


def cloud_of(xyz: np.ndarray) -> Cloud:
    return Cloud({axis: xyz[:, place] for place, axis in enumerate("xyz")})


@pytest.mark.parametrize("up", AXES)
def test_every_axis_turns_upwards_without_a_mirror(up):
    turn = Intake(up=up).turn
    upwards = np.zeros(3)
    upwards["xyz".index(up[-1])] = -1.0 if up[0] == "-" else 1.0
    assert (turn @ upwards).tolist() == [0, 0, 1]
    assert np.linalg.det(turn) == pytest.approx(1.0)


@given(
    up=st.sampled_from(AXES),
    scale=st.sampled_from([1.0, 0.001, 0.3048]),
    offset=st.sampled_from([(0.0, 0.0, 0.0), FAR]),
    frame=st.sampled_from(["map", "sensor"]),
)
def test_what_is_taken_goes_back_to_where_it_was(up, scale, offset, frame):
    intake = Intake(frame=frame, up=up, scale=scale, offset=offset)
    world = np.array([[1.0, 2, 3], [-4, 5, 0.5]]) / scale + offset
    placed = intake.place_points(world)  # points of the recording's map frame
    assert placed.dtype == np.float32
    np.testing.assert_allclose(intake.to_recording(placed), world, atol=1e-5 / scale, rtol=1e-12)


@given(up=st.sampled_from(AXES), scale=st.sampled_from([1.0, 0.001]))
def test_scans_of_either_frame_come_to_the_same_place(up, scale):
    seen = np.array([[1.0, 2, 3], [-4, 5, 0.5]])
    pose, position = POSE.copy(), POSE[:3, 3] / scale + FAR
    pose[:3, 3] = position
    from_sensor = Intake("sensor", up, scale, offset=FAR)
    from_map = Intake("map", up, scale, offset=FAR)
    world = (seen / scale) @ pose[:3, :3].T + position
    first = from_sensor.place_points(seen / scale, from_sensor.place_pose(pose))
    np.testing.assert_allclose(first, from_map.place_points(world), atol=1e-4)
    np.testing.assert_allclose(from_map.place_pose(pose)[:3, 3], from_map.turn @ POSE[:3, 3])


def test_poses_in_another_unit_than_the_scans_are_scaled_by_themselves():
    intake = Intake("sensor", scale=0.001, pose_scale=1.0)
    placed = intake.place_points(np.array([[1000.0, 0, 0]]), intake.place_pose(POSE))
    np.testing.assert_allclose(placed, [[3, 5, 1.5]])


def test_plain_coordinates_stay_what_they_are_to_the_bit():
    xyz = np.random.default_rng(0).normal(size=(9, 3)).astype(np.float32)
    assert Intake().place_points(xyz) is xyz
    assert Intake().place_pose(POSE) is POSE


def test_a_configuration_has_what_is_not_default_and_gives_it_back():
    intake = Intake("sensor", "y", 0.001, 1.0, FAR, "16-bit")
    assert Intake.of(intake.as_settings()) == intake
    assert Intake("map").as_settings() == {}


def test_points_that_are_none_have_no_labels_and_all_others_keep_theirs():
    xyz = np.array([[1, 1, 1], [np.nan, 0, 0], [0, 0, 0], [2, 2, 2], [np.inf, 1, 1]], np.float32)
    cloud = mark_valid(Path("a.ply"), cloud_of(xyz))
    placed, taken = take_points(cloud, POSE, Intake("sensor"), Path("a.ply"))
    assert len(placed) == 2
    assert taken.valid.tolist() == [True, False, False, True, False]

    labels = Labels(np.array([3, 4], np.uint8), np.array([7, 8], np.int32), np.ones(2, np.float32))
    labelled = taken.with_labels(labels)
    assert labelled.columns["semantic"].tolist() == [3, 255, 255, 4, 255]
    assert labelled.columns["instance"].tolist() == [7, 0, 0, 8, 0]
    np.testing.assert_array_equal(labelled.xyz, xyz)


@pytest.mark.parametrize("place", [POSE[:3, 3], np.zeros(3)])
def test_returns_of_nothing_in_the_maps_frame_lie_at_the_sensor_or_at_0(place):
    xyz = np.array([[1, 1, 1], place, place], np.float64)
    placed, taken = take_points(cloud_of(xyz), POSE, Intake(), Path("a.ply"))
    assert taken.valid.tolist() == [True, False, False]
    np.testing.assert_array_equal(placed, [[1, 1, 1]])


def test_one_point_at_0_of_the_map_is_a_point():
    xyz = np.array([[1, 1, 1], [0, 0, 0]], np.float32)
    assert take_points(cloud_of(xyz), POSE, Intake(), Path("a.ply"))[1].valid is None


def test_a_scan_that_hit_nothing_is_refused():
    with pytest.raises(InputError, match="all 4 points lie at the sensor"):
        take_points(cloud_of(np.zeros((4, 3))), POSE, Intake("sensor"), Path("a.ply"))
