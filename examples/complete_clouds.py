"""Divide a ray-traced area's complete cloud into columns to train offline methods on.

    python examples/complete_clouds.py data/Area_1 -o offline/Area_1
    mcpseg train offline/ --net pointnet -o trained/

The cloud is as ``segment --offline`` sees it. Every column of 1 m becomes a scan whose pose is the
column's middle, at the height of the nearest true pose; the truth is beside it, as after ``mcpseg
raytrace``.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from mcpseg_cli.config import OFFLINE_BLOCK, SampleSettings
from mcpseg_cli.formats import Cloud, write_cloud
from mcpseg_cli.formats.scan_source import pose_of
from mcpseg_cli.incremental.offline import nearest_height, split_blocks
from mcpseg_cli.train.replay import Replay

_FEWEST = 50  # points of a column worth learning from


def write_columns(area: Path, output: Path) -> int:
    """Write a recording of columns.

    Args:
        area: Folder that ``mcpseg raytrace`` wrote.
        output: Folder for scans/, gt/, poses.csv and raytrace.json.

    Returns:
        How many columns there are.

    Raises:
        InputError: The area is not complete or damaged.
    """
    # the complete cloud with its truth, and where the robot was
    replay = Replay(area, SampleSettings(num_context=1, seen_again=0))
    for _ in replay.run():
        pass
    positions = np.array([pose_of(scan)[:3, 3] for scan in replay.scans])

    # every column as a scan
    for name in ("scans", "gt"):
        (output / name).mkdir(parents=True, exist_ok=True)
    lines = ["scan,x,y,z,qx,qy,qz,qw"]
    for middle, ids in split_blocks(replay.map.xyz, OFFLINE_BLOCK):
        if len(ids) < _FEWEST:
            continue
        name = f"{len(lines) - 1:06d}"
        columns = dict(zip("xyz", replay.map.xyz[ids].T, strict=True))
        columns |= dict(zip(("red", "green", "blue"), replay.map.rgb[ids].T, strict=True))
        truth = {"semantic": replay.semantic[ids], "instance": replay.instance[ids]}
        write_cloud(output / "scans" / f"{name}.ply", Cloud(columns))
        write_cloud(output / "gt" / f"{name}.ply", Cloud(columns | truth, replay.classes))
        height = nearest_height(positions, middle)
        lines.append(f"{name},{middle[0]:.6f},{middle[1]:.6f},{height:.6f},0,0,0,1")

    (output / "poses.csv").write_text("\n".join(lines) + "\n")
    record = json.dumps({"complete": True, "columns_of": str(area)})
    (output / "raytrace.json").write_text(record + "\n")
    return len(lines) - 1


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("area", type=Path, help="what mcpseg raytrace wrote")
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the columns")
    arguments = parser.parse_args()
    print(f"{write_columns(arguments.area, arguments.output):,} columns in {arguments.output}")


if __name__ == "__main__":
    main()
