"""Sound recordings of several files, for the long campaign to damage one of them."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from mcpseg_cli.formats.poses import read_poses
from mcpseg_cli.formats.recording import list_recording, open_recording, read_scan
from tests import containers
from tests.formats import test_pose_files, test_rgbd
from tests.formats.test_bags import tf_chain
from tests.soak_sound import Sound, obey, sound_in, sound_of

_DAMAGED: dict[str, tuple[str, ...]] = {
    "ScanNet": ("depth/0.png", "color/0.png", "pose/0.txt", "intrinsic/intrinsic_depth.txt",
                "intrinsic/intrinsic_color.txt"),
    "7-Scenes": ("frame-000000.depth.png", "frame-000000.pose.txt", "intrinsics.txt"),
    "TUM": ("depth.txt", "rgb.txt", "groundtruth.txt", "intrinsics.txt"),
    "Record3D": ("metadata.json", "depth/0.npy"),
    "Stray Scanner": ("odometry.csv", "camera_matrix.csv", "confidence/000000.png",
                      "depth/000000.png"),
}  # fmt: skip
_LABELLED = ("TUM", "Record3D")
_POSES = (
    "TUM by dates", "CSV in degrees", "CSV of matrices", "EuRoC", "ROS", "RTAB-Map", "NavVis",
    "4 x 4 in four lines", "Open3D", "Record3D", "CSV of a German spreadsheet", "quoted CSV",
)  # fmt: skip


def recordings(folder: Path) -> list[Sound]:
    """Write folders of depth images, bags of them, KITTI's, and poses as many tools write them."""
    folder.mkdir(parents=True, exist_ok=True)
    return [*_depth_images(folder), *_bags(folder), *_kitti(folder), *_poses(folder)]


def _depth_images(folder: Path) -> list[Sound]:
    """Write all layouts of folders of depth images; one has arrays, one a JPEG."""
    found = []
    for layout, inners in _DAMAGED.items():
        root = test_rgbd.LAYOUTS[layout](folder / layout.replace(" ", "-"))
        if layout == "Stray Scanner":  # images of 1920 pixels take long to read
            shutil.rmtree(root / "rgb")
        if layout == "Record3D":
            for image in sorted((root / "depth").iterdir()):
                np.save(image.with_suffix(".npy"), np.asarray(Image.open(image)).astype("f4"))
                image.unlink()
        found += [sound_in(root, inner, read_whole) for inner in inners]
        if layout in _LABELLED:
            found.append(_labelled(root, inners[0], folder))
    return found


def _labelled(root: Path, inner: str, folder: Path) -> Sound:
    """Have ``mcpseg info`` and ``mcpseg segment`` read it."""
    output, whole = folder / "out", folder / f"{root.name}-labelled"
    shutil.copytree(root, whole)
    weights = folder / "weights.safetensors"
    if not weights.exists():
        from tests.recordings import write_weights

        write_weights(weights, "mcpnet")

    def label(one: Path) -> None:
        shutil.rmtree(output, ignore_errors=True)
        obey("info", one, "--json")
        obey("segment", one, "-o", output, "-w", weights, "-q", "--no-check")

    return sound_in(whole, inner, label, is_slow=True)


def read_whole(folder: Path) -> None:
    """Read a recording as ``mcpseg segment`` and ``mcpseg info`` do."""
    list_recording(folder)
    recording = open_recording(folder, on_error="skip")
    for source in recording:
        if source.pose is not None:
            read_scan(source, "map", 0.1)
        source.fingerprint()
    open_recording(folder)


def _bags(folder: Path) -> list[Sound]:
    """Write bags: depth images with colours and intrinsics, transforms, paths; and ROS 2's."""
    sweeps = containers.sweeps_of(containers.WALK / "scans", containers.WALK / "poses.csv", 2)
    small = [one._replace(xyz=one.xyz[:20], rgb=one.rgb[:20]) for one in sweeps]
    messages = []
    for number, one in enumerate(small):
        depth = np.ascontiguousarray(test_rgbd.depth_image(number)[::3, ::2])
        colour = np.ascontiguousarray(test_rgbd.colour_image(number)[::3, ::2])
        camera = np.array([[25.0, 0, 9.5], [0, 20.0, 4.5], [0, 0, 1]])
        stamp, depths, colours = one.stamp_ns, "/camera/depth", "/camera/color"
        messages += [
            containers.odometry(one, child="camera"),
            containers.camera_info(camera, stamp, f"{depths}/camera_info"),
            containers.camera_info(camera, stamp, f"{colours}/camera_info"),
            containers.image(
                np.rint(1000 * depth).astype("<u2"), "16UC1", stamp, f"{depths}/image_raw"
            ),
            containers.image(colour, "rgb8", stamp, f"{colours}/image_raw"),
        ]
    transforms, _ = tf_chain(small)
    clouds = [containers.cloud(one) for one in small]
    path = [containers.path_message(small), *(containers.cloud(one, frame="map") for one in small)]
    write: dict[str, Callable[[Path], Path]] = {
        "depth.bag": lambda at: containers.write_ros1_bag(at, messages),
        "depth.mcap": lambda at: containers.write_mcap(at, messages, chunked=False),
        "transforms.bag": lambda at: containers.write_ros1_bag(at, [*transforms, *clouds]),
        "path.mcap": lambda at: containers.write_mcap(at, path, "ros1"),
    }
    found = [sound_of(make(folder / name), read_whole) for name, make in write.items()]
    for storage in ("sqlite3", "mcap"):
        root = containers.write_ros2_bag(
            folder / f"ros2-{storage}", [*transforms, *clouds], storage
        )
        found.append(sound_in(root, "metadata.yaml", read_whole))
    return found


def _kitti(folder: Path) -> list[Sound]:
    """Write a sequence of KITTI, and poses of its camera with the calibration."""
    root = folder / "kitti"
    (root / "velodyne").mkdir(parents=True)
    poses = test_pose_files.kitti(root, "calib.txt").poses
    shutil.copy(root / "poses/00.txt", root / "poses.txt")
    for number in range(len(poses)):
        rows = np.random.default_rng(number).random((9, 4)).astype("<f4")
        (root / f"velodyne/{number:06d}.bin").write_bytes(rows.tobytes())
    inners = ("calib.txt", "poses.txt", "velodyne/000001.bin")
    return [sound_in(root, inner, read_whole) for inner in inners]


def _poses(folder: Path) -> list[Sound]:
    """Write poses as many tools do."""

    def read(path: Path) -> None:
        read_poses(path, is_growing=True)
        read_poses(path)

    found = []
    for name in _POSES:
        path = folder / f"{name.replace(' ', '-')}.txt"
        path.write_text("\n".join(test_pose_files.FILES[name]) + "\n")
        found.append(sound_of(path, read))
    return found
