"""Train the smoke-test weights: MCPNet on a few synthetic rooms of boxes, sampled exactly as inference samples them.

PYTHONPATH=examples python models/make_smoke_test.py models/smoke-test.safetensors
"""

import argparse
from collections.abc import Iterator
from itertools import cycle, islice
from math import cos, pi
from pathlib import Path
from time import perf_counter

import numpy as np
import torch
from make_office_walk import make_walk
from numpy.typing import NDArray

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.config import NUM_CONTEXT, SegmentSettings
from mcpseg_cli.context import context_input, network_input
from mcpseg_cli.formats import Labels
from mcpseg_cli.networks.mcpnet import MCPNet
from mcpseg_cli.scan import Scan, to_map_frame
from mcpseg_cli.segmenter import IncrementalSegmenter
from mcpseg_cli.voxel_map import VoxelMap
from mcpseg_cli.weights import Weights, WeightsInfo, build_network, save_weights

Walk = list[tuple[Scan, Labels]]
Batch = tuple[torch.Tensor, ...]  # (N, 6) centre, (N, K, 6) context, (N,) class, (N,) object
NOTICE = "a smoke-test model trained on a few synthetic rooms of boxes; expect poor labels on real scans"
SEEDS, VALIDATION_SEED = range(100, 180), 1
MARGIN = 1.0  # of the triplet loss, on squared distances
SEED = 0  # of the parameters, augmentation and batch order
SETTINGS = SegmentSettings()


def augment(walk: Walk, rng: np.random.Generator) -> tuple[Walk, float]:
    """Turn a walk about z, shift it against the voxels and change its colours; return it with its floor height."""
    yaw = rng.integers(4) * pi / 2 + rng.normal(0, 0.1)
    move = np.eye(4)
    move[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    move[:3, 3] = rng.uniform(-0.05, 0.05, 3)
    gain, offset = rng.uniform(0.75, 1.2) * rng.uniform(0.9, 1.1, 3), rng.uniform(-20, 20)
    if rng.random() < 0.15:
        gain, offset = 0 * gain, 128.0  # as the segmenter sees scans without colour
    turned = []
    for scan, labels in walk:
        colour = (np.asarray(scan.rgb) * gain + offset).clip(0, 255).astype(np.uint8)
        turned.append((Scan(to_map_frame(scan.xyz, move), colour, move @ scan.pose), labels))
    return turned, float(move[2, 3])


def replay(walk: Walk, floor: float, rng: np.random.Generator) -> Iterator[Batch]:
    """Give the batches that the segmenter labels on a walk: each scan's new voxels, shuffled, the last filled up."""
    voxel_map = VoxelMap(SETTINGS.voxel_size)
    truth = np.empty((0, 2), np.int64)  # class and object of every voxel
    for scan, labels in walk:
        new, first_point = insert_near(voxel_map, scan)
        truth = np.concatenate([truth, np.stack([labels.semantic, labels.instance], axis=1)[first_point]])
        filler = rng.integers(len(new), size=-len(new) % SETTINGS.batch_size)
        order = np.concatenate([rng.permutation(len(new)), filler])
        for ids in new[order].reshape(-1, SETTINGS.batch_size):
            sample = voxel_map.sample_context(ids, "cells", rng.random((len(ids), NUM_CONTEXT), np.float32))
            centre = network_input(voxel_map.xyz[ids], voxel_map.rgb[ids], scan.position, floor)
            context = context_input(ids, sample, voxel_map.xyz, voxel_map.rgb)
            yield torch.from_numpy(centre), torch.from_numpy(context), *torch.from_numpy(truth[ids]).unbind(dim=1)


def insert_near(voxel_map: VoxelMap, scan: Scan) -> tuple[NDArray[np.int32], NDArray[np.intp]]:
    """Insert the points in range; return the (M,) new voxel ids and the (M,) point of the scan each came from."""
    offset = scan.xyz[:, :2] - scan.position[:2].astype(np.float32)
    near = np.flatnonzero(np.hypot(*offset.T) < SETTINGS.local_range)
    start = len(voxel_map)
    ids, first = np.unique(voxel_map.insert(scan.xyz[near], np.asarray(scan.rgb)[near]), return_index=True)
    return ids[ids >= start], near[first[ids >= start]]


def endless_batches(rng: np.random.Generator) -> Iterator[Batch]:
    """Give batches of all walks for ever, augmented anew each time, those of eight walks mixed."""
    walks = cycle([make_walk(seed) for seed in SEEDS])
    while True:
        pool = [batch for walk in islice(walks, 8) for batch in replay(*augment(walk, rng), rng)]
        for index in rng.permutation(len(pool)):
            yield pool[index]


def triplet_loss(embedding: torch.Tensor, instance: torch.Tensor) -> torch.Tensor:
    """Compute the semi-hard triplet loss of (N, E) unit vectors and (N,) objects (Schroff et al., FaceNet, 2015)."""
    distance = 2 - 2 * embedding @ embedding.T  # (N, N) squared
    same = instance[:, None] == instance[None]
    negatives, _ = distance.masked_fill(same, torch.inf).sort(dim=1)
    num_negatives = (~same).sum(dim=1, keepdim=True)
    farther = torch.searchsorted(negatives.detach(), distance.detach(), right=True)
    # for each pair of one object, the nearest negative that is farther than the positive, else the farthest one
    chosen = negatives.gather(1, torch.minimum(farther, num_negatives - 1).clamp(min=0))
    pairs = same & (num_negatives > 0) & ~torch.eye(len(same), dtype=torch.bool)
    return torch.relu(MARGIN + distance[pairs] - chosen[pairs]).mean()


def train(network: MCPNet, steps: int, rng: np.random.Generator, checkpoint: Path, info: WeightsInfo) -> None:
    """Train in place by Adam with a cosine schedule; a checkpoint is saved now and then."""
    optimiser = torch.optim.Adam(network.parameters(), lr=1e-3)
    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, lambda step: 0.5 + 0.5 * cos(pi * step / steps))
    counts = torch.ones(len(S3DIS_CLASSES))
    for step, (centre, context, semantic, instance) in enumerate(islice(endless_batches(rng), steps), start=1):
        counts += torch.bincount(semantic, minlength=len(counts))
        embedding, logits = network(centre, context)
        class_loss = torch.nn.functional.cross_entropy(logits, semantic, (counts.mean() / counts).sqrt())
        instance_loss = triplet_loss(embedding, instance)
        optimiser.zero_grad()
        torch.autograd.backward(class_loss + instance_loss)
        optimiser.step()
        schedule.step()
        if step % 500 == 0:
            print(f"step {step}: class {class_loss.item():.3f}, instance {instance_loss.item():.3f}", flush=True)
            save_weights(checkpoint, network, info)


def point_accuracy(network: MCPNet, info: WeightsInfo, walk: Walk) -> float:
    """Run the segmenter over a walk and return the share of voxels whose class is right when first seen."""
    segmenter = IncrementalSegmenter(Weights(network.eval(), info, "", "smoke-test"), SETTINGS, precision="fp32")
    truth = []
    for scan, labels in walk:
        update = segmenter.register_scan(scan)
        ids, first_point = np.unique(update.point_ids, return_index=True)
        truth.append(labels.semantic[first_point[ids >= update.first_new]])
    return float((segmenter.semantic == np.concatenate(truth)).mean())


def main() -> None:
    """Train, score on a walk that training did not see, save."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("weights", type=Path, help="the .safetensors file to write")
    parser.add_argument("--steps", type=int, default=6000, help="batches of 256 voxels")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    torch.manual_seed(SEED)
    info = WeightsInfo(architecture="mcpnet", classes=S3DIS_CLASSES, context_window="cells", notice=NOTICE)
    network, start = build_network(info), perf_counter()
    train(network, arguments.steps, np.random.default_rng(SEED), arguments.weights, info)
    facts: dict[str, str | int | float] = {"steps": arguments.steps, "seconds": round(perf_counter() - start)}
    facts["point_accuracy"] = round(point_accuracy(network, info, make_walk(VALIDATION_SEED)), 4)
    facts["data"] = f"synthetic rooms, seeds {SEEDS.start} to {SEEDS.stop - 1}; scored on seed {VALIDATION_SEED}"
    save_weights(arguments.weights, network, info.model_copy(update={"training": facts}))


if __name__ == "__main__":
    main()
