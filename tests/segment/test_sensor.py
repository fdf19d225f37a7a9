"""Ranges found from scans: each kind of sensor is known by what it sees."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mcpseg_cli.formats.recording import open_recording
from mcpseg_cli.scan import Scan, to_map_frame
from mcpseg_cli.segment.sensor import (
    NUM_SCANS,
    first_scans,
    guess_range,
    kept_configuration,
    range_in,
)

CENTRE = np.array([30.0, -12.0, 1.2])


def directions(rng, count: int) -> np.ndarray:
    """(count, 3) unit vectors, all around alike."""
    drawn = rng.normal(size=(count, 3))
    return drawn / np.linalg.norm(drawn, axis=1, keepdims=True)


def in_box(rays: np.ndarray, half: tuple[float, float, float]) -> np.ndarray:
    """Where rays from the middle of a box end on its walls."""
    with np.errstate(divide="ignore"):
        return rays * np.min(np.array(half) / np.abs(rays), axis=1, keepdims=True)


def camera(rng, half_deg=35.0) -> np.ndarray:
    """What a camera that looks along x sees, sensor frame."""
    across = np.tan(np.radians(half_deg)) * rng.uniform(-1, 1, (4000, 2)) * [1, 0.75]
    rays = np.column_stack([np.ones(4000), across])
    return rays * rng.uniform(0.5, 6.0, (4000, 1))


def scan_of(xyz: np.ndarray, turn: Rotation | None = None) -> Scan:
    pose = np.eye(4)
    pose[:3, :3] = (turn or Rotation.identity()).as_matrix()
    pose[:3, 3] = CENTRE
    return Scan(to_map_frame(xyz, pose), None, pose)


@pytest.mark.parametrize("half", [(2, 2.5, 1.2), (1.0, 7.0, 1.2), (4, 5, 1.5)])
def test_a_scanner_of_all_directions_in_rooms_sees_as_far_as_a_room(half):
    rng = np.random.default_rng(1)
    scans = [scan_of(in_box(directions(rng, 4000), half)) for _ in range(3)]
    assert guess_range(scans) == (2.0, "a scanner that sees all around, in rooms")


@pytest.mark.parametrize("pitch_deg", [-80, -45, 0, 30])
@pytest.mark.parametrize("half_deg", [25, 45])
def test_a_camera_is_one_wherever_it_looks(pitch_deg, half_deg):
    rng = np.random.default_rng(2)
    turns = Rotation.from_euler("zyx", [[yaw, -pitch_deg, 5] for yaw in (0, 90, 200)], degrees=True)
    scans = [scan_of(camera(rng, half_deg), turn) for turn in turns]
    assert guess_range(scans) == (3.5, "a depth camera, by its field of view")


def test_a_few_stray_points_do_not_make_a_camera_a_scanner():
    rng = np.random.default_rng(3)
    xyz = camera(rng)
    xyz[:20] *= -1
    assert guess_range([scan_of(xyz)])[0] == 3.5


@pytest.mark.parametrize("first_deg", [-180.0, -35.0])
def test_a_long_lidar_is_known_by_its_reach_whatever_its_field_of_view(first_deg):
    rng = np.random.default_rng(4)
    angle = np.radians(rng.uniform(first_deg, -first_deg, 4000))
    reach = rng.uniform(1, 25, 4000)
    xyz = np.column_stack([reach * np.cos(angle), reach * np.sin(angle), rng.uniform(-1, 2, 4000)])
    assert guess_range([scan_of(xyz)]) == (5.0, "a long lidar, by its reach")


@pytest.mark.parametrize("rings_deg", [np.linspace(-15, 15, 16), np.linspace(-25, 15, 32)])
@pytest.mark.parametrize("half", [(2, 2.5, 1.2), (1.0, 7.0, 1.2)])
def test_a_lidar_of_rings_is_one_in_small_rooms_too(rings_deg, half):
    tilt, turn = np.meshgrid(np.radians(rings_deg), np.radians(np.arange(0, 360, 2)))
    flat = np.cos(tilt)
    rays = np.stack([flat * np.cos(turn), flat * np.sin(turn), np.sin(tilt)], -1).reshape(-1, 3)
    rocked = Rotation.from_euler("xy", [1.5, -1.5], degrees=True)
    expected = (5.0, "a lidar of rings, by its narrow band of elevations")
    assert guess_range([scan_of(in_box(rays, half), rocked)]) == expected


def test_most_scans_decide():
    rng = np.random.default_rng(5)
    room = scan_of(in_box(directions(rng, 4000), (2, 2, 1.2)))
    assert guess_range([room, scan_of(camera(rng)), room])[0] == 2.0


@pytest.mark.parametrize("xyz", [np.empty((0, 3)), np.zeros((4, 3))])
def test_scans_that_say_nothing_are_taken_for_rooms(xyz):
    assert guess_range([scan_of(xyz)])[0] == 2.0
    assert guess_range([])[0] == 2.0


def test_only_the_first_scans_are_read_and_broken_ones_passed_over(make_recording, tmp_path):
    recording = open_recording(*make_recording(tmp_path / "input", num_scans=NUM_SCANS + 2))
    for source in (recording[0], *recording[NUM_SCANS:]):
        source.path.write_bytes(b"no cloud")
    read = [scan.name for scan in first_scans(recording, "map", 0.1)]
    assert read == [source.path.name for source in recording[1:NUM_SCANS]]


def test_a_folder_without_a_run_has_no_range(tmp_path, labelled_run):
    assert kept_configuration(tmp_path / "nowhere") is None
    assert range_in(kept_configuration(labelled_run.out)) == 2.0
