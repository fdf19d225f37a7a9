"""Who draws batches changes nothing: threads and processes, and what goes between them."""

import os
from dataclasses import dataclass

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from mcpseg_cli.errors import McpsegError, TrainingError
from mcpseg_cli.networks.sparse import make_levels
from mcpseg_cli.networks.unet import NUM_LEVELS
from mcpseg_cli.train.batches import Batch
from mcpseg_cli.train.drawing import Drawing
from mcpseg_cli.train.objective import Objective, TensorBatch, TensorWindows
from mcpseg_cli.train.packing import pack, unpack

KINDS = [torch.float32, torch.uint8, torch.int32, torch.int64, torch.bool]
CPU = torch.device("cpu")


@dataclass(frozen=True)
class Numbers:
    """A source whose batches say which they are; one place may fail, or end its process."""

    name: int
    broken: int | None = None
    deadly: int | None = None

    def __len__(self):
        return 100

    def epoch(self, number, *, rank=0, world=1, start=0):
        raise NotImplementedError

    def batch(self, number, position):
        if position == self.broken:
            raise McpsegError("scan.ply: not there; expected a file; look for it")
        if position == self.deadly:
            os._exit(1)
        facts = np.array([self.name, number, position])
        return Batch(facts.astype(np.float32), None, facts, facts)


def drawn(drawing, source, epoch, positions):
    """What is drawn, as name, epoch and position."""
    objective = Objective.__new__(Objective)
    objective._device = CPU
    with drawing.batches(source, epoch, positions) as batches:
        return [tuple(objective.move(batch).semantic.tolist()) for batch in batches]


@pytest.mark.parametrize(("workers", "on_device"), [(0, False), (0, True), (2, False)])
def test_batches_come_in_order_whoever_draws_them(workers, on_device):
    one, other = Numbers(1), Numbers(2)
    drawing = Drawing([one, other], Objective.to_tensors, workers=workers, on_device=on_device)
    try:
        for source, epoch, positions in ((one, 0, range(9)), (other, 0, [3]), (one, 1, [8, 2, 5])):
            expected = [(source.name, epoch, position) for position in positions]
            assert drawn(drawing, source, epoch, positions) == expected
    finally:
        drawing.close()


@pytest.mark.parametrize("workers", [0, 1])
def test_what_is_wrong_with_the_data_is_told_in_its_own_line(workers):
    source = Numbers(1, broken=2)
    drawing = Drawing([source], Objective.to_tensors, workers=workers, on_device=False)
    with pytest.raises(McpsegError, match=r"^scan.ply: not there; expected a file; look for it$"):
        drawn(drawing, source, 0, range(4))
    drawing.close()


def test_a_process_that_is_gone_ends_the_training_in_one_line():
    source = Numbers(1, deadly=2)
    drawing = Drawing([source], Objective.to_tensors, workers=1, on_device=False)
    with pytest.raises(TrainingError, match="a process that draws batches is gone"):
        drawn(drawing, source, 0, range(4))
    drawing.close()


@given(
    st.lists(
        st.none()
        | st.tuples(st.sampled_from(KINDS), st.lists(st.integers(0, 5), min_size=1, max_size=3)),
        max_size=6,
    )
)
def test_packed_tensors_come_out_as_they_were(facts):
    tensors = [None if each is None else torch.randint(0, 2, each[1]).to(each[0]) for each in facts]
    assert_same(tensors, unpack(pack(tensors), CPU))


@pytest.mark.parametrize("context", [None, torch.rand(7, 3, 6)])
def test_a_batch_of_points_is_packed_and_unpacked(context):
    batch = TensorBatch(torch.rand(7, 6), context, torch.arange(7), torch.arange(7))
    assert_same(tensors_of(batch), tensors_of(TensorBatch.unpacked(batch.packed(), CPU)))


def test_windows_are_packed_and_unpacked():
    voxel = np.unique(np.random.default_rng(0).integers(0, 9, (200, 3)).astype(np.int32), axis=0)
    semantic = torch.arange(len(voxel))
    levels = make_levels(voxel, NUM_LEVELS)
    windows = TensorWindows(torch.rand(len(voxel), 14), levels, semantic, semantic)
    assert_same(tensors_of(windows), tensors_of(TensorWindows.unpacked(windows.packed(), CPU)))


def tensors_of(batch):
    """All tensors of a batch, levels flattened."""
    parts = []
    for part in vars(batch).values():
        parts += (
            [table for level in part for table in level.tables()] if type(part) is list else [part]
        )
    return parts


def assert_same(tensors: list[Tensor | None], others: list[Tensor | None]) -> None:
    for before, after in zip(tensors, others, strict=True):
        if before is None:
            assert after is None
        else:
            assert after.dtype == before.dtype
            assert torch.equal(after, before)
