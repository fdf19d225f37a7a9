"""Maps of which only what is near the robot is in memory."""

from pathlib import Path

import numpy as np
import pytest

from mcpseg_cli.errors import OutputError
from mcpseg_cli.segment import paging
from mcpseg_cli.segment.paging import PagedMemory
from tests.commands import invoke, outputs_of, segment
from tests.recordings import write_recording


def test_rows_that_left_memory_come_back_as_they_were(tmp_path):
    memory = PagedMemory(tmp_path, 1.0)
    rows = memory.rows(np.int32, (3,), 10)
    assert len(rows) >= 10
    assert not rows[:1000].any()
    rows[:100_000] = np.arange(300_000).reshape(-1, 3)
    memory.leave_all()
    assert np.array_equal(rows[:100_000], np.arange(300_000).reshape(-1, 3))
    assert list(tmp_path.iterdir()) == []


def resident_kb(rows) -> int:
    """Memory that the mapping of an array has."""
    address, found = rows.__array_interface__["data"][0], False
    with Path("/proc/self/smaps").open() as file:
        for line in file:
            if line.split()[0].startswith(f"{address:x}-"):
                found = True
            elif found and line.startswith("Rss:"):
                return int(line.split()[1])
    raise AssertionError("no such mapping")


def test_what_is_near_the_robot_stays_and_what_is_far_leaves(tmp_path, monkeypatch):
    monkeypatch.setattr(paging, "_EVERY", 1)
    memory = PagedMemory(tmp_path, 1.0)
    rows = memory.rows(np.float32, (), 10)
    rows[: 1 << 20] = 1
    assert resident_kb(rows) >= 4096
    memory.leave(np.zeros(3), lambda *_: np.arange(1024, 3072, dtype=np.int32))
    assert resident_kb(rows) == 8  # two pages of 1024 rows


@pytest.mark.parametrize("clustering", ["graph", "paper"])
def test_labels_do_not_depend_on_what_is_in_memory(unet_path, tmp_path, monkeypatch, clustering):
    monkeypatch.setattr(paging, "_EVERY", 1)
    recording = write_recording(tmp_path / "in", num_scans=6)
    options = ("-w", unet_path, "--clustering", clustering)
    assert segment(recording, tmp_path / "one", *options).exit_code == 0

    # a run that is continued, at that
    poses = recording[1].read_text().splitlines(keepends=True)
    few = tmp_path / "few"
    few.mkdir()
    for path in sorted(recording[0].iterdir())[:3]:
        (few / path.name).write_bytes(path.read_bytes())
    (tmp_path / "few.csv").write_text("".join(poses[:4]))
    options = (*options, "--keep-near", 1)
    for each in ((few, tmp_path / "few.csv"), recording):
        result = segment(each, tmp_path / "two", *options)
        assert result.exit_code == 0, result.output
    assert outputs_of(tmp_path / "one") == outputs_of(tmp_path / "two")


def test_a_disk_that_is_nearly_full_is_told_before_it_is(tmp_path, monkeypatch):
    monkeypatch.setattr(paging, "_LEAST_FREE", 1 << 60)
    memory = PagedMemory(tmp_path, 1.0)
    with pytest.raises(OutputError, match="MB free; expected room"):
        memory.leave(np.zeros(3), lambda *_: np.empty(0, np.int32))


def test_a_complete_cloud_is_not_kept_in_part(tmp_path, unet_path):
    recording = write_recording(tmp_path / "in", num_scans=1)
    words = ("segment", *recording, "-o", tmp_path / "o", "-w", unet_path, "--keep-near", 30)
    assert "--offline holds" in " ".join(invoke(*words, "--offline").output.split())
