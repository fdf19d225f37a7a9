"""The example walk as other people would have it: another unit, axis, place or frame."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from mcpseg_cli.formats import Cloud, read_cloud, write_cloud
from mcpseg_cli.formats.recording import open_recording

WALK = Path(__file__).parents[1] / "examples" / "office_walk"
CENTRE = np.array([-32.0, -22.0, 0.0])  # of the first scans, so that units change no extents

Points = Callable[[np.ndarray], np.ndarray]
WAYS: dict[str, Points] = {
    "metres": lambda xyz: xyz,
    "millimetres": lambda xyz: xyz * 1000,
    "centimetres": lambda xyz: xyz * 100,
    "feet": lambda xyz: xyz / 0.3048,
    "y up": lambda xyz: xyz[:, [0, 2, 1]] * [1, 1, -1],
    "y down": lambda xyz: xyz[:, [1, 2, 0]] * [-1, -1, 1],
    "georeferenced": lambda xyz: xyz + np.array([500_000.0, 5_400_000.0, 300.0]),
}


def write_walk(
    folder: Path,
    way: Points,
    num_scans: int = 6,
    *,
    pose_way: Points | None = None,
    in_sensor_frame: bool = False,
    change: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]] = lambda columns: columns,
    suffix: str = ".ply",
) -> tuple[Path, Path]:
    """Write the first scans of the walk another way; return its scans/ and poses.csv.

    Args:
        folder: Where.
        way: What becomes of coordinates (N, 3).
        num_scans: How many scans.
        pose_way: What becomes of positions, if it is something else.
        in_sensor_frame: Scans as the sensor saw them, before ``way``.
        change: What becomes of all attributes, at the end.
        suffix: Ending of the scans.
    """
    (folder / "scans").mkdir(parents=True)
    lines = ["scan,x,y,z" + (",qx,qy,qz,qw" if in_sensor_frame else "")]
    words = (WALK / "poses.csv").read_text().splitlines()
    recording = open_recording(WALK / "scans", WALK / "poses.csv")[:num_scans]
    for source, line in zip(recording, words[1:], strict=False):
        cloud = read_cloud(source.path)
        xyz, position = cloud.xyz.astype(np.float64) - CENTRE, source.pose[:3, 3] - CENTRE
        if in_sensor_frame:
            xyz = (xyz - position) @ source.pose[:3, :3]
        columns = cloud.columns | dict(zip("xyz", way(xyz).T, strict=True))
        write_cloud(
            (folder / "scans" / source.path.name).with_suffix(suffix), Cloud(change(columns))
        )
        place = ",".join(f"{value:.9f}" for value in (pose_way or way)(position[None])[0])
        turn = ",".join(line.split(",")[4:]) if in_sensor_frame else ""
        lines.append(f"{source.path.stem},{place}" + (f",{turn}" if turn else ""))
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    return folder / "scans", folder / "poses.csv"
