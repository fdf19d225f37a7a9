"""Time of a training step of MCPNet: layers and Adam as torch gives them, against ours.

    python -m tests.benchmarks.training [--threads 2] [--steps 100]

A step is 256 points with 50 context points each: forward, losses, backward, update, scores. Plain
and ours take turns, so that what else the machine does slows both.
"""

import argparse
import json
import os
from time import perf_counter

import numpy as np
import torch

from mcpseg_cli.config import BATCH, NUM_CONTEXT, TrainSettings
from mcpseg_cli.networks.mcpnet import MCPNet
from mcpseg_cli.train.objective import Objective, TensorBatch
from mcpseg_cli.train.scores import Tally

NUM_CLASSES = 13


class PlainNet(MCPNet):
    """MCPNet whose context pooling goes through torch's own backward pass."""

    def pool_context(self, context):
        """Run every layer on every context point."""
        return self.context_2(self.context_1(context).relu()).amax(dim=-2).relu()


class Stepper:
    """One network with its optimiser."""

    def __init__(self, network, precision="fp32", fused=True):
        self.network = network.train()
        self.objective = Objective(TrainSettings(precision=precision), None, torch.device("cpu"))
        self.optimiser = torch.optim.AdamW(
            network.parameters(), lr=1e-3, weight_decay=0.0, fused=fused
        )
        self.tally = Tally(NUM_CLASSES, torch.device("cpu"))

    def step(self, batch):
        """Do one step; return the milliseconds it took."""
        started = perf_counter()
        self.optimiser.zero_grad(set_to_none=True)
        outcome = self.objective.evaluate(self.network, batch)
        total = self.objective.total(outcome)
        total.backward()
        self.optimiser.step()
        self.tally.add(outcome, total, batch.semantic)
        return 1e3 * (perf_counter() - started)


def make_batch(rng):
    """Draw a batch of a scan's size: 12 objects of 13 classes."""
    instance = torch.from_numpy(rng.integers(1, 13, BATCH))
    centre = torch.from_numpy(rng.normal(size=(BATCH, 6)).astype(np.float32))
    context = torch.from_numpy(rng.normal(0, 0.2, (BATCH, NUM_CONTEXT, 6)).astype(np.float32))
    return TensorBatch(centre, context, instance, instance)


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--steps", type=int, default=100)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    rng = np.random.default_rng(0)
    steppers = {
        "plain fp32": Stepper(PlainNet(NUM_CLASSES), fused=False),
        "ours fp32": Stepper(MCPNet(NUM_CLASSES)),
        "plain bf16": Stepper(PlainNet(NUM_CLASSES), "bf16", fused=False),
        "ours bf16": Stepper(MCPNet(NUM_CLASSES), "bf16"),
    }
    times = {name: [] for name in steppers}
    for _ in range(arguments.steps):
        batch = make_batch(rng)
        for name, stepper in steppers.items():
            times[name].append(stepper.step(batch))
    figures = {
        name: {"median": round(float(np.median(each[5:])), 2), "fastest": round(min(each), 2)}
        for name, each in times.items()
    }
    print(
        json.dumps(
            {"ms_per_step": figures, "threads": arguments.threads, "load": os.getloadavg()},
            indent=1,
        )
    )


if __name__ == "__main__":
    main()
