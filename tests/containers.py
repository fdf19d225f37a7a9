"""Recordings as other programs write them: bags, MCAP, E57, RGB-D folders, of a few sweeps."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mcap.writer import Writer as McapWriter
from pye57 import E57
from rosbags.interfaces import Connection
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore
from scipy.spatial.transform import Rotation

from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from mcpseg_cli.formats.poses import read_poses

CLOUD, ODOMETRY = "sensor_msgs/msg/PointCloud2", "nav_msgs/msg/Odometry"
TF, STAMPED, PATH = "tf2_msgs/msg/TFMessage", "geometry_msgs/msg/PoseStamped", "nav_msgs/msg/Path"
IMAGE, CAMERA_INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"
START_NS = 1_700_000_000_000_000_000
STEP_NS = 200_000_000
WALK = Path(__file__).parents[1] / "examples/office_walk"
_TF_DEFINITION = "geometry_msgs/TransformStamped[] transforms\n"


class Sweep(NamedTuple):
    """One scan: points in the sensor's frame and where the sensor was."""

    stamp_ns: int
    xyz: np.ndarray  # (N, 3) float32
    rgb: np.ndarray  # (N, 3) uint8
    position: np.ndarray  # (3,) float64
    quaternion: np.ndarray  # (4,) x y z w


class Message(NamedTuple):
    """What is published: topic, type, time, and what makes it in a store of types."""

    topic: str
    type: str
    time_ns: int
    make: Callable[[Typestore], object]


def sweeps_of(scans: Path, poses: Path, count: int = 4) -> list[Sweep]:
    """Take scans of a folder, which are in the map's frame, into the sensor's."""
    files = sorted(scans.iterdir())[:count]
    table = read_poses(poses).poses
    sweeps = []
    for number, (file, pose) in enumerate(zip(files, table[:count], strict=True)):
        cloud = read_cloud(file)
        xyz = ((cloud.xyz.astype(float) - pose[:3, 3]) @ pose[:3, :3]).astype(np.float32)
        turn = Rotation.from_matrix(pose[:3, :3]).as_quat()
        sweeps.append(Sweep(START_NS + number * STEP_NS, xyz, cloud.rgb, pose[:3, 3].copy(), turn))
    return sweeps


def write_folder(folder: Path, sweeps: Sequence[Sweep]) -> tuple[Path, Path]:
    """Write PLY files in the sensor's frame and their poses, to the last digit."""
    (folder / "scans").mkdir(parents=True)
    lines = ["scan,x,y,z,qx,qy,qz,qw"]
    for number, sweep in enumerate(sweeps):
        columns = {axis: sweep.xyz[:, place] for place, axis in enumerate("xyz")}
        names = ("red", "green", "blue")
        columns |= {name: sweep.rgb[:, place] for place, name in enumerate(names)}
        write_cloud(folder / "scans" / f"{number:06d}.ply", Cloud(columns))
        values = [*sweep.position, *sweep.quaternion]
        lines.append(",".join([f"{number:06d}", *(repr(float(value)) for value in values)]))
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    return folder / "scans", folder / "poses.csv"


def write_e57(path: Path, sweeps: Sequence[Sweep]) -> Path:
    """Write stations through pye57."""
    with E57(str(path), mode="w") as file:
        for sweep in sweeps:
            data = {
                f"cartesian{axis}": sweep.xyz[:, place].astype(float)
                for place, axis in enumerate("XYZ")
            }
            names = ("colorRed", "colorGreen", "colorBlue")
            data |= {name: sweep.rgb[:, place].copy() for place, name in enumerate(names)}
            turn = np.roll(sweep.quaternion, 1)  # w first
            file.write_scan_raw(data, rotation=turn, translation=sweep.position)
    return path


def write_ptx(path: Path, sweeps: Sequence[Sweep]) -> Path:
    """Write stations as text, each with a point without return."""
    lines = []
    for sweep in sweeps:
        pose = pose_of(sweep)
        lines += [f"{len(sweep.xyz) + 1}", "1"]
        lines += [" ".join(map(repr, row.tolist())) for row in (pose[:3, 3], *pose[:3, :3].T)]
        lines += [" ".join(map(repr, row.tolist())) for row in pose.T]
        lines += ["0 0 0 0.5 0 0 0"]
        for xyz, rgb in zip(sweep.xyz.astype(float).tolist(), sweep.rgb.tolist(), strict=True):
            lines.append(" ".join(map(repr, (*xyz, 0.5, *rgb))))
    path.write_text("\n".join(lines) + "\n")
    return path


def pose_of(sweep: Sweep) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_quat(sweep.quaternion).as_matrix()
    pose[:3, 3] = sweep.position
    return pose


# --- messages ---


def store_of(stores: Stores) -> Typestore:
    """Make a store that knows TF too, which ROS 1 has in a package of its own."""
    store = get_typestore(stores)
    if TF not in store.fielddefs:
        store.register(get_types_from_msg(_TF_DEFINITION, TF))
    return store


def header(store: Typestore, stamp_ns: int, frame: str) -> object:
    time = store.types["builtin_interfaces/msg/Time"](
        sec=stamp_ns // 1_000_000_000, nanosec=stamp_ns % 1_000_000_000
    )
    kind = store.types["std_msgs/msg/Header"]
    seq = (
        {"seq": 0}
        if "seq" in {name for name, _ in store.fielddefs["std_msgs/msg/Header"][1]}
        else {}
    )
    return kind(stamp=time, frame_id=frame, **seq)


def cloud(sweep: Sweep, topic: str = "/points", frame: str = "lidar") -> Message:
    """Make a PointCloud2 of x y z rgb, the colour packed as PCL packs it."""
    table = np.zeros(len(sweep.xyz), [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<f4")])
    for place, axis in enumerate("xyz"):
        table[axis] = sweep.xyz[:, place]
    red, green, blue = sweep.rgb.T.astype(np.uint32)
    table["rgb"] = (red << 16 | green << 8 | blue).view(np.float32)
    return table_cloud(table, sweep.stamp_ns, topic, frame)


def table_cloud(table: np.ndarray, stamp_ns: int, topic: str, frame: str) -> Message:
    """Make a PointCloud2 of (N,) or (H, W) records."""
    codes = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}

    def make(store: Typestore) -> object:
        field = store.types["sensor_msgs/msg/PointField"]
        fields = [
            field(name=name, offset=offset, datatype=codes[dtype.str[1:]], count=1)
            for name, (dtype, offset) in table.dtype.fields.items()
        ]
        height, width = (1, len(table)) if table.ndim == 1 else table.shape
        return store.types[CLOUD](
            header=header(store, stamp_ns, frame), height=height, width=width, fields=fields,
            is_bigendian=False, point_step=table.itemsize, row_step=width * table.itemsize,
            data=np.frombuffer(table.tobytes(), np.uint8), is_dense=False,
        )  # fmt: skip

    return Message(topic, CLOUD, stamp_ns, make)


def _pose(store: Typestore, sweep: Sweep) -> object:
    point, turn = (store.types[f"geometry_msgs/msg/{name}"] for name in ("Point", "Quaternion"))
    return store.types["geometry_msgs/msg/Pose"](
        position=point(*sweep.position.tolist()), orientation=turn(*sweep.quaternion.tolist())
    )


def odometry(
    sweep: Sweep, topic: str = "/odom", parent: str = "odom", child: str = "lidar"
) -> Message:
    def make(store: Typestore) -> object:
        types = store.types
        zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
        twist = types["geometry_msgs/msg/Twist"](linear=zero, angular=zero)
        covariance = np.zeros(36)
        pose = types["geometry_msgs/msg/PoseWithCovariance"](_pose(store, sweep), covariance)
        return types[ODOMETRY](
            header=header(store, sweep.stamp_ns, parent), child_frame_id=child, pose=pose,
            twist=types["geometry_msgs/msg/TwistWithCovariance"](twist, covariance),
        )  # fmt: skip

    return Message(topic, ODOMETRY, sweep.stamp_ns, make)


def stamped(sweep: Sweep, topic: str = "/pose", parent: str = "map") -> Message:
    def make(store: Typestore) -> object:
        return store.types[STAMPED](header(store, sweep.stamp_ns, parent), _pose(store, sweep))

    return Message(topic, STAMPED, sweep.stamp_ns, make)


def path_message(sweeps: Sequence[Sweep], topic: str = "/path", parent: str = "map") -> Message:
    def make(store: Typestore) -> object:
        poses = [stamped(sweep).make(store) for sweep in sweeps]
        return store.types[PATH](header(store, sweeps[-1].stamp_ns, parent), poses)

    return Message(topic, PATH, sweeps[-1].stamp_ns, make)


def transform(
    stamp_ns: int, parent: str, child: str, pose: np.ndarray | Sweep, topic: str = "/tf"
) -> Message:
    """Make a TF message of one transform; on /tf_static if so named."""

    def make(store: Typestore) -> object:
        types = store.types
        if isinstance(pose, Sweep):
            position, turn = pose.position, pose.quaternion
        else:
            position, turn = pose[:3, 3], Rotation.from_matrix(pose[:3, :3]).as_quat()
        moved = types["geometry_msgs/msg/Transform"](
            translation=types["geometry_msgs/msg/Vector3"](*position.tolist()),
            rotation=types["geometry_msgs/msg/Quaternion"](*turn.tolist()),
        )
        one = types["geometry_msgs/msg/TransformStamped"](
            header=header(store, stamp_ns, parent), child_frame_id=child, transform=moved
        )
        return types[TF](transforms=[one])

    return Message(topic, TF, stamp_ns, make)


def image(
    pixels: np.ndarray, encoding: str, stamp_ns: int, topic: str, frame: str = "camera"
) -> Message:
    def make(store: Typestore) -> object:
        return store.types[IMAGE](
            header=header(store, stamp_ns, frame), height=pixels.shape[0], width=pixels.shape[1],
            encoding=encoding, is_bigendian=0, step=pixels.strides[0],
            data=np.frombuffer(pixels.tobytes(), np.uint8),
        )  # fmt: skip

    return Message(topic, IMAGE, stamp_ns, make)


def camera_info(matrix: np.ndarray, stamp_ns: int, topic: str, frame: str = "camera") -> Message:
    def make(store: Typestore) -> object:
        names = {name for name, _ in store.fielddefs[CAMERA_INFO][1]}
        upper = str.lower if "k" in names else str.upper
        values = {"d": np.zeros(5), "k": matrix.ravel(), "r": np.eye(3).ravel(), "p": np.zeros(12)}
        roi = store.types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        return store.types[CAMERA_INFO](
            header=header(store, stamp_ns, frame), height=480, width=640,
            distortion_model="plumb_bob", binning_x=0, binning_y=0, roi=roi,
            **{upper(name): value for name, value in values.items()},
        )  # fmt: skip

    return Message(topic, CAMERA_INFO, stamp_ns, make)


# --- bags ---


def write_ros1_bag(path: Path, messages: Sequence[Message]) -> Path:
    store = store_of(Stores.ROS1_NOETIC)
    with Writer1(path) as writer:
        known: dict[str, Connection] = {}
        for one in messages:
            if one.topic not in known:
                known[one.topic] = writer.add_connection(one.topic, one.type, typestore=store)
            raw = store.serialize_ros1(one.make(store), one.type)
            writer.write(known[one.topic], one.time_ns, raw)
    return path


def write_ros2_bag(folder: Path, messages: Sequence[Message], storage: str = "sqlite3") -> Path:
    store = store_of(Stores.LATEST)
    plugin = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}[storage]
    with Writer2(folder, version=9, storage_plugin=plugin) as writer:
        known: dict[str, Connection] = {}
        for one in messages:
            if one.topic not in known:
                known[one.topic] = writer.add_connection(one.topic, one.type, typestore=store)
            raw = store.serialize_cdr(one.make(store), one.type)
            writer.write(known[one.topic], one.time_ns, raw)
    return folder


def write_mcap(
    path: Path,
    messages: Sequence[Message],
    encoding: str = "cdr",
    *,
    chunked: bool = True,
    describes_types: bool = True,
) -> Path:
    """Write an MCAP file through the mcap library, its messages in ROS 1's form or CDR."""
    is_ros1 = encoding == "ros1"
    store = store_of(Stores.ROS1_NOETIC if is_ros1 else Stores.LATEST)
    with path.open("wb") as file:
        writer = McapWriter(file, use_chunking=chunked)
        writer.start(profile="ros1" if is_ros1 else "ros2", library="test")
        known: dict[str, int] = {}
        for one in messages:
            if one.topic not in known:
                text, _ = store.generate_msgdef(one.type, ros_version=1 if is_ros1 else 2)
                name = one.type.replace("/msg/", "/") if is_ros1 else one.type
                schema = writer.register_schema(
                    name,
                    "ros1msg" if is_ros1 else "ros2msg",
                    text.encode() if describes_types else b"",
                )
                known[one.topic] = writer.register_channel(one.topic, encoding, schema)
            raw = (store.serialize_ros1 if is_ros1 else store.serialize_cdr)(
                one.make(store), one.type
            )
            writer.add_message(known[one.topic], one.time_ns, bytes(raw), one.time_ns)
        writer.finish()
    return path
