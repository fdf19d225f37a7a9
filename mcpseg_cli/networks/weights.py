"""Weights files: safetensors that carry architecture, class table, context and training facts."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save
from torch import Tensor

from mcpseg_cli.choices import Architecture, StoredAs
from mcpseg_cli.errors import WeightsError
from mcpseg_cli.networks.description import (
    METADATA,
    DescribedWeights,
    WeightsInfo,
    describe_weights,
)
from mcpseg_cli.networks.mcpnet import MCPNet, MCPNetNoContext
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.pointnet import PointNet
from mcpseg_cli.networks.pointnet2 import PointNet2
from mcpseg_cli.networks.sgpn import SGPN
from mcpseg_cli.networks.unet import UNet
from mcpseg_cli.networks.voxnet import VoxNet
from mcpseg_cli.resumable import write_whole

NETWORKS: dict[Architecture, type[Network]] = {
    "unet": UNet,
    "mcpnet": MCPNet,
    "mcpnet-nocontext": MCPNetNoContext,
    "pointnet": PointNet,
    "pointnet2": PointNet2,
    "sgpn": SGPN,
    "voxnet": VoxNet,
}
"""Class of each network; ``description.TRAITS`` says what there is to know before one is built."""


@dataclass(frozen=True)
class Weights:
    """A network ready for inference, and what its file says about it.

    Attributes:
        network: On the CPU, float32, in evaluation mode.
        info: Architecture, classes, context.
        sha256: Hash of the file, hex.
        name: File name without its ending.
    """

    network: Network
    info: WeightsInfo
    sha256: str
    name: str


def load_weights(path: Path) -> Weights:
    """Read a weights file; nothing in it is executed or unpickled.

    Args:
        path: A .safetensors file written by ``save_weights``.

    Returns:
        The network in evaluation mode.

    Raises:
        WeightsError: Damaged, not mcpseg's, or tensors that do not fit the architecture.
        OSError: The file cannot be opened.
    """
    return load_described(describe_weights(path))


def load_described(described: DescribedWeights) -> Weights:
    """Read the tensors of a weights file of which the description was read, see ``load_weights``.

    Raises:
        WeightsError: Damaged, or changed since.
    """
    path = described.path
    data = path.read_bytes()
    if hashlib.sha256(data).hexdigest() != described.sha256:
        found, remedy = "changed while it was read", "run the same command again"
        raise WeightsError(path, found, "a file that stays as it is", remedy)
    try:
        tensors = load(data)
    except (SafetensorError, ValueError, KeyError) as error:
        found = f"not readable ({str(error).strip()[:80]})"
        raise WeightsError(path, found, "a safetensors file", "copy it again") from error

    network = build_network(described.info)
    try:
        network.load_state_dict(tensors)
    except RuntimeError as error:
        found = str(error).splitlines()[-1].strip()
        expected = f"the tensors of {described.info.architecture}"
        remedy = "copy the file again, or use weights of this network"
        raise WeightsError(path, found, expected, remedy) from error

    if not all(bool(torch.isfinite(tensor).all()) for tensor in tensors.values()):
        found, remedy = "NaN or infinite parameters", "use a checkpoint from before they broke"
        raise WeightsError(path, found, "finite numbers", remedy)
    return Weights(network.eval(), described.info, described.sha256, described.name)


def save_weights(
    path: Path, network: Network, info: WeightsInfo, stored_as: StoredAs = "fp32"
) -> None:
    """Write a network with its description; the file appears under its name only when complete.

    Args:
        path: Where; replaced if there.
        network: Its parameters.
        info: What they are.
        stored_as: Numbers to write matrices in.

    Raises:
        WeightsError: A matrix has numbers too large for ``fp16``.
    """
    tensors = {
        name: _rounded(tensor, stored_as).cpu().contiguous()
        for name, tensor in network.state_dict().items()
    }
    for name, tensor in tensors.items():
        if not bool(torch.isfinite(tensor).all()):
            found, expected = f"{name} beyond the numbers of {stored_as}", "finite numbers"
            raise WeightsError(path, found, expected, "store them as fp32")
    description = json.dumps(info.model_dump(mode="json"), sort_keys=True)
    write_whole(path, save(tensors, {METADATA: description}))


def _rounded(tensor: Tensor, stored_as: StoredAs) -> Tensor:
    """Round a matrix to the numbers of a file; the few numbers of biases and norms stay float32."""
    is_half = stored_as == "fp16" and tensor.ndim > 1
    return tensor.detach().to(torch.float16 if is_half else torch.float32)


def rounded_network(network: Network, info: WeightsInfo, stored_as: StoredAs) -> Network:
    """Return the network as it will be read from a file, with parameters in float32."""
    rounded = build_network(info)
    rounded.load_state_dict(
        {name: _rounded(tensor, stored_as) for name, tensor in network.state_dict().items()}
    )
    return rounded.eval()


def build_network(info: WeightsInfo) -> Network:
    """Build the network that ``info`` describes, with fresh parameters from torch's generator."""
    return NETWORKS[info.architecture](len(info.classes))
