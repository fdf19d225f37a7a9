"""Recordings of several files of which one is damaged: a line, or what is sound of them."""

import json
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.poses import read_poses
from mcpseg_cli.formats.recording import open_recording, read_scan
from tests import containers
from tests.formats.test_rgbd import (
    LAYOUTS,
    MATRIX,
    colour_image,
    depth_image,
    write_scannet,
    write_tum,
)

pytestmark = pytest.mark.filterwarnings("error")
TOO_LONG = "9" * 400
SIGNALLING = {"<f4": 0x7FA00000, "<f8": 0x7FF4000000000000}


def read_all(folder: Path) -> None:
    for source in open_recording(folder, on_error="skip"):
        if source.pose is not None:
            read_scan(source, "map", 0.1)


# --- folders of depth images ---


@pytest.mark.parametrize("word", ["1e300", TOO_LONG, "-1e12", "1e999999999", "nan", "-inf"])
@pytest.mark.parametrize("name", ["depth.txt", "rgb.txt", "groundtruth.txt"])
def test_a_time_that_no_clock_tells_is_refused_with_its_line(name, word, tmp_path):
    folder = write_tum(tmp_path / "recording")
    lines = (folder / name).read_text().splitlines()
    lines[2] = " ".join([word, *lines[2].split()[1:]])
    (folder / name).write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"in line 3; expected a time in seconds; mend the line"):
        open_recording(folder)


@pytest.mark.parametrize("name", ["depth.txt", "rgb.txt"])
@pytest.mark.parametrize("letter", ["\0", "\x1b", "\x7f"])
def test_an_image_of_a_name_that_cannot_be_written_is_refused(name, letter, tmp_path):
    folder = write_tum(tmp_path / "recording")
    lines = (folder / name).read_text().splitlines()
    (folder / name).write_text(lines[0] + "\n" + lines[1].replace(".png", f"{letter}.png"))
    with pytest.raises(InputError, match=r"line 2 names '.*'; expected an image; mend the line"):
        open_recording(folder)


FOCAL = {
    "ScanNet": "intrinsic/intrinsic_depth.txt", "7-Scenes": "intrinsics.txt",
    "TUM": "intrinsics.txt", "Record3D": "metadata.json", "Stray Scanner": "camera_matrix.csv",
}  # fmt: skip


@pytest.mark.parametrize(
    ("layout", "focal"),
    [*((layout, np.inf) for layout in LAYOUTS),
     *(("ScanNet", focal) for focal in (np.nan, -50.0, 0.0, 1e-300, 1e300))],
)  # fmt: skip
def test_a_camera_without_a_focal_length_is_refused(layout, focal, tmp_path):
    folder = LAYOUTS[layout](tmp_path / "recording")
    path, matrix = folder / FOCAL[layout], MATRIX.copy()
    matrix[0, 0] = focal
    if layout == "Record3D":
        facts = json.loads(path.read_text()) | {"K": matrix.T.ravel().tolist(), "w": 40}
        path.write_text(json.dumps(facts))
    else:
        np.savetxt(path, matrix, delimiter=",")
    with pytest.raises(InputError, match=r"a focal length of .*; expected pixels"):
        read_all(folder)


@pytest.mark.parametrize("dtype", ["<f4", "<f8"])
def test_depth_that_is_no_number_of_any_kind_is_no_point(dtype, tmp_path):
    folder = write_scannet(tmp_path / "recording", 1)
    depth = (1000 * depth_image(0)).astype(dtype)
    bits = depth.view(f"<u{depth.itemsize}")
    bits[0, 0] = SIGNALLING[dtype]
    depth[0, 1:3] = np.nan, np.inf
    np.save(folder / "depth/0.npy", depth)
    (folder / "depth/0.png").unlink()
    (source,) = open_recording(folder)
    assert len(source.read()) == (depth_image(0) > 0).sum() - 3


def test_points_that_no_pixel_shows_are_grey(tmp_path):
    folder = write_scannet(tmp_path / "recording", 1)
    np.savetxt(folder / "intrinsic/intrinsic_color.txt", np.diag([1.0, 1.0, 1.0, 1.0]) * 1e18)
    with pytest.raises(InputError, match="a focal length of"):
        read_all(folder)


# --- poses ---


@pytest.mark.parametrize("head", ["a b c", "0x 1 2", "nothing"])
def test_a_matrix_of_a_log_that_no_numbers_precede_is_refused(head, tmp_path):
    block = ["0 0 1", "1 0 0 0", "0 1 0 0", "0 0 1 0", "0 0 0 1"]
    path = tmp_path / "poses.log"
    path.write_text("\n".join([*block, head, *block[1:]]) + "\n")
    with pytest.raises(InputError, match=r"in line 6; expected numbers; copy the file again"):
        read_poses(path)


@pytest.mark.parametrize("number", ["1e300", "nan", "inf", "9007199254740993"])
def test_a_log_whose_numbers_count_nothing_gives_poses_without_ids(number, tmp_path):
    block = ["1 0 0 0", "0 1 0 0", "0 0 1 0", "0 0 0 1"]
    path = tmp_path / "poses.log"
    path.write_text("\n".join(["0 0 1", *block, f"{number} 1 2", *block]) + "\n")
    poses = read_poses(path)
    assert (len(poses), poses.ids) == (2, None)


# --- bags ---


@pytest.fixture
def bag(tmp_path) -> Path:
    """A ROS 2 bag of depth and colours, with metadata of its own."""
    messages = []
    for number in range(2):
        sweep = containers.Sweep(
            containers.START_NS + number * containers.STEP_NS, np.zeros((1, 3), np.float32),
            np.zeros((1, 3), np.uint8), np.zeros(3), np.array([0, 0, 0, 1.0]),
        )  # fmt: skip
        depth = np.rint(1000 * depth_image(number)).astype("<u2")
        stamp = sweep.stamp_ns
        messages += [
            containers.odometry(sweep, child="camera"),
            containers.camera_info(MATRIX, stamp, "/camera/depth/camera_info"),
            containers.image(depth, "16UC1", stamp, "/camera/depth/image_raw"),
            containers.image(colour_image(number), "rgb8", stamp, "/camera/color/image_raw"),
        ]
    return containers.write_ros2_bag(tmp_path / "bag", messages)


def test_an_undamaged_bag_is_read(bag):
    read_all(bag)


@pytest.mark.parametrize("count", ["'4'", "[]", "4.5x", "{}"])
def test_metadata_whose_counts_are_no_numbers_are_refused(count, bag):
    path = bag / "metadata.yaml"
    text = path.read_text()
    assert "message_count: 2\n" in text
    path.write_text(text.replace("message_count: 2\n", f"message_count: {count}\n"))
    with pytest.raises(InputError, match=r"rosbags: .*; expected a whole ROS bag"):
        read_all(bag)


def test_a_topic_that_has_none_of_the_messages_it_promises_is_refused(bag):
    database = next(bag.glob("*.db3"))
    with closing(sqlite3.connect(database)) as connection, connection:
        connection.execute(
            "DELETE FROM messages WHERE topic_id IN (SELECT id FROM topics WHERE name LIKE ?)",
            ("%color/image_raw",),
        )
    with pytest.raises(InputError, match=r"no message on /camera/color/image_raw; expected those"):
        read_all(bag)
