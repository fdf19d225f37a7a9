"""Training that starts from other weights, for the same classes or others."""

import torch
from torch import nn

from mcpseg_cli.errors import WeightsError
from mcpseg_cli.networks.description import WeightsInfo
from mcpseg_cli.networks.network import Network
from mcpseg_cli.networks.weights import Weights


def adopt(network: Network, info: WeightsInfo, weights: Weights) -> list[str]:
    """Copy parameters into a network; of the class head, those of classes that both know.

    Args:
        network: Fresh; changed in place. The head's rows for new classes stay as they are.
        info: What it is.
        weights: To start from.

    Returns:
        The classes that start afresh.

    Raises:
        WeightsError: The weights are of another network.
    """
    if weights.info.architecture != info.architecture:
        remedy = f"choose other weights, or --net {weights.info.architecture}"
        raise WeightsError(
            f"--weights {weights.name}", weights.info.architecture, info.architecture, remedy
        )

    # all but the class head as it is, of that what both class tables name
    head, known = _class_head(network), _class_head(weights.network)
    rows = [
        (info.classes.index(name), row)
        for row, name in enumerate(weights.info.classes)
        if name in info.classes
    ]
    with torch.no_grad():
        for tensor, other in zip(network.parameters(), weights.network.parameters(), strict=True):
            if tensor is not head.weight and tensor is not head.bias:
                tensor.copy_(other)
        for row, theirs in rows:
            head.weight[row] = known.weight[theirs]
            head.bias[row] = known.bias[theirs]
    return [name for name in info.classes if name not in weights.info.classes]


def _class_head(network: Network) -> nn.Linear:
    """Find the layer that gives the class logits."""
    head = network.get_submodule("classify")
    last = head[-1] if isinstance(head, nn.Sequential) else head
    assert isinstance(last, nn.Linear)
    return last
