"""The network that sees the room: all voxels in range are judged anew at every scan."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray

from mcpseg_cli.choices import Precision
from mcpseg_cli.config import EMBEDDING, SegmentSettings
from mcpseg_cli.grid import voxel_of
from mcpseg_cli.incremental.clustering import quantise
from mcpseg_cli.incremental.evidence import Look, compute_affinities
from mcpseg_cli.incremental.growing_map import ROOM_HEIGHT, Observation
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.incremental.window import window_input
from mcpseg_cli.networks.description import resolve_precision
from mcpseg_cli.networks.device import find_device
from mcpseg_cli.networks.sparse import make_levels
from mcpseg_cli.networks.unet import NUM_LEVELS, UNet
from mcpseg_cli.networks.unet_inference import FastUNet
from mcpseg_cli.networks.weights import Weights

_COARSEST = 2 ** (NUM_LEVELS - 1)  # voxels along the edge of the coarsest level's
_SPREAD = (0.8191725134, 0.6710436067, 0.5497004779)  # multiples of these fill a cube evenly
_RIM = 2.0  # metres from the border of the window within which a look is worth less
_LEAST = 0.1  # what a look from the border itself is worth


class RoomNetwork:
    """The sparse U-Net over windows of the map.

    Args:
        weights: Network and class table.
        settings: How far it sees.
        precision: Arithmetic of the dense layers; ``auto`` is bf16 where the processor computes it
            natively.
        device: Where the network runs, as torch names it.

    Raises:
        McpsegError: The device does not exist here.
    """

    def __init__(
        self,
        weights: Weights,
        settings: SegmentSettings,
        *,
        precision: Precision = "auto",
        device: str = "cpu",
    ) -> None:
        network = weights.network
        assert isinstance(network, UNet)
        self.weights = weights
        self.settings = settings
        self.precision = resolve_precision(precision, device)
        self._device = find_device(device)
        self._network = FastUNet(network, self.precision, self._device)

    def looks_at(
        self, voxels: VoxelMap, observed: Observation, position: NDArray[np.float64]
    ) -> NDArray[np.int32]:
        """List the voxels to judge at a scan: all in range of the robot, and all that it saw."""
        around = voxels.near(position, self.settings.local_range, ROOM_HEIGHT)
        seen = np.concatenate([observed.seen_again, observed.new])
        is_high = np.abs(voxels.xyz[seen, 2] - position[2]) > ROOM_HEIGHT - voxels.voxel_size
        return np.union1d(around, seen[is_high]) if is_high.any() else around

    @torch.inference_mode()
    def look(
        self,
        voxels: VoxelMap,
        ids: NDArray[np.int32],
        looks: NDArray[np.uint16],
        position: NDArray[np.float64],
        floor: float,
        number: int,
        rng: np.random.Generator,
    ) -> tuple[Look, NDArray[np.int16]]:
        """Judge voxels, each with all others as context; nothing is random.

        Where the coarser levels begin is arbitrary, and changes what the network says: at every
        scan they begin elsewhere, so that the evidence of many looks is about the room alone.

        Args:
            voxels: The map.
            ids: (M,) int32 voxels, ascending: the window.
            looks: (M,) uint16 how many scans saw each.
            position: (3,) float64 robot position, metres, map frame.
            floor: Height of the floor, metres, map frame.
            number: Of the scan, from 0.
            rng: Not used.

        Returns:
            What the network says, and (M, E) int16 what neighbours are compared by.
        """
        # the window in the order of its voxels, so that neighbours are near in memory
        xyz, voxel = voxels.xyz[ids], voxel_of(voxels.xyz[ids], voxels.voxel_size)
        order = np.lexsort(voxel.T[::-1])
        ids, xyz, voxel = ids[order], xyz[order], voxel[order]
        origin = voxel_of(position[None].astype(np.float32), voxels.voxel_size)
        start = (origin & -_COARSEST) - begin_of_levels(number)
        levels = make_levels(voxel - start.astype(np.int32), NUM_LEVELS)

        # what each is, and whom it belongs with
        neighbours = levels[0].neighbours.numpy()
        inputs = window_input(
            xyz,
            voxels.rgb[ids],
            looks[order],
            voxel,
            neighbours,
            voxel_size=voxels.voxel_size,
            floor=floor,
        )
        levels = [level.to(self._device) for level in levels]
        output = self._network(torch.from_numpy(inputs).to(self._device), levels)
        scaled = (output.logits / self.weights.info.temperature).T.contiguous()
        probability = torch.softmax(scaled, dim=0).T  # over rows it takes six times as long
        unit = output.embedding.cpu().numpy()
        affinity = compute_affinities(unit, neighbours, *self._network.affine)

        embedding = np.zeros((len(ids), EMBEDDING), np.int16)
        embedding[:, : unit.shape[1]] = quantise(unit)
        weight = self._weigh(xyz, position)
        return Look(ids, probability.contiguous().cpu().numpy(), weight, affinity), embedding

    def _weigh(
        self, xyz: NDArray[np.float32], position: NDArray[np.float64]
    ) -> NDArray[np.float32]:
        """Give (M,) float32 what a look is worth: less at the rim of what is seen."""
        offset = xyz[:, :2] - position[:2].astype(np.float32)
        away = np.sqrt(np.einsum("na,na->n", offset, offset))
        inside = (np.float32(self.settings.local_range) - away) / np.float32(_RIM)
        weight: NDArray[np.float32] = np.clip(inside, _LEAST, 1).astype(np.float32)
        return weight


def begin_of_levels(number: int) -> NDArray[np.int64]:
    """Give (3,) int64 by how many voxels the coarser levels begin off the map's origin at a scan.

    An additive recurrence (Roberts, 2018): few scans in a row have offsets all over the cube.
    """
    place = (0.5 + number * np.array(_SPREAD)) % 1
    offset: NDArray[np.int64] = np.floor(_COARSEST * place).astype(np.int64)
    return offset
