"""TensorFlow checkpoints (TensorBundle files) without TensorFlow; the authors' weights in them.

The index is an uncompressed LevelDB table whose values are BundleEntry protocol buffers; the data
file holds raw little-endian tensors. Sources: LevelDB doc/table_format.md; TensorFlow
core/protobuf/tensor_bundle.proto.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from mcpseg_cli.choices import Architecture
from mcpseg_cli.classes import MCPNET_CLASSES
from mcpseg_cli.config import HIDDEN, NUM_FEATURES
from mcpseg_cli.errors import WeightsError
from mcpseg_cli.networks.description import WeightsInfo
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.weights import build_network

_FOOTER_SIZE = 48
_MAGIC = 0xDB4775248B80FB57
_FLOAT32 = 1  # DT_FLOAT
_MCPNET = {1: "context_1", 2: "context_2", 3: "features", 4: "embed", 5: "hidden", 6: "classify"}
_LAYERS: dict[Architecture, dict[int, str]] = {
    "mcpnet": _MCPNET,
    "mcpnet-nocontext": {number: _MCPNET[number] for number in (3, 4, 5, 6)},
    "voxnet": {1: "convolve_1", 2: "convolve_2", 3: "hidden", 4: "classify"},
}
_OTHERS = (
    "import a checkpoint of MCPNet or VoxNet (the authors' other baselines are wider than ours)"
)


@dataclass
class _Entry:
    """Where one tensor lies in the data file."""

    dtype: int = 0
    shape: list[int] = field(default_factory=list)
    shard: int = 0
    offset: int = 0
    size: int = 0


def import_checkpoint(prefix: Path) -> tuple[Network, WeightsInfo]:
    """Read the authors' TensorFlow weights of MCPNet, with or without context layers, or of VoxNet.

    Args:
        prefix: The checkpoint's name; ``prefix.index`` and ``prefix.data-00000-of-00001`` are read.

    Returns:
        The network and its description: the authors' class order and coarse context cells.

    Raises:
        WeightsError: Damaged files, or variables that are not those networks'.
    """
    # which network
    tensors = read_tensor_bundle(prefix)
    kernels = {name: _as_torch(tensors[name]) for name in tensors if name.startswith("kernel")}
    info = WeightsInfo(
        architecture=_architecture(kernels),
        classes=MCPNET_CLASSES,
        context_window="coarse",
        training={"source": f"imported from the TensorFlow checkpoint {prefix.name}"},
    )
    network = build_network(info)

    # layer by layer
    state = {}
    for number, name in _LAYERS[info.architecture].items():
        kernel, bias = kernels.get(f"kernel{number}"), tensors.get(f"bias{number}")
        shape = tuple(network.get_parameter(f"{name}.weight").shape)
        if kernel is None or bias is None or (kernel.shape, bias.shape) != (shape, shape[:1]):
            found = f"kernel{number} {'missing' if kernel is None else kernel.shape}"
            owner = "VoxNet" if info.architecture == "voxnet" else "MCPNet"
            raise WeightsError(prefix, found, f"{shape} with its bias, as {owner} has", _OTHERS)
        state[f"{name}.weight"], state[f"{name}.bias"] = map(torch.from_numpy, (kernel, bias))
    network.load_state_dict(state)
    return network.eval(), info


def _as_torch(kernel: NDArray[np.float32]) -> NDArray[np.float32]:
    """Put outputs first, then inputs; a convolution over single points is a linear layer."""
    if kernel.ndim == 3 and len(kernel) == 1:
        kernel = kernel[0]
    if kernel.ndim < 2:
        return kernel
    return np.ascontiguousarray(kernel.transpose(-1, -2, *range(kernel.ndim - 2)))


def _architecture(kernels: dict[str, NDArray[np.float32]]) -> Architecture:
    """Tell the authors' networks apart by their variables."""
    shapes = {name: kernel.shape for name, kernel in kernels.items()}
    if len(shapes.get("kernel1", ())) == 5:
        return "voxnet"
    return "mcpnet-nocontext" if shapes.get("kernel3") == (HIDDEN, NUM_FEATURES) else "mcpnet"


def read_tensor_bundle(prefix: Path) -> dict[str, NDArray[np.float32]]:
    """Read every float32 variable of a checkpoint; optimizer slots and other types are left.

    Args:
        prefix: The checkpoint's name without ``.index``.

    Returns:
        Array by variable name.

    Raises:
        WeightsError: A file is missing, damaged or not a TensorBundle.
    """
    index, data = (path.read_bytes() for path in _bundle_files(prefix))
    tensors = {}
    try:
        for name, value in _table(index):
            entry = _entry(value)
            if name and "/" not in name and entry.dtype == _FLOAT32:
                tensors[name] = _tensor(name, entry, data)
    except (ValueError, IndexError, struct.error) as error:
        raise WeightsError(
            prefix, f"damaged ({error})", "a TensorFlow checkpoint", "copy both files again"
        ) from error
    return tensors


def _bundle_files(prefix: Path) -> tuple[Path, Path]:
    """Return the paths of index and data; both are there."""
    if not prefix.name:
        remedy = "give the name before .index"
        raise WeightsError(str(prefix), "a folder", "a checkpoint's name", remedy)
    index = prefix.with_name(f"{prefix.name}.index")
    data = prefix.with_name(f"{prefix.name}.data-00000-of-00001")

    for path in (index, data):
        if not path.is_file():
            both = f"{index.name} and {data.name}"
            raise WeightsError(prefix, f"no {path.name}", both, "give the name they share")
    return index, data


def _tensor(name: str, entry: _Entry, data: bytes) -> NDArray[np.float32]:
    """Copy a tensor out of the data file."""
    count = int(np.prod(entry.shape, dtype=np.int64))
    if entry.shard or entry.size != 4 * count or entry.offset + entry.size > len(data):
        raise ValueError(f"{name}: {entry.size} bytes at {entry.offset}, file of {len(data)}")
    values = np.frombuffer(data, "<f4", count, entry.offset)
    return values.reshape(entry.shape).astype(np.float32)


def _varint(data: bytes, position: int) -> tuple[int, int]:
    """Decode a base-128 number; return it and the position after it."""
    value = shift = 0
    while True:
        byte = data[position]
        value |= (byte & 0x7F) << shift
        position, shift = position + 1, shift + 7
        if byte < 0x80:
            return value, position
        if shift > 63:
            raise ValueError("number too long")


def _table(index: bytes) -> Iterator[tuple[str, bytes]]:
    """Iterate over the keys and values of a LevelDB table."""
    footer = index[-_FOOTER_SIZE:]
    if len(footer) < _FOOTER_SIZE or struct.unpack("<Q", footer[-8:])[0] != _MAGIC:
        raise ValueError("no table footer")
    position = 0
    for _ in range(2):  # skip the handle of the meta index
        _, position = _varint(footer, position)
    for _, handle in _block(index, footer[position:]):
        for key, value in _block(index, handle):
            yield key.decode("latin-1"), value


def _block(index: bytes, handle: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Iterate over one block; each key shares a prefix with the one before."""
    offset, position = _varint(handle, 0)
    size, _ = _varint(handle, position)
    block, kind = index[offset : offset + size], index[offset + size]
    if kind != 0 or len(block) != size:
        raise ValueError("a compressed or cut block")

    # entries, then the restart points and their number
    end = size - 4 - 4 * struct.unpack("<I", block[-4:])[0]
    position, key = 0, b""
    while position < end:
        shared, position = _varint(block, position)
        unshared, position = _varint(block, position)
        length, position = _varint(block, position)
        key = key[:shared] + block[position : position + unshared]
        position += unshared

        yield key, block[position : position + length]
        position += length


def _fields(message: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Iterate over the fields of a protocol buffer: number, and value or bytes."""
    position = 0
    while position < len(message):
        tag, position = _varint(message, position)
        number, wire = tag >> 3, tag & 7

        # numbers, bytes; 32-bit values are passed over
        if wire == 0:
            value, position = _varint(message, position)
            yield number, value
        elif wire == 2:
            length, position = _varint(message, position)
            yield number, message[position : position + length]
            position += length
        elif wire == 5:
            position += 4
        else:
            raise ValueError(f"field type {wire}")


def _entry(message: bytes) -> _Entry:
    """Decode a BundleEntry: 1 dtype, 2 shape, 3 shard, 4 offset, 5 size."""
    entry = _Entry()
    for number, value in _fields(message):
        match number, value:
            case 1, int():
                entry.dtype = value
            case 2, bytes():
                parts = [part for _, part in _fields(value) if isinstance(part, bytes)]
                entry.shape = [_dimension(part) for part in parts]
            case 3, int():
                entry.shard = value
            case 4, int():
                entry.offset = value
            case 5, int():
                entry.size = value
    return entry


def _dimension(message: bytes) -> int:
    sizes = [value for number, value in _fields(message) if number == 1 and isinstance(value, int)]
    return sizes[0] if sizes else 0
