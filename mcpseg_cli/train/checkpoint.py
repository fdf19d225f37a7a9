"""Training that can go on after an interruption: all that changes, in one safetensors file."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, JsonValue, ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from mcpseg_cli.errors import StateError, naming
from mcpseg_cli.train.objective import Scores

_METADATA = "mcpseg-checkpoint"
_FORMAT = 1
_NETWORK, _BEST, _OPTIMISER, _SUMS = "network.", "best.", "optimiser.", "sums"


class EpochReport(BaseModel):
    """One epoch.

    Attributes:
        epoch: Its number, from 1.
        learning_rate: At its end.
        seconds: What this process spent on it, validation included.
        train: Means over its batches, as the parameters changed.
        validation: On the held-out data after it; None where none was due.
    """

    model_config = ConfigDict(frozen=True)

    epoch: int
    learning_rate: float
    seconds: float
    train: Scores
    validation: Scores | None


@dataclass(frozen=True)
class TrainState:
    """All that changes while training.

    Attributes:
        step: Steps done of the epoch after those in ``curves``.
        curves: Report of every epoch done.
        best: Epoch of the best weights, from 1; 0: none yet.
        network: Parameters.
        best_network: Parameters after the best epoch; empty where ``best`` is 0.
        optimiser: Moments and step count, by number of the parameter and name.
        sums: Tally of the epoch at hand.
    """

    step: int
    curves: tuple[EpochReport, ...]
    best: int
    network: dict[str, Tensor]
    best_network: dict[str, Tensor]
    optimiser: dict[str, Tensor]
    sums: Tensor


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
    groups = {_NETWORK: state.network, _BEST: state.best_network, _OPTIMISER: state.optimiser, _SUMS: {"": state.sums}}
    tensors = {
        prefix + name: tensor.detach().cpu().contiguous()
        for prefix, group in groups.items()
        for name, tensor in group.items()
    }
    description = _Description(
        format=_FORMAT, identity=dict(identity), step=state.step, curves=state.curves, best=state.best
    )
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
            description = _Description.model_validate_json((file.metadata() or {}).get(_METADATA, ""))
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, ValidationError) as error:
        raise StateError(
            f"{path}: not a checkpoint of this version, or damaged; expected one that was not finished; "
            "give --overwrite to start anew"
        ) from error
    check_identity(path, description.identity, identity)
    groups = {
        prefix: {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}
        for prefix in (_NETWORK, _BEST, _OPTIMISER)
    }
    return TrainState(
        description.step, description.curves, description.best,
        groups[_NETWORK], groups[_BEST], groups[_OPTIMISER], tensors[_SUMS],
    )  # fmt: skip


def check_identity(path: Path, before: Mapping[str, JsonValue], now: Mapping[str, JsonValue]) -> None:
    """Refuse to continue under other settings or with other data.

    Raises:
        StateError: Names what differs.
    """
    now = json.loads(json.dumps(now))  # tuples as lists, as in the file
    names = list(_differences(before, now))
    if names:
        raise StateError(
            f"{path}: trained with another {', '.join(names)}; expected the same; "
            "choose another -o or --name, or give --overwrite to start anew"
        )


def _differences(before: Mapping[str, JsonValue], now: Mapping[str, JsonValue]) -> Iterator[str]:
    """Name what differs; of settings, one by one."""
    for key in [*now, *(key for key in before if key not in now)]:
        old, new = before.get(key), now.get(key)
        if isinstance(old, dict) and isinstance(new, dict):
            yield from _differences(old, new)
        elif old != new:
            is_long = len(f"{old}{new}") > 60
            yield key.replace("_", " ") if is_long else f"{key.replace('_', ' ')} ({old}, not {new})"
