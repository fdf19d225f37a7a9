"""Time of a training step: of MCPNet, plain and ours, or of the sparse U-Net.

    python -m tests.benchmarks.training [--net unet] [--threads 2] [--steps 100] [--device cuda]
    [--windows 16]

A step is forward, losses, backward, update, scores. MCPNet's has 256 points with 50 context points
each; layers and Adam as torch gives them and ours take turns, so that what else the machine does
slows both. The U-Net's has two windows, or so many, of 6,000 voxels: rooms with boxes in them; on a
device, the way there is part of a step, and looking around by a call for each of 26 neighbours, as
the slow twin does, takes turns with ours. Beside the time
that passed stands that of the processor, which a busy machine changes less.
"""

import argparse
import json
import os
from functools import partial
from time import perf_counter, process_time

import numpy as np
import torch

from mcpseg_cli.config import BATCH, NUM_CONTEXT, WINDOW_TRAINING, TrainSettings
from mcpseg_cli.incremental.window import NUM_INPUTS
from mcpseg_cli.networks import sparse
from mcpseg_cli.networks.mcpnet import MCPNet
from mcpseg_cli.networks.sparse import make_levels
from mcpseg_cli.networks.unet import NUM_LEVELS, UNet
from mcpseg_cli.train.objective import Objective, TensorBatch, TensorWindows
from mcpseg_cli.train.scores import Tally
from mcpseg_cli.train.window_objective import WindowObjective

NUM_CLASSES = 13
WINDOW_VOXELS = 6000
GATHER = sparse.gather_neighbours
ROOM = (46, 46, 27)  # voxels; with its boxes a little more than a window


class PlainNet(MCPNet):
    """MCPNet whose context pooling goes through torch's own backward pass."""

    def pool_context(self, context):
        """Run every layer on every context point."""
        return self.context_2(self.context_1(context).relu()).amax(dim=-2).relu()


class Stepper:
    """One network with its optimiser; what steps take, in milliseconds, of clock and processor."""

    def __init__(self, network, precision="fp32", fused=True, device="cpu", twin=False):
        self.device, self.twin = torch.device(device), twin
        self.network = network.train().to(self.device)
        self.objective = objective_of(network, precision, self.device)
        self.optimiser = torch.optim.AdamW(
            network.parameters(), lr=1e-3, weight_decay=0.0, fused=fused
        )
        self.tally = Tally(NUM_CLASSES, self.device)
        self.ms, self.cpu_ms = [], []

    def step(self, batch):
        """Do one step."""
        started, cpu_started = perf_counter(), process_time()
        batch = self.objective.move(batch)
        self.optimiser.zero_grad(set_to_none=True)
        if self.twin:
            sparse.gather_neighbours = sparse.sum_neighbours
        outcome = self.objective.evaluate(self.network, batch)
        total = self.objective.total(outcome)
        total.backward()
        self.optimiser.step()
        self.tally.add(outcome, total, batch.semantic)
        if self.device.type == "cuda":
            torch.cuda.synchronize()
        sparse.gather_neighbours = GATHER
        self.ms.append(1e3 * (perf_counter() - started))
        self.cpu_ms.append(1e3 * (process_time() - cpu_started))

    def figures(self):
        """Sum up all steps but the first few."""
        return {
            "median": round(float(np.median(self.ms[5:])), 2),
            "fastest": round(min(self.ms), 2),
            "cpu_median": round(float(np.median(self.cpu_ms[5:])), 2),
        }


def objective_of(network, precision, device):
    """Make what is to become small for a network."""
    if isinstance(network, UNet):
        settings = TrainSettings(architecture="unet", precision=precision, **WINDOW_TRAINING)
        return WindowObjective(settings, None, device)
    return Objective(TrainSettings(precision=precision), None, device)


def make_batch(rng):
    """Draw a batch of a scan's size: 12 objects of 13 classes."""
    instance = torch.from_numpy(rng.integers(1, 13, BATCH))
    centre = torch.from_numpy(rng.normal(size=(BATCH, 6)).astype(np.float32))
    context = torch.from_numpy(rng.normal(0, 0.2, (BATCH, NUM_CONTEXT, 6)).astype(np.float32))
    return TensorBatch(centre, context, instance, instance)


def make_window(rng):
    """Draw (6000, 3) int32 voxels of a room's six sides and of boxes on its floor, in order."""
    grid = np.stack(np.meshgrid(*map(np.arange, ROOM), indexing="ij"), axis=-1)
    is_side = ((grid == 0) | (grid == np.array(ROOM) - 1)).any(axis=-1)
    is_side[-1], is_side[:, -1] = False, False  # two walls out of sight
    for _ in range(24):
        low, size = rng.integers(2, 40, 2), rng.integers(3, 9, 3)
        within = (grid >= [*low, 1]) & (grid < [*(low + size[:2]), 1 + size[2]])
        inner = (grid > [*low, 1]) & (grid < [*(low + size[:2] - 1), size[2]])
        is_side |= within.all(axis=-1) & ~inner.all(axis=-1)
    voxel = np.argwhere(is_side).astype(np.int32)
    assert len(voxel) >= WINDOW_VOXELS, len(voxel)
    return voxel[np.sort(rng.permutation(len(voxel))[:WINDOW_VOXELS])]


def make_windows(rng, count=2):
    """Draw a batch of some windows, far from each other as in training."""
    apart = np.array([1 << 13, 0, 0], np.int32)
    voxel = np.concatenate([make_window(rng) + number * apart for number in range(count)])
    inputs = torch.from_numpy(rng.normal(size=(len(voxel), NUM_INPUTS)).astype(np.float32))
    semantic = torch.from_numpy(rng.integers(0, NUM_CLASSES, len(voxel)))
    instance = torch.from_numpy(rng.integers(1, 40, len(voxel)))
    return TensorWindows(inputs, make_levels(voxel, NUM_LEVELS), semantic, instance)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--net", choices=("mcpnet", "unet"), default="mcpnet")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--windows", type=int, default=2)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    rng = np.random.default_rng(0)
    make, steppers = (
        make_batch,
        {
            "plain fp32": Stepper(PlainNet(NUM_CLASSES), fused=False),
            "ours fp32": Stepper(MCPNet(NUM_CLASSES)),
            "plain bf16": Stepper(PlainNet(NUM_CLASSES), "bf16", fused=False),
            "ours bf16": Stepper(MCPNet(NUM_CLASSES), "bf16"),
        },
    )
    if arguments.net == "unet":
        make = partial(make_windows, count=arguments.windows)
        steppers = {
            name: Stepper(UNet(NUM_CLASSES), name, device=arguments.device)
            for name in ("fp32", "bf16")
        }
        if arguments.device != "cpu":
            twin = Stepper(UNet(NUM_CLASSES), "bf16", device=arguments.device, twin=True)
            steppers["bf16, neighbours one by one"] = twin
    for _ in range(arguments.steps):
        batch = make(rng)
        for stepper in steppers.values():
            stepper.step(batch)
    figures = {
        "ms_per_step": {name: stepper.figures() for name, stepper in steppers.items()},
        "threads": arguments.threads,
        "load": os.getloadavg(),
    }
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
