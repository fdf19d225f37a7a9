"""The commands of the README, top to bottom, in one folder, as somebody who reads it types them."""

import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from tests import containers
from tests.commands import invoke
from tests.formats.test_rgbd import write_scannet
from tests.test_docs import README, ROOT, simple_commands

INSTALLS = {"git", "cd", "make", ".", "pip", "docker"}  # other programs, which this run stands for
SERVERS = {"view"}  # see tests/export/test_view.py
ELSEWHERE = {"walk.mcap", "site.e57", "scene0000_00/"}  # see tests/cli/test_segment_recordings.py
SMALLER = {  # what makes minutes and hours seconds; otherwise commands are as printed
    "synth": ["--rooms", "2", "--spacing", "0.1", "--jobs", "1"],
    "raytrace": ["--step", "2", "--h-res", "6", "--v-res", "6", "--jobs", "1"],
    "train": ["--epochs", "1", "--batch-size", "64", "--context", "4"],
}
SCANS = 3  # of the example
SENSORS = {"walk.mcap", "site.e57", "tiles/", "sequences/00/", "handheld/"}
"""Recordings of the README that are of one walk here."""


@pytest.fixture
def folder(labelled_run, tmp_path, monkeypatch) -> Path:
    """A clone's examples, cut short, and somebody's own recording with its truth."""
    walk = tmp_path / "examples" / "office_walk"
    for part in ("scans", "gt"):
        (walk / part).mkdir(parents=True)
        for path in sorted((ROOT / "examples/office_walk" / part).iterdir())[:SCANS]:
            shutil.copy(path, walk / part)
    lines = (ROOT / "examples/office_walk/poses.csv").read_text().splitlines(keepends=True)
    (walk / "poses.csv").write_text("".join(lines[: SCANS + 1]))

    shutil.copytree(labelled_run.scans, tmp_path / "scans")
    shutil.copy(labelled_run.scans.parent / "poses.csv", tmp_path)
    shutil.copytree(labelled_run.out / "scans", tmp_path / "gt")
    write_of_each_sensor(tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_of_each_sensor(folder: Path) -> None:
    """Write the first scans of the walk as robots, surveyors, cars and hands have them."""
    walk = ROOT / "examples/office_walk"
    sweeps = containers.sweeps_of(walk / "scans", walk / "poses.csv", SCANS)
    messages = [(containers.cloud(each), containers.odometry(each)) for each in sweeps]
    containers.write_mcap(folder / "walk.mcap", [one for pair in messages for one in pair])
    containers.write_e57(folder / "site.e57", sweeps)
    write_scannet(folder / "scene0000_00")
    write_kitti(folder / "sequences/00", sweeps)

    # clouds and their poses, by time or by name
    (folder / "handheld").mkdir()
    (folder / "tiles").mkdir()
    lines, rows = ["# timestamp tx ty tz qx qy qz qw"], ["scan,x,y,z"]
    for number, each in enumerate(sweeps):
        columns = dict(zip("xyz", each.xyz.T, strict=True))
        write_cloud(folder / f"handheld/{each.stamp_ns}.ply", Cloud(columns))
        lines.append(" ".join(map(str, (each.stamp_ns / 1e9, *each.position, *each.quaternion))))
        place = np.array([500_000.0, 5_400_000.0, 0.0])
        pose = containers.pose_of(each)
        xyz = each.xyz @ pose[:3, :3].T + pose[:3, 3] + place
        write_cloud(folder / f"tiles/{number}.laz", Cloud(dict(zip("xyz", xyz.T, strict=True))))
        rows.append(",".join(map(str, (number, *(each.position + place)))))
    (folder / "trajectory.txt").write_text("\n".join(lines) + "\n")
    (folder / "stations.csv").write_text("\n".join(rows) + "\n")


def write_kitti(folder: Path, sweeps: list[containers.Sweep]) -> None:
    """Write sweeps of a lidar, and poses of a camera that a calib.txt ties to it."""
    (folder / "velodyne").mkdir(parents=True)
    to_camera = np.array([[0, -1, 0, 0], [0, 0, -1, -0.08], [1, 0, 0, -0.27], [0, 0, 0, 1.0]])
    lines = []
    for number, each in enumerate(sweeps):
        sweep = np.c_[each.xyz, np.zeros(len(each.xyz))].astype("<f4")
        sweep.tofile(folder / f"velodyne/{number:06d}.bin")
        first = np.linalg.inv(containers.pose_of(sweeps[0]))
        camera = to_camera @ first @ containers.pose_of(each) @ np.linalg.inv(to_camera)
        lines.append(" ".join(map(str, camera[:3].ravel())))
    (folder / "poses.txt").write_text("\n".join(lines) + "\n")
    calibration = " ".join(map(str, to_camera[:3].ravel()))
    (folder / "calib.txt").write_text(f"Tr: {calibration}\n")


def test_each_sensors_recording_gives_the_same_map(folder, weights_path):
    commands = [words for words in simple_commands(README) if words[:2] == ["mcpseg", "segment"]]
    commands = [words for words in commands if words[2] in SENSORS]
    assert {words[2] for words in commands} == SENSORS
    sizes = []
    for words in commands:
        result = invoke(*words[1:], "-w", weights_path, "-o", words[2].strip("/") + "-map")
        assert result.exit_code == 0, result.stderr
        cloud = read_cloud(Path(words[2].strip("/") + "-map") / "map.ply")
        sizes.append(np.sort(np.ptp(cloud.xyz, axis=0)))
    np.testing.assert_allclose(sizes, np.tile(sizes[0], (len(sizes), 1)), atol=0.05)


def test_all_commands_work_in_order_in_one_folder(folder):
    pytest.importorskip("matplotlib")
    ran = []
    for words in simple_commands(README):
        if words[0] in INSTALLS or words[1] in SERVERS or ELSEWHERE & set(words):
            continue
        assert words[0] == "mcpseg", f"{shlex.join(words)}: a command that this test does not run"
        result = invoke(*words[1:], *SMALLER.get(words[1], []))
        assert result.exit_code == 0, f"{shlex.join(words)}: {result.stderr or result.exception}"
        ran.append(words[1])
    assert set(ran) == {"segment", "export", "eval", "synth", "raytrace", "train"}
    for made in ("office.html", "office.png", "map.html", "map.png", "trained"):
        assert (folder / made).exists()


def test_package_indexes_get_whole_addresses():
    pytest.importorskip("hatchling")
    from hatch_build import FILES, PAGES, whole_addresses

    text = whole_addresses("![a](examples/a.png) [b](docs/b.md#c) [d](https://d) [e](#e)")
    expected = f"![a]({FILES}examples/a.png) [b]({PAGES}docs/b.md#c) [d](https://d) [e](#e)"
    assert text == expected
