"""Pose files as tools write them: all of one walk, each gives its poses, and says what it read."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mcpseg_cli.errors import InputError
from mcpseg_cli.formats.poses import Poses, read_poses

START = 1305031102.175304
NUM_POSES = 3


def walk() -> NDArray[np.float64]:
    """Poses of a robot that also tilts; the first is not turned."""
    poses = np.tile(np.eye(4), (NUM_POSES, 1, 1))
    for number in range(NUM_POSES):
        turn = Rotation.from_euler("xyz", [0.1 * number, -0.2 * number, 0.7 * number])
        poses[number, :3, :3] = turn.as_matrix()
        poses[number, :3, 3] = [-31.6 + 0.4 * number, 24.0, 0.977]
    return poses


def quaternion(pose: NDArray[np.float64], first: str = "x") -> list[float]:
    """Return x y z w or w x y z."""
    xyzw = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
    return xyzw if first == "x" else [xyzw[3], *xyzw[:3]]


def words(*values: float) -> list[str]:
    return [f"{value:.9f}" for value in values]


def rows(line: Callable[[int, NDArray[np.float64]], str]) -> list[str]:
    return [line(number, pose) for number, pose in enumerate(walk())]


def tum(number: int, pose: NDArray[np.float64], separator: str = " ", first: str = "x") -> str:
    numbers = words(*pose[:3, 3], *quaternion(pose, first))
    return separator.join([f"{START + number:.6f}", *numbers])


def named(number: int, pose: NDArray[np.float64], separator: str = ",", comma: str = ".") -> str:
    numbers = [word.replace(".", comma) for word in words(*pose[:3, 3], *quaternion(pose))]
    return separator.join([f"{number:06d}", *numbers])


def euroc(number: int, pose: NDArray[np.float64]) -> str:
    numbers = words(*pose[:3, 3], *quaternion(pose, "w"))
    return ",".join([str(1403715524907143168 + number * 10**9), *numbers])


def inverse(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.inv(pose)


def colmap() -> list[str]:
    """Two lines an image, the second may be empty; the world in the camera's frame."""
    lines = ["#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME"]
    for number, pose in enumerate(walk()):
        turned = inverse(pose)
        numbers = words(*quaternion(turned, "w"), *turned[:3, 3])
        lines += [" ".join([str(number + 1), *numbers, "1", f"{number:06d}.jpg"])]
        lines += ["" if number == 0 else "1.0 2.0 -1"]
    return lines


EUROC_HEADER = (
    "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], "
    "q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []"
)
NAVVIS_HEADER = (
    "# pano poses v1.0: ID; filename; timestamp; pano_pos_x; pano_pos_y; pano_pos_z; "
    "pano_ori_w; pano_ori_x; pano_ori_y; pano_ori_z"
)
ROS_HEADER = (
    "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.pose.pose.position.x,"
    "field.pose.pose.position.y,field.pose.pose.position.z,field.pose.pose.orientation.x,"
    "field.pose.pose.orientation.y,field.pose.pose.orientation.z,field.pose.pose.orientation.w,"
    "field.pose.covariance0,field.twist.twist.linear.x,field.twist.twist.linear.y"
)


def ros(number: int, pose: NDArray[np.float64]) -> str:
    stamp = str(1700000000000000000 + number * 10**9)
    numbers = words(*pose[:3, 3], *quaternion(pose))
    return ",".join([stamp, str(number), stamp, "odom", *numbers, "0.1", "0.2", "0.3"])


FILES = {
    "TUM": rows(tum),
    "TUM with a comment": ["# timestamp tx ty tz qx qy qz qw", *rows(tum)],
    "TUM whose header is no comment": ["timestamp tx ty tz qx qy qz qw", *rows(tum)],
    "TUM with semicolons": rows(lambda n, p: tum(n, p, ";")),
    "TUM with tabs": rows(lambda n, p: tum(n, p, "\t")),
    "TUM by dates": rows(lambda n, p: f"2024-05-01T10:00:0{n}Z " + tum(n, p).split(" ", 1)[1]),
    "TUM of which a comment says w first": [
        "# quaternions are qw qx qy qz",
        *rows(lambda n, p: tum(n, p, first="w")),
    ],
    "TUM that starts unturned with w first": rows(lambda n, p: tum(n, p, first="w")),
    "CSV with spaces behind commas": [
        "scan, x, y, z, qx, qy, qz, qw",
        *rows(lambda n, p: named(n, p, ", ")),
    ],
    "CSV of a German spreadsheet": [
        "scan;x;y;z;qx;qy;qz;qw",
        *rows(lambda n, p: named(n, p, ";", ",")),
    ],
    "quoted CSV": [
        '"scan","x","y","z","qx","qy","qz","qw"',
        *rows(lambda n, p: ",".join(f'"{word}"' for word in named(n, p).split(","))),
    ],
    "CSV with units and capitals": [
        "Scan,X [m],Y [m],Z [m],Rot_X,Rot_Y,Rot_Z,Rot_W",
        *rows(named),
    ],
    "CSV with dotted names": [
        "name,position.x,position.y,position.z,"
        "orientation.x,orientation.y,orientation.z,orientation.w",
        *rows(named),
    ],
    "CSV with camel case": ["fileName,posX,posY,posZ,quatX,quatY,quatZ,quatW", *rows(named)],
    "CSV in degrees": [
        "scan,x,y,z,roll_deg,pitch_deg,yaw_deg",
        *rows(
            lambda n, p: ",".join(
                [f"{n:06d}", *words(*p[:3, 3]), *words(*np.degrees([0.1 * n, -0.2 * n, 0.7 * n]))]
            )
        ),
    ],
    "CSV of matrices": [
        "scan,r11,r12,r13,r21,r22,r23,r31,r32,r33,tx,ty,tz",
        *rows(lambda n, p: ",".join([f"{n:06d}", *words(*p[:3, :3].ravel()), *words(*p[:3, 3])])),
    ],
    "CSV with a position of its own name and a bare quaternion": [
        "time,tx,ty,tz,w,x,y,z",
        *rows(lambda n, p: tum(n, p, ",", "w")),
    ],
    "CSV below a title": [
        "Trajectory of Device 7",
        "Exported 2024",
        "name,x,y,z,qx,qy,qz,qw",
        *rows(named),
    ],
    "EuRoC": [EUROC_HEADER, *rows(euroc)],
    "EuRoC's ground truth": [
        "#timestamp, p_x [m], p_y, p_z, q_w, q_x, q_y, q_z, vx, vy, vz, bx, by, bz, ax, ay, az",
        *rows(lambda n, p: euroc(n, p) + ",0" * 9),
    ],
    "EuRoC's ground truth without a header": rows(lambda n, p: euroc(n, p) + ",0" * 9),
    "ROS": [ROS_HEADER, *rows(ros)],
    "Stray Scanner": [
        "timestamp, frame, x, y, z, qx, qy, qz, qw",
        *rows(lambda n, p: f"{START + n:.6f}, " + named(n, p, ", ")),
    ],
    "RTAB-Map": ["#timestamp x y z qx qy qz qw id", *rows(lambda n, p: f"{tum(n, p)} {n + 1}")],
    "RTAB-Map without a header": rows(lambda n, p: f"{tum(n, p)} {7 * n + 1}"),
    "NavVis": [
        NAVVIS_HEADER,
        *rows(lambda n, p: f"{n}; {n:06d}.jpg; " + tum(n, p, "; ", "w")),
    ],
    "ORB-SLAM": rows(
        lambda n, p: f"{1403636579763555584 + n * 10**9}.000000 " + tum(n, p).split(" ", 1)[1]
    ),
    "names and seven numbers": rows(lambda n, p: named(n, p, " ")),
    "KITTI": rows(lambda n, p: " ".join(words(*p[:3].ravel()))),
    "KITTI with numbers": rows(lambda n, p: " ".join([str(n), *words(*p[:3].ravel())])),
    "4 x 4 a row": rows(lambda n, p: " ".join(words(*p.ravel()))),
    "4 x 4 a row, column by column": rows(lambda n, p: " ".join(words(*p.T.ravel()))),
    "4 x 4 in four lines": [" ".join(words(*row)) for pose in walk() for row in pose],
    "Open3D": [
        line
        for number, pose in enumerate(walk())
        for line in (f"{number} {number} {number + 1}", *(" ".join(words(*row)) for row in pose))
    ],
    "g2o": [
        *rows(
            lambda n, p: " ".join(["VERTEX_SE3:QUAT", str(n), *words(*p[:3, 3], *quaternion(p))])
        ),
        "EDGE_SE3:QUAT 0 1 0 0 0 0 0 0 1",
    ],
    "COLMAP": colmap(),
    "Record3D": [json.dumps({"poses": [[*quaternion(p), *p[:3, 3].tolist()] for p in walk()]})],
    "transforms.json": [
        json.dumps(
            {
                "frames": [
                    {"file_path": f"images/{n:06d}.png", "transform_matrix": p.tolist()}
                    for n, p in enumerate(walk())
                ]
            }
        )
    ],
}


def read(folder: Path, lines: list[str], name: str = "poses.txt", encoding: str = "utf-8") -> Poses:
    path = folder / name
    path.write_bytes(("\n".join(lines) + "\n").encode(encoding))
    return read_poses(path)


@pytest.mark.parametrize("lines", FILES.values(), ids=FILES)
def test_a_file_of_any_tool_gives_its_poses(tmp_path: Path, lines: list[str]) -> None:
    poses = read(tmp_path, lines)
    np.testing.assert_allclose(poses.poses, walk(), atol=1e-7)
    assert poses.has_rotation
    assert poses.columns


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-32", "latin-1"])
def test_any_encoding_is_read(tmp_path: Path, encoding: str) -> None:
    table = read(tmp_path, ["scan,x,y,z", "Büro_0,1,2,3", "Büro_1,4,5,6"], encoding=encoding)
    assert table.scans == ("Büro_0", "Büro_1")
    np.testing.assert_array_equal(table.poses[:, :3, 3], [[1, 2, 3], [4, 5, 6]])


STAMPS = {
    "seconds": ("timestamp", ["1305031102.175304", "1305031103.5"], 1305031102.175304),
    "ms by size": ("timestamp", ["1305031102175", "1305031103500"], 1305031102.175),
    "ns by size": ("timestamp", ["1305031102175304000", "1305031103500000000"], 1305031102.175304),
    "ns by unit": ("timestamp [ns]", ["1500000000", "2500000000"], 1.5),
    "us by name": ("time_us", ["1500000", "2500000"], 1.5),
    "dates": ("time", ["2011-05-10T12:38:22.5Z", "2011-05-10 12:38:23"], 1305031102.5),
    "time of day": ("time", ["00:00:01.5", "00:00:02"], 1.5),
}


@pytest.mark.parametrize(("name", "stamps", "first"), STAMPS.values(), ids=STAMPS)
def test_time_stamps_come_in_seconds(
    tmp_path: Path, name: str, stamps: list[str], first: float
) -> None:
    table = read(tmp_path, [f"{name},x,y,z", *(f"{stamp},1,2,3" for stamp in stamps)])
    assert table.stamps is not None
    np.testing.assert_allclose(table.stamps[0], first, atol=1e-6)


def test_seconds_and_nanoseconds_of_two_columns_are_one_time(tmp_path: Path) -> None:
    header = "header.stamp.sec,header.stamp.nanosec,x,y,z"
    table = read(tmp_path, [header, "1700000000,48000000,1,2,3"])
    np.testing.assert_allclose(table.stamps, [1700000000.048], atol=1e-6)


def test_columns_of_velocity_and_covariance_are_no_position(tmp_path: Path) -> None:
    table = read(tmp_path, ["vx,vy,vz,x,y,z,cov_x,std_y", "9,9,9,1,2,3,9,9"])
    np.testing.assert_array_equal(table.poses[0, :3, 3], [1, 2, 3])
    assert "passed over" in table.columns


@pytest.mark.parametrize("word", ["nan", "-inf", "NaN", "-nan", "inf", "-nan(ind)", ""])
def test_rows_of_lost_tracking_have_no_pose(tmp_path: Path, word: str) -> None:
    header = "scan,x,y,z,qx,qy,qz,qw"
    table = read(tmp_path, [header, "a,1,2,3,0,0,0,1", ",".join(["b", *[word] * 7])])
    assert list(table.lost) == [1]
    assert "line 3" in table.lost[1]
    assert np.isnan(table.poses[1]).all()
    assert np.isfinite(table.poses[0]).all()


def test_the_same_row_again_says_nothing_new(tmp_path: Path) -> None:
    assert len(read(tmp_path, [line for line in rows(tum) for _ in range(2)])) == NUM_POSES


REFUSED = {
    "quaternion whose order nothing tells": (
        [euroc(1, walk()[1]), euroc(2, walk()[2])],
        "qx qy qz qw (TUM) or qw qx qy qz (EuRoC)",
    ),
    "angles of unknown unit": (["x,y,z,roll,pitch,yaw", "1,2,3,0.1,0,0"], "without a unit"),
    "three numbers of a rotation": (["x,y,z,rx,ry,rz", "1,2,3,0,0,1"], "roll, pitch, yaw"),
    "two positions": (["x,y,z,pos_x,pos_y,pos_z", "1,2,3,4,5,6"], "columns x, y, z, pos_x"),
    "overflow": (["x,y,z", "1,2,1e999"], "'1e999' in line 2, column 3"),
    "excel": (["PK\x03\x04\0\0"], "a ZIP or Excel file"),
    "other JSON": (['{"points": []}'], "no 4 x 4 matrix"),
    "cut JSON": (['{"frames": ['], "no complete JSON"),
    "cut log": (["0 0 1", "1 0 0 0", "0 1 0 0", "0 0 1 0", "0 0 0 1", "1 1 2"], "6 lines"),
    "vertex of half a number": (
        ["VERTEX_SE3:QUAT 0.5 0 0 0 0 0 0 1"],
        "a vertex numbered 0.5 in line 1",
    ),
    "vertex of a number too large": (
        ["VERTEX_SE3:QUAT 1e30 0 0 0 0 0 0 1"],
        "a vertex numbered 1e30 in line 1",
    ),
    "flat graph": (["VERTEX_SE2 0 1 2 3"], "a pose graph without poses"),
}


@pytest.mark.parametrize(("lines", "found"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_told_is_refused(tmp_path: Path, lines: list[str], found: str) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, lines)
    assert found in str(caught.value)


def test_the_binary_images_of_colmap_are_refused_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="model_converter"):
        read(tmp_path, ["\x02\0"], "images.bin")


# --- folders and arrays ---


@pytest.mark.parametrize("ending", [".txt", ".pose.txt", ".pose"])
def test_a_folder_of_matrices_names_its_poses(tmp_path: Path, ending: str) -> None:
    for number, pose in enumerate(walk()):
        np.savetxt(tmp_path / f"frame-{number:06d}{ending}", pose)
    for name in (".DS_Store", "intrinsics.txt", "frame-000000.color.png"):
        (tmp_path / name).write_text("1 2 3")
    poses = read_poses(tmp_path)
    np.testing.assert_allclose(poses.poses, walk(), atol=1e-12)
    assert poses.scans == tuple(f"frame-{number:06d}{ending}" for number in range(NUM_POSES))


def test_a_matrix_of_infinities_in_a_folder_is_lost(tmp_path: Path) -> None:
    for number, pose in enumerate(walk()):
        np.savetxt(tmp_path / f"{number}.txt", np.full((4, 4), -np.inf) if number == 1 else pose)
    poses = read_poses(tmp_path)
    assert list(poses.lost) == [1]
    assert "1.txt" in poses.lost[1]


def test_frames_of_an_arkit_app_are_matrices_row_by_row(tmp_path: Path) -> None:
    for number, pose in enumerate(walk()):
        frame = {"cameraPoseARFrame": pose.ravel().tolist(), "time": START + number}
        (tmp_path / f"frame_{number:05d}.json").write_text(json.dumps(frame))
    (tmp_path / "info.json").write_text("{}")
    poses = read_poses(tmp_path)
    np.testing.assert_allclose(poses.poses, walk(), atol=1e-12)
    np.testing.assert_allclose(poses.stamps, START + np.arange(NUM_POSES))


def test_frames_of_polycam_are_twelve_entries(tmp_path: Path) -> None:
    for number, pose in enumerate(walk()):
        frame = {f"t_{r}{c}": float(pose[r, c]) for r in range(3) for c in range(4)}
        (tmp_path / f"{number}.json").write_text(json.dumps(frame))
    np.testing.assert_allclose(read_poses(tmp_path).poses, walk(), atol=1e-12)


def test_a_folder_without_poses_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a folder without pose files"):
        read_poses(tmp_path)


@pytest.mark.parametrize("shape", [(NUM_POSES, 4, 4), (NUM_POSES, 16)])
def test_an_array_of_matrices_is_read(tmp_path: Path, shape: tuple[int, ...]) -> None:
    np.save(tmp_path / "poses.npy", walk().reshape(shape))
    np.testing.assert_array_equal(read_poses(tmp_path / "poses.npy").poses, walk())


def test_an_array_of_another_shape_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "poses.npy", np.zeros((3, 5)))
    with pytest.raises(InputError, match=r"shape \(3, 5\)"):
        read_poses(tmp_path / "poses.npy")


# --- KITTI ---


def kitti(folder: Path, calibration: str) -> Poses:
    """Write the walk as the camera saw it, relative to its first pose."""
    to_camera = np.eye(4)
    to_camera[:3] = [[0, -1, 0, 0], [0, 0, -1, -0.08], [1, 0, 0, -0.27]]
    first = inverse(walk()[0])
    camera = [to_camera @ first @ pose @ inverse(to_camera) for pose in walk()]
    line = " ".join(words(*to_camera[:3].ravel()))
    (folder / calibration).parent.mkdir(parents=True, exist_ok=True)
    (folder / calibration).write_text(f"P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: {line}\n")
    (folder / "poses").mkdir(exist_ok=True)
    lines = [" ".join(words(*pose[:3].ravel())) for pose in camera]
    (folder / "poses/00.txt").write_text("\n".join(lines))
    return read_poses(folder / "poses/00.txt", folder / "data/velodyne")


@pytest.mark.parametrize("place", ["poses/calib.txt", "data/calib.txt", "sequences/00/calib.txt"])
def test_a_calibration_makes_the_cameras_poses_the_lidars(tmp_path: Path, place: str) -> None:
    poses = kitti(tmp_path, place)
    expected = [inverse(walk()[0]) @ pose for pose in walk()]
    np.testing.assert_allclose(poses.poses, expected, atol=1e-7)
    assert "calib.txt" in poses.columns


def test_a_calibration_without_the_lidar_is_refused(tmp_path: Path) -> None:
    (tmp_path / "calib.txt").write_text("P0: 1 0 0 0 0 1 0 0 0 0 1 0\n")
    with pytest.raises(InputError, match="lines P0; expected Tr:"):
        read(tmp_path, FILES["KITTI"])


def test_a_line_that_has_no_end_yet_is_left_out(tmp_path: Path) -> None:
    path = tmp_path / "poses.txt"
    path.write_text("\n".join(rows(tum))[:-5])
    assert len(read_poses(path, is_growing=True)) == NUM_POSES - 1
