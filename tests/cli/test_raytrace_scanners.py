"""``mcpseg raytrace --scanner``: depth cameras and lidars, from the command line."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import Result

from mcpseg_cli.config import WINDOW_SAMPLES, SampleSettings
from mcpseg_cli.formats import read_cloud, write_cloud
from mcpseg_cli.formats.poses import read_poses
from mcpseg_cli.formats.recording import open_recording
from mcpseg_cli.segment.sensor import first_scans, guess_range
from mcpseg_cli.train.replay import Replay
from tests.cli.test_raytrace import files_of, make_room
from tests.commands import invoke

FEW = ("--step", "1.5", "-q")
SENSORS = ("depth-camera", "lidar-16", "lidar-32")


def trace(room: Path, output: Path, scanner: str, *options: object) -> Result:
    result = invoke("raytrace", room, "-o", output, "--scanner", scanner, *FEW, *options)
    assert result.exit_code == 0, result.stderr
    return result


@pytest.fixture(scope="module")
def room(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("room") / "room.ply"
    write_cloud(path, make_room())
    return path


@pytest.fixture(scope="module")
def recordings(room, tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("recordings")
    for scanner in SENSORS:
        trace(room, folder / scanner, scanner)
    return folder


def in_sensor_frame(folder: Path) -> list[np.ndarray]:
    poses = read_poses(folder / "poses.csv").poses
    scans = sorted((folder / "scans").iterdir())
    return [
        (read_cloud(path).xyz - pose[:3, 3]) @ pose[:3, :3]
        for path, pose in zip(scans, poses, strict=True)
    ]


@pytest.mark.parametrize("scanner", SENSORS)
def test_every_scan_has_its_truth_and_the_record_says_the_sensor(recordings, scanner):
    folder = recordings / scanner
    record = json.loads((folder / "raytrace.json").read_text())
    assert record["complete"]
    assert record["settings"]["sensor"] == scanner
    assert "vertical_deg" not in record["settings"]
    for path in (folder / "scans").iterdir():
        scan, truth = read_cloud(path), read_cloud(folder / "gt" / path.name)
        np.testing.assert_array_equal(scan.xyz, truth.xyz)
        assert truth.label("semantic") is not None


def test_a_depth_camera_sees_a_pyramid_from_0_3_to_5_m(recordings):
    for xyz in in_sensor_frame(recordings / "depth-camera"):
        assert (xyz[:, 0] > 0.1).all()
        azimuth = np.degrees(np.arctan2(np.abs(xyz[:, 1]), xyz[:, 0]))
        assert azimuth.max() <= 40.1
        assert np.linalg.norm(xyz, axis=1).min() > 0.29
        assert np.linalg.norm(xyz, axis=1).max() < 5.3


def test_a_lidar_sees_rings(recordings):
    for xyz in in_sensor_frame(recordings / "lidar-16"):
        elevation = np.degrees(np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1])))
        ring = 2 * np.round((elevation + 15) / 2) - 15
        np.testing.assert_allclose(elevation, ring, atol=1e-3)
        assert set(ring) <= set(range(-15, 16, 2))


def test_points_are_on_the_surfaces_they_are_of(room, tmp_path):
    trace(room, tmp_path / "out", "lidar-32", "--noise", "0")
    truth = read_cloud(tmp_path / "out/gt/000000.ply")
    is_floor = truth.label("instance") == 1
    assert is_floor.sum() > 20
    assert np.abs(truth.xyz[is_floor, 2]).max() < 0.12
    assert np.median(np.abs(truth.xyz[is_floor, 2])) < 0.01


@pytest.mark.parametrize("scanner", SENSORS)
def test_the_number_of_jobs_changes_nothing_and_a_cut_run_is_continued(
    room, recordings, tmp_path, scanner
):
    expected = files_of(recordings / scanner)
    trace(room, tmp_path / "out", scanner, "--jobs", "3")
    assert files_of(tmp_path / "out") == expected
    (tmp_path / "out/gt/000001.ply").unlink()
    trace(room, tmp_path / "out", scanner, "--jobs", "1")
    assert files_of(tmp_path / "out") == expected


def test_the_seed_decides(room, recordings, tmp_path):
    trace(room, tmp_path / "out", "depth-camera", "--seed", "5")
    other = (tmp_path / "out/poses.csv").read_text()
    assert other != (recordings / "depth-camera/poses.csv").read_text()


def test_more_views_are_more_scans(room, recordings, tmp_path):
    trace(room, tmp_path / "out", "depth-camera", "--views", "6")
    few, many = (len(in_sensor_frame(path)) for path in (recordings / SENSORS[0], tmp_path / "out"))
    assert 1.6 < many / few < 2.4


@pytest.mark.parametrize(("scanner", "metres"), list(zip(SENSORS, (3.5, 5.0, 5.0), strict=True)))
def test_segment_knows_the_sensor_and_training_takes_the_recording(recordings, scanner, metres):
    folder = recordings / scanner
    recording = open_recording(folder / "scans", folder / "poses.csv")
    assert guess_range(first_scans(recording, "map", 0.1))[0] == metres
    replay = Replay(folder, SampleSettings.model_validate(WINDOW_SAMPLES))
    samples = list(replay.run())
    assert len(samples) == len(recording)
    assert all(len(sample.seen) for sample in samples)
    assert np.median([abs(sample.floor) for sample in samples]) < 0.1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--scanner", "lidar-16", "--v-res", "2"), "--v-res is no setting of a lidar-16"),
        (("--scanner", "lidar-32", "--v-min", "-9"), "--v-min is no setting of a lidar-32"),
        (("--scanner", "depth-camera", "--h-res", "2"), "--h-res is no setting of a depth-camera"),
        (("--scanner", "lidar-16", "--views", "2"), "--views is no setting of a lidar-16"),
        (("--views", "2"), "--views is no setting of a sphere"),
        (("--scanner", "depth-camera", "--views", "0"), "--views"),
        (("--scanner", "sonar"), "--scanner"),
    ],
)
def test_options_of_another_scanner_are_refused(room, tmp_path, options, said):
    result = invoke("raytrace", room, "-o", tmp_path / "out", *options)
    assert result.exit_code == 2
    assert said in " ".join(result.stderr.replace("│", " ").split())
    assert not (tmp_path / "out").exists()


def test_a_sphere_is_what_the_paper_says(room, tmp_path):
    for scanner in ("paper", "sphere"):
        trace(room, tmp_path / scanner, scanner, "--h-res", "6", "--v-res", "6")
    assert files_of(tmp_path / "paper") == files_of(tmp_path / "sphere")
