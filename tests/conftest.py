"""Fixtures that many test modules share: weights, small recordings and the reference data."""

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
import torch
from hypothesis import HealthCheck, settings

from mcpseg_cli.formats.recording import open_recording
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.weights import load_weights
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions
from tests.recordings import write_recording, write_weights

# how long something takes, while other work has the cores, is no finding
settings.register_profile("suite", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("suite")


class LabelledFolders(NamedTuple):
    """Folders of a run and of the scans it was made from."""

    out: Path
    scans: Path

    @property
    def recording(self) -> tuple[Path, Path]:
        """The scans and their poses."""
        return self.scans, self.scans.parent / "poses.csv"


MakeRecording = Callable[..., tuple[Path, Path]]


def pytest_configure() -> None:
    """Use one thread, also in other processes: the suite has a worker for each core."""
    os.environ["OMP_NUM_THREADS"] = "1"
    torch.set_num_threads(1)


@pytest.fixture(autouse=True)
def _one_thread_again() -> Iterator[None]:
    """Networks this small only wait for a second thread; who wants several asks for them."""
    yield
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def weights_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """MCPNet with seeded random parameters: no test depends on bundled weights."""
    return write_weights(tmp_path_factory.mktemp("weights") / "random.safetensors", "mcpnet")


@pytest.fixture(scope="session")
def unet_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The network that sees the room with seeded random parameters; its classes are mixed."""
    return write_weights(tmp_path_factory.mktemp("weights") / "room.safetensors", "unet")


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
def recording(tmp_path: Path) -> tuple[Path, Path]:
    """Folder and poses of a small recording of the test's own, in ``input`` of its folder."""
    return write_recording(tmp_path / "input")


@pytest.fixture
def shared_folder() -> Path:
    """Folder of the reference data; the test is skipped where there is none."""
    named = os.environ.get("MCPSEG_SHARED")
    folder = Path(named) if named else Path(__file__).parents[2] / "shared"
    if not folder.is_dir():
        pytest.skip(f"no reference data at {folder}; set MCPSEG_SHARED to its folder")
    return folder
