"""The methods that tables I and II compare, by name."""

from __future__ import annotations

from mcpseg_cli.config import Method, Precision, RegionGrowingSettings, SegmentSettings
from mcpseg_cli.errors import WeightsError
from mcpseg_cli.incremental.classification import NetworkLabeller
from mcpseg_cli.incremental.region_growing import RegionGrower
from mcpseg_cli.networks.weights import DEFAULT_WEIGHTS, Weights, find_weights, load_weights


def open_method(method: Method | None, weights: str | None) -> Weights | RegionGrowingSettings:
    """Load what labels.

    Args:
        method: None: whatever network the weights are of.
        weights: A .safetensors file or the name of bundled weights; None: those bundled for the
            method, of its name.

    Raises:
        WeightsError: There are none, they are damaged, or of another network than the method.
    """
    if method == "region-growing":
        if weights is not None:
            raise WeightsError(
                weights, "weights for region growing", "none, it learns nothing", "leave -w out"
            )
        return RegionGrowingSettings()
    if method is None:
        return load_weights(find_weights(weights or DEFAULT_WEIGHTS))
    try:
        loaded = load_weights(find_weights(weights or method))
    except WeightsError as error:
        if weights is not None:
            raise
        remedy = f"train them with 'mcpseg train --net {method}'"
        found = "no bundled weights"
        raise WeightsError(
            f"--method {method}", found, "weights of this network with -w", remedy
        ) from error
    if loaded.info.architecture != method:
        remedy = "give other weights, or leave --method out"
        raise WeightsError(
            loaded.name, f"weights of {loaded.info.architecture}", f"weights of {method}", remedy
        )
    return loaded


Labeller = NetworkLabeller | RegionGrower


def make_labeller(
    method: Weights | RegionGrowingSettings,
    settings: SegmentSettings,
    precision: Precision,
    device: str,
) -> Labeller:
    """Make what labels voxels: a network, or region growing.

    Raises:
        McpsegError: The device does not exist here.
    """
    if isinstance(method, RegionGrowingSettings):
        return RegionGrower(method, settings)
    return NetworkLabeller(method, settings, precision=precision, device=device)
