"""Small ray-traced areas for the tests of training: a corridor with a table, scans and truth."""

from pathlib import Path

import numpy as np

from mcpseg_cli.formats import Cloud, write_cloud

CLASSES = ("floor", "wall", "table", "lamp")
STEP = 0.4  # metres the robot moves along x between two scans


def write_area(
    folder: Path, num_scans=5, seed=0, classes=CLASSES, colour=True, unlabelled=False, density=1.0
) -> Path:
    """Write scans/, gt/, poses.csv and raytrace.json as ``mcpseg raytrace`` does.

    Args:
        folder: Where; made.
        num_scans: Scans along x.
        seed: Seed of the points.
        classes: Class table; labels are indices of the classes by name.
        colour: Whether the scans have colour.
        unlabelled: Whether a fifth of the points has no object and another fifth no class.
        density: Points, as a share of 1,000 a scan.
    """
    rng = np.random.default_rng(seed)
    for name in ("scans", "gt"):
        (folder / name).mkdir(parents=True)
    lines = ["scan,x,y,z,qx,qy,qz,qw"]
    for number in range(num_scans):
        x = STEP * number
        xyz, names, instance = _corridor(x, rng, density)
        columns = {axis: xyz[:, column] for column, axis in enumerate("xyz")}
        if colour:
            rgb = np.clip(100 + 60 * xyz + rng.normal(0, 10, xyz.shape), 0, 255).astype(np.uint8)
            columns |= {
                name: rgb[:, column] for column, name in enumerate(("red", "green", "blue"))
            }
        semantic = np.array([classes.index(name) for name in names], np.uint8)
        if unlabelled:
            instance = np.where(rng.random(len(xyz)) < 0.2, 0, instance)
            semantic = np.where(rng.random(len(xyz)) < 0.2, 255, semantic)
        truth = {"semantic": semantic.astype(np.uint8), "instance": instance.astype(np.int32)}
        write_cloud(folder / "scans" / f"{number:06d}.ply", Cloud(columns))
        write_cloud(folder / "gt" / f"{number:06d}.ply", Cloud(columns | truth, tuple(classes)))
        lines.append(f"{number:06d},{x:.6f},0.000000,0.800000,0,0,0,1")
    (folder / "poses.csv").write_text("\n".join(lines) + "\n")
    (folder / "raytrace.json").write_text(f'{{"complete": true, "seed": {seed}}}\n')
    return folder


def _corridor(x, rng, density):
    """Sample a floor (object 1), walls (2, 3) and a table (4): places, class names, objects."""
    sizes = [int(share * density) for share in (500, 200, 200, 100)]
    along = [rng.uniform(x - 1.8, x + 1.8, size) for size in sizes[:3]]
    floor = np.stack(
        [along[0], rng.uniform(-1.2, 1.2, sizes[0]), rng.normal(0, 0.005, sizes[0])], axis=1
    )
    walls = [
        np.stack(
            [along[k], np.full(sizes[k], 1.2 * (2 * k - 3)), rng.uniform(0, 2.0, sizes[k])], axis=1
        )
        for k in (1, 2)
    ]
    table = np.stack(
        [rng.uniform(0.3, 1.0, sizes[3]), rng.uniform(0.4, 0.9, sizes[3]), np.full(sizes[3], 0.7)],
        axis=1,
    )
    objects = np.repeat([1, 2, 3, 4], sizes)
    names = np.array(["", "floor", "wall", "wall", "table"])[objects]
    return np.concatenate([floor, *walls, table]).astype(np.float32), names.tolist(), objects
