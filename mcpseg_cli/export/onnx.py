"""Networks as ONNX, checked against PyTorch before the file is kept."""

from __future__ import annotations

import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor, nn

from mcpseg_cli import __version__
from mcpseg_cli.config import NUM_FEATURES
from mcpseg_cli.errors import OutputError
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.weights import Weights
from mcpseg_cli.resumable import write_whole

if TYPE_CHECKING:
    import onnx

_UNSUPPORTED = {
    "pointnet2": "chooses points in a loop over the batch",  # ONNX would fix it at one size
    "unet": "is given tables of a window's voxels, which change from window to window",
}
_OPSET = 18
_TOLERANCE = 1e-4  # of embeddings, which are of unit length, and of logits relative to their range
_CHECKED_BATCHES = (1, 37, 256)  # points; other than the size the graph was traced with
_TRACED_BATCH = 64
_SCOPE = (
    "The network pools over all N points of a call (dimension 0 of every input): what it says "
    "about a point depends on the others. Call it with one batch of points around one robot "
    "position at a time, batch_size of them as in training; fill the last batch up by repeating "
    "points. Never join batches of different places into one call."
)


def write_onnx(weights: Weights, path: Path) -> float:
    """Write a network as an ONNX model of any number of points, and compare it with PyTorch.

    Inputs are ``centre`` (N, 6) and, for a network with context, ``context`` (N, K, 6), as
    ``context.network_input`` and ``context.context_input`` make them; outputs are ``embedding`` (N,
    E), for a network that has one, and ``logits`` (N, C). The model's metadata tell class table,
    architecture, batch size, context and scope of pooling.

    Args:
        weights: Network and class table.
        path: The file; replaced if there.

    Returns:
        The largest difference from PyTorch that onnxruntime shows, of any output.

    Raises:
        OutputError: onnx, onnxscript or onnxruntime is not installed, or the network cannot be
            written so.
        OSError: The disk is full or the folder not writable; nothing is left under ``path``'s name.
    """
    # what cannot be done
    architecture = weights.info.architecture
    if architecture in _UNSUPPORTED:
        raise OutputError(
            f"{path}: {architecture} {_UNSUPPORTED[architecture]}; "
            "expected a network of fixed steps; export another architecture"
        )
    try:
        import onnx
        import onnxruntime  # noqa: F401
        import onnxscript  # noqa: F401
    except ModuleNotFoundError as error:
        raise OutputError(
            f"{path}: needs {error.name}; expected it installed; pip install 'mcpseg[onnx]'"
        ) from error

    # the graph, with what its users have to know
    network = weights.network.eval().float()
    model = _trace(network, weights.info.num_context)
    for key, value in _metadata(weights).items():
        model.metadata_props.append(onnx.StringStringEntryProto(key=key, value=value))
    onnx.checker.check_model(model, full_check=True)

    # kept only if it computes the same
    data = model.SerializeToString()
    difference = _difference(network, data, weights.info.num_context)
    if not difference < _TOLERANCE:
        raise OutputError(
            f"{path}: differs from PyTorch by {difference:.2g}; expected less than {_TOLERANCE}; "
            "report it"
        )
    write_whole(path, data)
    return difference


class _Outputs(nn.Module):
    """A network whose outputs are only those it has."""

    def __init__(self, network: Network) -> None:
        super().__init__()
        self.network = network

    def forward(self, centre: Tensor, context: Tensor | None = None) -> tuple[Tensor, ...]:
        embedding, logits = self.network(centre, context)
        return (logits,) if embedding is None else (embedding, logits)


def _trace(network: Network, num_context: int) -> onnx.ModelProto:
    """Turn a network into an ONNX graph whose number of points is free."""
    # an example whose first dimension may be any
    example = _example(network, _TRACED_BATCH, num_context)
    shapes = tuple({0: torch.export.Dim("points")} for _ in example)

    with _silence(), torch.inference_mode():
        program = torch.onnx.export(
            _Outputs(network).eval(),
            example,
            dynamo=True,
            dynamic_shapes=shapes,
            opset_version=_OPSET,
            input_names=["centre", "context"][: len(example)],
            output_names=["embedding", "logits"] if network.traits.has_embedding else ["logits"],
            verbose=False,
        )
    if program is None:
        raise RuntimeError("torch.onnx.export returned nothing")
    return program.model_proto


@contextmanager
def _silence() -> Iterator[None]:
    """Keep PyTorch from telling of libraries that are not needed here."""
    logger = logging.getLogger("torch.onnx")
    level = logger.level
    logger.setLevel(logging.ERROR)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        logger.setLevel(level)


def _example(network: Network, num_points: int, num_context: int) -> tuple[Tensor, ...]:
    """Make random points like those around a robot."""
    rng = np.random.default_rng(num_points)
    centre = torch.from_numpy(rng.normal(0, 0.5, (num_points, NUM_FEATURES)).astype(np.float32))
    shape = (num_points, num_context, NUM_FEATURES)
    context = torch.from_numpy(rng.normal(0, 0.2, shape).astype(np.float32))
    return (centre, context) if network.traits.needs_context else (centre,)


def _metadata(weights: Weights) -> dict[str, str]:
    """Collect what a user of the model has to know, as text by name."""
    info, network = weights.info, weights.network
    known: dict[str, object] = {
        "producer": f"mcpseg {__version__}",
        "weights": weights.name,
        "weights_sha256": weights.sha256,
        "architecture": info.architecture,
        "classes": json.dumps(list(info.classes)),
        "batch_size": network.traits.batch_size,
        "similarity": network.traits.similarity,
        "pooling_scope": _SCOPE,
        "centre": "x and y from the robot, z from the floor (metres), red green blue / 255 - 0.5",
    }

    # what the context is, for a network that has one
    if network.traits.needs_context:
        known |= {
            "context": "context points minus their centre point, "
            "position (metres) and colour / 255",
            "num_context": info.num_context,
            "context_window": info.context_window,
        }
    return {key: str(value) for key, value in known.items()}


def _difference(network: Network, model: bytes, num_context: int) -> float:
    """Run both on batches of several sizes; return the largest difference.

    That of embeddings as it is, that of logits relative to their range.
    """
    import onnxruntime

    session = onnxruntime.InferenceSession(model, providers=["CPUExecutionProvider"])
    names = [item.name for item in session.get_inputs()]
    largest = 0.0
    for num_points in _CHECKED_BATCHES:
        inputs = _example(network, num_points, num_context)
        named = {name: value.numpy() for name, value in zip(names, inputs, strict=True)}
        found = session.run(None, named)
        with torch.inference_mode():
            expected = _Outputs(network)(*inputs)

        # embeddings are of unit length, so their scale is 1
        for have, want in zip(found, expected, strict=True):
            scale = max(1.0, float(want.abs().max()))
            largest = max(largest, float(np.abs(have - want.numpy()).max()) / scale)
    return largest
