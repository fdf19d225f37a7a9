"""Weights files: safetensors that carry architecture, class table, context and training facts."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import torch
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from mcpseg_cli.choices import Architecture, ContextWindow, StoredAs
from mcpseg_cli.classes import MOST_CLASSES, TABLE_EXPECTED, table_problem
from mcpseg_cli.config import NUM_CONTEXT
from mcpseg_cli.errors import WeightsError
from mcpseg_cli.networks.mcpnet import MCPNet, MCPNetNoContext
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.pointnet import PointNet
from mcpseg_cli.networks.pointnet2 import PointNet2
from mcpseg_cli.networks.sgpn import SGPN
from mcpseg_cli.networks.unet import UNet
from mcpseg_cli.networks.voxnet import VoxNet
from mcpseg_cli.resumable import write_whole

DEFAULT_WEIGHTS = "unet"
NETWORKS: dict[Architecture, type[Network]] = {
    "unet": UNet,
    "mcpnet": MCPNet,
    "mcpnet-nocontext": MCPNetNoContext,
    "pointnet": PointNet,
    "pointnet2": PointNet2,
    "sgpn": SGPN,
    "voxnet": VoxNet,
}
"""Class of each network; its attributes say what there is to know before one is built."""
_METADATA = "mcpseg"


class WeightsInfo(BaseModel):
    """What weights say about themselves.

    Attributes:
        architecture: Which network they are for.
        classes: Class table: what the logits mean.
        context_window: Where the context points they were trained with came from.
        num_context: M, context points per point.
        temperature: What logits are divided by, so that confidence is the share that is right.
        notice: A warning to show whenever they are used; empty for weights meant for use.
        training: Facts for the reader: data, epochs, scores, source.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    architecture: Architecture
    classes: tuple[str, ...] = Field(min_length=2, max_length=MOST_CLASSES)
    context_window: ContextWindow = "cells"
    num_context: int = Field(default=NUM_CONTEXT, ge=1, le=1024)
    temperature: float = Field(default=1.0, gt=0.0, le=100.0)
    notice: str = ""
    training: dict[str, str | int | float] = {}

    @field_validator("classes")
    @classmethod
    def _check_classes(cls, classes: tuple[str, ...]) -> tuple[str, ...]:
        """Refuse names that would break the headers of clouds."""
        if problem := table_problem(classes):
            raise ValueError(f"{problem}; expected {TABLE_EXPECTED}")
        return classes


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


def find_weights(name_or_path: str) -> Path:
    """Find a weights file: a path, or the name of bundled weights.

    Raises:
        WeightsError: Neither.
    """
    path = Path(name_or_path)
    if path.suffix == ".safetensors" or path.is_file():
        return path

    # a wheel has the bundled weights inside, a checkout beside the package
    package = Path(__file__).parents[1]
    folders = [package / "models", package.parent / "models"]
    for folder in folders:
        if (folder / f"{name_or_path}.safetensors").is_file():
            return folder / f"{name_or_path}.safetensors"

    bundled = sorted(file.stem for folder in folders for file in folder.glob("*.safetensors"))
    expected = f"a .safetensors file or one of {', '.join(bundled)}"
    raise WeightsError(name_or_path, "no such weights", expected, "check the name")


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
    sha256 = hashlib.sha256(path.read_bytes()).hexdigest()
    description, tensors = _read_safetensors(path)
    network, info = _make_network(path, description, tensors)

    if not all(bool(torch.isfinite(tensor).all()) for tensor in tensors.values()):
        found, remedy = "NaN or infinite parameters", "use a checkpoint from before they broke"
        raise WeightsError(path, found, "finite numbers", remedy)
    return Weights(network.eval(), info, sha256, path.stem)


def _read_safetensors(path: Path) -> tuple[str, dict[str, Tensor]]:
    """Read mcpseg's description and the tensors."""
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, ValueError) as error:
        found = f"not readable ({str(error).strip()[:80]})"
        remedy = "import TensorFlow checkpoints with 'mcpseg import-weights'"
        raise WeightsError(path, found, "a safetensors file", remedy) from error

    if _METADATA not in metadata:
        found, remedy = "no mcpseg description", "use bundled or imported weights"
        raise WeightsError(path, found, "weights made by mcpseg", remedy)
    return metadata[_METADATA], tensors


def _make_network(
    path: Path, description: str, tensors: dict[str, Tensor]
) -> tuple[Network, WeightsInfo]:
    """Build the network described, with these tensors."""
    try:
        info = WeightsInfo.model_validate_json(description)
    except ValidationError as error:
        problem = error.errors()[0]
        found = f"{'.'.join(map(str, problem['loc']))}: {problem['msg']}"
        expected = "a description this version knows"
        raise WeightsError(path, found, expected, "update mcpseg") from error

    network = build_network(info)
    try:
        network.load_state_dict(tensors)
    except RuntimeError as error:
        found = str(error).splitlines()[-1].strip()
        remedy = "copy the file again, or use weights of this network"
        raise WeightsError(path, found, f"the tensors of {info.architecture}", remedy) from error
    return network, info


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
    write_whole(path, save(tensors, {_METADATA: description}))


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
