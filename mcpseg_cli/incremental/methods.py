"""The methods that tables I and II compare: what each must do, and how to open one by name."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from mcpseg_cli.choices import Method, Precision
from mcpseg_cli.config import RegionGrowingSettings, SegmentSettings
from mcpseg_cli.errors import McpsegError, WeightsError
from mcpseg_cli.incremental.column import IN_MEMORY, Memory
from mcpseg_cli.incremental.map_labels import AllLooks, FirstLooks
from mcpseg_cli.incremental.network_method import NetworkMethod
from mcpseg_cli.incremental.region_growing import RegionGrower
from mcpseg_cli.incremental.voxel_map import VoxelMap
from mcpseg_cli.networks.description import (
    DEFAULT_WEIGHTS,
    DescribedWeights,
    describe_weights,
    find_weights,
)

if TYPE_CHECKING:
    from mcpseg_cli.networks.weights import Weights


class SegmentationMethod(Protocol):
    """What labels voxels: what the segmenter, its run and its record ask of every method.

    Attributes:
        name: What ``--method`` calls it.
        classes: Class table; empty for a method that tells objects only.
        settings: Complete: what was not given is the method's own.
        similarity: Cosine similarity above which neighbours are connected (III-C).
        precision: ``bf16`` or ``fp32``.
    """

    name: str
    classes: tuple[str, ...]
    settings: SegmentSettings
    similarity: float
    precision: Precision

    @property
    def weights(self) -> Weights | DescribedWeights | None:
        """The weights it labels with; None for a method that learns nothing."""

    def configuration(self) -> dict[str, object]:
        """Record what decides the labels beside ``settings`` and ``precision``, as JSON has it."""

    def partners(
        self,
        voxel_map: VoxelMap,
        new: NDArray[np.int32],
        embedding: NDArray[np.int16],
        known: NDArray[np.int16],
    ) -> NDArray[np.int32]:
        """Give the neighbours that new voxels may connect to (III-C).

        Args:
            voxel_map: The map.
            new: (M,) int32 the new voxels, the map's last.
            embedding: (M, E) int16 of the new voxels.
            known: (V - M, E) int16 of those before.

        Returns:
            (M, 26) int32 voxel ids, -1 for none.
        """


AnyMethod = NetworkMethod | RegionGrower


def open_method(
    method: Method | None, weights: str | None
) -> DescribedWeights | RegionGrowingSettings:
    """Find what labels, and read what weights say of themselves.

    Args:
        method: None: whatever network the weights are of.
        weights: A .safetensors file or the name of bundled weights; None: those bundled for the
            method, of its name.

    Raises:
        WeightsError: There are none, they are damaged, or of another network than the method.
    """
    if method == "region-growing":
        if weights is not None:
            found, expected = "weights for region growing", "none, it learns nothing"
            raise WeightsError(weights, found, expected, "leave -w out")
        return RegionGrowingSettings()

    # whatever network the weights are of
    if method is None:
        return describe_weights(find_weights(weights or DEFAULT_WEIGHTS))

    # this network, and no other
    try:
        described = describe_weights(find_weights(weights or method))
    except WeightsError as error:
        if weights is not None:
            raise
        source, expected = f"--method {method}", "weights of this network with -w"
        remedy = f"train them with 'mcpseg train --net {method}'"
        raise WeightsError(source, "no bundled weights", expected, remedy) from error
    if described.info.architecture != method:
        found = f"weights of {described.info.architecture}"
        remedy = "give other weights, or leave --method out"
        raise WeightsError(described.name, found, f"weights of {method}", remedy)
    return described


def make_labels(method: AnyMethod, memory: Memory = IN_MEMORY) -> FirstLooks:
    """Make what keeps the labels of a map: of first looks, as in the paper, or of all.

    Raises:
        McpsegError: The method tells no classes, which looks could agree on.
    """
    labelling = method.settings.labelling
    if isinstance(method, NetworkMethod) and method.sees_windows:
        only_first = labelling == "first"
        return AllLooks(method, len(method.classes), only_first=only_first, memory=memory)
    if labelling != "fused":
        return FirstLooks(method, len(method.classes), memory=memory)
    if not isinstance(method, NetworkMethod):
        raise McpsegError(
            f"--labelling fused: {method.name} tells no classes; expected a network; leave it out"
        )
    return AllLooks(method, len(method.classes), memory=memory)


def make_method(
    method: Weights | DescribedWeights | RegionGrowingSettings,
    settings: SegmentSettings,
    precision: Precision,
    device: str,
) -> AnyMethod:
    """Make what labels: a network, or region growing; say which looks count for it.

    Raises:
        McpsegError: The device does not exist here.
    """
    sees_windows = False
    if not isinstance(method, RegionGrowingSettings):
        sees_windows = method.info.traits.sees_windows
    own = {
        "labelling": settings.labelling or ("fused" if sees_windows else "first"),
        "clustering": settings.clustering or ("graph" if sees_windows else "paper"),
    }
    settings = settings.model_copy(update=own)

    if isinstance(method, RegionGrowingSettings):
        if device != "cpu":  # nothing runs there, but a name that is wrong is told
            from mcpseg_cli.networks.device import find_device

            find_device(device)
        return RegionGrower(method, settings)
    return NetworkMethod(method, settings, precision=precision, device=device)
