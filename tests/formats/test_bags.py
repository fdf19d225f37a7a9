"""Bags: which topic has the scans, where the sensor was, and what is refused."""

import builtins
import sqlite3
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.typesys import Stores, TypesysError, get_typestore

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.recording import Recording, TopicChoice, open_recording, read_scan
from mcpseg_cli.formats.recordings.message_types import guard
from tests import containers
from tests.containers import WALK, Message, Sweep
from tests.formats.test_rgbd import MATRIX, colour_image, depth_image, write_scannet

WriteBag = Callable[[Path, Sequence[Message]], Path]
WRITERS: dict[str, tuple[str, WriteBag]] = {
    "ROS 1 bag": ("walk.bag", containers.write_ros1_bag),
    "ROS 2 bag (SQLite)": ("walk", containers.write_ros2_bag),
    "ROS 2 bag (MCAP)": (
        "walk",
        lambda path, messages: containers.write_ros2_bag(path, messages, "mcap"),
    ),
    "MCAP file": ("walk.mcap", containers.write_mcap),
    "MCAP file, ros1msg": (
        "walk.mcap",
        lambda path, messages: containers.write_mcap(path, messages, "ros1"),
    ),
}
every_kind = pytest.mark.parametrize("kind", WRITERS)


def write(kind: str, folder: Path, messages: Sequence[Message]) -> Path:
    name, writer = WRITERS[kind]
    return writer(folder / name, messages)


def write_small(folder: Path, messages: Sequence[Message]) -> Path:
    return write("MCAP file", folder, messages)


@pytest.fixture(scope="session")
def walk() -> list[Sweep]:
    """The first scans of the example walk, in the sensor's frame."""
    return containers.sweeps_of(WALK / "scans", WALK / "poses.csv", 2)


@pytest.fixture
def small() -> list[Sweep]:
    """Sweeps of a few points along x, turned a little more each time."""
    rng = np.random.default_rng(0)
    sweeps = []
    for number in range(4):
        turn = np.array([0, 0, np.sin(0.1 * number), np.cos(0.1 * number)])
        sweeps.append(
            Sweep(
                containers.START_NS + number * containers.STEP_NS,
                rng.uniform(-2, 2, (20, 3)).astype(np.float32),
                rng.integers(0, 256, (20, 3)).astype(np.uint8),
                np.array([0.1 * number, 0.3, 1.0]),
                turn,
            )
        )
    return sweeps


def both(sweeps: Sequence[Sweep]) -> list[Message]:
    return [
        message
        for sweep in sweeps
        for message in (containers.odometry(sweep), containers.cloud(sweep))
    ]


def poses_of(recording: Recording) -> np.ndarray:
    return np.stack([source.pose for source in recording])


# --- the same scans ---


@every_kind
def test_a_bag_gives_the_scans_of_the_folder_to_the_last_bit(kind, walk, tmp_path):
    bag = write(kind, tmp_path, both(walk))
    folder = open_recording(*containers.write_folder(tmp_path / "folder", walk), "sensor")
    recording = open_recording(bag)
    assert (recording.kind, recording.frame) == (kind.partition(",")[0], "sensor")
    for source, expected in zip(recording, folder, strict=True):
        scan, cloud = read_scan(source, "map", 0.1)
        true, true_cloud = read_scan(expected, "sensor", 0.1)
        np.testing.assert_array_equal(scan.xyz, true.xyz)
        np.testing.assert_array_equal(scan.rgb, true.rgb)
        np.testing.assert_array_equal(scan.pose, true.pose)
        np.testing.assert_array_equal(cloud.xyz, true_cloud.xyz)


@every_kind
def test_scans_are_read_again_in_any_order_and_known_by_their_content(kind, small, tmp_path):
    bag = write(kind, tmp_path, both(small))
    recording = open_recording(bag)
    kept = [source.fingerprint() for source in recording]
    assert len({one.sha256 for one in kept}) == len(small)
    for number in (3, 0, 2, 1):
        np.testing.assert_array_equal(recording[number].read().xyz, small[number].xyz)
    assert all(source.is_still(one) for source, one in zip(recording, kept, strict=True))

    changed = [sweep._replace(xyz=sweep.xyz + np.float32(n == 2)) for n, sweep in enumerate(small)]
    (tmp_path / "other").mkdir()
    other = open_recording(write(kind, tmp_path / "other", both(changed)))
    still = [source.is_still(one) for source, one in zip(other, kept, strict=True)]
    assert still == [True, True, False, True]


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_file_of_a_ros_2_bag_is_one_by_itself(storage, small, tmp_path):
    bag = containers.write_ros2_bag(tmp_path / "walk", both(small), storage)
    (file,) = (path for path in bag.iterdir() if path.suffix in (".db3", ".mcap"))
    assert len(open_recording(file)) == 4
    (bag / "metadata.yaml").unlink()  # as of a recorder that was killed
    assert len(open_recording(bag)) == 4


def test_a_folder_of_clouds_with_a_pose_file_is_one_whatever_else_is_there(small, tmp_path):
    scans, poses = containers.write_folder(tmp_path / "folder", small)
    write_small(scans, both(small))
    assert open_recording(scans, poses).kind == "folder of scans (ply)"
    assert open_recording(scans).kind == "MCAP file"


def test_scans_are_named_by_their_time(small, tmp_path):
    recording = open_recording(write_small(tmp_path, both(small)))
    assert [source.name for source in recording][:2] == [
        "1700000000.000000000.ply",
        "1700000000.200000000.ply",
    ]
    assert recording[1].stamp == pytest.approx(1_700_000_000.2)


def test_scans_of_one_moment_have_names_of_their_own(small, tmp_path):
    twice = [containers.cloud(small[0]), containers.cloud(small[0])]
    recording = open_recording(write_small(tmp_path, [containers.odometry(small[0]), *twice]))
    assert [source.name for source in recording] == [
        "1700000000.000000000.ply",
        "1700000000.000000000_1.ply",
    ]


# --- points ---


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("bits", [0x7FC00000, 0x7FA00000], ids=["quiet", "signalling"])
def test_points_without_return_are_dropped_and_other_fields_kept(bits, small, tmp_path):
    table = np.zeros((2, 3), [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("ring", "<u2")])
    table["x"] = [[7, 1, 2], [0, 4, 5]]
    table["x"].view("<u4")[0, 0] = bits
    table["ring"] = [[0, 1, 2], [3, 4, 5]]
    cloud = containers.table_cloud(table, small[0].stamp_ns, "/points", "lidar")
    (source,) = open_recording(write_small(tmp_path, [containers.odometry(small[0]), cloud]))
    read = source.read()
    np.testing.assert_array_equal(read.columns["ring"], [1, 2, 4, 5])
    assert read.rgb is None


def test_a_cloud_without_coordinates_is_refused_with_its_fields(small, tmp_path):
    table = np.zeros(3, [("x", "<f4"), ("range", "<f4")])
    cloud = containers.table_cloud(table, small[0].stamp_ns, "/points", "lidar")
    (source,) = open_recording(write_small(tmp_path, [containers.odometry(small[0]), cloud]))
    with pytest.raises(InputError, match="without y, z, of x, range"):
        source.read()


def test_depth_images_are_unprojected_as_those_of_a_folder_are(small, tmp_path):
    folder = open_recording(write_scannet(tmp_path / "folder"))
    messages = []
    for number, one in enumerate(small[:2]):
        depth = np.rint(1000 * depth_image(number)).astype("<u2")
        colour = containers.image(
            colour_image(number), "rgb8", one.stamp_ns + 1000, "/camera/color/image_raw"
        )
        messages += [
            containers.odometry(one, child="camera"),
            containers.camera_info(MATRIX, one.stamp_ns, "/camera/depth/camera_info"),
            containers.camera_info(2 * MATRIX, one.stamp_ns, "/camera/color/camera_info"),
            containers.image(depth, "16UC1", one.stamp_ns, "/camera/depth/image_raw"),
            colour,
        ]
    recording = open_recording(write("ROS 1 bag", tmp_path, messages))
    assert recording.frame == "sensor"
    for source, expected in zip(recording, folder, strict=True):
        np.testing.assert_array_equal(source.read().xyz, expected.read().xyz)
        np.testing.assert_array_equal(source.read().rgb, expected.read().rgb)
        assert source.is_still(source.fingerprint())


def test_colours_of_another_camera_are_not_used(small, tmp_path):
    one = small[0]
    depth = np.rint(1000 * depth_image(0)).astype("<u2")
    messages = [
        containers.odometry(one, child="camera"),
        containers.camera_info(MATRIX, one.stamp_ns, "/depth/camera_info"),
        containers.image(depth, "16UC1", one.stamp_ns, "/depth/image_raw"),
        containers.image(colour_image(0), "rgb8", one.stamp_ns, "/color/image_raw", "color"),
    ]
    recording = open_recording(write_small(tmp_path, messages))
    assert recording[0].read().rgb is None
    assert "no colours: /color/image_raw: none of the frame" in recording.notes[-1]


def test_depth_images_without_camera_info_are_refused(small, tmp_path):
    depth = containers.image(
        np.ones((4, 4), "<f4"), "32FC1", small[0].stamp_ns, "/camera/depth/image_raw"
    )
    said = refusal(write_small(tmp_path, [containers.odometry(small[0]), depth]))
    assert "camera_info on no topic; expected it on /camera/depth/camera_info" in said


# --- where the sensor was ---


def tf_chain(sweeps: Sequence[Sweep]) -> tuple[list[Message], np.ndarray]:
    """The robot moves in the map, the lidar is fixed on it; and the lidar's true poses."""
    mount = np.eye(4)
    mount[:3, 3] = [0.2, 0, 0.5]
    fixed = containers.transform(
        sweeps[0].stamp_ns, "base_link", "lidar", mount, topic="/tf_static"
    )
    moving = [containers.transform(one.stamp_ns, "map", "base_link", one) for one in sweeps]
    return [fixed, *moving], np.stack([containers.pose_of(one) @ mount for one in sweeps])


@every_kind
def test_transforms_lead_from_the_map_to_the_sensor(kind, small, tmp_path):
    transforms, expected = tf_chain(small)
    recording = open_recording(
        write(kind, tmp_path, [*transforms, *(containers.cloud(one) for one in small)])
    )
    np.testing.assert_allclose(poses_of(recording), expected, atol=1e-12)
    assert "poses: transforms map → base_link → lidar" in recording.notes


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_types_that_a_file_does_not_describe_are_the_usual_ones(encoding, small, tmp_path):
    transforms, expected = tf_chain(small)
    messages = [*transforms, *(containers.cloud(one) for one in small)]
    path = tmp_path / "walk.mcap"
    bag = containers.write_mcap(path, messages, encoding, describes_types=False)
    np.testing.assert_allclose(poses_of(open_recording(bag)), expected, atol=1e-12)


def test_odometry_goes_on_where_fixed_transforms_end(small, tmp_path):
    transforms, expected = tf_chain(small)
    odometry = [containers.odometry(one, child="base_link") for one in small]
    clouds = [containers.cloud(one) for one in small]
    recording = open_recording(write_small(tmp_path, [transforms[0], *odometry, *clouds]))
    np.testing.assert_allclose(poses_of(recording), expected, atol=1e-12)


@pytest.mark.parametrize("kind", ["PoseStamped", "Path"])
def test_poses_that_do_not_say_of_what_are_those_of_the_sensor(kind, small, tmp_path):
    if kind == "Path":
        poses = [containers.path_message(small[:2]), containers.path_message(small)]
    else:
        poses = [containers.stamped(one) for one in small]
    clouds = [containers.cloud(one) for one in small]
    recording = open_recording(write_small(tmp_path, [*poses, *clouds]))
    expected = np.stack([containers.pose_of(one) for one in small])
    np.testing.assert_array_equal(poses_of(recording), expected)
    assert "(taken as those of lidar)" in " ".join(recording.notes)


def test_a_pose_between_two_is_interpolated(small, tmp_path):
    late = small[0]._replace(stamp_ns=small[0].stamp_ns + containers.STEP_NS // 4)
    odometry = [containers.odometry(one) for one in small]
    (source,) = open_recording(write_small(tmp_path, [*odometry, containers.cloud(late)]))
    np.testing.assert_allclose(source.pose[:3, 3], [0.025, 0.3, 1.0])
    angle = np.arctan2(source.pose[1, 0], source.pose[0, 0])
    assert angle == pytest.approx(0.05)


def test_registered_clouds_stay_where_they_are(small, tmp_path):
    odometry = [containers.odometry(one, parent="camera_init", child="body") for one in small]
    clouds = [containers.cloud(one, frame="camera_init") for one in small]
    recording = open_recording(write_small(tmp_path, [*odometry, *clouds]))
    assert recording.frame == "map"
    scan, _ = read_scan(recording[1], "sensor", 0.1)
    np.testing.assert_array_equal(scan.xyz, small[1].xyz)
    np.testing.assert_array_equal(scan.position, small[1].position)


def test_a_scan_in_a_gap_of_the_poses_is_refused_or_left_without(small, tmp_path):
    late = small[3]._replace(stamp_ns=small[3].stamp_ns + 1_000_000_000)
    bag = write_small(tmp_path, [*both(small), containers.cloud(late)])
    with pytest.raises(InputError, match=r"no pose for 1 of 5 scans, as 1700000001\.6"):
        open_recording(bag)
    recording = open_recording(bag, on_error="skip")
    assert [source.pose is None for source in recording] == [False] * 4 + [True]


@pytest.mark.parametrize("lost", [[0.0, 0.0, 0.0, 0.0], [np.nan] * 4])
def test_poses_of_lost_tracking_are_none(small, tmp_path, lost):
    far = [
        one._replace(stamp_ns=containers.START_NS + number * 1_000_000_000)
        for number, one in enumerate(small)
    ]
    odometry = [containers.odometry(one) for one in far]
    odometry[1] = containers.odometry(far[1]._replace(quaternion=np.array(lost)))
    bag = write_small(tmp_path, [*odometry, *(containers.cloud(one) for one in far)])
    recording = open_recording(bag, on_error="skip")
    assert [source.pose is None for source in recording] == [False, True, False, False]


def test_a_pose_file_serves_a_bag_without_poses(small, tmp_path):
    bag = write_small(tmp_path, [containers.cloud(one) for one in small])
    _, poses = containers.write_folder(tmp_path / "folder", small)
    lines = [line.partition(",")[2] for line in poses.read_text().splitlines()]
    poses.write_text("\n".join(lines) + "\n")
    recording = open_recording(bag, poses, "sensor")
    expected = np.stack([containers.pose_of(one) for one in small])
    np.testing.assert_array_equal(poses_of(recording), expected)


# --- what is refused, in one line ---


def refusal(bag: Path, topics: TopicChoice | None = None) -> str:
    with pytest.raises(InputError) as caught:
        open_recording(bag, topics=topics or TopicChoice())
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_several_sensors_are_to_be_chosen_from(small, tmp_path):
    second = [containers.cloud(one, topic="/rear/points") for one in small[:2]]
    bag = write_small(tmp_path, [*both(small), *second])
    said = refusal(bag)
    assert "point clouds on 2 topics" in said
    assert "/points (4), /rear/points (2)" in said
    assert "--topic" in said
    assert len(open_recording(bag, topics=TopicChoice(scans="/rear/points"))) == 2
    assert "no clouds or depth images on /front" in refusal(bag, TopicChoice(scans="/front"))


def test_several_topics_of_poses_are_to_be_chosen_from(small, tmp_path):
    moved = [one._replace(position=one.position + 1) for one in small]
    wheels = [containers.odometry(one, topic="/wheels") for one in moved]
    bag = write_small(tmp_path, [*both(small), *wheels])
    said = refusal(bag)
    assert "poses on 2 topics: /odom, /wheels" in said
    assert "--pose-topic" in said
    chosen = open_recording(bag, topics=TopicChoice(poses="/wheels"))
    np.testing.assert_array_equal(chosen[0].pose[:3, 3], moved[0].position)


def test_a_bag_without_a_way_to_the_sensor_is_refused_with_the_frames_there_are(small, tmp_path):
    odometry = [containers.odometry(one, child="base_link") for one in small]
    said = refusal(write_small(tmp_path, [*odometry, *(containers.cloud(one) for one in small)]))
    assert "no transform from a map to lidar" in said
    assert "frames found: base_link, odom" in said


def test_a_robot_that_stands_in_no_map_is_refused(small, tmp_path):
    spinning = [containers.transform(one.stamp_ns, "base_link", "lidar", one) for one in small]
    said = refusal(write_small(tmp_path, [*spinning, *(containers.cloud(one) for one in small)]))
    assert "which ends at base_link" in said


def test_a_frame_with_two_parents_is_refused(small, tmp_path):
    first, second = (
        containers.transform(one.stamp_ns, parent, "lidar", one)
        for one, parent in zip(small, ("map", "odom"), strict=False)
    )
    said = refusal(write_small(tmp_path, [first, second, containers.cloud(small[0])]))
    assert "frame lidar has two parents: map, odom" in said


def test_messages_of_other_encodings_are_refused_with_what_they_are(tmp_path):
    with (tmp_path / "foxglove.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("foxglove.PointCloud", "protobuf", b"")
        channel = writer.register_channel("/lidar", "protobuf", schema)
        writer.add_message(channel, 0, b"x", 0)
        writer.finish()
    said = refusal(tmp_path / "foxglove.mcap")
    assert "/lidar (foxglove.PointCloud, encoded protobuf)" in said


def test_a_camera_whose_messages_are_encoded_in_another_way_is_refused(tmp_path):
    sweep = containers.sweeps_of(containers.WALK / "scans", containers.WALK / "poses.csv", 1)[0]
    topic = "/camera/depth/camera_info"
    depth = np.full((4, 5), 900, "<u2")
    bag = containers.write_mcap(
        tmp_path / "depth.mcap",
        [
            containers.odometry(sweep, child="camera"),
            containers.camera_info(MATRIX, sweep.stamp_ns, topic),
            containers.image(depth, "16UC1", sweep.stamp_ns, "/camera/depth/image_raw"),
        ],
        chunked=False,
    )
    cdr, other = (topic.encode() + b"\x03\0\0\0" + name for name in (b"cdr", b"xyz"))
    assert cdr in bag.read_bytes()
    bag.write_bytes(bag.read_bytes().replace(cdr, other))
    assert f"messages on {topic} encoded as 'xyz'; expected ros1 or cdr" in refusal(bag)


@pytest.mark.parametrize("field", ["std_msgs/Header header", "string encoding", "uint32 width"])
def test_images_of_a_type_that_lacks_a_field_are_refused(field, tmp_path):
    sweep = containers.sweeps_of(containers.WALK / "scans", containers.WALK / "poses.csv", 1)[0]
    depth, colour = np.full((4, 5), 900, "<u2"), np.zeros((4, 5, 3), np.uint8)
    bag = containers.write_mcap(
        tmp_path / "depth.mcap",
        [
            containers.odometry(sweep, child="camera"),
            containers.camera_info(MATRIX, sweep.stamp_ns, "/camera/depth/camera_info"),
            containers.image(depth, "16UC1", sweep.stamp_ns, "/camera/depth/image_raw"),
            containers.image(colour, "rgb8", sweep.stamp_ns, "/camera/color/image_raw"),
        ],
        chunked=False,
    )
    data = bag.read_bytes()
    start = data.index(b"sensor_msgs/msg/Image")  # and again in the summary at its end
    named = field.encode()
    bag.write_bytes(data[:start] + data[start:].replace(named, named[:-1] + b"X"))
    assert "is no sensor_msgs/msg/Image" in refusal(bag)


def test_a_message_that_is_not_of_its_type_is_refused(tmp_path):
    bag = tmp_path / "walk.mcap"
    with bag.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema("sensor_msgs/msg/PointCloud2", "ros2msg", b"")
        channel = writer.register_channel("/points", "cdr", schema)
        writer.add_message(channel, 0, b"\0\1\0\0\7", 0)
        writer.finish()
    assert "a message on /points that is no sensor_msgs/msg/PointCloud2" in refusal(bag)


HOSTILE = "a/msg/B:\n    pass\nimport builtins\nbuiltins.ran = True\nclass C"


@pytest.mark.parametrize(
    ("name", "definition"),
    [
        (HOSTILE, b"int32 x\n"),
        ("class", b"int32 x\n"),
        ("3d/msg/B", b"int32 x\n"),
        ("a/msg/B", b"int32 1x\n"),
        ("a/msg/B", b"int32 x\n" + b"=" * 80 + b"\nMSG: " + HOSTILE.encode() + b"\nint32 y\n"),
    ],
)
def test_no_name_of_a_message_type_is_run(name, definition, tmp_path):
    with (tmp_path / "walk.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        for number, (what, text) in enumerate(
            [("sensor_msgs/msg/PointCloud2", b""), (name, definition)]
        ):
            schema = writer.register_schema(what, "ros2msg", text)
            channel = writer.register_channel(f"/topic{number}", "cdr", schema)
            writer.add_message(channel, 0, b"\0\1\0\0\7", 0)
        writer.finish()
    assert "\n" not in refusal(tmp_path / "walk.mcap").strip()
    assert not hasattr(builtins, "ran")


def test_no_name_of_a_message_type_of_a_bag_is_run(small, tmp_path):
    bag = write("ROS 1 bag", tmp_path, both(small))
    data = bag.read_bytes()
    fields = b"uint32 height"
    assert fields in data
    bag.write_bytes(data.replace(fields, b"uint32 hei:ht"))
    assert "rosbags" in refusal(bag)
    guard()
    with pytest.raises(TypesysError, match="name"):
        get_typestore(Stores.EMPTY).register({HOSTILE: ([], [])})
    assert not hasattr(builtins, "ran")


def test_a_bag_without_clouds_is_refused_with_its_topics(small, tmp_path):
    said = refusal(write_small(tmp_path, [containers.odometry(one) for one in small]))
    assert "no PointCloud2 or depth images, but /odom (nav_msgs/msg/Odometry)" in said


def test_an_mcap_that_is_cut_short_gives_what_is_whole_and_says_so(small, tmp_path):
    bag = containers.write_mcap(tmp_path / "walk.mcap", both(small), chunked=False)
    whole = bag.read_bytes()
    bag.write_bytes(whole[: len(whole) // 2])
    recording = open_recording(bag)
    assert 0 < len(recording) < 4
    assert "cut short or still being written" in recording.notes[0]


@pytest.mark.parametrize("value", [5, 10**12, 1.5, "text"])
def test_a_message_that_is_no_blob_is_refused(value, small, tmp_path):
    bag = write("ROS 2 bag (SQLite)", tmp_path, both(small))
    with closing(sqlite3.connect(next(bag.glob("*.db3")))) as database, database:
        database.execute("UPDATE messages SET data = ?", (value,))
    assert "a message that is a " in refusal(bag)


@pytest.mark.parametrize("kind", ["ROS 1 bag", "ROS 2 bag (SQLite)"])
def test_damaged_bags_are_refused(kind, small, tmp_path):
    bag = write(kind, tmp_path, both(small))
    file = bag if bag.is_file() else next(bag.glob("*.db3"))
    file.write_bytes(file.read_bytes()[:200])
    assert "a whole ROS bag" in refusal(bag)
