"""Fixtures that many test modules share: weights, small recordings and the reference data."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import torch

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.formats import Cloud, write_cloud
from mcpseg_cli.formats.recording import open_recording
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.weights import WeightsInfo, build_network, load_weights, save_weights
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions


class LabelledFolders(NamedTuple):
    """Folders of a run and of the scans it was made from."""

    out: Path
    scans: Path


MakeRecording = Callable[..., tuple[Path, Path]]

STEP = 0.4  # metres the robot moves along x between two scans


@pytest.fixture(scope="session")
def weights_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """MCPNet with seeded random parameters: no test depends on bundled weights."""
    path = tmp_path_factory.mktemp("weights") / "random.safetensors"
    info = WeightsInfo(architecture="mcpnet", classes=S3DIS_CLASSES)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(7)
        save_weights(path, build_network(info), info)
    return path


@pytest.fixture(scope="session")
def unet_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The network that sees the room with seeded random parameters; its classes are mixed."""
    path = tmp_path_factory.mktemp("weights") / "room.safetensors"
    info = WeightsInfo(architecture="unet", classes=S3DIS_CLASSES)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(7)
        network = build_network(info)
        with torch.no_grad():
            network.classify.weight *= 20.0
            network.classify.bias.zero_()
        save_weights(path, network, info)
    return path


@pytest.fixture(scope="session")
def labelled_run(tmp_path_factory: pytest.TempPathFactory, weights_path: Path) -> LabelledFolders:
    """A small recording and the finished run made from it; not to be changed."""
    folder = tmp_path_factory.mktemp("labelled")
    scans, poses = write_recording(folder / "input")
    weights = load_weights(weights_path)
    run = SegmentRun(
        open_recording(scans, poses),
        folder / "out",
        IncrementalSegmenter(weights),
        RunOptions(),
    )
    with run:
        list(run.run())
        run.write_objects()
    return LabelledFolders(folder / "out", scans)


@pytest.fixture
def make_recording() -> MakeRecording:
    """Factory of small recordings: ``write_recording``."""
    return write_recording


@pytest.fixture
def shared_folder() -> Path:
    """Folder of the reference data; the test is skipped where there is none."""
    named = os.environ.get("MCPSEG_SHARED")
    folder = Path(named) if named else Path(__file__).parents[2] / "shared"
    if not folder.is_dir():
        pytest.skip(f"no reference data at {folder}; set MCPSEG_SHARED to its folder")
    return folder


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
