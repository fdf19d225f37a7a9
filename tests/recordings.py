"""Small recordings of a corridor and weights with random parameters: all a run needs."""

from pathlib import Path

import numpy as np
import torch

from mcpseg_cli.choices import Architecture
from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.formats import Cloud, write_cloud
from mcpseg_cli.networks.description import WeightsInfo
from mcpseg_cli.networks.unet import UNet
from mcpseg_cli.networks.weights import build_network, save_weights

STEP = 0.4  # metres the robot moves along x between two scans


def write_weights(path: Path, architecture: Architecture, seed: int = 7) -> Path:
    """Write a network with seeded random parameters; the classes that a U-Net finds are mixed."""
    info = WeightsInfo(architecture=architecture, classes=S3DIS_CLASSES)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = build_network(info)
        if isinstance(network, UNet):
            with torch.no_grad():
                network.classify.weight *= 20.0
                network.classify.bias.zero_()
        save_weights(path, network, info)
    return path


def write_recording(
    folder: Path, num_scans: int = 4, seed: int = 0, suffix: str = ".ply", colour: bool = True
) -> tuple[Path, Path]:
    """Write a robot's walk along a corridor, in the map frame; return its scans/ and poses.csv.

    A scan has about 800 points.
    """
    rng = np.random.default_rng(seed)
    scans = folder / "scans"
    scans.mkdir(parents=True)
    lines = ["scan,timestamp,x,y,z,qx,qy,qz,qw"]
    for number in range(num_scans):
        robot = np.array([STEP * number, 0.0, 0.5])
        xyz = _corridor(robot[0], rng)
        columns = {axis: xyz[:, column] for column, axis in enumerate("xyz")}
        if colour:
            rgb = np.clip(100 + 60 * xyz + rng.normal(0, 10, xyz.shape), 0, 255).astype(np.uint8)
            columns |= {
                name: rgb[:, column] for column, name in enumerate(("red", "green", "blue"))
            }
        write_cloud(scans / f"{number:06d}{suffix}", Cloud(columns))
        lines.append(
            f"{number:06d},{0.1 * number:.1f},{robot[0]:.3f},{robot[1]:.3f},{robot[2]:.3f},0,0,0,1"
        )
    poses = folder / "poses.csv"
    poses.write_text("\n".join(lines) + "\n")
    return scans, poses


def _corridor(x: float, rng: np.random.Generator) -> np.ndarray:
    """Sample (800, 3) float32 points of a floor (z = 0) and two walls (y = ±1.2) around ``x``."""
    along = rng.uniform(x - 1.6, x + 1.6, 800)
    floor = np.stack([along[:400], rng.uniform(-1.2, 1.2, 400), rng.normal(0, 0.005, 400)], axis=1)
    side = np.repeat([-1.2, 1.2], 200) + rng.normal(0, 0.005, 400)
    walls = np.stack([along[400:], side, rng.uniform(0, 2.0, 400)], axis=1)
    return np.concatenate([floor, walls]).astype(np.float32)
