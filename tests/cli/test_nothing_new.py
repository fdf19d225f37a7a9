"""Where no network runs torch stays out: it takes a second and 200 MB of every start."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.recordings import write_recording

SCRIPT = """
import sys
from mcpseg_cli.cli import main
try:
    main()
except SystemExit as end:
    print("torch" if "torch" in sys.modules else "no torch")
    raise
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, unet_path: Path) -> Path:
    """A folder with scans, their poses, weights and the finished run made of them."""
    folder = tmp_path_factory.mktemp("again")
    write_recording(folder, 3)
    shutil.copy(unet_path, folder / "w.safetensors")
    assert run(folder, "segment", *AGAIN).stdout.splitlines()[-1] == "torch"
    return folder


AGAIN = ("scans", "poses.csv", "-o", "out", "-w", "w.safetensors", "-q")


def run(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", SCRIPT, *words],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    "words",
    [
        ("segment", *AGAIN),
        ("export", "out", "-o", "map.laz"),
        ("export", "out", "-o", "map.html"),
        ("eval", "out", "out"),
        ("merge", "out", "-o", "merged", "-q"),
        ("info", "out"),
    ],
    ids=["segment", "laz", "html", "eval", "merge", "info"],
)
def test_commands_that_run_no_network_import_no_torch(folder, words):
    result = run(folder, *words)
    assert result.returncode == 0, result.stderr
    assert result.stdout.splitlines()[-1] == "no torch"


def test_weights_that_cannot_be_read_are_refused_before_anything_is_written(folder, tmp_path):
    damaged = tmp_path / "w.safetensors"
    data = bytearray((folder / "w.safetensors").read_bytes())
    data[-4:] = b"\xff\xff\xff\x7f"  # NaN
    damaged.write_bytes(data)
    words = [*AGAIN[:3], str(tmp_path / "new"), "-w", str(damaged), "-q"]
    result = run(folder, "segment", *words)
    assert result.returncode == 1
    assert "NaN or infinite parameters" in result.stderr
    assert not (tmp_path / "new").exists()


def test_a_run_that_is_started_again_with_damaged_weights_is_kept(folder, tmp_path):
    shutil.copytree(folder / "out", tmp_path / "out")
    data = bytearray((folder / "w.safetensors").read_bytes())
    data[-4:] = b"\xff\xff\xff\x7f"
    (tmp_path / "w.safetensors").write_bytes(data)
    words = ["scans", "poses.csv", "-o", str(tmp_path / "out"), "-w"]
    words += [str(tmp_path / "w.safetensors"), "-q", "--overwrite"]
    result = run(folder, "segment", *words)
    assert result.returncode == 1
    assert "NaN or infinite parameters" in result.stderr
    assert (tmp_path / "out/map.ply").read_bytes() == (folder / "out/map.ply").read_bytes()


def test_weights_that_changed_since_the_run_was_begun_are_refused(folder, tmp_path):
    shutil.copytree(folder / "out", tmp_path / "out")
    data = bytearray((folder / "w.safetensors").read_bytes())
    data[-1] ^= 1
    (tmp_path / "w.safetensors").write_bytes(data)
    words = ["scans", "poses.csv", "-o", str(tmp_path / "out"), "-w"]
    result = run(folder, "segment", *words, str(tmp_path / "w.safetensors"), "-q")
    assert result.returncode == 1
    assert "weights" in result.stderr
