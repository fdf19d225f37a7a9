"""How a sensor is carried along a route: by hand, or by a robot that rocks a little."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation

from mcpseg_cli.config import RaytraceSettings

# by hand: standard deviations, and over how many scans it changes
_SWEEP = (50.0, 4.0)  # degrees to both sides of the way
_NOD = (14.0, 5.0)  # degrees up and down ...
_LOOKS_DOWN_DEG = 12.0  # ... from a little down
_ROLL = (3.0, 4.0)  # degrees
_RISE = (0.06, 12.0)  # metres up and down, beside steps of ...
_BOB = (0.015, 0.5)  # ... metres
_SWAY = (0.03, 3.0)  # metres to the sides, at most twice that
_BEARERS = 0.12  # metres, each way, from the least tall to the tallest that carries it
_MOST_RISE = 0.25  # metres from the middle height
_TURN_SCANS = 3.0  # over which a person turns where the way does
_PITCHES = (-55.0, 35.0)  # degrees
_ROCK = (0.6, 4.0)  # degrees that a robot rocks, both ways

# what an odometry does not know: standard deviations; drift changes over so many scans
_DRIFT_SCANS = 10
_DRIFT = (0.01, 0.3)  # metres, degrees
_SHAKE = (0.003, 0.1)  # metres, degrees; of every scan anew
_DRIFTS, _SHAKES, _CARRIED = 1, 2, 5  # what else is drawn by the seed


def carry(poses: NDArray[np.float64], settings: RaytraceSettings) -> NDArray[np.float64]:
    """Say where a sensor is on a route, as it is carried.

    Args:
        poses: (S, 4, 4) float64 of the route, sensor to map; x is the way, z is up.
        settings: Sensor, height and seed.

    Returns:
        (S, 4, 4) float64: x is where the sensor looks, z its upper side. A new array, but for the
        sphere, whose poses are those of the route.
    """
    if settings.sensor == "sphere":
        return poses
    rng = np.random.default_rng((settings.seed, len(poses), _CARRIED))
    if settings.sensor == "depth-camera":
        return _by_hand(poses, rng)

    # a robot on a floor that is not quite even
    rock = np.stack([_wander(rng, len(poses), *_ROCK) for _ in range(2)], axis=1)
    carried = poses.copy()
    carried[:, :3, :3] @= Rotation.from_euler("yx", rock, degrees=True).as_matrix()
    return carried


def _by_hand(poses: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Carry a camera as a person does who looks around."""
    num = len(poses)

    # turned along the way and to its sides, nodding
    heading = np.unwrap(np.arctan2(poses[:, 1, 0], poses[:, 0, 0]))
    heading = np.degrees(gaussian_filter1d(heading, _TURN_SCANS, mode="nearest"))
    yaw = heading + _wander(rng, num, *_SWEEP)
    pitch = np.clip(_wander(rng, num, *_NOD) - _LOOKS_DOWN_DEG, *_PITCHES)
    angles = np.stack([yaw, -pitch, _wander(rng, num, *_ROLL)], axis=1)

    # in front of a chest, at each step a little higher and lower
    carried = poses.copy()
    carried[:, :3, :3] = Rotation.from_euler("ZYX", angles, degrees=True).as_matrix()
    for axis in (0, 1):
        sway = _wander(rng, num, *_SWAY)
        carried[:, axis, 3] += np.clip(sway, -2 * _SWAY[0], 2 * _SWAY[0])
    rise = rng.uniform(-_BEARERS, _BEARERS) + _wander(rng, num, *_RISE) + _wander(rng, num, *_BOB)
    carried[:, 2, 3] += np.clip(rise, -_MOST_RISE, _MOST_RISE)
    return carried


def _wander(
    rng: np.random.Generator, num: int, deviation: float, scans: float
) -> NDArray[np.float64]:
    """Draw (num,) values of this standard deviation that change smoothly over so many scans."""
    margin = int(4 * scans) + 1
    values = gaussian_filter1d(rng.normal(size=num + 2 * margin), scans)[margin : margin + num]
    wandering: NDArray[np.float64] = deviation * np.sqrt(2 * np.sqrt(np.pi) * scans) * values
    return wandering


def pose_error(seed: int, number: int) -> NDArray[np.float64]:
    """Draw how far a camera is from where its odometry says it is: a drift, and a shake.

    Args:
        seed: Seed of the run.
        number: Number of the scan; scans near each other in number have nearly the same drift.

    Returns:
        (4, 4) float64, from the sensor as it is to the sensor as it is said to be.
    """
    # between two drifts, and a shake of this scan alone
    knot, part = divmod(number, _DRIFT_SCANS)
    share = part / _DRIFT_SCANS
    before, after = (_draw(seed, knot + k, _DRIFTS) for k in (0, 1))
    drift = (1 - share) * before + share * after
    drift /= np.hypot(1 - share, share)
    shake = _draw(seed, number, _SHAKES)

    error = np.eye(4)
    error[:3, 3] = _DRIFT[0] * drift[:3] + _SHAKE[0] * shake[:3]
    turn = _DRIFT[1] * drift[3:] + _SHAKE[1] * shake[3:]
    error[:3, :3] = Rotation.from_rotvec(turn, degrees=True).as_matrix()
    return error


def _draw(seed: int, number: int, purpose: int) -> NDArray[np.float64]:
    return np.random.default_rng((seed, number, purpose)).normal(size=6)
