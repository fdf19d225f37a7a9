"""A power cut at any step of a run: the same command goes on, and what was told is not lost."""

import random
from pathlib import Path

import pytest

from mcpseg_cli.formats.recording import open_recording
from mcpseg_cli.incremental.segmenter import IncrementalSegmenter
from mcpseg_cli.networks.weights import load_weights
from mcpseg_cli.segment.run import SegmentRun
from mcpseg_cli.segment.run_record import RunOptions
from tests.commands import outputs_of
from tests.power_loss import Recorder, Step, folder_after, some
from tests.recordings import write_recording

_NUM_SCANS = 3
_SAMPLED = 10


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> tuple[Path, Path]:
    return write_recording(tmp_path_factory.mktemp("input") / "walk", num_scans=_NUM_SCANS)


def label(recording, out: Path, weights_path: Path, recorder: Recorder | None = None) -> int:
    """Label all scans, each on the disk before the next; return how many were there."""
    segmenter = IncrementalSegmenter(load_weights(weights_path))
    options = RunOptions(durable=True)
    with SegmentRun(open_recording(*recording), out, segmenter, options) as run:
        for _ in run.run():
            if recorder:
                recorder.told()
        run.write_objects()
    return run.resumed_from


@pytest.fixture(scope="module")
def recorded(recording, weights_path, tmp_path_factory) -> Recorder:
    """A run and all that it wrote, step by step."""
    recorder = Recorder(tmp_path_factory.mktemp("recorded") / "out")
    with recorder.recording():
        label(recording, recorder.folder, weights_path, recorder)
    return recorder


def first_known(steps: list[Step]) -> int:
    """Return after how many steps there is a checkpoint that the disk has."""
    syncs = (n for n, step in enumerate(steps) if (step.kind, step.name[:5]) == ("sync", "state"))
    return next(syncs) + 1


def test_the_log_of_a_run_is_all_that_it_wrote(recorded, tmp_path):
    folder_after(recorded.steps, tmp_path / "out")
    whole = outputs_of(recorded.folder)
    assert outputs_of(tmp_path / "out") == whole
    assert sum(step.kind == "told" for step in recorded.steps) == _NUM_SCANS
    assert len(recorded.steps) > 20 * _NUM_SCANS


@pytest.mark.parametrize("keeps", ["all that was written", "some of what nobody waited for"])
def test_a_run_goes_on_from_what_a_power_cut_leaves_and_has_all_that_was_told(
    recorded, recording, weights_path, tmp_path, keeps
):
    rng, steps = random.Random(keeps), recorded.steps
    whole = outputs_of(recorded.folder)
    ends = rng.sample(range(first_known(steps), len(steps)), _SAMPLED)
    for end in sorted(ends):
        out = tmp_path / f"after{end}"
        kept = some(rng) if keeps.startswith("some") else lambda: True
        folder_after(steps[:end], out, kept)
        told = sum(step.kind == "told" for step in steps[:end])
        assert label(recording, out, weights_path) >= told, f"after step {end}"
        assert outputs_of(out) == whole, f"after step {end}"
