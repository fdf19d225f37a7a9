"""The records that travel through the pipeline: one registered scan, and labels of its points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

GREY = 128
"""Colour of a scan that has none: the network's colour inputs are then (almost) zero."""


@dataclass(frozen=True)
class Scan:
    """One sweep of the sensor with the pose it was taken from.

    Attributes:
        xyz: (N, 3) float32, metres, map frame.
        rgb: (N, 3) uint8, or None for a scan without colour.
        pose: (4, 4) float64, sensor to map; its last column is where the robot stands.
        name: What the scan is called in messages and reports.
    """

    xyz: NDArray[np.float32]
    rgb: NDArray[np.uint8] | None
    pose: NDArray[np.float64]
    name: str = "scan"

    def __post_init__(self) -> None:
        if self.xyz.ndim != 2 or self.xyz.shape[1] != 3 or self.xyz.dtype != np.float32:
            raise ValueError(f"xyz is {self.xyz.dtype} {self.xyz.shape}, expected float32 (N, 3)")
        rgb, shape = self.rgb, self.xyz.shape
        if rgb is not None and (rgb.shape != shape or rgb.dtype != np.uint8):
            raise ValueError(f"rgb is {rgb.dtype} {rgb.shape}, expected uint8 {shape}")
        if self.pose.shape != (4, 4):
            raise ValueError(f"pose is {self.pose.shape}, expected (4, 4)")

    @property
    def position(self) -> NDArray[np.float64]:
        """(3,) float64: the robot's position, metres, map frame."""
        return self.pose[:3, 3]


def to_map_frame(
    xyz_sensor: NDArray[np.floating], pose: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Move points from the sensor's frame into the map's.

    Args:
        xyz_sensor: (N, 3), metres, sensor frame.
        pose: (4, 4) float64, sensor to map.

    Returns:
        (N, 3) float32, metres, map frame; computed in float64, a new array.
    """
    return (xyz_sensor.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]).astype(np.float32)


def near_robot(scan: Scan, local_range: float) -> NDArray[np.bool_]:
    """Mark the points within range of the robot, horizontally (III-B); (N,) bool."""
    offset = scan.xyz[:, :2] - scan.position[:2].astype(np.float32)
    near: NDArray[np.bool_] = np.einsum("na,na->n", offset, offset) < np.float32(local_range) ** 2
    return near


def colour_of(scan: Scan, near: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return the (M, 3) uint8 colours of the points marked, grey where the scan has none."""
    if scan.rgb is None:
        return np.full((int(near.sum()), 3), GREY, np.uint8)
    return scan.rgb[near]


@dataclass(frozen=True)
class Labels:
    """Labels of the points of one cloud.

    Attributes:
        semantic: (N,) uint8 class index, 255 unknown.
        instance: (N,) int32 object id, 0 none.
        confidence: (N,) float32 in 0-1.
        classes: Class names that ``semantic`` indexes.
    """

    semantic: NDArray[np.uint8]
    instance: NDArray[np.int32]
    confidence: NDArray[np.float32]
    classes: tuple[str, ...] = ()
