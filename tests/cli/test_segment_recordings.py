"""``mcpseg segment`` with one argument: what holds its poses itself, and where results go."""

import json
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mcpseg_cli.cli.segment import default_output
from mcpseg_cli.formats import read_cloud
from tests import containers
from tests.commands import invoke, segment
from tests.containers import Message, Sweep
from tests.formats.test_rgbd import write_depth, write_image, write_scannet


def messages(sweeps: list[Sweep]) -> list[Message]:
    return [
        one for sweep in sweeps for one in (containers.odometry(sweep), containers.cloud(sweep))
    ]


KINDS: dict[str, tuple[str, Callable[[Path, list[Sweep]], Path]]] = {
    "ROS 1 bag": (
        "walk.bag",
        lambda path, sweeps: containers.write_ros1_bag(path, messages(sweeps)),
    ),
    "ROS 2 bag, SQLite": (
        "walk",
        lambda path, sweeps: containers.write_ros2_bag(path, messages(sweeps)),
    ),
    "ROS 2 bag, MCAP": (
        "walk",
        lambda path, sweeps: containers.write_ros2_bag(path, messages(sweeps), "mcap"),
    ),
    "MCAP": ("walk.mcap", lambda path, sweeps: containers.write_mcap(path, messages(sweeps))),
    "MCAP, ros1msg": (
        "walk.mcap",
        lambda path, sweeps: containers.write_mcap(path, messages(sweeps), "ros1"),
    ),
    "E57": ("walk.e57", containers.write_e57),
    "PTX": ("walk.ptx", containers.write_ptx),
}


@pytest.fixture(scope="module")
def sweeps(tmp_path_factory: pytest.TempPathFactory) -> list[Sweep]:
    """A small recording, in the sensor's frame."""
    from tests.recordings import write_recording

    folder = tmp_path_factory.mktemp("recording")
    return containers.sweeps_of(*write_recording(folder / "input"))


@pytest.fixture(scope="module")
def folder_run(tmp_path_factory: pytest.TempPathFactory, sweeps, weights_path) -> Path:
    """The run of the same scans as a folder of PLY with a pose file."""
    folder = tmp_path_factory.mktemp("folder")
    recording = containers.write_folder(folder / "input", sweeps)
    result = segment(recording, folder / "out", "-w", weights_path, "--frame", "sensor")
    assert result.exit_code == 0, result.output
    return folder / "out"


def write(kind: str, folder: Path, sweeps: list[Sweep]) -> Path:
    name, writer = KINDS[kind]
    folder.mkdir(exist_ok=True)
    return writer(folder / name, sweeps)


@pytest.mark.parametrize("kind", KINDS)
def test_every_recording_gives_the_map_of_the_folder(
    kind, sweeps, folder_run, tmp_path, weights_path
):
    recording = write(kind, tmp_path / "input", sweeps)
    result = invoke("segment", recording, "-o", tmp_path / "out", "-w", weights_path)
    assert result.exit_code == 0, result.output
    for name in ("map.ply", "objects.json"):
        assert (tmp_path / "out" / name).read_bytes() == (folder_run / name).read_bytes()

    # its labelled copies are PLY, in order
    copies, expected = (sorted((out / "scans").iterdir()) for out in (tmp_path / "out", folder_run))
    for copy, original in zip(copies, expected, strict=True):
        for label in ("semantic", "instance", "confidence"):
            ours, theirs = read_cloud(copy).label(label), read_cloud(original).label(label)
            np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize("kind", ["MCAP", "E57", "ROS 1 bag"])
def test_a_recording_that_has_grown_is_continued(kind, sweeps, folder_run, tmp_path, weights_path):
    words = ("-o", tmp_path / "out", "-w", weights_path)
    assert invoke("segment", write(kind, tmp_path / "a", sweeps[:2]), *words).exit_code == 0
    result = invoke("segment", write(kind, tmp_path / "b", sweeps), *words)
    assert "continuing after 2 scans" in result.stderr
    assert (tmp_path / "out/map.ply").read_bytes() == (folder_run / "map.ply").read_bytes()


@pytest.mark.parametrize("kind", ["MCAP", "E57"])
def test_a_recording_whose_consumed_scans_changed_is_refused(kind, sweeps, tmp_path, weights_path):
    words = ("-o", tmp_path / "out", "-w", weights_path)
    invoke("segment", write(kind, tmp_path / "a", sweeps[:2]), *words)
    moved = sweeps[1]._replace(xyz=sweeps[1].xyz + np.float32(0.01))
    result = invoke("segment", write(kind, tmp_path / "b", [sweeps[0], moved]), *words)
    assert result.exit_code == 1
    assert "changed since it was consumed" in result.stderr


def test_lost_copies_of_a_bag_are_written_again_and_all_can_be_exported(
    sweeps, tmp_path, weights_path
):
    bag = write("MCAP", tmp_path / "input", sweeps)
    words = ("segment", bag, "-o", tmp_path / "out", "-w", weights_path)
    invoke(*words)
    copies = sorted((tmp_path / "out/scans").iterdir())
    before = copies[1].read_bytes()
    copies[1].unlink()
    assert invoke(*words).exit_code == 0
    assert copies[1].read_bytes() == before

    result = invoke("export", tmp_path / "out", "-o", tmp_path / "final", "--scans", bag)
    assert result.exit_code == 0, result.output
    names = sorted(path.name for path in (tmp_path / "final").iterdir())
    assert names == [path.name for path in copies]


def test_the_record_says_what_was_read_and_how(sweeps, tmp_path, weights_path):
    bag = write("MCAP", tmp_path / "input", sweeps)
    result = invoke("segment", bag, "-o", tmp_path / "out", "-w", weights_path)
    record = json.loads((tmp_path / "out/run.json").read_text())
    told = ["scans: /points (lidar)", "poses: /odom, odom → lidar"]
    assert record["recording"] == ["MCAP file", *told]
    assert record["configuration"]["frame"] == "sensor"
    assert all(line in result.stderr for line in told)


def test_scans_in_sub_folders_keep_their_folders_in_the_results(
    sweeps, folder_run, tmp_path, weights_path
):
    scans, poses = containers.write_folder(tmp_path / "input", sweeps)
    for number, path in enumerate(sorted(scans.iterdir())):
        run = scans / f"run{number // 2}"
        run.mkdir(exist_ok=True)
        path.rename(run / path.name)
    words = ("-w", weights_path, "--frame", "sensor")
    for _ in range(2):  # the second finds them all
        result = segment((scans, poses), tmp_path / "out", *words)
        assert result.exit_code == 0, result.output
    assert (tmp_path / "out/map.ply").read_bytes() == (folder_run / "map.ply").read_bytes()
    below = sorted(
        path.relative_to(tmp_path / "out/scans") for path in (tmp_path / "out/scans").rglob("*.ply")
    )
    assert list(map(str, below))[::3] == ["run0/000000.ply", "run1/000003.ply"]
    again = segment((scans, poses), tmp_path / "out", *words, "--overwrite")
    assert again.exit_code == 0, again.output


def test_frames_without_a_pose_are_skipped_and_counted_if_asked(tmp_path, weights_path):
    folder = write_scannet(tmp_path / "room", 3)
    np.savetxt(folder / "pose/1.txt", np.full((4, 4), -np.inf))
    words = ("segment", folder, "-o", tmp_path / "out", "-w", weights_path, "--json")
    refused = invoke(*words)
    assert refused.exit_code == 1
    assert "no pose for 1 of 3 scans" in refused.stderr
    document = json.loads(invoke(*words, "--on-error", "skip").stdout)
    assert (document["scans"], document["skipped"]) == (3, ["1.ply"])


def test_a_topic_that_was_chosen_cannot_be_changed_on_the_way(sweeps, tmp_path, weights_path):
    rear = [containers.cloud(one, topic="/rear") for one in sweeps[:1]]
    bag = containers.write_mcap(tmp_path / "walk.mcap", [*messages(sweeps[:1]), *rear])
    words = ("segment", bag, "-o", tmp_path / "out", "-w", weights_path, "--topic")
    assert invoke(*words, "/points").exit_code == 0
    refused = invoke(*words, "/rear")
    assert refused.exit_code == 1
    assert "--topic /points, now /rear" in refused.stderr


# --- where results go ---


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "here"


def test_results_go_beside_under_the_name_of_the_recording(sweeps, here, weights_path):
    bag = write("MCAP", here, sweeps[:1])
    result = invoke("segment", bag, "-w", weights_path)
    assert result.exit_code == 0, result.output
    assert (here / "walk-labelled/map.ply").is_file()
    assert "results go to walk-labelled" in result.stderr


@pytest.mark.parametrize(
    ("recording", "name"),
    [("a/walk.mcap", "walk"), ("a/room", "room"), ("a/walk/scans", "walk"), ("a/1.2.e57", "1.2")],
)
def test_a_recording_gives_its_name_to_its_results(recording, name, here):
    path = here / recording
    (path if "." not in path.name else path.parent).mkdir(parents=True)
    assert default_output(Path(recording)) == Path(f"{name}-labelled")


def test_results_never_go_into_the_recording(here):
    (here / "run1").mkdir()
    assert default_output(Path()) == here.parent / "here-labelled"
    assert default_output(here.parent) == here.parent.parent / f"{here.parent.name}-labelled"


# --- depth images of the example walk ---


def rgbd_of_walk(folder: Path) -> tuple[Path, tuple[Path, Path]]:
    """Look at each scan of the walk through four cameras: as depth images, and as PLY."""
    width, height = 1280, 960
    matrix = np.array([[640.0, 0, 639.5], [0, 480.0, 479.5], [0, 0, 1]])
    ahead = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # a camera's axes, looking along x
    walk = containers.sweeps_of(containers.WALK / "scans", containers.WALK / "poses.csv", 2)
    seen = []
    (folder / "room/pose").mkdir(parents=True)
    for number, (sweep, yaw) in enumerate(product(walk, (0, 90, 180, 270))):
        camera = Rotation.from_euler("z", yaw, degrees=True).as_matrix() @ ahead
        xyz = sweep.xyz.astype(float) @ camera
        column, row = np.rint(xyz[:, :2] * np.diag(matrix)[:2] / xyz[:, 2:] + matrix[:2, 2]).T
        inside = (xyz[:, 2] > 0.3) & (column >= 0) & (column < width) & (row >= 0) & (row < height)

        # the nearest point of each pixel
        nearest = np.full((height, width), -1)
        order = np.flatnonzero(inside)[np.argsort(-xyz[inside, 2])]
        nearest[row[order].astype(int), column[order].astype(int)] = order
        depth = np.where(nearest < 0, 0, xyz[nearest, 2])
        write_depth(folder / f"room/depth/{number:06d}.png", depth)
        write_image(folder / f"room/color/{number:06d}.png", sweep.rgb[nearest])

        pose = containers.pose_of(sweep)
        pose[:3, :3] = pose[:3, :3] @ camera
        np.savetxt(folder / f"room/pose/{number:06d}.txt", pose)
        turn = Rotation.from_matrix(pose[:3, :3]).as_quat()
        points = nearest[nearest >= 0]
        seen.append(Sweep(0, xyz[points].astype(np.float32), sweep.rgb[points], pose[:3, 3], turn))
    np.savetxt(folder / "room/intrinsics.txt", matrix)
    return folder / "room", containers.write_folder(folder / "input", seen)


@pytest.mark.parametrize("weights", ["unet", "unet-home"])
def test_depth_images_of_the_walk_give_the_labels_of_its_points_within_1_percent(weights, tmp_path):
    room, folder = rgbd_of_walk(tmp_path)
    words = ("-w", weights)
    assert invoke("segment", room, "-o", tmp_path / "a", *words).exit_code == 0
    assert segment(folder, tmp_path / "b", "--frame", "sensor", *words).exit_code == 0
    ours, theirs = (
        [read_cloud(path) for path in sorted(scans.iterdir())]
        for scans in (tmp_path / "a/scans", tmp_path / "b/scans")
    )
    xyz = [np.concatenate([cloud.xyz for cloud in clouds]) for clouds in (ours, theirs)]
    np.testing.assert_allclose(*xyz, atol=0.003)
    labels = [np.concatenate([cloud.label("semantic") for cloud in clouds])
              for clouds in (ours, theirs)]  # fmt: skip
    assert len(labels[0]) > 4000
    assert (labels[0] == labels[1]).mean() > 0.99
