"""Training that can go on after an interruption: all that changes, in one safetensors file."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from pydantic import BaseModel, ConfigDict, JsonValue, ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from mcpseg_cli.errors import StateError, naming
from mcpseg_cli.resumable import check_identity
from mcpseg_cli.train.progress import EpochReport, TrainState

_METADATA = "mcpseg-checkpoint"
_FORMAT = 1
_NETWORK, _BEST, _OPTIMISER, _SUMS = "network.", "best.", "optimiser.", "sums"


class _Description(BaseModel):
    """The part of a checkpoint that is not tensors."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    format: int
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
        format=_FORMAT,
        identity=dict(identity),
        step=state.step,
        curves=state.curves,
        best=state.best,
    )

    # on the disk before it replaces the one before
    partial = path.with_name(path.name + ".part")
    try:
        with naming(path):
            with partial.open("wb") as file:
                file.write(save(tensors, {_METADATA: description.model_dump_json()}))
                file.flush()
                os.fsync(file.fileno())
            partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


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
            description = _Description.model_validate_json(
                (file.metadata() or {}).get(_METADATA, "")
            )
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, ValidationError) as error:
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
