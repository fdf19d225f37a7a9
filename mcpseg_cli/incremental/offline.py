"""Label a complete cloud at once, block by block: the offline methods of tables I and II.

The authors' program divides the cloud into columns of a metre by a metre, runs the network on each
as if the robot stood in its middle, then clusters once.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.config import EMBEDDING, OFFLINE_BLOCK
from mcpseg_cli.incremental.floor import find_floor
from mcpseg_cli.incremental.map_labels import AllLooks
from mcpseg_cli.incremental.map_objects import make_objects
from mcpseg_cli.incremental.map_rows import MapRows
from mcpseg_cli.incremental.methods import AnyMethod, make_labels
from mcpseg_cli.incremental.network_method import NetworkMethod
from mcpseg_cli.incremental.voxel_map import VoxelMap


def label_cloud(
    voxel_map: VoxelMap, positions: NDArray[np.float64], method: AnyMethod
) -> tuple[MapRows, float]:
    """Label all voxels of a map, each as its block sees it, and cluster them once.

    A network that sees the room sees all of them at once.

    Args:
        voxel_map: The complete cloud, one point a voxel; at least one.
        positions: (S, 3) float64 where the scans were taken, metres, map frame; the nearest gives a
            block its height.
        method: What labels.

    Returns:
        The map's rows, labels final, and the height of the floor under the last block, metres, map
        frame.
    """
    if isinstance(method, NetworkMethod) and method.sees_windows:
        return _label_in_one_look(voxel_map, positions, method)
    num_voxels, settings = len(voxel_map), method.settings
    semantic, confidence = np.empty(num_voxels, np.uint8), np.empty(num_voxels, np.float32)
    embedding = np.empty((num_voxels, EMBEDDING), np.int16)
    floor: float | None = None

    # each block as if the robot stood in its middle
    for number, (middle, ids) in enumerate(split_blocks(voxel_map.xyz, OFFLINE_BLOCK)):
        position = np.array([*middle, nearest_height(positions, middle)])
        floor = find_floor(settings.floor, voxel_map, position, voxel_map.xyz[ids], floor)
        rng = np.random.default_rng((settings.seed, number))
        found = method.classify(voxel_map, ids, position, floor, rng)
        semantic[ids], confidence[ids] = found.semantic, found.confidence
        embedding[ids] = found.embedding

    # one clustering of everything
    labels = make_labels(method)
    labels.append(semantic, confidence)
    objects = make_objects(method, labels)
    objects.put_all_together(voxel_map, embedding)
    rows = MapRows(voxel_map.xyz, voxel_map.rgb, semantic, confidence, objects.instance, embedding)
    return rows, floor or 0.0


def _label_in_one_look(
    voxel_map: VoxelMap, positions: NDArray[np.float64], method: NetworkMethod
) -> tuple[MapRows, float]:
    """Label all voxels as one room; see ``label_cloud``."""
    everything = np.arange(len(voxel_map), dtype=np.int32)
    settings, position = method.settings, positions[0]
    floor = find_floor(settings.floor, voxel_map, position, voxel_map.xyz, None)

    # one look at each voxel, worth the same everywhere
    labels = make_labels(method)
    assert isinstance(labels, AllLooks)
    embedding = labels.judge_complete(voxel_map, position, floor)
    objects = make_objects(method, labels)
    objects.put_all_together(voxel_map, embedding)
    labels.decide(everything, objects.class_shares(everything))
    rows = MapRows(
        voxel_map.xyz, voxel_map.rgb, labels.semantic, labels.confidence, objects.instance,
        embedding,
    )  # fmt: skip
    return rows, floor or 0.0


def nearest_height(positions: NDArray[np.float64], middle: NDArray[np.float64]) -> float:
    """Return the z of the position nearest to a place, metres.

    Args:
        positions: (S, 3) float64, metres; at least one.
        middle: (2,) float64 x and y, metres.
    """
    return float(positions[np.argmin(np.sum((positions[:, :2] - middle) ** 2, axis=1)), 2])


def split_blocks(
    xyz: NDArray[np.float32], edge: float
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.int32]]]:
    """Divide points into upright columns on a grid.

    Args:
        xyz: (V, 3) float32, metres.
        edge: Width and depth of a column, metres.

    Yields:
        (2,) float64 x and y of each column's middle, metres, and (M,) int32 its points, ascending.
    """
    block = np.floor(xyz[:, :2].astype(np.float64) / edge).astype(np.int64)
    order = np.lexsort((block[:, 1], block[:, 0]))
    changes = np.flatnonzero((np.diff(block[order], axis=0) != 0).any(axis=1)) + 1
    for ids in np.split(order, changes) if len(order) else []:
        yield (block[ids[0]] + 0.5) * edge, ids.astype(np.int32)
