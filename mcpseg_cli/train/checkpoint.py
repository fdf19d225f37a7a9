"""Training that can go on after an interruption: all that changes, in one safetensors file."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Final, Literal

import torch
from pydantic import BaseModel, ConfigDict, JsonValue
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from mcpseg_cli.config import AugmentSettings, SampleSettings, TrainSettings, WindowSettings
from mcpseg_cli.errors import StateError
from mcpseg_cli.resumable import check_same, write_whole
from mcpseg_cli.train.progress import EpochReport, TrainState

_METADATA = "mcpseg-checkpoint"
_CHECKSUM = "crc32"
_FORMAT: Final = 2

_TABLES: dict[str, type[BaseModel]] = {
    "windows": WindowSettings,
    "train": TrainSettings,
    "samples": SampleSettings,
    "augment": AugmentSettings,
}
_OPTIONS = {
    "architecture", "epochs", "learning_rate", "schedule", "batch_size", "precision", "seed",
    "num_context", "local_range",
}  # fmt: skip
_NAMES = (
    {
        "classes": "set of classes",
        "class_table": "class table",
        "training_areas": "set of training areas",
        "validation_areas": "set of held-out areas",
        "processes": "number of processes",
    }
    | {
        name: f"[{table}] {name}"
        for table, settings in _TABLES.items()
        for name in settings.model_fields
        if name not in _OPTIONS
    }
    | {"voxel_size": "[samples] or [windows] voxel_size"}
)
"""What is called otherwise than by an option; settings without one by their place in the file."""

_NETWORK, _BEST, _OPTIMISER, _SUMS = "network.", "best.", "optimiser.", "sums"


class _Description(BaseModel):
    """The part of a checkpoint that is not tensors."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: Literal[2] = _FORMAT
    identity: dict[str, JsonValue]
    step: int
    curves: tuple[EpochReport, ...]
    best: int


def write_checkpoint(path: Path, state: TrainState, identity: Mapping[str, JsonValue]) -> None:
    """Write a checkpoint; it replaces the one before only when it is complete and on the disk.

    Args:
        path: Where.
        state: What to continue from.
        identity: What must be the same for that: settings and data.

    Raises:
        OSError: The disk is full or the folder not writable; the checkpoint before stays.
    """
    # every tensor under a name that says what it is
    groups = {
        _NETWORK: state.network,
        _BEST: state.best_network,
        _OPTIMISER: state.optimiser,
        _SUMS: {"": state.sums},
    }
    tensors = {
        prefix + name: tensor.detach().cpu().contiguous()
        for prefix, group in groups.items()
        for name, tensor in group.items()
    }
    description = _Description(
        identity=dict(identity),
        step=state.step,
        curves=state.curves,
        best=state.best,
    )
    text = description.model_dump_json()
    data = save(tensors, {_METADATA: text, _CHECKSUM: str(_checksum(text, tensors))})
    write_whole(path, data, is_durable=True)


def read_checkpoint(path: Path, identity: Mapping[str, JsonValue]) -> TrainState:
    """Read a checkpoint; nothing in it is executed or unpickled.

    Args:
        path: The file.
        identity: What it must have been made with.

    Raises:
        StateError: Damaged, or made with other settings or data.
        OSError: The file cannot be opened.
    """
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            text = metadata.get(_METADATA, "")
            description = _Description.model_validate_json(text)
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
        if metadata.get(_CHECKSUM) != str(_checksum(text, tensors)):
            raise ValueError("content that differs from its checksum")
    except (SafetensorError, ValueError, TypeError) as error:
        raise StateError(
            f"{path}: not a checkpoint of this version, or damaged; "
            "expected one that was not finished; give --overwrite to start anew"
        ) from error
    check_identity(path, description.identity, identity)

    # tensors by what they are
    groups = {
        prefix: {
            name.removeprefix(prefix): tensor
            for name, tensor in tensors.items()
            if name.startswith(prefix)
        }
        for prefix in (_NETWORK, _BEST, _OPTIMISER)
    }
    return TrainState(
        description.step, description.curves, description.best,
        groups[_NETWORK], groups[_BEST], groups[_OPTIMISER], tensors[_SUMS],
    )  # fmt: skip


def _checksum(text: str, tensors: Mapping[str, Tensor]) -> int:
    """Return the CRC-32 of a description, and of name, type, shape and values of every tensor."""
    checksum = zlib.crc32(text.encode())
    for name, tensor in sorted(tensors.items()):
        head = f"{name} {tensor.dtype} {tuple(tensor.shape)}"
        values = tensor.contiguous().reshape(-1).view(torch.uint8).numpy()
        checksum = zlib.crc32(values.data, zlib.crc32(head.encode(), checksum))
    return checksum


def check_identity(
    path: Path, kept: Mapping[str, JsonValue], asked: Mapping[str, JsonValue]
) -> None:
    """Refuse to continue a training under other settings or with other data.

    Args:
        path: Its checkpoint or record.
        kept: What it was made with.
        asked: What is asked for now.

    Raises:
        StateError: Names what differs.
    """
    remedy = "choose another -o or --name, or give --overwrite to start anew"
    check_same(path, kept, asked, remedy=remedy, names=_NAMES)
