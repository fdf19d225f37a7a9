"""Augmentation: the points of a training batch changed as other robots would see them.

Another robot, sensor, room or light changes them so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import cos, pi, radians, sin

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mcpseg_cli.config import AugmentSettings
from mcpseg_cli.scan import GREY

_NEAREST_CUT, _FARTHEST_CUT = 0.0, 1.0  # metres from the robot to where a half-space is cut away
_NARROWEST, _WIDEST = 30.0, 90.0  # degrees to each side that a sensor with a sector of view sees
_LUMINANCE = np.array([0.299, 0.587, 0.114], np.float32)  # ITU-R BT.601


@dataclass(frozen=True)
class Scene:
    """The points of a batch, centres and context alike, each once.

    Attributes:
        xyz: (L, 3) float32, metres, map frame.
        rgb: (L, 3) float32 in 0-255.
        position: (3,) float64 robot position, metres, map frame.
        floor: Height of the floor, metres, map frame.
    """

    xyz: NDArray[np.float32]
    rgb: NDArray[np.float32]
    position: NDArray[np.float64]
    floor: float


@dataclass(frozen=True)
class Cut:
    """What a partial view leaves out, seen from above.

    Attributes:
        direction: (2,) float64 unit vector from the robot.
        distance: Metres along it beyond which everything is gone; None for a sector.
        half_width: Degrees to both sides of it that a sector keeps.
    """

    direction: NDArray[np.float64]
    distance: float | None
    half_width: float = 180.0

    def removes(self, xyz: NDArray[np.float32], position: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Mark the points left out.

        Args:
            xyz: (L, 3) float32, metres, map frame.
            position: (3,) float64 robot position, metres, map frame.

        Returns:
            (L,) bool.
        """
        offset = xyz[:, :2] - position[:2]
        along = offset @ self.direction
        gone: NDArray[np.bool_]
        if self.distance is not None:
            gone = along > self.distance
        else:
            gone = along < np.hypot(offset[:, 0], offset[:, 1]) * cos(radians(self.half_width))
        return gone


def draw_cut(settings: AugmentSettings, rng: np.random.Generator) -> Cut | None:
    """Decide whether a view is partial, and how: a half-space or all but a sector is gone."""
    if rng.random() >= settings.partial_view:
        return None
    angle = rng.uniform(-np.pi, np.pi)
    direction = np.array([cos(angle), sin(angle)])
    if rng.random() < 0.5:
        return Cut(direction, rng.uniform(_NEAREST_CUT, _FARTHEST_CUT))
    return Cut(direction, None, rng.uniform(_NARROWEST, _WIDEST))


def draw_thinning(settings: AugmentSettings, rng: np.random.Generator) -> float:
    """Decide which share of the voxels to drop."""
    return rng.uniform(0.0, settings.thinning_share) if rng.random() < settings.thinning else 0.0


def augment(scene: Scene, settings: AugmentSettings, rng: np.random.Generator) -> Scene:
    """Change places and colours of a scene; its arrays may be overwritten."""
    return change_colours(change_places(scene, settings, rng), settings, rng)


def change_places(scene: Scene, settings: AugmentSettings, rng: np.random.Generator) -> Scene:
    """Turn, mirror and scale around the robot's foot; displace points, the robot and the floor.

    Args:
        scene: Points; not changed.
        settings: How.
        rng: Source of every choice.

    Returns:
        A new scene; what is off stays bit for bit.
    """
    # turn, mirror, scale
    angle = radians(rng.uniform(-1, 1) * settings.turn_deg)
    if settings.right_angle and rng.random() < settings.right_angle:
        angle = round(angle / (pi / 2)) * (pi / 2)
    side = -1.0 if rng.random() < settings.mirror else 1.0
    scale = 1 + rng.uniform(-1, 1) * settings.scale
    height = scale * (1 + rng.uniform(-1, 1) * settings.height_scale)
    turn = np.array([[cos(angle), -sin(angle), 0], [sin(angle), cos(angle), 0], [0, 0, 1]])
    linear = turn @ np.diag([scale, side * scale, height])
    xyz = scene.xyz
    if not np.array_equal(linear, np.eye(3)):
        foot = np.array([*scene.position[:2], scene.floor])
        xyz = ((xyz - foot) @ linear.T + foot).astype(np.float32)

    # scatter, and errors about the robot's place and the floor
    if settings.jitter:
        xyz = xyz + _noise(xyz.shape, settings.jitter, rng)
    position = scene.position.copy()
    position[:2] += rng.uniform(-1, 1, 2) * settings.robot_offset
    floor = scene.floor + rng.standard_normal() * settings.floor_error
    if rng.random() < settings.floor_lost:
        floor += rng.choice([-1, 1]) * rng.uniform(1 / 3, 1) * settings.floor_lost_by
    return replace(scene, xyz=xyz, position=position, floor=float(floor))


def change_colours(scene: Scene, settings: AugmentSettings, rng: np.random.Generator) -> Scene:
    """Change light, camera and sensor noise, or take the colours away.

    Args:
        scene: Points; colours are overwritten.
        settings: How.
        rng: Source of every choice.

    Returns:
        A scene with colours in 0-255; what is off stays bit for bit.
    """
    rgb = scene.rgb
    if rng.random() < settings.grey:
        rgb[:] = GREY
        return scene

    # light, then camera
    _change_light(scene, settings, rng)
    contrast = 1 + rng.uniform(-1, 1) * settings.contrast
    offset = rng.uniform(-1, 1) * settings.offset
    if contrast != 1 or offset:
        mean = rgb.mean() if rgb.size else 0.0
        rgb *= np.float32(contrast)
        rgb += np.float32((1 - contrast) * mean + offset)
    np.clip(rgb, 0, 255, out=rgb)
    if settings.gamma:
        exponent = np.exp(rng.uniform(-1, 1) * settings.gamma)
        rgb[:] = np.float32(255) * (rgb / np.float32(255)) ** np.float32(exponent)
    if settings.hue_deg:
        rgb[:] = rgb @ hue_turn(rng.uniform(-1, 1) * settings.hue_deg).T

    # noise of the sensor
    if settings.colour_noise:
        rgb += _noise(rgb.shape, settings.colour_noise, rng)
    if rng.random() < settings.luminance:
        rgb[:] = (rgb @ _LUMINANCE)[:, None]
    np.clip(rgb, 0, 255, out=rgb)
    return scene


def _change_light(scene: Scene, settings: AugmentSettings, rng: np.random.Generator) -> None:
    """Change exposure and white balance, and let the brightness fall off to one side."""
    gain = (1 + rng.uniform(-1, 1) * settings.gain) * (
        1 + rng.uniform(-1, 1, 3) * settings.channel_gain
    )
    scene.rgb[:] *= gain.astype(np.float32)
    if settings.light_gradient:
        angle, slope = rng.uniform(-np.pi, np.pi), rng.uniform(0, settings.light_gradient)
        along = (scene.xyz[:, :2] - scene.position[:2]) @ np.array([cos(angle), sin(angle)])
        scene.rgb[:] *= np.exp(slope * along).astype(np.float32)[:, None]


def hue_turn(angle_deg: float) -> NDArray[np.float32]:
    """Return the (3, 3) float32 matrix that turns colours about the grey axis; greys stay.

    By Rodrigues' formula.
    """
    angle = radians(angle_deg)
    across = np.array([[0, -1, 1], [1, 0, -1], [-1, 1, 0]]) / np.sqrt(3)
    turn: NDArray[np.float32] = (
        cos(angle) * np.eye(3) + (1 - cos(angle)) / 3 + sin(angle) * across
    ).astype(np.float32)
    return turn


def _noise(shape: tuple[int, ...], largest: float, rng: np.random.Generator) -> NDArray[np.float32]:
    """Draw normal noise whose standard deviation is itself drawn, up to ``largest``."""
    return rng.standard_normal(shape, np.float32) * np.float32(rng.uniform(0, largest))


def drop_context(
    context: NDArray[np.int32], settings: AugmentSettings, rng: np.random.Generator
) -> NDArray[np.int32]:
    """Perhaps replace a part of each point's context by repeating the rest.

    Args:
        context: (N, K) int32, each row in random order, so that its first columns are a random
            part.
        settings: How often and how much.
        rng: Source of the choice.

    Returns:
        (N, K) int32, new, or ``context`` itself.
    """
    if rng.random() >= settings.context_dropout:
        return context
    num_context = context.shape[1]
    kept = max(round(num_context * (1 - rng.uniform(0, settings.context_dropout_share))), 1)
    return context[:, np.arange(num_context) % kept]


@njit(cache=True, nogil=True)
def replace_gone(
    context: NDArray[np.int32], centre: NDArray[np.int32], gone: NDArray[np.bool_]
) -> None:
    """Replace context points that are gone by repeating the others of their row.

    Where none is left, the centre is repeated.

    Args:
        context: (N, K) int32 rows of the scene; overwritten.
        centre: (N,) int32 rows of the scene.
        gone: (L,) bool.
    """
    kept = np.empty(context.shape[1], np.int32)
    for i in range(context.shape[0]):
        size = 0
        for k in range(context.shape[1]):
            kept[size] = context[i, k]
            size += not gone[context[i, k]]
        if size == context.shape[1]:
            continue
        if size == 0:
            kept[0], size = centre[i], 1

        # those that are left take turns
        replaced = 0
        for k in range(context.shape[1]):
            if gone[context[i, k]]:
                context[i, k] = kept[replaced % size]
                replaced += 1
