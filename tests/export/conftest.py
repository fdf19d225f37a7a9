"""A run whose labels change, and a browser."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.commands import segment
from tests.conftest import LabelledFolders
from tests.pages import CHROMIUM, SOFTWARE_GL
from tests.recordings import write_recording


@pytest.fixture(scope="session")
def changing_run(tmp_path_factory: pytest.TempPathFactory, unet_path: Path) -> LabelledFolders:
    """A run of a network that looks at every voxel again; not to be changed."""
    folder = tmp_path_factory.mktemp("changing")
    recording = write_recording(folder / "input", num_scans=6)
    assert segment(recording, folder / "out", "-w", unet_path, "-q").exit_code == 0
    return LabelledFolders(folder / "out", recording[0])


@pytest.fixture
def own_run(changing_run: LabelledFolders, tmp_path: Path) -> Path:
    """A copy of that run, to be changed."""
    shutil.copytree(changing_run.out, tmp_path / "out")
    return tmp_path / "out"


@pytest.fixture(scope="session")
def browser() -> Iterator[object]:
    """Chromium, drawing in software; tests are skipped where it or Playwright is missing."""
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine (Debian: apt-get install chromium)")
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright drives the browser")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=SOFTWARE_GL)
        yield browser
        browser.close()
