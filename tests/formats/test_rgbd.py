"""Folders of depth images: which pixel is which point, in the layouts there are."""

import json
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial.transform import Rotation

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.recording import open_recording, read_scan
from tests.containers import Sweep, pose_of, write_folder

MATRIX = np.array([[50.0, 0, 19.5], [0, 60.0, 14.5], [0, 0, 1]])
HEIGHT, WIDTH = 30, 40


def depth_image(seed: int) -> np.ndarray:
    """A wall of 1 to 3 m with a hole, in metres to the millimetre."""
    depth = np.random.default_rng(seed).integers(1000, 3000, (HEIGHT, WIDTH)) / 1000
    depth[5:9, 5:9] = 0
    return depth


def colour_image(seed: int, scale: int = 1) -> np.ndarray:
    shape = (scale * HEIGHT, scale * WIDTH, 3)
    return np.random.default_rng(seed).integers(0, 256, shape).astype(np.uint8)


def pose(number: int) -> np.ndarray:
    """A camera (z forward, y down) that looks along x of a map with z up, moving along x."""
    forward = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
    matrix = np.eye(4)
    turn = Rotation.from_euler("z", 5 * number, degrees=True).as_matrix()
    matrix[:3, :3] = turn @ forward
    matrix[:3, 3] = [0.1 * number, 0.0, 1.5]
    return matrix


def expected_points(depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unproject pixel by pixel; (N, 3) in the camera's frame, and which pixel each is."""
    points, pixels = [], []
    for row in range(HEIGHT):
        for column in range(WIDTH):
            if z := depth[row, column]:
                x = (column - MATRIX[0, 2]) * z / MATRIX[0, 0]
                points.append((x, (row - MATRIX[1, 2]) * z / MATRIX[1, 1], z))
                pixels.append((row, column))
    return np.array(points), np.array(pixels)


def write_image(path: Path, image: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    assert o3d.io.write_image(str(path), o3d.geometry.Image(np.ascontiguousarray(image)))


def write_depth(path: Path, depth: np.ndarray, per_metre: float = 1000.0) -> None:
    write_image(path, np.rint(depth * per_metre).astype(np.uint16))


def write_scannet(folder: Path, count: int = 2) -> Path:
    for number in range(count):
        write_depth(folder / f"depth/{number}.png", depth_image(number))
        write_image(folder / f"color/{number}.png", colour_image(number))
        (folder / "pose").mkdir(exist_ok=True)
        np.savetxt(folder / f"pose/{number}.txt", pose(number))
    (folder / "intrinsic").mkdir()
    for kind in ("depth", "color"):
        matrix = np.eye(4)
        matrix[:3, :3] = MATRIX
        np.savetxt(folder / f"intrinsic/intrinsic_{kind}.txt", matrix)
    return folder


def write_seven_scenes(folder: Path, count: int = 2) -> Path:
    folder.mkdir()
    for number in range(count):
        depth = depth_image(number)
        raw = np.where(depth == 0, 65535, np.rint(1000 * depth)).astype(np.uint16)
        write_image(folder / f"frame-{number:06d}.depth.png", raw)
        write_image(folder / f"frame-{number:06d}.color.png", colour_image(number))
        np.savetxt(folder / f"frame-{number:06d}.pose.txt", pose(number))
    np.savetxt(folder / "intrinsics.txt", MATRIX)
    return folder


def quaternion(matrix: np.ndarray) -> list[float]:
    return Rotation.from_matrix(matrix[:3, :3]).as_quat().tolist()


def write_tum(folder: Path, count: int = 2) -> Path:
    """Depth at 2 Hz, colour 3 ms later, poses at 30 Hz that have the depth's moments between."""
    lists: dict[str, list[str]] = {"depth": ["# time file"], "rgb": ["# time file"]}
    for number in range(count):
        for kind, time in (("depth", 100.0 + 0.5 * number), ("rgb", 100.003 + 0.5 * number)):
            file = f"{kind}/{time:.6f}.png"
            lists[kind].append(f"{time:.6f} {file}")
            if kind == "depth":
                write_depth(folder / file, depth_image(number), 5000.0)
            else:
                write_image(folder / file, colour_image(number))
    poses = ["# timestamp tx ty tz qx qy qz qw"]
    for step in range(-1, 30 * count):
        moment = (step + 0.5) / 15  # in scans
        values = [100.0 + 0.5 * moment, *pose(moment)[:3, 3], *quaternion(pose(moment))]
        poses.append(" ".join(f"{value:.9f}" for value in values))
    for name, lines in (
        *((f"{kind}.txt", one) for kind, one in lists.items()),
        ("groundtruth.txt", poses),
    ):
        (folder / name).write_text("\n".join(lines) + "\n")
    (folder / "intrinsics.txt").write_text("50 60 19.5 14.5\n")
    return folder


Z_UP_TO_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def write_record3d(folder: Path, count: int = 2) -> Path:
    """Colour images twice the size of depth; ARKit's poses: y up, cameras that look along -z."""
    poses = []
    for number in range(count):
        write_depth(folder / f"depth/{number}.png", depth_image(number))
        write_image(
            folder / f"rgb/{number}.png",
            np.kron(colour_image(number), np.ones((2, 2, 1), np.uint8)),
        )
        arkit = Z_UP_TO_Y_UP @ pose(number) @ np.diag([1.0, -1, -1, 1])
        poses.append([*quaternion(arkit), *arkit[:3, 3]])
    matrix = 2 * MATRIX
    matrix[2, 2] = 1
    facts = {"poses": poses, "K": matrix.T.ravel().tolist(), "w": 2 * WIDTH, "h": 2 * HEIGHT}
    (folder / "metadata.json").write_text(json.dumps(facts))
    return folder


def write_stray(folder: Path, count: int = 2) -> Path:
    """Intrinsics of 1920 pixels; depth without confidence in its last row."""
    lines = ["timestamp, frame, x, y, z, qx, qy, qz, qw"]
    for number in range(count):
        depth = depth_image(number)
        write_depth(folder / f"depth/{number:06d}.png", np.where(depth == 0, 2.0, depth))
        write_image(folder / f"confidence/{number:06d}.png", (2 * (depth > 0)).astype(np.uint8))
        write_image(
            folder / f"rgb/{number:06d}.png",
            np.kron(colour_image(number), np.ones((48, 48, 1), np.uint8)),
        )
        y_up = Z_UP_TO_Y_UP @ pose(number)
        values = [0.5 * number, *y_up[:3, 3], *quaternion(y_up)]
        words = [f"{value:.9f}" for value in values]
        lines.append(", ".join([words[0], f"{number:06d}", *words[1:]]))
    (folder / "odometry.csv").write_text("\n".join(lines) + "\n")
    matrix = 48 * MATRIX
    matrix[2, 2] = 1
    np.savetxt(folder / "camera_matrix.csv", matrix, delimiter=",")
    return folder


LAYOUTS = {
    "ScanNet": write_scannet,
    "7-Scenes": write_seven_scenes,
    "TUM": write_tum,
    "Record3D": write_record3d,
    "Stray Scanner": write_stray,
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_pixel_with_depth_is_a_point_where_the_camera_saw_it(layout, tmp_path):
    recording = open_recording(LAYOUTS[layout](tmp_path / "recording"))
    assert (recording.kind, recording.frame) == (f"RGB-D folder ({layout})", "sensor")
    assert len(recording) == 2
    for number, source in enumerate(recording):
        np.testing.assert_allclose(source.pose, pose(number), atol=2e-4)
        scan, cloud = read_scan(source, "map", 0.1)
        points, pixels = expected_points(depth_image(number))
        np.testing.assert_allclose(cloud.xyz, points, atol=1e-4)
        in_map = points @ pose(number)[:3, :3].T + pose(number)[:3, 3]
        np.testing.assert_allclose(scan.xyz, in_map, atol=1e-3)
        same = (scan.rgb == colour_image(number)[pixels[:, 0], pixels[:, 1]]).all(axis=1)
        assert same.mean() > 0.99  # of a colour image twice as large, a pixel beside at times


def test_frames_come_in_natural_order_under_the_names_of_their_images(tmp_path):
    recording = open_recording(write_scannet(tmp_path / "recording", 11))
    assert [source.name for source in recording][8:] == ["8.ply", "9.ply", "10.ply"]


def test_a_frame_is_known_by_its_images_and_its_camera(tmp_path):
    folder = write_scannet(tmp_path / "recording")
    first, second = (source.fingerprint() for source in open_recording(folder))
    write_image(folder / "color/1.png", colour_image(7))
    recording = open_recording(folder)
    assert recording[0].is_still(first)
    assert not recording[1].is_still(second)
    (folder / "intrinsic/intrinsic_depth.txt").write_text("51 60 19.5 14.5")
    assert not open_recording(folder)[0].is_still(first)


def test_lost_tracking_is_refused_or_left_without_a_pose(tmp_path):
    folder = write_scannet(tmp_path / "recording")
    np.savetxt(folder / "pose/1.txt", np.full((4, 4), -np.inf))
    with pytest.raises(InputError, match=r"no pose for 1 of 2 scans, as 1\.ply"):
        open_recording(folder)
    assert [source.pose is None for source in open_recording(folder, on_error="skip")] == [
        False,
        True,
    ]


def test_depth_images_far_from_any_pose_have_none(tmp_path):
    folder = write_tum(tmp_path / "recording")
    rows = (folder / "groundtruth.txt").read_text().splitlines()
    (folder / "groundtruth.txt").write_text("\n".join(rows[:10]) + "\n")
    recording = open_recording(folder, on_error="skip")
    assert [source.pose is None for source in recording] == [False, True]


def test_points_beside_the_colour_image_are_grey(tmp_path):
    folder = write_scannet(tmp_path / "recording", 1)
    write_image(folder / "color/0.png", np.full((HEIGHT, 30, 3), 9, np.uint8))
    (source,) = open_recording(folder)
    cloud = source.read()
    _, pixels = expected_points(depth_image(0))
    np.testing.assert_array_equal(cloud.rgb[:, 0], np.where(pixels[:, 1] < 30, 9, 128))


def test_a_recording_without_intrinsics_is_refused_with_where_to_write_them(tmp_path):
    folder = write_tum(tmp_path / "recording")
    (folder / "intrinsics.txt").unlink()
    with pytest.raises(InputError, match=r"write fx fy cx cy into .*intrinsics\.txt"):
        open_recording(folder)


def test_the_cameras_of_the_tum_dataset_are_known_by_its_names(tmp_path):
    folder = write_tum(tmp_path / "rgbd_dataset_freiburg2_desk")
    (folder / "intrinsics.txt").unlink()
    recording = open_recording(folder)
    assert recording.notes[0] == "intrinsics: freiburg2's"
    with pytest.raises(InputError, match="a principal point at 325"):  # of 640 pixels, here 40
        recording[0].read()


def test_depth_of_8_bits_is_refused(tmp_path):
    folder = write_scannet(tmp_path / "recording", 1)
    write_image(folder / "depth/0.png", np.ones((HEIGHT, WIDTH), np.uint8))
    with pytest.raises(InputError, match=r"uint8 .*; expected depth of 16 bits"):
        open_recording(folder)[0].read()


@pytest.mark.parametrize("kept", [4, 60, 700])
def test_a_damaged_image_is_refused(kept, tmp_path):
    folder = write_scannet(tmp_path / "recording", 1)
    file = folder / "depth/0.png"
    file.write_bytes(file.read_bytes()[:kept])
    with pytest.raises(InputError, match=r"0\.png: no whole image"):
        open_recording(folder)[0].read()


def test_record3ds_own_compression_is_refused_with_what_to_do(tmp_path):
    folder = write_record3d(tmp_path / "recording")
    (folder / "depth").rename(folder / "rgbd")
    with pytest.raises(InputError, match=r"LZFSE.*; convert them to 16-bit PNG"):
        open_recording(folder)


def test_a_pose_file_takes_the_place_of_the_poses_of_the_recording(tmp_path):
    folder = write_scannet(tmp_path / "recording")
    other = Sweep(
        0,
        np.zeros((1, 3), np.float32),
        np.zeros((1, 3), np.uint8),
        np.ones(3),
        np.array([0, 0, 0, 1.0]),
    )
    _, poses = write_folder(tmp_path / "folder", [other, other])
    poses.write_text(poses.read_text().replace("000000", "0").replace("000001", "1"))
    recording = open_recording(folder, poses)
    np.testing.assert_array_equal(recording[0].pose, pose_of(other))


@pytest.mark.parametrize("lost", [0.0, float("nan")])
def test_record3d_frames_of_lost_tracking_have_no_pose(tmp_path, lost):
    folder = write_record3d(tmp_path / "recording", 3)
    facts = json.loads((folder / "metadata.json").read_text())
    facts["poses"][1] = [lost] * 7
    (folder / "metadata.json").write_text(json.dumps(facts))
    with pytest.raises(InputError, match=r"no pose for 1 of 3 scans, as 1\.ply"):
        open_recording(folder)
    recording = open_recording(folder, on_error="skip")
    assert [source.pose is None for source in recording] == [False, True, False]
