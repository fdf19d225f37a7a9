"""Scans and poses as people have them: what pairs, how it is told, and what is passed over."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from mcpseg_cli.formats import read_cloud, write_cloud
from mcpseg_cli.formats.recording import open_recording
from tests.commands import invoke, outputs_of, segment
from tests.walks import WAYS, write_walk

WALK = Path(__file__).parents[2] / "examples/office_walk"
HEADER = "scan,x,y,z,qx,qy,qz,qw"


def without_pose(recording, row: str) -> None:
    """Put another row in the place of the third scan's."""
    lines = recording[1].read_text().splitlines()
    lines[3] = row
    recording[1].write_text("\n".join(line for line in lines if line) + "\n")


LOST = {"lost": "000002,0,nan,nan,nan,nan,nan,nan,nan", "missing": ""}


@pytest.mark.parametrize("row", LOST.values(), ids=LOST)
def test_a_scan_without_a_pose_ends_a_run_before_it_begins(recording, tmp_path, weights_path, row):
    without_pose(recording, row)
    result = segment(recording, tmp_path / "out", "-w", weights_path)
    assert result.exit_code == 1
    assert "no pose for scan 000002.ply" in result.stderr
    assert "--on-error skip" in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("row", LOST.values(), ids=LOST)
def test_scans_without_a_pose_can_be_passed_over_and_are_counted(
    recording, tmp_path, weights_path, row
):
    without_pose(recording, row)
    words = ("-w", weights_path, "--on-error", "skip", "--json")
    result = segment(recording, tmp_path / "out", *words)
    document = json.loads(result.stdout)
    assert document["skipped"] == ["000002.ply"]
    assert document["pairing"]["without_pose"] == 1
    assert "no pose" in result.stderr
    assert json.loads((tmp_path / "out/run.json").read_text())["pairing"] == document["pairing"]

    # once more, nothing is new
    again = segment(recording, tmp_path / "out", *words)
    assert "nothing new" in again.stderr


def test_poses_of_no_scan_can_be_passed_over_and_are_counted(recording, tmp_path, weights_path):
    words = ("-w", weights_path)
    segment(recording, tmp_path / "whole", *words)
    with recording[1].open("a") as file:
        file.write("000099,0.9,1,2,3,0,0,0,1\n")
    refused = segment(recording, tmp_path / "out", *words)
    assert "a pose for 000099, which is not among the scans" in refused.stderr
    result = segment(recording, tmp_path / "out", *words, "--on-error", "skip")
    assert "by name; 1 poses without a scan" in result.stdout
    assert outputs_of(tmp_path / "out") == outputs_of(tmp_path / "whole")


def test_a_run_whose_first_scan_had_no_pose_can_be_shown_and_continued(
    recording, tmp_path, weights_path
):
    recording[1].write_text(recording[1].read_text().replace("000000,0.0,0.000", "000000,0.0,inf"))
    words = ("-w", weights_path, "--on-error", "skip", "--rerun", tmp_path / "live.rrd")
    assert segment(recording, tmp_path / "out", *words).exit_code == 0
    assert invoke("export", tmp_path / "out", "-o", tmp_path / "map.html").exit_code == 0
    assert "NaN" not in (tmp_path / "map.html").read_text()[:20_000]
    assert segment(recording, tmp_path / "out", *words[:-2]).exit_code == 0


def test_the_summary_says_what_poses_are_and_how_they_were_paired(
    recording, tmp_path, weights_path
):
    table = [line.split(",")[1:] for line in recording[1].read_text().splitlines()[1:]]
    comment = "# timestamp tx ty tz qw qx qy qz"
    rows = [" ".join([*row[:4], row[7], *row[4:7]]) for row in table]
    recording[1].write_text("\n".join([comment, *rows]) + "\n")
    result = segment(recording, tmp_path / "out", "-w", weights_path)
    assert re.search(
        r"^poses +timestamp tx ty tz qw qx qy qz, as line 1 says$", result.stdout, re.M
    )
    assert re.search(r"^paired +by order \(4 and 4\)$", result.stdout, re.M)


def test_scans_at_2_hz_and_poses_at_30_hz_give_the_map_of_one_pose_a_scan(tmp_path, weights_path):
    """The example walk in the sensor's frame, its scans named by time stamps, tracked at 30 Hz."""
    sources = open_recording(WALK / "scans", WALK / "poses.csv")[:6]
    times = 1305031102.175304 + 0.5 * np.arange(len(sources))
    (tmp_path / "scans").mkdir()
    slerp = Slerp(times, Rotation.from_matrix([source.pose[:3, :3] for source in sources]))
    positions = np.array([source.pose[:3, 3] for source in sources])

    # the robot rests for a moment at each scan, which falls between two moments of the track
    moments = np.arange(times[0] - 0.011, times[-1] + 0.03, 1 / 30)
    steps, share = np.divmod((moments - times[0]) / 0.5, 1)
    track = times[0] + 0.5 * (steps + np.clip((share - 0.2) / 0.6, 0, 1))
    track = track.clip(times[0], times[-1])
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    for moment, place, turn in zip(
        moments,
        np.stack([np.interp(track, times, axis) for axis in positions.T], axis=1),
        slerp(track).as_quat(),
        strict=True,
    ):
        lines.append(" ".join(f"{value:.9f}" for value in (moment, *place, *turn)))
    (tmp_path / "poses.tum").write_text("\n".join(lines) + "\n")

    rows = [HEADER]
    for time, source in zip(times, sources, strict=True):
        cloud = read_cloud(source.path)
        local = (cloud.xyz - source.pose[:3, 3]) @ source.pose[:3, :3]
        columns = cloud.columns | {axis: local[:, place] for place, axis in enumerate("xyz")}
        name = f"{time:.6f}.ply"
        write_cloud(tmp_path / "scans" / name, type(cloud)(columns))
        turn = Rotation.from_matrix(source.pose[:3, :3]).as_quat()
        rows.append(",".join([name, *(f"{value:.9f}" for value in (*source.pose[:3, 3], *turn))]))
    (tmp_path / "poses.csv").write_text("\n".join(rows) + "\n")

    words = ("-w", weights_path, "--frame", "sensor")
    one_each = segment((tmp_path / "scans", tmp_path / "poses.csv"), tmp_path / "a", *words)
    tracked = segment((tmp_path / "scans", tmp_path / "poses.tum"), tmp_path / "b", *words)
    assert (one_each.exit_code, tracked.exit_code) == (0, 0)
    assert re.search(r"^paired +by time, .*between two poses\)$", tracked.stdout, re.M)

    # the same voxels, but for points at their borders
    first, second = (read_cloud(tmp_path / name / "map.ply").xyz for name in "ab")
    assert abs(len(first) - len(second)) <= 5
    voxels = [set(map(tuple, np.floor(xyz / 0.1).astype(int).tolist())) for xyz in (first, second)]
    assert len(voxels[0] ^ voxels[1]) <= 10


def test_many_skipped_scans_are_counted_in_the_table(tmp_path, weights_path):
    scans, poses = write_walk(tmp_path / "in", WAYS["metres"], num_scans=8)
    rows = poses.read_text().splitlines()
    poses.write_text("\n".join(rows[:3]) + "\n")
    words = ("-o", tmp_path / "out", "-w", weights_path, "--on-error", "skip")
    result = invoke("segment", scans, poses, *words)
    assert result.exit_code == 0, result.stderr
    assert "6 scans: 000002.ply, 000003.ply" in result.stdout
    assert "6 scans without a pose" in result.stdout
