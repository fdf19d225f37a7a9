"""Fixtures of the tests of networks."""

import pytest
import torch

from mcpseg_cli.classes import S3DIS_CLASSES
from mcpseg_cli.networks.description import WeightsInfo
from mcpseg_cli.networks.unet import UNet
from mcpseg_cli.networks.weights import build_network


@pytest.fixture(scope="session")
def unet() -> UNet:
    """Random parameters, and norms that are not the identity; not to be changed."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(5)
        network = build_network(WeightsInfo(architecture="unet", classes=S3DIS_CLASSES)).eval()
        for module in network.modules():
            if isinstance(module, torch.nn.BatchNorm1d):
                torch.nn.init.uniform_(module.weight, 0.5, 1.5)
                torch.nn.init.normal_(module.bias, std=0.2)
                module.running_mean.normal_(std=0.2)
                module.running_var.uniform_(0.5, 2)
    return network
